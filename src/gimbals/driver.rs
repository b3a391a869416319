//! The one trait behind which every gimbal family stands.

use super::details::GimbalDetails;
use super::operation::{Operation, OperationId, OperationResult};
use super::parameters::Parameters;
use super::report::Report;
use super::setpoint::{Setpoint, Turning};
use super::settings::Family;
use crate::geometry::Angle;
use crate::timestamp::Timestamp;
use crate::wire::dialect::{COMMAND_LONG_DATA, MavMessage};
use crate::wire::{Frame, MavId};

/// The conversation with one gimbal.
///
/// One call of a `handle_*`, then [`poll_output`](Self::poll_output) until it is `None`.
pub trait GimbalDriver: std::fmt::Debug {
    /// What the gimbal speaks, as far as that is known.
    fn family(&self) -> Family;

    /// The component this driver is to talk to.
    fn adopt(&mut self, now: Timestamp, device: MavId);

    /// A frame that the device sent, but for what it answers to others.
    fn handle_received(&mut self, now: Timestamp, frame: &Frame<'_>);

    /// Where the vehicle's nose points, where that is known, from North; told before each frame.
    fn handle_vehicle_heading(&mut self, _heading: Option<Angle>) {}

    /// The link to the device is gone, and the device with it.
    fn handle_link_lost(&mut self);

    /// An order, in a yaw frame that the device accepts.
    fn handle_setpoint(&mut self, now: Timestamp, setpoint: Setpoint);

    /// What became of a command that the driver gave out ([`DriverOutput::Command`]).
    fn handle_command_outcome(&mut self, now: Timestamp, command: &COMMAND_LONG_DATA, outcome: CommandOutcome);

    /// What somebody who may asks of it; each is answered by exactly one [`DriverOutput::Operated`], at once or when the
    /// gimbal has done it or given no answer.
    fn handle_operation(&mut self, now: Timestamp, id: OperationId, operation: Operation);

    fn handle_timeout(&mut self, now: Timestamp);

    /// It was told to turn, and that it has stopped is not known, whatever it has been told since; until then the stop is
    /// to be repeated. `false` where a family has no rotation that outlives what replaces it.
    fn may_be_turning(&self) -> bool {
        false
    }

    /// What stops it, said at once, also where it has been plugged in besides; nothing where a family has no rotation that
    /// outlives what replaces it.
    fn words_that_stop(&self, _turning: Turning) -> Vec<MavMessage> {
        Vec::new()
    }

    /// Whether what it measures leans on the autopilot's attitude, so that it wants that often.
    fn leans_on_attitude(&self) -> bool {
        false
    }

    /// The family whose words stop it where those of a v2 device do not, by the configuration or as it was found out: the
    /// next run stops in these words what this one could not, also where its configuration does not name it.
    fn stops_as(&self) -> Option<Family> {
        None
    }

    /// An earlier run left it turning, and knew that `family`'s words stop it.
    fn stop_as(&mut self, _family: Family) {}

    /// Gives its parameters away, with what is under way, to another driver of the same gimbal; `None` where the family has a
    /// list of its own.
    fn hand_over_parameters(&mut self) -> Option<Parameters> {
        None
    }

    /// Goes on with the parameters of the driver before it, where its family has no list of its own.
    fn take_over_parameters(&mut self, _parameters: Parameters) {}

    fn poll_output(&mut self) -> Option<DriverOutput>;

    fn poll_timeout(&self) -> Option<Timestamp>;

    /// What only its family knows of it; asked when somebody looks.
    fn details(&self, now: Timestamp) -> GimbalDetails;
}

/// What a driver wants done.
#[derive(Clone, Debug, PartialEq)]
pub enum DriverOutput {
    /// To be sent in the manager's name, on the device's link only.
    Message(Box<MavMessage>),
    /// The same for a command to one component, which is sent again until it is answered.
    Command(Box<COMMAND_LONG_DATA>),
    Report(Report),
    /// What became of an operation.
    Operated {
        id: OperationId,
        result: OperationResult,
    },
}

/// What became of a command of ours.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CommandOutcome {
    /// `MAV_RESULT`, known to us or not.
    Answered(u8),
    /// It was sent as often as a command is sent.
    Unanswered,
    /// It was given no time to answer: the system id to which it would has changed.
    GivenUp,
}
