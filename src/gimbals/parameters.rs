//! A gimbal's parameters, for any driver: read, kept up to date, and set, each with retry.
//!
//! The list is asked for; when nothing has come for a second, what is missing is read one by one, up to five times each,
//! and what then has not come does not exist. A value is set until the gimbal tells it back. What the gimbal tells
//! others counts as well: a ground station that reads or sets parameters at the same time is not disturbed, and what it
//! changes is known here.

mod change;
mod encoding;

use std::collections::{BTreeMap, VecDeque};
use std::time::Duration;

use super::operation::{OperationError, OperationId};
use crate::timers::TimerTable;
use crate::timestamp::Timestamp;
use crate::wire::dialect::{
    CharArray, MavMessage, PARAM_REQUEST_LIST_DATA, PARAM_REQUEST_READ_DATA, PARAM_SET_DATA, PARAM_VALUE_DATA,
};
use crate::wire::{Frame, MavId};
use change::{Changes, Step};
pub use encoding::Encoding;

/// A list is over when nothing has come for so long.
const QUIET: Duration = Duration::from_secs(1);
/// It is asked for so often when nothing comes at all.
const LIST_TRIES: u8 = 3;
/// Somebody else who reads all the time does not keep us from going on for longer than this.
const LONGEST_WAIT: Duration = Duration::from_secs(20);
/// Nor is the silence after the last one waited for longer than this.
const LONGEST_SETTLING: Duration = Duration::from_secs(2);

/// Two parameters are read at least so far apart …
const READ_SPACING: Duration = Duration::from_millis(10);
/// … what others asked for delays one by no more than this …
const READ_DELAY: Duration = Duration::from_millis(100);
/// … the next round begins so long after the one before …
const ROUND_PAUSE: Duration = Duration::from_millis(500);
/// … and one that was read so often in vain does not exist.
const READ_TRIES: u8 = 5;
/// Where nothing was answered by its name so often, it is read by its index.
const TRIES_BY_NAME: u8 = 2;

/// More names than any gimbal has are not kept.
const MAX_NAMES: usize = 512;

/// So many wait for a refresh at most.
const MAX_WAITING: usize = 8;

/// A parameter that a device should have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Known {
    pub name: &'static str,
    /// Its place in the vendor's tables, where that is known.
    pub index: Option<u16>,
}

/// Which parameters a device should have, given those that it was heard to have.
pub type Catalogue = fn(&dyn Fn(&str) -> bool) -> Vec<Known>;

/// What is to be done, or has happened.
#[derive(Clone, Debug, PartialEq)]
pub enum ParameterOutput {
    Send(Box<MavMessage>),
    /// Everything that exists was read.
    Settled,
    /// What became of a request: of [`Parameters::set`] or [`Parameters::refresh_for`].
    Done {
        id: OperationId,
        result: Result<(), OperationError>,
    },
}

/// One gimbal's parameters.
#[derive(Debug)]
pub struct Parameters {
    encoding: Encoding,
    catalogue: Catalogue,
    device: Option<MavId>,
    values: BTreeMap<String, Value>,
    phase: Phase,
    /// When the last value came.
    heard: Timestamp,
    /// How often each was read in vain.
    tries: BTreeMap<&'static str, u8>,
    /// Something that was read by its name was answered.
    answers_to_names: bool,
    changes: Changes,
    waiting: Vec<OperationId>,
    timers: TimerTable<Timer>,
    outputs: VecDeque<ParameterOutput>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Value {
    value: f64,
    /// `MAV_PARAM_TYPE`.
    kind: u8,
}

#[derive(Clone, Debug, PartialEq, Eq)]
enum Phase {
    /// Nothing was asked for.
    Idle,
    /// The list was asked for, so often since then.
    Listing {
        since: Timestamp,
        tries: u8,
        any: bool,
    },
    /// What is missing is read, one by one.
    Reading {
        queue: VecDeque<Known>,
        /// When the next one is read at the latest.
        latest: Timestamp,
    },
    /// All was read; a while of silence, and it is settled.
    Settling {
        since: Timestamp,
    },
    Settled,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Timer {
    /// When the list is over.
    Quiet,
    /// When to read the next one, or to begin the next round.
    Read,
    /// When a value that was set should have been told back.
    Change,
}

impl Parameters {
    pub fn new(encoding: Encoding, catalogue: Catalogue) -> Self {
        Self {
            encoding,
            catalogue,
            device: None,
            values: BTreeMap::new(),
            phase: Phase::Idle,
            heard: Timestamp::ZERO,
            tries: BTreeMap::new(),
            answers_to_names: false,
            changes: Changes::default(),
            waiting: Vec::new(),
            timers: TimerTable::default(),
            outputs: VecDeque::new(),
        }
    }

    /// Reads everything, of `device` from now on.
    pub fn refresh(&mut self, now: Timestamp, device: MavId) {
        if self.device != Some(device) {
            self.forget();
            self.device = Some(device);
        }
        self.tries.clear();
        self.answers_to_names = false;
        self.phase = Phase::Listing { since: now, tries: 1, any: false };
        self.timers.cancel(Timer::Read);
        self.timers.set(Timer::Quiet, now + QUIET);
        self.send_list();
    }

    /// The same for somebody who is told when it is done.
    pub fn refresh_for(&mut self, now: Timestamp, id: OperationId) {
        let Some(device) = self.device else {
            self.done(id, Err(OperationError::NotThere));
            return;
        };
        if self.waiting.len() >= MAX_WAITING {
            self.done(id, Err(OperationError::Busy));
            return;
        }
        self.waiting.push(id);
        if matches!(self.phase, Phase::Idle | Phase::Settled) {
            self.refresh(now, device);
        }
    }

    /// Sets these, one after the other; the first that fails ends it.
    pub fn set(&mut self, now: Timestamp, id: OperationId, values: &[(&str, f64)]) {
        let checked = values.iter().try_for_each(|(name, value)| {
            encoding::check_name(name).map_err(OperationError::Invalid)?;
            let kind = self.kind_of(name);
            self.encoding.encode(*value, kind).map(drop).map_err(OperationError::Invalid)
        });
        let result = match (checked, self.device) {
            (Err(error), _) => Err(error),
            (Ok(()), None) => Err(OperationError::NotThere),
            (Ok(()), Some(_)) if values.is_empty() => Ok(()),
            (Ok(()), Some(_)) if !self.changes.has_room_for(values.len()) => Err(OperationError::Busy),
            (Ok(()), Some(_)) => {
                self.changes.push(id, values);
                self.begin_change(now);
                return;
            }
        };
        self.done(id, result);
    }

    /// A frame of any kind; only a `PARAM_VALUE` of the device matters.
    pub fn handle_received(&mut self, now: Timestamp, frame: &Frame<'_>) {
        if Some(frame.source()) != self.device {
            return;
        }
        let Some(message) = frame.decode::<PARAM_VALUE_DATA>() else { return };
        let Some(name) = encoding::read_name(&message.param_id) else { return };
        let Some(value) = self.encoding.decode(message.param_value, message.param_type) else { return };
        let is_new = !self.values.contains_key(name);
        if is_new && self.values.len() >= MAX_NAMES {
            return;
        }
        self.heard = now;
        if self.tries.get(name).is_some_and(|tries| *tries <= TRIES_BY_NAME) {
            self.answers_to_names = true;
        }
        let entry = Value { value, kind: message.param_type };
        self.values.insert(name.to_owned(), entry);
        match &mut self.phase {
            Phase::Listing { since, any, .. } => {
                *any = true;
                self.timers.set(Timer::Quiet, (now + QUIET).min(*since + LONGEST_WAIT));
            }
            // What somebody else asked for goes first.
            Phase::Reading { latest, .. } => {
                let at = self.timers.at(Timer::Read).unwrap_or(now);
                self.timers.set(Timer::Read, at.max((now + READ_SPACING).min(*latest)));
            }
            Phase::Settling { since } => self.timers.set(Timer::Quiet, (now + QUIET).min(*since + LONGEST_SETTLING)),
            Phase::Idle | Phase::Settled => {}
        }
        let wanted = self.changes.current().filter(|(current, _)| *current == name).map(|(_, value)| value);
        if let Some(wanted) = wanted {
            // A value travels in single precision.
            let is_so = value == wanted || value == f64::from(wanted as f32);
            match self.changes.handle_echo(is_so, value) {
                Step::Wait => {}
                Step::Next(done) => self.end_change(now, done),
            }
        }
    }

    pub fn handle_timeout(&mut self, now: Timestamp) {
        while let Some(timer) = self.timers.pop_due(now) {
            match timer {
                Timer::Quiet => self.handle_quiet(now),
                Timer::Read => self.read_next(now),
                Timer::Change => match self.changes.handle_silence() {
                    Step::Wait => self.send_change(now),
                    Step::Next(done) => self.end_change(now, done),
                },
            }
        }
    }

    pub fn poll_output(&mut self) -> Option<ParameterOutput> {
        self.outputs.pop_front()
    }

    pub fn poll_timeout(&self) -> Option<Timestamp> {
        self.timers.next().map(|(at, _)| at)
    }

    /// The device is gone, or another one: nothing is known any more, and what was asked for is not done.
    pub fn forget(&mut self) {
        for id in self.changes.clear().into_iter().chain(std::mem::take(&mut self.waiting)) {
            self.done(id, Err(OperationError::NotThere));
        }
        self.device = None;
        self.values.clear();
        self.tries.clear();
        self.phase = Phase::Idle;
        self.timers = TimerTable::default();
    }

    /// Everything that exists was read; more may still come.
    pub fn is_settled(&self) -> bool {
        self.phase == Phase::Settled
    }

    pub fn value(&self, name: &str) -> Option<f64> {
        self.values.get(name).map(|entry| entry.value)
    }

    pub fn values(&self) -> impl Iterator<Item = (&str, f64)> {
        self.values.iter().map(|(name, entry)| (name.as_str(), entry.value))
    }

    /// Whether it was read as often as a parameter is read, and did not come.
    pub fn is_missing(&self, name: &str) -> bool {
        !self.values.contains_key(name) && self.tries.get(name).is_some_and(|tries| *tries >= READ_TRIES)
    }

    fn kind_of(&self, name: &str) -> Option<u8> {
        self.values.get(name).map(|entry| entry.kind)
    }

    fn done(&mut self, id: OperationId, result: Result<(), OperationError>) {
        self.outputs.push_back(ParameterOutput::Done { id, result });
    }

    fn send(&mut self, message: MavMessage) {
        self.outputs.push_back(ParameterOutput::Send(Box::new(message)));
    }

    fn send_list(&mut self) {
        let Some(MavId { system, component }) = self.device else { return };
        let list = PARAM_REQUEST_LIST_DATA { target_system: system, target_component: component };
        self.send(MavMessage::PARAM_REQUEST_LIST(list));
    }

    fn handle_quiet(&mut self, now: Timestamp) {
        match &mut self.phase {
            Phase::Listing { tries, any: false, .. } if *tries < LIST_TRIES => {
                *tries += 1;
                self.timers.set(Timer::Quiet, now + QUIET);
                self.send_list();
            }
            Phase::Listing { .. } => self.begin_round(now),
            Phase::Settling { .. } => {
                self.phase = Phase::Settled;
                self.outputs.push_back(ParameterOutput::Settled);
                for id in std::mem::take(&mut self.waiting) {
                    self.done(id, Ok(()));
                }
            }
            Phase::Idle | Phase::Reading { .. } | Phase::Settled => {}
        }
    }

    /// Begins to read what is missing, or has nothing left to read.
    fn begin_round(&mut self, now: Timestamp) {
        let known = (self.catalogue)(&|name| self.values.contains_key(name));
        let is_open = |known: &Known| {
            !self.values.contains_key(known.name) && self.tries.get(known.name).is_none_or(|tries| *tries < READ_TRIES)
        };
        let queue: VecDeque<Known> = known.into_iter().filter(is_open).take(MAX_NAMES).collect();
        if queue.is_empty() {
            self.phase = Phase::Settling { since: now };
            self.timers.set(Timer::Quiet, now.max(self.heard + QUIET));
        } else {
            self.phase = Phase::Reading { queue, latest: now };
            self.read_next(now);
        }
    }

    fn read_next(&mut self, now: Timestamp) {
        let Phase::Reading { queue, latest } = &mut self.phase else { return };
        if queue.is_empty() {
            self.begin_round(now);
            return;
        }
        while let Some(known) = queue.pop_front() {
            if self.values.contains_key(known.name) {
                continue;
            }
            let tries = self.tries.entry(known.name).or_default();
            let by_index = *tries >= TRIES_BY_NAME && !self.answers_to_names;
            *tries += 1;
            let pause = if queue.is_empty() { ROUND_PAUSE } else { READ_SPACING };
            *latest = now + pause + READ_DELAY;
            self.timers.set(Timer::Read, now + pause);
            self.send_read(known, by_index);
            return;
        }
        *latest = now + ROUND_PAUSE + READ_DELAY;
        self.timers.set(Timer::Read, now + ROUND_PAUSE);
    }

    /// An index beside a name is what some gimbals go by, so it is −1 as long as the name is meant.
    fn send_read(&mut self, known: Known, by_index: bool) {
        let Some(MavId { system, component }) = self.device else { return };
        let index = known.index.filter(|_| by_index).and_then(|index| i16::try_from(index).ok()).unwrap_or(-1);
        self.send(MavMessage::PARAM_REQUEST_READ(PARAM_REQUEST_READ_DATA {
            param_index: index,
            target_system: system,
            target_component: component,
            param_id: CharArray::from(known.name),
        }));
    }

    fn begin_change(&mut self, now: Timestamp) {
        if self.changes.begin() {
            self.send_change(now);
        }
    }

    fn send_change(&mut self, now: Timestamp) {
        let Some(MavId { system, component }) = self.device else { return };
        let Some((name, value)) = self.changes.current() else { return };
        let known = self.values.get(name).map(|entry| entry.kind);
        let (param_value, param_type) = self.encoding.encode_typed(value, known);
        let param_id = CharArray::from(name);
        self.timers.set(Timer::Change, now + change::PATIENCE);
        self.send(MavMessage::PARAM_SET(PARAM_SET_DATA {
            param_value,
            target_system: system,
            target_component: component,
            param_id,
            param_type,
        }));
    }

    /// One was set, or not: whoever asked is told after its last.
    fn end_change(&mut self, now: Timestamp, done: Option<(OperationId, Result<(), OperationError>)>) {
        self.timers.cancel(Timer::Change);
        if let Some((id, result)) = done {
            self.done(id, result);
        }
        self.begin_change(now);
    }
}

#[cfg(test)]
mod tests;
