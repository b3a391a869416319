//! Stopping a Gremsy that speaks v2, which answers no setpoint: zeros for a second.

use std::time::Duration;

use crate::gimbals::setpoint::{Setpoint, Turning};
use crate::timestamp::Timestamp;

const EVERY: Duration = Duration::from_millis(100);
const LASTS: Duration = Duration::from_secs(1);

/// A rotation that is being stopped.
#[derive(Clone, Copy, Debug)]
pub struct Stopping {
    turning: Turning,
    next: Timestamp,
    until: Timestamp,
}

impl Stopping {
    /// The first zero is due at once.
    pub fn new(now: Timestamp, turning: Turning) -> Self {
        Self { turning: turning.stopped(), next: now, until: now + LASTS }
    }

    /// A zero was sent.
    pub fn handle_sent(&mut self, now: Timestamp) {
        self.next = now + EVERY;
    }

    /// The zero that is due.
    pub fn handle_timeout(&mut self, now: Timestamp) -> Option<Setpoint> {
        if now < self.next {
            return None;
        }
        self.handle_sent(now);
        Some(Setpoint::Turn(self.turning))
    }

    pub fn is_over(&self, now: Timestamp) -> bool {
        self.until <= now
    }

    pub const fn poll_timeout(&self) -> Timestamp {
        self.next
    }
}
