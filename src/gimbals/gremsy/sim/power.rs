//! When the device is on, hears, and has a reason to speak.

use std::time::Duration;

use crate::timestamp::Timestamp;

/// Deaf and mute after power-on.
const MUTE: Duration = Duration::from_secs(2);
/// From then on the motors find themselves.
const START_UP: Duration = Duration::from_secs(4);

#[derive(Clone, Copy, Debug)]
pub struct Power {
    /// `None` after a shutdown.
    on_at: Option<Timestamp>,
    /// It has heard a heartbeat.
    is_awake: bool,
}

impl Power {
    pub const fn on_at(on_at: Timestamp) -> Self {
        Self { on_at: Some(on_at), is_awake: false }
    }

    pub const fn off() -> Self {
        Self { on_at: None, is_awake: false }
    }

    pub fn hears(self, now: Timestamp) -> bool {
        self.on_at.is_some_and(|on_at| on_at + MUTE <= now)
    }

    /// It speaks.
    pub const fn is_awake(self) -> bool {
        self.is_awake
    }

    /// True when it was silent until now.
    pub const fn wake(&mut self) -> bool {
        !std::mem::replace(&mut self.is_awake, true)
    }

    pub fn is_starting(self, now: Timestamp) -> bool {
        now < self.settled_at()
    }

    /// When start-up is over.
    pub fn settled_at(self) -> Timestamp {
        self.on_at.map_or(Timestamp::ZERO, |on_at| on_at + MUTE + START_UP)
    }

    /// Time since power-on.
    pub fn uptime(self, now: Timestamp) -> Duration {
        self.on_at.map_or(Duration::ZERO, |on_at| now.since(on_at))
    }
}
