//! How a body turns, as a vector, with the frame of its components in the type.

use std::marker::PhantomData;
use std::time::Duration;

use nalgebra::{UnitQuaternion, Vector3};

use super::angle::AngularRate;
use super::attitude::{Attitude, EarthFrame};

/// Forward, right, down, fixed to the body.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BodyFrame {}

/// Rates about the three axes of frame `F`, positive right-handed: rolling right, pitching up, yawing right.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AngularVelocity<F> {
    radians_per_second: Vector3<f64>,
    frame: PhantomData<F>,
}

impl<F> AngularVelocity<F> {
    /// Radians per second about x, y and z; `None` unless all are numbers.
    pub fn from_radians_per_second(xyz: [f64; 3]) -> Option<Self> {
        xyz.iter().all(|rate| rate.is_finite()).then(|| Self::from_vector(Vector3::from(xyz)))
    }

    fn from_vector(radians_per_second: Vector3<f64>) -> Self {
        Self { radians_per_second, frame: PhantomData }
    }
}

impl AngularVelocity<EarthFrame> {
    /// Positive to the right.
    pub fn about_down(self) -> AngularRate {
        AngularRate::from_radians_per_second(self.radians_per_second.z)
    }
}

impl<F> Attitude<F> {
    /// A turn that is told about the body's axes, about those of the frame.
    pub fn turn_in_frame(self, turn: AngularVelocity<BodyFrame>) -> AngularVelocity<F> {
        AngularVelocity::from_vector(self.rotation() * turn.radians_per_second)
    }

    /// The attitude after turning on at `turn` for a while.
    pub fn after(self, turn: AngularVelocity<F>, time: Duration) -> Self {
        let turned = UnitQuaternion::from_scaled_axis(turn.radians_per_second * time.as_secs_f64());
        Self::from_rotation(turned * self.rotation())
    }

    /// The attitude of what is fixed to this body and turned in it by `mounting`.
    pub fn of_mounted(self, mounting: Attitude<BodyFrame>) -> Self {
        Self::from_rotation(self.rotation() * mounting.rotation())
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::geometry::{AircraftAngles, Angle};

    fn attitude(roll: f64, pitch: f64, yaw: f64) -> Attitude<EarthFrame> {
        let [roll, pitch, yaw] = [roll, pitch, yaw].map(Angle::from_degrees);
        Attitude::from_aircraft_angles(AircraftAngles { roll, pitch, yaw })
    }

    /// A rate about the body's z axis is one about Down only while the body is level.
    #[test]
    #[rustfmt::skip]
    fn body_rates_are_turned_into_the_frame() {
        for (at,                          body,              about_down) in [
            (attitude(  0.0,  0.0,  0.0), [0.0, 0.0, 1.0],          1.0),
            (attitude(  0.0,  0.0, 90.0), [0.0, 0.0, 1.0],          1.0),
            (attitude(180.0,  0.0,  0.0), [0.0, 0.0, 1.0],         -1.0),
            (attitude( 90.0,  0.0,  0.0), [0.0, 1.0, 0.0],          1.0),
            (attitude(  0.0, 90.0,  0.0), [1.0, 0.0, 0.0],         -1.0),
            (attitude( 60.0,  0.0, 30.0), [0.0, 0.0, 1.0],          0.5),
        ] {
            let body = AngularVelocity::from_radians_per_second(body).expect("they are numbers");
            let found = at.turn_in_frame(body).about_down().radians_per_second();
            assert!((found - about_down).abs() < 1e-12, "{at:?} {body:?}: {found}");
        }
    }

    #[test]
    fn what_is_no_number_is_no_angular_velocity() {
        for broken in [[f64::NAN, 0.0, 0.0], [0.0, f64::INFINITY, 0.0], [0.0, 0.0, f64::NAN]] {
            assert_eq!(AngularVelocity::<BodyFrame>::from_radians_per_second(broken), None);
        }
    }

    /// A tail-sitter on its tail, told as what it looks like to a pilot who flies it like an aeroplane.
    #[test]
    fn a_mounting_is_applied_inside_the_body() {
        let nose_up = attitude(0.0, 90.0, 0.0);
        let mounting = AircraftAngles { pitch: Angle::from_degrees(-90.0), ..AircraftAngles::default() };
        let level = nose_up.of_mounted(Attitude::from_aircraft_angles(mounting));
        assert!(level.angle_to(attitude(0.0, 0.0, 0.0)).degrees() < 1e-6);

        let rolled = attitude(20.0, 0.0, 0.0).of_mounted(Attitude::from_aircraft_angles(mounting));
        let nose_down_then_rolled = attitude(20.0, 0.0, 0.0).rotation() * attitude(0.0, -90.0, 0.0).rotation();
        assert!(rolled.angle_to(Attitude::from_rotation(nose_down_then_rolled)).degrees() < 1e-6);
    }

    proptest! {
        /// Turning on for a while, and for a while more, is turning on for both; about Down the heading goes with it.
        #[test]
        fn turns_add_up(
            roll in -180.0..180.0, pitch in -80.0..80.0, yaw in -180.0..180.0,
            x in -3.0..3.0, y in -3.0..3.0, z in -3.0..3.0, first_ms in 0_u64..500, second_ms in 0_u64..500,
        ) {
            let start = attitude(roll, pitch, yaw);
            let turn = AngularVelocity::from_radians_per_second([x, y, z]).expect("they are numbers");
            let in_steps = start.after(turn, Duration::from_millis(first_ms)).after(turn, Duration::from_millis(second_ms));
            let at_once = start.after(turn, Duration::from_millis(first_ms + second_ms));
            prop_assert!(in_steps.angle_to(at_once).degrees() < 1e-6);

            let about_down = AngularVelocity::from_radians_per_second([0.0, 0.0, z]).expect("they are numbers");
            let turned = start.after(about_down, Duration::from_millis(first_ms)).heading() - start.heading();
            let expected = about_down.about_down().over(Duration::from_millis(first_ms));
            prop_assert!((turned - expected).wrapped().degrees().abs() < 1e-6);
        }
    }
}
