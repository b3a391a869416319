//! What a Gremsy sends by itself, and how often.
//!
//! It forgets that when it starts, and some models then send nothing, so every rate is set, and set again when nothing
//! comes.

use std::collections::BTreeMap;
use std::time::Duration;

use super::generation::Generation;
use crate::gimbals::gremsy::packet::{self, MessageRate};
use crate::gimbals::operation::{Stream, StreamRate};
use crate::timestamp::Timestamp;
use crate::wire::MavId;
use crate::wire::dialect::COMMAND_LONG_DATA;
use crate::wire::ids::message;

/// A stream not heard for so long is set again.
const SILENCE: Duration = Duration::from_secs(5);

/// The attitude, in either generation.
const ATTITUDE: StreamRate = StreamRate::Hertz(20);
const ENCODERS: StreamRate = StreamRate::Hertz(5);

/// How often a message comes is counted over this.
const WINDOW: Duration = Duration::from_secs(2);

#[derive(Debug, Default)]
pub struct Streams {
    wanted: BTreeMap<Stream, StreamRate>,
    /// Those that the user has set.
    chosen: BTreeMap<Stream, StreamRate>,
    set_at: Timestamp,
    heard: BTreeMap<Stream, Counted>,
}

#[derive(Clone, Copy, Debug)]
struct Counted {
    latest: Timestamp,
    window: Timestamp,
    count: u32,
    /// Times a second, over the last window.
    rate: Option<f64>,
}

impl Streams {
    /// What is wanted of a gimbal of `generation`; `orientation_too` where 285 alone does not tell its yaw.
    pub fn want(&mut self, generation: Generation, orientation_too: bool) {
        self.wanted.clear();
        self.wanted.insert(Stream::Encoders, ENCODERS);
        match generation {
            Generation::V1 => self.wanted.insert(Stream::MountOrientation, ATTITUDE),
            Generation::V2 => self.wanted.insert(Stream::AttitudeStatus, ATTITUDE),
        };
        if orientation_too {
            self.wanted.insert(Stream::MountOrientation, ATTITUDE);
        }
        self.wanted.extend(self.chosen.iter().map(|(stream, rate)| (*stream, *rate)));
    }

    /// The user's choice, which the gimbal took.
    pub fn choose(&mut self, stream: Stream, rate: StreamRate) {
        self.chosen.insert(stream, rate);
        self.wanted.insert(stream, rate);
        if rate == StreamRate::Off {
            self.heard.remove(&stream);
        }
    }

    /// The commands that set all of them.
    pub fn set(&mut self, now: Timestamp, device: MavId) -> Vec<COMMAND_LONG_DATA> {
        self.set_at = now;
        self.wanted.iter().map(|(stream, rate)| command(device, *stream, *rate)).collect()
    }

    pub fn handle_heard(&mut self, now: Timestamp, stream: Stream) {
        let counted = self.heard.entry(stream).or_insert(Counted { latest: now, window: now, count: 0, rate: None });
        counted.latest = now;
        counted.count += 1;
        let passed = now.since(counted.window);
        if passed >= WINDOW {
            *counted = Counted {
                latest: now,
                window: now,
                count: 0,
                rate: Some(f64::from(counted.count) / passed.as_secs_f64()),
            };
        }
    }

    /// Whether one that should come does not.
    pub fn is_silent(&self, now: Timestamp) -> bool {
        let due = |stream: &Stream| {
            let latest = self.heard.get(stream).map_or(self.set_at, |counted| counted.latest.max(self.set_at));
            now.since(latest) >= SILENCE
        };
        self.wanted.iter().any(|(stream, rate)| matches!(rate, StreamRate::Hertz(1..)) && due(stream))
    }

    /// It was restarted, or is another one.
    pub fn forget_heard(&mut self) {
        self.heard.clear();
    }

    pub fn wanted(&self) -> impl Iterator<Item = (Stream, StreamRate)> {
        self.wanted.iter().map(|(stream, rate)| (*stream, *rate))
    }

    /// Times a second, where it is heard.
    pub fn measured(&self, now: Timestamp, stream: Stream) -> Option<f64> {
        let counted = self.heard.get(&stream).filter(|counted| now.since(counted.latest) < WINDOW + WINDOW)?;
        counted.rate
    }

    pub fn heard(&self) -> impl Iterator<Item = Stream> {
        self.heard.keys().copied()
    }
}

pub fn command(device: MavId, stream: Stream, rate: StreamRate) -> COMMAND_LONG_DATA {
    let rate = match rate {
        StreamRate::Off => MessageRate::Off,
        StreamRate::Default => MessageRate::Default,
        StreamRate::Hertz(hertz) => MessageRate::Hertz(hertz),
    };
    packet::set_message_rate(device, message_id(stream), rate)
}

const fn message_id(stream: Stream) -> u32 {
    match stream {
        Stream::Encoders => message::MOUNT_STATUS,
        Stream::MountOrientation => message::MOUNT_ORIENTATION,
        Stream::AttitudeStatus => message::GIMBAL_DEVICE_ATTITUDE_STATUS,
        Stream::RawImu => message::RAW_IMU,
    }
}

pub const fn stream_of(message_id: u32) -> Option<Stream> {
    match message_id {
        message::MOUNT_STATUS => Some(Stream::Encoders),
        message::MOUNT_ORIENTATION => Some(Stream::MountOrientation),
        message::GIMBAL_DEVICE_ATTITUDE_STATUS => Some(Stream::AttitudeStatus),
        message::RAW_IMU => Some(Stream::RawImu),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GIMBAL: MavId = MavId::new(1, 154);

    fn intervals(commands: &[COMMAND_LONG_DATA]) -> Vec<(f32, f32)> {
        commands.iter().map(|command| (command.param1, command.param2)).collect()
    }

    /// "v1: 265 at 20 Hz, 158 off or 5 Hz; v2: 285 at 20–50 Hz; 27 off" (gimbals 1.10).
    #[test]
    fn each_generation_has_its_streams_and_the_users_choice_goes_first() {
        let mut streams = Streams::default();
        streams.want(Generation::V1, false);
        assert_eq!(intervals(&streams.set(Timestamp::ZERO, GIMBAL)), [(158.0, 200_000.0), (265.0, 50_000.0)]);
        streams.choose(Stream::RawImu, StreamRate::Hertz(50));
        streams.choose(Stream::Encoders, StreamRate::Off);
        streams.want(Generation::V2, false);
        let expected = [(158.0, -1.0), (285.0, 50_000.0), (27.0, 20_000.0)];
        assert_eq!(intervals(&streams.set(Timestamp::ZERO, GIMBAL)), expected);
    }

    /// "Re-send all after any 5 s silence (the gimbal forgets them on power-up)."
    #[test]
    fn a_stream_that_does_not_come_is_set_again() {
        let mut streams = Streams::default();
        streams.want(Generation::V1, false);
        streams.choose(Stream::Encoders, StreamRate::Off);
        streams.set(Timestamp::ZERO, GIMBAL);
        assert!(!streams.is_silent(Timestamp::from_millis(4_999)));
        assert!(streams.is_silent(Timestamp::from_secs(5)));
        streams.set(Timestamp::from_secs(5), GIMBAL);
        assert!(!streams.is_silent(Timestamp::from_secs(9)));
        for millis in (9_000..13_000).step_by(50) {
            streams.handle_heard(Timestamp::from_millis(millis), Stream::MountOrientation);
        }
        assert!(!streams.is_silent(Timestamp::from_secs(17)));
        assert!(streams.is_silent(Timestamp::from_secs(18)));
        let rate = streams.measured(Timestamp::from_secs(13), Stream::MountOrientation).expect("it was heard");
        assert!((rate - 20.0).abs() < 1.0, "{rate}");
        // One that has stopped has no rate: the last was heard at 12.95 s.
        assert!(streams.measured(Timestamp::from_millis(16_949), Stream::MountOrientation).is_some());
        assert_eq!(streams.measured(Timestamp::from_millis(16_950), Stream::MountOrientation), None);
    }
}
