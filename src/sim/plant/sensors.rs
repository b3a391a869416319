//! What the gimbal's sensors say of where it looks: late, and with noise.

use std::collections::VecDeque;
use std::time::Duration;

use super::Pose;
use super::settings::PlantSettings;
use crate::geometry::{Angle, AngularRate};
use crate::sim::random::Random;
use crate::timestamp::Timestamp;

/// Age of a measurement when it is reported, 20 ms give or take 5 ms.
const LEAST_LATENCY: Duration = Duration::from_millis(15);
const LATENCY_SPREAD: Duration = Duration::from_millis(10);

/// How many steps are kept; more than the greatest latency holds.
const HISTORY: usize = 8;

/// The sensors, and where the gimbal looked in its last steps.
#[derive(Clone, Debug)]
pub struct Sensors {
    /// Standard deviation.
    noise: Angle,
    history: VecDeque<(Timestamp, Pose)>,
    random: Random,
}

impl Sensors {
    pub fn new(settings: &PlantSettings) -> Self {
        let history = VecDeque::with_capacity(HISTORY);
        Self { noise: settings.noise, history, random: Random::new(settings.seed) }
    }

    /// Takes the pose after a step.
    pub fn record(&mut self, at: Timestamp, pose: Pose) {
        if self.history.len() == HISTORY {
            self.history.pop_front();
        }
        self.history.push_back((at, pose));
    }

    /// It has looked for long where it looks.
    pub fn forget(&mut self) {
        self.history.clear();
    }

    /// What they say at `now`, when it truly is at `present`.
    pub fn measure(&mut self, now: Timestamp, present: Pose) -> Pose {
        let latency = LEAST_LATENCY + LATENCY_SPREAD.mul_f64(self.random.unit());
        let taken = self.history.iter().rev().find(|(at, _)| now.since(*at) >= latency);
        let pose = taken.map_or(present, |(_, pose)| *pose);
        let spread = self.noise.radians();
        let mut angle = |value: Angle| Angle::from_radians(value.radians() + spread * self.random.normal());
        let (roll, pitch, yaw) = (angle(pose.roll), angle(pose.pitch), angle(pose.yaw));
        let mut rate = |value: AngularRate| {
            AngularRate::from_radians_per_second(value.radians_per_second() + 2.5 * spread * self.random.normal())
        };
        Pose {
            roll,
            pitch,
            yaw,
            roll_rate: rate(pose.roll_rate),
            pitch_rate: rate(pose.pitch_rate),
            yaw_rate: rate(pose.yaw_rate),
        }
    }
}
