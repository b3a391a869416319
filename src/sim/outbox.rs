//! Frames that a simulated peer has ready to send.

use std::collections::VecDeque;

use crate::wire::dialect::MessageData;
use crate::wire::{MavId, encode_to_vec};

/// More than one input ever makes a peer say; beyond it the oldest frame goes.
const CAPACITY: usize = 1024;

/// Numbers the frames of one component and keeps them until they are taken.
#[derive(Clone, Debug)]
pub struct Outbox {
    source: MavId,
    sequence: u8,
    frames: VecDeque<Vec<u8>>,
}

impl Outbox {
    pub fn new(source: MavId) -> Self {
        Self { source, sequence: 0, frames: VecDeque::new() }
    }

    pub fn source(&self) -> MavId {
        self.source
    }

    /// Changes the system id of frames to come.
    pub fn set_system(&mut self, system: u8) {
        self.source.system = system;
    }

    pub fn send<M: MessageData>(&mut self, message: &M) {
        if self.frames.len() == CAPACITY {
            self.frames.pop_front();
        }
        self.frames.push_back(encode_to_vec(self.source, self.sequence, message));
        self.sequence = self.sequence.wrapping_add(1);
    }

    pub fn poll(&mut self) -> Option<Vec<u8>> {
        self.frames.pop_front()
    }

    /// Starts over: what was not sent is lost, and numbers begin at 0.
    pub fn clear(&mut self) {
        self.frames.clear();
        self.sequence = 0;
    }
}
