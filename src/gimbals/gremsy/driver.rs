//! The conversation with a Gremsy: it is got to know, then steered in the generation of its protocol that it speaks.
//!
//! Follows the vendor's gSDK: who it is and its parameters are asked for, then it is waited for until everything in it is
//! in place; only then is it known to whoever steers. What it is told in v1 is in [`mount`]; in v2 it is a gimbal device of
//! the Gimbal Protocol, which the driver for those takes care of, with modes of the vendor's own ([`mode_change`]).

mod details;
mod effect;
mod faults;
mod generation;
mod mode_change;
mod mount;
mod operations;
mod steering;
mod streams;
mod telling;
mod vehicle_turn;
mod writes;

use std::collections::VecDeque;
use std::time::Duration;

use super::config::GremsySettings;
use super::packet;
use super::readings::{Encoders, Negated, Orientation, RawImu};
use super::status::{Activity, SystemStatus, read_system_status};
use super::version::FirmwareVersion;
use crate::gimbals::capabilities::Capabilities;
use crate::gimbals::details::GimbalDetails;
use crate::gimbals::driver::{CommandOutcome, DriverOutput, GimbalDriver};
use crate::gimbals::gremsy::parameters::{Axis, Parameter, ParameterTable};
use crate::gimbals::mavlink_v2::MavlinkV2Driver;
use crate::gimbals::mavlink_v2::packet::{DeviceInformation, read_information};
use crate::gimbals::operation::{Operation, OperationError, OperationId};
use crate::gimbals::parameters::{Encoding, Known, ParameterOutput, Parameters};
use crate::gimbals::report::{GimbalStatus, Identity, Report};
use crate::gimbals::setpoint::Setpoint;
use crate::gimbals::settings::Family;
use crate::timers::TimerTable;
use crate::timestamp::Timestamp;
use crate::wire::dialect::{COMMAND_ACK_DATA, COMMAND_LONG_DATA, HEARTBEAT_DATA, MavMessage};
use crate::wire::ids::{CommandResult, command, mav_state, message};
use crate::wire::{Frame, MavId};
use effect::EffectWatch;
use faults::{Fault, Faults};
pub use generation::Generation;
use generation::{Evidence, Search, Step};
use mode_change::ModeChange;
use mount::Mount;
use operations::Operations;
use streams::Streams;
use vehicle_turn::VehicleTurn;

/// A gimbal not heard for so long is lost: five heartbeats.
pub const LOST_AFTER: Duration = Duration::from_secs(5);

/// One that was told to start again is waited for this long: it is silent for ten seconds, and for two more.
const REBOOT_TAKES_AT_MOST: Duration = Duration::from_secs(20);

/// 283 is asked for so often, once a second.
const ASK_EVERY: Duration = Duration::from_secs(1);
const ASK_AT_MOST: u8 = 10;

/// What is looked after beside everything else.
const TICK: Duration = Duration::from_millis(500);

/// A gimbal should have become ready by then, or at least have told its status.
const READY_WITHIN: Duration = Duration::from_secs(20);
const STATUS_WITHIN: Duration = Duration::from_secs(10);

/// A time since boot that jumps back further means that the device was restarted.
const REBOOT_STEP_MS: u32 = 1_000;

/// Drives one Gremsy.
#[derive(Debug)]
pub struct GremsyDriver {
    settings: GremsySettings,
    device: Option<MavId>,
    is_alive: bool,
    /// That it is there was reported.
    is_reported: bool,
    /// It was told to start again and has not been heard since.
    is_booting: bool,
    reboot_announced: Option<Timestamp>,
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
    /// In v2, "retract" has switched the motors off.
    is_retracted: bool,
    /// Its radio receiver was given the gimbal.
    is_handed_over: bool,
    operations: Operations,
    heard: Heard,
    vehicle_turn: VehicleTurn,
    negated: Negated,
    effect: EffectWatch,
    faults: Faults,
    timers: TimerTable<Timer>,
    outputs: VecDeque<DriverOutput>,
}

/// The latest of everything that it tells.
#[derive(Debug, Default)]
struct Heard {
    latest: Timestamp,
    heartbeat: Option<Timestamp>,
    status: Option<(Timestamp, SystemStatus)>,
    imu: Option<(Timestamp, RawImu)>,
    encoders: Option<(Timestamp, Encoders)>,
    orientation: Option<(Timestamp, Orientation)>,
    /// As it was reported.
    attitude: Option<(Timestamp, GimbalStatus)>,
    device_status: Option<Timestamp>,
    information: Option<Timestamp>,
    boot_ms: Option<u32>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Timer {
    /// When to ask for 283 again.
    AskInformation,
    /// When to call it lost.
    Lost,
    /// When to look after the rest.
    Tick,
}

impl GremsyDriver {
    pub fn new(settings: GremsySettings) -> Self {
        Self {
            device: None,
            is_alive: false,
            is_reported: false,
            is_booting: false,
            reboot_announced: None,
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
            is_retracted: false,
            is_handed_over: false,
            operations: Operations::default(),
            heard: Heard::default(),
            vehicle_turn: VehicleTurn::default(),
            negated: settings.negated(),
            effect: EffectWatch::default(),
            faults: Faults::default(),
            timers: TimerTable::default(),
            outputs: VecDeque::new(),
            settings,
        }
    }

    /// Gets to know the gimbal, from its first heartbeat on and whenever it starts again.
    fn begin(&mut self, now: Timestamp, device: MavId) {
        self.begun = now;
        self.asked = 0;
        self.information = None;
        self.aligned_since = None;
        self.is_present = false;
        self.is_booting = false;
        self.reboot_announced = None;
        self.heard.status = None;
        self.streams.forget_heard();
        self.timers.set(Timer::AskInformation, now);
        self.timers.set(Timer::Tick, now + TICK);
        self.parameters.refresh(now, device);
        if let Some(generation) = self.search.decided() {
            self.set_streams(now, device, generation);
        }
    }

    /// It was started again, by whomever.
    fn restart(&mut self, now: Timestamp, device: MavId) {
        self.mount.handle_restart();
        self.mode_change = None;
        self.is_retracted = false;
        self.is_handed_over = false;
        self.effect.forget();
        self.heard.boot_ms = None;
        if self.is_reported {
            self.outputs.push_back(DriverOutput::Report(Report::Restarted));
        }
        self.begin(now, device);
    }

    fn handle_heard(&mut self, now: Timestamp, device: MavId) {
        self.heard.latest = now;
        self.timers.set(Timer::Lost, now + LOST_AFTER);
        if !self.is_alive {
            self.is_alive = true;
            self.begin(now, device);
            if self.search.decided().is_some() {
                self.report_alive(device);
            }
        } else if self.is_booting && self.reboot_announced.is_some_and(|at| now.since(at) > ASK_EVERY) {
            // Of that it has told already.
            self.begin(now, device);
        }
    }

    fn report_alive(&mut self, device: MavId) {
        if !self.is_reported {
            self.is_reported = true;
            self.outputs.push_back(DriverOutput::Report(Report::Alive { device }));
        }
    }

    fn lose(&mut self, now: Timestamp) {
        if let Some(announced) = self.reboot_announced
            && self.is_booting
            && now.since(announced) < REBOOT_TAKES_AT_MOST
        {
            self.timers.set(Timer::Lost, announced + REBOOT_TAKES_AT_MOST);
            return;
        }
        // One that is gone before it was known has been there all the same, and another may take its place.
        if let Some(device) = self.device {
            self.report_alive(device);
        }
        self.forget_conversation();
        self.outputs.push_back(DriverOutput::Report(Report::Lost));
    }

    fn forget_conversation(&mut self) {
        self.is_alive = false;
        self.is_reported = false;
        self.is_booting = false;
        self.is_present = false;
        self.reboot_announced = None;
        self.mount.handle_lost();
        self.mode_change = None;
        self.is_retracted = false;
        self.is_handed_over = false;
        self.effect.forget();
        self.heard = Heard::default();
        for id in self.operations.clear() {
            self.operated(id, Err(OperationError::NotThere));
        }
        self.parameters.forget();
        self.drain_parameters(Timestamp::ZERO);
        self.timers = TimerTable::default();
    }

    fn handle_heartbeat(&mut self, now: Timestamp, frame: &Frame<'_>) {
        let Some(heartbeat) = frame.decode::<HEARTBEAT_DATA>() else { return };
        self.heard.heartbeat = Some(now);
        // Many never set it, so only what says otherwise counts.
        self.is_active =
            !matches!(heartbeat.system_status, mav_state::BOOT | mav_state::CALIBRATING | mav_state::POWEROFF);
    }

    fn handle_status(&mut self, now: Timestamp, device: MavId, status: SystemStatus) {
        let was_running = self.is_present && !self.is_booting;
        self.heard.status = Some((now, status));
        if was_running && status.activity.contains(Activity::STARTING_UP) {
            self.restart(now, device);
            self.heard.status = Some((now, status));
        }
        if status.is_aligned() {
            self.aligned_since.get_or_insert(now);
            self.faults.clear(|fault| matches!(fault, Fault::NotAligned(_)));
        }
        self.faults.clear(|fault| *fault == Fault::NoStatus);
        for short in self.faults.handle_status(status) {
            self.warn(short);
        }
        if status.motors_on() {
            self.faults.clear(|fault| matches!(fault, Fault::MotorsOff | Fault::StaysRetracted));
            self.mount.handle_shown_mode(operations::shown_mode(status));
        }
        self.handle_shown(status);
    }

    fn handle_boot_ms(&mut self, now: Timestamp, device: MavId, boot_ms: u32) {
        let before = self.heard.boot_ms.replace(boot_ms);
        let is_back = before.is_some_and(|before| before.wrapping_sub(boot_ms) > REBOOT_STEP_MS && boot_ms < before);
        if is_back && self.is_present {
            self.restart(now, device);
            self.heard.boot_ms = Some(boot_ms);
        }
    }

    fn handle_ack(&mut self, frame: &Frame<'_>) {
        let Some(ack) = frame.decode::<COMMAND_ACK_DATA>() else { return };
        if ack.command == command::DO_MOUNT_CONTROL && ack.result != CommandResult::InProgress as u8 {
            self.mount.handle_answer();
            self.faults.clear(|fault| *fault == Fault::NoAnswers);
        }
    }

    /// Its version, from whichever tells it.
    fn version(&self) -> Option<FirmwareVersion> {
        let parameter = |parameter| {
            let table = self.table().unwrap_or(ParameterTable::New);
            self.parameters.value(table.name(parameter)?).map(|value| value as i16)
        };
        let version_z = parameter(Parameter::VersionZ);
        let told = self.information.as_ref().and_then(|information| information.identity.firmware);
        if let Some(told) = told {
            return Some(FirmwareVersion::from_information(told, version_z));
        }
        let (x, y, z) = (parameter(Parameter::VersionX)?, parameter(Parameter::VersionY)?, version_z?);
        Some(FirmwareVersion::from_parameters(x, y, z))
    }

    fn evidence(&self) -> Evidence {
        let is_asked = self.information.is_some() || self.asked >= ASK_AT_MOST;
        Evidence {
            version: self.version(),
            is_read: is_asked && self.parameters.is_settled(),
            aligned_since: self.aligned_since,
        }
    }

    /// Goes on with getting to know it.
    fn judge(&mut self, now: Timestamp, device: MavId) {
        if !self.is_alive {
            return;
        }
        match self.search.judge(now, self.evidence()) {
            None => {}
            Some(Step::Probe) => {
                let command = packet::set_message_rate(
                    device,
                    message::GIMBAL_DEVICE_ATTITUDE_STATUS,
                    packet::MessageRate::Hertz(10),
                );
                self.outputs.push_back(DriverOutput::Command(Box::new(command)));
            }
            Some(Step::Decided(generation)) => {
                tracing::info!(%device, generation = generation.name(), "the gimbal's protocol is known");
                let speaks = generation == Generation::V2;
                self.outputs.push_back(DriverOutput::Report(Report::SpeaksForItself(speaks)));
                self.report_alive(device);
                self.set_streams(now, device, generation);
            }
        }
        let is_ready = self.search.decided().is_some() && self.parameters.is_settled() && self.aligned_since.is_some();
        if is_ready && !self.is_present && !self.is_booting {
            self.is_present = true;
            self.look_at_settings();
            if let Some(generation) = self.search.decided() {
                self.streams.want(generation, self.needs_orientation());
            }
            self.set_missing_streams(now, device);
        }
        if self.is_present {
            self.report_known();
        }
    }

    fn set_streams(&mut self, now: Timestamp, device: MavId, generation: Generation) {
        self.streams.want(generation, self.needs_orientation());
        for command in self.streams.set(now, device) {
            self.outputs.push_back(DriverOutput::Command(Box::new(command)));
        }
    }

    /// Those that are wanted since more is known of it.
    fn set_missing_streams(&mut self, now: Timestamp, device: MavId) {
        let heard: Vec<_> = self.streams.heard().collect();
        let is_missing = self.streams.wanted().any(|(stream, _)| !heard.contains(&stream));
        if is_missing {
            for command in self.streams.set(now, device) {
                self.outputs.push_back(DriverOutput::Command(Box::new(command)));
            }
        }
    }

    /// In v2, where 285 tells only a yaw from North and that one is wrong.
    fn needs_orientation(&self) -> bool {
        let version = self.version();
        self.search.decided() == Some(Generation::V2)
            && version.is_some_and(|version| version.has_wrong_earth_yaw() && !version.tells_yaw_frame())
    }

    fn tick(&mut self, now: Timestamp, device: MavId) {
        self.timers.set(Timer::Tick, now + TICK);
        if self.is_booting {
            return;
        }
        if self.search.decided().is_some() && self.streams.is_silent(now) {
            for command in self.streams.set(now, device) {
                self.outputs.push_back(DriverOutput::Command(Box::new(command)));
            }
        }
        let waited = now.since(self.begun);
        match self.heard.status {
            None if waited >= STATUS_WITHIN => self.raise(Fault::NoStatus),
            Some((_, status)) if waited >= READY_WITHIN && !status.is_aligned() => {
                self.raise(Fault::NotAligned(status.alignment));
            }
            _ => {}
        }
        if self.mount.is_unanswered(now) {
            self.raise(Fault::NoAnswers);
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

    fn ask_information(&mut self, now: Timestamp, device: MavId) {
        if self.information.is_some() || self.asked >= ASK_AT_MOST {
            return;
        }
        self.asked += 1;
        self.timers.set(Timer::AskInformation, now + ASK_EVERY);
        let command = packet::request_message(device, message::GIMBAL_DEVICE_INFORMATION);
        self.outputs.push_back(DriverOutput::Message(Box::new(MavMessage::COMMAND_LONG(command))));
    }

    pub(super) fn drain_parameters(&mut self, _now: Timestamp) {
        while let Some(output) = self.parameters.poll_output() {
            match output {
                ParameterOutput::Send(message) => self.outputs.push_back(DriverOutput::Message(message)),
                ParameterOutput::Settled => {}
                ParameterOutput::Done { id, result } => self.operated(id, result),
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
                DriverOutput::Report(Report::Restarted) if self.is_present && !self.is_booting => {
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
        self.drain_parameters(now);
        self.judge(now, device);
        self.drain_parameters(now);
        self.steer_on(now, device);
        self.handle_operations_timeout(now);
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
            }
            message::MOUNT_ORIENTATION => self.handle_orientation(now, device, frame),
            message::MOUNT_STATUS => {
                // The encoders, and never where it looks.
                self.heard.encoders = Encoders::read(frame).map(|encoders| (now, encoders)).or(self.heard.encoders);
            }
            message::RAW_IMU => self.heard.imu = RawImu::read(frame).map(|imu| (now, imu)).or(self.heard.imu),
            message::COMMAND_ACK => self.handle_ack(frame),
            message::GIMBAL_DEVICE_INFORMATION => {
                self.heard.information = Some(now);
                self.information = read_information(frame).or(self.information.take());
                self.timers.cancel(Timer::AskInformation);
                self.look_at_settings();
            }
            _ => {}
        }
        self.v2.handle_received(now, frame);
        self.go_on(now);
    }

    fn handle_link_lost(&mut self) {
        self.v2.handle_link_lost();
        while self.v2.poll_output().is_some() {}
        if self.is_alive {
            if let Some(device) = self.device {
                self.report_alive(device);
            }
            self.forget_conversation();
            self.outputs.push_back(DriverOutput::Report(Report::Lost));
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
        self.mount.handle_outcome(now, device, command, is_done);
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
            }
        }
        self.go_on(now);
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
        [timer, search, mode_change, mount].into_iter().chain(rest).flatten().min()
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
