//! What frames survive: any cut of the reads, and any noise between them.

use std::io::Cursor;
use std::slice::from_ref;

use gimbald::wire::dialect::{AUTOPILOT_STATE_FOR_GIMBAL_DEVICE_DATA, COMMAND_ACK_DATA, HEARTBEAT_DATA};
use gimbald::wire::target::{known_messages, message_shape};
use gimbald::wire::{DatagramFrames, WireCounters};
use mavlink::dialects::storm32::MavMessage as FullMessage;
use mavlink::error::MessageReadError;
use mavlink::{MAVLinkMessageRaw, MavlinkReader};
use proptest::prelude::*;

use crate::support::wire::{Random, decode_datagram, decode_stream, frame_v1, frame_v2};

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    /// A serial port may cut the stream anywhere; the frames do not depend on where.
    #[test]
    fn frames_do_not_depend_on_read_boundaries(stream in frames_between_noise(), cuts in cut_points()) {
        let in_one_read = decode_stream([&stream[..]]);

        prop_assert_eq!(decode_stream(chunks(&stream, &cuts)), in_one_read.clone());
        prop_assert_eq!(decode_stream(stream.chunks(1)), in_one_read);
    }

    /// When nothing more comes, a stream ends as a datagram does.
    #[test]
    fn a_stream_is_decoded_as_a_datagram_of_the_same_bytes(stream in frames_between_noise()) {
        prop_assert_eq!(decode_stream([&stream[..]]), decode_datagram(&stream));
    }

    /// Each byte belongs to one frame or was passed over, and frames come out in the order they went in.
    #[test]
    fn every_byte_is_accounted_for(stream in frames_between_noise()) {
        let decoded = decode_datagram(&stream);

        let in_frames: usize = decoded.frames.iter().map(Vec::len).sum();
        prop_assert_eq!(in_frames as u64 + decoded.counters.resync_bytes, stream.len() as u64);
        prop_assert_eq!(decoded.frames.len() as u64, decoded.counters.frames);
        let mut rest = &stream[..];
        for frame in &decoded.frames {
            let at = rest.windows(frame.len()).position(|window| window == &frame[..]);
            prop_assert!(at.is_some());
            rest = &rest[at.unwrap_or_default() + frame.len()..];
        }
    }

    /// The crate's reader, which refuses unknown messages, finds the same frames of known ones.
    #[test]
    fn the_crates_reader_finds_the_same_frames(stream in known_frames_between_noise()) {
        // The crate's reader waits at the end for what a false start claims.
        let stream = [&stream[..], &[0; 600]].concat();
        let ours = known(decode_datagram(&stream).frames);

        let theirs = frames_of_the_crates_reader(&stream);
        // It checks a message that it does not know with a seed of 0, so that one false start in 65,536 is a frame to it.
        prop_assume!(known(theirs.clone()) == theirs);
        prop_assert_eq!(ours, theirs);
    }
}

/// "No valid frame lost": in no class of noise, in streams and in datagrams. What is passed on besides belongs to a
/// frame that happens to be closed as a valid one is; the classes say how often that may be.
#[test]
fn no_valid_frame_is_lost_and_no_junk_passed_on() {
    for class in CLASSES {
        let tally = class.run(2_000, 1);
        assert_eq!((tally.lost, tally.junk_frames), (0, 0), "{}: {tally:?}", class.name);
        assert_eq!(tally.sent, tally.received, "{}", class.name);
    }
}

/// Prints how many frames are lost and how much junk is passed on in a million frames of each class.
#[test]
#[ignore = "a measurement of some minutes, to be run with --release"]
fn measure_a_million_frames_of_each_class() {
    for class in CLASSES {
        let tally = class.run(1_000_000, 7);
        println!(
            "{:<55} sent {:>8} lost {} junk frames {} bytes {}",
            class.name, tally.sent, tally.lost, tally.junk_frames, tally.junk_bytes
        );
    }
}

/// One flipped bit anywhere never makes another frame of a known one: not of its length, and not of its id.
#[test]
fn no_single_flipped_bit_makes_another_frame() {
    let mut random = Random::new(3);
    for sequence in 0..=255 {
        // A signature is not part of the checksum.
        let whole = random.unsigned_frame(sequence);
        // Long enough that a longer claimed length finds its bytes.
        let behind = random.bytes(300);
        let alone = decode_datagram(&behind).frames;
        for bit in 0..8 * whole.len() {
            let mut bytes = whole.clone();
            bytes[bit / 8] ^= 1 << (bit % 8);
            bytes.extend_from_slice(&behind);

            assert_eq!(decode_datagram(&bytes).frames, alone, "bit {bit} of {whole:02x?}");
        }
    }
}

/// The same for the bits of the id, which can make a known message an unknown one: every message at every length. What
/// a flipped bit does to a checksum does not depend on the content.
#[test]
fn no_single_flipped_bit_in_the_id_makes_an_unknown_message() {
    for shape in known_messages() {
        for len in 1..=usize::from(shape.max_len) {
            let whole = frame_v2(shape.id, shape.crc_extra, 0, &vec![1; len], None);
            for bit in 8 * 7..8 * 10 {
                let mut damaged = whole.clone();
                damaged[bit / 8] ^= 1 << (bit % 8);

                assert_eq!(DatagramFrames::new(&damaged).next_frame(), None, "bit {bit} of {whole:02x?}");
            }
        }
    }
}

/// "A frame of an unknown message … passes only in sync", with the bytes it came with.
#[test]
fn unknown_messages_pass_in_sync_and_byte_identical() {
    let mut random = Random::new(4);
    let (mut passed, mut sent) = (0, 0);
    for sequence in 0..=255 {
        let frames = [
            random.known_frame(sequence),
            random.unknown_frame(sequence),
            random.unknown_frame(sequence),
            random.known_frame(sequence),
        ];
        let decoded = decode_stream([&frames.concat()[..]]);
        assert!(decoded.frames.iter().all(|frame| frames.contains(frame)));
        sent += frames.len();
        passed += decoded.frames.len();
        assert_eq!(decode_datagram(&frames.concat()), decoded);

        let out_of_sync = [&[0x55][..], &frames[1]].concat();
        assert_eq!(decode_datagram(&out_of_sync).frames, Vec::<Vec<u8>>::new());
    }
    assert_eq!(passed, sent);
}

/// A vendor's frame that carries a whole frame of a known message cannot be told from damage in front of that frame.
#[test]
fn an_unknown_message_gives_way_to_a_checked_frame_inside_it() {
    let inner = frame_v2(0, 50, 1, &[0, 0, 0, 0, 26, 8, 0, 4, 3], None);
    for (before, after) in [(0, 0), (5, 40), (200, 3)] {
        let payload = [&vec![7; before][..], &inner, &vec![7; after]].concat();
        let outer = frame_v2(50_001, 17, 0, &payload, None);

        assert_eq!(decode_datagram(&outer).frames, from_ref(&inner));
        assert_eq!(decode_stream(outer.chunks(1)).frames, from_ref(&inner));
    }
    // A frame of a known message was checked, so what it carries is its own.
    let mut tunnel = [0; 133];
    tunnel[5..5 + inner.len()].copy_from_slice(&inner);
    let outer = frame_v2(385, 147, 0, &tunnel, None);
    assert_eq!(decode_datagram(&outer).frames, from_ref(&outer));
}

/// A claimed length that ends inside the next frame must not take that frame along, however late the rest of it comes.
#[test]
fn an_unknown_message_gives_way_to_a_checked_frame_that_begins_inside_it() {
    let inner = frame_v2(0, 50, 1, &[0, 0, 0, 0, 26, 8, 0, 4, 3], None);
    for overlap in 3..inner.len() {
        // An unknown frame whose checksum is the first two bytes of its end inside `inner`.
        let (payload_of_inner, sum) = inner[..overlap].split_at(overlap - 2);
        let Some(outer) = (0..=u8::MAX).flat_map(|a| (0..=u8::MAX).map(move |b| [a, b])).find_map(|free| {
            let payload = [&free[..], payload_of_inner].concat();
            let outer = frame_v2(50_001, 17, 0, &payload, None);
            outer.ends_with(sum).then_some(outer)
        }) else {
            continue;
        };
        let stream = [&outer[..], &inner[overlap..]].concat();

        assert_eq!(decode_datagram(&stream).frames, from_ref(&inner), "{overlap} bytes in common");
        assert_eq!(decode_stream(stream.chunks(1)).frames, from_ref(&inner), "{overlap} bytes in common");
        assert_eq!(
            decode_stream([&outer[..], &inner[overlap..]]).frames,
            from_ref(&inner),
            "{overlap} bytes in common"
        );
    }
}

/// A partial frame that the line never finishes gives the frames behind it free, one false start after the other.
#[test]
fn given_up_starts_free_the_frames_behind_them() {
    let good = [frame_v2(0, 50, 1, &[9; 9], None), frame_v1(0, 50, 2, &[8; 9])];
    let start = [0xfd, 0xff, 0x00, 0x00, 0x01, 0x01, 0x9a, 0x00, 0x00, 0x00];
    let stream = [&start[..], &start, &good[0], &start, &good[1]].concat();

    let decoded = decode_stream([&stream[..]]);

    assert_eq!(decoded.frames, good);
    let counters = WireCounters { frames: 2, crc_errors: 0, incompatible_frames: 0, resync_bytes: 30 };
    assert_eq!(decoded.counters, counters);
}

/// A false start that claims much and repeats itself costs a bounded time per byte: what follows it is decoded.
#[test]
fn streams_of_start_bytes_are_worked_off() {
    let good = frame_v2(0, 50, 1, &[9; 9], None);
    for pattern in [&[0xfd][..], &[0xfe], &[0xfd, 0xff, 0, 0], &[0xfe, 0xff, 0, 0, 1, 131], &COSTLY_V2] {
        let stream: Vec<u8> = pattern.iter().cycle().copied().take(200_000).chain(good.iter().copied()).collect();
        for decoded in [decode_stream(stream.chunks(4096)), decode_datagram(&stream)] {
            assert_eq!(decoded.frames, from_ref(&good), "{pattern:02x?}");
            assert_eq!(decoded.counters.resync_bytes, 200_000, "{pattern:02x?}");
        }
    }
}

/// Prints what a byte of hostile streams costs.
#[test]
#[ignore = "a measurement, to be run with --release"]
#[expect(clippy::disallowed_methods, reason = "it measures real time")]
fn measure_hostile_streams() {
    let mut random = Random::new(5);
    let noise = random.bytes(1 << 20);
    for (name, pattern) in [
        ("random", &noise[..]),
        ("FD", &[0xfd]),
        ("FE", &[0xfe]),
        ("FD FF 00 00", &[0xfd, 0xff, 0, 0]),
        ("FE FF 00 00 01 83", &[0xfe, 0xff, 0, 0, 1, 131]),
        ("FD FF and a known id", &COSTLY_V2),
    ] {
        let stream: Vec<u8> = pattern.iter().cycle().copied().take(1 << 20).collect();
        let started = std::time::Instant::now();
        decode_stream(stream.chunks(4096));
        let in_stream = started.elapsed();
        let started = std::time::Instant::now();
        decode_datagram(&stream);
        let per_byte = |time: std::time::Duration| time.as_secs_f64() * 1e9 / stream.len() as f64;
        println!(
            "{name:<22} stream {:.1} datagram {:.1} ns per byte",
            per_byte(in_stream),
            per_byte(started.elapsed())
        );
    }
}

/// Every tenth byte starts a frame of 267 bytes whose id is known and whose flags are allowed.
const COSTLY_V2: [u8; 10] = [0xfd, 0xff, 0, 0, 0, 0, 0, 0, 0, 0];

/// A way of putting frames on a line, with what may come between them.
struct Class {
    name: &'static str,
    /// Makes one burst: the bytes of one datagram or write, and the valid frames among them.
    burst: fn(&mut Random, u8) -> Burst,
    line: Line,
}

struct Burst {
    /// What each datagram holds; written in a row on a stream.
    parts: Vec<Vec<u8>>,
    frames: Vec<Vec<u8>>,
}

enum Line {
    Stream,
    /// Written in pieces of 1 to 9 bytes.
    Trickle,
    Datagrams,
}

#[derive(Debug, Default)]
struct Tally {
    sent: u64,
    received: u64,
    lost: u64,
    junk_frames: u64,
    junk_bytes: u64,
}

#[rustfmt::skip]
const CLASSES: [Class; 17] = [
    Class { name: "serial, random bytes", burst: after_random_bytes, line: Line::Stream },
    Class { name: "serial, random bytes with start bytes", burst: after_random_starts, line: Line::Stream },
    Class { name: "serial, stray start byte before each frame", burst: after_stray_start, line: Line::Stream },
    Class { name: "serial, damaged frame before each", burst: after_damaged_frame, line: Line::Stream },
    Class { name: "serial, broken-off frame before each", burst: after_broken_frame, line: Line::Stream },
    Class { name: "serial, 1-9 bytes per write", burst: clean, line: Line::Trickle },
    Class { name: "serial, broken-off frame, 1-9 bytes per write", burst: after_broken_frame, line: Line::Trickle },
    Class { name: "serial, unknown messages in sync", burst: with_unknown, line: Line::Stream },
    Class { name: "UDP, noise before the frame", burst: after_random_starts, line: Line::Datagrams },
    Class { name: "UDP, damaged frame before the frame", burst: after_damaged_frame, line: Line::Datagrams },
    Class { name: "UDP, datagrams of noise between", burst: noise_datagram_between, line: Line::Datagrams },
    Class { name: "UDP, broken-off frame in between", burst: broken_datagram_between, line: Line::Datagrams },
    Class { name: "UDP, frame + part of the next", burst: with_part_of_next, line: Line::Datagrams },
    Class { name: "UDP, three frames per datagram", burst: three_frames, line: Line::Datagrams },
    Class { name: "UDP, forty frames per datagram", burst: forty_frames, line: Line::Datagrams },
    Class { name: "UDP, enum value not defined yet", burst: with_new_enum_values, line: Line::Datagrams },
    Class { name: "UDP, unknown messages in sync", burst: with_unknown, line: Line::Datagrams },
];

impl Class {
    /// Sends about `frames` valid frames and sorts what comes out, a few hundred frames at a time.
    fn run(&self, frames: u64, seed: u64) -> Tally {
        let mut random = Random::new(seed);
        let mut tally = Tally::default();
        let mut sequence = 0u8;
        while tally.sent < frames {
            let mut sent = Vec::new();
            let mut parts = Vec::new();
            while sent.len() < 200 {
                let mut burst = (self.burst)(&mut random, sequence);
                sequence = sequence.wrapping_add(1);
                sent.append(&mut burst.frames);
                parts.append(&mut burst.parts);
            }
            let received = match self.line {
                Line::Datagrams => parts.iter().flat_map(|part| decode_datagram(part).frames).collect(),
                Line::Stream => decode_stream([&parts.concat()[..]]).frames,
                Line::Trickle => {
                    let cuts: Vec<usize> = (0..64).map(|_| 1 + random.below(9)).collect();
                    decode_stream(chunks(&parts.concat(), &cuts)).frames
                }
            };
            tally.compare(&sent, &received);
        }
        tally
    }
}

impl Tally {
    fn compare(&mut self, sent: &[Vec<u8>], received: &[Vec<u8>]) {
        let mut awaited = sent.iter();
        self.sent += sent.len() as u64;
        self.received += received.len() as u64;
        for frame in received {
            match awaited.clone().position(|candidate| candidate == frame) {
                Some(skipped) => {
                    self.lost += skipped as u64;
                    awaited.nth(skipped);
                }
                None => {
                    self.junk_frames += 1;
                    self.junk_bytes += frame.len() as u64;
                }
            }
        }
        self.lost += awaited.count() as u64;
    }
}

fn one_part(noise: &[u8], frame: Vec<u8>) -> Burst {
    Burst { parts: vec![[noise, &frame].concat()], frames: vec![frame] }
}

fn clean(random: &mut Random, sequence: u8) -> Burst {
    one_part(&[], random.known_frame(sequence))
}

fn after_random_bytes(random: &mut Random, sequence: u8) -> Burst {
    let len = random.below(40);
    one_part(&random.bytes(len), random.known_frame(sequence))
}

fn after_random_starts(random: &mut Random, sequence: u8) -> Burst {
    let len = random.below(40);
    one_part(&random.bytes_with_starts(len), random.known_frame(sequence))
}

fn after_stray_start(random: &mut Random, sequence: u8) -> Burst {
    let start = if random.below(2) == 0 { 0xfd } else { 0xfe };
    one_part(&[start], random.known_frame(sequence))
}

fn after_damaged_frame(random: &mut Random, sequence: u8) -> Burst {
    // Of a signed frame a damaged signature would leave a valid one.
    let mut damaged = random.unsigned_frame(sequence);
    let bit = random.below(8 * damaged.len());
    damaged[bit / 8] ^= 1 << (bit % 8);
    one_part(&damaged, random.known_frame(sequence))
}

fn broken_off(random: &mut Random, sequence: u8) -> Vec<u8> {
    let frame = match random.below(4) {
        0 => random.unknown_frame(sequence),
        _ => random.known_frame(sequence),
    };
    loop {
        let len = 1 + random.below(frame.len() - 1);
        // Else the start byte of the next frame would make it whole.
        if frame[len] != 0xfd && frame[len] != 0xfe {
            return frame[..len].to_vec();
        }
    }
}

fn after_broken_frame(random: &mut Random, sequence: u8) -> Burst {
    one_part(&broken_off(random, sequence), random.known_frame(sequence))
}

fn noise_datagram_between(random: &mut Random, sequence: u8) -> Burst {
    let len = random.below(300);
    let frame = random.known_frame(sequence);
    Burst { parts: vec![random.bytes_with_starts(len), frame.clone()], frames: vec![frame] }
}

fn broken_datagram_between(random: &mut Random, sequence: u8) -> Burst {
    let frame = random.known_frame(sequence);
    Burst { parts: vec![broken_off(random, sequence), frame.clone()], frames: vec![frame] }
}

fn with_part_of_next(random: &mut Random, sequence: u8) -> Burst {
    let frame = random.known_frame(sequence);
    Burst { parts: vec![[&frame[..], &broken_off(random, sequence)].concat()], frames: vec![frame] }
}

fn three_frames(random: &mut Random, sequence: u8) -> Burst {
    let frames: Vec<_> = (0..3).map(|_| random.known_frame(sequence)).collect();
    Burst { parts: vec![frames.concat()], frames }
}

fn forty_frames(random: &mut Random, sequence: u8) -> Burst {
    let frames: Vec<_> = (0..40).map(|_| random.known_frame(sequence)).collect();
    Burst { parts: vec![frames.concat()], frames }
}

fn with_new_enum_values(random: &mut Random, sequence: u8) -> Burst {
    let frame = match random.below(3) {
        // type and autopilot, landed_state, command and result: whatever the bytes are.
        0 => frame_v2(0, 50, sequence, &random.bytes(9), None),
        1 => frame_v2(286, 210, sequence, &random.bytes(57), None),
        _ => frame_v2(77, 143, sequence, &random.bytes(10), None),
    };
    let mut datagram = DatagramFrames::new(&frame);
    let whole = datagram.next_frame().expect("it is valid");
    assert!(
        whole.decode::<HEARTBEAT_DATA>().is_some()
            || whole.decode::<AUTOPILOT_STATE_FOR_GIMBAL_DEVICE_DATA>().is_some()
            || whole.decode::<COMMAND_ACK_DATA>().is_some(),
        "a value cost the message {frame:02x?}"
    );
    one_part(&[], frame)
}

fn with_unknown(random: &mut Random, sequence: u8) -> Burst {
    let frames = vec![random.known_frame(sequence), random.unknown_frame(sequence)];
    Burst { parts: vec![frames.concat()], frames }
}

/// Streams of frames, known and unknown, whole, damaged and broken off, with noise between them.
fn frames_between_noise() -> impl Strategy<Value = Vec<u8>> {
    pieces(|random, sequence, len| match random.below(6) {
        0 => random.bytes_with_starts(len),
        1 => after_damaged_frame(random, sequence).parts.concat(),
        2 => broken_off(random, sequence),
        3 => random.known_frame(sequence),
        _ => random.unknown_frame(sequence),
    })
}

/// The same without unknown messages and without signed frames that are broken off: with the start of the next frame
/// for the rest of its signature, the crate's reader takes such a frame for a whole one.
fn known_frames_between_noise() -> impl Strategy<Value = Vec<u8>> {
    pieces(|random, sequence, len| match random.below(4) {
        0 => random.bytes_with_starts(len),
        1 => after_damaged_frame(random, sequence).parts.concat(),
        2 => {
            let mut frame = random.unsigned_frame(sequence);
            frame.truncate(1 + random.below(frame.len() - 1));
            frame
        }
        _ => random.known_frame(sequence),
    })
}

/// Up to a dozen pieces in a row; a piece knows its number and how long it is when it is noise.
fn pieces(piece: fn(&mut Random, u8, usize) -> Vec<u8>) -> impl Strategy<Value = Vec<u8>> {
    (any::<u64>(), 1u8..12).prop_map(move |(seed, count)| {
        let mut random = Random::new(seed);
        (0..count)
            .flat_map(|sequence| {
                let len = random.below(30);
                piece(&mut random, sequence, len)
            })
            .collect()
    })
}

fn cut_points() -> impl Strategy<Value = Vec<usize>> {
    prop::collection::vec(1usize..60, 1..40)
}

/// `stream` in pieces of these lengths, over and over.
fn chunks<'a>(stream: &'a [u8], lens: &'a [usize]) -> impl Iterator<Item = &'a [u8]> {
    let mut rest = stream;
    let mut lens = lens.iter().cycle();
    std::iter::from_fn(move || {
        if rest.is_empty() {
            return None;
        }
        let (chunk, after) = rest.split_at(rest.len().min(*lens.next()?));
        rest = after;
        Some(chunk)
    })
}

fn known(frames: Vec<Vec<u8>>) -> Vec<Vec<u8>> {
    let id = |frame: &[u8]| match frame[0] {
        0xfe => u32::from(frame[5]),
        _ => u32::from_le_bytes([frame[7], frame[8], frame[9], 0]),
    };
    frames.into_iter().filter(|frame| message_shape(id(frame)).is_some()).collect()
}

/// What the crate's reader makes of `stream`.
fn frames_of_the_crates_reader(stream: &[u8]) -> Vec<Vec<u8>> {
    let mut reader = MavlinkReader::new(Cursor::new(stream.to_vec()));
    let mut frames = Vec::new();
    loop {
        match reader.read_any_raw_message::<FullMessage>() {
            Ok(MAVLinkMessageRaw::V1(message)) => frames.push(message.raw_bytes().to_vec()),
            Ok(MAVLinkMessageRaw::V2(message)) => frames.push(message.raw_bytes().to_vec()),
            Err(MessageReadError::Io(_)) => break,
            Err(MessageReadError::Parse(_)) => {}
        }
    }
    frames
}
