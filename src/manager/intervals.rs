//! How often each channel is sent a manager's own messages.
//!
//! `MAV_CMD_SET_MESSAGE_INTERVAL`: "0: request default rate, -1: disable", a setting of the channel it came on.

use std::time::Duration;

use super::messages::Interval;
use crate::channel::{ChannelId, ChannelSet};
use crate::timestamp::Timestamp;

/// "This message should be broadcast at a low regular rate (e.g. 5Hz)" (`GIMBAL_MANAGER_STATUS`).
pub const DEFAULT_STATUS_INTERVAL: Duration = Duration::from_millis(200);

/// No message is sent more often than this.
pub const LEAST_INTERVAL: Duration = Duration::from_millis(20);

/// The schedule of one message over all channels.
#[derive(Debug)]
pub struct Schedule {
    default: Interval,
    entries: Vec<Entry>,
}

#[derive(Clone, Copy, Debug)]
struct Entry {
    channel: ChannelId,
    interval: Interval,
    due: Timestamp,
}

/// An interval that cannot be had.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct InvalidInterval;

impl Schedule {
    pub fn new(default: Interval) -> Self {
        Self { default, entries: Vec::new() }
    }

    /// A new channel is served together with the others where it can be, so that one wake-up does for all.
    pub fn open(&mut self, now: Timestamp, channel: ChannelId) {
        self.close(channel);
        let due = match self.default {
            Interval::Every(interval) => next_multiple(now, interval),
            Interval::Off | Interval::NotAvailable => now,
        };
        self.entries.push(Entry { channel, interval: self.default, due });
    }

    pub fn close(&mut self, channel: ChannelId) {
        self.entries.retain(|entry| entry.channel != channel);
    }

    /// Applies parameter 2 of `SET_MESSAGE_INTERVAL`, in microseconds.
    pub fn set(&mut self, now: Timestamp, channel: ChannelId, micros: f32) -> Result<(), InvalidInterval> {
        let interval = match micros {
            0.0 => self.default,
            -1.0 => Interval::Off,
            micros if micros > 0.0 && micros.is_finite() => {
                Interval::Every(Duration::from_micros(micros as u64).max(LEAST_INTERVAL))
            }
            _ => return Err(InvalidInterval),
        };
        let Some(entry) = self.entries.iter_mut().find(|entry| entry.channel == channel) else { return Ok(()) };
        if entry.interval != interval {
            entry.interval = interval;
            entry.due = match interval {
                Interval::Every(every) if interval == self.default => next_multiple(now, every),
                Interval::Every(every) => now + every,
                Interval::Off | Interval::NotAvailable => now,
            };
        }
        Ok(())
    }

    pub fn interval(&self, channel: ChannelId) -> Interval {
        self.entries.iter().find(|entry| entry.channel == channel).map_or(self.default, |entry| entry.interval)
    }

    pub fn channels(&self) -> impl Iterator<Item = ChannelId> {
        self.entries.iter().map(|entry| entry.channel)
    }

    pub fn poll_timeout(&self) -> Option<Timestamp> {
        self.entries.iter().filter(|entry| matches!(entry.interval, Interval::Every(_))).map(|entry| entry.due).min()
    }

    /// The channels whose turn it is; each is due again one interval later.
    pub fn take_due(&mut self, now: Timestamp) -> ChannelSet {
        let mut channels = ChannelSet::EMPTY;
        for entry in &mut self.entries {
            let Interval::Every(interval) = entry.interval else { continue };
            if entry.due <= now {
                channels.insert(entry.channel);
                entry.due += interval;
                if entry.due <= now {
                    // Time has jumped: nothing is made up for.
                    entry.due = now + interval;
                }
            }
        }
        channels
    }
}

/// The first moment after `now` that is a whole number of intervals from the start.
fn next_multiple(now: Timestamp, interval: Duration) -> Timestamp {
    let step = interval.as_micros().max(1) as u64;
    Timestamp::from_micros((now.as_micros() / step + 1) * step)
}
