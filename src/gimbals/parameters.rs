//! A gimbal's parameters, for any driver: read, kept up to date, and set, each with retry.
//!
//! The list is asked for; when nothing has come for a second, what is missing is read one by one, up to five times each,
//! and what then has not come does not exist. What there should be says the gimbal's maker, by names, or the gimbal itself, by
//! its count (`list`). A value is set until the gimbal tells it back. What the gimbal tells others counts as well: a ground
//! station that reads or sets parameters at the same time is not disturbed, and what it changes is known here.

mod change;
mod encoding;
mod evidence;
mod list;
mod reading;

use std::collections::{BTreeMap, VecDeque};

use super::driver::DriverOutput;
use super::operation::{OperationError, OperationId};
use crate::timers::TimerTable;
use crate::timestamp::Timestamp;
use crate::wire::dialect::{CharArray, MavMessage, PARAM_SET_DATA, PARAM_VALUE_DATA};
use crate::wire::{Frame, MavId};
use change::{Changes, Step};
pub use encoding::Encoding;
use evidence::Evidence;
pub use list::{Catalogue, Known};
use list::{List, MAX_NAMES};
use reading::Phase;

/// So many wait for a refresh at most.
const MAX_WAITING: usize = 8;

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
    codec: Codec,
    list: List,
    device: Option<MavId>,
    values: BTreeMap<String, Value>,
    phase: Phase,
    /// When it is read no longer, where nobody knows how many there are.
    ends: Option<Timestamp>,
    /// One was told since the list was asked for.
    is_answered: bool,
    /// When the last value came.
    heard: Timestamp,
    changes: Changes,
    waiting: Vec<OperationId>,
    timers: TimerTable<Timer>,
    outputs: VecDeque<ParameterOutput>,
}

/// How values travel.
#[derive(Clone, Copy, Debug)]
enum Codec {
    /// As its maker says.
    Given(Encoding),
    /// As is found out.
    Found(Evidence),
}

impl Codec {
    const fn encoding(self) -> Encoding {
        match self {
            Self::Given(encoding) => encoding,
            Self::Found(evidence) => evidence.encoding(),
        }
    }
}

/// As it was told: how it is to be read may be known only later.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Value {
    raw: f32,
    /// `MAV_PARAM_TYPE`.
    kind: u8,
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

/// Those [of any gimbal](Parameters::of_any_gimbal).
impl Default for Parameters {
    fn default() -> Self {
        Self::of_any_gimbal()
    }
}

impl Parameters {
    /// Of a gimbal whose maker tells their names and how they travel.
    pub fn new(encoding: Encoding, catalogue: Catalogue) -> Self {
        Self::with(Codec::Given(encoding), List::named(catalogue))
    }

    /// Of a gimbal of which nothing is known: it tells how many it has, and shows how they travel.
    pub fn of_any_gimbal() -> Self {
        Self::with(Codec::Found(Evidence::default()), List::counted())
    }

    fn with(codec: Codec, list: List) -> Self {
        Self {
            codec,
            list,
            device: None,
            values: BTreeMap::new(),
            phase: Phase::Idle,
            ends: None,
            is_answered: false,
            heard: Timestamp::ZERO,
            changes: Changes::default(),
            waiting: Vec::new(),
            timers: TimerTable::default(),
            outputs: VecDeque::new(),
        }
    }

    /// Learns what `device` tells anybody from now on; nothing is asked.
    pub fn listen(&mut self, device: MavId) {
        if self.device != Some(device) {
            self.forget();
            self.device = Some(device);
        }
    }

    /// Reads everything for somebody who is told when it is done.
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
    ///
    /// One of which the type is not known is read first, by the list, and by its name if it is not in there: it is not
    /// guessed.
    pub fn set(&mut self, now: Timestamp, id: OperationId, values: &[(&str, f64)]) {
        let checked = values.iter().try_for_each(|(name, value)| {
            encoding::check_name(name)?;
            self.check(name, *value)
        });
        let result = match (checked, self.device) {
            (Err(problem), _) => Err(OperationError::Invalid(problem)),
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
        let name = encoding::read_name(&message.param_id);
        let told = Value { raw: message.param_value, kind: message.param_type };
        // A maker's value that is none was not told.
        if let Codec::Given(encoding) = self.codec
            && (name.is_none() || encoding.decode(told.raw, told.kind).is_none())
        {
            return;
        }
        let is_new = name.is_some_and(|name| !self.values.contains_key(name));
        let is_kept = name.is_some() && !(is_new && self.values.len() >= MAX_NAMES);
        if !is_kept && self.list.count().is_none() {
            return;
        }
        self.heard = now;
        self.is_answered = true;
        self.list.handle_told(name, message.param_index, message.param_count);
        if let Some(name) = name.filter(|_| is_kept) {
            if let Codec::Found(evidence) = &mut self.codec {
                evidence.weigh(told.raw, told.kind);
            }
            self.values.insert(name.to_owned(), told);
        }
        self.go_on_after(now);
        if let Some(name) = name.filter(|_| is_kept) {
            self.handle_told_current(now, name, is_new);
        }
    }

    /// The gimbal told the value of `name`, which may be the one that is being set.
    fn handle_told_current(&mut self, now: Timestamp, name: &str, is_new: bool) {
        let Some((_, wanted)) = self.changes.current().filter(|(current, _)| *current == name) else { return };
        let value = self.value(name);
        // A value travels in single precision.
        let is_so = value.is_some_and(|value| value == wanted || value == f64::from(wanted as f32));
        let step = if is_so || !(is_new && self.reads_before_setting()) {
            self.changes.handle_echo(is_so, value.unwrap_or(f64::NAN))
        } else if let Err(problem) = self.check(name, wanted) {
            self.changes.fail(OperationError::Invalid(problem))
        } else {
            // Its type is known from now on.
            self.changes.start_over();
            return self.send_change(now);
        };
        match step {
            Step::Wait => {}
            Step::Next(done) => self.end_change(now, done),
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

    /// Hands on everything that is to be done.
    pub fn drain_into(&mut self, outputs: &mut VecDeque<DriverOutput>) {
        outputs.extend(self.outputs.drain(..).filter_map(|output| match output {
            ParameterOutput::Send(message) => Some(DriverOutput::Message(message)),
            ParameterOutput::Done { id, result } => Some(DriverOutput::Operated { id, result }),
            ParameterOutput::Settled => None,
        }));
    }

    pub fn poll_timeout(&self) -> Option<Timestamp> {
        self.timers.next().map(|(at, _)| at)
    }

    /// The device is gone, or another one: nothing is known any more, and what was asked for is not done.
    pub fn forget(&mut self) {
        self.abandon(&OperationError::NotThere);
    }

    /// The same for this reason.
    pub fn abandon(&mut self, reason: &OperationError) {
        for id in self.changes.clear().into_iter().chain(std::mem::take(&mut self.waiting)) {
            self.done(id, Err(reason.clone()));
        }
        self.device = None;
        self.values.clear();
        self.list.begin();
        if let Codec::Found(evidence) = &mut self.codec {
            *evidence = Evidence::default();
        }
        self.phase = Phase::Idle;
        self.timers = TimerTable::default();
    }

    /// The device was restarted: what is known is of before, and what was asked for is not done.
    pub fn handle_restart(&mut self) {
        let device = self.device;
        self.abandon(&OperationError::NotReady);
        self.device = device;
    }

    /// Everything that exists was read; more may still come.
    pub fn is_settled(&self) -> bool {
        self.phase == Phase::Settled
    }

    pub fn value(&self, name: &str) -> Option<f64> {
        self.values.get(name).and_then(|told| self.decode(*told))
    }

    pub fn values(&self) -> impl Iterator<Item = (&str, f64)> {
        self.values.iter().filter_map(|(name, told)| Some((name.as_str(), self.decode(*told)?)))
    }

    /// All of them by name.
    pub fn by_name(&self) -> BTreeMap<String, f64> {
        self.values().map(|(name, value)| (name.to_owned(), value)).collect()
    }

    /// Whether it was read as often as a parameter is read, and did not come.
    pub fn is_missing(&self, name: &str) -> bool {
        !self.values.contains_key(name) && self.list.was_read_in_vain(name)
    }

    fn decode(&self, Value { raw, kind }: Value) -> Option<f64> {
        self.codec.encoding().decode(raw, kind)
    }

    /// What is wrong with a value, as far as the type is known.
    fn check(&self, name: &str, value: f64) -> Result<(), String> {
        let kind = self.values.get(name).map(|told| told.kind);
        self.codec.encoding().encode(value, kind).map(drop)
    }

    /// Why a gimbal that told nothing did not.
    fn silence(&self) -> OperationError {
        if self.values.is_empty() { OperationError::NoParameters } else { OperationError::NoAnswer }
    }

    const fn reads_before_setting(&self) -> bool {
        matches!(self.codec, Codec::Found(_))
    }

    fn done(&mut self, id: OperationId, result: Result<(), OperationError>) {
        self.outputs.push_back(ParameterOutput::Done { id, result });
    }

    fn send(&mut self, message: MavMessage) {
        self.outputs.push_back(ParameterOutput::Send(Box::new(message)));
    }

    fn begin_change(&mut self, now: Timestamp) {
        while !self.waits_for_reading(now) && self.changes.begin() {
            let Some((name, value)) = self.changes.current() else { return };
            let Err(problem) = self.check(name, value) else { return self.send_change(now) };
            if let Step::Next(Some((id, result))) = self.changes.fail(OperationError::Invalid(problem)) {
                self.done(id, result);
            }
        }
    }

    /// Whether the next one to be set cannot be sent before all were read, which is seen to.
    fn waits_for_reading(&mut self, now: Timestamp) -> bool {
        let Codec::Found(evidence) = self.codec else { return false };
        let Some(name) = self.changes.next_name() else { return false };
        let is_clear =
            self.values.get(name).is_some_and(|told| evidence.is_decided() || !encoding::is_whole(told.kind));
        if is_clear || self.is_settled() {
            return false;
        }
        if let (Phase::Idle, Some(device)) = (&self.phase, self.device) {
            self.refresh(now, device);
        }
        true
    }

    /// Sets the one that is under way, or asks for it by its name where that must be first.
    fn send_change(&mut self, now: Timestamp) {
        let Some(MavId { system, component }) = self.device else { return };
        let Some((name, value)) = self.changes.current() else { return };
        let known = self.values.get(name).map(|told| told.kind);
        self.timers.set(Timer::Change, now + change::PATIENCE);
        if known.is_none() && self.reads_before_setting() {
            let name = name.to_owned();
            return self.send_read(&name, -1);
        }
        let (param_value, param_type) = self.codec.encoding().encode_typed(value, known);
        let param_id = CharArray::from(name);
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
            let is_unanswered = result == Err(OperationError::NoAnswer) && self.reads_before_setting();
            self.done(id, if is_unanswered { Err(self.silence()) } else { result });
        }
        self.begin_change(now);
    }
}

#[cfg(test)]
mod tests;
