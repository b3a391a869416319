//! Messages that a simulated peer sends at intervals of their own.

use std::time::Duration;

use crate::timestamp::Timestamp;

/// The shortest interval that may be asked for.
const SHORTEST: Duration = Duration::from_millis(10);

#[derive(Clone, Copy, Debug)]
struct Stream {
    message_id: u32,
    usual: Option<Duration>,
    interval: Option<Duration>,
    next: Timestamp,
}

/// The streams of one peer, each message id once.
#[derive(Clone, Debug, Default)]
pub struct Streams(Vec<Stream>);

impl Streams {
    /// Adds a message that is sent every `usual` interval from `start`, or only on request when it is `None`.
    pub fn add(&mut self, message_id: u32, usual: Option<Duration>, start: Timestamp) {
        self.0.push(Stream { message_id, usual, interval: usual, next: start });
    }

    pub fn contains(&self, message_id: u32) -> bool {
        self.0.iter().any(|stream| stream.message_id == message_id)
    }

    /// `MAV_CMD_SET_MESSAGE_INTERVAL`: microseconds, 0 for the usual rate, -1 to stop. False for a message that is
    /// not streamed here or an interval that is none.
    pub fn set_interval(&mut self, now: Timestamp, message_id: u32, interval_us: f64) -> bool {
        let Some(stream) = self.0.iter_mut().find(|stream| stream.message_id == message_id) else { return false };
        stream.interval = match interval_us {
            0.0 => stream.usual,
            -1.0 => None,
            us if us > 0.0 => Some(Duration::from_micros(us as u64).max(SHORTEST)),
            _ => return false,
        };
        stream.next = now + stream.interval.unwrap_or_default();
        true
    }

    /// Changes the usual interval, and with it the interval in use if nobody asked for another.
    pub fn set_usual(&mut self, now: Timestamp, message_id: u32, usual: Duration) {
        let Some(stream) = self.0.iter_mut().find(|stream| stream.message_id == message_id) else { return };
        if stream.interval == stream.usual {
            stream.interval = Some(usual);
            stream.next = stream.next.min(now + usual);
        }
        stream.usual = Some(usual);
    }

    /// What `MESSAGE_INTERVAL` says of a message: microseconds, -1 when it is not sent, 0 when it is not known.
    pub fn interval_us(&self, message_id: u32) -> i32 {
        match self.0.iter().find(|stream| stream.message_id == message_id) {
            None => 0,
            Some(Stream { interval: None, .. }) => -1,
            Some(Stream { interval: Some(interval), .. }) => i32::try_from(interval.as_micros()).unwrap_or(i32::MAX),
        }
    }

    /// The next message that is due, at most one after a pause.
    pub fn pop_due(&mut self, now: Timestamp) -> Option<u32> {
        let (interval, stream) = self
            .0
            .iter_mut()
            .filter_map(|stream| Some((stream.interval?, stream)))
            .filter(|(_, stream)| stream.next <= now)
            .min_by_key(|(_, stream)| stream.next)?;
        stream.next += interval;
        if stream.next <= now {
            stream.next = now + interval;
        }
        Some(stream.message_id)
    }

    pub fn poll_timeout(&self) -> Option<Timestamp> {
        self.0.iter().filter(|stream| stream.interval.is_some()).map(|stream| stream.next).min()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// "The interval between two messages. -1: disable, 0: request default rate" (`MAV_CMD_SET_MESSAGE_INTERVAL`).
    #[test]
    fn intervals_follow_the_request() {
        let start = Timestamp::ZERO;
        let mut streams = Streams::default();
        streams.add(30, Some(Duration::from_millis(20)), start);
        streams.add(286, None, start);

        assert_eq!(streams.interval_us(30), 20_000);
        assert_eq!(streams.interval_us(286), -1);
        assert_eq!(streams.interval_us(31), 0);
        assert!(streams.set_interval(start, 286, 100_000.0));
        assert!(streams.set_interval(start, 30, -1.0));
        assert!(!streams.set_interval(start, 31, 100_000.0));
        assert!(!streams.set_interval(start, 286, f64::NAN));
        assert_eq!(streams.interval_us(286), 100_000);
        assert_eq!(streams.interval_us(30), -1);

        assert_eq!(streams.poll_timeout(), Some(Timestamp::from_millis(100)));
        assert_eq!(streams.pop_due(Timestamp::from_millis(99)), None);
        assert_eq!(streams.pop_due(Timestamp::from_millis(100)), Some(286));
        assert!(streams.set_interval(Timestamp::from_millis(100), 30, 0.0));
        assert_eq!(streams.pop_due(Timestamp::from_millis(120)), Some(30));
        assert_eq!(streams.pop_due(Timestamp::from_millis(120)), None);
    }

    #[test]
    fn a_pause_is_not_made_up_for() {
        let mut streams = Streams::default();
        streams.add(0, Some(Duration::from_secs(1)), Timestamp::ZERO);

        assert_eq!(streams.pop_due(Timestamp::from_secs(10)), Some(0));
        assert_eq!(streams.pop_due(Timestamp::from_secs(10)), None);
        assert_eq!(streams.poll_timeout(), Some(Timestamp::from_secs(11)));
    }
}
