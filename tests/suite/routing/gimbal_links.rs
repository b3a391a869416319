//! D14: what a link of role `gimbal` gets: "frames addressed to a component known there, COMMAND_* and PARAM_* to our
//! system or to 0, HEARTBEAT, SYSTEM_TIME, TIMESYNC, 286, our 281 (and 60011), and what the family lists; cameras and
//! payloads living there are components known there. The rest is counted `not_for_gimbal`."

use std::collections::BTreeSet;

use gimbald::bridge::settings::{Settings, SystemId};
use gimbald::wire::target::known_messages;

use super::*;
use crate::support::world::{AUTOPILOT, GIMBAL, three_links};

/// What passes when it is said to all, or to our whole system.
const FOR_EVERY_GIMBAL: [u32; 14] = [0, 2, 20, 21, 23, 75, 76, 77, 80, 111, 286, 320, 321, 323];

/// What steers a gimbal, and so comes from its manager only (R15).
const FIREWALLED: [u32; 3] = [156, 157, 284];

fn rig() -> Rig {
    let mut rig = Rig::new();
    rig.introduce("gimbal", GIMBAL);
    rig.introduce("gimbal", CAMERA);
    rig
}

/// Every message that the definitions hold, without a target, to 0/0, and to our system.
#[test]
fn d14_of_what_is_said_to_all_a_gimbal_gets_what_it_uses() {
    let mut rig = rig();
    let (mut passed, mut counted) = (BTreeSet::new(), 0);
    for shape in known_messages() {
        let with_target = shape.system_offset.is_some();
        // What the firewall keeps away, and what a manager would answer, have tests of their own.
        if FIREWALLED.contains(&shape.id) || (282..=288).contains(&shape.id) && shape.id != 286 {
            continue;
        }
        let frames = match with_target {
            true => vec![addressed(GROUND, shape.id, (0, 0)), addressed(GROUND, shape.id, (1, 0))],
            // A heartbeat of zeros would be that of another vehicle's autopilot.
            false if shape.id == HEARTBEAT => vec![frame(GROUND, HEARTBEAT, &[0, 0, 0, 0, 6, 8, 0, 4, 3])],
            false => vec![broadcast(GROUND, shape.id)],
        };
        for bytes in frames {
            let passes = rig.deliver_amid_ours("ground", &bytes).contains(&"gimbal");
            assert_eq!(passes, FOR_EVERY_GIMBAL.contains(&shape.id), "{}", shape.name);
            counted += u64::from(!passes);
            if passes {
                passed.insert(shape.id);
            }
            assert_eq!(rig.dropped("gimbal", "not_for_gimbal"), counted, "{}", shape.name);
        }
    }
    assert_eq!(passed, BTreeSet::from(FOR_EVERY_GIMBAL));
}

/// "frames addressed to a component known there … cameras and payloads living there are components known there".
#[test]
fn d14_what_is_addressed_to_a_component_there_passes() {
    let mut rig = rig();
    for shape in known_messages().iter().filter(|shape| shape.component_offset.is_some()) {
        if FIREWALLED.contains(&shape.id) {
            continue;
        }
        for component in [154, 100] {
            let bytes = addressed(GROUND, shape.id, (1, component));
            assert_eq!(rig.deliver("ground", &bytes), ["gimbal"], "{} to 1/{component}", shape.name);
        }
    }
    assert_eq!(rig.dropped("gimbal", "not_for_gimbal"), 0);
}

/// A component that is looked for where its system is (rule R5) is not "known there".
#[test]
fn d14_what_is_addressed_to_an_unknown_component_of_another_system_does_not_pass() {
    let mut rig = rig();
    rig.introduce("gimbal", MavId::new(9, 100));
    assert_eq!(rig.deliver("ground", &addressed(GROUND, MISSION_REQUEST_LIST, (9, 100))), ["gimbal"]);
    assert_eq!(rig.deliver("ground", &addressed(GROUND, MISSION_REQUEST_LIST, (9, 1))), [""; 0]);
    assert_eq!(rig.dropped("gimbal", "not_for_gimbal"), 1);
}

/// 286 is for every gimbal of our vehicle, also for one that was not heard yet, and however it is addressed.
#[test]
fn d14_the_state_of_the_vehicle_reaches_every_gimbal() {
    for target in [(0, 0), (1, 0)] {
        let mut rig = Rig::new();
        rig.introduce("autopilot", AUTOPILOT);
        assert!(rig.deliver("autopilot", &addressed(AUTOPILOT, 286, target)).contains(&"gimbal"), "{target:?}");
        rig.introduce("ground", OTHER_AUTOPILOT);
        for other in [(9, 0), (0, 0)] {
            let reached = rig.deliver("ground", &addressed(OTHER_AUTOPILOT, 286, other));
            assert!(!reached.contains(&"gimbal"), "another vehicle's, to {other:?}, is not for ours");
        }
    }
}

/// A gimbal takes the system id of the first heartbeat that it hears, so that is to be ours.
#[test]
fn d14_nothing_passes_before_our_system_id_is_settled() {
    let mut rig = Rig::with(Settings { system_id: SystemId::Auto, ..Settings::default() });
    let place = rig.place("ground");
    rig.world.send(place, GROUND, &heartbeat(6, 8));
    assert_eq!(rig.world.take(rig.place("gimbal")), []);
    assert_eq!(rig.dropped("gimbal", "not_for_gimbal"), 1);
}

/// "our 281": a gimbal gets what we say to it, our heartbeat and our status; what we tell clients it does not get.
#[test]
fn d14_of_our_own_messages_a_gimbal_gets_what_it_uses() {
    let (mut world, places) = World::with_one_gimbal(three_links());
    // 512 for 280.
    let mut payload = [0; 33];
    payload[..4].copy_from_slice(&280f32.to_le_bytes());
    payload[28..33].copy_from_slice(&[0, 2, 1, 191, 1]);
    world.send_bytes(places.ground, &frame(GROUND, COMMAND_LONG, &payload));
    world.run_for(Duration::from_secs(12));

    let ours = |arrivals: Vec<crate::support::world::Arrival>| -> BTreeSet<u32> {
        arrivals.iter().filter(|arrival| arrival.source() == MANAGER).map(|arrival| arrival.id()).collect()
    };
    // The command is what its driver asks of it.
    assert_eq!(ours(world.take(places.gimbal)), BTreeSet::from([HEARTBEAT, COMMAND_LONG, 281]));
    assert!(ours(world.take(places.ground)).contains(&280));
}

/// Protocol checklist 44: "When 512(283) for S/154 is directed to the device, it is forwarded to the gimbal link and
/// *not* answered by us."
#[test]
fn item_44_a_request_to_the_device_is_its_own_to_answer() {
    let mut rig = rig();
    let mut payload = [0; 33];
    payload[..4].copy_from_slice(&283f32.to_le_bytes());
    payload[28..33].copy_from_slice(&[0, 2, 1, 154, 1]);
    assert_eq!(rig.deliver("ground", &frame(GROUND, COMMAND_LONG, &payload)), ["gimbal"]);
}

/// Protocol checklist 127: "When 195 is addressed to S/154, it is forwarded to the device and not executed by us."
#[test]
fn item_127_a_region_of_interest_for_the_device_is_not_ours() {
    let mut rig = rig();
    for id in [COMMAND_LONG, COMMAND_INT] {
        assert_eq!(rig.deliver("ground", &command(GROUND, id, 195, (1, 154))), ["gimbal"]);
    }
    assert_eq!(rig.world.snapshot().gimbals[0].roi, None);
}

/// "never a wrong id": a gimbal that has just been switched on takes the system id of an autopilot that it hears, and
/// that must not be another vehicle's. Nor are their commands for it, such as PX4's request of 283 of everybody.
#[test]
fn d14_what_other_vehicles_say_to_all_is_not_for_our_gimbal() {
    let mut rig = rig();
    rig.introduce("autopilot", AUTOPILOT);
    let beat = frame(OTHER_AUTOPILOT, HEARTBEAT, &[0, 0, 0, 0, 2, 12, 0, 4, 3]);
    assert_eq!(rig.deliver("ground", &beat), ["autopilot", "radio", "peer"]);
    for id in [SYSTEM_TIME, COMMAND_LONG, 21, 111] {
        let shape = message_shape(id).expect("a known message");
        let bytes = |source, target| match shape.system_offset {
            Some(_) => addressed(source, id, target),
            None => broadcast(source, id),
        };
        assert!(!rig.deliver("ground", &bytes(OTHER_AUTOPILOT, (0, 0))).contains(&"gimbal"), "{}", shape.name);
        assert!(!rig.deliver("ground", &bytes(MavId::new(9, 154), (0, 0))).contains(&"gimbal"), "{}", shape.name);
        assert!(rig.deliver_amid_ours("autopilot", &bytes(AUTOPILOT, (0, 0))).contains(&"gimbal"), "{}", shape.name);
    }
    // What is addressed to it is delivered.
    assert_eq!(rig.deliver("ground", &addressed(OTHER_AUTOPILOT, MISSION_REQUEST_LIST, (1, 154))), ["gimbal"]);
}

/// Protocol notes 4.4: "never let a GCS heartbeat be the first one", also for a gimbal that was lost and starts again.
#[test]
fn d14_a_gimbal_that_starts_again_hears_no_ground_station_first() {
    let mut rig = rig();
    rig.introduce("autopilot", AUTOPILOT);
    let station = frame(GROUND, HEARTBEAT, &[0, 0, 0, 0, 6, 8, 0, 4, 3]);
    let autopilot = frame(AUTOPILOT, HEARTBEAT, &[0, 0, 0, 0, 2, 12, 0, 4, 3]);
    assert!(rig.deliver_amid_ours("ground", &station).contains(&"gimbal"));

    rig.run_for(Duration::from_secs(4));
    let before = rig.dropped("gimbal", "not_for_gimbal");
    assert!(!rig.deliver_amid_ours("ground", &station).contains(&"gimbal"), "it is lost");
    assert_eq!(rig.dropped("gimbal", "not_for_gimbal"), before + 1);
    assert!(rig.deliver_amid_ours("autopilot", &autopilot).contains(&"gimbal"));

    rig.introduce("gimbal", GIMBAL);
    assert!(rig.deliver_amid_ours("ground", &station).contains(&"gimbal"), "it is there again");
}
