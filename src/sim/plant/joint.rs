//! How one joint follows what it is told: no faster than it can, and no further than its end stops.

use super::STEP_S;
use super::settings::PlantSettings;
use crate::geometry::{Angle, AngularRate, AxisLimits};

/// Position loop, per second: at most 2 % overshoot while the acceleration is at least four times the speed limit.
const GAIN: f64 = 6.0;

/// Nearer than this, and slower per second, a joint has arrived; radians.
const ARRIVED: f64 = 1e-7;

/// A limit counts as touched within this.
const AT_LIMIT: Angle = Angle::from_degrees(0.2);

/// How fast a joint sinks to its rest without motors.
const REST_TIME_S: f64 = 0.6;

/// What a joint is told to do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Drive {
    /// Go to an angle and stay, at no more than `speed` if given.
    To { angle: Angle, speed: Option<AngularRate> },
    /// Turn until told otherwise.
    Turn(AngularRate),
}

/// One joint in motion.
#[derive(Clone, Copy, Debug)]
pub struct Joint {
    /// Radians.
    pub angle: f64,
    /// Radians per second.
    pub rate: f64,
    pub drive: Drive,
}

impl Joint {
    pub fn at(angle: Angle) -> Self {
        Self { angle: angle.radians(), rate: 0.0, drive: Drive::To { angle, speed: None } }
    }

    pub fn angle(&self) -> Angle {
        Angle::from_radians(self.angle)
    }

    pub fn hold(&mut self) {
        self.drive = Drive::To { angle: self.angle(), speed: None };
    }

    /// Whether it stands exactly there.
    pub fn is_at(&self, goal: Angle) -> bool {
        self.rate == 0.0 && self.angle == goal.radians()
    }

    /// One step; true when it is told to go further than it can and stands at the limit.
    ///
    /// `base` is what the drive counts from, as an angle of the joint, and how fast it turns in radians per second;
    /// `reach` gives the joint angle to go to for the one that is wanted and the one it has.
    pub fn follow(
        &mut self,
        settings: &PlantSettings,
        speed_limit: AngularRate,
        limits: Option<AxisLimits>,
        base: (Angle, f64),
        reach: impl Fn(Angle, Angle) -> Angle,
    ) -> bool {
        let max_rate = settings.max_rate.radians_per_second();
        let (offset, carried) = (base.0, -base.1);
        let at_min = limits.is_some_and(|limits| self.angle() - limits.min() < AT_LIMIT);
        let at_max = limits.is_some_and(|limits| limits.max() - self.angle() < AT_LIMIT);
        let (wanted_rate, stuck) = match self.drive {
            Drive::Turn(rate) => {
                let rate = rate.clamp(-speed_limit, speed_limit).radians_per_second() + carried;
                // Brake in time for the end stop.
                let room = |end: Angle| GAIN * (end.radians() - self.angle);
                let bounded = limits
                    .map_or(rate, |limits| rate.max(room(limits.min()).min(0.0)).min(room(limits.max()).max(0.0)));
                (bounded, (rate < 0.0 && at_min) || (rate > 0.0 && at_max))
            }
            Drive::To { angle, speed } => {
                let wanted = angle - offset;
                let goal = reach(wanted, self.angle());
                let out_of_reach = (goal - wanted).wrapped().abs() > Angle::from_radians(ARRIVED);
                let error = goal.radians() - self.angle;
                if error.abs() < ARRIVED && self.rate.abs() < ARRIVED && carried == 0.0 {
                    self.angle = goal.radians();
                    self.rate = 0.0;
                    return out_of_reach;
                }
                let speed = speed
                    .map_or(speed_limit, |speed| speed.abs().clamp(AngularRate::ZERO, speed_limit))
                    .radians_per_second();
                let carried = if out_of_reach { 0.0 } else { carried };
                ((GAIN * error).clamp(-speed, speed) + carried, out_of_reach && (at_min || at_max))
            }
        };
        let most = settings.max_acceleration * STEP_S;
        self.rate += (wanted_rate.clamp(-max_rate, max_rate) - self.rate).clamp(-most, most);
        self.angle += self.rate * STEP_S;
        if let Some(limits) = limits {
            let stopped = limits.clamp(self.angle());
            if stopped != self.angle() {
                self.angle = stopped.radians();
                self.rate = 0.0;
            }
        }
        stuck
    }

    /// One step without motors.
    pub fn sink(&mut self, rest: Angle) {
        self.rate = (rest.radians() - self.angle) / REST_TIME_S;
        self.angle += self.rate * STEP_S;
    }
}
