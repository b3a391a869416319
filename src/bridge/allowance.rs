//! How many of something there may be in a while.

use std::time::Duration;

use crate::timestamp::Timestamp;

/// So many at once, and one more for each interval that passes.
#[derive(Clone, Copy, Debug)]
pub struct Allowance {
    burst: u32,
    interval: Duration,
    /// When all that was taken is made up for.
    whole_at: Timestamp,
}

impl Allowance {
    pub const fn new(burst: u32, interval: Duration) -> Self {
        Self { burst, interval, whole_at: Timestamp::ZERO }
    }

    /// Takes one, if `kept` more are left for others.
    pub fn take(&mut self, now: Timestamp, kept: u32) -> bool {
        let whole_at = self.whole_at.max(now);
        if whole_at.since(now) + self.interval * (1 + kept) > self.interval * self.burst {
            return false;
        }
        self.whole_at = whole_at + self.interval;
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_taken_comes_back_with_time() {
        let mut allowance = Allowance::new(3, Duration::from_secs(1));
        let mut take = |millis, kept| allowance.take(Timestamp::from_millis(millis), kept);
        assert_eq!([take(0, 0), take(0, 2), take(0, 1), take(0, 0), take(0, 0)], [true, false, true, true, false]);
        assert_eq!([take(999, 0), take(1_000, 0), take(1_001, 0)], [false, true, false]);
        assert_eq!([take(9_000, 2), take(9_000, 0), take(9_000, 0), take(9_000, 0)], [true, true, true, false]);
    }
}
