//! What the holder of secondary control adds to what the primary demands.
//!
//! Gimbal Protocol v2 leaves open how the two are mixed. Here the primary says where to look, and the rates of the
//! secondary move the camera away from there, by at most [`BOUND`] on each axis. The primary's next absolute
//! setpoint takes that back, on the axes it names; so does the end of secondary control. It is taken back at
//! [`RETURN`], so that nothing jumps.
//!
//! A primary that streams its setpoints does not take it back while the secondary moves: the camera would tremble.

use std::time::Duration;

use super::motion::clamp_yaw;
use super::situation::{Pose, Situation};
use super::{Aim, RateTimeouts, Tracking};
use crate::geometry::{Angle, AngularRate, Yaw};
use crate::gimbals::setpoint::{Pointing, Setpoint, Turning};
use crate::manager::request::{AxisDemand, Demand, DemandKind, Refusal};
use crate::timestamp::Timestamp;
use crate::wire::MavId;
use crate::wire::ids::GimbalFlags;

/// The furthest from where the primary would look.
pub const BOUND: Angle = Angle::from_degrees(20.0);

/// How fast it is taken back.
pub const RETURN: AngularRate = AngularRate::from_degrees_per_second(30.0);

/// An absolute setpoint that follows the one before so soon is part of a stream.
const STREAM: Duration = Duration::from_secs(1);

/// How far the secondary has moved the camera, and still does.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Nudge {
    by: Option<MavId>,
    pitch: Offset,
    yaw: Offset,
    /// When the last absolute setpoint came.
    absolute: Option<Timestamp>,
}

/// One axis.
#[derive(Clone, Copy, Debug, Default)]
struct Offset {
    at: Angle,
    rate: AngularRate,
    until: Option<Timestamp>,
    returns: bool,
}

impl Offset {
    fn moves(&self) -> bool {
        !self.rate.is_zero()
    }

    fn turn(&mut self, rate: AngularRate, until: Option<Timestamp>) {
        self.rate = rate;
        self.until = until;
        self.returns &= rate.is_zero();
    }

    fn stop(&mut self) {
        self.rate = AngularRate::ZERO;
        self.until = None;
    }

    fn take_back(&mut self) {
        self.stop();
        self.returns = true;
    }

    /// From `from` to `now`; true when its rate has just ended by itself.
    fn carry_on(&mut self, from: Timestamp, now: Timestamp) -> bool {
        if self.moves() {
            let end = self.until.map_or(now, |until| until.min(now));
            self.at = (self.at + self.rate.over(end.since(from))).clamp(-BOUND, BOUND);
            if self.until.is_some_and(|until| until <= now) {
                self.stop();
                return true;
            }
        } else if self.returns {
            let step = RETURN.over(now.since(from));
            self.at = if self.at.abs() <= step {
                self.returns = false;
                Angle::ZERO
            } else if self.at > Angle::ZERO {
                self.at - step
            } else {
                self.at + step
            };
        }
        false
    }

    /// How fast it moves the camera at this moment: not at all at its bound.
    fn velocity(&self) -> AngularRate {
        let outward = self.rate.radians_per_second().signum() == self.at.radians().signum();
        if self.at.abs() >= BOUND && outward { AngularRate::ZERO } else { self.rate }
    }
}

impl Nudge {
    pub(super) fn by(&self) -> Option<MavId> {
        self.by
    }

    /// Whether there is anything to be added.
    pub(super) fn is_active(&self) -> bool {
        [self.pitch, self.yaw].iter().any(|axis| axis.moves() || axis.at != Angle::ZERO)
    }

    pub(super) fn moves(&self) -> bool {
        self.pitch.moves() || self.yaw.moves()
    }

    pub(super) fn carry_on(&mut self, from: Timestamp, now: Timestamp) -> bool {
        let timed_out = [self.pitch.carry_on(from, now), self.yaw.carry_on(from, now)];
        timed_out.contains(&true)
    }

    pub(super) fn stop(&mut self) {
        self.pitch.stop();
        self.yaw.stop();
    }

    pub(super) fn take_back(&mut self) {
        self.by = None;
        self.pitch.take_back();
        self.yaw.take_back();
    }

    /// A rotation has no angle to return to: the camera goes on from where it looks.
    pub(super) fn stay(&mut self) {
        for axis in [&mut self.pitch, &mut self.yaw] {
            if axis.returns {
                *axis = Offset::default();
            }
        }
    }

    /// The primary has set these axes anew.
    pub(super) fn handle_absolute(&mut self, now: Timestamp, pitch: bool, yaw: bool) {
        if !pitch && !yaw {
            return;
        }
        let streams = self.absolute.replace(now).is_some_and(|before| now.since(before) < STREAM);
        for (axis, set) in [(&mut self.pitch, pitch), (&mut self.yaw, yaw)] {
            if set && !(streams && axis.moves()) {
                axis.take_back();
            }
        }
    }

    /// Where the gimbal would look without it.
    pub(super) fn taken_off(&self, pose: Pose) -> Pose {
        Pose { pitch: pose.pitch - self.pitch.at, yaw: pose.yaw - self.yaw.at, ..pose }
    }

    /// `setpoint` with it. Beyond the end stops nothing is added that would have to be taken back before the camera
    /// moves the other way.
    pub(super) fn added_to(&mut self, setpoint: Setpoint, situation: &Situation<'_>) -> Setpoint {
        if !self.is_active() {
            return setpoint;
        }
        match setpoint {
            Setpoint::Point(pointing) => {
                let limits = &situation.capabilities.limits;
                let frame = pointing.yaw.frame();
                let pitch = limits.clamp_pitch(pointing.pitch);
                let yaw = clamp_yaw(pointing.yaw.angle(), frame, situation);
                let nudged =
                    (limits.clamp_pitch(pitch + self.pitch.at), clamp_yaw(yaw + self.yaw.at, frame, situation));
                (self.pitch.at, self.yaw.at) = (nudged.0 - pitch, nudged.1 - yaw);
                Setpoint::Point(Pointing { pitch: nudged.0, yaw: Yaw::new(frame, nudged.1), ..pointing })
            }
            Setpoint::Turn(turning) => Setpoint::Turn(Turning {
                pitch: turning.pitch + self.pitch.velocity(),
                yaw: turning.yaw + self.yaw.velocity(),
                ..turning
            }),
            Setpoint::Retract | Setpoint::Neutral => setpoint,
        }
    }
}

impl Tracking {
    /// Whether what the gimbal is told is somebody else's than `secondary`, and can be added to.
    pub fn can_be_nudged_by(&self, secondary: MavId) -> bool {
        matches!(self.aim, Aim::Turn(_) | Aim::Point(_) | Aim::Roi(_)) && self.source != Some(secondary)
    }

    /// Moves the camera on top of what it is told. `demand` has rates only; an axis without one stands still.
    pub fn nudge(
        &mut self,
        now: Timestamp,
        secondary: MavId,
        demand: &Demand,
        situation: &Situation<'_>,
        timeouts: RateTimeouts,
    ) -> Result<(), Refusal> {
        self.carry_on(now, situation);
        if self.is_radio_controlled(now, situation) {
            return Err(Refusal::later("radio_control_has_it"));
        }
        let until = match demand.kind {
            DemandKind::Commanded => timeouts.commanded.map(|timeout| now + timeout),
            DemandKind::Streamed | DemandKind::Manual => Some(now + timeouts.streamed),
        };
        let rate = |axis: AxisDemand| axis.rate.unwrap_or(AngularRate::ZERO);
        self.nudge.by = Some(secondary);
        self.nudge.pitch.turn(rate(demand.pitch), until);
        self.nudge.yaw.turn(rate(demand.yaw), until);
        self.next = Some(now);
        Ok(())
    }

    /// Secondary control is over: the camera returns to where the primary would have it.
    pub fn end_nudge(&mut self) {
        self.nudge.take_back();
        if matches!(self.aim, Aim::Turn(_)) {
            self.nudge.stay();
        }
    }

    /// The primary is another one, or nobody: where the secondary moved the camera is where it is told to look from now on.
    /// Only a place that is looked at goes on to say where that would be.
    pub fn keep_nudge(&mut self) {
        if let Aim::Point(point) = &mut self.aim {
            point.pitch.shift(self.nudge.pitch.at);
            point.yaw.shift(self.nudge.yaw.at);
        }
        if !matches!(self.aim, Aim::Roi(_)) {
            self.nudge = Nudge { absolute: self.nudge.absolute, ..Nudge::default() };
        }
    }

    /// Who moves the camera, or has moved it, away from where the primary would look.
    pub fn nudged_by(&self) -> Option<MavId> {
        self.nudge.by
    }

    /// How far in pitch and yaw the camera is from where the primary would look.
    pub fn nudged(&self) -> (Angle, Angle) {
        (self.nudge.pitch.at, self.nudge.yaw.at)
    }
}

impl Demand {
    /// Whether rates are all it demands.
    pub fn is_rates_only(&self) -> bool {
        let axes = [self.roll, self.pitch, self.yaw];
        let more = GimbalFlags::RETRACT | GimbalFlags::NEUTRAL | GimbalFlags::RC_EXCLUSIVE | GimbalFlags::RC_MIXED;
        axes.iter().all(|axis| axis.angle.is_none())
            && axes.iter().any(|axis| axis.rate.is_some())
            && !self.flags.intersects(more)
    }

    /// Whether it is to turn no more, and nothing else.
    pub fn is_stop(&self) -> bool {
        self.kind != DemandKind::Manual && self.is_without_motion()
    }

    /// The same, or what a stick at rest sends.
    pub fn is_without_motion(&self) -> bool {
        let is_still = |rate: AngularRate| rate.is_zero();
        self.is_rates_only() && [self.roll, self.pitch, self.yaw].iter().all(|axis| axis.rate.is_none_or(is_still))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A rate ends when it ends, not at the next setpoint behind that.
    #[test]
    fn a_rate_moves_the_camera_for_as_long_as_it_lasts() {
        let mut axis = Offset::default();
        axis.turn(AngularRate::from_degrees_per_second(10.0), Some(Timestamp::from_millis(500)));

        assert!(axis.carry_on(Timestamp::ZERO, Timestamp::from_secs(1)), "it is told");

        assert!((axis.at.degrees() - 5.0).abs() < 1e-9, "{:?}", axis.at);
        assert!(!axis.moves() && !axis.carry_on(Timestamp::from_secs(1), Timestamp::from_secs(2)));
    }

    /// It is not said to turn where it does not: 284 has zero rates at the bound.
    #[test]
    fn at_its_bound_it_moves_inwards_only() {
        let mut axis = Offset::default();
        for (rate_dps, velocity_dps) in [(10.0, 0.0), (-10.0, -10.0)] {
            axis.turn(AngularRate::from_degrees_per_second(rate_dps), None);
            if rate_dps > 0.0 {
                assert!(!axis.carry_on(Timestamp::ZERO, Timestamp::from_secs(9)));
            }
            assert!((axis.velocity().degrees_per_second() - velocity_dps).abs() < 1e-9);
        }
    }
}
