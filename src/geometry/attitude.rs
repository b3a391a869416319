//! Attitudes as unit quaternions, with the frame in the type, and the two orders of angles that describe them.
//!
//! A quaternion turns the body's axes (forward, right, down) into the frame's, in Hamilton's convention with w first,
//! as MAVLink sends it.

use std::marker::PhantomData;

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use super::angle::Angle;

/// North, East, Down.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EarthFrame {}

/// Level, x along the vehicle's heading, z down: it turns with the vehicle but does not tilt with it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum VehicleFrame {}

/// How a body is turned in frame `F`. Opposite quaternions are the same attitude and compare equal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Attitude<F> {
    rotation: UnitQuaternion<f64>,
    frame: PhantomData<F>,
}

/// Angles applied in the order yaw, roll, pitch, as the axes of a gimbal are nested.
///
/// Pitch has the full turn and yaw stays defined when the camera looks straight down; only a roll of ±90° is singular.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct GimbalAngles {
    pub roll: Angle,
    pub pitch: Angle,
    pub yaw: Angle,
}

/// Angles applied in the order yaw, pitch, roll, as aviation counts them; a pitch of ±90° is singular.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AircraftAngles {
    pub roll: Angle,
    pub pitch: Angle,
    pub yaw: Angle,
}

/// Why four received numbers are no attitude.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum QuaternionError {
    #[error("some but not all elements are NaN")]
    PartlyNan,
    #[error("an element is infinite")]
    Infinite,
    /// What a sender leaves that never filled the field in; it is not the identity.
    #[error("all elements are zero")]
    Zero,
    #[error("the squared norm is {norm_squared}, not 1")]
    NotUnit { norm_squared: f64 },
}

/// Below this the axis order at hand is singular and only a combination of yaw and the other outer angle is defined.
const SINGULAR: f64 = 1e-6;

impl<F> Attitude<F> {
    /// Level, and x along the frame's x.
    pub fn identity() -> Self {
        Self::from_rotation(UnitQuaternion::identity())
    }

    /// Reads a received quaternion (w, x, y, z). Four NaN mean that the sender states no attitude: `Ok(None)`.
    ///
    /// A squared norm from 0.9 to 1.1 is rounding and is normalised.
    pub fn from_wxyz(wxyz: [f32; 4]) -> Result<Option<Self>, QuaternionError> {
        match wxyz.iter().filter(|element| element.is_nan()).count() {
            0 => {}
            4 => return Ok(None),
            _ => return Err(QuaternionError::PartlyNan),
        }
        if wxyz.iter().any(|element| element.is_infinite()) {
            return Err(QuaternionError::Infinite);
        }
        if wxyz == [0.0; 4] {
            return Err(QuaternionError::Zero);
        }
        let [w, x, y, z] = wxyz.map(f64::from);
        let quaternion = Quaternion::new(w, x, y, z);
        let norm_squared = quaternion.norm_squared();
        if !(0.9..=1.1).contains(&norm_squared) {
            return Err(QuaternionError::NotUnit { norm_squared });
        }
        Ok(Some(Self::from_rotation(UnitQuaternion::new_normalize(quaternion))))
    }

    /// The quaternion (w, x, y, z) as it is sent, with w ≥ 0.
    pub fn to_wxyz(self) -> [f32; 4] {
        let q = self.rotation.quaternion();
        let sign = if q.w < 0.0 { -1.0 } else { 1.0 };
        // Adding zero turns −0 into 0, which a receiver's truncation of zero bytes knows.
        [q.w, q.i, q.j, q.k].map(|element| (sign * element) as f32 + 0.0)
    }

    pub fn from_gimbal_angles(angles: GimbalAngles) -> Self {
        Self::from_rotation(about_z(angles.yaw) * about_x(angles.roll) * about_y(angles.pitch))
    }

    /// Roll within ±90°, pitch and yaw within (−180°, 180°]. At a roll of ±90° pitch reads zero and yaw takes it over.
    pub fn gimbal_angles(self) -> GimbalAngles {
        let m = self.elements();
        let cos_roll = m.r01.hypot(m.r11);
        let roll = Angle::from_radians(m.r21.atan2(cos_roll));
        if cos_roll < SINGULAR {
            return GimbalAngles { roll, pitch: Angle::ZERO, yaw: self.twist_about_z() };
        }
        GimbalAngles {
            roll,
            pitch: Angle::from_radians((-m.r20).atan2(m.r22)).wrapped(),
            yaw: Angle::from_radians((-m.r01).atan2(m.r11)).wrapped(),
        }
    }

    pub fn from_aircraft_angles(angles: AircraftAngles) -> Self {
        Self::from_rotation(about_z(angles.yaw) * about_y(angles.pitch) * about_x(angles.roll))
    }

    /// Pitch within ±90°, roll and yaw within (−180°, 180°]. At a pitch of ±90° roll reads zero and yaw takes it over.
    pub fn aircraft_angles(self) -> AircraftAngles {
        let m = self.elements();
        let cos_pitch = m.r00.hypot(m.r10);
        let pitch = Angle::from_radians((-m.r20).atan2(cos_pitch));
        if cos_pitch < SINGULAR {
            return AircraftAngles { roll: Angle::ZERO, pitch, yaw: self.twist_about_z() };
        }
        AircraftAngles {
            roll: Angle::from_radians(m.r21.atan2(m.r22)).wrapped(),
            pitch,
            yaw: Angle::from_radians(m.r10.atan2(m.r00)).wrapped(),
        }
    }

    /// The angle of the one turn that leads from here to `other`, from 0° to 180°.
    pub fn angle_to(self, other: Self) -> Angle {
        Angle::from_radians(self.rotation.angle_to(&other.rotation))
    }

    pub(super) fn from_rotation(rotation: UnitQuaternion<f64>) -> Self {
        Self { rotation, frame: PhantomData }
    }

    pub(super) fn rotation(self) -> UnitQuaternion<f64> {
        self.rotation
    }

    /// What is left of yaw where the other outer axis coincides with it.
    fn twist_about_z(&self) -> Angle {
        Angle::from_radians(2.0 * self.rotation.k.atan2(self.rotation.w)).wrapped()
    }

    fn elements(&self) -> Elements {
        let q = self.rotation.quaternion();
        let (w, x, y, z) = (q.w, q.i, q.j, q.k);
        Elements {
            r00: 1.0 - 2.0 * (y * y + z * z),
            r10: 2.0 * (x * y + w * z),
            r01: 2.0 * (x * y - w * z),
            r11: 1.0 - 2.0 * (x * x + z * z),
            r20: 2.0 * (x * z - w * y),
            r21: 2.0 * (y * z + w * x),
            r22: 1.0 - 2.0 * (x * x + y * y),
        }
    }
}

impl Attitude<VehicleFrame> {
    /// The same attitude seen from North, given the vehicle's heading.
    pub fn to_earth(self, heading: Angle) -> Attitude<EarthFrame> {
        Attitude::from_rotation(about_z(heading) * self.rotation)
    }
}

impl Attitude<EarthFrame> {
    /// The same attitude seen from the vehicle, given the vehicle's heading.
    pub fn to_vehicle(self, heading: Angle) -> Attitude<VehicleFrame> {
        Attitude::from_rotation(about_z(-heading) * self.rotation)
    }

    /// Where an aircraft of this attitude is heading, from North, within (−180°, 180°].
    pub fn heading(self) -> Angle {
        self.aircraft_angles().yaw
    }
}

/// The elements of the rotation matrix that the angles are read from, row before column.
struct Elements {
    r00: f64,
    r10: f64,
    r01: f64,
    r11: f64,
    r20: f64,
    r21: f64,
    r22: f64,
}

fn about_x(angle: Angle) -> UnitQuaternion<f64> {
    UnitQuaternion::from_axis_angle(&Vector3::x_axis(), angle.radians())
}

fn about_y(angle: Angle) -> UnitQuaternion<f64> {
    UnitQuaternion::from_axis_angle(&Vector3::y_axis(), angle.radians())
}

fn about_z(angle: Angle) -> UnitQuaternion<f64> {
    UnitQuaternion::from_axis_angle(&Vector3::z_axis(), angle.radians())
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{FRAC_PI_2, PI};

    use proptest::prelude::*;

    use super::*;

    fn earth(wxyz: [f32; 4]) -> Attitude<EarthFrame> {
        Attitude::from_wxyz(wxyz).expect("it is well formed").expect("it is set")
    }

    fn gimbal(roll: f64, pitch: f64, yaw: f64) -> GimbalAngles {
        GimbalAngles {
            roll: Angle::from_degrees(roll),
            pitch: Angle::from_degrees(pitch),
            yaw: Angle::from_degrees(yaw),
        }
    }

    fn assert_wxyz<F>(attitude: Attitude<F>, expected: [f32; 4]) {
        let wxyz = attitude.to_wxyz();
        let difference = wxyz.iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(difference < 2e-7, "{wxyz:?} is not {expected:?}");
    }

    fn assert_degrees(angle: Angle, expected: f64) {
        assert!((angle.degrees() - expected).abs() < 0.01, "{}° is not {expected}°", angle.degrees());
    }

    /// "Example θ = −0.5, ψ = 0.3 rad → [0.9580326, 0.0369716, −0.2446259, 0.1447925]." (protocol notes 3.7)
    #[test]
    fn pitch_and_yaw_become_the_documented_quaternion() {
        let attitude = Attitude::<EarthFrame>::from_gimbal_angles(GimbalAngles {
            roll: Angle::ZERO,
            pitch: Angle::from_radians(-0.5),
            yaw: Angle::from_radians(0.3),
        });

        assert_wxyz(attitude, [0.958_032_6, 0.036_971_6, -0.244_625_9, 0.144_792_5]);
    }

    /// Protocol checklist 112: "When q is pitch −90°, yaw 60° the reported yaw is 60° ± 0.01°, not 26.6°."
    #[test]
    fn yaw_is_right_when_the_camera_looks_straight_down() {
        let angles = earth([0.612_372_4, 0.353_553_4, -0.612_372_4, 0.353_553_4]).gimbal_angles();

        assert_degrees(angles.roll, 0.0);
        assert_degrees(angles.pitch, -90.0);
        assert_degrees(angles.yaw, 60.0);
    }

    /// "Example δ = 100°, q_vehicle (pitch −20°, yaw 30°) = … → q_earth = … (yaw 130°)." (protocol notes 3.7)
    #[test]
    fn the_heading_leads_from_the_vehicle_frame_to_the_earth_frame_and_back() {
        let heading = Angle::from_degrees(100.0);
        let in_vehicle = Attitude::<VehicleFrame>::from_gimbal_angles(gimbal(0.0, -20.0, 30.0));
        assert_wxyz(in_vehicle, [0.951_251_2, 0.044_943_5, -0.167_731_3, 0.254_887]);

        let in_earth = in_vehicle.to_earth(heading);

        assert_wxyz(in_earth, [0.416_197_7, 0.157_378_7, -0.073_386_9, 0.892_538_9]);
        assert_degrees(in_earth.gimbal_angles().yaw, 130.0);
        assert_degrees(in_earth.to_vehicle(heading).angle_to(in_vehicle), 0.0);
    }

    /// "q_earth = (roll 0, pitch −30, yaw 100), delta_yaw 70° → vehicle-frame (0, −30, 30)." (gimbal notes 0.2)
    #[test]
    fn only_yaw_changes_between_the_frames() {
        let in_earth = Attitude::<EarthFrame>::from_gimbal_angles(gimbal(0.0, -30.0, 100.0));

        let angles = in_earth.to_vehicle(Angle::from_degrees(70.0)).gimbal_angles();

        assert_degrees(angles.roll, 0.0);
        assert_degrees(angles.pitch, -30.0);
        assert_degrees(angles.yaw, 30.0);
    }

    /// "All four NaN → no angle. Some NaN → malformed. Any Inf → malformed. |q|² outside 0.9..1.1 → malformed; otherwise
    /// normalise. All zeros is malformed, never identity." (protocol notes 3.7)
    #[test]
    #[rustfmt::skip]
    fn a_received_quaternion_is_checked() {
        const NAN: f32 = f32::NAN;
        const INF: f32 = f32::INFINITY;
        let read = Attitude::<EarthFrame>::from_wxyz;

        assert_eq!(read([NAN; 4]), Ok(None));
        for (wxyz,                       expected) in [
            ([1.0, NAN, NAN, NAN],       QuaternionError::PartlyNan),
            ([NAN, 0.0, 0.0, 0.0],       QuaternionError::PartlyNan),
            ([NAN, INF, 0.0, 0.0],       QuaternionError::PartlyNan),
            ([INF, 0.0, 0.0, 0.0],       QuaternionError::Infinite),
            ([1.0, 0.0, 0.0, -INF],      QuaternionError::Infinite),
            ([0.0, 0.0, 0.0, 0.0],       QuaternionError::Zero),
            ([0.0, -0.0, 0.0, 0.0],      QuaternionError::Zero),
            ([0.5, 0.5, 0.0, 0.0],       QuaternionError::NotUnit { norm_squared: 0.5 }),
            ([1.0, 1.0, 1.0, 1.0],       QuaternionError::NotUnit { norm_squared: 4.0 }),
        ] {
            assert_eq!(read(wxyz), Err(expected), "{wxyz:?}");
        }
        assert!(matches!(read([f32::MAX; 4]), Err(QuaternionError::NotUnit { .. })));
        assert!(matches!(read([f32::MIN_POSITIVE, 0.0, 0.0, 0.0]), Err(QuaternionError::NotUnit { .. })));
        assert_eq!(read([0.95, 0.0, 0.0, 0.0]), Ok(Some(Attitude::identity())));
        assert_eq!(read([-1.04, 0.0, 0.0, 0.0]), Ok(Some(Attitude::identity())));
    }

    /// "q and −q are the same attitude; choose w ≥ 0 when emitting." (protocol notes 3.7)
    #[test]
    fn the_scalar_part_is_sent_positive_and_zeros_without_a_sign() {
        let sent = earth([-0.8, 0.0, 0.6, 0.0]).to_wxyz();

        assert_eq!(sent.map(f32::to_bits), [0.8_f32, 0.0, -0.6, 0.0].map(f32::to_bits));
    }

    #[test]
    fn an_aircraft_heads_where_its_nose_points_also_when_it_banks() {
        let attitude = Attitude::<EarthFrame>::from_aircraft_angles(AircraftAngles {
            roll: Angle::from_degrees(40.0),
            pitch: Angle::from_degrees(25.0),
            yaw: Angle::from_degrees(-170.0),
        });

        assert_degrees(attitude.heading(), -170.0);
        assert_degrees(attitude.aircraft_angles().roll, 40.0);
        assert_degrees(attitude.aircraft_angles().pitch, 25.0);
    }

    /// A camera pitched beyond straight down keeps its yaw and an upright roll.
    #[test]
    fn gimbal_angles_go_on_beyond_straight_down() {
        let angles = Attitude::<VehicleFrame>::from_gimbal_angles(gimbal(3.0, -100.0, 20.0)).gimbal_angles();

        assert_degrees(angles.roll, 3.0);
        assert_degrees(angles.pitch, -100.0);
        assert_degrees(angles.yaw, 20.0);
    }

    /// Any angle within a turn, with those where the orders of angles become singular among them.
    fn any_angle() -> impl Strategy<Value = Angle> {
        prop_oneof![
            4 => -PI..PI,
            1 => prop::sample::select(vec![0.0, FRAC_PI_2, -FRAC_PI_2, PI, FRAC_PI_2 - 1e-7, 1e-7 - FRAC_PI_2]),
        ]
        .prop_map(Angle::from_radians)
    }

    proptest! {
        #[test]
        fn any_attitude_survives_its_gimbal_angles(roll in any_angle(), pitch in any_angle(), yaw in any_angle()) {
            let attitude = Attitude::<EarthFrame>::from_gimbal_angles(GimbalAngles { roll, pitch, yaw });

            let angles = attitude.gimbal_angles();

            prop_assert!(Attitude::from_gimbal_angles(angles).angle_to(attitude).radians() < 2e-6);
            prop_assert!(angles.roll.abs().radians() <= FRAC_PI_2);
        }

        #[test]
        fn any_attitude_survives_its_aircraft_angles(roll in any_angle(), pitch in any_angle(), yaw in any_angle()) {
            let attitude = Attitude::<EarthFrame>::from_aircraft_angles(AircraftAngles { roll, pitch, yaw });

            let angles = attitude.aircraft_angles();

            prop_assert!(Attitude::from_aircraft_angles(angles).angle_to(attitude).radians() < 2e-6);
            prop_assert!(angles.pitch.abs().radians() <= FRAC_PI_2);
        }

        /// Pitch may be anything, straight down and up included, as long as roll stays off ±90°.
        #[test]
        fn gimbal_angles_come_back_as_they_were(roll in -1.5..1.5_f64, pitch in any_angle(), yaw in any_angle()) {
            let given = GimbalAngles { roll: Angle::from_radians(roll), pitch, yaw };

            let angles = Attitude::<EarthFrame>::from_gimbal_angles(given).gimbal_angles();

            prop_assert!((angles.roll - given.roll).abs().radians() < 1e-9);
            prop_assert!((angles.pitch - given.pitch).wrapped().abs().radians() < 1e-9);
            prop_assert!((angles.yaw - given.yaw).wrapped().abs().radians() < 1e-9);
        }

        #[test]
        fn the_frames_lead_there_and_back(
            roll in any_angle(), pitch in any_angle(), yaw in any_angle(), heading in -10.0..10.0_f64,
        ) {
            let heading = Angle::from_radians(heading);
            let in_earth = Attitude::<EarthFrame>::from_gimbal_angles(GimbalAngles { roll, pitch, yaw });

            let in_vehicle = in_earth.to_vehicle(heading);

            prop_assert!(in_vehicle.to_earth(heading).angle_to(in_earth).radians() < 1e-7);
            let (seen, known) = (in_vehicle.gimbal_angles(), in_earth.gimbal_angles());
            prop_assert!((seen.roll - known.roll).abs().radians() < 1e-6);
            if known.roll.abs().radians() < 1.57 {
                prop_assert!((seen.pitch - known.pitch).wrapped().abs().radians() < 1e-6);
                prop_assert!((seen.yaw + heading - known.yaw).wrapped().abs().radians() < 1e-6);
            }
        }

        /// Single precision costs less than 0.00002°.
        #[test]
        fn an_attitude_survives_the_wire(roll in any_angle(), pitch in any_angle(), yaw in any_angle()) {
            let attitude = Attitude::<EarthFrame>::from_gimbal_angles(GimbalAngles { roll, pitch, yaw });

            let sent = attitude.to_wxyz();

            prop_assert!(sent[0] >= 0.0);
            prop_assert!(earth(sent).angle_to(attitude).degrees() < 2e-5);
        }

        /// Whatever arrives is refused, absent, or a rotation; never NaN.
        #[test]
        fn nothing_received_becomes_a_broken_attitude(
            wxyz in prop::array::uniform4(prop_oneof![
                4 => -1.1..1.1_f32,
                1 => prop::sample::select(vec![0.0, -0.0, 1.0, -1.0, f32::MIN_POSITIVE]),
                1 => any::<u32>().prop_map(f32::from_bits),
            ]),
        ) {
            if let Ok(Some(attitude)) = Attitude::<EarthFrame>::from_wxyz(wxyz) {
                let aircraft = attitude.aircraft_angles();
                prop_assert!(aircraft.roll.is_finite() && aircraft.pitch.is_finite() && aircraft.yaw.is_finite());
                let angles = attitude.gimbal_angles();
                prop_assert!(angles.roll.is_finite() && angles.pitch.is_finite() && angles.yaw.is_finite());
            }
        }
    }
}
