use std::f64::consts::{FRAC_PI_2, PI};

use proptest::prelude::*;

use super::*;

fn earth(wxyz: [f32; 4]) -> Attitude<EarthFrame> {
    Attitude::from_wxyz(wxyz).expect("it is well formed").expect("it is set")
}

fn gimbal(roll: f64, pitch: f64, yaw: f64) -> GimbalAngles {
    GimbalAngles { roll: Angle::from_degrees(roll), pitch: Angle::from_degrees(pitch), yaw: Angle::from_degrees(yaw) }
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
