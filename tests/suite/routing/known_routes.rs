//! What is learned, and how it is forgotten.

use std::time::Duration;

use gimbald::bridge::settings::{Settings, SystemId};
use gimbald::wire::MavId;

use super::*;
use crate::support::world::AUTOPILOT;

/// Protocol checklist 148: "When a source system sends SYSTEM_TIME with smaller time_boot_ms, its routes are forgotten
/// and relearnt."
#[test]
fn item_148_a_restarted_system_is_learned_anew() {
    let mut rig = Rig::new();
    rig.introduce("radio", OTHER_AUTOPILOT);
    rig.introduce("peer", MavId::new(9, 100));
    let system_time = |boot_ms: u32| {
        let payload = [&[1; 8][..], &boot_ms.to_le_bytes()].concat();
        frame(OTHER_AUTOPILOT, SYSTEM_TIME, &payload)
    };
    let for_camera = addressed(GROUND, MISSION_REQUEST_LIST, (9, 100));
    for boot_ms in [50_000, 50_000, 51_000] {
        rig.deliver("radio", &system_time(boot_ms));
        assert_eq!(rig.deliver("ground", &for_camera), ["peer"]);
    }

    rig.deliver("radio", &system_time(50_999));

    // The camera is not known any more, so it is looked for where its system is.
    assert_eq!(rig.deliver("ground", &for_camera), ["radio"]);
    assert_eq!(rig.deliver("ground", &addressed(GROUND, MISSION_REQUEST_LIST, (9, 1))), ["radio"]);
    rig.introduce("peer", MavId::new(9, 100));
    assert_eq!(rig.deliver("ground", &for_camera), ["peer"]);
}

/// Protocol checklist 149: "When a route is silent for 60 s, targeted messages for it are no longer forwarded."
#[test]
fn item_149_a_silent_route_is_forgotten() {
    let mut rig = Rig::new();
    rig.introduce("radio", OTHER_AUTOPILOT);
    let message = addressed(GROUND, MISSION_REQUEST_LIST, (9, 1));

    rig.run_for(Duration::from_micros(59_999_999));
    assert_eq!(rig.deliver("ground", &message), ["radio"]);
    rig.run_for(Duration::from_micros(1));
    assert_eq!(rig.deliver("ground", &message), [""; 0]);
}

/// Protocol checklist 150: "When a source has compid 0 it is forwarded but no route is learned." The same goes for
/// system 0.
#[test]
fn item_150_sources_that_nobody_has_are_forwarded_and_not_learned() {
    for source in [MavId::new(9, 0), MavId::new(0, 9)] {
        let mut rig = Rig::new();
        for _ in 0..2 {
            assert_eq!(rig.deliver("radio", &broadcast(source, ATTITUDE)), ["autopilot", "ground", "peer"], "{source}");
        }
        assert_eq!(rig.deliver("ground", &addressed(GROUND, MISSION_REQUEST_LIST, (9, 1))), [""; 0]);
        assert_eq!(rig.world.snapshot().links[3].peers[0].components, [""; 0]);
    }
}

/// Protocol checklist 151: "When a source is known on link K and one of its frames arrives on L, that frame is not sent
/// to K."
#[test]
fn item_151_a_frame_is_not_sent_to_where_its_source_is() {
    let mut rig = Rig::new();
    rig.introduce("radio", OTHER_AUTOPILOT);
    rig.introduce("autopilot", AUTOPILOT);

    let message = broadcast(OTHER_AUTOPILOT, ATTITUDE);
    assert_eq!(rig.deliver("peer", &message), ["autopilot", "ground"]);
    // It is known on both now.
    assert_eq!(rig.deliver("radio", &message), ["autopilot", "ground"]);
    assert_eq!(rig.deliver("radio", &addressed(OTHER_AUTOPILOT, MISSION_REQUEST_LIST, (9, 0))), [""; 0]);
}

/// "Move a route when a component appears on another link (keep both for 5 s to survive redundant links)."
#[test]
fn a_component_that_moved_is_reached_at_its_new_place() {
    let mut rig = Rig::new();
    let message = addressed(GROUND, MISSION_REQUEST_LIST, (9, 1));
    rig.introduce("radio", OTHER_AUTOPILOT);
    rig.run_for(Duration::from_secs(3));
    rig.introduce("peer", OTHER_AUTOPILOT);
    assert_eq!(rig.deliver("ground", &message), ["radio", "peer"]);

    rig.run_for(Duration::from_millis(2_001));
    rig.introduce("peer", OTHER_AUTOPILOT);

    assert_eq!(rig.deliver("ground", &message), ["peer"]);
}

/// A peer that is gone takes its routes with it.
#[test]
fn a_closed_channel_is_no_route() {
    let mut rig = Rig::new();
    rig.introduce("radio", OTHER_AUTOPILOT);
    let radio = rig.place("radio");
    rig.world.unplug(radio);
    assert_eq!(rig.deliver("ground", &addressed(GROUND, MISSION_REQUEST_LIST, (9, 1))), [""; 0]);
    rig.world.plug_in(radio);
    assert_eq!(rig.deliver("ground", &addressed(GROUND, MISSION_REQUEST_LIST, (9, 1))), [""; 0]);
}

/// Whoever makes up sources displaces the longest silent, and never the vehicle that keeps speaking.
#[test]
fn a_flood_of_sources_displaces_nobody_who_speaks() {
    let mut rig = Rig::new();
    rig.introduce("autopilot", AUTOPILOT);
    let autopilot = rig.place("autopilot");
    for number in 0..2_000u32 {
        let [low, high, ..] = number.to_le_bytes();
        let source = MavId::new(10 + high, low.max(1));
        let radio = rig.place("radio");
        rig.world.send_bytes(radio, &broadcast(source, ATTITUDE));
        if number % 100 == 0 {
            rig.world.send(autopilot, AUTOPILOT, &heartbeat(2, 12));
        }
        rig.run_for(Duration::from_millis(1));
    }
    assert_eq!(rig.deliver("ground", &addressed(GROUND, MISSION_REQUEST_LIST, (1, 1))), ["autopilot"]);
    let known: usize = rig.world.snapshot().links.iter().map(|link| link.peers[0].components.len()).sum();
    assert_eq!(known, 512);
}

/// D5: "Other vehicles' systems are routed, but never gate, latch or steer."
#[test]
fn other_vehicles_on_a_ground_link_are_routed_and_nothing_else() {
    let mut rig = Rig::with(Settings { system_id: SystemId::Auto, ..Settings::default() });
    for _ in 0..8 {
        rig.introduce("autopilot", AUTOPILOT);
        rig.introduce("ground", OTHER_AUTOPILOT);
        rig.introduce("ground", MavId::new(9, 154));
        rig.run_for(Duration::from_millis(500));
    }
    assert_eq!(rig.deliver("ground", &broadcast(OTHER_AUTOPILOT, 31)), ["autopilot", "radio", "peer"]);
    assert_eq!(rig.deliver("peer", &addressed(CAMERA, MISSION_REQUEST_LIST, (9, 1))), ["ground"]);
    assert_eq!(rig.deliver("peer", &addressed(CAMERA, MISSION_REQUEST_LIST, (9, 154))), ["ground"]);

    // A take-over and an angle for our gimbal, from the other vehicle.
    rig.introduce("gimbal", MavId::new(1, 154));
    rig.run_for(Duration::from_secs(6));
    for number in [1001, 1000] {
        let place = rig.place("ground");
        rig.world.send_bytes(place, &command(OTHER_AUTOPILOT, COMMAND_LONG, number, (1, 191)));
    }

    let snapshot = rig.world.snapshot();
    assert_eq!(snapshot.system_id, Some(1));
    assert_eq!(snapshot.vehicle.attitude_age_ms, None);
    assert_eq!(snapshot.gimbals.len(), 1, "{:?}", snapshot.gimbals);
    assert_eq!((&snapshot.gimbals[0].primary, &snapshot.gimbals[0].setpoint), (&None, &None));
    assert_eq!(snapshot.gimbals[0].rejected["9/1"]["other_vehicle"], 2);
    let at_gimbal = rig.world.take(rig.place("gimbal"));
    assert_eq!(at_gimbal.iter().filter(|arrival| arrival.id() == 284).count(), 0);
}
