//! From bytes to frames, losing no valid one.
//!
//! A frame of a known message must pass its checksum; when it does not, scanning goes on one byte further, so a
//! damaged length never takes a neighbour with it. A frame of an unknown message cannot be checked and passes only
//! *in sync*: where the frame before it ended, or at the start of a datagram. Even there it must have been closed
//! with some `CRC_EXTRA`, and gives way to a checked frame inside it.

use std::time::Duration;

use super::crc::Crc;
use super::frame::{Frame, Header, INCOMPAT_SIGNED, MAGIC_V1, MAGIC_V2, MAX_FRAME_LEN};
use crate::timestamp::Timestamp;

/// What a decoder has met so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct WireCounters {
    pub frames: u64,
    /// Frames of known messages, at a place where a frame was due, whose checksum was wrong.
    pub crc_errors: u64,
    /// Frames, at a place where a frame was due, with an `incompat_flags` bit that we do not know.
    pub incompatible_frames: u64,
    /// Bytes that belonged to no frame.
    pub resync_bytes: u64,
}

impl WireCounters {
    pub fn add(&mut self, other: Self) {
        self.frames += other.frames;
        self.crc_errors += other.crc_errors;
        self.incompatible_frames += other.incompatible_frames;
        self.resync_bytes += other.resync_bytes;
    }
}

/// The frames of one datagram. Its end is the end of every frame begun in it.
#[derive(Debug)]
pub struct DatagramFrames<'a> {
    bytes: &'a [u8],
    scanner: Scanner,
}

impl<'a> DatagramFrames<'a> {
    pub fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, scanner: Scanner::default() }
    }

    /// The next frame, `None` at the end.
    pub fn next_frame(&mut self) -> Option<Frame<'a>> {
        self.scanner.next_frame(&mut self.bytes, true)
    }

    pub fn counters(&self) -> WireCounters {
        self.scanner.counters
    }
}

/// The frames of a byte stream, cut anywhere.
///
/// Push what was read, then take frames until there is none. A false start byte could make it wait for up to 280
/// bytes that belong to others; when nothing more has come by [`poll_timeout`](Self::poll_timeout),
/// [`handle_timeout`](Self::handle_timeout) gives the unfinished frame up.
#[derive(Debug, Default)]
pub struct StreamDecoder {
    buffer: Vec<u8>,
    start: usize,
    scanner: Scanner,
    patience: Patience,
    last_push: Timestamp,
    given_up: bool,
}

/// How long a stream decoder waits for the rest of a frame once no more bytes come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Patience {
    /// Twice the wire time of the claimed frame, and at least 20 ms: a serial sender does not pause inside a frame.
    Serial { baud: u32 },
    /// A fixed time, for transports that may hold back the rest.
    Fixed(Duration),
}

impl Default for Patience {
    fn default() -> Self {
        Self::Fixed(Duration::from_secs(1))
    }
}

const LEAST_SERIAL_PATIENCE: Duration = Duration::from_millis(20);

impl StreamDecoder {
    pub fn new(patience: Patience) -> Self {
        Self { patience, ..Self::default() }
    }

    pub fn push(&mut self, now: Timestamp, bytes: &[u8]) {
        if self.start > 0 {
            self.buffer.drain(..self.start);
            self.start = 0;
        }
        self.buffer.extend_from_slice(bytes);
        self.last_push = now;
    }

    /// The next frame, `None` when more bytes are needed.
    pub fn next_frame(&mut self) -> Option<Frame<'_>> {
        let before = &self.buffer[self.start..];
        let mut rest = before;
        let given_up = std::mem::take(&mut self.given_up);
        if given_up && !rest.is_empty() {
            self.scanner.skip(&mut rest);
        }
        let frame = self.scanner.next_frame(&mut rest, false);
        self.start += before.len() - rest.len();
        frame
    }

    /// When to give up the frame that has begun and not ended.
    pub fn poll_timeout(&self) -> Option<Timestamp> {
        let pending = &self.buffer[self.start..];
        if pending.is_empty() {
            return None;
        }
        let wait = match self.patience {
            Patience::Fixed(wait) => wait,
            Patience::Serial { baud } => {
                let len = Header::read(pending).map_or(MAX_FRAME_LEN, |header| header.frame_len());
                let wire_time = Duration::from_micros(len as u64 * 10 * 1_000_000 / u64::from(baud.max(1)));
                LEAST_SERIAL_PATIENCE.max(2 * wire_time)
            }
        };
        Some(self.last_push + wait)
    }

    /// Gives up the unfinished frame if it is time; take frames afterwards.
    pub fn handle_timeout(&mut self, now: Timestamp) {
        if self.poll_timeout().is_some_and(|at| at <= now) {
            self.given_up = true;
        }
    }

    /// Forgets what was read, as after reopening a port.
    pub fn reset(&mut self) {
        self.buffer.clear();
        self.start = 0;
        self.scanner.in_sync = true;
        self.given_up = false;
    }

    pub fn counters(&self) -> WireCounters {
        self.scanner.counters
    }
}

#[derive(Clone, Copy, Debug)]
struct Scanner {
    /// The next byte is where a frame is due.
    in_sync: bool,
    counters: WireCounters,
}

impl Default for Scanner {
    fn default() -> Self {
        Self { in_sync: true, counters: WireCounters::default() }
    }
}

/// What the bytes at one position are.
enum Found {
    Frame(Header),
    NoFrame,
    NeedsMore,
}

impl Scanner {
    /// Takes the next frame off the front of `bytes`, which shrink by it and by what came before it.
    ///
    /// With `at_end` nothing will follow `bytes`; otherwise an unfinished frame is left in place.
    fn next_frame<'a>(&mut self, bytes: &mut &'a [u8], at_end: bool) -> Option<Frame<'a>> {
        while !bytes.is_empty() {
            match self.examine(bytes, at_end) {
                Found::Frame(header) => {
                    let (frame, rest) = bytes.split_at(header.frame_len());
                    *bytes = rest;
                    self.in_sync = true;
                    self.counters.frames += 1;
                    return Some(Frame::new(frame, header));
                }
                Found::NoFrame => self.skip(bytes),
                Found::NeedsMore => return None,
            }
        }
        None
    }

    fn skip(&mut self, bytes: &mut &[u8]) {
        self.in_sync = false;
        self.counters.resync_bytes += 1;
        *bytes = &bytes[1..];
    }

    fn examine(&mut self, bytes: &[u8], at_end: bool) -> Found {
        let unfinished = if at_end { Found::NoFrame } else { Found::NeedsMore };
        if bytes[0] != MAGIC_V1 && bytes[0] != MAGIC_V2 {
            return Found::NoFrame;
        }
        if bytes[0] == MAGIC_V2 && bytes.get(2).is_some_and(|flags| flags & !INCOMPAT_SIGNED != 0) {
            self.counters.incompatible_frames += u64::from(self.in_sync);
            return Found::NoFrame;
        }
        let Some(header) = Header::read(bytes) else { return unfinished };
        if header.shape.is_none() && (!self.in_sync || header.source.system == 0) {
            return Found::NoFrame;
        }
        if bytes.len() < header.frame_len() {
            return unfinished;
        }
        let crc = Crc::new().add(&bytes[1..header.payload_end()]);
        let sum = u16::from_le_bytes([bytes[header.payload_end()], bytes[header.payload_end() + 1]]);
        match header.shape {
            Some(shape) if crc.finish(shape.crc_extra) == sum => Found::Frame(header),
            Some(_) => {
                self.counters.crc_errors += u64::from(self.in_sync);
                Found::NoFrame
            }
            None if crc.can_finish_as(sum) && !holds_checked_frame(&bytes[1..], header.frame_len() - 1) => {
                Found::Frame(header)
            }
            None => Found::NoFrame,
        }
    }
}

/// Whether a frame of a known message starts within the first `len` of `bytes`.
fn holds_checked_frame(bytes: &[u8], len: usize) -> bool {
    (0..len.min(bytes.len())).any(|at| {
        let bytes = &bytes[at..];
        let Some(header) = Header::read(bytes) else { return false };
        let Some(shape) = header.shape else { return false };
        if header.incompat_flags & !INCOMPAT_SIGNED != 0 || bytes.len() < header.frame_len() {
            return false;
        }
        let end = header.payload_end();
        let sum = u16::from_le_bytes([bytes[end], bytes[end + 1]]);
        Crc::new().add(&bytes[1..end]).finish(shape.crc_extra) == sum
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wire::dialect::HEARTBEAT_DATA;
    use crate::wire::encoder::encode_to_vec;
    use crate::wire::ids::MavId;

    /// Protocol checklist 9: "When a valid frame follows directly after a corrupted one in the same read, the valid
    /// one is processed."
    #[test]
    fn a_valid_frame_behind_a_corrupted_one_is_found() {
        let good = heartbeat(2);
        let mut stream = heartbeat(1);
        stream[12] ^= 0x10;
        stream.extend_from_slice(&good);

        let mut datagram = DatagramFrames::new(&stream);

        assert_eq!(datagram.next_frame().map(|frame| frame.bytes().to_vec()), Some(good));
        assert_eq!(datagram.next_frame(), None);
        let expected = WireCounters { frames: 1, crc_errors: 1, incompatible_frames: 0, resync_bytes: 21 };
        assert_eq!(datagram.counters(), expected);
    }

    /// A start byte that begins nothing holds the next frame back no longer than the patience of the line.
    #[test]
    fn a_false_start_is_given_up_when_nothing_follows() {
        let good = heartbeat(1);
        let mut decoder = StreamDecoder::new(Patience::Serial { baud: 115_200 });
        decoder.push(Timestamp::ZERO, &[0xfd, 0xff, 0x00, 0x00, 0x01, 0x01]);
        decoder.push(Timestamp::from_millis(1), &good);
        assert_eq!(decoder.next_frame(), None);

        let at = decoder.poll_timeout().expect("a frame is unfinished");
        // 267 bytes of 10 bits at 115200 baud, twice, after the last read.
        assert_eq!(at, Timestamp::from_micros(1_000 + 2 * 23_177));
        decoder.handle_timeout(at);

        assert_eq!(decoder.next_frame().map(|frame| frame.bytes().to_vec()), Some(good));
        assert_eq!(decoder.poll_timeout(), None);
    }

    fn heartbeat(sequence: u8) -> Vec<u8> {
        let message = HEARTBEAT_DATA {
            custom_mode: 0,
            mavtype: 26,
            autopilot: 8,
            base_mode: 0,
            system_status: 4,
            mavlink_version: 3,
        };
        encode_to_vec(MavId::new(1, 154), sequence, &message)
    }
}
