//! A serial line seen from its far end, and the traffic that it is offered.

use std::collections::BTreeMap;
use std::time::Duration;

use gimbald::timestamp::Timestamp;
use gimbald::wire::MavId;
use gimbald::wire::target::message_shape;

use super::wire::{Random, checksum};

/// Who sends the traffic.
pub const SENDER: MavId = MavId::new(255, 190);
/// Who lives at the far end and is sent the control frames.
pub const RECEIVER: MavId = MavId::new(1, 1);

const COMMAND_LONG: u32 = 76;
/// `DEBUG_FLOAT_ARRAY`, which has no target and any length up to 252.
const TELEMETRY: u32 = 350;

/// A frame for the line and when it is offered.
#[derive(Clone, Debug)]
pub struct Offer {
    pub at: Timestamp,
    pub bytes: Vec<u8>,
    pub is_control: bool,
}

/// 400 broadcasts of 20 to 100 bytes and 50 control frames a second, each with a number of its own, at uneven times.
pub fn traffic(seed: u64, duration: Duration) -> Vec<Offer> {
    let mut random = Random::new(seed);
    let mut offers = Vec::new();
    for (every_us, is_control) in [(2_500, false), (20_000, true)] {
        for number in 0..duration.as_micros() as u64 / every_us {
            let at = Timestamp::from_micros(number * every_us + random.next() % every_us);
            let bytes = if is_control { control(number as u32) } else { telemetry(number as u32, &mut random) };
            offers.push(Offer { at, bytes, is_control });
        }
    }
    offers.sort_by_key(|offer| offer.at);
    offers
}

/// A command (a mode change, which is none of ours) to whoever lives at the far end, of 45 bytes.
pub fn control(number: u32) -> Vec<u8> {
    let mut payload = [0; 33];
    payload[4..8].copy_from_slice(&number.to_le_bytes());
    payload[28..33].copy_from_slice(&[176, 0, RECEIVER.system, RECEIVER.component, 1]);
    frame(COMMAND_LONG, &payload)
}

fn telemetry(number: u32, random: &mut Random) -> Vec<u8> {
    let frame_len = 20 + random.below(81);
    let mut payload = random.bytes(frame_len - 12);
    payload[..4].copy_from_slice(&number.to_le_bytes());
    frame(TELEMETRY, &payload)
}

fn frame(id: u32, payload: &[u8]) -> Vec<u8> {
    let [low, middle, high, _] = id.to_le_bytes();
    let len = u8::try_from(payload.len()).expect("a payload has at most 255 bytes");
    let mut frame = vec![0xfd, len, 0, 0, 0, SENDER.system, SENDER.component, low, middle, high];
    frame.extend_from_slice(payload);
    let sum = checksum(&frame[1..], message_shape(id).expect("a known message").crc_extra);
    frame.extend_from_slice(&sum.to_le_bytes());
    frame
}

/// One frame on the wire, from its first bit to its last.
#[derive(Clone, Debug)]
pub struct Passage {
    pub start: Timestamp,
    pub end: Timestamp,
    pub bytes: Vec<u8>,
}

/// A line that drains what it is given at its own speed, as the buffer of a serial port does.
#[derive(Debug)]
pub struct Line {
    byte_time_ns: u64,
    free_at_ns: u64,
    pub passages: Vec<Passage>,
}

impl Line {
    pub fn new(bytes_per_second: u64) -> Self {
        Self { byte_time_ns: 1_000_000_000 / bytes_per_second, free_at_ns: 0, passages: Vec::new() }
    }

    pub fn write(&mut self, now: Timestamp, bytes: &[u8]) {
        let start = self.free_at_ns.max(now.as_micros() * 1_000);
        self.free_at_ns = start + self.byte_time_ns * bytes.len() as u64;
        self.passages.push(Passage {
            start: Timestamp::from_micros(start / 1_000),
            end: Timestamp::from_micros(self.free_at_ns / 1_000),
            bytes: bytes.to_vec(),
        });
    }
}

/// How long the control frames of `offers` waited beyond their own time on the wire and the rest of the frame that was
/// on it when they were offered; sorted. Frames that did not arrive are left out.
pub fn control_waits(offers: &[Offer], passages: &[Passage]) -> Vec<Duration> {
    let by_bytes: BTreeMap<&[u8], &Passage> = passages.iter().map(|passage| (&passage.bytes[..], passage)).collect();
    let mut waits: Vec<Duration> = offers
        .iter()
        .filter(|offer| offer.is_control)
        .filter_map(|offer| {
            let own = by_bytes.get(&offer.bytes[..])?;
            let before = passages.partition_point(|passage| passage.start < offer.at);
            let in_progress = before.checked_sub(1).map(|at| &passages[at]);
            let rest = in_progress.map_or(Duration::ZERO, |passage| passage.end.since(offer.at));
            Some(own.start.since(offer.at).saturating_sub(rest))
        })
        .collect();
    waits.sort();
    waits
}

/// The value below which `share` of the sorted `values` lie.
pub fn percentile(values: &[Duration], share: f64) -> Duration {
    values[((values.len() as f64 * share) as usize).min(values.len() - 1)]
}
