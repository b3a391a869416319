//! When gimbals are told the state of the vehicle by us, because its autopilot does not tell them.
//!
//! Each channel with gimbals of ours is told at every attitude that comes, but at most 50 and at least 20 times a second;
//! never once somebody else tells it.

use std::time::Duration;

use crate::channel::ChannelId;
use crate::timestamp::Timestamp;

/// At most 50 times a second …
pub const SHORTEST: Duration = Duration::from_millis(20);

/// … and at least 20 times.
pub const LONGEST: Duration = Duration::from_millis(50);

/// What nobody told for so long is not told any more.
const TOLD_WITHIN: Duration = Duration::from_secs(2);

/// Who tells gimbals the state of the vehicle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// The autopilot, or another component of the vehicle.
    Autopilot,
    Synthesized,
}

impl Source {
    pub const fn name(self) -> &'static str {
        match self {
            Self::Autopilot => "autopilot",
            Self::Synthesized => "synthesized",
        }
    }
}

/// A channel with gimbals of ours.
#[derive(Clone, Copy, Debug)]
struct Line {
    channel: ChannelId,
    /// The least time from one to the next, by what the line can carry.
    shortest: Duration,
    told: Option<Timestamp>,
    due: Option<Timestamp>,
}

/// Whether we tell gimbals the state of the vehicle, and when next.
#[derive(Debug, Default)]
pub struct StateForGimbals {
    is_ours: bool,
    told_by_others: Option<Timestamp>,
    lines: Vec<Line>,
    /// The latest time that we told, and of which start of the autopilot it was.
    told_us: u64,
    restarts: u32,
}

impl StateForGimbals {
    /// Somebody else told it: that is the end of ours.
    pub fn handle_told_by_others(&mut self, now: Timestamp) {
        if self.is_ours {
            tracing::info!("the vehicle tells gimbals its state itself");
        }
        self.is_ours = false;
        self.lines.clear();
        self.told_by_others = Some(now);
    }

    /// Nobody else will tell it.
    pub fn start(&mut self) {
        if !self.is_ours {
            tracing::info!("the vehicle does not tell gimbals its state: it is made from what it tells others");
        }
        self.is_ours = true;
    }

    /// The vehicle is another one.
    pub fn stop(&mut self) {
        *self = Self::default();
    }

    pub fn is_ours(&self) -> bool {
        self.is_ours
    }

    /// Whether there is something to tell, and somebody to tell it.
    pub fn is_telling(&self) -> bool {
        self.lines.iter().any(|line| line.told.is_some())
    }

    /// The channels to tell it on, each with the least time from one to the next.
    pub fn set_lines(&mut self, now: Timestamp, lines: &[(ChannelId, Duration)]) {
        self.lines.retain(|line| lines.iter().any(|(channel, _)| *channel == line.channel));
        for (channel, shortest) in lines.iter().copied() {
            match self.lines.iter_mut().find(|line| line.channel == channel) {
                Some(line) => line.shortest = shortest,
                None => self.lines.push(Line { channel, shortest, told: None, due: Some(now) }),
            }
        }
    }

    /// There is news to tell.
    pub fn handle_attitude(&mut self, now: Timestamp) {
        for line in &mut self.lines {
            line.due = Some(line.told.map_or(now, |told| now.max(told + line.shortest)));
        }
    }

    pub fn poll_timeout(&self) -> Option<Timestamp> {
        self.lines.iter().filter_map(|line| line.due).min()
    }

    /// A channel that is to be told now, until there is none.
    pub fn take_due(&mut self, now: Timestamp) -> Option<ChannelId> {
        let line = self.lines.iter_mut().find(|line| line.due.is_some_and(|due| due <= now))?;
        line.told = Some(now);
        line.due = Some(now + line.shortest.max(LONGEST));
        Some(line.channel)
    }

    /// There is nothing to tell, and will not be before the next attitude.
    pub fn pause(&mut self) {
        for line in &mut self.lines {
            (line.told, line.due) = (None, None);
        }
    }

    /// The time to tell: never one that was told before, nor an earlier one, until the autopilot starts anew.
    pub fn next_time_us(&mut self, time_us: u64, restarts: u32) -> u64 {
        let again = self.restarts == restarts;
        self.restarts = restarts;
        self.told_us = if again { time_us.max(self.told_us + 1) } else { time_us };
        self.told_us
    }

    /// Who tells it at present.
    pub fn source(&self, now: Timestamp) -> Option<Source> {
        let recently = |told: Option<Timestamp>| told.is_some_and(|told| now.since(told) <= TOLD_WITHIN);
        if recently(self.told_by_others) {
            return Some(Source::Autopilot);
        }
        self.lines.iter().any(|line| recently(line.told)).then_some(Source::Synthesized)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(millis: u64) -> Timestamp {
        Timestamp::from_millis(millis)
    }

    fn channel() -> ChannelId {
        ChannelId::new(3).expect("below the bound")
    }

    /// When it is told up to `end_ms`, with attitudes at these times.
    fn times(shortest_ms: u64, attitudes_ms: impl IntoIterator<Item = u64>, end_ms: u64) -> Vec<u64> {
        let mut state = StateForGimbals::default();
        state.start();
        state.set_lines(at(0), &[(channel(), Duration::from_millis(shortest_ms))]);
        state.pause();
        let mut told = Vec::new();
        let mut run = |state: &mut StateForGimbals, until: u64| {
            while let Some(due) = state.poll_timeout().filter(|due| *due <= at(until)) {
                assert_eq!(state.take_due(due), Some(channel()));
                told.push(due.as_micros() / 1_000);
            }
        };
        for attitude_ms in attitudes_ms {
            run(&mut state, attitude_ms);
            state.handle_attitude(at(attitude_ms));
        }
        run(&mut state, end_ms);
        told
    }

    /// "follows the attitude messages, at least 20 and at most 50 Hz".
    #[test]
    fn it_follows_the_attitudes_between_20_and_50_hertz() {
        let every = |ms: usize| (0..1_000).step_by(ms);
        assert_eq!(times(20, every(25), 999), every(25).collect::<Vec<_>>());
        assert_eq!(times(20, every(10), 999), every(20).collect::<Vec<_>>());
        assert_eq!(times(20, [0, 240, 480], 500), [0, 50, 100, 150, 200, 240, 290, 340, 390, 440, 480]);
        assert_eq!(times(48, every(20), 999), every(48).collect::<Vec<_>>(), "a slow line");
        // Attitudes that come in pairs.
        assert_eq!(times(20, [0, 5, 60, 65, 120, 125], 125), [0, 20, 60, 80, 120]);
    }

    #[test]
    fn nothing_is_told_once_another_tells_it_and_while_there_is_nothing_to_tell() {
        let mut state = StateForGimbals::default();
        assert_eq!((state.poll_timeout(), state.source(at(0))), (None, None));
        state.start();
        state.set_lines(at(0), &[(channel(), SHORTEST)]);
        assert_eq!((state.take_due(at(0)), state.take_due(at(0))), (Some(channel()), None));
        assert_eq!(state.source(at(2_000)), Some(Source::Synthesized));

        state.pause();
        assert_eq!((state.poll_timeout(), state.source(at(10))), (None, None));
        state.handle_attitude(at(20));
        assert_eq!(state.take_due(at(20)), Some(channel()));

        state.handle_told_by_others(at(30));
        state.handle_attitude(at(40));
        assert!(!state.is_ours());
        assert_eq!((state.poll_timeout(), state.source(at(40))), (None, Some(Source::Autopilot)));
        assert_eq!(state.source(at(2_031)), None);
    }

    /// "time_boot_us: … monotonic".
    #[test]
    fn a_time_is_never_told_twice_until_the_autopilot_starts_anew() {
        let mut state = StateForGimbals::default();
        let told: Vec<u64> = [(100, 0), (150, 0), (149, 0), (150, 0), (160, 0), (5, 1), (5, 1)]
            .into_iter()
            .map(|(time_us, restarts)| state.next_time_us(time_us, restarts))
            .collect();
        assert_eq!(told, [100, 150, 151, 152, 160, 5, 6]);
    }
}
