//! The conversation with a Gremsy: it is got to know, then steered in the generation of its protocol that it speaks.
//!
//! Follows the vendor's gSDK: who it is and its parameters are asked for, then it is waited for until everything in it is
//! in place; only then is it known to whoever steers. What it is told in v1 is in `mount`; in v2 it is a gimbal device of
//! the Gimbal Protocol, which the driver for those takes care of, with modes of the vendor's own (`mode_change`).

mod details;
mod effect;
mod faults;
mod generation;
mod mode_change;
mod mount;
mod operations;
mod rotation;
mod start_up;
mod steering;
mod stopping;
mod streams;
mod supervision;
mod telling;
mod vehicle_turn;
mod writes;

use std::collections::VecDeque;
use std::time::Duration;

use super::config::GremsySettings;
use super::readings::{Encoders, Negated, Orientation, RawImu};
use super::status::{SystemStatus, read_system_status};
use crate::geometry::{Angle, AngularRate};
use crate::gimbals::boot_clock::BootClock;
use crate::gimbals::capabilities::Capabilities;
use crate::gimbals::details::GimbalDetails;
use crate::gimbals::driver::{CommandOutcome, DriverOutput, GimbalDriver};
use crate::gimbals::gremsy::parameters::{Axis, EncoderType, Parameter, ParameterTable};
use crate::gimbals::gremsy::{is_vendor, packet};
use crate::gimbals::mavlink_v2::MavlinkV2Driver;
use crate::gimbals::mavlink_v2::packet::{DeviceInformation, read_information};
use crate::gimbals::operation::{Operation, OperationId};
use crate::gimbals::parameters::{Encoding, Known, ParameterOutput, Parameters};
use crate::gimbals::report::{GimbalStatus, Identity, Readiness, Report};
use crate::gimbals::setpoint::{Setpoint, Turning};
use crate::gimbals::settings::Family;
use crate::gimbals::told_rates::ToldRates;
use crate::timers::TimerTable;
use crate::timestamp::Timestamp;
use crate::wire::dialect::{COMMAND_ACK_DATA, COMMAND_LONG_DATA, MavMessage};
use crate::wire::ids::{CommandResult, command, message};
use crate::wire::{Frame, MavId};
use effect::EffectWatch;
use faults::{Fault, Faults};
pub use generation::Generation;
use generation::Search;
use mode_change::ModeChange;
use mount::Mount;
use operations::Operations;
use stopping::Stopping;
use streams::Streams;
use supervision::Off;
use vehicle_turn::VehicleTurn;

/// A gimbal not heard for so long is lost: five heartbeats.
pub const LOST_AFTER: Duration = Duration::from_secs(5);

/// What is looked after beside everything else.
const TICK: Duration = Duration::from_millis(500);

/// Drives one Gremsy.
#[derive(Debug)]
pub struct GremsyDriver {
    settings: GremsySettings,
    device: Option<MavId>,
    is_alive: bool,
    /// That it is there was reported.
    is_reported: bool,
    /// It was told to start again, or to switch itself off, and has not been heard since.
    off: Option<Off>,
    /// It is lost because it was told to switch itself off.
    is_gone_as_told: bool,
    begun: Timestamp,
    asked: u8,
    information: Option<DeviceInformation>,
    /// Its heartbeat does not say otherwise.
    is_active: bool,
    /// Since when everything in it is in place.
    aligned_since: Option<Timestamp>,
    /// It is known to whoever steers.
    is_present: bool,
    reported: Option<(Identity, Capabilities)>,
    search: Search,
    /// Asks and supervises nothing here; tells and reads as a v2 device is told and read.
    v2: MavlinkV2Driver,
    parameters: Parameters,
    streams: Streams,
    mount: Mount,
    mode_change: Option<ModeChange>,
    /// When its motors were last told to run.
    motors_asked: Option<Timestamp>,
    /// In v2, "retract" has switched the motors off.
    is_retracted: bool,
    /// How it was last told to turn in v2.
    turning: Option<Turning>,
    /// In v1, how it is told to turn.
    turning_in_v1: Option<Turning>,
    told_rates: ToldRates,
    /// A rotation that is being stopped; in v1 it is only watched here.
    stopping: Option<Stopping>,
    /// In v2, it is handed to its radio control when it has stopped.
    hand_over_waits: bool,
    /// The last that was reported.
    readiness: Option<Readiness>,
    /// That it starts was reported, or is no news.
    is_start_told: bool,
    hand_over: HandOver,
    /// It was told to retract, which is a place to stow.
    is_to_be_stowed: bool,
    operations: Operations,
    /// It is being told another unit for its encoders, and may send either.
    unit_change: Option<OperationId>,
    heard: Heard,
    vehicle_turn: VehicleTurn,
    /// What the autopilot says of it.
    vehicle_heading: Option<Angle>,
    /// Since when that is told without a gap.
    is_fed_since: Option<Timestamp>,
    negated: Negated,
    effect: EffectWatch,
    faults: Faults,
    timers: TimerTable<Timer>,
    outputs: VecDeque<DriverOutput>,
}

/// Whether it was given to its radio receiver.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum HandOver {
    No,
    Asked,
    /// It acknowledged that.
    Done,
    /// Nobody asks it again before something else was asked of it.
    Refused,
}

/// The latest of everything that it tells.
#[derive(Debug, Default)]
struct Heard {
    latest: Timestamp,
    heartbeat: Option<Timestamp>,
    status: Option<(Timestamp, SystemStatus)>,
    imu: Option<(Timestamp, RawImu)>,
    /// With the unit in which it was sent.
    encoders: Option<(Timestamp, Encoders, EncoderType)>,
    orientation: Option<(Timestamp, Orientation)>,
    /// As it was reported.
    attitude: Option<(Timestamp, GimbalStatus)>,
    device_status: Option<Timestamp>,
    information: Option<Timestamp>,
    clock: BootClock,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Timer {
    /// When to ask for 283 again.
    AskInformation,
    /// When to call it lost.
    Lost,
    /// When to look after the rest.
    Tick,
    /// When to stop a rotation in v2 that nobody repeats.
    DeadMan,
}

impl GremsyDriver {
    pub fn new(settings: GremsySettings) -> Self {
        Self {
            device: None,
            is_alive: false,
            is_reported: false,
            off: None,
            is_gone_as_told: false,
            begun: Timestamp::ZERO,
            asked: 0,
            information: None,
            is_active: false,
            aligned_since: None,
            is_present: false,
            reported: None,
            search: Search::new(settings.generation, Timestamp::ZERO),
            v2: MavlinkV2Driver::new(),
            parameters: Parameters::new(Encoding::Int16AsNumber, catalogue),
            streams: Streams::default(),
            mount: Mount::default(),
            mode_change: None,
            motors_asked: None,
            is_retracted: false,
            turning: None,
            turning_in_v1: None,
            told_rates: ToldRates::default(),
            stopping: None,
            hand_over_waits: false,
            readiness: None,
            is_start_told: true,
            hand_over: HandOver::No,
            is_to_be_stowed: false,
            operations: Operations::default(),
            unit_change: None,
            heard: Heard::default(),
            vehicle_turn: VehicleTurn::default(),
            vehicle_heading: None,
            is_fed_since: None,
            negated: settings.negated(),
            effect: EffectWatch::default(),
            faults: Faults::default(),
            timers: TimerTable::default(),
            outputs: VecDeque::new(),
            settings,
        }
    }

    fn handle_ack(&mut self, frame: &Frame<'_>) {
        let Some(ack) = frame.decode::<COMMAND_ACK_DATA>() else { return };
        if ack.command == command::DO_MOUNT_CONTROL && ack.result != CommandResult::InProgress as u8 {
            self.mount.handle_answer(ack.result == CommandResult::Accepted as u8);
            self.faults.clear(|fault| *fault == Fault::NoAnswers);
        }
    }

    /// Whether the configuration calls another maker's gimbal a Gremsy.
    fn look_at_maker(&mut self) {
        self.faults.clear(|fault| matches!(fault, Fault::OtherMaker(_)));
        let vendor = self.information.as_ref().map(|information| information.identity.vendor.trim().to_owned());
        if let Some(vendor) = vendor.filter(|vendor| !vendor.is_empty() && !is_vendor(vendor)) {
            self.raise(Fault::OtherMaker(vendor));
        }
    }

    fn raise(&mut self, fault: Fault) {
        if let Some(short) = self.faults.raise(fault) {
            self.warn(short);
        }
    }

    fn warn(&mut self, short: &'static str) {
        self.outputs.push_back(DriverOutput::Report(Report::Fault(short)));
    }

    fn drain_parameters(&mut self) {
        while let Some(output) = self.parameters.poll_output() {
            match output {
                ParameterOutput::Send(message) => self.outputs.push_back(DriverOutput::Message(message)),
                ParameterOutput::Settled => {}
                ParameterOutput::Done { id, result } => {
                    self.unit_change.take_if(|change| *change == id);
                    self.operated(id, result);
                }
            }
        }
    }

    /// What the driver for v2 devices wants; what concerns discovery and supervision is ours.
    fn drain_v2(&mut self, now: Timestamp, device: MavId) {
        while let Some(output) = self.v2.poll_output() {
            match output {
                DriverOutput::Message(message) => {
                    if let MavMessage::GIMBAL_DEVICE_SET_ATTITUDE(setpoint) = *message {
                        self.send_v2_setpoint(setpoint);
                    }
                }
                DriverOutput::Report(Report::Attitude(status)) => self.handle_device_status(now, status),
                // While it is got to know it needs no second beginning.
                DriverOutput::Report(Report::Restarted) if self.is_present && self.off.is_none() => {
                    self.restart(now, device);
                }
                DriverOutput::Report(report @ Report::Malformed { .. })
                    if self.search.decided() == Some(Generation::V2) =>
                {
                    self.outputs.push_back(DriverOutput::Report(report));
                }
                DriverOutput::Report(_) | DriverOutput::Command(_) | DriverOutput::Operated { .. } => {}
            }
        }
    }

    /// After each event: what may have become due.
    fn go_on(&mut self, now: Timestamp) {
        let Some(device) = self.device else { return };
        self.drain_v2(now, device);
        self.drain_parameters();
        self.judge(now, device);
        self.drain_parameters();
        self.steer_on(now, device);
        self.handle_operations_timeout(now, device);
        self.report_readiness();
    }
}

impl GimbalDriver for GremsyDriver {
    fn family(&self) -> Family {
        Family::Gremsy
    }

    fn adopt(&mut self, now: Timestamp, device: MavId) {
        let outputs = std::mem::take(&mut self.outputs);
        *self = Self { device: Some(device), outputs, ..Self::new(self.settings) };
        self.search = Search::new(self.settings.generation, now);
        self.v2.adopt(now, device);
    }

    fn handle_received(&mut self, now: Timestamp, frame: &Frame<'_>) {
        let Some(device) = self.device.filter(|device| *device == frame.source()) else { return };
        self.is_fed_since = self.vehicle_heading.map(|_| self.is_fed_since.unwrap_or(now));
        self.handle_heard(now, device);
        if let Some(stream) = streams::stream_of(frame.message_id()) {
            self.streams.handle_heard(now, stream);
        }
        match frame.message_id() {
            message::HEARTBEAT => self.handle_heartbeat(now, frame),
            message::SYS_STATUS => {
                if let Some(status) = read_system_status(frame) {
                    self.handle_status(now, device, status);
                }
            }
            message::PARAM_VALUE => {
                self.parameters.handle_received(now, frame);
                self.look_at_settings();
                self.tell_north(now);
            }
            message::MOUNT_ORIENTATION => self.handle_orientation(now, device, frame),
            message::MOUNT_STATUS => {
                // The encoders, and never where it looks.
                if let Some(encoders) = Encoders::read(frame).filter(|_| self.unit_change.is_none()) {
                    self.heard.encoders = Some((now, encoders, self.encoder_type()));
                }
            }
            message::RAW_IMU => self.heard.imu = RawImu::read(frame).map(|imu| (now, imu)).or(self.heard.imu),
            message::COMMAND_ACK => self.handle_ack(frame),
            message::GIMBAL_DEVICE_INFORMATION => {
                self.heard.information = Some(now);
                self.information = read_information(frame).or(self.information.take());
                self.look_at_maker();
                self.timers.cancel(Timer::AskInformation);
                self.look_at_settings();
            }
            _ => {}
        }
        // Parameters are read here, by the maker's names.
        if frame.message_id() != message::PARAM_VALUE {
            self.v2.handle_received(now, frame);
        }
        self.go_on(now);
    }

    /// A stop of ours is believed when it is acknowledged, or was looked at for a while, however early its protocol is known.
    fn stop_as(&mut self, _family: Family) {
        if self.search.decided() != Some(Generation::V2) {
            self.mount.assume_turning();
        }
    }

    fn handle_vehicle_heading(&mut self, heading: Option<Angle>) {
        self.vehicle_heading = heading;
    }

    fn handle_link_lost(&mut self) {
        self.v2.handle_link_lost();
        while self.v2.poll_output().is_some() {}
        if self.is_alive {
            if let Some(device) = self.device {
                self.report_alive(device);
            }
            self.forget_conversation();
            self.report_gone();
        }
    }

    fn handle_setpoint(&mut self, now: Timestamp, setpoint: Setpoint) {
        self.end_pointing();
        self.steer(now, setpoint);
        self.go_on(now);
    }

    fn handle_command_outcome(&mut self, now: Timestamp, command: &COMMAND_LONG_DATA, outcome: CommandOutcome) {
        let Some(device) = self.device else { return };
        if device != MavId::new(command.target_system, command.target_component) {
            return;
        }
        let is_done = outcome == CommandOutcome::Answered(CommandResult::Accepted as u8);
        let is_refused = matches!(outcome, CommandOutcome::Answered(result) if result != CommandResult::Accepted as u8);
        if command.command == command::SET_MESSAGE_INTERVAL
            && command.param1 == message::GIMBAL_DEVICE_ATTITUDE_STATUS as f32
            && is_refused
            && self.search.decided().is_none()
        {
            self.search.handle_refusal();
        }
        let asked = COMMAND_LONG_DATA { confirmation: 0, ..command.clone() };
        if asked == packet::hand_to_rc(device) && self.hand_over == HandOver::Asked {
            self.hand_over = if is_done { HandOver::Done } else { HandOver::Refused };
        }
        self.mount.handle_outcome(now, device, command, outcome);
        self.handle_operation_outcome(now, command, outcome);
        self.go_on(now);
    }

    fn handle_operation(&mut self, now: Timestamp, id: OperationId, operation: Operation) {
        self.operate(now, id, &operation);
        self.go_on(now);
    }

    fn handle_timeout(&mut self, now: Timestamp) {
        let Some(device) = self.device else { return };
        self.v2.handle_timeout(now);
        self.parameters.handle_timeout(now);
        while let Some(timer) = self.timers.pop_due(now) {
            match timer {
                Timer::AskInformation => self.ask_information(now, device),
                Timer::Lost => self.lose(now),
                Timer::Tick => self.tick(now, device),
                Timer::DeadMan => self.stop_unrepeated(now),
            }
        }
        self.go_on(now);
    }

    fn leans_on_attitude(&self) -> bool {
        self.combines_attitude()
    }

    fn stops_as(&self) -> Option<Family> {
        Some(Family::Gremsy)
    }

    fn words_that_stop(&self, turning: Turning) -> Vec<MavMessage> {
        let Some(device) = self.device else { return Vec::new() };
        let in_v1 = MavMessage::COMMAND_LONG(packet::turn_at(device, [AngularRate::ZERO; 3]));
        let in_v2 = self.v2.words_that_stop(turning).into_iter().map(|word| match word {
            MavMessage::GIMBAL_DEVICE_SET_ATTITUDE(zero) => {
                MavMessage::GIMBAL_DEVICE_SET_ATTITUDE(self.in_its_way(zero))
            }
            word => word,
        });
        match self.search.decided() {
            Some(Generation::V1) => vec![in_v1],
            Some(Generation::V2) => in_v2.collect(),
            None => std::iter::once(in_v1).chain(in_v2).collect(),
        }
    }

    fn may_be_turning(&self) -> bool {
        self.mount.may_be_turning() || self.turning.is_some() || self.stopping.is_some()
    }

    fn poll_output(&mut self) -> Option<DriverOutput> {
        self.outputs.pop_front()
    }

    fn poll_timeout(&self) -> Option<Timestamp> {
        let timer = self.timers.next().map(|(at, _)| at);
        let search = self.search.poll_timeout(self.evidence()).filter(|_| self.is_alive);
        let mode_change = self.mode_change.map(|change| change.poll_timeout());
        let mount = self.mount.poll_timeout(self.condition());
        let rest = [self.v2.poll_timeout(), self.parameters.poll_timeout(), self.operations.poll_timeout()];
        let stopping = self.stopping.and_then(|stopping| stopping.poll_timeout());
        [timer, search, mode_change, mount, stopping].into_iter().chain(rest).flatten().min()
    }

    fn details(&self, now: Timestamp) -> GimbalDetails {
        self.tell_details(now)
    }
}

/// What a gimbal with either table should have, or, before that is known, what tells the tables apart.
fn catalogue(has: &dyn Fn(&str) -> bool) -> Vec<Known> {
    let tables = [ParameterTable::New, ParameterTable::Old];
    let mark = |table: ParameterTable| table.name(Parameter::Stiffness(Axis::Tilt));
    let known = |table: ParameterTable| {
        table.rows().iter().map(|row| Known { name: row.name, index: row.index }).collect::<Vec<_>>()
    };
    match tables.into_iter().find(|table| mark(*table).is_some_and(has)) {
        Some(table) => known(table),
        None => {
            let marks = tables.into_iter().flat_map(|table| known(table).into_iter().map(move |row| (table, row)));
            marks.filter(|(table, row)| Some(row.name) == mark(*table)).map(|(_, row)| row).collect()
        }
    }
}

#[cfg(test)]
mod tests;
