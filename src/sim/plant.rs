//! The mechanics of a gimbal: how its three joints follow what they are told while the vehicle moves under them.
//!
//! Time goes in fixed steps of 5 ms, so the motion does not depend on how often it is looked at.

mod carrier;
mod joint;
mod sensors;
mod settings;

use std::time::Duration;

pub use self::joint::Drive;
pub use self::settings::PlantSettings;

use self::carrier::Carrier;
use self::joint::Joint;
use self::sensors::Sensors;
use crate::geometry::{Angle, AngularRate, Limits};
use crate::sim::peer::PlatformMotion;
use crate::timestamp::Timestamp;

const STEP: Duration = Duration::from_millis(5);
const STEP_S: f64 = 0.005;

/// Drift of the held direction without a heading to lean on, radians per second (0.5° per minute).
const DRIFT: f64 = 0.5 / 60.0 * std::f64::consts::PI / 180.0;

/// Where the camera hangs without motors.
const REST_PITCH: Angle = Angle::from_degrees(-25.0);

/// What the yaw joint's angle or rate counts from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum YawHold {
    /// The vehicle: the camera turns with it.
    Vehicle,
    /// The horizon: the joint turns against the vehicle. The angle is joint angle plus platform heading.
    Horizon,
}

/// Where the camera looks, as the gimbal measures it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pose {
    /// Against the horizon.
    pub roll: Angle,
    /// Against the horizon.
    pub pitch: Angle,
    /// The joint's own angle: against the vehicle, counting turns.
    pub yaw: Angle,
    pub roll_rate: AngularRate,
    pub pitch_rate: AngularRate,
    /// Against the vehicle.
    pub yaw_rate: AngularRate,
}

/// Which joints are told to go further than they can.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct AtLimit {
    pub roll: bool,
    pub pitch: bool,
    pub yaw: bool,
}

/// A gimbal in motion.
#[derive(Clone, Debug)]
pub struct Plant {
    settings: PlantSettings,
    stepped: Timestamp,
    roll: Joint,
    pitch: Joint,
    yaw: Joint,
    yaw_hold: YawHold,
    motors_on: bool,
    /// The fastest that roll, pitch and yaw turn when they are told to; holding against the vehicle may take more.
    speed_limits: [AngularRate; 3],
    takes_direct_way: bool,
    carrier: Carrier,
    has_heading_reference: bool,
    /// Radians.
    drift: f64,
    at_limit: AtLimit,
    sensors: Sensors,
}

impl Plant {
    pub fn new(now: Timestamp, settings: PlantSettings) -> Self {
        let initial = settings.initial;
        Self {
            stepped: now,
            roll: Joint::at(initial.roll),
            pitch: Joint::at(initial.pitch),
            yaw: Joint::at(initial.yaw),
            yaw_hold: YawHold::Vehicle,
            motors_on: true,
            speed_limits: [settings.max_rate; 3],
            takes_direct_way: false,
            carrier: Carrier::at_rest(now),
            has_heading_reference: false,
            drift: 0.0,
            at_limit: AtLimit::default(),
            sensors: Sensors::new(&settings),
            settings,
        }
    }

    /// Moves on to the last whole step before `now`. What was told before holds until then.
    pub fn advance(&mut self, now: Timestamp) {
        while now.since(self.stepped) >= STEP {
            if self.is_at_rest() {
                let whole = now.since(self.stepped).as_micros() / STEP.as_micros();
                self.stepped += STEP * u32::try_from(whole).unwrap_or(u32::MAX);
                self.sensors.forget();
                return;
            }
            self.step();
        }
    }

    /// The vehicle moves like this from now on.
    pub fn set_platform(&mut self, now: Timestamp, motion: PlatformMotion) {
        self.advance(now);
        self.carrier.set_motion(now, motion);
    }

    /// Whether a heading from outside keeps the held direction from drifting.
    pub fn set_heading_reference(&mut self, known: bool) {
        self.has_heading_reference = known;
    }

    /// Moves the end stops. Joints beyond them come back.
    pub fn set_limits(&mut self, limits: Limits) {
        self.settings.limits = limits;
    }

    pub fn limits(&self) -> Limits {
        self.settings.limits
    }

    pub fn set_speed_limits(&mut self, roll_pitch_yaw: [AngularRate; 3]) {
        self.speed_limits = roll_pitch_yaw;
    }

    /// Whether yaw goes to the very angle it is told, and not to the same direction the shorter way round.
    pub fn set_direct_way(&mut self, direct: bool) {
        self.takes_direct_way = direct;
    }

    pub fn set_roll(&mut self, drive: Drive) {
        self.roll.drive = drive;
    }

    pub fn set_pitch(&mut self, drive: Drive) {
        self.pitch.drive = drive;
    }

    pub fn set_yaw(&mut self, hold: YawHold, drive: Drive) {
        self.yaw_hold = hold;
        self.yaw.drive = drive;
    }

    /// Stops where it is; the yaw goes on to be held against what it counted from.
    pub fn hold(&mut self) {
        self.hold_roll();
        self.hold_pitch();
        self.hold_yaw(self.yaw_hold);
    }

    pub fn hold_roll(&mut self) {
        self.roll.hold();
    }

    pub fn hold_pitch(&mut self) {
        self.pitch.hold();
    }

    pub fn hold_yaw(&mut self, hold: YawHold) {
        self.yaw_hold = hold;
        let angle = match hold {
            YawHold::Vehicle => self.yaw.angle(),
            YawHold::Horizon => self.yaw.angle() + self.platform_heading(self.stepped) + self.drifted(),
        };
        self.yaw.drive = Drive::To { angle, speed: None };
    }

    /// Lets go: the camera sinks to where gravity pulls it.
    pub fn release_motors(&mut self) {
        self.motors_on = false;
    }

    /// Takes hold again, wherever the camera has sunk to; without effect on motors that are on.
    pub fn engage_motors(&mut self) {
        if !self.motors_on {
            self.motors_on = true;
            self.hold();
        }
    }

    pub fn yaw_hold(&self) -> YawHold {
        self.yaw_hold
    }

    /// The platform's heading at `now`, going on as it last turned.
    pub fn platform_heading(&self, now: Timestamp) -> Angle {
        self.carrier.heading(now)
    }

    /// What has to be added to the yaw joint's angle to have what [`YawHold::Horizon`] counts.
    pub fn horizon(&self, now: Timestamp) -> Angle {
        self.platform_heading(now) + self.drifted()
    }

    pub fn motors_on(&self) -> bool {
        self.motors_on
    }

    pub fn at_limit(&self) -> AtLimit {
        self.at_limit
    }

    /// Without noise and latency, as of the last step.
    pub fn pose(&self) -> Pose {
        let (residual_roll, residual_pitch) = self.carrier.residual();
        Pose {
            roll: Angle::from_radians(self.roll.angle + residual_roll),
            pitch: Angle::from_radians(self.pitch.angle + residual_pitch),
            yaw: self.yaw.angle(),
            roll_rate: AngularRate::from_radians_per_second(self.roll.rate),
            pitch_rate: AngularRate::from_radians_per_second(self.pitch.rate),
            yaw_rate: AngularRate::from_radians_per_second(self.yaw.rate),
        }
    }

    /// What the sensors say at `now`: late, and with noise.
    pub fn measure(&mut self, now: Timestamp) -> Pose {
        self.advance(now);
        let present = self.pose();
        self.sensors.measure(now, present)
    }

    fn drifted(&self) -> Angle {
        Angle::from_radians(self.drift)
    }

    fn is_at_rest(&self) -> bool {
        let limits = &self.settings.limits;
        let is_at = |joint: &Joint, clamped: fn(&Limits, Angle) -> Angle| match joint.drive {
            Drive::To { angle, .. } => joint.is_at(clamped(limits, angle)),
            Drive::Turn(_) => false,
        };
        let yaw = match (self.yaw_hold, self.yaw.drive) {
            (YawHold::Vehicle, Drive::To { angle, .. }) => {
                self.yaw.is_at(yaw_goal(limits, self.takes_direct_way, angle, self.yaw.angle()))
            }
            _ => false,
        };
        self.motors_on
            && yaw
            && is_at(&self.roll, Limits::clamp_roll)
            && is_at(&self.pitch, Limits::clamp_pitch)
            && self.carrier.is_still()
    }

    fn step(&mut self) {
        self.stepped += STEP;
        self.carrier.step(self.stepped);
        if self.motors_on {
            self.drive_joints();
        } else {
            self.sink();
        }
        self.sensors.record(self.stepped, self.pose());
    }

    fn drive_joints(&mut self) {
        if self.has_heading_reference {
            self.drift = 0.0;
        } else if self.yaw_hold == YawHold::Horizon {
            self.drift += DRIFT * STEP_S;
        }
        let level = (Angle::ZERO, 0.0);
        let yaw_base = match self.yaw_hold {
            YawHold::Vehicle => level,
            YawHold::Horizon => (self.horizon(self.stepped), self.carrier.heading_rate().radians_per_second()),
        };
        let Self { settings, roll, pitch, yaw, speed_limits, takes_direct_way, .. } = self;
        let limits = settings.limits;
        let [roll_speed, pitch_speed, yaw_speed] = *speed_limits;
        let direct = *takes_direct_way;
        self.at_limit = AtLimit {
            roll: roll.follow(settings, roll_speed, limits.roll, level, |angle, _| limits.clamp_roll(angle)),
            pitch: pitch.follow(settings, pitch_speed, limits.pitch, level, |angle, _| limits.clamp_pitch(angle)),
            yaw: yaw.follow(settings, yaw_speed, limits.yaw, yaw_base, |angle, from| {
                yaw_goal(&limits, direct, angle, from)
            }),
        };
    }

    fn sink(&mut self) {
        self.roll.sink(Angle::ZERO);
        self.pitch.sink(REST_PITCH);
        self.yaw.rate = 0.0;
        self.at_limit = AtLimit::default();
    }
}

/// The angle of the yaw joint for one that it is told.
fn yaw_goal(limits: &Limits, direct: bool, angle: Angle, from: Angle) -> Angle {
    if direct { limits.yaw.map_or(angle, |limits| limits.clamp(angle)) } else { limits.clamp_yaw(angle, from) }
}

#[cfg(test)]
mod tests;
