//! The conversation with a v2 gimbal device: discovery, supervision, setpoints.
//!
//! Follows "Discovery of gimbal device" of the Gimbal Protocol v2: ask for 283 until it comes, keep an eye on 285.

use std::collections::VecDeque;
use std::time::Duration;

use super::packet::{self, DeviceStatus, WhichGimbal};
use crate::geometry::Angle;
use crate::gimbals::boot_clock::BootClock;
use crate::gimbals::capabilities::Capabilities;
use crate::gimbals::details::GimbalDetails;
use crate::gimbals::driver::{CommandOutcome, DriverOutput, GimbalDriver};
use crate::gimbals::gremsy;
use crate::gimbals::operation::{Operation, OperationError, OperationId};
use crate::gimbals::parameters::Parameters;
use crate::gimbals::report::{GimbalStatus, Identity, Report};
use crate::gimbals::setpoint::{Setpoint, Turning};
use crate::gimbals::settings::Family;
use crate::timers::TimerTable;
use crate::timestamp::Timestamp;
use crate::wire::dialect::{COMMAND_LONG_DATA, MavMessage};
use crate::wire::ids::{CapFlags, GimbalFlags, command, message};
use crate::wire::{Frame, MavId, Target};

/// A device not heard for so long is lost.
pub const LOST_AFTER: Duration = Duration::from_secs(3);

/// 283 is asked for so often …
const ASK_EVERY: Duration = Duration::from_secs(1);
/// … for so long …
const ASK_EAGERLY_FOR: Duration = Duration::from_secs(30);
/// … and so often from then on, for ever.
const ASK_PATIENTLY_EVERY: Duration = Duration::from_secs(5);

/// So often a gimbal was asked what it is when it is named as one that does not say.
const SILENT_AFTER_REQUESTS: u32 = 25;
const SAYS_NOTHING_OF_ITSELF: &str = "it is heard, and tells neither what it is (GIMBAL_DEVICE_INFORMATION) nor where it looks \
    (GIMBAL_DEVICE_ATTITUDE_STATUS), so that it cannot be steered. Check that what is sent arrives there. If it does, this is \
    no device of gimbal protocol v2: leave its family out of the configuration, and it is found out";

fn says_wrong_id(id: u8) -> String {
    format!(
        "it tells what it is and where it looks (GIMBAL_DEVICE_INFORMATION and GIMBAL_DEVICE_ATTITUDE_STATUS) of a gimbal with the \
         gimbal_device_id {id}, which no gimbal has, so that nothing of it counts. Have its firmware say 0 there, or its own component id"
    )
}

/// The first requests go to everybody, as the guide has it; then to the one device heard.
const BROADCAST_REQUESTS: u32 = 2;

/// A device that sends 285 and never 283 is used all the same after so long.
const USABLE_WITHOUT_INFORMATION_AFTER: Duration = Duration::from_secs(5);

/// 285 is counted over such a time …
const RATE_WINDOW: Duration = Duration::from_secs(5);
/// … and should come at least so often …
const LEAST_STATUS_RATE_HZ: u32 = 5;
/// … or is asked for at this interval, once; so often when there is no answer.
const WANTED_STATUS_INTERVAL: Duration = Duration::from_millis(100);
const RATE_REQUESTS: u8 = 3;

#[derive(Clone, Copy, Debug, Default)]
struct Clocks {
    of_information: BootClock,
    of_status: BootClock,
}

/// Drives one v2 gimbal device.
#[derive(Debug, Default)]
pub struct MavlinkV2Driver {
    device: Option<MavId>,
    alive: bool,
    /// Something was said of its capabilities: by itself, or by our patience.
    known: bool,
    informed: bool,
    /// It tells of a gimbal with this id, which is neither its own nor that of any other.
    wrong_id: Option<u8>,
    first_status: Option<Timestamp>,
    asking_since: Timestamp,
    requests: u32,
    /// When it was or will be asked because it seemed to have been restarted.
    asked_on_restart: Option<Timestamp>,
    /// The clocks by which it stamps 283 and 285: they are not the same in every device.
    clocks: Clocks,
    statuses_in_window: u32,
    /// How often 285 may still be asked for.
    rate_requests_left: u8,
    capabilities: Option<Capabilities>,
    /// Its maker has a family of its own.
    says_gremsy: bool,
    /// It has set a frame bit, so it is newer than them.
    sets_frame_bits: bool,
    /// Its `delta_yaw` was not zero once, so it does fill it in.
    fills_delta_yaw: bool,
    /// Read when somebody asks for that, and learned from what it tells others.
    parameters: Parameters,
    timers: TimerTable<Timer>,
    outputs: VecDeque<DriverOutput>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Timer {
    /// When to ask for 283 again.
    AskInformation,
    /// When to call the device lost.
    Lost,
    /// When to do without 283.
    UseWithoutInformation,
    /// When to judge the rate of 285.
    CheckRate,
}

impl MavlinkV2Driver {
    pub fn new() -> Self {
        Self::default()
    }

    fn handle_heard(&mut self, now: Timestamp, device: MavId) {
        self.timers.set(Timer::Lost, now + LOST_AFTER);
        if self.alive {
            return;
        }
        self.alive = true;
        self.parameters.listen(device);
        self.outputs.push_back(DriverOutput::Report(Report::Alive { device }));
        self.timers.set(Timer::CheckRate, now + RATE_WINDOW);
        self.statuses_in_window = 0;
        self.rate_requests_left = RATE_REQUESTS;
        self.ask_anew(now);
    }

    /// It may be another one, and is asked what it is.
    pub fn ask_information_anew(&mut self, now: Timestamp) {
        if self.alive {
            self.ask_anew(now);
        }
    }

    fn ask_anew(&mut self, now: Timestamp) {
        self.informed = false;
        self.first_status = None;
        self.asking_since = now;
        self.requests = 0;
        self.timers.set(Timer::AskInformation, now);
    }

    fn handle_boot_time(&mut self, now: Timestamp, of: fn(&mut Clocks) -> &mut BootClock, boot_ms: u32) {
        let clock = of(&mut self.clocks);
        if clock.handle_time(boot_ms) {
            // The other one shows the same restart, and is told it once.
            self.clocks = Clocks::default();
            of(&mut self.clocks).handle_time(boot_ms);
            self.fills_delta_yaw = false;
            self.rate_requests_left = RATE_REQUESTS;
            self.parameters.handle_restart();
            self.outputs.push_back(DriverOutput::Report(Report::Restarted));
            self.ask_anew(now);
            // Two devices under one id seem to be restarted with every word they say.
            let at = match self.asked_on_restart {
                Some(ahead) if ahead > now => ahead,
                Some(last) => now.max(last + ASK_EVERY),
                None => now,
            };
            self.asked_on_restart = Some(at);
            self.timers.set(Timer::AskInformation, at);
        }
    }

    fn is_of_itself(&mut self, of: WhichGimbal) -> bool {
        match of {
            WhichGimbal::Sender => self.wrong_id = None,
            WhichGimbal::Nobody(id) => self.wrong_id = Some(id),
            WhichGimbal::BehindSender => {}
        }
        of == WhichGimbal::Sender
    }

    fn handle_information(&mut self, now: Timestamp, frame: &Frame<'_>) {
        let Some(information) = packet::read_information(frame) else { return };
        if !self.is_of_itself(information.of) {
            return;
        }
        self.handle_boot_time(now, |clocks| &mut clocks.of_information, information.boot_ms);
        self.informed = true;
        self.timers.cancel(Timer::AskInformation);
        self.timers.cancel(Timer::UseWithoutInformation);
        self.says_gremsy = gremsy::is_vendor(&information.identity.vendor);
        self.become_known(information.identity, information.capabilities);
    }

    fn become_known(&mut self, identity: Identity, capabilities: Capabilities) {
        self.known = true;
        self.capabilities = Some(capabilities);
        self.outputs.push_back(DriverOutput::Report(Report::Known(identity, capabilities)));
    }

    fn handle_status(&mut self, now: Timestamp, frame: &Frame<'_>) {
        let Some(status) = packet::read_status(frame) else { return };
        if !self.is_of_itself(status.of) {
            return;
        }
        self.handle_boot_time(now, |clocks| &mut clocks.of_status, status.boot_ms);
        self.statuses_in_window += 1;
        if self.first_status.is_none() && !self.informed {
            self.first_status = Some(now);
            self.timers.set(Timer::UseWithoutInformation, now + USABLE_WITHOUT_INFORMATION_AFTER);
        }
        self.sets_frame_bits |=
            status.flags.intersects(GimbalFlags::YAW_IN_VEHICLE_FRAME | GimbalFlags::YAW_IN_EARTH_FRAME);
        let attitude = match status.attitude {
            Ok(attitude) => attitude,
            Err(reason) => {
                self.outputs.push_back(DriverOutput::Report(Report::Malformed { reason }));
                return;
            }
        };
        let heading = self.trusted_heading(&status);
        let accepts_earth_yaw = self.accepts_earth_yaw(status.flags);
        self.outputs.push_back(DriverOutput::Report(Report::Attitude(GimbalStatus {
            is_assumed: false,
            attitude,
            rates: status.rates,
            heading,
            flags: status.flags,
            failures: status.failures,
            accepts_earth_yaw,
        })));
    }

    /// `delta_yaw` counts only beside a frame bit and where the frame really carried it: a field cut off reads 0,
    /// which is also North.
    fn trusted_heading(&mut self, status: &DeviceStatus) -> Option<Angle> {
        let delta_yaw = status.delta_yaw?;
        if !status.flags.intersects(GimbalFlags::YAW_IN_VEHICLE_FRAME | GimbalFlags::YAW_IN_EARTH_FRAME) {
            return None;
        }
        self.fills_delta_yaw |= delta_yaw.radians() != 0.0;
        (status.extended || self.fills_delta_yaw).then_some(delta_yaw)
    }

    /// A new device says so in its status, moment by moment; an old one can do what it has a lock for.
    fn accepts_earth_yaw(&self, flags: GimbalFlags) -> bool {
        if self.sets_frame_bits {
            flags.contains(GimbalFlags::ACCEPTS_YAW_IN_EARTH_FRAME)
        } else {
            self.capabilities.is_some_and(|capabilities| capabilities.flags.contains(CapFlags::HAS_YAW_LOCK))
        }
    }

    fn send(&mut self, message: MavMessage) {
        self.outputs.push_back(DriverOutput::Message(Box::new(message)));
    }

    fn ask_information(&mut self, now: Timestamp) {
        let Some(device) = self.device else { return };
        let target = if self.requests < BROADCAST_REQUESTS { Target::Everyone } else { Target::Component(device) };
        self.requests += 1;
        self.send(packet::request_message(target, message::GIMBAL_DEVICE_INFORMATION));
        let eager = now.since(self.asking_since) < ASK_EAGERLY_FOR;
        self.timers.set(Timer::AskInformation, now + if eager { ASK_EVERY } else { ASK_PATIENTLY_EVERY });
    }

    fn check_rate(&mut self, now: Timestamp) {
        let Some(device) = self.device else { return };
        let enough = LEAST_STATUS_RATE_HZ * RATE_WINDOW.as_secs() as u32;
        if self.statuses_in_window < enough && self.rate_requests_left > 0 {
            self.rate_requests_left -= 1;
            let wanted = message::GIMBAL_DEVICE_ATTITUDE_STATUS;
            let command = packet::set_message_interval(device, wanted, WANTED_STATUS_INTERVAL);
            self.outputs.push_back(DriverOutput::Command(Box::new(command)));
        }
        self.statuses_in_window = 0;
        self.timers.set(Timer::CheckRate, now + RATE_WINDOW);
    }

    fn lose(&mut self) {
        self.alive = false;
        self.clocks = Clocks::default();
        self.parameters.forget();
        for timer in [Timer::AskInformation, Timer::UseWithoutInformation, Timer::CheckRate] {
            self.timers.cancel(timer);
        }
        self.outputs.push_back(DriverOutput::Report(Report::Lost));
    }
}

impl GimbalDriver for MavlinkV2Driver {
    fn family(&self) -> Family {
        Family::MavlinkV2
    }

    fn adopt(&mut self, _now: Timestamp, device: MavId) {
        *self = Self { device: Some(device), outputs: std::mem::take(&mut self.outputs), ..Self::default() };
    }

    fn handle_received(&mut self, now: Timestamp, frame: &Frame<'_>) {
        if Some(frame.source()) != self.device {
            return;
        }
        match frame.message_id() {
            message::HEARTBEAT => self.handle_heard(now, frame.source()),
            message::GIMBAL_DEVICE_INFORMATION => {
                self.handle_heard(now, frame.source());
                self.handle_information(now, frame);
            }
            message::GIMBAL_DEVICE_ATTITUDE_STATUS => {
                self.handle_heard(now, frame.source());
                self.handle_status(now, frame);
            }
            message::PARAM_VALUE => self.parameters.handle_received(now, frame),
            _ => {}
        }
        self.handle_timeout(now);
    }

    fn handle_link_lost(&mut self) {
        self.timers.cancel(Timer::Lost);
        if self.alive {
            self.lose();
        }
        self.parameters.drain_into(&mut self.outputs);
    }

    fn handle_setpoint(&mut self, _now: Timestamp, setpoint: Setpoint) {
        // One that is not heard may still hear that it is to stop.
        let stops = matches!(setpoint, Setpoint::Turn(turning) if turning.is_zero());
        if let Some(device) = self.device
            && (self.alive || stops)
        {
            self.send(packet::set_attitude(device, &setpoint));
        }
    }

    fn words_that_stop(&self, turning: Turning) -> Vec<MavMessage> {
        let zero = Setpoint::Turn(turning.stopped());
        self.device.map(|device| packet::set_attitude(device, &zero)).into_iter().collect()
    }

    fn handle_command_outcome(&mut self, _now: Timestamp, command: &COMMAND_LONG_DATA, outcome: CommandOutcome) {
        let ours = self.device == Some(MavId::new(command.target_system, command.target_component));
        // Whatever the answer is, asking again would not change it.
        if ours && command.command == command::SET_MESSAGE_INTERVAL && matches!(outcome, CommandOutcome::Answered(_)) {
            self.rate_requests_left = 0;
        }
    }

    fn handle_operation(&mut self, now: Timestamp, id: OperationId, operation: Operation) {
        match operation {
            Operation::RefreshParameters => self.parameters.refresh_for(now, id),
            Operation::SetParameter { name, value } => self.parameters.set(now, id, &[(&name, value)]),
            _ => self.outputs.push_back(DriverOutput::Operated { id, result: Err(OperationError::Unsupported) }),
        }
        self.parameters.drain_into(&mut self.outputs);
    }

    fn handle_timeout(&mut self, now: Timestamp) {
        while let Some(timer) = self.timers.pop_due(now) {
            match timer {
                Timer::AskInformation => self.ask_information(now),
                Timer::Lost => self.lose(),
                Timer::UseWithoutInformation if !self.known => {
                    self.become_known(Identity::default(), Capabilities::assumed());
                }
                Timer::UseWithoutInformation => {}
                Timer::CheckRate => self.check_rate(now),
            }
        }
        self.parameters.handle_timeout(now);
        self.parameters.drain_into(&mut self.outputs);
    }

    fn hand_over_parameters(&mut self) -> Option<Parameters> {
        Some(std::mem::take(&mut self.parameters))
    }

    fn take_over_parameters(&mut self, parameters: Parameters) {
        self.parameters = parameters;
    }

    fn poll_output(&mut self) -> Option<DriverOutput> {
        self.outputs.pop_front()
    }

    fn poll_timeout(&self) -> Option<Timestamp> {
        let timer = self.timers.next().map(|(at, _)| at);
        [timer, self.parameters.poll_timeout()].into_iter().flatten().min()
    }

    fn details(&self, _now: Timestamp) -> GimbalDetails {
        let gremsy = self.says_gremsy.then(|| gremsy::wrong_family(Family::MavlinkV2));
        let wrong_id = self.wrong_id.filter(|_| self.alive);
        let is_silent = self.alive && !self.known && wrong_id.is_none() && self.requests >= SILENT_AFTER_REQUESTS;
        let silent = is_silent.then(|| SAYS_NOTHING_OF_ITSELF.to_owned());
        GimbalDetails {
            faults: gremsy.into_iter().chain(silent).chain(wrong_id.map(says_wrong_id)).collect(),
            parameters: self.parameters.by_name(),
            ..GimbalDetails::default()
        }
    }
}
