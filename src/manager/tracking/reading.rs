//! From a demand to an aim: which frame it is in, which axes it leaves out, what the gimbal can do.

use super::motion::{Axis, Motion, Point, Turn, is_zero};
use super::situation::Situation;
use super::{Aim, RateTimeouts, Tracking, neutral};
use crate::geometry::{Angle, AngularRate, Yaw, YawFrame};
use crate::gimbals::adapt;
use crate::gimbals::setpoint::{Setpoint, Stabilised, Turning, yaw_frame};
use crate::manager::request::{AxisDemand, Demand, DemandKind, Refusal};
use crate::timestamp::Timestamp;
use crate::wire::ids::{CapFlags, GimbalFlags};

impl Tracking {
    pub(super) fn read_demand(
        &self,
        now: Timestamp,
        demand: &Demand,
        situation: &Situation<'_>,
        timeouts: RateTimeouts,
    ) -> Result<Aim, Refusal> {
        let capabilities = situation.capabilities;
        let flags = demand.flags;
        if flags.intersects(GimbalFlags::RC_EXCLUSIVE | GimbalFlags::RC_MIXED)
            && !capabilities.flags.contains(CapFlags::HAS_RC_INPUTS)
        {
            return Err(Refusal::denied("no_rc_inputs"));
        }
        if flags.contains(GimbalFlags::RETRACT) {
            if !capabilities.flags.contains(CapFlags::HAS_RETRACT) {
                return Err(Refusal::denied("cannot_retract"));
            }
            return Ok(Aim::Retract);
        }
        if flags.contains(GimbalFlags::NEUTRAL) {
            return Ok(neutral(capabilities));
        }
        let numbers = yaw_frame(flags).ok_or(Refusal::denied("both_yaw_frames"))?;
        let hold = if flags.intersects(GimbalFlags::YAW_LOCK | GimbalFlags::YAW_IN_EARTH_FRAME) {
            YawFrame::Earth
        } else {
            YawFrame::Vehicle
        };
        self.need_frame(hold, situation)?;
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
        if any_rate && !any_angle && situation.device_frame(hold) == hold {
            let rate = |axis: AxisDemand| axis.rate.unwrap_or(AngularRate::ZERO);
            let has_roll = capabilities.flags.contains(CapFlags::HAS_ROLL_AXIS);
            let turning = Turning {
                roll: roll.rate.filter(|_| has_roll),
                pitch: rate(pitch),
                yaw: rate(yaw),
                yaw_frame: hold,
                stabilised,
            };
            let mut turn = Turn { turning, stops_at: until, settles_at: None };
            if is_zero(&turn.turning) {
                turn.stop(now);
            }
            return Ok(Aim::Turn(turn));
        }
        let reference = self.reference(hold, situation);
        let missing = Refusal::later("no_attitude");
        let yaw_angle = match yaw.angle {
            Some(angle) => {
                let yaw = Yaw::new(numbers, angle).in_frame(hold, situation.heading);
                Some(yaw.ok_or(Refusal::later("no_heading"))?.angle())
            }
            None => None,
        };
        let measured = situation.measured_pose(hold);
        // A ramp begins where the gimbal is, unless the axis is on its way already: then it goes on from there.
        let begin = |reference: Option<Axis>, measured: Option<Angle>| match (reference, measured) {
            (Some(Axis { at, motion: Motion::Slew { .. } | Motion::Turning { .. } }), _) => Ok(at),
            (_, Some(at)) => Ok(at),
            (Some(Axis { at, .. }), None) => Ok(at),
            (None, None) => Err(missing),
        };
        // With rates alone an axis without one stands still; otherwise it keeps what it does.
        let keep = |axis: Axis| if any_rate && !any_angle { Axis::still(axis.at) } else { axis };
        let axis = |wanted: AxisDemand, angle: Option<Angle>, reference: Option<Axis>, measured: Option<Angle>| match (
            angle,
            wanted.rate,
        ) {
            (Some(angle), None) => Ok(Axis::still(angle)),
            (Some(to), Some(rate)) => {
                Ok(Axis { at: begin(reference, measured)?, motion: Motion::Slew { to, rate: rate.abs() } })
            }
            (None, Some(rate)) => Ok(Axis { at: begin(reference, measured)?, motion: Motion::Turning { rate, until } }),
            (None, None) => Ok(keep(reference.ok_or(missing)?)),
        };
        let has_roll = capabilities.flags.contains(CapFlags::HAS_ROLL_AXIS);
        let level = Axis::still(Angle::ZERO);
        Ok(Aim::Point(Point {
            roll: match roll.angle {
                Some(angle) if has_roll => Axis::still(angle),
                _ => level,
            },
            pitch: axis(
                pitch,
                pitch.angle,
                reference.map(|reference| reference.pitch),
                measured.map(|pose| pose.pitch),
            )?,
            yaw: axis(yaw, yaw_angle, reference.map(|reference| reference.yaw), measured.map(|pose| pose.yaw))?,
            frame: hold,
            stabilised,
        }))
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
        if let Aim::Point(point) = self.aim {
            if point.frame == frame {
                return Some(point);
            }
            let yaw = Yaw::new(point.frame, point.yaw.at).in_frame(frame, situation.heading)?;
            return Some(Point { yaw: Axis::still(yaw.angle()), frame, ..point });
        }
        if let (Aim::Roi(_), Some(Setpoint::Point(last))) = (&self.aim, self.last) {
            let yaw = last.yaw.in_frame(frame, situation.heading)?;
            return Some(Point {
                roll: Axis::still(last.roll),
                pitch: Axis::still(last.pitch),
                yaw: Axis::still(yaw.angle()),
                frame,
                stabilised,
            });
        }
        let pose = situation.measured_pose(frame)?;
        Some(Point::still(pose, frame, stabilised))
    }
}

impl AxisDemand {
    /// A rate of exactly 0 beside an angle is a field left empty, not a limit that forbids moving.
    fn without_zero_limit(self) -> Self {
        let rate = self.rate.filter(|rate| self.angle.is_none() || rate.radians_per_second() != 0.0);
        Self { rate, ..self }
    }
}
