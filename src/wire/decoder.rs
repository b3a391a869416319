//! From bytes to frames, losing no valid one.
//!
//! A frame of a known message must pass its checksum; when it does not, scanning goes on one byte further, so a
//! damaged length never takes a neighbour with it. A frame of an unknown message cannot be checked and passes only
//! *in sync*: where the frame before it ended, or at the start of a datagram. Even there it must have been closed
//! with some `CRC_EXTRA`, must not be a known message with one wrong bit in its id, and gives way to a checked frame
//! that begins inside it; so does a signature, which no checksum covers. What is taken depends on the bytes alone,
//! never on the reads that brought them.

use std::ops::Range;
use std::time::Duration;

use super::crc::Crc;
use super::frame::{CRC_LEN, Frame, Header, INCOMPAT_SIGNED, MAGIC_V1, MAGIC_V2, MAX_FRAME_LEN, Version};
use super::target::message_shape;
use crate::timestamp::Timestamp;

/// What a decoder has met so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct WireCounters {
    pub frames: u64,
    /// Frames of known messages, at a place where a frame was due, whose checksum was wrong, or whose length was one
    /// that MAVLink 1 does not allow.
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
        self.scanner.next_frame(&mut self.bytes, Ahead::Nothing)
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

    /// Appends what was read. Take all frames before the next push: what is kept then is less than two frames long.
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
        let mut frame = None;
        if std::mem::take(&mut self.given_up) && !rest.is_empty() {
            frame = match self.scanner.step(&mut rest, Ahead::Nothing) {
                Step::Frame(frame) => Some(frame),
                Step::Skipped | Step::NeedsMore => None,
            };
        }
        if frame.is_none() {
            frame = self.scanner.next_frame(&mut rest, Ahead::More);
        }
        self.start += before.len() - rest.len();
        frame
    }

    /// How many bytes the decoder has room for: the largest read and less than two frames.
    pub fn buffer_capacity(&self) -> usize {
        self.buffer.capacity()
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

/// What may follow the bytes at hand.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Ahead {
    More,
    Nothing,
}

/// What the bytes at one position are.
enum Found {
    Frame(Header),
    NoFrame,
    NeedsMore,
}

/// What one look at the front of the bytes led to.
enum Step<'a> {
    Frame(Frame<'a>),
    Skipped,
    NeedsMore,
}

impl Scanner {
    /// Takes the next frame off the front of `bytes`, which shrink by it and by what came before it.
    fn next_frame<'a>(&mut self, bytes: &mut &'a [u8], ahead: Ahead) -> Option<Frame<'a>> {
        while !bytes.is_empty() {
            match self.step(bytes, ahead) {
                Step::Frame(frame) => return Some(frame),
                Step::Skipped => {}
                Step::NeedsMore => return None,
            }
        }
        None
    }

    /// Takes one frame, or what can begin none, off the front of `bytes`, which must not be empty.
    fn step<'a>(&mut self, bytes: &mut &'a [u8], ahead: Ahead) -> Step<'a> {
        match self.examine(bytes, ahead) {
            Found::Frame(header) => {
                let (frame, rest) = bytes.split_at(header.frame_len());
                *bytes = rest;
                self.in_sync = true;
                self.counters.frames += 1;
                Step::Frame(Frame::new(frame, header))
            }
            Found::NoFrame => {
                let len = 1 + bytes[1..].iter().take_while(|byte| !begins_frame(**byte)).count();
                *bytes = &bytes[len..];
                self.in_sync = false;
                self.counters.resync_bytes += len as u64;
                Step::Skipped
            }
            Found::NeedsMore => Step::NeedsMore,
        }
    }

    fn examine(&mut self, bytes: &[u8], ahead: Ahead) -> Found {
        let unfinished = match ahead {
            Ahead::More => Found::NeedsMore,
            Ahead::Nothing => Found::NoFrame,
        };
        if !begins_frame(bytes[0]) {
            return Found::NoFrame;
        }
        if has_unknown_incompat_flag(bytes) {
            self.counters.incompatible_frames += u64::from(self.in_sync);
            return Found::NoFrame;
        }
        let Some(header) = Header::read(bytes) else { return unfinished };
        if header.shape.is_none() {
            if !self.in_sync || header.source.system == 0 {
                return Found::NoFrame;
            }
            if bytes.len() < header.frame_len() {
                return unfinished;
            }
            return examine_unknown(bytes, header, ahead);
        }
        match checks_out(bytes, &header) {
            Some(true) => examine_signature(bytes, header, ahead),
            Some(false) => {
                self.counters.crc_errors += u64::from(self.in_sync);
                Found::NoFrame
            }
            None => unfinished,
        }
    }
}

fn begins_frame(byte: u8) -> bool {
    byte == MAGIC_V1 || byte == MAGIC_V2
}

/// Such a frame must be discarded: not even its length is certain.
fn has_unknown_incompat_flag(bytes: &[u8]) -> bool {
    bytes[0] == MAGIC_V2 && bytes.get(2).is_some_and(|flags| flags & !INCOMPAT_SIGNED != 0)
}

/// Whether `bytes` start with a whole and undamaged frame of the known message of `header`; `None` while that is open.
fn checks_out(bytes: &[u8], header: &Header) -> Option<bool> {
    let shape = header.shape?;
    if bytes.len() < header.frame_len() {
        return None;
    }
    Some(Crc::new().add(&bytes[1..header.payload_end()]).finish(shape.crc_extra) == sum_of(bytes, header))
}

fn sum_of(bytes: &[u8], header: &Header) -> u16 {
    let end = header.payload_end();
    u16::from_le_bytes([bytes[end], bytes[end + 1]])
}

/// Whether the frame of an unknown message that `bytes` start with, in sync and whole, is to be believed.
fn examine_unknown(bytes: &[u8], header: Header, ahead: Ahead) -> Found {
    let crc = Crc::new().add(&bytes[1..header.payload_end()]);
    if !crc.can_finish_as(sum_of(bytes, &header)) || is_known_but_for_one_bit(bytes, &header) {
        return Found::NoFrame;
    }
    unless_frame_begins_in(1..header.frame_len(), bytes, header, ahead)
}

/// Whether the checked frame that `bytes` start with is whole.
///
/// The checksum leaves a signature out, so a frame that broke off inside it would take the start of the next for it.
fn examine_signature(bytes: &[u8], header: Header, ahead: Ahead) -> Found {
    unless_frame_begins_in(header.payload_end() + CRC_LEN..header.frame_len(), bytes, header, ahead)
}

/// The frame of `header`, unless a checked frame of a known message begins at one of `positions`.
fn unless_frame_begins_in(positions: Range<usize>, bytes: &[u8], header: Header, ahead: Ahead) -> Found {
    let mut open = false;
    for at in positions {
        match holds_known_frame(&bytes[at..]) {
            Some(true) => return Found::NoFrame,
            Some(false) => {}
            None => open = true,
        }
    }
    match ahead {
        Ahead::More if open => Found::NeedsMore,
        Ahead::More | Ahead::Nothing => Found::Frame(header),
    }
}

/// Whether a checked frame of a known message starts here; `None` while that is open.
fn holds_known_frame(bytes: &[u8]) -> Option<bool> {
    if !begins_frame(bytes[0]) || has_unknown_incompat_flag(bytes) {
        return Some(false);
    }
    let header = Header::read(bytes)?;
    if header.shape.is_none() { Some(false) } else { checks_out(bytes, &header) }
}

/// Whether one wrong bit in the id made a known message unknown.
fn is_known_but_for_one_bit(bytes: &[u8], header: &Header) -> bool {
    let id_at = match header.version {
        Version::V1 => 5,
        Version::V2 => 7,
    };
    let sum = sum_of(bytes, header);
    (0..8 * (header.payload_start() - id_at)).any(|bit| {
        message_shape(header.message_id ^ (1 << bit)).is_some_and(|shape| {
            let at = id_at + bit / 8;
            let mended = bytes[at] ^ (1 << (bit % 8));
            let crc = Crc::new().add(&bytes[1..at]).add(&[mended]).add(&bytes[at + 1..header.payload_end()]);
            crc.finish(shape.crc_extra) == sum
        })
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

    /// D13: "A CRC-valid frame of a known id is a valid frame", whatever its length, in MAVLink 1 too.
    #[test]
    fn a_checked_frame_is_a_frame_whatever_its_length() {
        for len in [4_u8, 9, 12] {
            let mut frame = vec![MAGIC_V1, len, 0, 1, 154, 0];
            frame.extend(vec![3; usize::from(len)]);
            // 50 is the CRC_EXTRA of HEARTBEAT.
            let sum = Crc::new().add(&frame[1..]).finish(50);
            frame.extend_from_slice(&sum.to_le_bytes());

            let mut datagram = DatagramFrames::new(&frame);

            assert_eq!(datagram.next_frame().map(|found| found.bytes().to_vec()), Some(frame.clone()), "{len} bytes");
        }
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
