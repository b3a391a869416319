//! Frames, known and unknown, and decoders as the links use them.

use gimbald::timestamp::Timestamp;
use gimbald::wire::decoder::Patience;
use gimbald::wire::target::{MessageShape, known_messages, message_shape};
use gimbald::wire::{DatagramFrames, StreamDecoder, WireCounters};

/// What a decoder made of its input.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Decoded {
    pub frames: Vec<Vec<u8>>,
    pub counters: WireCounters,
}

/// Decodes reads of a serial port, then lets it fall silent.
pub fn decode_stream<'a>(reads: impl IntoIterator<Item = &'a [u8]>) -> Decoded {
    let mut decoder = StreamDecoder::new(Patience::Serial { baud: 115_200 });
    let mut frames = Vec::new();
    let mut now = Timestamp::ZERO;
    for read in reads {
        decoder.push(now, read);
        take(&mut decoder, &mut frames);
    }
    while let Some(at) = decoder.poll_timeout() {
        now = now.max(at);
        decoder.handle_timeout(now);
        take(&mut decoder, &mut frames);
    }
    Decoded { frames, counters: decoder.counters() }
}

fn take(decoder: &mut StreamDecoder, frames: &mut Vec<Vec<u8>>) {
    while let Some(frame) = decoder.next_frame() {
        frames.push(frame.bytes().to_vec());
    }
}

pub fn decode_datagram(bytes: &[u8]) -> Decoded {
    let mut datagram = DatagramFrames::new(bytes);
    let mut frames = Vec::new();
    while let Some(frame) = datagram.next_frame() {
        frames.push(frame.bytes().to_vec());
    }
    Decoded { frames, counters: datagram.counters() }
}

/// Reads `bytes` written as hexadecimal digits; spaces are ignored.
pub fn hex(digits: &str) -> Vec<u8> {
    let digits: Vec<u8> = digits.bytes().filter(|byte| !byte.is_ascii_whitespace()).collect();
    digits
        .chunks(2)
        .map(|pair| {
            let pair = str::from_utf8(pair).expect("hexadecimal digits are ASCII");
            u8::from_str_radix(pair, 16).expect("only hexadecimal digits")
        })
        .collect()
}

/// CRC-16/MCRF4XX bit by bit, written apart from the crate's own.
pub fn checksum(bytes: &[u8], crc_extra: u8) -> u16 {
    bytes.iter().chain([&crc_extra]).fold(0xffff, |crc, byte| {
        (0..8).fold(crc ^ u16::from(*byte), |crc, _| if crc & 1 == 1 { (crc >> 1) ^ 0x8408 } else { crc >> 1 })
    })
}

/// A frame of MAVLink 2 from 1/154, signed with thirteen bytes of `signature` when there are any.
pub fn frame_v2(id: u32, crc_extra: u8, sequence: u8, payload: &[u8], signature: Option<[u8; 13]>) -> Vec<u8> {
    let id = id.to_le_bytes();
    let len = u8::try_from(payload.len()).expect("a payload has at most 255 bytes");
    let mut frame = vec![0xfd, len, u8::from(signature.is_some()), 0, sequence, 1, 154, id[0], id[1], id[2]];
    frame.extend_from_slice(payload);
    let sum = checksum(&frame[1..], crc_extra);
    frame.extend_from_slice(&sum.to_le_bytes());
    frame.extend(signature.into_iter().flatten());
    frame
}

/// A frame of MAVLink 1 from 1/154.
pub fn frame_v1(id: u8, crc_extra: u8, sequence: u8, payload: &[u8]) -> Vec<u8> {
    let len = u8::try_from(payload.len()).expect("a payload has at most 255 bytes");
    let mut frame = vec![0xfe, len, sequence, 1, 154, id];
    frame.extend_from_slice(payload);
    let sum = checksum(&frame[1..], crc_extra);
    frame.extend_from_slice(&sum.to_le_bytes());
    frame
}

/// Random numbers that are the same in every run (SplitMix64).
#[derive(Clone, Debug)]
pub struct Random(u64);

impl Random {
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    pub fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mixed = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        mixed ^ (mixed >> 31)
    }

    pub fn byte(&mut self) -> u8 {
        self.next().to_le_bytes()[7]
    }

    /// A number below `end`.
    pub fn below(&mut self, end: usize) -> usize {
        usize::try_from(self.next() % end as u64).expect("it is below a usize")
    }

    pub fn bytes(&mut self, len: usize) -> Vec<u8> {
        (0..len).map(|_| self.byte()).collect()
    }

    /// Bytes of which one in eight is a start byte of either version.
    pub fn bytes_with_starts(&mut self, len: usize) -> Vec<u8> {
        (0..len)
            .map(|_| match self.below(16) {
                0 => 0xfd,
                1 => 0xfe,
                _ => self.byte(),
            })
            .collect()
    }

    /// A valid frame of some known message: mostly version 2, some signed, payloads full of start bytes.
    pub fn known_frame(&mut self, sequence: u8) -> Vec<u8> {
        let messages = known_messages();
        let shape = &messages[self.below(messages.len())];
        match (self.below(8), u8::try_from(shape.id)) {
            (0 | 1, Ok(id)) => {
                let payload = self.bytes_with_starts(usize::from(shape.base_len));
                frame_v1(id, shape.crc_extra, sequence, &payload)
            }
            (2, _) => {
                let payload = self.payload_v2(shape);
                let signature = self.bytes_with_starts(13).try_into().expect("13 bytes were made");
                frame_v2(shape.id, shape.crc_extra, sequence, &payload, Some(signature))
            }
            _ => {
                let payload = self.payload_v2(shape);
                frame_v2(shape.id, shape.crc_extra, sequence, &payload, None)
            }
        }
    }

    /// A valid frame of some known message without a signature.
    pub fn unsigned_frame(&mut self, sequence: u8) -> Vec<u8> {
        loop {
            let frame = self.known_frame(sequence);
            if frame[0] == 0xfe || frame[2] == 0 {
                return frame;
            }
        }
    }

    /// A payload cut anywhere, as if zeros had followed.
    fn payload_v2(&mut self, shape: &MessageShape) -> Vec<u8> {
        let len = 1 + self.below(usize::from(shape.max_len));
        self.bytes_with_starts(len)
    }

    /// A frame of a message that the definitions do not hold.
    pub fn unknown_frame(&mut self, sequence: u8) -> Vec<u8> {
        let id = loop {
            let id = u32::try_from(self.below(1 << 24)).expect("it has 24 bits");
            if message_shape(id).is_none() {
                break id;
            }
        };
        let (len, crc_extra) = (1 + self.below(255), self.byte());
        let payload = self.bytes(len);
        frame_v2(id, crc_extra, sequence, &payload, None)
    }
}
