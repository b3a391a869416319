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
mod tests;
