//! Commands of a gimbal family's own that reach its manager over MAVLink: `MAV_CMD_USER_1` (31010, motors),
//! `MAV_CMD_USER_2` (31011, modes and resets), and `PREFLIGHT_REBOOT_SHUTDOWN` (246) that names the gimbal.
//!
//! They pass the same gate as everything else, and mean what the gimbal's maker has given them. Where a gimbal has no such
//! functions they are refused as commands that nobody knows.

use super::asked::{Asked, NotDone};
use super::commands::{Outcome, unsupported};
use super::control::Voice;
use super::request::{Command, Form, Refusal};
use super::{GimbalManager, ManagerOutput, Sender, Surroundings, messages};
use crate::channel::ChannelId;
use crate::geometry::YawFrame;
use crate::gimbals::operation::{Motors, Operation, OperationError, OperationId, ResetMode, Restart};
use crate::gimbals::settings::Family;
use crate::timestamp::Timestamp;
use crate::wire::MavId;
use crate::wire::ids::{CommandResult, command};

/// Ids of these are told from those of requests over HTTP by their highest bit.
const OF_COMMANDS: u64 = 1 << 63;

/// A command whose answer comes when the gimbal has done it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Commander {
    pub id: MavId,
    pub channel: ChannelId,
    pub number: u16,
}

/// What a command asks for.
enum Meaning {
    Operation(Operation),
    /// Stay, and keep yaw to that.
    Hold(YawFrame),
}

impl GimbalManager {
    pub(super) fn vendor_command(
        &mut self,
        now: Timestamp,
        sender: Sender,
        command: &Command,
        around: Surroundings<'_>,
    ) -> Result<Outcome, Refusal> {
        if !self.may_operate() {
            return Err(unsupported(command.number));
        }
        let meaning = self.read_vendor_command(command)?;
        // Who asks a gimbal that is not known yet may ask again.
        if !self.is_known() {
            self.steerable()?;
        }
        let operation = match meaning {
            Meaning::Operation(operation) => operation,
            Meaning::Hold(frame) => {
                let voice = self.gate(now, sender.id, around)?;
                self.stay(now, sender.id, voice, Some(frame), around)?;
                return Ok(Outcome::Accepted);
            }
        };
        // Sent anew because its answer did not come yet.
        if command.confirmation > 0 && self.commanded.contains(&(sender.id, command.number)) {
            return Ok(Outcome::InProgress);
        }
        self.gate(now, sender.id, around).and_then(Voice::needs_whole)?;
        let id = OperationId(OF_COMMANDS | self.next_command);
        self.next_command += 1;
        let asked = Asked::Operation(operation.clone());
        // It is registered before the gimbal can have done it.
        let before = self.outputs.len();
        self.do_operation(now, sender.id, id, &asked, &operation, around).map_err(refusal)?;
        let commander = Commander { id: sender.id, channel: sender.channel, number: command.number };
        self.outputs.insert(before, ManagerOutput::Commanded { id, commander });
        self.commanded.push((sender.id, command.number));
        Ok(Outcome::InProgress)
    }

    /// Whether it has functions of its maker's own, or may turn out to have them.
    fn may_operate(&self) -> bool {
        match (self.capabilities, self.settings.family) {
            (Some(capabilities), _) => capabilities.operates,
            (None, Family::Gremsy | Family::Auto) => true,
            (None, Family::MavlinkV1 | Family::MavlinkV2) => false,
        }
    }

    fn read_vendor_command(&self, command: &Command) -> Result<Meaning, Refusal> {
        let number = |at: usize| match (command.form, at) {
            (Form::Int { x, .. }, 5) => f64::from(x),
            (Form::Int { y, .. }, 6) => f64::from(y),
            _ => command.param(at).map_or(0.0, f64::from),
        };
        let is = |at: usize, wanted: u8| number(at) == f64::from(wanted);
        let operation = match command.number {
            command::USER_1 if is(7, 1) => Operation::Motors(Motors::On),
            command::USER_1 if is(7, 0) && command.param(7).is_some() => Operation::Motors(Motors::Off),
            command::USER_2 if is(7, 1) => return Ok(Meaning::Hold(YawFrame::Earth)),
            command::USER_2 if is(7, 2) => return Ok(Meaning::Hold(YawFrame::Vehicle)),
            command::USER_2 if is(7, 4) && is(6, 1) => Operation::Reset(ResetMode::Yaw),
            command::USER_2 if is(7, 4) && is(6, 3) => Operation::Reset(ResetMode::PitchAndYaw),
            command::USER_2 if is(7, 4) && is(6, 11) => Operation::Reset(ResetMode::PitchDownUpAndYaw),
            command::USER_2 if is(7, 4) && is(6, 12) => Operation::Reset(ResetMode::PitchDownUp),
            command::USER_2 if is(7, 4) && is(6, 13) => Operation::Mapping,
            command::PREFLIGHT_REBOOT_SHUTDOWN => {
                // Only one that names the gimbal: others mean the autopilot, or the companion computer.
                let names_it = self.device.is_some_and(|device| is(4, device.component));
                match (is(3, 1), is(3, 2)) {
                    (true, _) if names_it => Operation::Restart(Restart::Reboot),
                    (_, true) if names_it => Operation::Restart(Restart::Shutdown),
                    _ => return Err(unsupported(command.number)),
                }
            }
            _ => return Err(Refusal::denied("no_such_mode")),
        };
        Ok(Meaning::Operation(operation))
    }

    /// What became of a command: its one last answer.
    pub fn handle_commanded(&mut self, commander: Commander, answer: &Result<(), NotDone>) {
        let Commander { id, channel, number } = commander;
        if let Some(at) = self.commanded.iter().position(|known| *known == (id, number)) {
            self.commanded.swap_remove(at);
        }
        let message = Box::new(messages::ack(id, number, result_of(answer)));
        self.outputs.push_back(ManagerOutput::Reply { to: id, channel, message });
    }
}

fn refusal(not_done: NotDone) -> Refusal {
    match not_done {
        NotDone::Refused { refusal, .. } => refusal,
        not_done => {
            let result = result_of(&Err(not_done));
            Refusal { result, reason: "gimbal_not_there" }
        }
    }
}

fn result_of(answer: &Result<(), NotDone>) -> CommandResult {
    match answer {
        Ok(()) => CommandResult::Accepted,
        Err(NotDone::Refused { refusal, .. }) => refusal.result,
        Err(NotDone::TooMuch | NotDone::Starting) => CommandResult::TemporarilyRejected,
        Err(NotDone::UnknownGimbal | NotDone::Ending) => CommandResult::Failed,
        Err(NotDone::Operation(error)) => match error {
            OperationError::Unsupported | OperationError::NotConfigured(_) | OperationError::UnsupportedByDevice => {
                CommandResult::Unsupported
            }
            OperationError::Invalid(_) | OperationError::Denied => CommandResult::Denied,
            OperationError::NotReady
            | OperationError::Busy
            | OperationError::Rejected
            | OperationError::StillTurning => CommandResult::TemporarilyRejected,
            OperationError::NotThere
            | OperationError::Failed
            | OperationError::NoAnswer
            | OperationError::NoParameters
            | OperationError::NoEffect(_) => CommandResult::Failed,
        },
    }
}
