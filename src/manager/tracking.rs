//! What the gimbal is to do: from demands to a stream of setpoints.
//!
//! Nothing is sent before the first demand, no change of frame moves the camera, and every rate ends by itself.

use std::time::Duration;

use super::request::{AxisDemand, Demand, DemandKind, Refusal};
use crate::geometry::{Angle, AngularRate, Position, Yaw, YawFrame};
use crate::gimbals::adapt;
use crate::gimbals::capabilities::Capabilities;
use crate::gimbals::report::GimbalStatus;
use crate::gimbals::setpoint::{Pointing, Setpoint, Stabilised, Turning, yaw_frame};
use crate::gimbals::settings::DeviceYawFrame;
use crate::timestamp::Timestamp;
use crate::wire::MavId;
use crate::wire::ids::{CapFlags, GimbalFlags};

/// After a rotation was stopped the gimbal gets so long to come to rest; then its attitude is held.
pub const SETTLE: Duration = Duration::from_millis(300);

/// What the tracking has to go by at one moment.
#[derive(Clone, Copy, Debug)]
pub struct Situation<'a> {
    /// The gimbal's latest attitude, if it is fresh.
    pub measured: Option<GimbalStatus>,
    /// The vehicle's heading, as the gimbal or else the autopilot knows it.
    pub heading: Option<Angle>,
    /// The vehicle's position, if it is fresh.
    pub position: Option<Position>,
    pub capabilities: &'a Capabilities,
    pub accepts_earth_yaw: bool,
    pub device_yaw_frame: DeviceYawFrame,
}

impl Situation<'_> {
    /// The frame in which the device is told a yaw that is to be held in `frame`.
    fn device_frame(&self, frame: YawFrame) -> YawFrame {
        match self.device_yaw_frame {
            DeviceYawFrame::Auto if self.accepts_earth_yaw => frame,
            DeviceYawFrame::Auto | DeviceYawFrame::Vehicle => YawFrame::Vehicle,
            DeviceYawFrame::Earth => YawFrame::Earth,
        }
    }

    /// Where the gimbal looks now, yaw in `frame`.
    fn measured_pose(&self, frame: YawFrame) -> Option<Pose> {
        let attitude = self.measured?.attitude;
        let angles = attitude.angles();
        let yaw = attitude.yaw().in_frame(frame, self.heading)?.angle();
        Some(Pose { roll: angles.roll, pitch: angles.pitch, yaw })
    }
}

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
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Aim {
    Idle,
    Retract,
    Neutral,
    Turn(Turn),
    Point(Point),
    Roi(Position),
}

/// A rotation that the device carries out by itself.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Turn {
    turning: Turning,
    stops_at: Option<Timestamp>,
    /// The rates are zero, and the attitude then is to be held.
    settles_at: Option<Timestamp>,
}

/// Angles, which may be on their way.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Point {
    roll: Axis,
    pitch: Axis,
    yaw: Axis,
    frame: YawFrame,
    stabilised: Stabilised,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Axis {
    at: Angle,
    motion: Motion,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Motion {
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
}

#[derive(Clone, Copy, Debug)]
struct Pose {
    roll: Angle,
    pitch: Angle,
    yaw: Angle,
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
        }
    }

    /// Takes a demand that passed the gate.
    pub fn demand(
        &mut self,
        now: Timestamp,
        source: MavId,
        demand: &Demand,
        situation: &Situation<'_>,
        timeouts: RateTimeouts,
    ) -> Result<(), Refusal> {
        self.carry_on(now, situation);
        let aim = self.read_demand(now, demand, situation, timeouts)?;
        self.begin(now, source, aim);
        Ok(())
    }

    /// Points at a place until something else is demanded.
    pub fn point_at(
        &mut self,
        now: Timestamp,
        source: MavId,
        place: Position,
        situation: &Situation<'_>,
    ) -> Result<(), Refusal> {
        if situation.position.is_none() {
            return Err(Refusal::later("no_vehicle_position"));
        }
        self.need_frame(YawFrame::Earth, situation)?;
        self.begin(now, source, Aim::Roi(place));
        Ok(())
    }

    /// Ends pointing at a place: neutral where the gimbal knows such, straight ahead otherwise. True if there was one.
    pub fn end_roi(&mut self, now: Timestamp, source: MavId, capabilities: &Capabilities) -> bool {
        let was_active = matches!(self.aim, Aim::Roi(_));
        if was_active {
            self.begin(now, source, neutral(capabilities));
        }
        was_active
    }

    /// Stops every rotation, keeping the angles; true when there was one.
    pub fn stop_rates(&mut self, now: Timestamp) -> bool {
        match &mut self.aim {
            Aim::Turn(turn) if !is_zero(&turn.turning) => {
                turn.stop(now);
                self.next = Some(now);
                true
            }
            Aim::Point(point) => {
                let mut stopped = false;
                for axis in [&mut point.roll, &mut point.pitch, &mut point.yaw] {
                    if matches!(axis.motion, Motion::Turning { .. }) {
                        axis.motion = Motion::Still;
                        stopped = true;
                    }
                }
                if stopped {
                    self.next = Some(now);
                }
                stopped
            }
            _ => false,
        }
    }

    /// The gimbal is gone: when it comes back it is not moved until somebody asks for it.
    pub fn forget(&mut self) {
        self.aim = Aim::Idle;
        self.source = None;
        self.next = None;
        self.last = None;
    }

    /// The next setpoint for the device, if one is due.
    pub fn steer(&mut self, now: Timestamp, situation: &Situation<'_>) -> Option<Setpoint> {
        if self.next.is_none_or(|next| next > now) {
            return None;
        }
        self.carry_on(now, situation);
        let wanted = self.setpoint(situation);
        let setpoint = wanted.and_then(|wanted| self.for_device(wanted, situation)).or(self.last);
        self.last = setpoint;
        self.next = (self.aim != Aim::Idle).then(|| now + self.period);
        setpoint
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
        }
    }

    /// The latest setpoint, as the device was told.
    pub fn last(&self) -> Option<Setpoint> {
        self.last
    }

    /// Whose demand is being carried out.
    pub fn source(&self) -> Option<MavId> {
        self.source
    }

    pub fn roi(&self) -> Option<Position> {
        match self.aim {
            Aim::Roi(place) => Some(place),
            _ => None,
        }
    }

    /// `None` while nothing was demanded, else a word for people.
    pub fn mode(&self) -> Option<&'static str> {
        match &self.aim {
            Aim::Idle => None,
            Aim::Retract => Some("retract"),
            Aim::Neutral => Some("neutral"),
            Aim::Turn(turn) if is_zero(&turn.turning) => Some("hold"),
            Aim::Turn(_) => Some("rate"),
            Aim::Point(_) => Some("angle"),
            Aim::Roi(_) => Some("roi"),
        }
    }

    fn begin(&mut self, now: Timestamp, source: MavId, aim: Aim) {
        self.aim = aim;
        self.source = Some(source);
        self.carried_to = now;
        self.next = Some(now);
    }

    fn read_demand(
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
        // With rates alone an axis without one stands still; otherwise it keeps what it does.
        let keep = |axis: Axis| if any_rate && !any_angle { Axis::still(axis.at) } else { axis };
        let axis = |wanted: AxisDemand, angle: Option<Angle>, reference: Option<Axis>| match (angle, wanted.rate) {
            (Some(angle), None) => Ok(Axis::still(angle)),
            (Some(to), Some(rate)) => {
                Ok(Axis { at: reference.ok_or(missing)?.at, motion: Motion::Slew { to, rate: rate.abs() } })
            }
            (None, Some(rate)) => {
                Ok(Axis { at: reference.ok_or(missing)?.at, motion: Motion::Turning { rate, until } })
            }
            (None, None) => Ok(keep(reference.ok_or(missing)?)),
        };
        let has_roll = capabilities.flags.contains(CapFlags::HAS_ROLL_AXIS);
        let level = Axis::still(Angle::ZERO);
        Ok(Aim::Point(Point {
            roll: match roll.angle {
                Some(angle) if has_roll => Axis::still(angle),
                _ => level,
            },
            pitch: axis(pitch, pitch.angle, reference.map(|reference| reference.pitch))?,
            yaw: axis(yaw, yaw_angle, reference.map(|reference| reference.yaw))?,
            frame: hold,
            stabilised,
        }))
    }

    /// Fails where the device needs its yaw in another frame than it is held in, and no heading is known.
    fn need_frame(&self, hold: YawFrame, situation: &Situation<'_>) -> Result<(), Refusal> {
        if situation.device_frame(hold) != hold && situation.heading.is_none() {
            return Err(Refusal::later("no_heading"));
        }
        Ok(())
    }

    /// What an axis without a demand keeps: its setpoint where it has one, else where the gimbal is.
    fn reference(&self, frame: YawFrame, situation: &Situation<'_>) -> Option<Point> {
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

    /// Brings the aim up to `now`: axes that are on their way move, rates that have run out end.
    fn carry_on(&mut self, now: Timestamp, situation: &Situation<'_>) {
        let passed = now.since(self.carried_to);
        self.carried_to = now;
        match &mut self.aim {
            Aim::Turn(turn) => {
                if turn.settles_at.is_some_and(|at| at <= now)
                    && let Some(pose) = situation.measured_pose(turn.turning.yaw_frame)
                {
                    let turning = turn.turning;
                    self.aim = Aim::Point(Point::still(pose, turning.yaw_frame, turning.stabilised));
                }
            }
            Aim::Point(point) => {
                let limits = &situation.capabilities.limits;
                point.roll.carry_on(now, passed, |angle| limits.clamp_roll(angle));
                point.pitch.carry_on(now, passed, |angle| limits.clamp_pitch(angle));
                let (frame, heading) = (point.frame, situation.heading);
                point.yaw.carry_on(now, passed, |angle| clamp_yaw(angle, frame, heading, situation));
            }
            Aim::Idle | Aim::Retract | Aim::Neutral | Aim::Roi(_) => {}
        }
    }

    /// The setpoint of the aim, yaw in the frame it is held in; `None` where what it takes is not known.
    fn setpoint(&self, situation: &Situation<'_>) -> Option<Setpoint> {
        match self.aim {
            Aim::Idle => None,
            Aim::Retract => Some(Setpoint::Retract),
            Aim::Neutral => Some(Setpoint::Neutral),
            Aim::Turn(turn) => Some(Setpoint::Turn(turn.turning)),
            Aim::Point(point) => Some(Setpoint::Point(Pointing {
                roll: point.roll.at,
                pitch: point.pitch.at,
                yaw: Yaw::new(point.frame, point.yaw.at),
                stabilised: point.stabilised,
            })),
            Aim::Roi(place) => {
                let aim = situation.position?.aim_at(place)?;
                let yaw = match aim.azimuth {
                    Some(azimuth) => Yaw::InEarthFrame(azimuth),
                    // Straight above or below any yaw is right: keep the one there is.
                    None => self.reference(YawFrame::Earth, situation).map(|kept| Yaw::InEarthFrame(kept.yaw.at))?,
                };
                Some(Setpoint::Point(Pointing {
                    roll: Angle::ZERO,
                    pitch: aim.elevation,
                    yaw,
                    stabilised: Stabilised::BOTH,
                }))
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

fn neutral(capabilities: &Capabilities) -> Aim {
    if capabilities.flags.contains(CapFlags::HAS_NEUTRAL) {
        return Aim::Neutral;
    }
    let ahead = Pose { roll: Angle::ZERO, pitch: Angle::ZERO, yaw: Angle::ZERO };
    Aim::Point(Point::still(ahead, YawFrame::Vehicle, Stabilised::BOTH))
}

fn is_zero(turning: &Turning) -> bool {
    [turning.roll.unwrap_or(AngularRate::ZERO), turning.pitch, turning.yaw]
        .iter()
        .all(|rate| rate.radians_per_second() == 0.0)
}

/// Keeps a moving yaw within the end stops, which are the vehicle's also while North is held.
fn clamp_yaw(angle: Angle, frame: YawFrame, heading: Option<Angle>, situation: &Situation<'_>) -> Angle {
    let Some(limits) = situation.capabilities.limits.yaw else { return angle };
    let Some(Yaw::InVehicleFrame(vehicle)) = Yaw::new(frame, angle).in_frame(YawFrame::Vehicle, heading) else {
        return angle;
    };
    if vehicle >= limits.min() && vehicle <= limits.max() {
        return angle;
    }
    let stopped = Yaw::InVehicleFrame(limits.clamp(vehicle));
    stopped.in_frame(frame, heading).map_or(angle, Yaw::angle)
}

impl AxisDemand {
    /// A rate of exactly 0 beside an angle is a field left empty, not a limit that forbids moving.
    fn without_zero_limit(self) -> Self {
        let rate = self.rate.filter(|rate| self.angle.is_none() || rate.radians_per_second() != 0.0);
        Self { rate, ..self }
    }
}

impl Turn {
    fn stop(&mut self, now: Timestamp) {
        self.turning = Turning {
            roll: self.turning.roll.map(|_| AngularRate::ZERO),
            pitch: AngularRate::ZERO,
            yaw: AngularRate::ZERO,
            ..self.turning
        };
        self.stops_at = None;
        self.settles_at = Some(now + SETTLE);
    }
}

impl Point {
    fn still(pose: Pose, frame: YawFrame, stabilised: Stabilised) -> Self {
        Self {
            roll: Axis::still(pose.roll),
            pitch: Axis::still(pose.pitch),
            yaw: Axis::still(pose.yaw),
            frame,
            stabilised,
        }
    }
}

impl Axis {
    const fn still(at: Angle) -> Self {
        Self { at, motion: Motion::Still }
    }

    fn carry_on(&mut self, now: Timestamp, passed: Duration, clamp: impl Fn(Angle) -> Angle) {
        match self.motion {
            Motion::Still => {}
            Motion::Slew { to, rate } => {
                let step = rate.over(passed);
                let left = to - self.at;
                if left.abs() <= step {
                    *self = Self::still(to);
                } else {
                    self.at += if left > Angle::ZERO { step } else { -step };
                }
            }
            Motion::Turning { rate, until } => {
                self.at = clamp(self.at + rate.over(passed));
                if until.is_some_and(|until| until <= now) {
                    self.motion = Motion::Still;
                }
            }
        }
    }
}
