//! Faults as they are written on the command line.

use std::str::FromStr;
use std::time::Duration;

use super::{ClockJump, Faults, Window};
use crate::timestamp::Timestamp;

/// The names of all faults, for people.
pub const WORDS: &str = "drop, deaf, duplicate, reorder, delay, jitter, corrupt, truncate, garbage, split, merge, ack-loss, \
                     ack-delay, ack-target, sequence-gap, nan, slow-parameters, foreign, twin, silence, power-cut, \
                     baud-mismatch, reboot, clock-jump";

const PROBABILITY: &str = "a probability from 0 to 1, for example 0.1";
const DURATION: &str = "a duration, for example 250ms, 5s, 2min or 1h";
const TIME: &str = "@ and a time since the start, for example @20s";
const NOTHING: &str = "no time; this fault is always on";
const NO_VALUE: &str = "no value, only a time, for example reboot@20s";

/// Why a text names no faults.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum FaultError {
    #[error("{word:?} is not a fault; expected one of {WORDS}")]
    Unknown { word: String },
    #[error("fault {word:?}: found {found:?}, expected {expected}")]
    Value { word: &'static str, found: String, expected: &'static str },
    #[error("fault {word:?}: expected {expected}")]
    Missing { word: &'static str, expected: &'static str },
}

impl FromStr for Faults {
    type Err = FaultError;

    /// Reads a list separated by commas; of a word that comes twice the last one counts, but words with a time add up.
    fn from_str(text: &str) -> Result<Self, FaultError> {
        let mut faults = Self::default();
        for entry in text.split(',').map(str::trim).filter(|entry| !entry.is_empty()) {
            faults.read_entry(Entry::split(entry))?;
        }
        Ok(faults)
    }
}

impl Faults {
    #[rustfmt::skip]
    fn read_entry(&mut self, entry: Entry<'_>) -> Result<(), FaultError> {
        match entry.word {
            "drop" => self.drop = entry.probability("drop")?,
            "deaf" => self.deaf = entry.probability("deaf")?,
            "duplicate" => self.duplicate = entry.probability("duplicate")?,
            "reorder" => self.reorder = entry.probability("reorder")?,
            "delay" => self.delay = entry.duration("delay")?,
            "jitter" => self.jitter = entry.duration("jitter")?,
            "corrupt" => self.corrupt = entry.probability("corrupt")?,
            "truncate" => self.truncate = entry.probability("truncate")?,
            "garbage" => self.garbage = entry.probability("garbage")?,
            "split" => self.split = entry.probability("split")?,
            "merge" => self.merge = entry.probability("merge")?,
            "ack-loss" => self.ack_loss = entry.probability("ack-loss")?,
            "ack-delay" => self.ack_delay = entry.duration("ack-delay")?,
            "ack-target" => self.ack_target = entry.probability("ack-target")?,
            "sequence-gap" => self.sequence_gap = entry.probability("sequence-gap")?,
            "nan" => self.nan = entry.probability("nan")?,
            "slow-parameters" => self.slow_parameters = entry.duration("slow-parameters")?,
            "foreign" => self.foreign = entry.probability("foreign")?,
            "twin" => self.twin = entry.probability("twin")?,
            "silence" => self.silences.push(entry.window("silence")?),
            "power-cut" => self.power_cuts.push(entry.window("power-cut")?),
            "baud-mismatch" => self.baud_mismatches.push(entry.window("baud-mismatch")?),
            "reboot" => self.reboots.push(entry.moment("reboot")?),
            "clock-jump" => self.clock_jumps.push(entry.clock_jump("clock-jump")?),
            word => return Err(FaultError::Unknown { word: word.to_owned() }),
        }
        Ok(())
    }
}

/// One `WORD[=VALUE][@TIME]`.
#[derive(Clone, Copy)]
struct Entry<'a> {
    word: &'a str,
    value: Option<&'a str>,
    time: Option<&'a str>,
}

impl<'a> Entry<'a> {
    fn split(text: &'a str) -> Self {
        let (rest, time) = match text.split_once('@') {
            Some((rest, time)) => (rest, Some(time)),
            None => (text, None),
        };
        let (word, value) = match rest.split_once('=') {
            Some((word, value)) => (word, Some(value)),
            None => (rest, None),
        };
        Self { word, value, time }
    }

    fn value(self, word: &'static str, expected: &'static str) -> Result<&'a str, FaultError> {
        self.value.ok_or(FaultError::Missing { word, expected })
    }

    fn without_time(self, word: &'static str) -> Result<(), FaultError> {
        match self.time {
            None => Ok(()),
            Some(found) => Err(FaultError::Value { word, found: format!("@{found}"), expected: NOTHING }),
        }
    }

    fn probability(self, word: &'static str) -> Result<f64, FaultError> {
        self.without_time(word)?;
        let text = self.value(word, PROBABILITY)?;
        match text.parse() {
            Ok(value @ 0.0..=1.0) => Ok(value),
            _ => Err(FaultError::Value { word, found: text.to_owned(), expected: PROBABILITY }),
        }
    }

    fn duration(self, word: &'static str) -> Result<Duration, FaultError> {
        self.without_time(word)?;
        self.length(word)
    }

    fn length(self, word: &'static str) -> Result<Duration, FaultError> {
        let text = self.value(word, DURATION)?;
        parse_duration(text).ok_or_else(|| FaultError::Value { word, found: text.to_owned(), expected: DURATION })
    }

    fn start(self, word: &'static str) -> Result<Timestamp, FaultError> {
        let text = self.time.ok_or(FaultError::Missing { word, expected: TIME })?;
        let after = parse_duration(text).ok_or_else(|| FaultError::Value {
            word,
            found: format!("@{text}"),
            expected: TIME,
        })?;
        Ok(Timestamp::ZERO + after)
    }

    fn window(self, word: &'static str) -> Result<Window, FaultError> {
        let length = self.length(word)?;
        let from = self.start(word)?;
        Ok(Window { from, until: from + length })
    }

    fn moment(self, word: &'static str) -> Result<Timestamp, FaultError> {
        match self.value {
            None => self.start(word),
            Some(found) => Err(FaultError::Value { word, found: found.to_owned(), expected: NO_VALUE }),
        }
    }

    fn clock_jump(self, word: &'static str) -> Result<ClockJump, FaultError> {
        let text = self.value(word, DURATION)?;
        let (sign, digits) = match text.strip_prefix('-') {
            Some(digits) => (-1, digits),
            None => (1, text),
        };
        let length = parse_duration(digits)
            .and_then(|length| i64::try_from(length.as_millis()).ok())
            .ok_or_else(|| FaultError::Value { word, found: text.to_owned(), expected: DURATION })?;
        Ok(ClockJump { at: self.start(word)?, by_ms: sign * length })
    }
}

/// A number from 0 with its unit, at most a thousand hours.
fn parse_duration(text: &str) -> Option<Duration> {
    let digits = text.find(|c: char| !c.is_ascii_digit() && c != '.')?;
    let (number, unit) = text.split_at(digits);
    let seconds = match unit {
        "ms" => 0.001,
        "s" => 1.0,
        "min" => 60.0,
        "h" => 3600.0,
        _ => return None,
    } * number.parse::<f64>().ok()?;
    (0.0..=3_600_000.0).contains(&seconds).then(|| Duration::from_secs_f64(seconds))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_word_sets_its_fault() {
        let text = "drop=0.1,deaf=0.2,duplicate=0.3,reorder=0.4,delay=250ms,jitter=5ms,corrupt=0.5,\
                    truncate=0.6,garbage=0.7,split=0.8,merge=0.9,ack-loss=1,ack-delay=1s,ack-target=0.11,\
                    slow-parameters=200ms,foreign=0.5,twin=0.25,sequence-gap=0.12,nan=0.13,silence=5s@20s,\
                    power-cut=1min@1h,baud-mismatch=2s@0s,reboot@1.5s,\
                    clock-jump=-3s@4s";
        let window = |from, until| Window { from: Timestamp::from_secs(from), until: Timestamp::from_secs(until) };

        let expected = Faults {
            seed: 1,
            drop: 0.1,
            deaf: 0.2,
            duplicate: 0.3,
            reorder: 0.4,
            delay: Duration::from_millis(250),
            jitter: Duration::from_millis(5),
            corrupt: 0.5,
            truncate: 0.6,
            garbage: 0.7,
            split: 0.8,
            merge: 0.9,
            ack_loss: 1.0,
            ack_delay: Duration::from_secs(1),
            ack_target: 0.11,
            sequence_gap: 0.12,
            slow_parameters: Duration::from_millis(200),
            foreign: 0.5,
            twin: 0.25,
            nan: 0.13,
            silences: vec![window(20, 25)],
            power_cuts: vec![window(3600, 3660)],
            baud_mismatches: vec![window(0, 2)],
            reboots: vec![Timestamp::from_millis(1500)],
            clock_jumps: vec![ClockJump { at: Timestamp::from_secs(4), by_ms: -3000 }],
        };
        assert_eq!(text.parse(), Ok(expected));
        assert_eq!("".parse(), Ok(Faults::default()));
    }

    #[test]
    fn an_error_names_the_word_and_what_is_expected() {
        for (text, message) in [
            ("drop=2", "fault \"drop\": found \"2\", expected a probability from 0 to 1, for example 0.1"),
            ("drop=NaN", "fault \"drop\": found \"NaN\", expected a probability from 0 to 1, for example 0.1"),
            ("drop", "fault \"drop\": expected a probability from 0 to 1, for example 0.1"),
            ("drop=0.1@5s", "fault \"drop\": found \"@5s\", expected no time; this fault is always on"),
            ("delay=5", "fault \"delay\": found \"5\", expected a duration, for example 250ms, 5s, 2min or 1h"),
            ("delay=-5s", "fault \"delay\": found \"-5s\", expected a duration, for example 250ms, 5s, 2min or 1h"),
            ("silence=5s", "fault \"silence\": expected @ and a time since the start, for example @20s"),
            (
                "silence=5s@soon",
                "fault \"silence\": found \"@soon\", expected @ and a time since the start, for example @20s",
            ),
            ("reboot=1@5s", "fault \"reboot\": found \"1\", expected no value, only a time, for example reboot@20s"),
            ("reboot", "fault \"reboot\": expected @ and a time since the start, for example @20s"),
        ] {
            assert_eq!(text.parse::<Faults>().map_err(|error| error.to_string()), Err(message.to_owned()), "{text}");
        }
        let unknown = "drop=0.1, dorp=0.1".parse::<Faults>().map_err(|error| error.to_string());
        assert_eq!(unknown, Err(format!("\"dorp\" is not a fault; expected one of {WORDS}")));
    }
}
