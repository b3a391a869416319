//! Messages that the autopilot does not send unasked, and that we or the gimbal need.
//!
//! `SET_MESSAGE_INTERVAL` (511) for each one that is missing while the autopilot is alive, until it comes or is refused.

use std::time::Duration;

use crate::gimbals::CommandOutcome;
use crate::timestamp::Timestamp;
use crate::wire::ids::{CommandResult, message};

/// A message not seen for so long is missing.
const MISSING_AFTER: Duration = Duration::from_secs(2);

/// It is asked for at most so often.
const ASK_EVERY: Duration = Duration::from_secs(5);

/// A message we want, and how often.
#[derive(Clone, Copy, Debug)]
struct Wanted {
    message_id: u32,
    interval: Duration,
    seen: Option<Timestamp>,
    asked: Option<Timestamp>,
    refused: bool,
    needed: bool,
}

/// What we want of the autopilot.
#[derive(Debug)]
pub struct AutopilotStreams {
    wanted: [Wanted; 3],
    since: Option<Timestamp>,
}

impl Default for AutopilotStreams {
    fn default() -> Self {
        let wanted = |message_id, millis| Wanted {
            message_id,
            interval: Duration::from_millis(millis),
            seen: None,
            asked: None,
            refused: false,
            needed: false,
        };
        Self {
            wanted: [
                wanted(message::AUTOPILOT_STATE_FOR_GIMBAL_DEVICE, 40),
                wanted(message::ATTITUDE, 100),
                wanted(message::GLOBAL_POSITION_INT, 200),
            ],
            since: None,
        }
    }
}

impl AutopilotStreams {
    /// The autopilot is there, for the first time or again: what it refused before it may now do.
    pub fn handle_autopilot_found(&mut self, now: Timestamp) {
        self.since = Some(now);
        for wanted in &mut self.wanted {
            wanted.seen = None;
            wanted.asked = None;
            wanted.refused = false;
        }
    }

    /// Whether there is somebody to ask.
    pub fn has_autopilot(&self) -> bool {
        self.since.is_some()
    }

    pub fn handle_autopilot_lost(&mut self) {
        self.since = None;
    }

    /// The autopilot sent `message_id`.
    pub fn handle_seen(&mut self, now: Timestamp, message_id: u32) {
        if let Some(wanted) = self.find(message_id) {
            wanted.seen = Some(now);
        }
    }

    /// Whether the message is of use to anybody here.
    pub fn set_needed(&mut self, message_id: u32, needed: bool) {
        if let Some(wanted) = self.find(message_id) {
            wanted.needed = needed;
        }
    }

    /// What became of our request for `message_id`.
    pub fn handle_outcome(&mut self, message_id: u32, outcome: CommandOutcome) {
        const REFUSALS: [u8; 3] =
            [CommandResult::Denied as u8, CommandResult::Unsupported as u8, CommandResult::Failed as u8];
        if let Some(wanted) = self.find(message_id)
            && matches!(outcome, CommandOutcome::Answered(result) if REFUSALS.contains(&result))
        {
            wanted.refused = true;
        }
    }

    pub fn poll_timeout(&self) -> Option<Timestamp> {
        let since = self.since?;
        let due = self.wanted.iter().filter(|wanted| wanted.needed && !wanted.refused).map(|wanted| wanted.due(since));
        due.min()
    }

    /// A message to ask for at `now`, with its interval; the next one when this request is done with.
    pub fn take_due(&mut self, now: Timestamp) -> Option<(u32, Duration)> {
        let since = self.since?;
        let wanted =
            self.wanted.iter_mut().find(|wanted| wanted.needed && !wanted.refused && wanted.due(since) <= now)?;
        wanted.asked = Some(now);
        Some((wanted.message_id, wanted.interval))
    }

    fn find(&mut self, message_id: u32) -> Option<&mut Wanted> {
        self.wanted.iter_mut().find(|wanted| wanted.message_id == message_id)
    }
}

impl Wanted {
    fn due(&self, since: Timestamp) -> Timestamp {
        let missing = self.seen.unwrap_or(since) + MISSING_AFTER;
        self.asked.map_or(missing, |asked| missing.max(asked + ASK_EVERY))
    }
}
