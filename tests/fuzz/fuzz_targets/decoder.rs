//! Any bytes, cut anywhere: the decoder accounts for each byte, and finds in a stream what it finds in a datagram.
//!
//! `cargo fuzz run --fuzz-dir tests/fuzz decoder`; the first byte of an input says how long the reads are.

#![no_main]

use gimbald::timestamp::Timestamp;
use gimbald::wire::decoder::Patience;
use gimbald::wire::{DatagramFrames, StreamDecoder, WireCounters};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|input: &[u8]| {
    let Some((read, bytes)) = input.split_first() else { return };
    let in_datagram = decode_datagram(bytes);
    let in_stream = decode_stream(bytes.chunks(usize::from(*read).max(1)));
    assert_eq!(in_stream, in_datagram);
    let in_frames: usize = in_datagram.0.iter().map(Vec::len).sum();
    assert_eq!(in_frames as u64 + in_datagram.1.resync_bytes, bytes.len() as u64);
});

fn decode_datagram(bytes: &[u8]) -> (Vec<Vec<u8>>, WireCounters) {
    let mut datagram = DatagramFrames::new(bytes);
    let mut frames = Vec::new();
    while let Some(frame) = datagram.next_frame() {
        // Nothing that a frame tells of itself may panic either.
        let _told = (frame.target(), frame.name(), frame.payload(), frame.is_signed());
        frames.push(frame.bytes().to_vec());
    }
    (frames, datagram.counters())
}

fn decode_stream<'a>(reads: impl Iterator<Item = &'a [u8]>) -> (Vec<Vec<u8>>, WireCounters) {
    let mut decoder = StreamDecoder::new(Patience::Serial { baud: 115_200 });
    let mut frames = Vec::new();
    let mut take = |decoder: &mut StreamDecoder| {
        while let Some(frame) = decoder.next_frame() {
            frames.push(frame.bytes().to_vec());
        }
    };
    for read in reads {
        decoder.push(Timestamp::ZERO, read);
        take(&mut decoder);
        assert!(decoder.buffer_capacity() <= 4096);
    }
    while let Some(at) = decoder.poll_timeout() {
        decoder.handle_timeout(at);
        take(&mut decoder);
    }
    (frames, decoder.counters())
}
