//! Who may take a place from a holder that lives and has not released it.
//!
//! The Gimbal Protocol v2 leaves it to politeness ("open"); the other policies are ours. A place that nobody holds, or
//! whose holder was silent for the lease, is free under each, but for the secondary place beside a primary, which is that
//! one's; and a holder gives its own place to whom it likes.

use super::super::rank::Rank;
use super::super::request::Refusal;
use crate::gimbals::settings::Takeover;

/// What somebody is about to do to a place that another holds, or has at its disposal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Attempt {
    pub(super) taker: Rank,
    pub(super) holder: Rank,
    /// The autopilot of our system takes primary control for itself, to give it back afterwards.
    pub(super) borrows: bool,
    /// The taker had the place until the autopilot borrowed it, and has not released it.
    pub(super) takes_back: bool,
}

/// Whether it may.
pub(super) fn check(policy: Takeover, attempt: Attempt) -> Result<(), Refusal> {
    let (allowed, reason) = match policy {
        Takeover::Open => (true, ""),
        // Who lent its place was not asked for it, and so need not ask for it back.
        Takeover::Ask => (attempt.borrows || attempt.takes_back, "holder_must_release"),
        Takeover::Priority => (attempt.taker > attempt.holder, "holder_ranks_no_lower"),
        Takeover::Exclusive => (false, "exclusively_held"),
    };
    if allowed { Ok(()) } else { Err(Refusal::denied(reason)) }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `takeover`: "open: anyone takes", "ask: another's CONFIGURE is DENIED … the own autopilot's borrow is still
    /// allowed", "priority: only a sender of higher rank", "exclusive: nobody, not even the autopilot may borrow".
    #[test]
    #[rustfmt::skip]
    fn each_policy_has_its_rule() {
        use Rank::{Autopilot, GroundStation, OnBoard, Stranger};
        const OPEN: Takeover = Takeover::Open;
        const ASK: Takeover = Takeover::Ask;
        const PRIORITY: Takeover = Takeover::Priority;
        const EXCLUSIVE: Takeover = Takeover::Exclusive;
        for (policy,   taker,         holder,        borrows, takes_back, refused) in [
            (OPEN,      Stranger,      GroundStation, false,   false,      None),
            (ASK,       GroundStation, Stranger,      false,   false,      Some("holder_must_release")),
            (ASK,       Autopilot,     GroundStation, false,   false,      Some("holder_must_release")),
            (ASK,       Autopilot,     GroundStation, true,    false,      None),
            (ASK,       Stranger,      Autopilot,     false,   true,       None),
            (PRIORITY,  GroundStation, Autopilot,     false,   false,      None),
            (PRIORITY,  Autopilot,     OnBoard,       true,    false,      None),
            (PRIORITY,  OnBoard,       Stranger,      false,   false,      None),
            (PRIORITY,  GroundStation, GroundStation, false,   false,      Some("holder_ranks_no_lower")),
            (PRIORITY,  Autopilot,     GroundStation, true,    false,      Some("holder_ranks_no_lower")),
            (PRIORITY,  OnBoard,       Autopilot,     false,   true,       Some("holder_ranks_no_lower")),
            (EXCLUSIVE, GroundStation, Stranger,      false,   false,      Some("exclusively_held")),
            (EXCLUSIVE, Autopilot,     Stranger,      true,    false,      Some("exclusively_held")),
        ] {
            let attempt = Attempt { taker, holder, borrows, takes_back };
            let result = check(policy, attempt);
            assert_eq!(result, refused.map_or(Ok(()), |reason| Err(Refusal::denied(reason))), "{policy:?} {attempt:?}");
        }
    }
}
