//! Values that are to be set, one at a time, until the gimbal tells them back.

use std::collections::VecDeque;
use std::time::Duration;

use crate::gimbals::operation::{OperationError, OperationId};

/// A value should be told back within this time …
pub const PATIENCE: Duration = Duration::from_millis(300);
/// … or it is set again, so often in all.
const TRIES: u8 = 5;
/// Another value told back so often means that the gimbal does not take it; the first may have been somebody else's
/// answer that was on its way.
const OTHER_VALUES: u8 = 2;

/// So many values wait at most.
const CAPACITY: usize = 64;

/// What is next.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Step {
    /// For the echo, or, where that did not come, to set it again.
    Wait,
    /// The next one; who asked for the last is told if that was all.
    Next(Option<(OperationId, Result<(), OperationError>)>),
}

#[derive(Debug, Default)]
pub struct Changes {
    waiting: VecDeque<Change>,
    sent: Option<Sent>,
}

#[derive(Clone, Debug)]
struct Change {
    id: OperationId,
    name: String,
    value: f64,
    /// Whoever asked is told after it.
    is_last: bool,
}

#[derive(Debug)]
struct Sent {
    change: Change,
    tries: u8,
    /// The value told back last, where it was another one …
    other: Option<f64>,
    /// … and after how many tries one was.
    others: u8,
}

impl Changes {
    pub fn has_room_for(&self, count: usize) -> bool {
        self.waiting.len() + count <= CAPACITY
    }

    pub fn push(&mut self, id: OperationId, values: &[(&str, f64)]) {
        for (at, (name, value)) in values.iter().enumerate() {
            let is_last = at + 1 == values.len();
            self.waiting.push_back(Change { id, name: (*name).to_owned(), value: *value, is_last });
        }
    }

    /// Takes the next one up; false where one is under way, or none is left.
    pub fn begin(&mut self) -> bool {
        if self.sent.is_some() {
            return false;
        }
        self.sent = self.waiting.pop_front().map(|change| Sent { change, tries: 1, other: None, others: 0 });
        self.sent.is_some()
    }

    /// The name of the one to be taken up next; `None` while one is under way.
    pub fn next_name(&self) -> Option<&str> {
        self.waiting.front().filter(|_| self.sent.is_none()).map(|change| change.name.as_str())
    }

    /// Name and value of the one under way.
    pub fn current(&self) -> Option<(&str, f64)> {
        self.sent.as_ref().map(|sent| (sent.change.name.as_str(), sent.change.value))
    }

    /// The gimbal told a value for the one under way.
    pub fn handle_echo(&mut self, is_so: bool, value: f64) -> Step {
        let Some(sent) = &mut self.sent else { return Step::Wait };
        if is_so {
            return self.finish(Ok(()));
        }
        sent.other = Some(value);
        Step::Wait
    }

    /// What was done so far for the one under way was not yet to set it.
    pub fn start_over(&mut self) {
        if let Some(sent) = &mut self.sent {
            *sent = Sent { change: sent.change.clone(), tries: 1, other: None, others: 0 };
        }
    }

    /// The one under way cannot be set.
    pub fn fail(&mut self, error: OperationError) -> Step {
        self.finish(Err(error))
    }

    /// It has told nothing that ends the one under way for so long.
    pub fn handle_silence(&mut self) -> Step {
        let Some(sent) = &mut self.sent else { return Step::Next(None) };
        if let Some(value) = sent.other.take() {
            sent.others += 1;
            if sent.others >= OTHER_VALUES {
                let text = format!("{} is {value}", sent.change.name);
                return self.finish(Err(OperationError::NoEffect(text)));
            }
        }
        if sent.tries >= TRIES {
            return self.finish(Err(OperationError::NoAnswer));
        }
        sent.tries += 1;
        Step::Wait
    }

    /// Drops all of them; whose they were.
    pub fn clear(&mut self) -> Vec<OperationId> {
        let sent = self.sent.take().map(|sent| sent.change);
        let mut ids: Vec<OperationId> =
            sent.into_iter().chain(self.waiting.drain(..)).map(|change| change.id).collect();
        ids.dedup();
        ids
    }

    fn finish(&mut self, result: Result<(), OperationError>) -> Step {
        let Some(Sent { change, .. }) = self.sent.take() else { return Step::Next(None) };
        if result.is_err() {
            self.waiting.retain(|waiting| waiting.id != change.id);
        }
        let is_over = change.is_last || result.is_err();
        Step::Next(is_over.then_some((change.id, result)))
    }
}
