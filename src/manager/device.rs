//! The gimbal as its driver tells of it, and what follows from that.

use super::events::Event;
use super::heading::HeadingBias;
use super::readiness::ReadinessWatch;
use super::request::Refusal;
use super::voice::DeviceVoice;
use super::{DeviceState, GimbalManager, Surroundings};
use crate::gimbals::capabilities::Capabilities;
use crate::gimbals::report::{GimbalStatus, Identity, Readiness, Report};
use crate::timestamp::Timestamp;
use crate::wire::MavId;
use crate::wire::ids::{CommandResult, FailureFlags};

impl GimbalManager {
    /// News from the driver.
    pub fn handle_report(&mut self, now: Timestamp, report: Report, around: Surroundings<'_>) {
        if !matches!(report, Report::Attitude(_) | Report::HeldBack(_) | Report::Malformed { .. } | Report::Fault(_)) {
            self.last_command = None;
        }
        if matches!(report, Report::Restarted | Report::AnotherFamily | Report::Lost | Report::ShutDown) {
            self.pauses.clear();
            self.is_held_back = false;
        }
        match report {
            Report::Restarted => {
                // What it was told to stop it may not have heard. One that is known to start again is told by its driver.
                self.forget_demand(now, self.readiness.is_ready() && self.may_be_turning());
                self.heading_bias = HeadingBias::default();
                self.restarts.handle_restarted(now);
                // Two that seem to be one are told of as a conflict.
                if self.readiness.handle_restarted() && !self.seems_to_be_two(now) {
                    self.tell(Event::Restarted { device: self.device });
                }
            }
            Report::Readiness(readiness) => {
                if readiness == Readiness::Starting {
                    self.pauses.clear();
                    self.forget_demand(now, false);
                }
                if self.readiness.handle(readiness) {
                    self.tell(Event::Ready { device: self.device });
                }
                self.stop_what_was_left_turning(now);
            }
            Report::HeldBack(is_held_back) => self.is_held_back = is_held_back,
            Report::Stands => self.forget_rotation(),
            Report::Alive { device } => {
                if self.device != Some(device) {
                    self.readiness = ReadinessWatch::default();
                    // It may be the one that was told to turn, under another id.
                    self.leave_turning();
                    self.tracking.forget();
                    self.heading_bias = HeadingBias::default();
                    self.identity = Identity::default();
                    self.capabilities = None;
                    self.status = None;
                    self.told_attitude = None;
                }
                let known = self.device.replace(device) == Some(device);
                (self.state, self.is_heard, self.is_shut_down) = (DeviceState::Alive, true, false);
                self.readiness.handle_alive();
                self.tell(if known { Event::Back { device } } else { Event::Found { device } });
                self.stop_what_was_left_turning(now);
            }
            Report::AnotherFamily => {
                self.readiness = ReadinessWatch::default();
                self.tracking.forget();
                self.heading_bias = HeadingBias::default();
                self.capabilities = None;
                self.status = None;
                self.leave_turning();
                self.stop_what_was_left_turning(now);
            }
            Report::SpeaksForItself(itself) => {
                self.speak_for_device(now, !itself);
                if !std::mem::replace(&mut self.has_settled_id, true) {
                    self.broadcast_status(now);
                }
            }
            Report::Known(identity, capabilities) => {
                let changed = self.identity != identity || self.capabilities != Some(capabilities);
                self.identity = identity;
                self.capabilities = Some(capabilities);
                self.has_settled_id = true;
                self.stop_what_was_left_turning(now);
                if changed {
                    let (vendor, model) = (&self.identity.vendor, &self.identity.model);
                    tracing::info!(gimbal = self.settings.name, vendor, model, "gimbal known");
                    self.announce(now, around);
                }
            }
            Report::Attitude(status) => {
                if let Some(of_gimbal) = status.heading {
                    self.heading_bias.handle_heading(now, of_gimbal, around.vehicle.heading(now));
                }
                if let Some(voice) = &mut self.voice {
                    voice.handle_status(status);
                }
                self.status = Some((now, status));
                self.told_attitude = Some(now);
                self.note_look(now, &status, around.vehicle);
                if let Some(capabilities) = self.capabilities {
                    let situation = self.situation(now, &capabilities, around);
                    if status.heading.is_some() {
                        self.tracking.handle_turned(now, &situation);
                    }
                    if !situation.radio_control_has_it() {
                        self.stop_what_radio_control_left(now);
                    }
                }
            }
            Report::Fault(what) => self.tell(Event::Fault { what }),
            Report::Malformed { reason } => {
                if let Some(device) = self.device {
                    self.count_refusal(device, reason);
                }
            }
            Report::Lost => {
                self.lose();
                self.tell(Event::Lost { device: self.device });
            }
            Report::ShutDown => {
                self.lose();
                self.is_shut_down = true;
                self.tell(Event::ShutDown { device: self.device });
            }
        }
        self.carry_out(now, around);
    }

    fn lose(&mut self) {
        (self.state, self.is_heard) = (DeviceState::Lost, false);
        self.status = None;
        // It may hear us while we do not hear it; and it is stopped when it is heard again.
        if self.may_be_turning() {
            self.stop_at_once();
            self.leave_turning();
        }
        self.tracking.forget();
    }

    /// From now on speaks for the gimbal, or leaves that to the gimbal itself.
    pub(super) fn speak_for_device(&mut self, now: Timestamp, speaks: bool) {
        if self.voice.is_some() == speaks {
            return;
        }
        self.voice = self.number.filter(|_| speaks).map(|number| {
            let mut voice = DeviceVoice::new(number);
            for channel in self.status_schedule.channels() {
                voice.schedule.open(now, channel);
            }
            voice
        });
    }

    /// Keeps a device id for the gimbal in case that it turns out to be no v2 device.
    pub fn keep_number(&mut self, number: u8) {
        self.number = Some(number);
    }

    /// The device id that is kept, whether it is used or not.
    pub fn kept_number(&self) -> Option<u8> {
        self.number
    }

    /// 1 to 6 where the gimbal is no v2 device.
    pub fn number(&self) -> Option<u8> {
        self.voice.as_ref().map(DeviceVoice::number)
    }

    /// The gimbal device id of 280 and 281: a v2 device's component id, any other gimbal's number.
    pub fn device_id(&self) -> Option<u8> {
        self.device.map(|device| self.number().unwrap_or(device.component))
    }

    pub fn device(&self) -> Option<MavId> {
        self.device
    }

    pub fn state(&self) -> DeviceState {
        self.state
    }

    /// It is lost, and that is what was asked of it.
    pub fn is_shut_down(&self) -> bool {
        self.is_shut_down
    }

    pub fn identity(&self) -> &Identity {
        &self.identity
    }

    /// What the device can do, once it is known.
    pub fn capabilities(&self) -> Option<&Capabilities> {
        self.capabilities.as_ref()
    }

    /// Whether enough is known of the device to steer it.
    pub fn is_known(&self) -> bool {
        self.capabilities.is_some()
    }

    /// The latest attitude and when it came, however old.
    pub fn status(&self) -> Option<(Timestamp, &GimbalStatus)> {
        self.status.as_ref().map(|(at, status)| (*at, status))
    }

    /// When the device last told an attitude, also if it is lost.
    pub fn told_attitude_at(&self) -> Option<Timestamp> {
        self.told_attitude
    }

    /// Whether the device reports a fault that is more than a limit reached.
    pub fn has_hard_failure(&self) -> bool {
        self.status.is_some_and(|(_, status)| status.failures.intersects(FailureFlags::HARD))
    }

    /// Its setpoint is forgotten. Its clock may have jumped while it goes on turning: then it is stopped.
    fn forget_demand(&mut self, now: Timestamp, may_be_turning: bool) {
        let turns_on = may_be_turning || self.tracking.unstopped().is_some();
        self.tracking.forget();
        if turns_on {
            self.leave_turning();
            self.stop_what_was_left_turning(now);
        }
    }

    /// Whether there is a gimbal that can be steered now.
    pub(super) fn steerable(&self) -> Result<&Capabilities, Refusal> {
        match (self.state, &self.capabilities) {
            (DeviceState::Lost, _) if self.is_shut_down => {
                Err(Refusal { result: CommandResult::Failed, reason: "gimbal_shut_down" })
            }
            (DeviceState::Lost, _) => Err(Refusal { result: CommandResult::Failed, reason: "gimbal_lost" }),
            (DeviceState::Alive, Some(_)) if !self.readiness.is_ready() => Err(Refusal::later("gimbal_starting")),
            (DeviceState::Alive, Some(capabilities)) => {
                let calibrating =
                    self.status.is_some_and(|(_, status)| status.failures.contains(FailureFlags::CALIBRATION_RUNNING));
                if calibrating { Err(Refusal::later("gimbal_calibrating")) } else { Ok(capabilities) }
            }
            (DeviceState::Alive, None) => Err(Refusal::later("gimbal_unknown_yet")),
            _ => Err(Refusal::later("no_gimbal_yet")),
        }
    }
}
