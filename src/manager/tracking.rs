//! What the gimbal is to do: from demands to a stream of setpoints.
//!
//! Nothing is sent before the first demand, no change of frame moves the camera, and every rate ends by itself.

mod aim;
mod motion;
mod nudge;
mod radio_control;
mod reading;
mod roi;
mod situation;

use std::time::Duration;

use super::request::{Demand, Refusal};
use crate::geometry::{Angle, Position, Yaw, YawFrame};
use crate::gimbals::adapt;
use crate::gimbals::capabilities::Capabilities;
use crate::gimbals::setpoint::{Pointing, Setpoint, Stabilised, Turning};
use crate::timestamp::Timestamp;
use crate::wire::MavId;
use aim::Aim;
pub use motion::SETTLE;
use motion::{Point, Turn, clamp_pitch, clamp_yaw, way};
use nudge::Nudge;
use roi::Roi;
use situation::Pose;
pub use situation::Situation;

/// How long rates last.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RateTimeouts {
    /// Of a rate in a message that its sender repeats.
    pub streamed: Duration,
    /// Of a rate in a command; `None` lasts until the next demand.
    pub commanded: Option<Duration>,
}

/// The current aim of one gimbal.
#[derive(Clone, Debug)]
pub struct Tracking {
    aim: Aim,
    source: Option<MavId>,
    period: Duration,
    next: Option<Timestamp>,
    /// The aim was carried on up to here.
    carried_to: Timestamp,
    last: Option<Setpoint>,
    /// Whose rate has ended because it was not refreshed, until somebody asks.
    timed_out: Option<MavId>,
    /// What the holder of secondary control adds.
    nudge: Nudge,
    last_at: Timestamp,
    /// The vehicle's heading with which it was reckoned.
    last_heading: Option<Angle>,
    /// What the aim takes is not known at present, so the last setpoint is held.
    stale: bool,
    /// When radio control was last asked to let go of the gimbal.
    let_go: Option<Timestamp>,
    /// It was left to its radio control until the next demand, by something else than a demand.
    left_to_radio_control: bool,
    /// It does something by a function of its own, until the next demand.
    left_to_itself: bool,
}

impl Tracking {
    /// `rate_hz`: how often an active setpoint is repeated.
    pub fn new(rate_hz: u8) -> Self {
        Self {
            aim: Aim::Idle,
            source: None,
            period: Duration::from_micros(1_000_000 / u64::from(rate_hz.max(1))),
            next: None,
            carried_to: Timestamp::ZERO,
            last: None,
            timed_out: None,
            nudge: Nudge::default(),
            last_at: Timestamp::ZERO,
            last_heading: None,
            stale: false,
            let_go: None,
            left_to_radio_control: false,
            left_to_itself: false,
        }
    }

    /// Takes a demand that passed the gate; false where it changes nothing.
    pub fn demand(
        &mut self,
        now: Timestamp,
        source: MavId,
        demand: &Demand,
        situation: &Situation<'_>,
        timeouts: RateTimeouts,
    ) -> Result<bool, Refusal> {
        self.carry_on(now, situation);
        let Some(aim) = self.read_demand(now, demand, situation, timeouts)? else { return Ok(false) };
        self.change_hands(now, &aim, situation)?;
        self.begin(now, source, aim);
        let whole = matches!(aim, Aim::Retract | Aim::Neutral);
        self.nudge.handle_absolute(now, whole || demand.pitch.angle.is_some(), whole || demand.yaw.angle.is_some());
        Ok(true)
    }

    /// Whether a demand could be carried out.
    pub fn check_demand(
        &self,
        now: Timestamp,
        demand: &Demand,
        situation: &Situation<'_>,
        timeouts: RateTimeouts,
    ) -> Result<(), Refusal> {
        self.read_demand(now, demand, situation, timeouts).map(|_| ())
    }

    /// Points at a place until something else is demanded.
    pub fn point_at(
        &mut self,
        now: Timestamp,
        source: MavId,
        place: Position,
        situation: &Situation<'_>,
    ) -> Result<(), Refusal> {
        self.check_place(situation)?;
        let aim = Aim::Roi(Roi::new(place));
        self.change_hands(now, &aim, situation)?;
        self.begin(now, source, aim);
        self.nudge.handle_absolute(now, true, true);
        Ok(())
    }

    /// Whether enough is known to look at a place.
    pub fn check_place(&self, situation: &Situation<'_>) -> Result<(), Refusal> {
        if situation.position.is_none() {
            return Err(Refusal::later("no_vehicle_position"));
        }
        self.need_frame(YawFrame::Earth, situation)
    }

    /// Keeps the direction that the gimbal was told, or else has, yaw in `frame`.
    pub fn hold(
        &mut self,
        now: Timestamp,
        source: MavId,
        frame: YawFrame,
        situation: &Situation<'_>,
    ) -> Result<(), Refusal> {
        self.carry_on(now, situation);
        self.need_frame(frame, situation)?;
        // What it was told may be known from North only, and where that is no longer.
        let measured = || self.unnudged_pose(frame, situation).map(|pose| Point::still(pose, frame, Stabilised::BOTH));
        let kept = self.reference(frame, situation).or_else(measured);
        let kept = kept.ok_or_else(|| self.nothing_to_keep(frame, situation))?;
        let pose = Pose { roll: kept.roll.at, pitch: kept.pitch.at, yaw: kept.yaw.at };
        let aim = Aim::Point(Point::still(pose, frame, kept.stabilised));
        self.change_hands(now, &aim, situation)?;
        self.begin(now, source, aim);
        Ok(())
    }

    /// Stays where it looks at this moment, on its way or not; the yaw in `frame`, if that is possible.
    pub fn stay(
        &mut self,
        now: Timestamp,
        source: MavId,
        frame: YawFrame,
        situation: &Situation<'_>,
    ) -> Result<(), Refusal> {
        self.carry_on(now, situation);
        self.nudge.stop();
        // To stop takes no heading.
        let frame = if self.need_frame(frame, situation).is_ok() { frame } else { situation.device_frame(frame) };
        let Some(pose) = self.unnudged_pose(frame, situation) else {
            return self.hold(now, source, frame, situation);
        };
        let aim = Aim::Point(Point::still(pose, frame, Stabilised::BOTH));
        self.change_hands(now, &aim, situation)?;
        self.begin(now, source, aim);
        Ok(())
    }

    /// Ends pointing at a place: neutral where the gimbal knows such, straight ahead otherwise. True if there was one.
    pub fn end_roi(&mut self, now: Timestamp, source: MavId, capabilities: &Capabilities) -> bool {
        let was_active = matches!(self.aim, Aim::Roi(_));
        if was_active {
            self.begin(now, source, Aim::neutral(capabilities));
            self.nudge.handle_absolute(now, true, true);
        }
        was_active
    }

    /// Stops every rotation, keeping the angles; true when there was one.
    pub fn stop_rates(&mut self, now: Timestamp) -> bool {
        let nudged = self.nudge.moves();
        if nudged {
            self.nudge.stop();
        }
        let stopped = self.aim.stop_rates(now) || nudged;
        if stopped {
            self.next = Some(now);
        }
        stopped
    }

    /// Whether the gimbal is told to turn on and on.
    pub fn is_rotating(&self) -> bool {
        self.aim.is_rotating()
    }

    /// The rotation that the device was told last and was not told to stop.
    pub fn unstopped(&self) -> Option<Turning> {
        match self.last {
            Some(Setpoint::Turn(turning)) if !turning.is_zero() => Some(turning),
            _ => None,
        }
    }

    /// The device may still be turning as it was told before it was lost or restarted: it is stopped, and kept where it
    /// comes to rest.
    pub fn halt(&mut self, now: Timestamp, turning: Turning) {
        let turning = Turning { yaw_frame: YawFrame::Vehicle, ..turning };
        let mut turn = Turn { turning, stops_at: None, settles_at: None };
        turn.stop(now);
        self.aim = Aim::Turn(turn);
        self.source = None;
        self.carried_to = now;
        self.next = Some(now);
    }

    /// The gimbal is gone: when it comes back it is not moved until somebody asks for it.
    pub fn forget(&mut self) {
        self.aim = Aim::Idle;
        self.source = None;
        self.next = None;
        self.last = None;
        self.stale = false;
        self.let_go = None;
        (self.left_to_radio_control, self.left_to_itself) = (false, false);
        self.nudge = Nudge::default();
    }

    /// The gimbal does what it was asked by name, until somebody demands something.
    pub fn leave_to_itself(&mut self) {
        self.forget();
        self.left_to_itself = true;
    }

    /// More is known of how the vehicle is turned: where the setpoint follows it, the next one is due unless one has just
    /// been sent.
    pub fn handle_turned(&mut self, now: Timestamp, situation: &Situation<'_>) {
        let turned = situation.heading.is_some() && situation.heading != self.last_heading;
        if self.aim.follows_vehicle(situation) && turned && now.since(self.last_at) >= self.period * 4 / 5 {
            self.next = Some(now);
        }
    }

    /// The next setpoint for the device, if one is due.
    pub fn steer(&mut self, now: Timestamp, situation: &Situation<'_>) -> Option<Setpoint> {
        if self.next.is_none_or(|next| next > now) {
            return None;
        }
        self.carry_on(now, situation);
        if self.is_radio_controlled(now, situation) {
            if self.is_handed_over() {
                self.next = Some(now + self.period);
            } else {
                // What was asked for before must not move the gimbal when its radio control lets go of it.
                self.forget();
            }
            return None;
        }
        let wanted = self.setpoint(situation).map(|wanted| self.nudge.added_to(wanted, situation));
        let wanted = wanted.and_then(|wanted| self.for_device(wanted, situation));
        self.note_stale(wanted.is_none() || self.has_lost_the_vehicle(situation));
        self.last = wanted.or_else(|| self.last.map(|last| situation.without_north(last.at_rest())));
        self.last_at = now;
        self.last_heading = situation.heading;
        self.next = (self.aim != Aim::Idle).then(|| now + self.period);
        self.last
    }

    pub fn poll_timeout(&self) -> Option<Timestamp> {
        let turn = match &self.aim {
            Aim::Turn(turn) => turn.stops_at,
            _ => None,
        };
        [self.next, turn].into_iter().flatten().min()
    }

    /// Times that lie between two setpoints; call before [`steer`](Self::steer).
    pub fn handle_timeout(&mut self, now: Timestamp) {
        if let Aim::Turn(turn) = &mut self.aim
            && turn.stops_at.is_some_and(|at| at <= now)
        {
            turn.stop(now);
            self.next = Some(now);
            self.timed_out = self.source;
        }
    }

    /// Whose rate has ended because it was not refreshed; told once.
    pub fn take_timed_out(&mut self) -> Option<MavId> {
        self.timed_out.take()
    }

    /// Whether the setpoint is one of the past, because position or heading of the vehicle are not known any more.
    pub fn is_stale(&self) -> bool {
        self.stale
    }

    /// The latest setpoint, as the device was told.
    pub fn last(&self) -> Option<Setpoint> {
        self.last
    }

    /// Whose demand is being carried out.
    pub fn source(&self) -> Option<MavId> {
        self.source
    }

    /// Whether yaw is held to North.
    pub fn is_locked(&self) -> bool {
        self.aim.is_locked()
    }

    /// The same of what is demanded; `None` where nothing is, or the gimbal is left to its radio control.
    pub fn holds_north(&self) -> Option<bool> {
        let is_demanded = self.aim != Aim::Idle && !self.is_handed_over();
        is_demanded.then(|| self.is_locked())
    }

    pub fn roi(&self) -> Option<Position> {
        self.aim.place()
    }

    /// `None` while nothing was demanded, else a word for people.
    pub fn mode(&self) -> Option<&'static str> {
        self.aim.name()
    }

    fn begin(&mut self, now: Timestamp, source: MavId, aim: Aim) {
        self.aim = aim;
        (self.left_to_radio_control, self.left_to_itself) = (false, false);
        self.source = Some(source);
        self.carried_to = now;
        self.next = Some(now);
        if matches!(aim, Aim::Turn(_)) {
            self.nudge.stay();
        }
    }

    /// Brings the aim up to `now`: axes that are on their way move, rates that have run out end.
    fn carry_on(&mut self, now: Timestamp, situation: &Situation<'_>) {
        let passed = now.since(self.carried_to);
        let nudged_by = self.nudge.by();
        if self.nudge.carry_on(self.carried_to, now) {
            self.timed_out = nudged_by;
        }
        let nudge = self.nudge;
        let unnudged = |frame| situation.measured_pose(frame).map(|pose| nudge.taken_off(pose));
        self.carried_to = now;
        match &mut self.aim {
            Aim::Turn(turn) => {
                if turn.settles_at.is_some_and(|at| at <= now)
                    && let Some(pose) = unnudged(turn.turning.yaw_frame)
                {
                    let turning = turn.turning;
                    self.aim = Aim::Point(Point::still(pose, turning.yaw_frame, turning.stabilised));
                } else if situation.device_frame(turn.turning.yaw_frame) != turn.turning.yaw_frame
                    && situation.heading.is_some()
                    && let Some(pose) = unnudged(turn.turning.yaw_frame)
                {
                    // The device has ceased to take this frame: we turn its angles. Without a heading it is told to stop.
                    self.aim = Aim::Point(turn.in_angles(pose));
                }
            }
            Aim::Point(point) => {
                let limits = &situation.capabilities.limits;
                let straight = |from, to| to - from;
                let (frame, from) = (point.frame, point.pitch.at);
                let way = |from, to| way(from, to, frame, situation);
                // What it cannot be told it does not do meanwhile, and would do all at once later.
                let has_frame = situation.device_frame(frame) == frame || situation.heading.is_some();
                let can_be_told = has_frame && !situation.is_held_back;
                let passed = if can_be_told { passed } else { Duration::ZERO };
                let measured = unnudged(frame);
                let [roll, pitch, yaw] =
                    [measured.map(|pose| pose.roll), measured.map(|pose| pose.pitch), measured.map(|pose| pose.yaw)];
                let timed_out = [
                    point.roll.carry_on(now, passed, roll, straight, |angle| limits.clamp_roll(angle)),
                    point.pitch.carry_on(now, passed, pitch, straight, |angle| clamp_pitch(angle, from, situation)),
                    point.yaw.carry_on(now, passed, yaw, way, |angle| clamp_yaw(angle, frame, situation)),
                ];
                if timed_out.contains(&true) {
                    self.timed_out = self.source;
                }
            }
            Aim::Roi(roi) => roi.look_from(situation.position),
            Aim::Idle | Aim::Retract | Aim::Neutral => {}
        }
    }

    /// The place is looked at from where the vehicle was.
    fn has_lost_the_vehicle(&self, situation: &Situation<'_>) -> bool {
        matches!(self.aim, Aim::Roi(_)) && situation.position.is_none()
    }

    fn note_stale(&mut self, stale: bool) {
        if stale != self.stale {
            let mode = self.mode();
            if stale {
                tracing::warn!(mode, "the vehicle's position or heading is missing: the last setpoint is held");
            } else {
                tracing::info!(mode, "the vehicle's position and heading are back");
            }
        }
        self.stale = stale;
    }

    /// The setpoint of the aim, yaw in the frame it is held in; `None` where what it takes is not known.
    fn setpoint(&self, situation: &Situation<'_>) -> Option<Setpoint> {
        match self.aim {
            Aim::Idle => None,
            Aim::Retract => Some(Setpoint::Retract),
            Aim::Neutral => Some(Setpoint::Neutral),
            Aim::Turn(turn) => Some(Setpoint::Turn(turn.turning)),
            Aim::Point(point) => Some(point.setpoint()),
            Aim::Roi(roi) => {
                let yaw_now = || self.reference(YawFrame::Earth, situation).map(|kept| kept.yaw.at);
                roi.direction(yaw_now).map(|direction| direction.setpoint())
            }
        }
    }

    fn for_device(&self, setpoint: Setpoint, situation: &Situation<'_>) -> Option<Setpoint> {
        let hold = match setpoint {
            Setpoint::Point(pointing) => pointing.yaw.frame(),
            Setpoint::Turn(turning) => turning.yaw_frame,
            Setpoint::Retract | Setpoint::Neutral => YawFrame::Vehicle,
        };
        let yaw_now = match self.last {
            Some(Setpoint::Point(Pointing { yaw: Yaw::InVehicleFrame(yaw), .. })) => yaw,
            _ => situation.measured_pose(YawFrame::Vehicle).map_or(Angle::ZERO, |pose| pose.yaw),
        };
        let frame = situation.device_frame(hold);
        adapt::to_device(setpoint, frame, situation.heading, &situation.capabilities.limits, yaw_now)
    }
}
