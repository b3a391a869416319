//! What was given on to the gimbal, as far as the events tell of it.
//!
//! That it was asked for is told when the gimbal has been given it, and that it was not done when that is known. What is
//! refused before it reaches the gimbal is told to nobody but the one who asked.

use super::asked::{Answer, NotDone};
use super::events::Event;
use super::{GimbalManager, ManagerOutput};
use crate::gimbals::operation::{Operation, OperationId};
use crate::wire::MavId;

/// An operation that is under way. Whoever gives it on answers each exactly once, so there are as many as he has under way.
#[derive(Clone, Debug)]
pub(super) struct Given {
    id: OperationId,
    who: MavId,
    operation: Operation,
    is_told: bool,
}

impl GimbalManager {
    pub(super) fn give(&mut self, who: MavId, id: OperationId, operation: &Operation) {
        let is_told_of = operation.needs_control();
        self.outputs.push_back(ManagerOutput::Operate { id, operation: operation.clone() });
        if is_told_of {
            self.given.push(Given { id, who, operation: operation.clone(), is_told: false });
            self.outputs.push_back(ManagerOutput::Given { id });
        }
    }

    /// The driver has been given it. What it has refused at once is known by then.
    pub fn handle_given(&mut self, id: OperationId) {
        let Some(given) = self.given.iter_mut().find(|given| given.id == id) else { return };
        given.is_told = true;
        let event = operated(given);
        self.tell(event);
    }

    /// What became of it.
    pub(super) fn tell_outcome(&mut self, id: OperationId, answer: &Answer) {
        let Some(at) = self.given.iter().position(|given| given.id == id) else { return };
        let given = self.given.swap_remove(at);
        match answer {
            Ok(()) if !given.is_told => self.tell(operated(&given)),
            Err(NotDone::Operation(error)) if given.is_told => {
                self.tell(Event::NotOperated { who: given.who, operation: given.operation, error: error.clone() });
            }
            _ => {}
        }
    }
}

fn operated(given: &Given) -> Event {
    Event::Operated { who: given.who, operation: given.operation.clone(), before: None }
}
