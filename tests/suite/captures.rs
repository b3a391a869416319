//! Recordings of real peers, replayed: each frame is decoded or counted, and nothing changes unnoticed.
//!
//! `UPDATE_CAPTURES=1` rewrites `expected.jsonl`; read the difference before committing it.

use std::collections::BTreeMap;
use std::fmt::Write;

use gimbald::timestamp::Timestamp;
use gimbald::wire::decoder::Patience;
use gimbald::wire::{DatagramFrames, StreamDecoder, WireCounters};

use crate::support::tlog;

/// A link of a recording: its name, how many frames it carried, and how many of them of unknown messages.
type Link = (&'static str, u64, u64);

/// Every recording with its links. No frame was damaged on its way.
#[rustfmt::skip]
const CAPTURES: [(&str, &[Link]); 5] = [
    ("ap_gremsy_a",  &[("gimbal",    1365, 0), ("ground",    1061, 0)]),
    ("ap_none",      &[("ground",    548, 0)]),
    ("ap_storm32",   &[("gimbal",    1051, 0), ("ground",    892, 0)]),
    ("px4_dev",      &[("gimbal",    1980, 0), ("ground",    4445, 16)]),
    ("px4_nodev",    &[("ground",    1924, 8)]),
];

#[test]
fn every_frame_of_a_recording_is_decoded_or_counted() {
    for (capture, links) in CAPTURES {
        let mut expected = String::new();
        for (link, frames, unknown) in links {
            let path = tlog::capture(capture).join(format!("{link}.tlog"));
            let records = tlog::read(&path);
            let stream = replay_as_stream(&tlog::stream(&records));
            let datagrams = replay_as_datagrams(&records);

            let clean =
                WireCounters { frames: records.len() as u64, crc_errors: 0, incompatible_frames: 0, resync_bytes: 0 };
            assert_eq!(stream.counters, clean, "{capture}, {link}");
            assert_eq!(stream, datagrams, "{capture}, {link}");
            assert_eq!((clean.frames, stream.unknown), (*frames, *unknown), "{capture}, {link}");
            for ((id, name), count) in &stream.messages {
                writeln!(expected, r#"{{"link":"{link}","id":{id},"message":"{name}","count":{count}}}"#)
                    .expect("a string takes everything");
            }
        }
        let path = tlog::capture(capture).join("expected.jsonl");
        if std::env::var_os("UPDATE_CAPTURES").is_some() {
            std::fs::write(&path, &expected).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        }
        let written = std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        assert_eq!(written, expected, "{capture}");
    }
}

/// What decoding found on one link.
#[derive(Debug, Default, PartialEq, Eq)]
struct Replay {
    counters: WireCounters,
    unknown: u64,
    messages: BTreeMap<(u32, &'static str), u64>,
}

impl Replay {
    fn count(&mut self, frame: gimbald::wire::Frame<'_>) {
        self.unknown += u64::from(!frame.is_known());
        *self.messages.entry((frame.message_id(), frame.name())).or_default() += 1;
    }
}

fn replay_as_stream(bytes: &[u8]) -> Replay {
    let mut replay = Replay::default();
    let mut decoder = StreamDecoder::new(Patience::Serial { baud: 115_200 });
    for read in bytes.chunks(61) {
        decoder.push(Timestamp::ZERO, read);
        while let Some(frame) = decoder.next_frame() {
            replay.count(frame);
        }
    }
    // An unknown message at the end may wait to see whether a frame begins inside it.
    while let Some(at) = decoder.poll_timeout() {
        decoder.handle_timeout(at);
        while let Some(frame) = decoder.next_frame() {
            replay.count(frame);
        }
    }
    replay.counters = decoder.counters();
    replay
}

fn replay_as_datagrams(records: &[tlog::Record]) -> Replay {
    let mut replay = Replay::default();
    for record in records {
        let mut datagram = DatagramFrames::new(&record.bytes);
        while let Some(frame) = datagram.next_frame() {
            replay.count(frame);
        }
        replay.counters.add(datagram.counters());
    }
    replay
}
