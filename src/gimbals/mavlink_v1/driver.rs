//! The conversation with a v1 gimbal: it is told angles, and says where it looks, or does not.
//!
//! A v1 gimbal is heard by its heartbeats alone. It has no rates and no yaw from North, so both are turned into angles
//! against the vehicle before they come here. One that must be configured is sent the newest setpoint when it has answered
//! that, or will not.

mod assumed;
mod watching;

use std::collections::VecDeque;
use std::time::Duration;

use self::assumed::{AssumedPose, capabilities};
use self::watching::DoesNotMove;
use super::config::{NO_RADIO_CONTROL, V1RadioControl, V1Settings};
use super::obedience::Obedience;
use super::packet::{self, MountControl};
use crate::geometry::{Attitude, GimbalAngles, VehicleFrame};
use crate::gimbals::boot_clock::BootClock;
use crate::gimbals::details::GimbalDetails;
use crate::gimbals::driver::{CommandOutcome, DriverOutput, GimbalDriver};
use crate::gimbals::gremsy;
use crate::gimbals::operation::{Operation, OperationError, OperationId};
use crate::gimbals::parameters::Parameters;
use crate::gimbals::report::{GimbalAttitude, GimbalStatus, Identity, Readiness, Report};
use crate::gimbals::setpoint::{Pointing, RadioControl, Setpoint};
use crate::gimbals::settings::Family;
use crate::timers::TimerTable;
use crate::timestamp::Timestamp;
use crate::wire::dialect::{COMMAND_LONG_DATA, HEARTBEAT_DATA, MOUNT_ORIENTATION_DATA, MOUNT_STATUS_DATA, MessageData};
use crate::wire::ids::{CommandResult, FailureFlags, GimbalFlags, mav_state, message};
use crate::wire::{Frame, MavId, Version};

/// A gimbal not heard for so long is lost: five heartbeats.
pub const LOST_AFTER: Duration = Duration::from_secs(5);

/// An unchanged setpoint is repeated so often.
const REPEAT_EVERY: Duration = Duration::from_millis(500);
/// And no setpoint is sent sooner after another.
const LEAST_INTERVAL: Duration = Duration::from_millis(20);

/// Without a report for so long, the attitude is that of a gimbal which does what it is told.
const FEEDBACK_MISSING_AFTER: Duration = Duration::from_secs(2);
const OPEN_LOOP_INTERVAL: Duration = Duration::from_millis(100);

/// A gimbal that sends `SYS_STATUS`, as no plain v1 gimbal is known to, is asked so often whether it is a Gremsy.
const GREMSY_QUESTIONS: u8 = 3;

/// Drives one v1 gimbal.
#[derive(Debug)]
pub struct MavlinkV1Driver {
    settings: V1Settings,
    device: Option<MavId>,
    alive: bool,
    /// It says that it is ready for angles; what it is told before its first word on that is kept for it.
    ready: bool,
    /// As it was reported.
    readiness: Option<Readiness>,
    wanted: Option<MountControl>,
    sent: Option<(Timestamp, MountControl)>,
    configuration: Configuration,
    feedback: Feedback,
    clock: BootClock,
    /// It said that it is one, which has a family of its own.
    says_gremsy: bool,
    gremsy_questions_left: u8,
    obedience: Obedience,
    does_not_move: DoesNotMove,
    /// It has sent MAVLink 2, and so understands what it is told in it.
    sends_mavlink_2: bool,
    assumed: AssumedPose,
    /// Read when somebody asks for that, and learned from what it tells others.
    parameters: Parameters,
    timers: TimerTable<Timer>,
    outputs: VecDeque<DriverOutput>,
}

/// Who tells where it looks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Feedback {
    /// Nobody yet.
    Awaited,
    /// `MOUNT_ORIENTATION`, which is believed rather than `MOUNT_STATUS`.
    Orientation,
    Status,
    /// Nobody: it is taken to do what it is told.
    OpenLoop,
}

/// What became of the `DO_MOUNT_CONFIGURE` that such a gimbal needs before another mode, a `MAV_MOUNT_MODE`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Configuration {
    Unknown,
    /// Sent, and neither answered nor given up.
    UnderWay(u8),
    Done(u8),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Timer {
    /// When to call the gimbal lost.
    Lost,
    /// When to tell it again, or what had to wait.
    Send,
    /// When to do without its reports.
    FeedbackMissing,
    /// When to report where it is taken to look.
    OpenLoop,
}

impl MavlinkV1Driver {
    pub fn new(settings: V1Settings) -> Self {
        Self {
            settings,
            device: None,
            alive: false,
            ready: false,
            readiness: None,
            wanted: None,
            sent: None,
            configuration: Configuration::Unknown,
            feedback: Feedback::Awaited,
            clock: BootClock::default(),
            says_gremsy: false,
            gremsy_questions_left: GREMSY_QUESTIONS,
            obedience: Obedience::default(),
            does_not_move: DoesNotMove::default(),
            sends_mavlink_2: false,
            assumed: AssumedPose::default(),
            parameters: Parameters::of_any_gimbal(),
            timers: TimerTable::default(),
            outputs: VecDeque::new(),
        }
    }

    fn handle_heard(&mut self, now: Timestamp, device: MavId) {
        self.timers.set(Timer::Lost, now + LOST_AFTER);
        if self.alive {
            return;
        }
        self.alive = true;
        self.parameters.listen(device);
        self.report(Report::Alive { device });
        self.report(Report::Known(self.identity(), capabilities(&self.settings)));
        self.feedback = Feedback::Awaited;
        self.timers.set(Timer::FeedbackMissing, now + FEEDBACK_MISSING_AFTER);
    }

    fn handle_heartbeat(&mut self, now: Timestamp, heartbeat: &HEARTBEAT_DATA) {
        // "system_status ACTIVE only when ready for angle targets"; many never set it, so only what says otherwise counts.
        let state = heartbeat.system_status;
        let ready =
            !matches!(state, mav_state::BOOT | mav_state::CALIBRATING | mav_state::STANDBY | mav_state::POWEROFF);
        let was_ready = std::mem::replace(&mut self.ready, ready);
        self.report_readiness();
        if state == mav_state::BOOT && was_ready {
            self.restart();
        }
        if ready && !was_ready {
            self.send_when_due(now);
        }
        if !ready {
            // It would do that when it is ready, however long after it was asked for.
            self.wanted = None;
            self.timers.cancel(Timer::Send);
            self.obedience.pause();
        }
    }

    fn report_readiness(&mut self) {
        let readiness = if self.ready { Readiness::Ready } else { Readiness::Starting };
        if self.readiness.replace(readiness) != Some(readiness) {
            self.report(Report::Readiness(readiness));
        }
    }

    fn handle_boot_ms(&mut self, boot_ms: u32) {
        if self.clock.handle_time(boot_ms) {
            self.restart();
            self.clock.handle_time(boot_ms);
        }
    }

    /// It does not do any more what it was told, and is not told it again before somebody asks. Its next heartbeat says
    /// whether it is ready.
    fn restart(&mut self) {
        self.clock.forget();
        self.ready = false;
        self.wanted = None;
        self.sent = None;
        self.configuration = Configuration::Unknown;
        self.obedience.forget();
        self.does_not_move.is_so = false;
        self.timers.cancel(Timer::Send);
        self.parameters.handle_restart();
        self.report(Report::Restarted);
    }

    fn handle_attitude(&mut self, now: Timestamp, from_status: bool, attitude: Attitude<VehicleFrame>) {
        if from_status && self.feedback == Feedback::Orientation {
            return;
        }
        let was_open_loop = self.feedback == Feedback::OpenLoop;
        self.feedback = if from_status { Feedback::Status } else { Feedback::Orientation };
        self.timers.set(Timer::FeedbackMissing, now + FEEDBACK_MISSING_AFTER);
        self.timers.cancel(Timer::OpenLoop);
        self.assumed = AssumedPose { angles: attitude.gimbal_angles(), at: now };
        if was_open_loop {
            self.report(Report::Known(self.identity(), capabilities(&self.settings)));
        }
        self.report_attitude(attitude);
    }

    fn report_attitude(&mut self, attitude: Attitude<VehicleFrame>) {
        let mut flags = GimbalFlags::YAW_IN_VEHICLE_FRAME;
        flags |= match self.sent {
            Some((_, MountControl::Retract)) => GimbalFlags::RETRACT,
            Some((_, MountControl::Neutral)) => GimbalFlags::NEUTRAL | GimbalFlags::ROLL_LOCK | GimbalFlags::PITCH_LOCK,
            Some((_, MountControl::RadioControl)) => {
                GimbalFlags::RC_EXCLUSIVE | GimbalFlags::ROLL_LOCK | GimbalFlags::PITCH_LOCK
            }
            Some((_, MountControl::Angles(_))) | None => GimbalFlags::ROLL_LOCK | GimbalFlags::PITCH_LOCK,
        };
        self.report(Report::Attitude(GimbalStatus {
            is_assumed: self.feedback == Feedback::OpenLoop,
            attitude: GimbalAttitude::InVehicleFrame(attitude),
            rates: [None; 3],
            heading: None,
            flags,
            failures: FailureFlags::empty(),
            accepts_earth_yaw: false,
        }));
    }

    fn identity(&self) -> Identity {
        let custom_name = if self.feedback == Feedback::OpenLoop { "open loop" } else { "" };
        Identity { model: "MAVLink v1".to_owned(), custom_name: custom_name.to_owned(), ..Identity::default() }
    }

    /// Sends what is wanted, or arranges for it.
    fn send_when_due(&mut self, now: Timestamp) {
        let (Some(device), Some(wanted), true, true) = (self.device, self.wanted, self.alive, self.ready) else {
            return;
        };
        let due = match self.sent {
            Some((at, sent)) => at + if sent == wanted { REPEAT_EVERY } else { LEAST_INTERVAL },
            None => now,
        };
        if due > now {
            self.timers.set(Timer::Send, due);
            return;
        }
        let silent = wanted == MountControl::RadioControl && self.settings.radio_control == V1RadioControl::Silence;
        if !silent && !self.is_configured(device, wanted.mode()) {
            // What comes in the meantime takes the place of what is wanted now.
            return;
        }
        // As long as it says where it looks it is not guessed about.
        if self.feedback == Feedback::OpenLoop {
            self.carry_assumed_on(now);
        }
        self.sent = Some((now, wanted));
        self.obedience.handle_target(match wanted {
            MountControl::Angles(angles) => Some([angles.pitch, angles.yaw]),
            MountControl::Retract | MountControl::Neutral | MountControl::RadioControl => None,
        });
        if silent {
            self.timers.cancel(Timer::Send);
            return;
        }
        self.timers.set(Timer::Send, now + REPEAT_EVERY);
        let message = packet::mount_control(device, wanted, self.settings.sign);
        self.outputs.push_back(DriverOutput::Message(Box::new(message)));
    }

    /// Whether the gimbal may be told something in `mode`; if not, it is configured for it.
    fn is_configured(&mut self, device: MavId, mode: u8) -> bool {
        if !self.settings.configures || self.configuration == Configuration::Done(mode) {
            return true;
        }
        if !matches!(self.configuration, Configuration::UnderWay(_)) {
            self.configuration = Configuration::UnderWay(mode);
            self.report(Report::HeldBack(true));
            self.outputs.push_back(DriverOutput::Command(Box::new(packet::mount_configure(device, mode))));
        }
        false
    }

    /// Moves the gimbal that says nothing to where it was told to go.
    fn carry_assumed_on(&mut self, now: Timestamp) {
        let target = match self.sent {
            Some((_, MountControl::Angles(angles))) => Some(angles),
            Some((_, MountControl::Retract | MountControl::Neutral)) => Some(GimbalAngles::default()),
            Some((_, MountControl::RadioControl)) | None => None,
        };
        self.assumed.carry_on(now, target);
    }

    fn report_assumed(&mut self, now: Timestamp) {
        self.carry_assumed_on(now);
        self.timers.set(Timer::OpenLoop, now + OPEN_LOOP_INTERVAL);
        self.report_attitude(Attitude::from_gimbal_angles(self.assumed.angles));
    }

    fn report(&mut self, report: Report) {
        self.outputs.push_back(DriverOutput::Report(report));
    }

    fn lose(&mut self) {
        self.alive = false;
        (self.ready, self.readiness) = (false, None);
        self.clock.forget();
        // Another may come in its place.
        self.says_gremsy = false;
        self.sends_mavlink_2 = false;
        self.gremsy_questions_left = GREMSY_QUESTIONS;
        // What it is told next is told anew, and not before it is asked for again.
        self.wanted = None;
        self.sent = None;
        self.configuration = Configuration::Unknown;
        self.obedience.forget();
        self.does_not_move.is_so = false;
        for timer in [Timer::Lost, Timer::Send, Timer::FeedbackMissing, Timer::OpenLoop] {
            self.timers.cancel(timer);
        }
        self.parameters.forget();
        self.report(Report::Lost);
    }
}

impl GimbalDriver for MavlinkV1Driver {
    fn family(&self) -> Family {
        Family::MavlinkV1
    }

    fn adopt(&mut self, _now: Timestamp, device: MavId) {
        let outputs = std::mem::take(&mut self.outputs);
        *self = Self { device: Some(device), outputs, ..Self::new(self.settings) };
    }

    fn handle_received(&mut self, now: Timestamp, frame: &Frame<'_>) {
        let Some(device) = self.device.filter(|device| *device == frame.source()) else { return };
        self.sends_mavlink_2 |= frame.version() == Version::V2;
        match frame.message_id() {
            message::SYS_STATUS if self.alive && !self.says_gremsy && self.gremsy_questions_left > 0 => {
                self.gremsy_questions_left -= 1;
                let questions = gremsy::telling_questions(device);
                self.outputs.extend(questions.map(|question| DriverOutput::Message(Box::new(question))));
            }
            message::PARAM_VALUE | message::GIMBAL_DEVICE_INFORMATION => {
                self.says_gremsy |= gremsy::is_known_by(frame);
                self.parameters.handle_received(now, frame);
            }
            message::HEARTBEAT => {
                let Some(heartbeat) = frame.decode::<HEARTBEAT_DATA>() else { return };
                self.handle_heard(now, device);
                self.handle_heartbeat(now, &heartbeat);
            }
            message::MOUNT_ORIENTATION | message::MOUNT_STATUS => {
                self.handle_heard(now, device);
                if let Some(orientation) = frame.decode::<MOUNT_ORIENTATION_DATA>() {
                    self.handle_boot_ms(orientation.time_boot_ms);
                }
                if let Some(attitude) = packet::read_attitude(frame, self.settings.report_sign) {
                    let from_status = frame.message_id() == MOUNT_STATUS_DATA::ID;
                    if !from_status || self.feedback != Feedback::Orientation {
                        self.watch_obedience(now, frame, attitude);
                    }
                    self.handle_attitude(now, from_status, attitude);
                }
            }
            _ => {}
        }
        self.handle_timeout(now);
    }

    fn handle_link_lost(&mut self) {
        if self.alive {
            self.lose();
        }
        self.parameters.drain_into(&mut self.outputs);
    }

    fn handle_setpoint(&mut self, now: Timestamp, setpoint: Setpoint) {
        if self.readiness == Some(Readiness::Starting) {
            return;
        }
        self.wanted = Some(match setpoint {
            Setpoint::Retract => MountControl::Retract,
            Setpoint::Neutral => MountControl::Neutral,
            Setpoint::Point(Pointing { radio_control: RadioControl::Exclusive, .. })
                if self.settings.radio_control != V1RadioControl::None =>
            {
                MountControl::RadioControl
            }
            Setpoint::Point(pointing) => MountControl::Angles(GimbalAngles {
                roll: pointing.roll,
                pitch: pointing.pitch,
                yaw: pointing.yaw.angle(),
            }),
            // It has no rates: whoever decides turns the angles.
            Setpoint::Turn(_) => return,
        });
        self.send_when_due(now);
    }

    /// A gimbal that refuses to be configured, or does not answer, may do without.
    fn handle_command_outcome(&mut self, now: Timestamp, command: &COMMAND_LONG_DATA, outcome: CommandOutcome) {
        let Configuration::UnderWay(mode) = self.configuration else { return };
        if f32::from(mode) != command.param1 {
            return;
        }
        if outcome != CommandOutcome::Answered(CommandResult::Accepted as u8) {
            tracing::debug!(mode, ?outcome, "the gimbal was not configured");
        }
        self.configuration = Configuration::Done(mode);
        self.report(Report::HeldBack(false));
        self.send_when_due(now);
    }

    /// Its parameters are read and set, and it is handed to its radio control as by a demand; nothing else has a message.
    fn handle_operation(&mut self, now: Timestamp, id: OperationId, operation: Operation) {
        let result = match operation {
            Operation::RefreshParameters => {
                self.parameters.refresh_for(now, id);
                return self.parameters.drain_into(&mut self.outputs);
            }
            Operation::SetParameter { name, value } => {
                self.parameters.set(now, id, &[(&name, value)]);
                return self.parameters.drain_into(&mut self.outputs);
            }
            Operation::RadioControl if self.readiness == Some(Readiness::Starting) => Err(OperationError::NotReady),
            Operation::RadioControl if self.settings.radio_control != V1RadioControl::None => {
                self.wanted = Some(MountControl::RadioControl);
                self.send_when_due(now);
                Ok(())
            }
            Operation::RadioControl => Err(OperationError::NotConfigured(NO_RADIO_CONTROL)),
            _ => Err(OperationError::Unsupported),
        };
        self.outputs.push_back(DriverOutput::Operated { id, result });
    }

    fn handle_timeout(&mut self, now: Timestamp) {
        while let Some(timer) = self.timers.pop_due(now) {
            match timer {
                Timer::Lost => self.lose(),
                Timer::Send => self.send_when_due(now),
                Timer::FeedbackMissing => {
                    self.feedback = Feedback::OpenLoop;
                    self.obedience.pause();
                    self.assumed.at = now;
                    self.report(Report::Known(self.identity(), capabilities(&self.settings)));
                    self.report_assumed(now);
                }
                Timer::OpenLoop => self.report_assumed(now),
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
        let wrong_family = self.says_gremsy.then(|| gremsy::wrong_family(Family::MavlinkV1));
        let does_not_move = self.does_not_move.is_so.then(|| self.why_it_may_not_move());
        let faults = wrong_family.into_iter().chain(does_not_move).collect();
        GimbalDetails { faults, parameters: self.parameters.by_name(), ..GimbalDetails::default() }
    }
}

#[cfg(test)]
mod tests;
