//! From a setpoint to what is sent, in either generation.

use super::effect::Pose;
use super::faults::Fault;
use super::mode_change::{self, ModeChange};
use super::mount::{Condition, DEAD_MAN, MountOutput, Order};
use super::operations::MOTORS_SHOW_WITHIN;
use super::stopping::Stopping;
use super::{Generation, GremsyDriver, HandOver, Timer};
use crate::geometry::{Angle, AngularRate, GimbalAngles, Yaw, YawFrame};
use crate::gimbals::driver::{DriverOutput, GimbalDriver};
use crate::gimbals::gremsy::modes::{self, ControlMode};
use crate::gimbals::gremsy::packet;
use crate::gimbals::gremsy::status::OperationState;
use crate::gimbals::operation::{OperationError, YawMode};
use crate::gimbals::report::{GimbalStatus, Readiness};
use crate::gimbals::rest_watch::LOOKS_AGAIN_WITHIN;
use crate::gimbals::setpoint::{Pointing, RadioControl, Setpoint, Stabilised, Turning};
use crate::gimbals::told_rates::ToldRates;
use crate::timestamp::Timestamp;
use crate::wire::MavId;
use crate::wire::dialect::{COMMAND_LONG_DATA, GIMBAL_DEVICE_SET_ATTITUDE_DATA, MavMessage};
use crate::wire::ids::GimbalFlags;

/// Its flags come twenty times a second; older ones say nothing of what it was told since.
const SHOWN_WITHIN: std::time::Duration = std::time::Duration::from_millis(400);

/// Closer to where it was told to look it is there.
const THERE: Angle = Angle::from_degrees(1.0);

impl GremsyDriver {
    /// What somebody who may wants of it.
    pub(super) fn steer(&mut self, now: Timestamp, setpoint: Setpoint) {
        let Some(device) = self.device else { return };
        let is_stop = matches!(setpoint, Setpoint::Turn(turning) if turning.is_zero());
        self.is_to_be_stowed = setpoint == Setpoint::Retract && !self.settings.retract_allowed;
        let setpoint = self.within_policy(setpoint);
        // One that is not heard may still hear that it is to stop.
        if !self.is_alive && !is_stop {
            return;
        }
        self.effect.handle_target(pose_of(setpoint).filter(|_| self.is_present));
        match self.search.decided() {
            Some(Generation::V1) => {
                let order = order_of(self.about_north(now, setpoint));
                if order != Order::RadioControl {
                    self.hand_over = HandOver::No;
                }
                self.mount.order(now, order);
                self.mount.advance(now, device, self.condition());
            }
            Some(Generation::V2) => self.steer_v2(now, setpoint, is_stop),
            // To stop takes no knowledge: zeros in either protocol.
            None if is_stop => {
                self.mount.assume_turning();
                self.stopping.get_or_insert(Stopping::of_unknown(now));
            }
            None => {}
        }
        // Those that are off for a retract, or on their way, are no news.
        let is_off = self.heard.status.is_some_and(|(_, status)| status.operation() == OperationState::OFF);
        let is_retracted = self.is_retracted || self.mode_change.is_some() || self.mount.is_retracted();
        let may_start = self.motors_asked.is_some_and(|at| now.since(at) < MOTORS_SHOW_WITHIN);
        let stay_off = self.faults.iter().any(|fault| *fault == Fault::StaysRetracted);
        if self.is_present && is_off && !is_retracted && !is_stop && !may_start && !stay_off {
            self.raise(Fault::MotorsOff);
        }
    }

    /// "When using Speed Mode, the gimbal moves at the absolute rate in the Earth frame", whatever its mode: a rotation from
    /// the nose has the vehicle's in it. A stop is one in any frame.
    fn about_north(&self, now: Timestamp, setpoint: Setpoint) -> Setpoint {
        match setpoint {
            Setpoint::Turn(turning) if turning.yaw_frame == YawFrame::Vehicle && !turning.is_zero() => {
                let of_vehicle = self.vehicle_turn.rate(now).unwrap_or(AngularRate::ZERO);
                Setpoint::Turn(Turning { yaw: turning.yaw + of_vehicle, ..turning })
            }
            setpoint => setpoint,
        }
    }

    /// "RETRACT in v2 cuts motors; on some firmware only a reboot re-enables": unless it is allowed, it is turned to where
    /// it is stowed.
    fn within_policy(&self, setpoint: Setpoint) -> Setpoint {
        match setpoint {
            Setpoint::Retract if !self.settings.retract_allowed => Setpoint::Point(Pointing {
                roll: Angle::ZERO,
                pitch: self.settings.stow_pitch,
                yaw: Yaw::InVehicleFrame(self.settings.stow_yaw),
                stabilised: Stabilised::BOTH,
                radio_control: RadioControl::Off,
            }),
            setpoint => setpoint,
        }
    }

    /// Says a setpoint of the driver's own.
    pub(super) fn send_setpoint(&mut self, now: Timestamp, setpoint: Setpoint) {
        self.effect.handle_target(pose_of(setpoint).filter(|_| self.is_present));
        self.v2.handle_setpoint(now, setpoint);
        if let Some(device) = self.device {
            self.drain_v2(now, device);
        }
    }

    fn steer_v2(&mut self, now: Timestamp, setpoint: Setpoint, is_stop: bool) {
        if !is_stop && self.readiness() == Readiness::Starting {
            return;
        }
        if let Setpoint::Point(Pointing { radio_control: RadioControl::Exclusive, .. }) = setpoint {
            self.stop_v2(now);
            self.hand_over_waits = self.hand_over == HandOver::No;
            return;
        }
        self.hand_over = HandOver::No;
        self.hand_over_waits = false;
        match self.mode_change {
            // It is to move, and its motors are being switched on, for that or by name: what it is told waits for them.
            Some(change)
                if !is_stop
                    && (change.asker().is_none()
                        || change.mode() == ControlMode::Reset && setpoint != Setpoint::Retract) =>
            {
                if self.turning.is_some() && matches!(setpoint, Setpoint::Turn(_)) {
                    self.timers.set(Timer::DeadMan, now + DEAD_MAN);
                }
                return;
            }
            Some(change) if !is_stop => {
                self.mode_change = None;
                if let Some(id) = change.asker() {
                    let text = match change.mode() {
                        ControlMode::Reset => "it is told to retract, which keeps its motors off",
                        _ => "another demand took its place",
                    };
                    self.operated(id, Err(OperationError::NoEffect(text.to_owned())));
                }
            }
            _ => {}
        }
        if setpoint == Setpoint::Retract {
            self.is_retracted = true;
        } else if self.is_retracted && !is_stop {
            self.is_retracted = false;
            let shows_it = self.heard.attitude.is_some_and(|(_, status)| status.flags.contains(GimbalFlags::RETRACT));
            if shows_it {
                self.turning = None;
                self.mode_change = Some(ModeChange::new(now, ControlMode::Reset, None));
                return;
            }
        }
        match setpoint {
            Setpoint::Turn(turning) if !turning.is_zero() => {
                self.turning = Some(turning);
                self.told_rates.add(turning);
                self.stopping = None;
                self.timers.set(Timer::DeadMan, now + DEAD_MAN);
            }
            Setpoint::Turn(_) => {
                self.stop_v2(now);
                if let Some(stopping) = &mut self.stopping {
                    stopping.handle_sent(now, self.is_alive);
                }
            }
            // What it turns at is not over because something else is said: that may be lost.
            _ => {
                self.stop_v2(now);
                if let Some(stopping) = &mut self.stopping {
                    stopping.replace(now);
                }
            }
        }
        self.v2.handle_setpoint(now, setpoint);
    }

    /// Begins to stop what it was told to turn in v2.
    pub(super) fn stop_v2(&mut self, now: Timestamp) {
        if let Some(turning) = self.turning.take() {
            self.stopping = Some(Stopping::new(now, turning, self.told_rates, self.told_look()));
        } else if let Some(stopping) = self.stopping.as_mut().filter(|_| self.search.decided() != Some(Generation::V1))
        {
            stopping.go_on(now);
        }
    }

    /// When it last told where it looks.
    fn told_look(&self) -> Option<Timestamp> {
        self.heard.attitude.map(|(at, _)| at)
    }

    /// In v2, without its motors it stands, and zeros are a mode of their own, which it may take for switching them on.
    fn is_switched_off(&self, now: Timestamp) -> bool {
        let shows_it = |(at, status): (Timestamp, GimbalStatus)| {
            now.since(at) <= LOOKS_AGAIN_WITHIN && status.flags.contains(GimbalFlags::RETRACT)
        };
        self.mode_change.is_some_and(|change| change.mode() == ControlMode::Off)
            || self.heard.attitude.is_some_and(shows_it)
    }

    fn stop_on_in_v2(&mut self, now: Timestamp, device: MavId) {
        let is_off = self.is_switched_off(now);
        if let Some(stopping) = &mut self.stopping {
            if stopping.is_over(now) {
                self.stopping = None;
                self.told_rates = ToldRates::default();
            } else if let Some(zero) = stopping.handle_timeout(now, self.is_alive).filter(|_| !is_off) {
                self.v2.handle_setpoint(now, zero);
            }
            self.drain_v2(now, device);
        }
        if self.hand_over_waits && self.stopping.is_none() {
            self.hand_over_waits = false;
            self.hand_over = HandOver::Asked;
            self.outputs.push_back(DriverOutput::Command(Box::new(packet::hand_to_rc(device))));
        }
    }

    /// In v1, whether what took the place of a rotation was heard is told by its answer, and seen as well.
    fn watch_rotation_in_v1(&mut self, now: Timestamp) {
        let turning = match self.mount.wanted() {
            Some(order @ Order::Turn { rates: [roll, pitch, yaw], .. }) if order.turns() => {
                Some(Turning { roll: Some(roll), pitch, yaw, yaw_frame: YawFrame::Earth, ..Turning::STOPPED })
            }
            _ => None,
        };
        match (turning, std::mem::replace(&mut self.turning_in_v1, turning)) {
            (Some(turning), _) => {
                self.told_rates.add(turning);
                self.stopping = None;
            }
            (None, Some(before)) => {
                self.stopping = Some(Stopping::watching(now, before, self.told_rates, self.told_look()));
            }
            (None, None) => {}
        }
    }

    /// Whoever steers has not repeated a rotation: it ends.
    pub(super) fn stop_unrepeated(&mut self, now: Timestamp) {
        if self.turning.is_some() {
            tracing::warn!("a rotation that nobody repeats is stopped");
            self.stop_v2(now);
        }
    }

    /// A setpoint as the driver for v2 devices makes it: roll and pitch are always level here, rates are all numbers, and
    /// firmware that does not know the bits of the yaw frame does not get them.
    pub(super) fn in_its_way(&self, mut setpoint: GIMBAL_DEVICE_SET_ATTITUDE_DATA) -> GIMBAL_DEVICE_SET_ATTITUDE_DATA {
        let mut flags = GimbalFlags::from_bits_retain(setpoint.flags);
        flags |= GimbalFlags::ROLL_LOCK | GimbalFlags::PITCH_LOCK;
        if !self.tells_yaw_frame() {
            flags.remove(GimbalFlags::YAW_IN_VEHICLE_FRAME | GimbalFlags::YAW_IN_EARTH_FRAME);
        }
        setpoint.flags = flags.bits();
        let turns = setpoint.angular_velocity_y.is_finite() || setpoint.angular_velocity_z.is_finite();
        if turns && setpoint.angular_velocity_x.is_nan() {
            setpoint.angular_velocity_x = 0.0;
        }
        setpoint
    }

    pub(super) fn send_v2_setpoint(&mut self, setpoint: GIMBAL_DEVICE_SET_ATTITUDE_DATA) {
        if self.search.decided() != Some(Generation::V1) {
            let told = MavMessage::GIMBAL_DEVICE_SET_ATTITUDE(self.in_its_way(setpoint));
            self.outputs.push_back(DriverOutput::Message(Box::new(told)));
        }
    }

    fn send_mode(&mut self, device: MavId, mode: ControlMode) {
        let frame = if mode == ControlMode::Lock { YawFrame::Earth } else { YawFrame::Vehicle };
        let setpoint = modes::set_mode(device, mode, Some(frame).filter(|_| self.tells_yaw_frame()));
        self.outputs.push_back(DriverOutput::Message(Box::new(MavMessage::GIMBAL_DEVICE_SET_ATTITUDE(setpoint))));
    }

    fn tells_yaw_frame(&self) -> bool {
        self.version().is_some_and(|version| version.tells_yaw_frame())
    }

    pub(super) fn handle_mode_step(&mut self, now: Timestamp, device: MavId, step: Option<mode_change::Step>) {
        match step {
            None => {}
            Some(mode_change::Step::Send(mode)) => {
                match mode {
                    ControlMode::Reset => self.motors_asked = Some(now),
                    ControlMode::Off => self.motors_asked = None,
                    ControlMode::Lock | ControlMode::Follow | ControlMode::Mapping => {}
                }
                self.send_mode(device, mode);
            }
            Some(mode_change::Step::Done(asker, result)) => {
                let mode = self.mode_change.take().map(|change| change.mode());
                match (asker, mode) {
                    (Some(id), Some(mode)) if result.is_ok() => self.handle_mode_taken(now, id, mode),
                    (Some(id), Some(ControlMode::Reset)) if self.shows_retracted(now) => {
                        self.raise_stays_off();
                        let text = "its motors stay off; this firmware needs a restart for that";
                        self.operated(id, Err(OperationError::NoEffect(text.to_owned())));
                    }
                    (Some(id), _) => self.operated(id, result),
                    (None, _) if result.is_err() => self.raise_stays_off(),
                    (None, _) => {}
                }
            }
        }
    }

    fn shows_retracted(&self, now: Timestamp) -> bool {
        let is_shown = |(at, status): (Timestamp, GimbalStatus)| {
            now.since(at) < SHOWN_WITHIN && status.flags.contains(GimbalFlags::RETRACT)
        };
        self.heard.attitude.is_some_and(is_shown)
    }

    /// To switch them on is no remedy.
    fn raise_stays_off(&mut self) {
        self.faults.clear(|fault| *fault == Fault::MotorsOff);
        self.raise(Fault::StaysRetracted);
    }

    /// Something else than its setpoint was asked of it.
    pub(super) fn drop_demand(&mut self, now: Timestamp, device: MavId) {
        self.effect.handle_target(None);
        self.hand_over = HandOver::No;
        self.stop_v2(now);
        self.hand_over_waits = false;
        self.mount.drop_order(now, device, self.condition());
        self.drain_mount(now);
        if let Some(change) = self.mode_change.take()
            && let Some(id) = change.asker()
        {
            self.operated(id, Err(OperationError::NoEffect("another demand took its place".to_owned())));
        }
    }

    pub(super) fn steer_on(&mut self, now: Timestamp, device: MavId) {
        if let Some(change) = &mut self.mode_change {
            let step = change.handle_timeout(now);
            self.handle_mode_step(now, device, step);
        }
        self.stop_on_in_v2(now, device);
        if self.search.decided() != Some(Generation::V2) {
            self.mount.advance(now, device, self.condition());
            self.watch_rotation_in_v1(now);
        }
        self.drain_mount(now);
    }

    fn drain_mount(&mut self, now: Timestamp) {
        while let Some(output) = self.mount.poll_output() {
            match output {
                MountOutput::Send(command) => self.send_command(command),
                MountOutput::Command(command) => {
                    let target = MavId::new(command.target_system, command.target_component);
                    if command == packet::hand_to_rc(target) {
                        self.hand_over = HandOver::Asked;
                    }
                    self.outputs.push_back(DriverOutput::Command(Box::new(command)));
                }
                MountOutput::ModeRefused => {
                    self.faults.clear(|fault| *fault == Fault::NoAnswers);
                    let may_be_v2 = self.version().is_none_or(|version| version.may_speak_v2());
                    let is_set_to_v1 = self.settings.generation == Some(Generation::V1);
                    self.raise(if is_set_to_v1 && may_be_v2 { Fault::NotV1 } else { Fault::ModeRefused });
                }
                MountOutput::ModeTaken => {
                    self.faults.clear(|fault| matches!(fault, Fault::ModeRefused | Fault::NotV1 | Fault::NoAnswers));
                }
                MountOutput::StaysRetracted => self.raise_stays_off(),
                MountOutput::Unanswered => self.raise_unanswered(now),
            }
        }
    }

    fn send_command(&mut self, command: COMMAND_LONG_DATA) {
        self.outputs.push_back(DriverOutput::Message(Box::new(MavMessage::COMMAND_LONG(command))));
    }

    pub(super) fn condition(&self) -> Condition {
        Condition {
            is_heard: self.is_alive,
            is_ready: self.is_alive && self.is_present && self.is_active && self.off.is_none(),
            is_there: self.is_there(),
            motors_on: self.heard.status.is_some_and(|(_, status)| status.motors_on()),
            is_watched: self.stopping.is_some() && self.search.decided() == Some(Generation::V1),
        }
    }

    fn is_there(&self) -> bool {
        let (Some(Order::Point { angles, mode }), Some((_, status))) = (self.mount.wanted(), self.heard.attitude)
        else {
            return false;
        };
        let (seen, yaw) = (status.attitude.angles(), status.attitude.yaw());
        let frame = match mode {
            YawMode::Follow => YawFrame::Vehicle,
            YawMode::Lock => YawFrame::Earth,
        };
        let close = |a: Angle, b: Angle| (a - b).wrapped().abs() < THERE;
        close(seen.pitch, angles.pitch) && yaw.frame() == frame && close(yaw.angle(), angles.yaw)
    }
}

fn order_of(setpoint: Setpoint) -> Order {
    let mode = |frame| match frame {
        YawFrame::Vehicle => YawMode::Follow,
        YawFrame::Earth => YawMode::Lock,
    };
    match setpoint {
        Setpoint::Retract => Order::Retract,
        Setpoint::Neutral => Order::Home,
        Setpoint::Point(Pointing { radio_control: RadioControl::Exclusive, .. }) => Order::RadioControl,
        Setpoint::Point(Pointing { roll, pitch, yaw, .. }) => {
            Order::Point { angles: GimbalAngles { roll, pitch, yaw: yaw.angle() }, mode: mode(yaw.frame()) }
        }
        Setpoint::Turn(Turning { roll, pitch, yaw, yaw_frame, .. }) => {
            Order::Turn { rates: [roll.unwrap_or(AngularRate::ZERO), pitch, yaw], mode: mode(yaw_frame) }
        }
    }
}

fn pose_of(setpoint: Setpoint) -> Option<Pose> {
    match setpoint {
        Setpoint::Point(Pointing { pitch, yaw, radio_control: RadioControl::Off, .. }) => Some(Pose { pitch, yaw }),
        _ => None,
    }
}
