//! What others ask of a gimbal manager, read once: NaN, −1 and 0 as "not set" end here.

mod command;
mod configure;
mod demand;
mod setpoint_messages;

pub use self::command::{Command, Form};
pub use self::configure::{Claim, Configure};
pub use self::demand::{AxisDemand, Demand, DemandKind};
pub use self::setpoint_messages::device_set_attitude;

use self::setpoint_messages::{set_attitude, set_manual_control, set_pitchyaw};
use crate::wire::dialect::{MOUNT_CONFIGURE_DATA, MOUNT_CONTROL_DATA};
use crate::wire::ids::{CommandResult, message};
use crate::wire::{Frame, Target};

/// Something asked of a manager.
#[derive(Clone, Debug, PartialEq)]
pub enum Request {
    /// A demand on the gimbal by message: no answer is due.
    Demand {
        target: Target,
        gimbal: u8,
        demand: Demand,
    },
    Command(Command),
    /// A v1 message to a mount: no answer is due.
    Mount {
        target: Target,
        message: MountMessage,
    },
}

/// `MOUNT_CONFIGURE` (156) or `MOUNT_CONTROL` (157).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MountMessage {
    /// A `MAV_MOUNT_MODE`.
    Configure { mode: u8 },
    /// Pitch, roll and yaw in hundredths of a degree; or latitude and longitude in units of 1e-7 degrees and the altitude
    /// above home in centimetres, as the mode has it.
    Control { inputs: [i32; 3] },
}

/// Why a request is not done.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Refusal {
    pub result: CommandResult,
    /// A word for the counters and the person looking.
    pub reason: &'static str,
}

impl Refusal {
    pub const fn denied(reason: &'static str) -> Self {
        Self { result: CommandResult::Denied, reason }
    }

    pub const fn later(reason: &'static str) -> Self {
        Self { result: CommandResult::TemporarilyRejected, reason }
    }
}

/// Reads a message that a manager has to do with: `None` for any other, an error for one that is malformed.
pub fn read_request(frame: &Frame<'_>) -> Option<Result<Request, Refusal>> {
    let request = match frame.message_id() {
        message::COMMAND_LONG => frame.decode().map(|message| Ok(Request::Command(Command::long(frame, &message)))),
        message::COMMAND_INT => frame.decode().map(|message| Ok(Request::Command(Command::int(frame, &message)))),
        message::GIMBAL_MANAGER_SET_ATTITUDE => frame.decode().map(|message| set_attitude(frame.target(), &message)),
        message::GIMBAL_MANAGER_SET_PITCHYAW => frame.decode().map(|message| set_pitchyaw(frame.target(), &message)),
        message::GIMBAL_MANAGER_SET_MANUAL_CONTROL => {
            frame.decode().map(|message| set_manual_control(frame.target(), &message))
        }
        message::MOUNT_CONFIGURE => frame.decode::<MOUNT_CONFIGURE_DATA>().map(|message| {
            let message = MountMessage::Configure { mode: message.mount_mode };
            Ok(Request::Mount { target: frame.target(), message })
        }),
        message::MOUNT_CONTROL => frame.decode::<MOUNT_CONTROL_DATA>().map(|message| {
            let message = MountMessage::Control { inputs: [message.input_a, message.input_b, message.input_c] };
            Ok(Request::Mount { target: frame.target(), message })
        }),
        _ => None,
    };
    request.map(|request| {
        request.and_then(|request| match request {
            Request::Demand { demand, .. } => demand.check().map(|()| request),
            Request::Command(_) | Request::Mount { .. } => Ok(request),
        })
    })
}
