//! What comes out of a manager.

use super::Commander;
use super::events::Event;
use crate::channel::{ChannelId, ChannelSet};
use crate::gimbals::operation::{Operation, OperationId};
use crate::gimbals::setpoint::Setpoint;
use crate::wire::MavId;
use crate::wire::dialect::MavMessage;

/// What a manager wants done.
#[derive(Clone, Debug, PartialEq)]
pub enum ManagerOutput {
    /// To be sent to where `to` is known, or else on the channel on which it asked.
    Reply {
        to: MavId,
        channel: ChannelId,
        message: Box<MavMessage>,
    },
    /// To be sent on the channel of the one who asked.
    Answer {
        channel: ChannelId,
        message: Box<MavMessage>,
    },
    /// To be sent on these channels, or on all.
    Broadcast {
        channels: Option<ChannelSet>,
        message: Box<MavMessage>,
    },
    /// The heartbeat was asked for, on these channels or on all.
    Heartbeat {
        channels: Option<ChannelSet>,
    },
    Steer(Setpoint),
    /// The operation of that id was asked for by a command, which is answered once more when it is done.
    Commanded {
        id: OperationId,
        commander: Commander,
    },
    /// For the driver; it answers.
    Operate {
        id: OperationId,
        operation: Operation,
    },
    /// To be told back when the driver has been given the operation and what it says to that was heard.
    Given {
        id: OperationId,
    },
    /// The autopilot is to be asked for a message that it may never have sent.
    AskAutopilot {
        message_id: u32,
    },
    /// For whoever looks.
    Event(Event),
}
