//! The autopilot's clock, as the time stamps of its messages tell it.
//!
//! A stamp of 32 bits wraps, after 49.7 days in milliseconds and after 71.6 minutes in microseconds; the time made of
//! them here does not. What comes later than the fastest message lately is late by the difference: how much longer it
//! was measured, queued and sent before it got here. The part that all messages have in common cannot be told from
//! stamps alone, see [`round_trips`](super::round_trips).

use std::time::Duration;

use crate::timestamp::Timestamp;

/// A time since the start of the sender, as a message carries it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stamp {
    Millis(u32),
    /// Some senders fill all 64 bits, others only the lower half.
    Micros(u64),
}

/// The fastest message counts for one to two such spans: as clocks drift apart by some hundred parts in a million, an
/// older comparison would be off by milliseconds.
const SPAN: Duration = Duration::from_secs(10);

/// A clock that jumps back further was started anew.
const STEP_BACK_US: i64 = 1_000_000;

/// A stamp this far ahead of its time, and one in a thousand of the time it was not heard for, is from another clock, …
const STEP_AHEAD_US: i64 = 1_000_000;

/// … but for the message whose stamps are believed: a queue that held back all there was for long, such as that of a narrow
/// radio, and does not any more, makes it this much faster at once. Who starts again begins to count anew.
const QUEUED_US: i64 = 10_000_000;

/// The message whose stamps are believed was not heard for so long: one that agrees with it takes its place, so that it
/// is one that comes often …
const REFERENCE_SELDOM: Duration = Duration::from_millis(200);

/// … and after so long one that does not.
const REFERENCE_SILENT: Duration = Duration::from_secs(2);

/// One sender's clock beside ours.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BootClock {
    track: Option<Track>,
    restarts: u32,
}

#[derive(Clone, Debug, PartialEq)]
struct Track {
    /// The message id whose stamps are believed: not every sender stamps all its messages by one clock.
    reference: u32,
    stamp: Stamp,
    heard: Timestamp,
    /// The latest time that was told, microseconds since the sender's start.
    told_us: i64,
    /// Our time less the sender's, microseconds: the least of this span and of the one before.
    least: [i64; 2],
    span_began: Timestamp,
}

impl BootClock {
    /// Takes the stamp of a message; how late the message came, `None` where its stamp tells nothing.
    pub fn handle_stamp(&mut self, now: Timestamp, message_id: u32, stamp: Stamp) -> Option<Duration> {
        let raw = match stamp {
            Stamp::Millis(millis) => u64::from(millis),
            Stamp::Micros(micros) => micros,
        };
        // Zero is what a sender leaves that does not fill the field in, unless the count has just wrapped.
        if raw == 0 && !self.track.as_ref().is_some_and(|track| track.has_wrapped(now, stamp)) {
            return None;
        }
        let Some(track) = &mut self.track else {
            // A wrapped count tells no time by itself.
            if matches!(stamp, Stamp::Millis(_)) {
                self.track = Some(Track::new(now, message_id, stamp));
            }
            return None;
        };
        let is_reference = track.reference == message_id;
        // Nor does one tell anything that never changes.
        if is_reference && track.stamp == stamp {
            return None;
        }
        let told_us = stamp.nearest_to(track.time_at(now));
        let is_believed = is_reference || now.since(track.heard) > REFERENCE_SILENT;
        if track.agrees(now, told_us, if is_believed { QUEUED_US } else { STEP_AHEAD_US }) {
            if is_reference || now.since(track.heard) > REFERENCE_SELDOM {
                (track.reference, track.stamp, track.heard) = (message_id, stamp, now);
            }
            return Some(track.take(now, told_us));
        }
        if is_believed && matches!(stamp, Stamp::Millis(_)) {
            self.track = Some(Track::new(now, message_id, stamp));
            self.restarts += 1;
        }
        None
    }

    /// The sender's time in microseconds since its start, `None` until it told one.
    pub fn time_us(&self, now: Timestamp) -> Option<u64> {
        let track = self.track.as_ref()?;
        Some(u64::try_from(track.time_at(now)).unwrap_or(0))
    }

    /// How often the sender was started anew while it was listened to.
    pub fn restarts(&self) -> u32 {
        self.restarts
    }
}

impl Track {
    fn new(now: Timestamp, reference: u32, stamp: Stamp) -> Self {
        let told_us = stamp.as_it_is();
        let difference = micros(now) - told_us;
        Self { reference, stamp, heard: now, told_us, least: [difference; 2], span_began: now }
    }

    /// The sender's time at `now`, if the fastest message took no time.
    fn time_at(&self, now: Timestamp) -> i64 {
        micros(now) - self.least[0].min(self.least[1])
    }

    /// Whether a time fits this clock: not before what was told, nor further ahead of now than `step_ahead_us`. It may lag,
    /// as what was stuck in a queue does.
    fn agrees(&self, now: Timestamp, told_us: i64, step_ahead_us: i64) -> bool {
        let unheard_us = i64::try_from(now.since(self.heard).as_micros()).unwrap_or(i64::MAX);
        let ahead = told_us - self.time_at(now);
        told_us > self.told_us - STEP_BACK_US && ahead < step_ahead_us.saturating_add(unheard_us / 1_000)
    }

    /// Whether a count is at its turn, more or less.
    fn has_wrapped(&self, now: Timestamp, zero: Stamp) -> bool {
        let told_us = zero.nearest_to(self.time_at(now));
        told_us > 0 && (self.time_at(now) - told_us).abs() < STEP_AHEAD_US
    }

    fn take(&mut self, now: Timestamp, told_us: i64) -> Duration {
        if now.since(self.span_began) >= SPAN {
            self.least = [i64::MAX, self.least[0]];
            self.span_began = now;
        }
        self.told_us = self.told_us.max(told_us);
        let difference = micros(now) - told_us;
        self.least[0] = self.least[0].min(difference);
        let late = difference - self.least[0].min(self.least[1]);
        Duration::from_micros(u64::try_from(late).unwrap_or(0))
    }
}

impl Stamp {
    fn as_it_is(self) -> i64 {
        match self {
            Self::Millis(millis) => i64::from(millis) * 1_000,
            Self::Micros(micros) => i64::try_from(micros).unwrap_or(i64::MAX),
        }
    }

    /// The time in microseconds that this stamp may mean and that lies nearest to `expected`.
    fn nearest_to(self, expected: i64) -> i64 {
        let wraps_at = match self {
            Self::Millis(_) => (1_i64 << 32) * 1_000,
            Self::Micros(micros) if micros <= u64::from(u32::MAX) => 1 << 32,
            Self::Micros(_) => return self.as_it_is(),
        };
        let turns = (expected - self.as_it_is() + wraps_at / 2).div_euclid(wraps_at);
        self.as_it_is() + turns.max(0) * wraps_at
    }
}

fn micros(now: Timestamp) -> i64 {
    i64::try_from(now.as_micros()).unwrap_or(i64::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    const ATTITUDE: u32 = 30;
    const POSITION: u32 = 33;
    const DAY_MS: u64 = 86_400_000;

    /// A sender whose stamps are milliseconds of 32 bits.
    fn millis(boot_ms: u64) -> Stamp {
        Stamp::Millis(boot_ms as u32)
    }

    fn at(ms: u64) -> Timestamp {
        Timestamp::from_millis(ms)
    }

    fn ms(ms: u64) -> Option<Duration> {
        Some(Duration::from_millis(ms))
    }

    #[test]
    fn a_message_is_late_by_what_it_took_longer_than_the_fastest() {
        let mut clock = BootClock::default();

        assert_eq!(clock.handle_stamp(at(1_000), ATTITUDE, millis(501)), None, "nothing to compare it with");
        assert_eq!(clock.handle_stamp(at(1_020), ATTITUDE, millis(521)), ms(0));
        assert_eq!(clock.handle_stamp(at(1_047), ATTITUDE, millis(541)), ms(7));
        assert_eq!(clock.handle_stamp(at(1_050), POSITION, millis(461)), ms(90), "measured a while ago");
        assert_eq!(clock.handle_stamp(at(1_060), ATTITUDE, millis(563)), ms(0), "the fastest yet");
        assert_eq!(clock.handle_stamp(at(1_080), ATTITUDE, millis(581)), ms(2));
        assert_eq!(clock.time_us(at(1_080)), Some(583_000));
        assert_eq!(clock.restarts(), 0);
    }

    /// Clocks drift apart: the fastest message counts for a while only.
    #[test]
    fn what_was_fastest_long_ago_does_not_count() {
        let mut clock = BootClock::default();
        let mut late = Vec::new();
        // The sender's clock is slow by 100 parts in a million.
        for second in 0..120_u64 {
            let stamp = millis(10_000 + second * 1_000 - second / 10);
            late.extend(clock.handle_stamp(at(1_000 * second), ATTITUDE, stamp));
        }
        assert!(late.iter().all(|late| *late <= Duration::from_millis(2)), "{late:?}");
    }

    /// "32-bit ms wrap at 49.7 days".
    #[test]
    fn milliseconds_go_on_where_the_stamp_wraps() {
        let mut clock = BootClock::default();
        // One of the stamps is 0.
        let start = (1_u64 << 32) - 100;
        clock.handle_stamp(at(0), ATTITUDE, millis(start));
        for step in 1..20 {
            assert_eq!(clock.handle_stamp(at(step * 20), ATTITUDE, millis(start + step * 20)), ms(0));
            assert_eq!(clock.time_us(at(step * 20)), Some((start + step * 20) * 1_000));
        }
        assert_eq!(clock.restarts(), 0);

        // And where it does so during a silence of days.
        let later = start + 3 * DAY_MS;
        assert_eq!(clock.handle_stamp(at(3 * DAY_MS), ATTITUDE, millis(later)), ms(0));
        assert_eq!(clock.time_us(at(3 * DAY_MS)), Some(later * 1_000));
    }

    /// "Clock in AUTOPILOT_STATE wraps at 71.6 min": a count of 32 bits in a field of 64, beside milliseconds that do not
    /// wrap; and one that fills the field.
    #[test]
    fn microseconds_go_on_where_the_stamp_wraps() {
        for fills_the_field in [false, true] {
            let mut clock = BootClock::default();
            let start_ms = (1_u64 << 32) / 1_000 - 50;
            clock.handle_stamp(at(0), ATTITUDE, millis(start_ms));
            for step in 1..10 {
                let boot_us = (start_ms + step * 20) * 1_000;
                let stamp = if fills_the_field { boot_us } else { u64::from(boot_us as u32) };
                assert_eq!(clock.handle_stamp(at(step * 20), 286, Stamp::Micros(stamp)), ms(0), "{step}");
            }
            assert_eq!(clock.restarts(), 0);
        }
    }

    #[test]
    fn a_clock_that_jumps_was_started_anew() {
        for (before, after) in [
            (90_000, 3),
            (90_000, 88_000),
            (90_000, 150_000),
            (34 * DAY_MS, 5_000),
            // Where the count is at its turn anyway; less would be no more than what a queue had held back.
            ((1 << 32) - 10, 15_000),
            (5_000, (1 << 32) - 10),
        ] {
            let mut clock = BootClock::default();
            clock.handle_stamp(at(1_000), ATTITUDE, millis(before));
            clock.handle_stamp(at(1_020), ATTITUDE, millis(before + 20));

            assert_eq!(clock.handle_stamp(at(1_040), ATTITUDE, millis(after)), None);

            assert_eq!((clock.restarts(), clock.time_us(at(1_040))), (1, Some(after * 1_000)), "{before} to {after}");
            assert_eq!(clock.handle_stamp(at(1_060), ATTITUDE, millis(after + 20)), ms(0));
            assert_eq!(clock.restarts(), 1);
        }
    }

    /// A link that stood still delivers what it held back.
    #[test]
    fn a_burst_of_old_messages_is_late_and_no_restart() {
        let mut clock = BootClock::default();
        clock.handle_stamp(at(0), ATTITUDE, millis(10_000));
        for step in 1..=50 {
            let late = clock.handle_stamp(at(5_000), ATTITUDE, millis(10_000 + step * 100));
            assert_eq!(late, ms(5_000 - step * 100));
        }
        assert_eq!(clock.restarts(), 0);
    }

    /// A radio that held back all messages equally, for longer than the fastest counts, and does not any more; also when nothing
    /// was heard in between, and whichever message comes first then.
    #[test]
    fn a_queue_that_is_gone_is_no_restart() {
        for (late, silent, first) in [(1_500, 20, ATTITUDE), (8_000, 20, ATTITUDE), (8_000, 3_000, POSITION)] {
            let mut clock = BootClock::default();
            let mut now = 0;
            while now < 25_000 {
                now += 20;
                clock.handle_stamp(at(now), ATTITUDE, millis(100_000 + now - late));
                clock.handle_stamp(at(now), POSITION, millis(100_000 + now - late));
            }
            now += silent;
            assert_eq!(clock.handle_stamp(at(now), first, millis(100_000 + now)), ms(0), "{late} ms");
            assert_eq!((clock.restarts(), clock.time_us(at(now))), (0, Some((100_000 + now) * 1_000)));
            // What overtook nothing is late again, and who starts again begins anew.
            assert_eq!(clock.handle_stamp(at(now), POSITION, millis(100_000 + now - 700)), ms(700));
            clock.handle_stamp(at(now + 40), first, millis(15));
            assert_eq!((clock.restarts(), clock.time_us(at(now + 40))), (1, Some(15_000)));
        }
    }

    /// Some senders stamp some messages by another clock, or not at all.
    #[test]
    fn one_message_of_another_clock_does_not_count() {
        let mut clock = BootClock::default();
        clock.handle_stamp(at(0), ATTITUDE, millis(10_000));
        for step in 1..100 {
            let now = at(step * 20);
            assert_eq!(clock.handle_stamp(now, ATTITUDE, millis(10_000 + step * 20)), ms(0));
            assert_eq!(clock.handle_stamp(now, POSITION, millis(900_000 + step * 20)), None);
            assert_eq!(clock.handle_stamp(now, 32, millis(0)), None);
        }
        assert_eq!(clock.restarts(), 0);

        // Once it is alone, it is the one.
        assert_eq!(clock.handle_stamp(at(4_000), POSITION, millis(904_000)), None);
        assert_eq!(clock.handle_stamp(at(4_020), POSITION, millis(904_020)), ms(0));
        assert_eq!(clock.time_us(at(4_020)), Some(904_020_000));
    }

    /// A restart is noticed with the first message that comes often, though one that comes seldom was heard first.
    #[test]
    fn a_restart_is_noticed_at_once() {
        let mut clock = BootClock::default();
        clock.handle_stamp(at(0), 2, millis(60_000));
        for step in 1..40 {
            clock.handle_stamp(at(step * 20), ATTITUDE, millis(60_000 + step * 20));
        }

        clock.handle_stamp(at(800), ATTITUDE, millis(20));

        assert_eq!((clock.restarts(), clock.time_us(at(800))), (1, Some(20_000)));
    }

    #[test]
    fn a_stamp_that_stands_still_tells_nothing() {
        let mut clock = BootClock::default();
        assert_eq!(clock.time_us(at(0)), None);
        for step in 0..500 {
            assert_eq!(clock.handle_stamp(at(step * 20), ATTITUDE, millis(77)), None);
            assert_eq!(clock.handle_stamp(at(step * 20), POSITION, millis(0)), None);
        }
        assert_eq!(clock.restarts(), 0);
    }

    #[test]
    fn a_count_that_may_have_wrapped_tells_no_time_by_itself() {
        let mut clock = BootClock::default();
        for step in 1..10 {
            assert_eq!(clock.handle_stamp(at(step * 20), 286, Stamp::Micros(step * 20_000)), None);
        }
        assert_eq!(clock.time_us(at(200)), None);
    }
}
