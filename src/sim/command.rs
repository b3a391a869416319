//! `COMMAND_LONG` and `COMMAND_INT` as one, and the answer to them.

use crate::sim::outbox::Outbox;
use crate::wire::dialect::{COMMAND_ACK_DATA, COMMAND_INT_DATA, COMMAND_LONG_DATA};
use crate::wire::ids::{CommandResult, message};
use crate::wire::{Frame, MavId, Target};

/// A command that was received.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Command {
    pub sender: MavId,
    pub target: Target,
    /// `MAV_CMD`.
    pub number: u16,
    /// `param1` to `param7`; `COMMAND_INT` gives x, y, z in the last three.
    pub params: [f64; 7],
    /// It was a `COMMAND_INT`, whose x and y are integers.
    pub is_int: bool,
}

impl Command {
    /// The command in `frame`; `None` if there is none.
    pub fn read(frame: &Frame<'_>) -> Option<Self> {
        let is_int = frame.message_id() == message::COMMAND_INT;
        let (number, params) = match frame.message_id() {
            message::COMMAND_LONG => {
                let long: COMMAND_LONG_DATA = frame.decode()?;
                let params =
                    [long.param1, long.param2, long.param3, long.param4, long.param5, long.param6, long.param7];
                (long.command, params.map(f64::from))
            }
            message::COMMAND_INT => {
                let int: COMMAND_INT_DATA = frame.decode()?;
                let [p1, p2, p3, p4] = [int.param1, int.param2, int.param3, int.param4].map(f64::from);
                (int.command, [p1, p2, p3, p4, f64::from(int.x), f64::from(int.y), f64::from(int.z)])
            }
            _ => return None,
        };
        Some(Self { sender: frame.source(), target: frame.target(), number, params, is_int })
    }

    /// Whether the command is for one component alone, so that it must be answered.
    pub fn is_directed(&self) -> bool {
        matches!(self.target, Target::Component(_))
    }

    /// `param1` of a message request: the message id, 0 when it is none.
    pub fn message_id(&self) -> u32 {
        // A float cast saturates, and turns NaN into 0.
        self.params[0].round() as u32
    }

    pub fn acknowledge(&self, outbox: &mut Outbox, result: CommandResult) {
        outbox.send(&COMMAND_ACK_DATA {
            command: self.number,
            result: result as u8,
            progress: 0,
            result_param2: 0,
            target_system: self.sender.system,
            target_component: self.sender.component,
        });
    }
}
