//! What the service manager is told: ready, alive, stopping, and a line of status.

use std::io;
use std::time::Duration;

use sd_notify::NotifyState;

use crate::timestamp::Timestamp;

/// Speaks the `sd_notify(3)` protocol; silent when nobody listens.
pub struct ServiceManager {
    watchdog: Option<Watchdog>,
    /// How many links of how many were said to be up.
    told: Option<(usize, usize)>,
}

struct Watchdog {
    /// Half of what the service manager waits for.
    interval: Duration,
    next: Timestamp,
}

impl ServiceManager {
    /// Takes over what the environment says.
    pub fn new() -> Self {
        Self::with_watchdog(sd_notify::watchdog_enabled())
    }

    fn with_watchdog(timeout: Option<Duration>) -> Self {
        let watchdog = timeout.map(|timeout| Watchdog { interval: timeout / 2, next: Timestamp::ZERO });
        Self { watchdog, told: None }
    }

    pub fn ready(&self) {
        tell(&[NotifyState::Ready]);
    }

    pub fn stopping(&self) {
        tell(&[NotifyState::Stopping]);
    }

    /// Tells how many links work, when that changed.
    pub fn links_up(&mut self, up: usize, all: usize) {
        if self.told != Some((up, all)) {
            self.told = Some((up, all));
            tell(&[NotifyState::Status(&format!("{up} of {all} links up"))]);
        }
    }

    /// Says that the event loop is alive, if it is time to; to be called by the event loop itself.
    pub fn feed_watchdog(&mut self, now: Timestamp) {
        if let Some(watchdog) = &mut self.watchdog
            && now >= watchdog.next
        {
            watchdog.next = now + watchdog.interval;
            tell(&[NotifyState::Watchdog]);
        }
    }

    /// When to call [`Self::feed_watchdog`] again.
    pub fn poll_timeout(&self) -> Option<Timestamp> {
        self.watchdog.as_ref().map(|watchdog| watchdog.next)
    }
}

fn tell(state: &[NotifyState<'_>]) {
    if let Err(error) = sd_notify::notify(state) {
        told_nobody(&error);
    }
}

fn told_nobody(error: &io::Error) {
    tracing::debug!(%error, "the service manager could not be told");
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `sd_watchdog_enabled(3)`: "It is recommended that a daemon sends a keep-alive notification message to the
    /// service manager every half of the time returned here."
    #[test]
    fn the_watchdog_is_fed_at_half_its_interval() {
        let mut manager = ServiceManager::with_watchdog(Some(Duration::from_secs(5)));
        assert_eq!(manager.poll_timeout(), Some(Timestamp::ZERO));

        manager.feed_watchdog(Timestamp::from_secs(1));
        assert_eq!(manager.poll_timeout(), Some(Timestamp::from_millis(3_500)));

        manager.feed_watchdog(Timestamp::from_secs(3));
        assert_eq!(manager.poll_timeout(), Some(Timestamp::from_millis(3_500)));
    }

    #[test]
    fn nothing_is_due_without_a_watchdog() {
        assert_eq!(ServiceManager::with_watchdog(None).poll_timeout(), None);
    }
}
