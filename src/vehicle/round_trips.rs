//! How long a message of the autopilot takes to get here, at best.
//!
//! One-way time stamps tell only how much longer one message takes than another. `TIMESYNC` goes there and back: half of
//! the fastest round trip is taken for the way of the fastest message.

use std::time::Duration;

use crate::timestamp::Timestamp;
use crate::wire::dialect::TIMESYNC_DATA;

/// The first requests follow each other closely, …
const FIRST: u32 = 5;
const FIRST_EVERY: Duration = Duration::from_millis(200);
/// … later ones see to it that a link that has changed is noticed.
const EVERY: Duration = Duration::from_secs(5);

/// What is not answered within this, nobody answers.
const ANSWERED_WITHIN: Duration = Duration::from_secs(1);

/// The fastest round trip counts for one to two such spans.
const SPAN: Duration = Duration::from_secs(30);

/// Measures round trips.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct RoundTrips {
    /// `ts1` of the latest request, and when it was sent.
    sent: Option<(i64, Timestamp)>,
    requests: u32,
    next: Timestamp,
    /// The fastest of this span and of the one before.
    fastest: [Option<Duration>; 2],
    span_began: Timestamp,
}

impl RoundTrips {
    /// When the next request is due.
    pub fn due(&self) -> Timestamp {
        self.next
    }

    /// A request to everybody, to be sent at once.
    pub fn request(&mut self, now: Timestamp) -> TIMESYNC_DATA {
        // Nanoseconds of our time, and in the digits below microseconds a number that tells ours from others'.
        let ts1 = i64::try_from(now.as_micros()).unwrap_or(0) * 1_000 + i64::from(self.requests % 900) + 99;
        self.requests = self.requests.saturating_add(1);
        self.sent = Some((ts1, now));
        self.next = now + if self.requests < FIRST { FIRST_EVERY } else { EVERY };
        TIMESYNC_DATA { tc1: 0, ts1, target_system: 0, target_component: 0 }
    }

    /// Takes an answer of the autopilot, maybe to somebody else's request.
    pub fn handle_timesync(&mut self, now: Timestamp, message: &TIMESYNC_DATA) {
        let Some((_, sent)) = self.sent.filter(|(ts1, _)| message.tc1 != 0 && *ts1 == message.ts1) else { return };
        self.sent = None;
        let took = now.since(sent);
        if took > ANSWERED_WITHIN {
            return;
        }
        if now.since(self.span_began) >= SPAN {
            self.fastest = [None, self.fastest[0]];
            self.span_began = now;
        }
        self.fastest[0] = Some(self.fastest[0].map_or(took, |fastest| fastest.min(took)));
    }

    /// The time that the fastest message takes, `None` while no request was answered.
    pub fn one_way(&self) -> Option<Duration> {
        self.fastest.into_iter().flatten().min().map(|round_trip| round_trip / 2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(millis: u64) -> Timestamp {
        Timestamp::from_millis(millis)
    }

    fn answer(request: &TIMESYNC_DATA) -> TIMESYNC_DATA {
        TIMESYNC_DATA { tc1: 77, ..request.clone() }
    }

    #[test]
    fn one_way_is_half_of_the_fastest_round_trip() {
        let mut trips = RoundTrips::default();
        assert_eq!(trips.one_way(), None);
        for (sent, took, expected) in [(1_000, 30, 15), (2_000, 10, 5), (3_000, 50, 5), (4_000, 1_001, 5)] {
            let request = trips.request(at(sent));
            trips.handle_timesync(at(sent + took), &answer(&request));
            assert_eq!(trips.one_way(), Some(Duration::from_millis(expected)), "sent at {sent}");
        }
    }

    /// "tc1: … 0 is a request": nothing but the autopilot's answer to the latest request of ours counts, once.
    #[test]
    fn others_requests_and_answers_do_not_count() {
        let mut trips = RoundTrips::default();
        let old = trips.request(at(1_000));
        let request = trips.request(at(1_200));
        for other in [
            request.clone(),
            answer(&old),
            TIMESYNC_DATA { ts1: request.ts1 + 1, ..answer(&request) },
            TIMESYNC_DATA { ts1: 0, ..answer(&request) },
        ] {
            trips.handle_timesync(at(1_300), &other);
            assert_eq!(trips.one_way(), None, "{other:?}");
        }
        trips.handle_timesync(at(1_300), &answer(&request));
        trips.handle_timesync(at(1_301), &answer(&request));
        assert_eq!(trips.one_way(), Some(Duration::from_millis(50)));
    }

    #[test]
    fn a_link_that_has_become_slow_is_noticed() {
        let mut trips = RoundTrips::default();
        let mut asked = 0;
        for second in 0..180 {
            while trips.due() <= at(second * 1_000) {
                let request = trips.request(at(second * 1_000));
                asked += 1;
                trips.handle_timesync(at(second * 1_000 + if second < 60 { 10 } else { 80 }), &answer(&request));
            }
        }
        assert_eq!(trips.one_way(), Some(Duration::from_millis(40)));
        assert!(asked <= 5 + 180 / 5, "{asked}");
    }
}
