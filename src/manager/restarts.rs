//! Whether a gimbal seems to start again more often than one can: then two on one line have its id, each with a clock of its
//! own.

use std::time::Duration;

use crate::timestamp::Timestamp;

/// So many in a row …
const MANY: u32 = 4;
/// … no further apart than this are none: every gimbal takes longer to start.
const CLOSE: Duration = Duration::from_secs(1);

#[derive(Clone, Copy, Debug, Default)]
pub struct Restarts {
    in_a_row: u32,
    latest: Option<Timestamp>,
}

impl Restarts {
    /// It seems to have started again.
    pub fn handle_restarted(&mut self, now: Timestamp) {
        self.in_a_row = if self.are_close(now) { self.in_a_row.saturating_add(1) } else { 1 };
        self.latest = Some(now);
    }

    /// Whether there are two, as it seems.
    pub fn are_of_two(&self, now: Timestamp) -> bool {
        self.in_a_row >= MANY && self.are_close(now)
    }

    fn are_close(&self, now: Timestamp) -> bool {
        self.latest.is_some_and(|latest| now.since(latest) <= CLOSE)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn four_in_a_row_are_of_two_and_single_ones_are_not() {
        let mut restarts = Restarts::default();
        for (millis, are_of_two) in
            [(0, false), (900, false), (1_000, false), (2_001, false), (2_200, false), (2_300, false), (3_300, true)]
        {
            restarts.handle_restarted(Timestamp::from_millis(millis));
            assert_eq!(restarts.are_of_two(Timestamp::from_millis(millis)), are_of_two, "{millis}");
        }
        assert!(!restarts.are_of_two(Timestamp::from_millis(4_301)), "one of them is gone");
    }
}
