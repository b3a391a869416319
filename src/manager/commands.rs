//! `COMMAND_LONG` and `COMMAND_INT` for a gimbal manager, each with its one answer.
//!
//! What a command is about is in files of its own: [`super::inquiries`] (512, 511, 510), [`super::roi`] (195, 197, 201),
//! [`super::mount`] (204, 205, 220), [`super::vendor_commands`] (31010, 31011, 246). Those that we do not know are refused
//! by name to whoever addressed exactly us, and are somebody else's business when everybody was asked.

use std::time::Duration;

use super::request::{Command, Demand, DemandKind, Refusal};
use super::{GimbalManager, ManagerOutput, Sender, Surroundings, messages};
use crate::timestamp::Timestamp;
use crate::wire::MavId;
use crate::wire::ids::{CommandResult, command};

/// A command that comes again within this time was sent anew because its answer did not come.
const REPEATED_WITHIN: Duration = Duration::from_secs(1);

/// What becomes of a command.
pub(super) enum Outcome {
    /// Done.
    Accepted,
    /// Begun; another answer comes when it is done.
    InProgress,
    /// Not for us: addressed to everybody or only overheard, and somebody else's business.
    Ignored,
}

/// The command that last changed what the gimbal does or who steers it.
#[derive(Clone, Copy, Debug)]
pub(super) struct LastCommand {
    sender: MavId,
    command: Command,
    at: Timestamp,
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
        let result = match self.execute(now, sender, command, around) {
            Ok(Outcome::Accepted) => CommandResult::Accepted,
            Ok(Outcome::InProgress) => CommandResult::InProgress,
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

    fn execute(
        &mut self,
        now: Timestamp,
        sender: Sender,
        command: &Command,
        around: Surroundings<'_>,
    ) -> Result<Outcome, Refusal> {
        match command.number {
            command::REQUEST_MESSAGE => self.request_message(now, sender, command, around),
            command::SET_MESSAGE_INTERVAL => self.set_message_interval(now, sender, command),
            command::GET_MESSAGE_INTERVAL => Ok(self.get_message_interval(sender, command)),
            command::DO_GIMBAL_MANAGER_CONFIGURE
            | command::DO_GIMBAL_MANAGER_PITCHYAW
            | command::DO_SET_ROI_LOCATION
            | command::DO_SET_ROI_NONE
            | command::DO_SET_ROI
            | command::DO_MOUNT_CONFIGURE
            | command::DO_MOUNT_CONTROL
            | command::DO_MOUNT_CONTROL_QUAT => self.handle_once(now, sender.id, command, around),
            command::USER_1 | command::USER_2 | command::PREFLIGHT_REBOOT_SHUTDOWN
                if command.is_directed() && !around.overheard =>
            {
                self.vendor_command(now, sender, command, around)
            }
            number if command.is_directed() && !around.overheard => Err(unsupported(number)),
            _ => Ok(Outcome::Ignored),
        }
    }

    /// A command about the gimbal itself. A repeat of the one that was accepted last is accepted again and not carried
    /// out again: angles stay converted with the heading of the first time, and nothing happens twice.
    fn handle_once(
        &mut self,
        now: Timestamp,
        sender: MavId,
        command: &Command,
        around: Surroundings<'_>,
    ) -> Result<Outcome, Refusal> {
        let is_repeat = self.last_command.is_some_and(|last| {
            last.sender == sender && now.since(last.at) <= REPEATED_WITHIN && command.is_repeat_of(&last.command)
        });
        if is_repeat {
            tracing::debug!(gimbal = self.settings.name, %sender, command = command.number, "repeated");
            return Ok(Outcome::Accepted);
        }
        let outcome = self.handle_gimbal_command(now, sender, command, around)?;
        if matches!(outcome, Outcome::Accepted) {
            self.last_command = Some(LastCommand { sender, command: *command, at: now });
        }
        Ok(outcome)
    }

    /// All but CONFIGURE pass the gate.
    fn handle_gimbal_command(
        &mut self,
        now: Timestamp,
        sender: MavId,
        command: &Command,
        around: Surroundings<'_>,
    ) -> Result<Outcome, Refusal> {
        if !self.concerns_us(sender, command, around)? {
            return Ok(Outcome::Ignored);
        }
        if command.number == command::DO_GIMBAL_MANAGER_CONFIGURE {
            self.do_gimbal_manager_configure(now, sender, command, around)?;
            return Ok(Outcome::Accepted);
        }
        let voice = self.gate(now, sender, around)?;
        match command.number {
            command::DO_GIMBAL_MANAGER_PITCHYAW => {
                let kind = self.kind_of(now, sender, command);
                self.handle_demand(now, sender, &Demand { kind, ..command.pitchyaw()? }, around)?;
            }
            command::DO_MOUNT_CONFIGURE => self.do_mount_configure(now, sender, command, around)?,
            command::DO_MOUNT_CONTROL => self.do_mount_control(now, sender, command, around)?,
            command::DO_MOUNT_CONTROL_QUAT => self.do_mount_control_quat(now, sender, command, around)?,
            // Places are the primary's, or nobody's.
            _ => {
                voice.needs_whole()?;
                return self.handle_roi_command(now, sender, command, around);
            }
        }
        Ok(Outcome::Accepted)
    }

    fn handle_roi_command(
        &mut self,
        now: Timestamp,
        sender: MavId,
        command: &Command,
        around: Surroundings<'_>,
    ) -> Result<Outcome, Refusal> {
        match command.number {
            command::DO_SET_ROI_LOCATION => self.do_set_roi_location(now, sender, command, around)?,
            command::DO_SET_ROI_NONE => self.do_set_roi_none(now, sender)?,
            _ => return self.do_set_roi(now, sender, command, around),
        }
        Ok(Outcome::Accepted)
    }

    /// A rate that its sender says again before a streamed one would have ended is a stream, and ends like one: up to its
    /// releases of early 2026 QGroundControl turns a gimbal by commands every 500 ms, and may fail to send the last, zero.
    pub(super) fn kind_of(&self, now: Timestamp, sender: MavId, command: &Command) -> DemandKind {
        let again = self.last_command.is_some_and(|last| {
            last.sender == sender
                && now.since(last.at) <= self.rules.rate_timeout
                && command.is_meant_again_after(&last.command)
        });
        if again { DemandKind::Streamed } else { DemandKind::Commanded }
    }

    /// Whether a command is for this gimbal: an id that nobody here has is refused to whoever asked exactly us, and
    /// somebody else's business when everybody was asked or the autopilot was.
    pub(super) fn concerns_us(
        &self,
        sender: MavId,
        command: &Command,
        around: Surroundings<'_>,
    ) -> Result<bool, Refusal> {
        let exactly_us = command.is_directed() && !around.overheard;
        if around.other_vehicle && !exactly_us {
            return Ok(false);
        }
        // What an autopilot says to every mount is how it drives one, and no wish of a client.
        let to_mounts = matches!(
            command.number,
            command::DO_MOUNT_CONFIGURE | command::DO_MOUNT_CONTROL | command::DO_MOUNT_CONTROL_QUAT
        );
        if to_mounts && !exactly_us && around.autopilot == Some(sender) {
            return Ok(false);
        }
        let id = match command.number {
            command::DO_SET_ROI_LOCATION | command::DO_SET_ROI_NONE => command.gimbal(1),
            command::DO_GIMBAL_MANAGER_PITCHYAW | command::DO_GIMBAL_MANAGER_CONFIGURE => command.gimbal(7),
            // The commands of gimbal protocol v1 know of no ids.
            _ => Ok(0),
        };
        // The autopilot may have a gimbal of its own: who names none there means that one (QGroundControl 4.4.0 names).
        let needs_id = matches!(
            command.number,
            command::DO_GIMBAL_MANAGER_PITCHYAW | command::DO_GIMBAL_MANAGER_CONFIGURE if around.overheard
        );
        match id {
            Ok(0) => Ok(!needs_id),
            Ok(id) if Some(id) == self.device_id() => Ok(true),
            _ if !exactly_us => Ok(false),
            Ok(_) if self.device.is_none() => Err(Refusal::later("no_gimbal_yet")),
            Ok(_) => Err(Refusal::denied("unknown_gimbal")),
            Err(refusal) => Err(refusal),
        }
    }
}

/// The refusal of a command that we do not carry out; a person looking reads which one it was.
pub(super) fn unsupported(number: u16) -> Refusal {
    let reason = match number {
        command::DO_SET_ROI_WPNEXT_OFFSET => "do_set_roi_wpnext_offset_unsupported",
        command::DO_SET_ROI_SYSID => "do_set_roi_sysid_unsupported",
        command::DO_SET_ROI => "do_set_roi_unsupported",
        // Known, and done only for a gimbal that it names.
        command::PREFLIGHT_REBOOT_SHUTDOWN => return Refusal::denied("preflight_reboot_shutdown_denied"),
        command::DO_GIMBAL_MANAGER_TRACK_RECTANGLE => "do_gimbal_manager_track_rectangle_unsupported",
        command::REQUEST_OPERATOR_CONTROL => "request_operator_control_unsupported",
        command::GIMBAL_RESET => "gimbal_reset_unsupported",
        _ => "unsupported_command",
    };
    Refusal { result: CommandResult::Unsupported, reason }
}
