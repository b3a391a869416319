//! What the motors do, and how they are switched.

use std::time::Duration;

use super::Device;
use crate::timestamp::Timestamp;

/// Motors that are switched on need so long.
const START: Duration = Duration::from_secs(3);

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Motors {
    Off,
    Starting { until: Timestamp },
    On,
}

impl Device {
    pub(super) fn motors_off(&mut self) {
        self.motors = Motors::Off;
        self.plant.release_motors();
    }

    /// Starts motors that are off. When they run it goes straight ahead.
    pub(super) fn motors_on(&mut self, now: Timestamp) {
        if self.motors == Motors::Off {
            self.motors = Motors::Starting { until: now + START };
        }
    }
}
