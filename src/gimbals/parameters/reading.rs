//! Reading all parameters: the list, then what is missing of it, one by one, then a while of silence.

use std::collections::VecDeque;
use std::time::Duration;

use super::list::Wanted;
use super::{ParameterOutput, Parameters, Timer};
use crate::gimbals::operation::{OperationError, OperationResult};
use crate::timestamp::Timestamp;
use crate::wire::MavId;
use crate::wire::dialect::{CharArray, MavMessage, PARAM_REQUEST_LIST_DATA, PARAM_REQUEST_READ_DATA};

/// A list is over when nothing has come for so long.
const QUIET: Duration = Duration::from_secs(1);
/// It is asked for so often when nothing comes at all.
const LIST_TRIES: u8 = 3;
/// Somebody else who reads all the time does not keep us from going on for longer than this.
const LONGEST_WAIT: Duration = Duration::from_secs(20);
/// Nor is the silence after the last one waited for longer than this.
const LONGEST_SETTLING: Duration = Duration::from_secs(2);

/// After what somebody else asked for comes nothing of ours for so long …
const AFTER_OTHERS: Duration = Duration::from_millis(10);
/// … but it is delayed by no more than this …
const READ_DELAY: Duration = Duration::from_millis(100);
/// … and the next round begins so long after the one before.
const ROUND_PAUSE: Duration = Duration::from_millis(500);

/// A gimbal that says itself how many it has is read for so long at most: whoever asked waits for it, and perhaps for a value
/// to be set then.
const LONGEST_READING: Duration = Duration::from_secs(14);

/// How far it is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Phase {
    /// Nothing was asked for.
    Idle,
    /// The list was asked for, so often since then.
    Listing {
        since: Timestamp,
        tries: u8,
    },
    /// What is missing is read, one by one.
    Reading {
        queue: VecDeque<Wanted>,
        /// When the next one is read at the latest.
        latest: Timestamp,
    },
    /// All was read; a while of silence, and it is settled.
    Settling {
        since: Timestamp,
    },
    Settled,
}

impl Parameters {
    /// Reads everything, of `device` from now on.
    pub fn refresh(&mut self, now: Timestamp, device: MavId) {
        self.listen(device);
        self.list.begin();
        self.is_answered = false;
        self.ends = self.list.count().map(|_| now + LONGEST_READING);
        self.phase = Phase::Listing { since: now, tries: 1 };
        self.timers.cancel(Timer::Read);
        self.timers.set(Timer::Quiet, now + QUIET);
        self.send_list();
    }

    /// One was told while it reads.
    pub(super) fn go_on_after(&mut self, now: Timestamp) {
        match &mut self.phase {
            Phase::Listing { since, .. } => {
                let latest = self.ends.unwrap_or(*since + LONGEST_WAIT);
                self.timers.set(Timer::Quiet, (now + QUIET).min(latest).max(now));
            }
            // What somebody else asked for goes first.
            Phase::Reading { latest, .. } => {
                let at = self.timers.at(Timer::Read).unwrap_or(now);
                self.timers.set(Timer::Read, at.max((now + AFTER_OTHERS).min(*latest)));
            }
            Phase::Settling { since } => self.timers.set(Timer::Quiet, (now + QUIET).min(*since + LONGEST_SETTLING)),
            Phase::Idle | Phase::Settled => {}
        }
    }

    pub(super) fn handle_quiet(&mut self, now: Timestamp) {
        match &mut self.phase {
            Phase::Listing { tries, .. } if !self.is_answered && *tries < LIST_TRIES => {
                *tries += 1;
                self.timers.set(Timer::Quiet, now + QUIET);
                self.send_list();
            }
            Phase::Listing { .. } => self.begin_round(now),
            Phase::Settling { .. } => {
                self.phase = Phase::Settled;
                self.outputs.push_back(ParameterOutput::Settled);
                let result = self.result_of_reading();
                for id in std::mem::take(&mut self.waiting) {
                    self.done(id, result.clone());
                }
                self.begin_change(now);
            }
            Phase::Idle | Phase::Reading { .. } | Phase::Settled => {}
        }
    }

    /// What never came by its maker's list does not exist, and what is known has to come again; where nothing is known of the
    /// gimbal, what it told has to do.
    fn result_of_reading(&self) -> OperationResult {
        if !self.is_answered {
            return Err(self.silence());
        }
        let (missing, count) = match self.list.count() {
            Some(count) => (self.missing().len(), usize::from(count)),
            None => (self.list.known_in_vain(&self.values), self.values.len()),
        };
        match missing {
            0 => Ok(()),
            missing => {
                let text = format!(
                    "{missing} of its {count} parameters did not come in time; ask again, and check the line to it"
                );
                Err(OperationError::NoEffect(text))
            }
        }
    }

    fn missing(&self) -> VecDeque<Wanted> {
        self.list.missing(&self.values)
    }

    fn is_out_of_time(&self, now: Timestamp) -> bool {
        self.ends.is_some_and(|ends| now >= ends)
    }

    /// Begins to read what is missing, or has nothing left to read.
    fn begin_round(&mut self, now: Timestamp) {
        let queue = self.missing();
        if queue.is_empty() || self.is_out_of_time(now) {
            self.phase = Phase::Settling { since: now };
            self.timers.set(Timer::Quiet, now.max(self.heard + QUIET));
        } else {
            self.phase = Phase::Reading { queue, latest: now };
            self.read_next(now);
        }
    }

    pub(super) fn read_next(&mut self, now: Timestamp) {
        let is_out_of_time = self.is_out_of_time(now);
        let Phase::Reading { queue, latest } = &mut self.phase else { return };
        if queue.is_empty() || is_out_of_time {
            self.begin_round(now);
            return;
        }
        while let Some(wanted) = queue.pop_front() {
            if self.list.has_come(&wanted) {
                continue;
            }
            let pause = if queue.is_empty() { ROUND_PAUSE } else { self.list.spacing() };
            *latest = now + pause + READ_DELAY;
            self.timers.set(Timer::Read, now + pause);
            let (name, index) = self.list.ask(wanted);
            self.send_read(&name, index);
            return;
        }
        *latest = now + ROUND_PAUSE + READ_DELAY;
        self.timers.set(Timer::Read, now + ROUND_PAUSE);
    }

    fn send_list(&mut self) {
        let Some(MavId { system, component }) = self.device else { return };
        let list = PARAM_REQUEST_LIST_DATA { target_system: system, target_component: component };
        self.send(MavMessage::PARAM_REQUEST_LIST(list));
    }

    pub(super) fn send_read(&mut self, name: &str, index: i16) {
        let Some(MavId { system, component }) = self.device else { return };
        self.send(MavMessage::PARAM_REQUEST_READ(PARAM_REQUEST_READ_DATA {
            param_index: index,
            target_system: system,
            target_component: component,
            param_id: CharArray::from(name),
        }));
    }
}
