//! What a simulated gimbal's mechanics can do.

use crate::geometry::{Angle, AngularRate, GimbalAngles, Limits};

/// How much of its greatest rate a joint gains within a second.
const ACCELERATION_PER_RATE: f64 = 8.0;

/// What one gimbal can do.
#[derive(Clone, Debug, PartialEq)]
pub struct PlantSettings {
    pub max_rate: AngularRate,
    /// Radians per second squared.
    pub max_acceleration: f64,
    pub limits: Limits,
    pub initial: GimbalAngles,
    /// Standard deviation of a reported angle; rates have 2.5 times as much per second.
    pub noise: Angle,
    pub seed: u64,
}

impl PlantSettings {
    /// With joints of this greatest rate, which they reach as soon as others reach theirs.
    pub fn with_max_rate(self, max_rate: AngularRate) -> Self {
        Self { max_rate, max_acceleration: ACCELERATION_PER_RATE * max_rate.radians_per_second(), ..self }
    }
}

impl Default for PlantSettings {
    fn default() -> Self {
        let max_rate = AngularRate::from_degrees_per_second(100.0);
        Self {
            max_rate,
            max_acceleration: ACCELERATION_PER_RATE * max_rate.radians_per_second(),
            limits: Limits::default(),
            initial: GimbalAngles::default(),
            noise: Angle::from_degrees(0.02),
            seed: 1,
        }
    }
}
