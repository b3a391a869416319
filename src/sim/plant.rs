//! The mechanics of a gimbal: how its three joints follow what they are told while the vehicle moves under them.
//!
//! Time goes in fixed steps of 5 ms, so the motion does not depend on how often it is looked at.

use std::collections::VecDeque;
use std::time::Duration;

use crate::geometry::{Angle, AngularRate, AxisLimits, GimbalAngles, Limits};
use crate::sim::peer::PlatformMotion;
use crate::sim::random::Random;
use crate::timestamp::Timestamp;

const STEP: Duration = Duration::from_millis(5);
const STEP_S: f64 = 0.005;

/// Position loop, per second: at most 2 % overshoot while the acceleration is at least four times the speed limit.
const GAIN: f64 = 6.0;

/// Nearer than this, and slower per second, a joint has arrived; radians.
const ARRIVED: f64 = 1e-7;

/// A limit counts as touched within this.
const AT_LIMIT: Angle = Angle::from_degrees(0.2);

/// What stabilisation leaves of the vehicle's rates: 3 %, as a high-pass of 1 Hz, at most 0.3°.
const RESIDUAL_SHARE: f64 = 0.03;
const RESIDUAL_DECAY_PER_S: f64 = std::f64::consts::TAU;
const RESIDUAL_MOST: f64 = 0.3 * std::f64::consts::PI / 180.0;

/// Drift of the held direction without a heading to lean on, radians per second (0.5° per minute).
const DRIFT: f64 = 0.5 / 60.0 * std::f64::consts::PI / 180.0;

/// Where the camera hangs without motors, and how fast it gets there.
const REST_PITCH: Angle = Angle::from_degrees(-25.0);
const REST_TIME_S: f64 = 0.6;

/// Age of a measurement when it is reported, 20 ms give or take 5 ms.
const LEAST_LATENCY: Duration = Duration::from_millis(15);
const LATENCY_SPREAD: Duration = Duration::from_millis(10);
const HISTORY: usize = 8;

/// Beyond this the vehicle's last known rate is no longer believed.
const EXTRAPOLATION: Duration = Duration::from_millis(500);

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

/// How much of its greatest rate a joint gains within a second.
const ACCELERATION_PER_RATE: f64 = 8.0;

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

/// What a joint is told to do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Drive {
    /// Go to an angle and stay, at no more than `speed` if given.
    To { angle: Angle, speed: Option<AngularRate> },
    /// Turn until told otherwise.
    Turn(AngularRate),
}

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

#[derive(Clone, Copy, Debug)]
struct Joint {
    /// Radians.
    angle: f64,
    /// Radians per second.
    rate: f64,
    drive: Drive,
}

impl Joint {
    fn at(angle: Angle) -> Self {
        Self { angle: angle.radians(), rate: 0.0, drive: Drive::To { angle, speed: None } }
    }

    fn angle(&self) -> Angle {
        Angle::from_radians(self.angle)
    }

    fn hold(&mut self) {
        self.drive = Drive::To { angle: self.angle(), speed: None };
    }
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
    platform: PlatformMotion,
    platform_at: Timestamp,
    has_heading_reference: bool,
    drift: f64,
    residual_roll: f64,
    residual_pitch: f64,
    at_limit: AtLimit,
    history: VecDeque<(Timestamp, Pose)>,
    random: Random,
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
            platform: PlatformMotion::default(),
            platform_at: now,
            has_heading_reference: false,
            drift: 0.0,
            residual_roll: 0.0,
            residual_pitch: 0.0,
            at_limit: AtLimit::default(),
            history: VecDeque::with_capacity(HISTORY),
            random: Random::new(settings.seed),
            settings,
        }
    }

    /// Moves on to the last whole step before `now`. What was told before holds until then.
    pub fn advance(&mut self, now: Timestamp) {
        while now.since(self.stepped) >= STEP {
            if self.is_at_rest() {
                let whole = now.since(self.stepped).as_micros() / STEP.as_micros();
                self.stepped += STEP * u32::try_from(whole).unwrap_or(u32::MAX);
                self.history.clear();
                return;
            }
            self.step();
        }
    }

    /// The vehicle moves like this from now on.
    pub fn set_platform(&mut self, now: Timestamp, motion: PlatformMotion) {
        self.advance(now);
        self.platform = motion;
        self.platform_at = now;
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
        let age = now.since(self.platform_at);
        self.platform.heading + self.platform.heading_rate.over(age.min(EXTRAPOLATION))
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
        let (residual_roll, residual_pitch) = (self.residual_roll, self.residual_pitch);
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
        let latency = LEAST_LATENCY + LATENCY_SPREAD.mul_f64(self.random.unit());
        let taken = self.history.iter().rev().find(|(at, _)| now.since(*at) >= latency);
        let pose = taken.map_or_else(|| self.pose(), |(_, pose)| *pose);
        let spread = self.settings.noise.radians();
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

    fn drifted(&self) -> Angle {
        Angle::from_radians(self.drift)
    }

    fn is_at_rest(&self) -> bool {
        let arrived = |joint: &Joint, goal: Angle| joint.rate == 0.0 && joint.angle == goal.radians();
        let to = |joint: &Joint, clamped: fn(&Limits, Angle) -> Angle| match joint.drive {
            Drive::To { angle, .. } => arrived(joint, clamped(&self.settings.limits, angle)),
            Drive::Turn(_) => false,
        };
        let yaw = match (self.yaw_hold, self.yaw.drive) {
            (YawHold::Vehicle, Drive::To { angle, .. }) => {
                arrived(&self.yaw, yaw_goal(&self.settings.limits, self.takes_direct_way, angle, self.yaw.angle()))
            }
            _ => false,
        };
        let platform = self.platform;
        let is_still = [platform.heading_rate, platform.roll_rate, platform.pitch_rate]
            .iter()
            .all(|rate| *rate == AngularRate::ZERO);
        self.motors_on
            && yaw
            && to(&self.roll, Limits::clamp_roll)
            && to(&self.pitch, Limits::clamp_pitch)
            && is_still
            && self.residual_roll == 0.0
            && self.residual_pitch == 0.0
    }

    fn step(&mut self) {
        self.stepped += STEP;
        self.shake();
        if self.motors_on {
            self.drive_joints();
        } else {
            self.sink();
        }
        if self.history.len() == HISTORY {
            self.history.pop_front();
        }
        self.history.push_back((self.stepped, self.pose()));
    }

    fn shake(&mut self) {
        let fresh = self.stepped.since(self.platform_at) <= EXTRAPOLATION;
        let excite = |residual: f64, rate: AngularRate| {
            let push = if fresh { RESIDUAL_SHARE * rate.radians_per_second() } else { 0.0 };
            let next = residual + (push - RESIDUAL_DECAY_PER_S * residual) * STEP_S;
            if push == 0.0 && next.abs() < ARRIVED { 0.0 } else { next.clamp(-RESIDUAL_MOST, RESIDUAL_MOST) }
        };
        self.residual_roll = excite(self.residual_roll, self.platform.roll_rate);
        self.residual_pitch = excite(self.residual_pitch, self.platform.pitch_rate);
        if !fresh {
            self.platform.heading = self.platform_heading(self.stepped);
            self.platform_at = self.stepped;
            self.platform.heading_rate = AngularRate::ZERO;
            self.platform.roll_rate = AngularRate::ZERO;
            self.platform.pitch_rate = AngularRate::ZERO;
        }
    }

    fn drive_joints(&mut self) {
        if self.has_heading_reference {
            self.drift = 0.0;
        } else if self.yaw_hold == YawHold::Horizon {
            self.drift += DRIFT * STEP_S;
        }
        let (heading, turning) = match self.yaw_hold {
            YawHold::Vehicle => (Angle::ZERO, 0.0),
            YawHold::Horizon => (
                self.platform_heading(self.stepped) + Angle::from_radians(self.drift),
                self.platform.heading_rate.radians_per_second(),
            ),
        };
        let Self { settings, roll, pitch, yaw, speed_limits, takes_direct_way, .. } = self;
        let limits = settings.limits;
        let level = (Angle::ZERO, 0.0);
        let [roll_speed, pitch_speed, yaw_speed] = *speed_limits;
        let direct = *takes_direct_way;
        self.at_limit = AtLimit {
            roll: follow(settings, roll_speed, roll, limits.roll, level, |angle, _| limits.clamp_roll(angle)),
            pitch: follow(settings, pitch_speed, pitch, limits.pitch, level, |angle, _| limits.clamp_pitch(angle)),
            yaw: follow(settings, yaw_speed, yaw, limits.yaw, (heading, turning), |angle, from| {
                yaw_goal(&limits, direct, angle, from)
            }),
        };
    }

    fn sink(&mut self) {
        let sink = |joint: &mut Joint, rest: f64| {
            joint.rate = (rest - joint.angle) / REST_TIME_S;
            joint.angle += joint.rate * STEP_S;
        };
        sink(&mut self.roll, 0.0);
        sink(&mut self.pitch, REST_PITCH.radians());
        self.yaw.rate = 0.0;
        self.at_limit = AtLimit::default();
    }
}

/// The angle of the yaw joint for one that it is told.
fn yaw_goal(limits: &Limits, direct: bool, angle: Angle, from: Angle) -> Angle {
    if direct { limits.yaw.map_or(angle, |limits| limits.clamp(angle)) } else { limits.clamp_yaw(angle, from) }
}

/// One step of one joint; true when it is told to go further than it can and stands at the limit.
///
/// `base` is what the drive counts from, as an angle of the joint, and how fast it turns in radians per second;
/// `reach` gives the joint angle to go to for the one that is wanted and the one it has.
fn follow(
    settings: &PlantSettings,
    speed_limit: AngularRate,
    joint: &mut Joint,
    limits: Option<AxisLimits>,
    base: (Angle, f64),
    reach: impl Fn(Angle, Angle) -> Angle,
) -> bool {
    let max_rate = settings.max_rate.radians_per_second();
    let (offset, carried) = (base.0, -base.1);
    let at_min = limits.is_some_and(|limits| joint.angle() - limits.min() < AT_LIMIT);
    let at_max = limits.is_some_and(|limits| limits.max() - joint.angle() < AT_LIMIT);
    let (wanted_rate, stuck) = match joint.drive {
        Drive::Turn(rate) => {
            let rate = rate.clamp(-speed_limit, speed_limit).radians_per_second() + carried;
            // Brake in time for the end stop.
            let room = |end: Angle| GAIN * (end.radians() - joint.angle);
            let bounded =
                limits.map_or(rate, |limits| rate.max(room(limits.min()).min(0.0)).min(room(limits.max()).max(0.0)));
            (bounded, (rate < 0.0 && at_min) || (rate > 0.0 && at_max))
        }
        Drive::To { angle, speed } => {
            let wanted = angle - offset;
            let goal = reach(wanted, joint.angle());
            let out_of_reach = (goal - wanted).wrapped().abs() > Angle::from_radians(ARRIVED);
            let error = goal.radians() - joint.angle;
            if error.abs() < ARRIVED && joint.rate.abs() < ARRIVED && carried == 0.0 {
                joint.angle = goal.radians();
                joint.rate = 0.0;
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
    joint.rate += (wanted_rate.clamp(-max_rate, max_rate) - joint.rate).clamp(-most, most);
    joint.angle += joint.rate * STEP_S;
    if let Some(limits) = limits {
        let stopped = limits.clamp(joint.angle());
        if stopped != joint.angle() {
            joint.angle = stopped.radians();
            joint.rate = 0.0;
        }
    }
    stuck
}

#[cfg(test)]
mod tests;
