//! How long to wait before the next attempt.

use std::time::Duration;

use crate::timestamp::Timestamp;

/// A wait that doubles from attempt to attempt up to a limit.
#[derive(Clone, Debug)]
pub struct Backoff {
    first: Duration,
    limit: Duration,
    next: Duration,
}

impl Backoff {
    /// For sockets: 250 ms, doubling to 2 s.
    pub fn for_sockets() -> Self {
        Self::new(Duration::from_millis(250), Duration::from_secs(2))
    }

    /// For serial devices: every 250 ms, because whoever plugs one in waits for it.
    pub fn for_devices() -> Self {
        Self::new(Duration::from_millis(250), Duration::from_millis(250))
    }

    fn new(first: Duration, limit: Duration) -> Self {
        Self { first, limit, next: first }
    }

    /// An attempt failed at `now`: when to make the next one.
    pub fn failed(&mut self, now: Timestamp) -> Timestamp {
        let at = now + self.next;
        self.next = (self.next * 2).min(self.limit);
        at
    }

    /// An attempt succeeded.
    pub fn reset(&mut self) {
        self.next = self.first;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// "back-off 250 ms doubling to 2 s" (endpoints).
    #[test]
    fn sockets_wait_longer_after_each_failure_up_to_two_seconds() {
        let mut backoff = Backoff::for_sockets();
        let mut waits = || backoff.failed(Timestamp::ZERO).as_micros() / 1_000;
        assert_eq!([waits(), waits(), waits(), waits(), waits()], [250, 500, 1_000, 2_000, 2_000]);

        backoff.reset();
        assert_eq!(backoff.failed(Timestamp::from_secs(1)), Timestamp::from_millis(1_250));
    }

    /// "serial paths every 250 ms" (endpoints).
    #[test]
    fn devices_are_looked_for_every_250_ms() {
        let mut backoff = Backoff::for_devices();
        let mut waits = || backoff.failed(Timestamp::ZERO).as_micros() / 1_000;
        assert_eq!([waits(), waits(), waits()], [250, 250, 250]);
    }
}
