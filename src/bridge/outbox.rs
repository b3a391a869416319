//! What is to be sent, in order, without an allocation per frame.

use std::collections::VecDeque;

use super::Output;
use crate::channel::ChannelSet;
use crate::gimbals::operation::OperationId;
use crate::manager::asked::Answer;

/// Frames that wait for [`poll_output`](super::Bridge::poll_output), their bytes side by side in one buffer.
#[derive(Debug)]
pub struct Outbox {
    bytes: Vec<u8>,
    entries: VecDeque<Entry>,
    /// The last ones that were given out.
    turning: String,
    gimbal_ids: String,
    answer: Answer,
}

#[derive(Clone, Debug)]
enum Entry {
    Frame { channels: ChannelSet, start: usize, end: usize },
    StoreSystemId(u8),
    StoreTurning(String),
    StoreGimbalIds(String),
    Answered { id: OperationId, answer: Answer },
}

impl Default for Outbox {
    fn default() -> Self {
        Self {
            bytes: Vec::new(),
            entries: VecDeque::new(),
            turning: String::new(),
            gimbal_ids: String::new(),
            answer: Ok(()),
        }
    }
}

impl Outbox {
    pub fn push_frame(&mut self, channels: ChannelSet, bytes: &[u8]) {
        if channels.is_empty() {
            return;
        }
        if self.entries.is_empty() {
            self.bytes.clear();
        }
        let start = self.bytes.len();
        self.bytes.extend_from_slice(bytes);
        self.entries.push_back(Entry::Frame { channels, start, end: self.bytes.len() });
    }

    pub fn push_system_id(&mut self, system: u8) {
        self.entries.push_back(Entry::StoreSystemId(system));
    }

    pub fn push_turning(&mut self, names: String) {
        self.entries.push_back(Entry::StoreTurning(names));
    }

    pub fn push_gimbal_ids(&mut self, lines: String) {
        self.entries.push_back(Entry::StoreGimbalIds(lines));
    }

    pub fn push_answer(&mut self, id: OperationId, answer: Answer) {
        self.entries.push_back(Entry::Answered { id, answer });
    }

    pub fn pop(&mut self) -> Option<Output<'_>> {
        Some(match self.entries.pop_front()? {
            Entry::Frame { channels, start, end } => Output::Transmit { channels, bytes: &self.bytes[start..end] },
            Entry::StoreSystemId(system) => Output::StoreSystemId(system),
            Entry::StoreTurning(names) => {
                self.turning = names;
                Output::StoreTurning(&self.turning)
            }
            Entry::StoreGimbalIds(lines) => {
                self.gimbal_ids = lines;
                Output::StoreGimbalIds(&self.gimbal_ids)
            }
            Entry::Answered { id, answer } => {
                self.answer = answer;
                Output::Answered { id, answer: &self.answer }
            }
        })
    }
}
