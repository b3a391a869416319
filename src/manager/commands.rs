//! `COMMAND_LONG` and `COMMAND_INT` for a gimbal manager, each with its one answer.

use super::messages::{self, Interval};
use super::request::{Command, Configure, Form, Refusal};
use super::settings::AltitudeReference;
use super::{GimbalManager, ManagerOutput, Sender, Surroundings};
use crate::geometry::Position;
use crate::timestamp::Timestamp;
use crate::vehicle::Autopilot;
use crate::wire::MavId;
use crate::wire::dialect::MavMessage;
use crate::wire::ids::{CommandResult, command, mav_frame, message};

/// What becomes of a command.
enum Outcome {
    /// Done.
    Accepted,
    /// Not for us: addressed to everybody, and somebody else's business.
    Ignored,
}

impl GimbalManager {
    pub(super) fn handle_command(
        &mut self,
        now: Timestamp,
        sender: Sender,
        command: &Command,
        around: Surroundings<'_>,
    ) {
        let first_answer = self.outputs.len();
        let outcome = match command.number {
            command::DO_GIMBAL_MANAGER_CONFIGURE
            | command::DO_GIMBAL_MANAGER_PITCHYAW
            | command::DO_SET_ROI_LOCATION
            | command::DO_SET_ROI_NONE => self.handle_gimbal_command(now, sender.id, command, around),
            command::REQUEST_MESSAGE => self.request_message(now, sender, command),
            command::SET_MESSAGE_INTERVAL => self.set_message_interval(now, sender, command),
            command::GET_MESSAGE_INTERVAL => Ok(self.get_message_interval(sender, command)),
            _ if command.is_directed() && !around.overheard => {
                Err(Refusal { result: CommandResult::Unsupported, reason: "unsupported_command" })
            }
            _ => Ok(Outcome::Ignored),
        };
        let result = match outcome {
            Ok(Outcome::Accepted) => CommandResult::Accepted,
            Ok(Outcome::Ignored) => return,
            Err(refusal) => {
                self.count_refusal(sender.id, refusal.reason);
                refusal.result
            }
        };
        if around.overheard {
            return;
        }
        // The answer comes before what was asked for.
        let message = Box::new(messages::ack(sender.id, command.number, result));
        self.outputs.insert(first_answer, ManagerOutput::Reply { to: sender.id, channel: sender.channel, message });
    }

    /// A command about the gimbal itself; all but CONFIGURE pass the gate.
    fn handle_gimbal_command(
        &mut self,
        now: Timestamp,
        sender: MavId,
        command: &Command,
        around: Surroundings<'_>,
    ) -> Result<Outcome, Refusal> {
        let id_parameter = match command.number {
            command::DO_SET_ROI_LOCATION | command::DO_SET_ROI_NONE => 1,
            _ => 7,
        };
        if !self.concerns_us(command.gimbal(id_parameter)?, command)? {
            return Ok(Outcome::Ignored);
        }
        if command.number == command::DO_GIMBAL_MANAGER_CONFIGURE {
            self.do_gimbal_manager_configure(now, sender, command, around)?;
            return Ok(Outcome::Accepted);
        }
        self.gate(now, sender, around)?;
        match command.number {
            command::DO_GIMBAL_MANAGER_PITCHYAW => self.handle_demand(now, sender, &command.pitchyaw()?, around)?,
            command::DO_SET_ROI_LOCATION => self.do_set_roi_location(now, sender, command, around)?,
            _ => self.do_set_roi_none(now, sender)?,
        }
        Ok(Outcome::Accepted)
    }

    /// Whether a command for device `gimbal` concerns this one: an id that nobody here has is refused to whoever asked
    /// exactly us, and somebody else's business when everybody was asked.
    fn concerns_us(&self, gimbal: u8, command: &Command) -> Result<bool, Refusal> {
        match gimbal {
            0 => Ok(true),
            id if Some(id) == self.device_id() => Ok(true),
            _ if command.is_directed() => Err(Refusal::denied("unknown_gimbal")),
            _ => Ok(false),
        }
    }

    fn do_gimbal_manager_configure(
        &mut self,
        now: Timestamp,
        sender: MavId,
        command: &Command,
        around: Surroundings<'_>,
    ) -> Result<(), Refusal> {
        if around.other_vehicle {
            return Err(Refusal::denied("other_vehicle"));
        }
        let configure = Configure::read(command)?;
        let policy = self.policy(around);
        let changes = self.control.configure(now, sender, configure, policy)?;
        self.after_changes_of_control(now, &changes);
        Ok(())
    }

    fn do_set_roi_location(
        &mut self,
        now: Timestamp,
        sender: MavId,
        command: &Command,
        around: Surroundings<'_>,
    ) -> Result<(), Refusal> {
        let Some(place) = self.roi_place(now, command, around)? else {
            return self.do_set_roi_none(now, sender);
        };
        let capabilities = *self.steerable()?;
        let situation = self.situation(now, &capabilities, around);
        self.tracking.point_at(now, sender, place, &situation)
    }

    fn do_set_roi_none(&mut self, now: Timestamp, sender: MavId) -> Result<(), Refusal> {
        let capabilities = *self.steerable()?;
        self.tracking.end_roi(now, sender, &capabilities);
        Ok(())
    }

    /// The place to look at, `None` for 0, 0, 0, which by tradition ends it.
    fn roi_place(
        &self,
        now: Timestamp,
        command: &Command,
        around: Surroundings<'_>,
    ) -> Result<Option<Position>, Refusal> {
        let missing = Refusal::denied("no_such_place");
        let altitude = f64::from(command.finite(7)?.ok_or(missing)?);
        let (latitude, longitude, relative) = match command.form {
            Form::Int { x: i32::MAX, .. } | Form::Int { y: i32::MAX, .. } => return Err(missing),
            Form::Int { frame, x, y } => {
                let relative = match frame {
                    mav_frame::GLOBAL | mav_frame::GLOBAL_INT => false,
                    mav_frame::GLOBAL_RELATIVE_ALT | mav_frame::GLOBAL_RELATIVE_ALT_INT => true,
                    _ => {
                        let result = CommandResult::UnsupportedMavFrame;
                        return Err(Refusal { result, reason: "unsupported_frame" });
                    }
                };
                (f64::from(x) / 1e7, f64::from(y) / 1e7, relative)
            }
            Form::Long => {
                let degrees = |number| command.finite(number)?.map(f64::from).ok_or(missing);
                let relative = match self.rules.roi_altitude {
                    AltitudeReference::Amsl => false,
                    AltitudeReference::Relative => true,
                    // The frame is not stated; each family takes it for its own.
                    AltitudeReference::Auto => around.vehicle.autopilot() == Some(Autopilot::ArduPilot),
                };
                (degrees(5)?, degrees(6)?, relative)
            }
        };
        if (latitude, longitude, altitude) == (0.0, 0.0, 0.0) {
            return Ok(None);
        }
        if latitude.abs() > 90.0 || longitude.abs() > 180.0 {
            return Err(missing);
        }
        let datum = if relative {
            around.vehicle.home_altitude_amsl(now).ok_or(Refusal::later("no_home_altitude"))?
        } else {
            0.0
        };
        Ok(Some(Position { latitude_deg: latitude, longitude_deg: longitude, altitude_m: altitude + datum }))
    }

    fn request_message(&mut self, now: Timestamp, sender: Sender, command: &Command) -> Result<Outcome, Refusal> {
        let not_yet = Refusal::later("no_gimbal_yet");
        let message = match message_id(command, 1) {
            Some(message::GIMBAL_MANAGER_INFORMATION) => self.information(now).ok_or(not_yet)?,
            Some(message::GIMBAL_MANAGER_STATUS) => self.status_message(now).ok_or(not_yet)?,
            Some(message::COMPONENT_INFORMATION_BASIC) => Box::new(messages::component_information_basic(now)),
            Some(message::MESSAGE_INTERVAL) => {
                let id = message_id(command, 2).unwrap_or(u32::MAX);
                Box::new(self.message_interval(sender, id))
            }
            Some(message::HEARTBEAT) if command.is_directed() => {
                self.outputs.push_back(ManagerOutput::Heartbeat { channel: sender.channel });
                return Ok(Outcome::Accepted);
            }
            _ if command.is_directed() => return Err(Refusal::denied("unknown_message")),
            _ => return Ok(Outcome::Ignored),
        };
        self.outputs.push_back(ManagerOutput::Answer { channel: sender.channel, message });
        Ok(Outcome::Accepted)
    }

    fn set_message_interval(&mut self, now: Timestamp, sender: Sender, command: &Command) -> Result<Outcome, Refusal> {
        let micros = command.param(2).unwrap_or(0.0);
        let schedule = match message_id(command, 1) {
            Some(message::GIMBAL_MANAGER_STATUS) => &mut self.status_schedule,
            Some(message::GIMBAL_MANAGER_INFORMATION) => &mut self.information_schedule,
            _ if command.is_directed() => return Err(Refusal::denied("unknown_message")),
            _ => return Ok(Outcome::Ignored),
        };
        let set = schedule.set(now, sender.channel, micros);
        set.map_err(|_| Refusal::denied("invalid_interval"))?;
        Ok(Outcome::Accepted)
    }

    fn get_message_interval(&mut self, sender: Sender, command: &Command) -> Outcome {
        let id = message_id(command, 1).unwrap_or(u32::MAX);
        let interval = self.message_interval(sender, id);
        if !command.is_directed() && interval == messages::message_interval(id, Interval::NotAvailable) {
            return Outcome::Ignored;
        }
        self.outputs.push_back(ManagerOutput::Answer { channel: sender.channel, message: Box::new(interval) });
        Outcome::Accepted
    }

    fn message_interval(&self, sender: Sender, message_id: u32) -> MavMessage {
        let interval = match message_id {
            message::HEARTBEAT => Interval::Every(std::time::Duration::from_secs(1)),
            message::GIMBAL_MANAGER_STATUS => self.status_schedule.interval(sender.channel),
            message::GIMBAL_MANAGER_INFORMATION => self.information_schedule.interval(sender.channel),
            _ => Interval::NotAvailable,
        };
        messages::message_interval(message_id, interval)
    }
}

/// A parameter that is a message id; `None` where it can be none.
fn message_id(command: &Command, number: usize) -> Option<u32> {
    let id = command.param(number)?;
    (id.fract() == 0.0 && (0.0..16_777_216.0).contains(&id)).then_some(id as u32)
}
