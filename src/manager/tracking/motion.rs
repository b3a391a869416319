//! Movements that take time: rotations of the device's own, and angles on their way.

use std::time::Duration;

use super::situation::{Pose, Situation};
use crate::geometry::{Angle, AngularRate, Yaw, YawFrame};
use crate::gimbals::setpoint::{Pointing, RadioControl, Setpoint, Stabilised, Turning};
use crate::timestamp::Timestamp;

/// After a rotation was stopped the gimbal gets so long to come to rest; then its attitude is held.
pub const SETTLE: Duration = Duration::from_millis(300);

/// A rotation that the device carries out by itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Turn {
    pub(super) turning: Turning,
    pub(super) stops_at: Option<Timestamp>,
    /// The rates are zero, and the attitude then is to be held.
    pub(super) settles_at: Option<Timestamp>,
}

/// Angles, which may be on their way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Point {
    pub(super) roll: Axis,
    pub(super) pitch: Axis,
    pub(super) yaw: Axis,
    pub(super) frame: YawFrame,
    pub(super) stabilised: Stabilised,
    pub(super) radio_control: RadioControl,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Axis {
    pub(super) at: Angle,
    pub(super) motion: Motion,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Motion {
    Still,
    /// To an angle, no faster than a rate.
    Slew {
        to: Angle,
        rate: AngularRate,
    },
    Turning {
        rate: AngularRate,
        until: Option<Timestamp>,
    },
    /// A rotation at that rate has ended.
    Stopping {
        rate: AngularRate,
    },
}

/// The angle that turns is so far ahead of the gimbal at most as it turns in that time: a gimbal slower than asked would go on
/// to it for as long as it was told to turn, …
const LEADS_BY: Duration = Duration::from_secs(1);

/// … and so far when the rotation has ended. "On expiry the rate falls to zero within 0.2 s, then the attitude is held" (D7).
const ENDS_WITHIN: Duration = Duration::from_millis(200);

impl Turn {
    /// The same rotation as angles that move, from where the gimbal is.
    pub(super) fn in_angles(&self, pose: Pose) -> Point {
        let Turning { pitch, yaw, yaw_frame, stabilised, radio_control, .. } = self.turning;
        let turning = |at, rate| Axis { at, motion: Motion::Turning { rate, until: self.stops_at } };
        Point {
            roll: Axis::still(Angle::ZERO),
            pitch: turning(pose.pitch, pitch),
            yaw: turning(pose.yaw, yaw),
            frame: yaw_frame,
            stabilised,
            radio_control,
        }
    }

    pub(super) fn stop(&mut self, now: Timestamp) {
        self.turning = self.turning.stopped();
        self.stops_at = None;
        self.settles_at = Some(now + SETTLE);
    }
}

impl Point {
    pub(super) fn still(pose: Pose, frame: YawFrame, stabilised: Stabilised) -> Self {
        Self {
            roll: Axis::still(pose.roll),
            pitch: Axis::still(pose.pitch),
            yaw: Axis::still(pose.yaw),
            frame,
            stabilised,
            radio_control: RadioControl::Off,
        }
    }

    /// Whether an axis is on its way.
    pub(super) fn moves(&self) -> bool {
        [self.roll, self.pitch, self.yaw].iter().any(|axis| axis.motion != Motion::Still)
    }

    pub(super) fn setpoint(&self) -> Setpoint {
        Setpoint::Point(Pointing {
            roll: self.roll.at,
            pitch: self.pitch.at,
            yaw: Yaw::new(self.frame, self.yaw.at),
            stabilised: self.stabilised,
            radio_control: self.radio_control,
        })
    }
}

impl Axis {
    /// The whole movement by so much.
    pub(super) fn shift(&mut self, by: Angle) {
        self.at += by;
        if let Motion::Slew { to, .. } = &mut self.motion {
            *to += by;
        }
    }

    pub(super) const fn still(at: Angle) -> Self {
        Self { at, motion: Motion::Still }
    }

    /// Moves by the time that has `passed`; the gimbal looks along `measured`, `way` leads from one angle to another, `clamp`
    /// keeps off the end stops. True when a rate has just ended by itself.
    pub(super) fn carry_on(
        &mut self,
        now: Timestamp,
        passed: Duration,
        measured: Option<Angle>,
        way: impl Fn(Angle, Angle) -> Angle,
        clamp: impl Fn(Angle) -> Angle,
    ) -> bool {
        match self.motion {
            Motion::Still => {}
            Motion::Slew { to, rate } => {
                let step = rate.over(passed);
                let left = way(self.at, to);
                if left.abs() <= step {
                    *self = Self::still(to);
                } else {
                    self.at += if left > Angle::ZERO { step } else { -step };
                }
            }
            Motion::Turning { rate, until } => {
                self.at = clamp(self.at + rate.over(passed));
                if until.is_some_and(|until| until <= now) {
                    self.stop(rate, measured);
                    return true;
                }
                self.lead(rate, measured, LEADS_BY);
            }
            Motion::Stopping { rate } => self.stop(rate, measured),
        }
        false
    }
}

impl Axis {
    fn stop(&mut self, rate: AngularRate, measured: Option<Angle>) {
        self.lead(rate, measured, ENDS_WITHIN);
        self.motion = Motion::Still;
    }

    /// No further ahead of `measured` than `rate` leads in that time.
    fn lead(&mut self, rate: AngularRate, measured: Option<Angle>, time: Duration) {
        let Some(measured) = measured.filter(|_| !rate.is_zero()) else { return };
        let (ahead, most) = ((self.at - measured).wrapped(), rate.over(time));
        let too_far = if most > Angle::ZERO { ahead > most } else { ahead < most };
        if too_far {
            self.at -= ahead - most;
        }
    }
}

/// Keeps a moving pitch within the end stops. Where none are known it ends straight down and straight up: what is told of a
/// camera beyond is the direction behind it, upside down.
pub(super) fn clamp_pitch(angle: Angle, from: Angle, situation: &Situation<'_>) -> Angle {
    let limits = &situation.capabilities.limits;
    if limits.pitch.is_some() {
        return limits.clamp_pitch(angle);
    }
    let straight = Angle::from_degrees(90.0);
    // One that was asked to look beyond comes back from there.
    let reach = if from.abs() > straight { from.abs() } else { straight };
    angle.clamp(-reach, reach)
}

/// Keeps a moving yaw within the end stops, which are the vehicle's also while North is held.
pub(super) fn clamp_yaw(angle: Angle, frame: YawFrame, situation: &Situation<'_>) -> Angle {
    let Some(limits) = situation.capabilities.limits.yaw else { return angle };
    let Some(vehicle) = vehicle_yaw(angle, frame, situation.heading) else { return angle };
    if vehicle >= limits.min() && vehicle <= limits.max() {
        return angle;
    }
    let stopped = Yaw::InVehicleFrame(limits.clamp(vehicle));
    stopped.in_frame(frame, situation.heading).map_or(angle, Yaw::angle)
}

/// The way round from one yaw to another: the short one, or the one that has no end stop in between.
pub(super) fn way(from: Angle, to: Angle, frame: YawFrame, situation: &Situation<'_>) -> Angle {
    let vehicle = |angle| vehicle_yaw(angle, frame, situation.heading);
    match (vehicle(from), vehicle(to)) {
        (Some(from), Some(to)) => situation.capabilities.limits.clamp_yaw(to, from) - from,
        _ => (to - from).wrapped(),
    }
}

/// A yaw from the nose. Only there turns count, so an angle that is from the nose already keeps them.
fn vehicle_yaw(angle: Angle, frame: YawFrame, heading: Option<Angle>) -> Option<Angle> {
    Yaw::new(frame, angle).in_frame(YawFrame::Vehicle, heading).map(Yaw::angle)
}
