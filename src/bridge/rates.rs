//! R19: how often one channel of a narrow link gets a message.
//!
//! What others send too often is dropped: it comes again. Of our own messages the newest is kept back until its turn
//! comes, because some are sent on a change only, and the last word must not be lost.

use std::time::Duration;

use crate::timestamp::Timestamp;
use crate::wire::MavId;

/// So many pairs of message and source are told apart on one channel.
const MAX_ENTRIES: usize = 256;

/// When each message of each source may pass next.
#[derive(Debug, Default)]
pub struct RateLimits {
    entries: Vec<Entry>,
}

#[derive(Debug)]
struct Entry {
    message_id: u32,
    source: MavId,
    next: Timestamp,
    held: Option<Box<[u8]>>,
}

impl RateLimits {
    /// Whether a message may pass now that must not come more often than once an `interval`; if so, it counts as sent,
    /// and an older one that was kept back is forgotten.
    pub fn admit(&mut self, now: Timestamp, interval: Duration, message_id: u32, source: MavId) -> bool {
        let Some(entry) = self.entry(message_id, source) else {
            self.make_room();
            self.entries.push(Entry { message_id, source, next: now + interval, held: None });
            return true;
        };
        if entry.next > now {
            return false;
        }
        // A message a little late must not shift those behind it.
        let late = now.since(entry.next);
        entry.next = if late < interval / 2 { entry.next + interval } else { now + interval };
        entry.held = None;
        true
    }

    /// Keeps a frame that was not admitted; true when it takes the place of an older one, which is lost.
    pub fn hold(&mut self, message_id: u32, source: MavId, frame: &[u8]) -> bool {
        let entry = self.entry(message_id, source);
        entry.is_some_and(|entry| entry.held.replace(frame.into()).is_some())
    }

    /// A frame whose turn has come, to be sent by way of [`admit`](Self::admit).
    pub fn take_due(&mut self, now: Timestamp) -> Option<Box<[u8]>> {
        self.entries.iter_mut().filter(|entry| entry.next <= now).find_map(|entry| entry.held.take())
    }

    /// When the turn of a frame comes that was kept back.
    pub fn poll_timeout(&self) -> Option<Timestamp> {
        self.entries.iter().filter(|entry| entry.held.is_some()).map(|entry| entry.next).min()
    }

    /// Forgets what was kept back.
    pub fn forget_held(&mut self) {
        for entry in &mut self.entries {
            entry.held = None;
        }
    }

    fn entry(&mut self, message_id: u32, source: MavId) -> Option<&mut Entry> {
        self.entries.iter_mut().find(|entry| entry.message_id == message_id && entry.source == source)
    }

    /// The longest-silent sender makes room, who would be admitted anyway.
    fn make_room(&mut self) {
        if self.entries.len() < MAX_ENTRIES {
            return;
        }
        if let Some(oldest) = (0..self.entries.len()).min_by_key(|at| self.entries[*at].next) {
            self.entries.swap_remove(oldest);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STATUS: u32 = 281;
    const US: MavId = MavId::new(1, 191);
    const INTERVAL: Duration = Duration::from_secs(1);

    #[test]
    fn the_newest_frame_that_came_too_soon_has_its_turn() {
        let mut limits = RateLimits::default();
        assert!(limits.admit(millis(0), INTERVAL, STATUS, US));
        for (at, frame, replaces) in [(100, [1], false), (900, [2], true)] {
            assert!(!limits.admit(millis(at), INTERVAL, STATUS, US));
            assert_eq!(limits.hold(STATUS, US, &frame), replaces);
        }

        assert_eq!((limits.poll_timeout(), limits.take_due(millis(999))), (Some(millis(1_000)), None));
        assert_eq!(limits.take_due(millis(1_000)).as_deref(), Some(&[2][..]));
        assert!(limits.admit(millis(1_000), INTERVAL, STATUS, US));
        assert_eq!((limits.poll_timeout(), limits.take_due(millis(5_000))), (None, None));
    }

    #[test]
    fn one_that_was_kept_back_is_not_sent_behind_a_newer_one() {
        let mut limits = RateLimits::default();
        assert!(limits.admit(millis(0), INTERVAL, STATUS, US));
        assert!(!limits.hold(STATUS, US, &[1]));

        assert!(limits.admit(millis(1_000), INTERVAL, STATUS, US));

        assert_eq!((limits.poll_timeout(), limits.take_due(millis(5_000))), (None, None));
    }

    #[test]
    fn a_flood_of_sources_takes_a_bounded_room() {
        let mut limits = RateLimits::default();
        for number in 0..1_000_u32 {
            let source = MavId::new(1 + (number >> 8) as u8, number as u8);
            assert!(limits.admit(millis(u64::from(number)), INTERVAL, STATUS, source));
        }
        assert_eq!(limits.entries.len(), MAX_ENTRIES);
    }

    fn millis(millis: u64) -> Timestamp {
        Timestamp::from_millis(millis)
    }
}
