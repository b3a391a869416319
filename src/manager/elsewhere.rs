//! Where else the id of a gimbal is heard that may be turning: it may have been plugged in there.
//!
//! Whoever has it there is told to stop as well, and the gimbal has not stopped before that was said there for a while in which
//! it was heard. What is heard where the gimbal was may be another by then.

use std::time::Duration;

use crate::channel::ChannelId;
use crate::gimbals::heard_time::HeardTime;
use crate::timestamp::Timestamp;

const EVERY: Duration = Duration::from_millis(100);
/// In which it is said more than once also to one that only beats.
const LASTS: Duration = Duration::from_secs(2);
/// Who was silent for longer there may have been plugged in just now.
const AWAY_AFTER: Duration = Duration::from_millis(1_500);

/// So many channels at most.
const MOST: usize = 8;

#[derive(Clone, Debug, Default)]
pub struct Elsewhere(Vec<Other>);

#[derive(Clone, Copy, Debug)]
struct Other {
    channel: ChannelId,
    next: Timestamp,
    latest: Timestamp,
    heard: HeardTime,
}

impl Other {
    const fn new(now: Timestamp, channel: ChannelId) -> Self {
        Self { channel, next: now, latest: now, heard: HeardTime::new(now) }
    }

    fn was_told(&self) -> bool {
        self.heard.passed() >= LASTS
    }
}

impl Elsewhere {
    /// Its id is heard there; true where a word that stops it is due there. `turns`: where it was until now it is told to.
    pub fn handle_heard(&mut self, now: Timestamp, channel: ChannelId, turns: bool) -> bool {
        let at = self.0.iter().position(|other| other.channel == channel).unwrap_or_else(|| {
            if self.0.len() >= MOST {
                self.0.remove(0);
            }
            self.0.push(Other::new(now, channel));
            self.0.len() - 1
        });
        let other = &mut self.0[at];
        if now.since(other.latest) > AWAY_AFTER {
            *other = Other::new(now, channel);
        }
        other.latest = now;
        other.heard.handle_heard(now);
        let is_due = other.next <= now && (turns || !other.was_told());
        if is_due {
            other.next = now + EVERY;
        }
        is_due
    }

    /// It is itself there.
    pub fn forget(&mut self, channel: ChannelId) {
        self.0.retain(|other| other.channel != channel);
    }

    /// It turned until now.
    pub fn begin_anew(&mut self, now: Timestamp) {
        for other in &mut self.0 {
            other.heard = HeardTime::new(now);
        }
    }

    /// Whether all were told to stop.
    pub fn were_told(&self) -> bool {
        self.0.iter().all(Other::was_told)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(millis: u64) -> Timestamp {
        Timestamp::from_millis(millis)
    }

    #[test]
    fn each_place_is_told_for_two_seconds_in_which_it_is_heard() {
        let [here, there] = [1, 2].map(|index| ChannelId::new(index).expect("below the bound"));
        let mut elsewhere = Elsewhere::default();
        assert!(elsewhere.were_told(), "there is nobody");
        let told = |elsewhere: &mut Elsewhere, channel, from: u64, until: u64| -> usize {
            (from..until).step_by(50).filter(|millis| elsewhere.handle_heard(at(*millis), channel, false)).count()
        };
        assert_eq!(told(&mut elsewhere, there, 0, 2_000), 20);
        assert!(!elsewhere.were_told());
        assert_eq!(told(&mut elsewhere, there, 2_000, 9_000), 0);
        assert!(elsewhere.were_told());
        // Another may have come there while it was silent.
        assert_eq!(told(&mut elsewhere, there, 10_600, 11_000), 4);
        elsewhere.forget(there);
        assert_eq!(told(&mut elsewhere, here, 20_000, 23_000), 20);
        elsewhere.begin_anew(at(23_000));
        assert_eq!(told(&mut elsewhere, here, 23_000, 26_000), 20);
    }

    #[test]
    fn while_it_is_told_to_turn_whoever_is_elsewhere_is_told_to_stop() {
        let there = ChannelId::new(1).expect("below the bound");
        let mut elsewhere = Elsewhere::default();
        let told = (0..9_000).step_by(1_000).filter(|millis| elsewhere.handle_heard(at(*millis), there, true));
        assert_eq!(told.count(), 9);
    }
}
