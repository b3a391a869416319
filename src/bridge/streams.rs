//! Messages that the autopilot does not send unasked, or not often enough, and that we or the gimbal need.
//!
//! `SET_MESSAGE_INTERVAL` (511) for each one that is missing while the autopilot is alive, until it comes or is refused.
//! Autopilots from before that command know groups of messages: where it is refused or ignored, `REQUEST_DATA_STREAM` (66)
//! for the group.

use std::time::Duration;

use super::transactions;
use crate::gimbals::CommandOutcome;
use crate::timestamp::Timestamp;
use crate::wire::ids::{CommandResult, mav_data_stream, message};

/// A message not seen for so long is missing.
const MISSING_AFTER: Duration = Duration::from_secs(2);

/// It is asked for at most so often.
const ASK_EVERY: Duration = Duration::from_secs(5);

/// A message that was asked for so often, copies of a request counted, does not come.
const IGNORED_AFTER: u8 = transactions::TRIES;

/// One that comes is asked for at most so often to come faster.
const FASTER_REQUESTS: u8 = 3;

/// The messages that we ask for, in the order in which we do.
const WANTED: [u32; 9] = [
    message::AUTOPILOT_STATE_FOR_GIMBAL_DEVICE,
    message::ATTITUDE_QUATERNION,
    message::ATTITUDE,
    message::GLOBAL_POSITION_INT,
    message::LOCAL_POSITION_NED,
    message::EXTENDED_SYS_STATE,
    message::ESTIMATOR_STATUS,
    message::EKF_STATUS_REPORT,
    message::ATTITUDE_TARGET,
];

/// How much of a message somebody here needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Need {
    None,
    /// It is asked for at this interval when it does not come at all; whoever set another has his reasons.
    Some(Duration),
    /// It is asked for at this interval when it comes more slowly.
    AtLeast(Duration),
}

/// How a message is asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ask {
    /// 511, which is answered.
    MessageInterval { message_id: u32, interval: Duration },
    /// 66, which is not: a group (`MAV_DATA_STREAM`) and messages per second.
    DataStream { group: u8, rate_hz: u16 },
}

/// By which of the two a message is asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Way {
    MessageInterval,
    /// In turn: the autopilot ignores the command, or the way to it loses much.
    Either {
        data_stream_next: bool,
    },
    /// It refused the command.
    DataStream,
}

/// A message, and what became of asking for it.
#[derive(Clone, Copy, Debug)]
struct Wanted {
    message_id: u32,
    need: Need,
    seen: Option<Timestamp>,
    /// The time from one to the next, smoothed.
    spacing: Option<Duration>,
    asked: Option<Timestamp>,
    /// How often it was asked for since it last came.
    tries: u8,
    faster_requests: u8,
    refused: bool,
    way: Way,
}

/// What we want of the autopilot.
#[derive(Debug)]
pub struct AutopilotStreams {
    wanted: [Wanted; WANTED.len()],
    since: Option<Timestamp>,
}

impl Default for AutopilotStreams {
    fn default() -> Self {
        Self { wanted: WANTED.map(Wanted::new), since: None }
    }
}

impl AutopilotStreams {
    /// The autopilot is there, for the first time or again: what it refused before it may now do.
    pub fn handle_autopilot_found(&mut self, now: Timestamp) {
        self.since = Some(now);
        for wanted in &mut self.wanted {
            *wanted = Wanted { need: wanted.need, ..Wanted::new(wanted.message_id) };
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
        if let Some(wanted) = self.find_mut(message_id) {
            let spacing = wanted.seen.map(|seen| now.since(seen));
            wanted.spacing = match (wanted.spacing, spacing) {
                (Some(smoothed), Some(spacing)) => Some((smoothed * 3 + spacing) / 4),
                (_, spacing) => spacing,
            };
            wanted.seen = Some(now);
            wanted.tries = 0;
            wanted.refused = false;
        }
    }

    /// How much of the message is of use to anybody here.
    pub fn set_need(&mut self, message_id: u32, need: Need) {
        if let Some(wanted) = self.find_mut(message_id) {
            wanted.need = need;
        }
    }

    /// What became of our request for `message_id`.
    pub fn handle_outcome(&mut self, message_id: u32, outcome: CommandOutcome) {
        const REFUSALS: [u8; 3] =
            [CommandResult::Denied as u8, CommandResult::Unsupported as u8, CommandResult::Failed as u8];
        let Some(wanted) = self.find_mut(message_id) else { return };
        match outcome {
            CommandOutcome::Answered(result) => {
                wanted.refused |= REFUSALS.contains(&result);
                wanted.tries = wanted.tries.saturating_add(1);
            }
            CommandOutcome::GivenUp => {}
            CommandOutcome::Unanswered => wanted.tries = wanted.tries.saturating_add(transactions::TRIES),
        }
        if wanted.group().is_some() {
            if wanted.refused {
                wanted.way = Way::DataStream;
            } else if wanted.way == Way::MessageInterval && wanted.tries >= IGNORED_AFTER {
                wanted.way = Way::Either { data_stream_next: true };
            }
        }
    }

    /// Whether `message_id` was asked for and will not come: "the request was refused or ignored three times".
    pub fn will_not_come(&self, now: Timestamp, message_id: u32) -> bool {
        let Some(wanted) = self.find(message_id) else { return false };
        // Who accepts may need a moment to begin.
        let waited = wanted.asked.is_none_or(|asked| now.since(asked) >= MISSING_AFTER);
        wanted.refused || (wanted.tries >= IGNORED_AFTER && waited)
    }

    /// Whether `message_id` comes about as often as every `interval`.
    pub fn comes_every(&self, now: Timestamp, message_id: u32, interval: Duration) -> bool {
        self.find(message_id).is_some_and(|wanted| wanted.is_there(now) && !wanted.is_slower_than(interval))
    }

    pub fn poll_timeout(&self) -> Option<Timestamp> {
        let since = self.since?;
        self.wanted.iter().filter_map(|wanted| wanted.due(since)).min()
    }

    /// What to ask for at `now`; the next one when this request is done with.
    pub fn take_due(&mut self, now: Timestamp) -> Option<Ask> {
        let since = self.since?;
        let wanted = self.wanted.iter_mut().find(|wanted| wanted.due(since).is_some_and(|due| due <= now))?;
        let (Need::Some(interval) | Need::AtLeast(interval)) = wanted.need else { return None };
        if wanted.is_there(now) {
            wanted.faster_requests += 1;
        }
        wanted.asked = Some(now);
        Some(wanted.ask(interval))
    }

    /// Asks for more of a message than was set, if that is less.
    pub fn raise_need(&mut self, message_id: u32, interval: Duration) {
        let Some(wanted) = self.find_mut(message_id) else { return };
        wanted.need = match wanted.need {
            Need::AtLeast(known) => Need::AtLeast(known.min(interval)),
            // What does not come at all is asked for as often as anybody needs it.
            Need::Some(known) if wanted.seen.is_none() => Need::AtLeast(known.min(interval)),
            Need::None | Need::Some(_) => Need::AtLeast(interval),
        };
    }

    fn find(&self, message_id: u32) -> Option<&Wanted> {
        self.wanted.iter().find(|wanted| wanted.message_id == message_id)
    }

    fn find_mut(&mut self, message_id: u32) -> Option<&mut Wanted> {
        self.wanted.iter_mut().find(|wanted| wanted.message_id == message_id)
    }
}

impl Wanted {
    const fn new(message_id: u32) -> Self {
        Self {
            message_id,
            need: Need::None,
            seen: None,
            spacing: None,
            asked: None,
            tries: 0,
            faster_requests: 0,
            refused: false,
            way: Way::MessageInterval,
        }
    }

    /// The group (`MAV_DATA_STREAM`) in which autopilots of before 511 send it.
    const fn group(&self) -> Option<u8> {
        match self.message_id {
            message::ATTITUDE => Some(mav_data_stream::EXTRA1),
            message::GLOBAL_POSITION_INT => Some(mav_data_stream::POSITION),
            _ => None,
        }
    }

    fn ask(&mut self, interval: Duration) -> Ask {
        let by_group = match &mut self.way {
            Way::MessageInterval => false,
            Way::Either { data_stream_next } => std::mem::replace(data_stream_next, !*data_stream_next),
            Way::DataStream => true,
        };
        match self.group().filter(|_| by_group) {
            Some(group) => Ask::DataStream { group, rate_hz: (1.0 / interval.as_secs_f64()).round().max(1.0) as u16 },
            None => Ask::MessageInterval { message_id: self.message_id, interval },
        }
    }

    fn due(&self, since: Timestamp) -> Option<Timestamp> {
        if self.refused && self.way != Way::DataStream {
            return None;
        }
        let missing = self.seen.unwrap_or(since) + MISSING_AFTER;
        let due = match self.need {
            Need::None => return None,
            // It comes, but too slowly: there is nothing to wait for.
            Need::AtLeast(interval) if self.is_slower_than(interval) && self.faster_requests < FASTER_REQUESTS => since,
            Need::Some(_) | Need::AtLeast(_) => missing,
        };
        Some(self.asked.map_or(due, |asked| due.max(asked + ASK_EVERY)))
    }

    fn is_there(&self, now: Timestamp) -> bool {
        self.seen.is_some_and(|seen| now.since(seen) < MISSING_AFTER)
    }

    /// By half or more: an interval in whole ticks of the sender is not met exactly.
    fn is_slower_than(&self, interval: Duration) -> bool {
        self.spacing.is_some_and(|spacing| spacing > interval * 3 / 2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `REQUEST_DATA_STREAM.req_message_rate`: "The requested message rate" in whole messages per second. A group is asked for
    /// about as often as its message is needed, and once a second at least: at a rate of 0 it would end.
    #[test]
    fn a_group_is_asked_for_about_as_often_as_its_message_is_needed() {
        for (interval_ms, rate_hz) in [(20, 50), (61, 16), (100, 10), (500, 2), (1_000, 1), (3_000, 1)] {
            let mut streams = AutopilotStreams::default();
            streams.handle_autopilot_found(Timestamp::ZERO);
            streams.set_need(message::ATTITUDE, Need::AtLeast(Duration::from_millis(interval_ms)));
            let refused = CommandOutcome::Answered(CommandResult::Unsupported as u8);
            streams.handle_outcome(message::ATTITUDE, refused);

            let asked = streams.take_due(Timestamp::from_secs(2));

            assert_eq!(asked, Some(Ask::DataStream { group: mav_data_stream::EXTRA1, rate_hz }), "{interval_ms} ms");
        }
    }
}
