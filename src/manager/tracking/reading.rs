//! From a demand to an aim: which frame it is in, which axes it leaves out, what the gimbal can do.
//!
//! A demand of zero rates and no angles stops what moves: a rotation, an angle approached at a rate, a region of interest.
//! It ends no angle, no neutral and no retract, however long ago they were asked for, nothing that the gimbal does by a function
//! of its own, and takes it from no radio control: some clients stream zero rates while nobody touches the stick, and
//! a last one often arrives behind the command that was meant to follow it.

use super::motion::{Axis, Motion, Point, Turn, clamp_yaw};
use super::situation::{Pose, Situation};
use super::{Aim, RateTimeouts, Tracking};
use crate::geometry::{Angle, AngularRate, Yaw, YawFrame};
use crate::gimbals::adapt;
use crate::gimbals::setpoint::{RadioControl, Setpoint, Stabilised, Turning, yaw_frame};
use crate::manager::request::{AxisDemand, Demand, DemandKind, Refusal};
use crate::timestamp::Timestamp;
use crate::wire::ids::{CapFlags, GimbalFlags};

impl Tracking {
    /// `None` for a demand that changes nothing.
    pub(super) fn read_demand(
        &self,
        now: Timestamp,
        demand: &Demand,
        situation: &Situation<'_>,
        timeouts: RateTimeouts,
    ) -> Result<Option<Aim>, Refusal> {
        let capabilities = situation.capabilities;
        let flags = demand.flags;
        if flags.intersects(GimbalFlags::RC_EXCLUSIVE | GimbalFlags::RC_MIXED)
            && !capabilities.flags.contains(CapFlags::HAS_RC_INPUTS)
        {
            return Err(Refusal::denied(capabilities.why_no_radio_control("no_rc_inputs")));
        }
        if flags.contains(GimbalFlags::RETRACT) {
            if !capabilities.flags.contains(CapFlags::HAS_RETRACT) {
                return Err(Refusal::denied("cannot_retract"));
            }
            return Ok(Some(Aim::Retract));
        }
        if flags.contains(GimbalFlags::NEUTRAL) {
            return Ok(Some(Aim::neutral(capabilities)));
        }
        let numbers = yaw_frame(flags).ok_or(Refusal::denied("both_yaw_frames"))?;
        let wanted =
            Stabilised { roll: flags.contains(GimbalFlags::ROLL_LOCK), pitch: flags.contains(GimbalFlags::PITCH_LOCK) };
        let stabilised = adapt::stabilised(wanted, capabilities.flags);
        let until = match demand.kind {
            DemandKind::Commanded => timeouts.commanded.map(|timeout| now + timeout),
            DemandKind::Streamed | DemandKind::Manual => Some(now + timeouts.streamed),
        };
        let [roll, pitch, yaw] = [demand.roll, demand.pitch, demand.yaw].map(AxisDemand::without_zero_limit);
        let any_angle = [roll, pitch, yaw].iter().any(|axis| axis.angle.is_some());
        let any_rate = [roll, pitch, yaw].iter().any(|axis| axis.rate.is_some());
        let by_rates = any_rate && !any_angle;
        let stops = by_rates && [roll, pitch, yaw].iter().all(|axis| axis.rate.is_none_or(|rate| rate.is_zero()));
        let mut hold = if flags.intersects(GimbalFlags::YAW_LOCK | GimbalFlags::YAW_IN_EARTH_FRAME) {
            YawFrame::Earth
        } else {
            YawFrame::Vehicle
        };
        if let Err(refusal) = self.need_frame(hold, situation) {
            // To stop takes no heading.
            if !stops {
                return Err(refusal);
            }
            hold = situation.device_frame(hold);
        }
        let reference = self.reference(hold, situation);
        let radio_control = RadioControl::of_flags(flags);
        let stands = match &self.aim {
            Aim::Retract | Aim::Neutral => true,
            Aim::Turn(turn) => turn.turning.is_zero() && turn.turning.yaw_frame == hold,
            Aim::Point(point) => !point.moves() && reference.is_none(),
            Aim::Idle => self.left_to_itself,
            Aim::Roi(_) => false,
        };
        if stops && (stands || self.is_handed_over() && radio_control != RadioControl::Exclusive) {
            return Ok(None);
        }
        let stops_angles = stops && matches!(self.aim, Aim::Point(_)) && reference.is_some();
        let keeps_angles = stops_angles || radio_control == RadioControl::Exclusive;
        if by_rates && !keeps_angles && capabilities.turns && situation.device_frame(hold) == hold {
            let rate = |axis: AxisDemand| axis.rate.unwrap_or(AngularRate::ZERO);
            let has_roll = capabilities.flags.contains(CapFlags::HAS_ROLL_AXIS);
            let turning = Turning {
                roll: roll.rate.filter(|_| has_roll),
                pitch: rate(pitch),
                yaw: rate(yaw),
                yaw_frame: hold,
                stabilised,
                radio_control,
            };
            let mut turn = Turn { turning, stops_at: until, settles_at: None };
            if turn.turning.is_zero() {
                turn.stop(now);
            }
            return Ok(Some(Aim::Turn(turn)));
        }
        let missing = self.nothing_to_keep(hold, situation);
        if radio_control == RadioControl::Exclusive {
            let kept = reference.ok_or(missing)?;
            let [roll, pitch, yaw] = [kept.roll, kept.pitch, kept.yaw].map(|axis| Axis::still(axis.at));
            return Ok(Some(Aim::Point(Point { roll, pitch, yaw, stabilised, radio_control, ..kept })));
        }
        let yaw_angle = match yaw.angle {
            Some(angle) => {
                let yaw = Yaw::new(numbers, angle).in_frame(hold, situation.heading);
                let angle = yaw.ok_or(Refusal::later("no_heading"))?.angle();
                Some(if hold == YawFrame::Vehicle { clamp_yaw(angle, hold, situation) } else { angle })
            }
            None => None,
        };
        let measured = self.unnudged_pose(hold, situation);
        // A ramp begins where the gimbal is, unless the axis is on its way already: then it goes on from there.
        let begin = |reference: Option<Axis>, measured: Option<Angle>| match (reference, measured) {
            (Some(Axis { at, motion: Motion::Slew { .. } | Motion::Turning { .. } }), _) => Ok(at),
            (_, Some(at)) => Ok(at),
            (Some(Axis { at, .. }), None) => Ok(at),
            (None, None) => Err(missing),
        };
        // An axis left out goes on to its angle, and turns no further: rates are replaced on all axes at once (D7).
        let keep = |axis: Axis| match axis.motion {
            Motion::Slew { .. } if !by_rates => axis,
            Motion::Turning { rate, .. } => Axis { at: axis.at, motion: Motion::Stopping { rate } },
            Motion::Still | Motion::Slew { .. } | Motion::Stopping { .. } => Axis::still(axis.at),
        };
        let axis = |wanted: AxisDemand, angle: Option<Angle>, reference: Option<Axis>, measured: Option<Angle>| match (
            angle,
            wanted.rate,
        ) {
            (Some(angle), None) => Ok(Axis::still(angle)),
            (Some(to), Some(rate)) => {
                Ok(Axis { at: begin(reference, measured)?, motion: Motion::Slew { to, rate: rate.abs() } })
            }
            (None, Some(rate)) if !rate.is_zero() => {
                Ok(Axis { at: begin(reference, measured)?, motion: Motion::Turning { rate, until } })
            }
            (None, _) => Ok(keep(reference.ok_or(missing)?)),
        };
        let has_roll = capabilities.flags.contains(CapFlags::HAS_ROLL_AXIS);
        let level = Axis::still(Angle::ZERO);
        let limits = &capabilities.limits;
        Ok(Some(Aim::Point(Point {
            roll: match roll.angle {
                Some(angle) if has_roll => Axis::still(limits.clamp_roll(angle)),
                _ => level,
            },
            pitch: axis(
                pitch,
                pitch.angle.map(|angle| limits.clamp_pitch(angle)),
                reference.map(|reference| reference.pitch),
                measured.map(|pose| pose.pitch),
            )?,
            yaw: axis(yaw, yaw_angle, reference.map(|reference| reference.yaw), measured.map(|pose| pose.yaw))?,
            frame: hold,
            stabilised,
            radio_control,
        })))
    }

    /// Fails where the device needs its yaw in another frame than it is held in, and no heading is known.
    pub(super) fn need_frame(&self, hold: YawFrame, situation: &Situation<'_>) -> Result<(), Refusal> {
        if situation.device_frame(hold) != hold && situation.heading.is_none() {
            return Err(Refusal::later("no_heading"));
        }
        Ok(())
    }

    /// What an axis without a demand keeps: its setpoint where it has one, else where the gimbal is.
    pub(super) fn reference(&self, frame: YawFrame, situation: &Situation<'_>) -> Option<Point> {
        let stabilised = Stabilised::BOTH;
        // What it was told before its radio control had it is none of its angles any more.
        if let Aim::Point(point) = self.aim
            && point.radio_control != RadioControl::Exclusive
        {
            if point.frame == frame {
                return Some(point);
            }
            // From where the end stops let it look, which is what the picture shows.
            let yaw = Yaw::new(point.frame, clamp_yaw(point.yaw.at, point.frame, situation));
            let yaw = yaw.in_frame(frame, situation.heading)?;
            return Some(Point { yaw: Axis::still(yaw.angle()), frame, ..point });
        }
        if let (Aim::Roi(_), Some(Setpoint::Point(last))) = (&self.aim, self.last) {
            let yaw = last.yaw.in_frame(frame, situation.heading)?.angle();
            let pose = self.nudge.taken_off(Pose { roll: last.roll, pitch: last.pitch, yaw });
            return Some(Point::still(pose, frame, stabilised));
        }
        let pose = self.unnudged_pose(frame, situation)?;
        Some(Point::still(pose, frame, stabilised))
    }

    /// Why there is nothing to keep: where the gimbal looks is not known, or not from where `frame` counts.
    pub(super) fn nothing_to_keep(&self, frame: YawFrame, situation: &Situation<'_>) -> Refusal {
        let is_known = [YawFrame::Vehicle, YawFrame::Earth]
            .into_iter()
            .any(|other| other != frame && situation.measured_pose(other).is_some());
        Refusal::later(if is_known { "no_heading" } else { "no_attitude" })
    }

    /// Where the gimbal would look now if nobody nudged it, yaw in `frame`.
    pub(super) fn unnudged_pose(&self, frame: YawFrame, situation: &Situation<'_>) -> Option<Pose> {
        situation.measured_pose(frame).map(|pose| self.nudge.taken_off(pose))
    }
}

impl AxisDemand {
    /// A rate of exactly 0 beside an angle is a field left empty, not a limit that forbids moving.
    fn without_zero_limit(self) -> Self {
        let rate = self.rate.filter(|rate| self.angle.is_none() || !rate.is_zero());
        Self { rate, ..self }
    }
}
