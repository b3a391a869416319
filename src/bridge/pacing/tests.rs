use super::*;
use crate::wire::dialect::{
    ATTITUDE_DATA, COMMAND_ACK_DATA, COMMAND_LONG_DATA, GIMBAL_DEVICE_SET_ATTITUDE_DATA, HEARTBEAT_DATA,
    PARAM_REQUEST_LIST_DATA,
};
use crate::wire::{DatagramFrames, encode_to_vec};

/// "paced to the baud rate": what is given out in a second is what the wire can carry in it.
#[test]
fn a_full_line_is_filled_and_not_overfilled() {
    let mut queue = SerialQueue::new(115_200);
    let mut sent = 0;
    for millis in 0..1_000 {
        let now = Timestamp::from_millis(millis);
        push(&mut queue, now, &attitude(millis as u8));
        while let Some(bytes) = pop(&mut queue, now) {
            sent += bytes.len();
        }
    }
    assert!((10_900..=11_520).contains(&sent), "{sent} bytes in a second at 115200 baud");
}

/// "control first": a command waits for nothing but the frame in progress.
#[test]
fn control_overtakes_telemetry() {
    let mut queue = SerialQueue::new(115_200);
    push(&mut queue, Timestamp::ZERO, &attitude(0));
    push(&mut queue, Timestamp::ZERO, &attitude(1));
    push(&mut queue, Timestamp::ZERO, &ack(7));

    assert_eq!(pop(&mut queue, Timestamp::ZERO), Some(ack(7)));
    assert_eq!(pop(&mut queue, Timestamp::ZERO), None);
    let free = queue.poll_timeout().expect("telemetry waits");
    assert_eq!(pop(&mut queue, free), Some(attitude(0)));
}

/// "the newest setpoint replaces the queued one".
#[test]
fn the_newest_setpoint_replaces_the_queued_one() {
    let mut queue = SerialQueue::new(57_600);
    push(&mut queue, Timestamp::ZERO, &setpoint(1, 0.1));
    push(&mut queue, Timestamp::ZERO, &setpoint(2, 0.2));

    assert_eq!(pop(&mut queue, Timestamp::ZERO), Some(setpoint(2, 0.2)));
    assert_eq!(queue.poll_timeout(), None);
    assert_eq!(queue.dropped(), &BTreeMap::from([(REPLACED, 1)]));
}

/// "bounded in time": telemetry that could not be sent in time is not sent late.
#[test]
fn stale_telemetry_is_dropped_and_counted() {
    let mut queue = SerialQueue::new(57_600);
    push(&mut queue, Timestamp::ZERO, &attitude(0));
    push(&mut queue, Timestamp::from_millis(290), &attitude(1));

    assert_eq!(pop(&mut queue, Timestamp::from_millis(301)), Some(attitude(1)));
    assert_eq!(queue.dropped(), &BTreeMap::from([(STALE, 1)]));
}

/// "old frames discarded on reopening".
#[test]
fn nothing_waits_over_a_reopening() {
    let mut queue = SerialQueue::new(57_600);
    push(&mut queue, Timestamp::ZERO, &ack(1));
    queue.clear();
    assert_eq!(pop(&mut queue, Timestamp::from_secs(1)), None);
    assert_eq!(queue.dropped(), &BTreeMap::from([(LINK_DOWN, 1)]));
}

/// "When a link's output queue is full, stream frames are dropped before COMMAND_*" (Protocol checklist 155).
#[test]
fn a_full_queue_drops_telemetry_before_control_and_the_oldest_first() {
    let mut queue = SerialQueue::new(921_600);
    for n in 0..100 {
        push(&mut queue, Timestamp::ZERO, &attitude(n));
        push(&mut queue, Timestamp::ZERO, &ack(n));
    }
    assert_eq!(queue.dropped(), &BTreeMap::from([(QUEUE_FULL, 200 - SLOTS as u64)]));
    let sent = drain(&mut queue);
    let expected = (0..100).map(ack).chain((72..100).map(attitude));
    assert_eq!(sent, expected.collect::<Vec<_>>());
}

#[test]
fn a_flood_of_control_is_bounded_and_the_newest_frames_stay() {
    let mut queue = SerialQueue::new(57_600);
    for n in 0..200 {
        push(&mut queue, Timestamp::ZERO, &ack(n));
    }
    assert_eq!(queue.dropped(), &BTreeMap::from([(QUEUE_FULL, 200 - SLOTS as u64)]));
    assert_eq!(drain(&mut queue), (72..200).map(ack).collect::<Vec<_>>());
}

/// What we tell a gimbal leaves before others' commands, however many there are, and is not dropped for them.
#[test]
fn our_own_control_passes_a_flood_of_others_commands() {
    let mut queue = SerialQueue::new(115_200);
    for n in 0..200 {
        push(&mut queue, Timestamp::ZERO, &ack(n));
    }
    push_own(&mut queue, Timestamp::ZERO, &setpoint(1, 0.0));
    for n in 200..=255 {
        push(&mut queue, Timestamp::ZERO, &ack(n));
    }
    assert_eq!(drain(&mut queue), [setpoint(1, 0.0)].into_iter().chain((129..=255).map(ack)).collect::<Vec<_>>());
}

/// Nor do we take the whole line from others: after four frames of ours one of theirs has its turn.
#[test]
fn others_commands_keep_a_share_of_the_line() {
    let mut queue = SerialQueue::new(115_200);
    let own = |n| command(n, command::REQUEST_MESSAGE);
    for n in 0..3 {
        push(&mut queue, Timestamp::ZERO, &ack(n));
    }
    for n in 0..12 {
        push_own(&mut queue, Timestamp::ZERO, &own(n));
    }
    let expected = (0..3).flat_map(|n| (4 * n..4 * n + 4).map(own).chain([ack(n)]));
    assert_eq!(drain(&mut queue), expected.collect::<Vec<_>>());
}

/// A gimbal that hears no heartbeat any more believes its vehicle gone: commands leave a share to what it needs, and
/// what others address to it does not push ours out.
#[test]
fn our_heartbeat_passes_a_flood_of_what_others_send() {
    let mut queue = SerialQueue::new(115_200);
    for n in 0..86 {
        push(&mut queue, Timestamp::ZERO, &ack(n));
    }
    push_own(&mut queue, Timestamp::ZERO, &heartbeat());
    for n in 0..100 {
        push(&mut queue, Timestamp::ZERO, &parameter_request(n));
    }
    let sent = drain(&mut queue);
    assert_eq!(sent.iter().position(|frame| *frame == heartbeat()), Some(8));
}

/// Everything that waits, at the pace of the line.
fn drain(queue: &mut SerialQueue) -> Vec<Vec<u8>> {
    let mut sent = Vec::new();
    while let Some(at) = queue.poll_timeout() {
        sent.extend(pop(queue, at));
    }
    sent
}

fn pop(queue: &mut SerialQueue, now: Timestamp) -> Option<Vec<u8>> {
    queue.pop(now).map(|departure| departure.bytes.to_vec())
}

fn push(queue: &mut SerialQueue, now: Timestamp, bytes: &[u8]) {
    queue.push(now, &DatagramFrames::new(bytes).next_frame().expect("one frame"), Origin::Forwarded);
}

fn push_own(queue: &mut SerialQueue, now: Timestamp, bytes: &[u8]) {
    queue.push(now, &DatagramFrames::new(bytes).next_frame().expect("one frame"), Origin::Own);
}

fn heartbeat() -> Vec<u8> {
    let (mavtype, autopilot, base_mode, custom_mode, system_status, mavlink_version) = (18, 8, 0, 0, 4, 3);
    let message = HEARTBEAT_DATA { mavtype, autopilot, base_mode, custom_mode, system_status, mavlink_version };
    encode_to_vec(MavId::new(1, 191), 0, &message)
}

fn parameter_request(sequence: u8) -> Vec<u8> {
    let message = PARAM_REQUEST_LIST_DATA { target_system: 1, target_component: 154 };
    encode_to_vec(MavId::new(255, 190), sequence, &message)
}

fn command(sequence: u8, number: u16) -> Vec<u8> {
    let message = COMMAND_LONG_DATA {
        param1: 283.0,
        command: number,
        target_system: 1,
        target_component: 154,
        ..COMMAND_LONG_DATA::DEFAULT
    };
    encode_to_vec(MavId::new(1, 191), sequence, &message)
}

fn attitude(sequence: u8) -> Vec<u8> {
    let message = ATTITUDE_DATA { time_boot_ms: 1, yawspeed: 1.0, ..ATTITUDE_DATA::DEFAULT };
    encode_to_vec(MavId::new(1, 1), sequence, &message)
}

fn ack(sequence: u8) -> Vec<u8> {
    let message = COMMAND_ACK_DATA {
        command: 1000,
        result: 0,
        progress: 255,
        result_param2: 0,
        target_system: 1,
        target_component: 154,
    };
    encode_to_vec(MavId::new(255, 190), sequence, &message)
}

fn setpoint(sequence: u8, rate: f32) -> Vec<u8> {
    let message = GIMBAL_DEVICE_SET_ATTITUDE_DATA {
        q: [f32::NAN; 4],
        angular_velocity_x: f32::NAN,
        angular_velocity_y: rate,
        angular_velocity_z: 0.0,
        flags: 44,
        target_system: 1,
        target_component: 154,
    };
    encode_to_vec(MavId::new(1, 191), sequence, &message)
}
