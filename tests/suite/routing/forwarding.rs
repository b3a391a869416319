//! Broadcasts, targets, and that nothing is altered on the way.

use std::time::Duration;

use gimbald::wire::MavId;

use super::*;
use crate::support::wire::frame_v1;
use crate::support::world::{AUTOPILOT, GIMBAL};

/// Protocol checklist 8: "When one bit of a known message's payload is flipped, the frame is neither processed nor
/// forwarded, and the crc-error counter of that link rises by one."
#[test]
fn item_8_a_damaged_frame_is_not_forwarded() {
    let whole = broadcast(GROUND, ATTITUDE);
    for bit in 0..8 * 28 {
        let mut rig = Rig::new();
        let mut damaged = whole.clone();
        damaged[10 + bit / 8] ^= 1 << (bit % 8);

        assert_eq!(rig.deliver("ground", &damaged), [""; 0], "bit {bit}");
        assert_eq!(rig.world.snapshot().links[2].crc_errors, 1);
    }
}

/// Protocol checklist 9: "When a valid frame follows directly after a corrupted one in the same read, the valid one is
/// processed."
#[test]
fn item_9_the_frame_behind_a_damaged_one_is_forwarded() {
    let mut rig = Rig::new();
    let good = addressed(GROUND, COMMAND_ACK, (9, 1));
    let mut damaged = good.clone();
    damaged[12] ^= 1;
    rig.introduce("peer", OTHER_AUTOPILOT);
    let place = rig.place("ground");
    rig.world.send_bytes(place, &[&damaged[..], &good[..]].concat());

    let arrived: Vec<Vec<u8>> = rig.world.take(rig.place("peer")).into_iter().map(|arrival| arrival.bytes).collect();
    assert_eq!(arrived, [good]);
}

/// Protocol checklist 10: "When a v1 HEARTBEAT (GV-2) arrives on any link, it is processed and forwarded
/// byte-identically as v1."
#[test]
fn item_10_a_frame_of_version_1_stays_one() {
    // A heartbeat of 1/154, a gimbal.
    let heartbeat = frame_v1(0, 50, 3, &[0, 0, 0, 0, 26, 8, 0, 4, 3]);
    for from in ["autopilot", "ground", "radio", "peer"] {
        let mut rig = Rig::new();
        let place = rig.place(from);
        rig.world.send_bytes(place, &heartbeat);
        for to in ["autopilot", "gimbal", "ground", "radio", "peer"] {
            let arrived = rig.world.take(rig.place(to));
            let copies = arrived.iter().filter(|arrival| arrival.bytes == heartbeat).count();
            assert_eq!(copies, usize::from(to != from), "from {from} to {to}");
        }
        assert_eq!(rig.world.snapshot().gimbals[0].device.as_deref(), Some("1/154"), "it is processed");
    }
}

/// Protocol checklist 11: "When a 285 carries flag bits 1024..32768, it is still processed (bits ignored) and forwarded
/// unchanged."
#[test]
fn item_11_flags_that_nobody_knows_do_not_stop_a_frame() {
    let mut rig = Rig::new();
    rig.introduce("gimbal", GIMBAL);
    let mut payload = [0; 40];
    // q is (1, 0, 0, 0); the flags have the vehicle frame and every undefined bit.
    payload[4..8].copy_from_slice(&1f32.to_le_bytes());
    payload[36..38].copy_from_slice(&(0xfc00u16 | 32).to_le_bytes());
    let status = frame(GIMBAL, 285, &payload);

    assert_eq!(rig.deliver_amid_ours("gimbal", &status), ["autopilot", "ground", "radio", "peer"]);
    assert_eq!(rig.world.snapshot().gimbals[0].attitude.pitch_deg.map(f64::abs), Some(0.0));
}

/// Protocol checklist 142: "When a broadcast (no target or 0) arrives on L, it is sent on all other links, not on L."
#[test]
fn item_142_a_broadcast_goes_to_all_other_links() {
    let mut rig = Rig::new();
    let everybody = ["autopilot", "ground", "radio", "peer"];
    for (at, from) in everybody.into_iter().enumerate() {
        let source = MavId::new(20 + at as u8, 1);
        let others: Vec<_> = everybody.into_iter().filter(|to| *to != from).collect();
        assert_eq!(rig.deliver(from, &broadcast(source, ATTITUDE)), others, "no target, from {from}");
        assert_eq!(rig.deliver(from, &addressed(source, MISSION_REQUEST_LIST, (0, 0))), others, "0/0, from {from}");
        assert_eq!(rig.deliver(from, &addressed(source, MISSION_REQUEST_LIST, (0, 7))), others, "0/7, from {from}");
    }
}

/// Protocol checklist 143: "When a message for 9/1 arrives and 9/x was seen on K only, it is sent on K only; if 9 was
/// never seen, on none."
#[test]
fn item_143_another_system_is_looked_for_where_it_was_seen() {
    let mut rig = Rig::new();
    let message = addressed(GROUND, MISSION_REQUEST_LIST, (9, 1));
    assert_eq!(rig.deliver("ground", &message), [""; 0]);

    rig.introduce("radio", MavId::new(9, 7));

    assert_eq!(rig.deliver("ground", &message), ["radio"]);
    assert_eq!(rig.deliver("ground", &addressed(GROUND, MISSION_REQUEST_LIST, (9, 0))), ["radio"]);
    // Once the exact pair is known, that is where it goes.
    rig.introduce("peer", OTHER_AUTOPILOT);
    assert_eq!(rig.deliver("ground", &message), ["peer"]);
    assert_eq!(rig.deliver("ground", &addressed(GROUND, MISSION_REQUEST_LIST, (9, 0))), ["radio", "peer"]);
}

/// Protocol checklist 144: "When a message for S/154 arrives from the GCS link, it is sent on the gimbal link only."
/// Of our own system an unknown component is nowhere.
#[test]
fn item_144_a_component_of_our_system_is_where_exactly_it_was_heard() {
    let mut rig = Rig::new();
    rig.introduce("autopilot", AUTOPILOT);
    rig.introduce("gimbal", GIMBAL);

    assert_eq!(rig.deliver("ground", &addressed(GROUND, MISSION_REQUEST_LIST, (1, 154))), ["gimbal"]);
    assert_eq!(rig.deliver("ground", &addressed(GROUND, MISSION_REQUEST_LIST, (1, 1))), ["autopilot"]);
    assert_eq!(rig.deliver("ground", &addressed(GROUND, MISSION_REQUEST_LIST, (1, 155))), [""; 0]);
}

/// Protocol checklist 145: "When a COMMAND_LONG whose target bytes are truncated arrives, it is treated as 0/0."
#[test]
fn item_145_a_truncated_target_is_everybody() {
    let mut rig = Rig::new();
    rig.introduce("autopilot", AUTOPILOT);
    // RUN_PREARM_CHECKS, which is none of ours.
    let whole = command(GROUND, COMMAND_LONG, 401, (0, 0));
    let truncated = frame(GROUND, COMMAND_LONG, &whole[10..40]);

    assert_eq!(rig.deliver("ground", &truncated), ["autopilot", "gimbal", "radio", "peer"]);
}

/// Protocol checklist 146: "When a message with an unknown id arrives, it is forwarded to all other links unchanged."
/// It could not be checked, so nothing is learned from it; and a gimbal gets only what it knows (D14).
#[test]
fn item_146_an_unknown_message_is_forwarded_and_teaches_nothing() {
    let mut rig = Rig::new();
    let unknown = unchecked_frame(OTHER_AUTOPILOT, 54_321, 99, &[1, 2, 3, 0, 0]);

    assert_eq!(rig.deliver("radio", &unknown), ["autopilot", "ground", "peer"]);
    assert_eq!(rig.dropped("gimbal", "not_for_gimbal"), 1);
    assert_eq!(rig.deliver("ground", &addressed(GROUND, MISSION_REQUEST_LIST, (9, 1))), [""; 0]);
}

/// Protocol checklist 147: "When any frame is forwarded, output bytes equal input bytes, including signature,
/// untruncated zeros and sequence."
#[test]
fn item_147_frames_are_forwarded_byte_for_byte() {
    let mut signed = broadcast(GROUND, ATTITUDE);
    signed[2] = 1;
    let end = signed.len() - 2;
    let sum = crate::support::wire::checksum(&signed[1..end], 39);
    signed[end..].copy_from_slice(&sum.to_le_bytes());
    signed.extend([5, 1, 2, 3, 4, 5, 6, 9, 8, 7, 6, 5, 4]);
    let untruncated = frame(GROUND, ATTITUDE, &[0; 28]);
    let truncated = frame(GROUND, ATTITUDE, &[7]);
    let longer_than_known = frame(GROUND, ATTITUDE, &[3; 40]);
    let v1 = frame_v1(30, 39, 200, &[0; 28]);

    for (what, bytes) in [
        ("signed", signed),
        ("untruncated zeros", untruncated),
        ("truncated", truncated),
        ("with fields of a later definition", longer_than_known),
        ("version 1", v1),
    ] {
        assert_eq!(Rig::new().deliver("ground", &bytes), ["autopilot", "radio", "peer"], "{what}");
    }
}

/// Protocol checklist 152: "When MANUAL_CONTROL (69) has target = S at offset 10, it is routed as system-targeted."
#[test]
fn item_152_the_target_of_manual_control_is_a_system() {
    let mut rig = Rig::new();
    rig.introduce("autopilot", AUTOPILOT);
    rig.introduce("radio", OTHER_AUTOPILOT);
    let for_system = |system| {
        let mut payload = [1; 11];
        payload[10] = system;
        frame(GROUND, MANUAL_CONTROL, &payload)
    };

    assert_eq!(rig.deliver("ground", &for_system(1)), ["autopilot"]);
    assert_eq!(rig.deliver("ground", &for_system(9)), ["radio"]);
    assert_eq!(rig.deliver("ground", &for_system(8)), [""; 0]);
}

/// Protocol checklist 154: "When two UDP peers talk to one listening socket, each gets its own route set, and frames
/// from one are forwarded to the other."
#[test]
fn item_154_peers_of_one_link_reach_each_other() {
    let mut rig = Rig::new();
    rig.open_beside("ground", "tablet");
    let tablet = MavId::new(254, 190);
    rig.introduce("ground", GROUND);
    rig.introduce("tablet", tablet);

    assert_eq!(rig.deliver("ground", &broadcast(GROUND, ATTITUDE)), ["autopilot", "radio", "peer", "tablet"]);
    assert_eq!(rig.deliver("tablet", &addressed(tablet, MISSION_REQUEST_LIST, (255, 190))), ["ground"]);
    assert_eq!(rig.deliver("peer", &addressed(CAMERA, MISSION_REQUEST_LIST, (254, 190))), ["tablet"]);
}

/// Protocol checklist 156: "When RADIO_STATUS arrives on the GCS radio link it is not sent to the AP link by default."
#[test]
fn item_156_the_state_of_a_radio_is_kept_from_the_autopilot() {
    let mut rig = Rig::new();
    let radio = MavId::new(51, 68);
    for (count, id) in [(1, 109), (2, 166)] {
        assert_eq!(rig.deliver("radio", &broadcast(radio, id)), ["ground", "peer"]);
        assert_eq!(rig.dropped("autopilot", "not_for_autopilot"), count);
    }
}

/// Protocol checklist 134: "When an ACK for somebody else arrives, it is forwarded and does not complete our
/// transaction." We ask the autopilot for messages that it does not send; a refusal would end the asking.
#[test]
fn item_134_an_answer_to_somebody_else_is_only_forwarded() {
    let requests = |answer: Option<(u8, u8)>| {
        let mut rig = Rig::new();
        rig.introduce("ground", GROUND);
        let place = rig.place("autopilot");
        let mut asked = 0;
        for _ in 0..40 {
            rig.world.send(place, AUTOPILOT, &heartbeat(2, 12));
            rig.world.run_for(Duration::from_millis(500));
            let arrived = rig.world.take(place);
            let new = arrived.iter().filter(|arrival| arrival.id() == COMMAND_LONG).count();
            asked += new;
            if let Some(target) = answer.filter(|_| new > 0) {
                // 511 is denied.
                let denied = frame(AUTOPILOT, COMMAND_ACK, &[0xff, 0x01, 2, 0, 0, 0, 0, 0, target.0, target.1]);
                rig.world.forget();
                rig.world.send_bytes(place, &denied);
                let at_ground: Vec<Vec<u8>> =
                    rig.world.take(rig.place("ground")).into_iter().map(|arrival| arrival.bytes).collect();
                assert_eq!(at_ground.contains(&denied), target == (255, 190));
            }
        }
        asked
    };
    let unanswered = requests(None);
    assert!(unanswered >= 4, "it is asked again and again: {unanswered}");
    assert_eq!(requests(Some((255, 190))), unanswered);
    assert!(requests(Some((1, 191))) < unanswered);
}
