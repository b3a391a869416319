//! What was told, and when.

use std::time::Duration;

use crate::timestamp::Timestamp;

/// A value and when it arrived.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Dated<T> {
    pub at: Timestamp,
    pub value: T,
}

impl<T> Dated<T> {
    pub fn new(at: Timestamp, value: T) -> Self {
        Self { at, value }
    }

    pub fn age(&self, now: Timestamp) -> Duration {
        now.since(self.at)
    }

    /// The value unless it is older than `limit`.
    pub fn within(self, now: Timestamp, limit: Duration) -> Option<T> {
        (self.age(now) <= limit).then_some(self.value)
    }
}
