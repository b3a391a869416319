use super::*;
use crate::wire::dialect::{COMMAND_ACK_DATA, HEARTBEAT_DATA};
use crate::wire::dialect::{GIMBAL_DEVICE_ATTITUDE_STATUS_DATA, MessageData, PARAM_VALUE_DATA};
use crate::wire::{DatagramFrames, MavId, encode_to_vec};

const SOURCE: MavId = MavId::new(1, 154);

/// Sends 285 every 10 ms with its own time since boot, and a `COMMAND_ACK` for whatever it hears.
#[derive(Debug, Default)]
struct Beacon {
    boot: Timestamp,
    next: Timestamp,
    sequence: u8,
    ready: Vec<Vec<u8>>,
}

impl Beacon {
    fn send<M: MessageData>(&mut self, message: &M) {
        self.ready.push(encode_to_vec(SOURCE, self.sequence, message));
        self.sequence = self.sequence.wrapping_add(1);
    }
}

impl Peer for Beacon {
    fn handle_received(&mut self, _now: Timestamp, _bytes: &[u8]) {
        self.send(&COMMAND_ACK_DATA {
            command: 512,
            result: 0,
            progress: 0,
            result_param2: 0,
            target_system: 255,
            target_component: 190,
        });
    }

    fn handle_timeout(&mut self, now: Timestamp) {
        if self.next <= now {
            self.next = now + Duration::from_millis(10);
            let time_boot_ms = (Timestamp::ZERO + now.since(self.boot)).boot_ms();
            let status = GIMBAL_DEVICE_ATTITUDE_STATUS_DATA {
                time_boot_ms,
                q: [1.0, 0.0, 0.0, 0.0],
                ..GIMBAL_DEVICE_ATTITUDE_STATUS_DATA::default()
            };
            self.send(&status);
        }
    }

    fn poll_output(&mut self) -> Option<Vec<u8>> {
        if self.ready.is_empty() { None } else { Some(self.ready.remove(0)) }
    }

    fn poll_timeout(&self) -> Option<Timestamp> {
        Some(self.next)
    }

    fn handle_reboot(&mut self, now: Timestamp) {
        *self = Self { boot: now, next: now, ..Self::default() };
    }
}

/// Runs the beacon for `millis`; what left the line, and when.
fn run(faults: &str, millis: u64) -> Vec<(Timestamp, Vec<u8>)> {
    run_with_seed(1, faults, millis)
}

fn run_with_seed(seed: u64, faults: &str, millis: u64) -> Vec<(Timestamp, Vec<u8>)> {
    let faults = Faults { seed, ..faults.parse().expect(faults) };
    let mut peer = FaultyPeer::new(Beacon::default(), faults);
    run_peer(&mut peer, Timestamp::ZERO, Timestamp::from_millis(millis))
}

fn run_peer(peer: &mut FaultyPeer<Beacon>, from: Timestamp, until: Timestamp) -> Vec<(Timestamp, Vec<u8>)> {
    let mut sent = Vec::new();
    let mut now = from;
    while now < until {
        peer.handle_timeout(now);
        sent.extend(std::iter::from_fn(|| peer.poll_output()).map(|bytes| (now, bytes)));
        now = peer.poll_timeout().expect("the beacon goes on").max(now + Duration::from_micros(1));
    }
    sent
}

fn statuses(sent: &[(Timestamp, Vec<u8>)]) -> Vec<(Timestamp, u8, GIMBAL_DEVICE_ATTITUDE_STATUS_DATA)> {
    let mut found = Vec::new();
    for (at, bytes) in sent {
        let mut frames = DatagramFrames::new(bytes);
        while let Some(frame) = frames.next_frame() {
            if let Some(status) = frame.decode() {
                found.push((*at, frame.sequence(), status));
            }
        }
    }
    found
}

fn times(sent: &[(Timestamp, Vec<u8>)]) -> Vec<u64> {
    sent.iter().map(|(at, _)| at.as_micros() / 1000).collect()
}

#[test]
fn without_faults_every_frame_passes_at_once() {
    let sent = run("", 1000);

    assert_eq!(times(&sent), (0..100).map(|n| n * 10).collect::<Vec<_>>());
    let all = statuses(&sent);
    assert!(all.iter().all(|(at, _, status)| status.time_boot_ms == at.boot_ms()));
    assert!(all.iter().enumerate().all(|(n, (_, sequence, _))| usize::from(*sequence) == n));
}

#[test]
fn the_same_seed_gives_the_same_course() {
    let all = "drop=0.2,duplicate=0.2,reorder=0.2,jitter=8ms,corrupt=0.1,truncate=0.1,garbage=0.2,split=0.3,merge=0.2";

    assert_eq!(run(all, 2000), run(all, 2000));
    assert_ne!(run(all, 2000), run_with_seed(2, all, 2000));
}

/// The share of frames that a fault takes is about its probability.
#[test]
fn frames_are_lost_doubled_and_broken_as_often_as_asked() {
    for (faults, valid) in [
        ("drop=0.25", 700..800),
        ("duplicate=0.25", 1200..1300),
        ("corrupt=0.25", 700..800),
        ("truncate=0.25", 700..810),
        ("nan=1", 1000..1001),
        ("garbage=1", 1000..1001),
        ("merge=0.5", 1000..1001),
        ("drop=1", 0..1),
    ] {
        let count = statuses(&run(faults, 10_000)).len();
        assert!(valid.contains(&count), "{faults}: {count}");
    }
}

#[test]
fn garbage_and_pieces_leave_the_stream_whole_in_the_end() {
    for faults in ["split=1", "split=0.5,merge=0.5", "garbage=0.5,split=0.3"] {
        let sent = run(faults, 2000);
        let stream: Vec<u8> = sent.iter().flat_map(|(_, bytes)| bytes.clone()).collect();

        assert!(statuses(&[(Timestamp::ZERO, stream)]).len() >= 195, "{faults}");
        assert!(sent.iter().any(|(_, bytes)| statuses(&[(Timestamp::ZERO, bytes.clone())]).len() != 1), "{faults}");
    }
}

#[test]
fn delay_and_jitter_keep_the_order_and_reorder_does_not() {
    let delayed = statuses(&run("delay=30ms", 1000));
    assert!(delayed.iter().all(|(at, _, status)| at.boot_ms() == status.time_boot_ms + 30));

    let jittered = statuses(&run("jitter=50ms", 1000));
    assert!(jittered.windows(2).all(|pair| pair[0].1 < pair[1].1));
    assert!(jittered.iter().any(|(at, _, status)| at.boot_ms() > status.time_boot_ms));

    let reordered = statuses(&run("reorder=0.2", 1000));
    assert!(reordered.windows(2).any(|pair| pair[0].1 > pair[1].1));
}

#[test]
fn nan_reaches_the_receiver_in_a_valid_frame() {
    let all = statuses(&run("nan=1", 1000));

    let hit = |status: &GIMBAL_DEVICE_ATTITUDE_STATUS_DATA| {
        let rates = [status.angular_velocity_y, status.angular_velocity_z, status.delta_yaw];
        status.q.iter().chain(&rates).filter(|float| float.is_nan()).count()
    };
    assert_eq!(all.iter().map(|(_, _, status)| hit(status)).collect::<Vec<_>>(), vec![1; 100]);
}

#[test]
fn sequence_numbers_are_left_out_and_frames_stay_valid() {
    let all = statuses(&run("sequence-gap=0.1", 1000));

    assert_eq!(all.len(), 100);
    let steps: Vec<u8> = all.windows(2).map(|pair| pair[1].1.wrapping_sub(pair[0].1)).collect();
    assert!(steps.iter().all(|step| (1..=11).contains(step)), "{steps:?}");
    assert!(steps.iter().filter(|step| **step > 1).count() > 3, "{steps:?}");
}

#[test]
fn silence_stops_sending_and_power_cut_also_starts_over() {
    let silent = statuses(&run("silence=200ms@300ms", 1000));
    assert_eq!(silent.len(), 80);
    assert!(silent.iter().all(|(at, _, status)| at.boot_ms() == status.time_boot_ms));

    let cut = statuses(&run("power-cut=200ms@300ms", 1000));
    assert_eq!(cut.len(), 80);
    assert_eq!(cut[29].0, Timestamp::from_millis(290));
    assert_eq!((cut[30].0, cut[30].1, cut[30].2.time_boot_ms), (Timestamp::from_millis(500), 0, 0));
}

#[test]
fn a_reboot_restarts_clock_and_sequence() {
    let all = statuses(&run("reboot@305ms", 600));

    let first = all.iter().find(|(at, _, _)| *at >= Timestamp::from_millis(305)).expect("it goes on");
    assert_eq!((first.0, first.1, first.2.time_boot_ms), (Timestamp::from_millis(305), 0, 0));
}

/// `time_boot_ms` wraps at 2^32.
#[test]
fn a_clock_jump_moves_time_boot_and_wraps() {
    let all = statuses(&run("clock-jump=-1s@100ms", 200));

    assert_eq!(all[9].2.time_boot_ms, 90);
    assert_eq!(all[10].2.time_boot_ms, 100_u32.wrapping_sub(1000));
}

#[test]
fn a_baud_mismatch_turns_every_byte_into_noise() {
    let sent = run("baud-mismatch=100ms@100ms", 300);

    assert_eq!(sent.len(), 30);
    assert_eq!(statuses(&sent).len(), 20);
    assert_eq!(sent[15].1.len(), sent[5].1.len());
}

#[test]
fn acks_are_lost_late_or_for_somebody_else() {
    let acks = |faults: &str| {
        let mut peer = FaultyPeer::new(Beacon::default(), faults.parse().expect(faults));
        let heartbeat = encode_to_vec(MavId::new(255, 190), 0, &HEARTBEAT_DATA::default());
        peer.handle_received(Timestamp::ZERO, &heartbeat);
        let mut found = Vec::new();
        for (at, bytes) in run_peer(&mut peer, Timestamp::ZERO, Timestamp::from_secs(1)) {
            if let Some(frame) = DatagramFrames::new(&bytes).next_frame()
                && let Some(ack) = frame.decode::<COMMAND_ACK_DATA>()
            {
                found.push((at.boot_ms(), ack.target_system, ack.target_component));
            }
        }
        found
    };

    assert_eq!(acks(""), [(0, 255, 190)]);
    assert_eq!(acks("ack-loss=1"), []);
    assert_eq!(acks("ack-delay=400ms"), [(400, 255, 190)]);
    assert_eq!(acks("ack-target=1"), [(0, 0, 191)]);
    assert_eq!(acks("deaf=1"), []);
}

/// Strangers on the line: another vehicle's autopilot, and a second device under the same ids.
#[test]
fn strangers_speak_before_the_peer() {
    let sources = |sent: &[(Timestamp, Vec<u8>)]| -> Vec<(MavId, u32)> {
        let frame = |bytes: &[u8]| {
            let frame = DatagramFrames::new(bytes).next_frame().expect("a whole frame");
            (frame.source(), frame.message_id())
        };
        sent.iter().map(|(_, bytes)| frame(bytes)).collect()
    };
    let stranger = (MavId::new(99, 1), HEARTBEAT_DATA::ID);
    let own = (SOURCE, GIMBAL_DEVICE_ATTITUDE_STATUS_DATA::ID);
    assert_eq!(sources(&run("foreign=1", 20)), [stranger, own, stranger, own]);
    assert_eq!(sources(&run("twin=1", 10)), [own, own]);
}

/// "flash-slow parameter writes (200 ms)": `PARAM_VALUE` comes late, and nothing else does.
#[test]
fn parameters_come_late_from_a_slow_memory() {
    let mut peer = FaultyPeer::new(Beacon::default(), "slow-parameters=200ms".parse().expect("a fault"));
    peer.handle_timeout(Timestamp::ZERO);
    let value =
        PARAM_VALUE_DATA { param_value: 1.0, param_count: 1, param_index: 0, param_id: "A".into(), param_type: 9 };
    peer.peer.send(&value);
    let ids = |sent: Vec<(Timestamp, Vec<u8>)>| -> Vec<(u64, u32)> {
        let id = |bytes: &[u8]| DatagramFrames::new(bytes).next_frame().expect("a whole frame").message_id();
        sent.iter().map(|(at, bytes)| (at.as_micros() / 1_000, id(bytes))).collect()
    };

    let sent = ids(run_peer(&mut peer, Timestamp::ZERO, Timestamp::from_millis(210)));

    let late: Vec<_> = sent.iter().filter(|(_, id)| *id == PARAM_VALUE_DATA::ID).collect();
    assert_eq!(late, [&(200, PARAM_VALUE_DATA::ID)]);
    let prompt = sent.iter().filter(|(_, id)| *id == GIMBAL_DEVICE_ATTITUDE_STATUS_DATA::ID);
    assert!(prompt.clone().count() >= 20 && prompt.clone().all(|(at, _)| at % 10 == 0));
}
