//! Stopping a Gremsy that speaks v2, which answers no setpoint: zeros for a second in which it is heard.

use std::time::Duration;

use crate::gimbals::heard_time::HeardTime;
use crate::gimbals::setpoint::{Setpoint, Turning};
use crate::timestamp::Timestamp;

const EVERY: Duration = Duration::from_millis(100);
/// While it is not there, which it may be all the same.
const EVERY_UNHEARD: Duration = Duration::from_secs(1);
const LASTS: Duration = Duration::from_secs(1);

/// A rotation that is being stopped.
#[derive(Clone, Copy, Debug)]
pub struct Stopping {
    turning: Turning,
    next: Timestamp,
    heard: HeardTime,
}

impl Stopping {
    /// The first zero is due at once.
    pub fn new(now: Timestamp, turning: Turning) -> Self {
        Self { turning: turning.stopped(), next: now, heard: HeardTime::new(now) }
    }

    /// A zero was sent to a gimbal that is there or not.
    pub fn handle_sent(&mut self, now: Timestamp, is_there: bool) {
        self.next = now + if is_there { EVERY } else { EVERY_UNHEARD };
    }

    /// It said something.
    pub fn handle_heard(&mut self, now: Timestamp) {
        self.heard.handle_heard(now);
        self.next = self.next.min(now + EVERY);
    }

    /// The zero that is due.
    pub fn handle_timeout(&mut self, now: Timestamp, is_there: bool) -> Option<Setpoint> {
        if now < self.next {
            return None;
        }
        self.handle_sent(now, is_there);
        Some(Setpoint::Turn(self.turning))
    }

    pub fn is_over(&self) -> bool {
        self.heard.passed() >= LASTS
    }

    pub const fn poll_timeout(&self) -> Timestamp {
        self.next
    }
}
