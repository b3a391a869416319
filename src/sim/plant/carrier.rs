//! How the vehicle carries the gimbal, and what of its motion stabilisation lets through.

use std::time::Duration;

use super::STEP_S;
use crate::geometry::{Angle, AngularRate};
use crate::sim::peer::PlatformMotion;
use crate::timestamp::Timestamp;

/// What stabilisation leaves of the vehicle's rates: 3 %, as a high-pass of 1 Hz, at most 0.3°.
const RESIDUAL_SHARE: f64 = 0.03;
const RESIDUAL_DECAY_PER_S: f64 = std::f64::consts::TAU;
const RESIDUAL_MOST: f64 = 0.3 * std::f64::consts::PI / 180.0;
/// Without anything that excites it, less than this is nothing; radians.
const RESIDUAL_LEAST: f64 = 1e-7;

/// Beyond this the vehicle's last known rate is no longer believed.
const EXTRAPOLATION: Duration = Duration::from_millis(500);

/// The vehicle under the gimbal.
#[derive(Clone, Copy, Debug)]
pub struct Carrier {
    motion: PlatformMotion,
    told_at: Timestamp,
    /// Radians.
    residual_roll: f64,
    residual_pitch: f64,
}

impl Carrier {
    pub fn at_rest(now: Timestamp) -> Self {
        Self { motion: PlatformMotion::default(), told_at: now, residual_roll: 0.0, residual_pitch: 0.0 }
    }

    /// It moves like this from now on.
    pub fn set_motion(&mut self, now: Timestamp, motion: PlatformMotion) {
        self.motion = motion;
        self.told_at = now;
    }

    /// Its heading at `now`, going on as it last turned.
    pub fn heading(&self, now: Timestamp) -> Angle {
        let age = now.since(self.told_at);
        self.motion.heading + self.motion.heading_rate.over(age.min(EXTRAPOLATION))
    }

    pub fn heading_rate(&self) -> AngularRate {
        self.motion.heading_rate
    }

    /// How far the camera is off in roll and pitch, radians.
    pub fn residual(&self) -> (f64, f64) {
        (self.residual_roll, self.residual_pitch)
    }

    /// Neither it moves nor anything is left of its motion.
    pub fn is_still(&self) -> bool {
        let rates = [self.motion.heading_rate, self.motion.roll_rate, self.motion.pitch_rate];
        rates.iter().all(|rate| *rate == AngularRate::ZERO) && self.residual() == (0.0, 0.0)
    }

    /// One step, to `now`.
    pub fn step(&mut self, now: Timestamp) {
        let fresh = now.since(self.told_at) <= EXTRAPOLATION;
        let excite = |residual: f64, rate: AngularRate| {
            let push = if fresh { RESIDUAL_SHARE * rate.radians_per_second() } else { 0.0 };
            let next = residual + (push - RESIDUAL_DECAY_PER_S * residual) * STEP_S;
            let is_over = push == 0.0 && next.abs() < RESIDUAL_LEAST;
            if is_over { 0.0 } else { next.clamp(-RESIDUAL_MOST, RESIDUAL_MOST) }
        };
        self.residual_roll = excite(self.residual_roll, self.motion.roll_rate);
        self.residual_pitch = excite(self.residual_pitch, self.motion.pitch_rate);
        if !fresh {
            self.motion = PlatformMotion { heading: self.heading(now), ..PlatformMotion::default() };
            self.told_at = now;
        }
    }
}
