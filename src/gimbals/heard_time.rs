//! For how long a gimbal was heard while it was told something.
//!
//! A device that answers nothing has heard what it is told again and again when it was heard itself meanwhile. What was
//! said while it was away went into the void, however long it was said.

use std::time::Duration;

use crate::timestamp::Timestamp;

/// A frame of the gimbal vouches for so long before it …
const VOUCHES_FOR: Duration = Duration::from_millis(500);
/// … unless it was silent for longer than one that only beats, and may just be back.
const AWAY_AFTER: Duration = Duration::from_millis(1_500);

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HeardTime {
    latest: Timestamp,
    passed: Duration,
}

impl HeardTime {
    /// From `now` on it is told.
    pub const fn new(now: Timestamp) -> Self {
        Self { latest: now, passed: Duration::ZERO }
    }

    /// A frame of the gimbal came.
    pub fn handle_heard(&mut self, now: Timestamp) {
        let silent = now.since(std::mem::replace(&mut self.latest, now));
        if silent <= AWAY_AFTER {
            self.passed += silent.min(VOUCHES_FOR);
        }
    }

    pub const fn passed(&self) -> Duration {
        self.passed
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn silence_does_not_count() {
        let mut heard = HeardTime::new(Timestamp::from_millis(10_000));
        assert_eq!(heard.passed(), Duration::ZERO);
        for millis in (10_100..=10_400).step_by(100) {
            heard.handle_heard(Timestamp::from_millis(millis));
        }
        assert_eq!(heard.passed(), Duration::from_millis(400));
        heard.handle_heard(Timestamp::from_millis(18_000));
        assert_eq!(heard.passed(), Duration::from_millis(400), "it has just come back");
        heard.handle_heard(Timestamp::from_millis(18_100));
        heard.handle_heard(Timestamp::from_millis(19_100));
        assert_eq!(heard.passed(), Duration::from_secs(1), "it may have been away for half of the second");
    }
}
