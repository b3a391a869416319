//! Recordings of real peers, replayed: each frame is decoded or counted, and nothing changes unnoticed.
//!
//! `UPDATE_CAPTURES=1` rewrites `expected.jsonl`; read the difference before committing it.

mod core;

use std::collections::BTreeMap;
use std::fs;
use std::sync::{Mutex, PoisonError};

use gimbald::timestamp::Timestamp;
use gimbald::wire::decoder::Patience;
use gimbald::wire::{DatagramFrames, StreamDecoder, WireCounters};

use self::core::Gimbal;
use crate::support::tlog;
use crate::support::world::{AUTOPILOT, GIMBAL};

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
        let mut lines = Vec::new();
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
                lines.push(format!(r#"{{"link":"{link}","id":{id},"message":"{name}","count":{count}}}"#));
            }
        }
        assert_expected(capture, Part::Wire, &lines);
    }
}

/// A recording, and who plays the gimbal.
type Recording = (&'static str, Gimbal);

/// How each recording is played through the core, and what the autopilot is to be told to leave the gimbal to us.
#[rustfmt::skip]
const REPLAYS: [(&str, &[Recording], &[&str]); 5] = [
    ("ap_gremsy_a", &[("gimbal", Gimbal::Simulated), ("ground", Gimbal::Recorded)], &["MNT1_TYPE", "MNT1_TYPE"]),
    ("ap_none",     &[("ground", Gimbal::Recorded)],                                &[]),
    ("ap_storm32",  &[("gimbal", Gimbal::Simulated), ("ground", Gimbal::Recorded)], &["MNT1_TYPE", "MNT1_TYPE"]),
    ("px4_dev",     &[("gimbal", Gimbal::Simulated), ("ground", Gimbal::Recorded)], &["MNT_MODE_IN", "MNT_MODE_IN"]),
    ("px4_nodev",   &[("ground", Gimbal::Absent)],                                  &[]),
];

/// "every frame decoded or counted, system id adopted, discovery happens as it should, 286 of the autopilot arrives
/// byte-identical on the gimbal link, rival managers are reported with the right setting, our manager stays consistent."
#[test]
fn a_recorded_flight_goes_through_the_core() {
    for (capture, recordings, settings) in REPLAYS {
        let mut lines = Vec::new();
        let mut remedies = Vec::new();
        for (recording, gimbal) in recordings {
            let replay = core::replay(capture, recording, *gimbal);

            replay.assert_everything_was_read();
            replay.assert_the_system_id_is_adopted();
            replay.assert_gimbals_hear_the_autopilot();
            replay.assert_the_gimbal_is_left_alone();
            replay.assert_our_manager_is_consistent();
            let found: Vec<_> =
                replay.snapshot.gimbals.iter().map(|found| (found.device.as_deref(), found.state.as_str())).collect();
            let expected = (Some("1/154"), "alive");
            assert_eq!(
                found,
                if *gimbal == Gimbal::Absent { vec![] } else { vec![expected] },
                "{capture}, {recording}"
            );
            let rivals = replay.snapshot.conflicts.iter().filter(|conflict| conflict.contains("1/1 "));
            remedies.extend(rivals.map(|conflict| conflict.to_owned()));
            lines.extend(replay.lines());
        }
        let named = |setting: &&str| remedies.iter().any(|remedy| remedy.contains(*setting));
        assert!(settings.iter().all(named) && settings.is_empty() == remedies.is_empty(), "{capture}: {remedies:?}");
        assert_expected(capture, Part::Core, &lines);
    }
}

/// `[autopilot] present_device` under a recorded ArduPilot: its constant stream moves nothing and its 286 goes on, the ground
/// sees one manager, and there is nothing to complain of.
#[test]
fn a_recorded_ardupilot_drives_the_presented_device() {
    for (recording, gimbal) in [("gimbal", Gimbal::Simulated), ("ground", Gimbal::Recorded)] {
        let replay = core::replay_with("ap_gremsy_a", recording, gimbal, true);

        replay.assert_everything_was_read();
        replay.assert_gimbals_hear_the_autopilot();
        replay.assert_the_gimbal_is_left_alone();
        replay.assert_our_manager_is_consistent();
        assert_eq!(replay.snapshot.conflicts, [""; 0], "{recording}");
        assert_eq!(replay.snapshot.links[1].dropped.get("firewall"), None, "{recording}");
        // Each of its words as a manager was kept here, and each of the gimbal's from it.
        let as_manager = [280, 281, 283, 285];
        assert_eq!(replay.heard_on("ground", AUTOPILOT, &as_manager), 0, "{recording}");
        let kept = replay.snapshot.links[0].dropped.get("autopilots_gimbal").copied().unwrap_or(0);
        assert_eq!(kept, replay.said_by_autopilot(&as_manager) as u64, "{recording}");
        assert!(replay.heard_on("ground", GIMBAL, &as_manager) > 100, "{recording}");
        let presented = replay.snapshot.gimbals[0].presented.as_ref().expect("it is presented");
        let streams = if recording == "gimbal" { "steady" } else { "silent" };
        assert_eq!((presented.device.as_str(), presented.stream.as_str()), ("1/154", streams));
        assert!(replay.heard_on("autopilot", GIMBAL, &[0]) > 10, "{recording}");
    }
}

/// Which lines of `expected.jsonl` a test stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Part {
    /// Those that begin with the link.
    Wire,
    /// All others.
    Core,
}

impl Part {
    fn of(line: &str) -> Self {
        if line.starts_with(r#"{"link":"#) { Self::Wire } else { Self::Core }
    }
}

/// Compares one part of `expected.jsonl`, or rewrites it under `UPDATE_CAPTURES`.
fn assert_expected(capture: &str, part: Part, lines: &[String]) {
    // The two tests rewrite one file.
    static FILES: Mutex<()> = Mutex::new(());
    let guard = FILES.lock().unwrap_or_else(PoisonError::into_inner);
    let path = tlog::capture(capture).join("expected.jsonl");
    let read = || fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    if std::env::var_os("UPDATE_CAPTURES").is_some() {
        let before = read();
        let of = |wanted: Part| before.lines().filter(move |line| Part::of(line) == wanted).map(str::to_owned);
        let whole: Vec<String> = match part {
            Part::Wire => lines.iter().cloned().chain(of(Part::Core)).collect(),
            Part::Core => of(Part::Wire).chain(lines.iter().cloned()).collect(),
        };
        let text: String = whole.into_iter().map(|line| line + "\n").collect();
        fs::write(&path, text).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    }
    let written = read();
    drop(guard);
    let written: Vec<&str> = written.lines().filter(|line| Part::of(line) == part).collect();
    for (written, found) in written.iter().zip(lines) {
        assert_eq!(written, found, "{capture}");
    }
    assert_eq!(written.len(), lines.len(), "{capture}");
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
