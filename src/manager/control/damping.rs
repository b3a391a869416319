//! When clients take control from one another again and again, the one that has it keeps it for a while.
//!
//! A client that takes control back whenever it has lost it (PX4 as a client does) and another of its kind would
//! otherwise swing the camera between them for ever.

use std::collections::VecDeque;
use std::time::Duration;

use super::super::request::Refusal;
use crate::timestamp::Timestamp;

/// More than so many take-overs …
const TOLERATED: usize = 5;
/// … within such a time are a war …
const WINDOW: Duration = Duration::from_secs(10);
/// … and then there are none for so long.
const TRUCE: Duration = Duration::from_secs(10);

/// The latest take-overs of primary control.
#[derive(Clone, Debug, Default)]
pub(super) struct Damping {
    takeovers: VecDeque<Timestamp>,
    truce_until: Option<Timestamp>,
}

impl Damping {
    /// Whether there may be a take-over now.
    pub(super) fn check(&self, now: Timestamp) -> Result<(), Refusal> {
        if self.is_truce(now) { Err(Refusal::denied("acquire_war")) } else { Ok(()) }
    }

    pub(super) fn is_truce(&self, now: Timestamp) -> bool {
        self.truce_until.is_some_and(|until| now < until)
    }

    /// There was a take-over.
    pub(super) fn note(&mut self, now: Timestamp) {
        self.takeovers.retain(|at| now.since(*at) < WINDOW);
        self.takeovers.push_back(now);
        if self.takeovers.len() > TOLERATED {
            self.takeovers.clear();
            self.truce_until = Some(now + TRUCE);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// "After more than 5 take-overs of primary … within 10 s, further take-overs are DENIED for 10 s."
    #[test]
    fn the_sixth_take_over_within_ten_seconds_is_the_last_for_ten() {
        let mut damping = Damping::default();
        let refused = Err(Refusal::denied("acquire_war"));
        for secs in [0, 1, 2, 3, 4] {
            damping.note(Timestamp::from_secs(secs));
        }
        // Each time the first is ten seconds ago, so that there are five again.
        for secs in [10, 11, 12] {
            assert_eq!(damping.check(Timestamp::from_secs(secs)), Ok(()));
            damping.note(Timestamp::from_secs(secs));
        }
        assert_eq!(damping.check(Timestamp::from_millis(12_500)), Ok(()));
        damping.note(Timestamp::from_millis(12_500));
        assert_eq!(damping.check(Timestamp::from_millis(12_500)), refused);
        assert_eq!(damping.check(Timestamp::from_micros(22_499_999)), refused);
        assert_eq!(damping.check(Timestamp::from_millis(22_500)), Ok(()));
        damping.note(Timestamp::from_millis(22_500));
        assert_eq!(damping.check(Timestamp::from_millis(22_500)), Ok(()), "it begins anew");
    }
}
