//! Who sees whom: the autopilot the presented device and not the gimbal, everybody else the gimbal and one manager.

use gimbald::bridge::Input;
use gimbald::bridge::settings::{Role, Settings, SystemId, Transport};
use gimbald::gimbals::settings::GimbalSettings;
use gimbald::timestamp::Timestamp;
use gimbald::wire::MavId;
use gimbald::wire::dialect::{
    AUTOPILOT_STATE_FOR_GIMBAL_DEVICE_DATA, GIMBAL_DEVICE_ATTITUDE_STATUS_DATA, GIMBAL_DEVICE_INFORMATION_DATA,
    GIMBAL_MANAGER_INFORMATION_DATA, GIMBAL_MANAGER_STATUS_DATA, MavMessage,
};

use super::{EVERYBODY, PERIOD, SECOND, introduce, of_device, presenting, setpoint, with_device};
use crate::support::script::{
    ardupilot_heartbeat, autopilot_state, command_long, device_information, device_status, gimbal_heartbeat, ids,
    request_message, usual_capabilities,
};
use crate::support::world::{AUTOPILOT, GCS, GIMBAL, MANAGER, World, link};

/// "The real 154 (its heartbeat, 283, 285, everything from it) is not forwarded to the autopilot's link"; others get it as
/// ever. Counted.
#[test]
fn the_real_gimbal_is_not_seen_by_the_autopilot() {
    let (mut world, places) = with_device(presenting());
    let messages = [
        gimbal_heartbeat(),
        MavMessage::GIMBAL_DEVICE_INFORMATION(device_information(world.now, usual_capabilities())),
        MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(device_status(world.now, 44, -5.0, 10.0)),
        command_long(AUTOPILOT, 512, &[1.0]),
    ];
    for message in &messages {
        world.send(places.gimbal, GIMBAL, message);
    }
    assert_eq!(world.take(places.autopilot), []);
    assert_eq!(of_device(world.take(places.ground)).len(), 3);
    let dropped = &world.snapshot().links[0].dropped;
    // Three of them were there before, when the gimbal introduced itself.
    assert_eq!(dropped.get("presented_instead"), Some(&7), "{dropped:?}");
}

/// "only frames identical to ones that we sent are dropped" (D20) are about what comes back: the gimbal itself may say on its
/// own link, to the byte, what we say under its id to the autopilot.
#[test]
fn a_gimbal_that_says_the_same_as_the_presented_device_is_heard() {
    let (mut world, places) = with_device(presenting());
    world.run_for(SECOND);
    let said = of_device(world.take(places.autopilot)).pop().expect("it beats").bytes;
    world.forget();
    world.send_bytes(places.gimbal, &said);
    assert_eq!(of_device(world.take(places.ground)).len(), 1);
    assert_eq!(world.snapshot().links[1].dropped.get("loop"), None);
    world.send_bytes(places.ground, &said);
    assert_eq!(world.snapshot().links[2].dropped.get("loop"), Some(&1));
}

/// Nor does the manager speak there for a gimbal that is no v2 device: who asks everybody for 283, as PX4 does, hears of one
/// device. A ground station that asks everybody elsewhere hears of the gimbal.
#[test]
fn who_asks_everybody_hears_of_one_device() {
    use gimbald::gimbals::mavlink_v1::sim::{Device, DeviceSettings};
    let (mut world, places) = World::empty(presenting());
    world.install(places.gimbal, Device::new(Timestamp::ZERO, DeviceSettings::default()));
    world.run_with(15 * SECOND, &[(SECOND, places.autopilot, AUTOPILOT, ardupilot_heartbeat())]);
    assert_eq!(world.snapshot().gimbals[0].family, "mavlink_v1");
    world.forget();
    let question = request_message(EVERYBODY, 283);
    for (place, asker, from) in [(places.autopilot, AUTOPILOT, GIMBAL), (places.ground, GCS, MANAGER)] {
        let answers = world.ask(place, asker, &question);
        let told = answers.iter().filter(|arrival| arrival.id() == 283);
        assert_eq!(told.map(|arrival| arrival.source()).collect::<Vec<_>>(), [from]);
    }
}

/// Also while our system id is not settled, so that the device is not presented yet: ArduPilot would take what it sees in the
/// meantime for the device, and drive both.
#[test]
fn the_real_gimbal_is_not_seen_before_the_device_is() {
    let (mut world, places) = World::empty(Settings { system_id: SystemId::Auto, ..presenting() });
    let beats = [
        (SECOND, places.autopilot, AUTOPILOT, ardupilot_heartbeat()),
        (SECOND / 10, places.gimbal, GIMBAL, gimbal_heartbeat()),
    ];
    world.run_with(SECOND * 5 / 2, &beats);
    assert_eq!(world.snapshot().system_id, None);
    assert_eq!(of_device(world.take(places.autopilot)), []);
    assert_eq!(of_device(world.take(places.ground)).len(), 25);
    world.run_with(2 * SECOND, &beats);
    assert_eq!(world.snapshot().system_id, Some(1));
    assert_eq!(ids(&of_device(world.take(places.autopilot))), [0, 0], "once a second");
}

/// "The autopilot's own 280/281/285 (and 283 it relays) do not reach the ground: counted and shown", and there is nothing
/// to complain of: one manager is visible.
#[test]
fn the_autopilots_words_as_a_manager_are_not_seen() {
    let (mut world, places) = with_device(presenting());
    let messages = [
        MavMessage::GIMBAL_MANAGER_INFORMATION(GIMBAL_MANAGER_INFORMATION_DATA {
            time_boot_ms: 1,
            cap_flags: 1,
            roll_min: 0.0,
            roll_max: 0.0,
            pitch_min: -0.1,
            pitch_max: 0.1,
            yaw_min: -0.1,
            yaw_max: 0.1,
            gimbal_device_id: 1,
        }),
        MavMessage::GIMBAL_MANAGER_STATUS(GIMBAL_MANAGER_STATUS_DATA {
            time_boot_ms: 1,
            flags: 12,
            gimbal_device_id: 1,
            primary_control_sysid: 255,
            primary_control_compid: 190,
            secondary_control_sysid: 0,
            secondary_control_compid: 0,
        }),
        MavMessage::GIMBAL_DEVICE_INFORMATION(GIMBAL_DEVICE_INFORMATION_DATA {
            gimbal_device_id: 1,
            ..device_information(world.now, usual_capabilities())
        }),
        MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(GIMBAL_DEVICE_ATTITUDE_STATUS_DATA {
            gimbal_device_id: 1,
            ..device_status(world.now, 44, -5.0, 10.0)
        }),
    ];
    for message in &messages {
        world.send(places.autopilot, AUTOPILOT, message);
    }
    assert_eq!([world.take(places.ground), world.take(places.gimbal)].concat(), []);
    let snapshot = world.snapshot();
    assert_eq!(snapshot.links[0].dropped.get("autopilots_gimbal"), Some(&4));
    assert_eq!(snapshot.conflicts, [""; 0]);
}

/// "What the autopilot addresses to 154 goes to the virtual device", and the conflicts do not complain of the rival that we
/// host; "all of ArduPilot's 286 goes to the real gimbal as before", whomever of the vehicle it names.
#[test]
fn what_the_autopilot_tells_the_device_stays_here() {
    let (mut world, places) = with_device(presenting());
    for _ in 0..50 {
        world.send(places.autopilot, AUTOPILOT, &setpoint(-30.0, 0.0, 0));
        world.run_for(PERIOD);
    }
    for message in [command_long(GIMBAL, 42_600, &[1.0]), command_long(GIMBAL, 203, &[1.0])] {
        world.send(places.autopilot, AUTOPILOT, &message);
    }
    let not_ours = world.take(places.gimbal).into_iter().filter(|arrival| arrival.source() == AUTOPILOT);
    assert_eq!(ids(&not_ours.collect::<Vec<_>>()), [0; 0]);
    let snapshot = world.snapshot();
    assert_eq!(snapshot.conflicts, [""; 0]);
    assert_eq!(snapshot.links[1].dropped.get("firewall"), None);

    for target in [MavId::new(1, 0), MavId::new(0, 0), GIMBAL] {
        let state: AUTOPILOT_STATE_FOR_GIMBAL_DEVICE_DATA = autopilot_state(world.now, target, 90.0);
        let sent = world.send(places.autopilot, AUTOPILOT, &MavMessage::AUTOPILOT_STATE_FOR_GIMBAL_DEVICE(state));
        let heard = world.take(places.gimbal).into_iter().filter(|arrival| arrival.bytes == sent).count();
        assert_eq!(heard, 1, "to {target}");
    }
}

/// Somebody else at the autopilot's end who steers the presented device is kept away like anybody who steers the real one.
#[test]
fn only_the_autopilot_steers_the_presented_device() {
    let (mut world, places) = with_device(presenting());
    let other = MavId::new(1, 195);
    for pitch in [-10.0, -40.0, -70.0] {
        world.send(places.autopilot, other, &setpoint(pitch, 0.0, 0));
    }
    assert_eq!(world.take(places.gimbal), []);
    let snapshot = world.snapshot();
    assert!(snapshot.conflicts[0].contains("1/195 steers gimbal 1/154"), "{:?}", snapshot.conflicts);
    assert_eq!(snapshot.links[0].dropped.get("firewall"), Some(&3));
}

/// ArduPilot's SToRM32 backend (`MNT1_TYPE` 4) takes the presented device for one of its own, and is told which setting is
/// the right one.
#[test]
fn mount_commands_to_the_presented_device_are_named() {
    let (mut world, places) = with_device(presenting());
    let mount_control = command_long(GIMBAL, 205, &[35.0, 0.0, 0.0, 0.0, 0.0, 0.0, 2.0]);
    let answers = world.ask(places.autopilot, AUTOPILOT, &mount_control);
    assert_eq!(ids(&answers), [77]);
    assert_eq!(world.take(places.gimbal), []);
    let conflicts = world.snapshot().conflicts;
    assert!(conflicts.len() == 1 && conflicts[0].contains("set MNT1_TYPE to 6"), "{conflicts:?}");
}

/// A gimbal at the autopilot's end of the line is the autopilot's own: it is not presented to it, and a rival is one.
#[test]
fn a_gimbal_behind_the_autopilot_is_not_presented() {
    let (mut world, places) = World::empty(presenting());
    world.run_for(SECOND / 2);
    world.send(places.autopilot, AUTOPILOT, &ardupilot_heartbeat());
    let behind = crate::support::world::Places { gimbal: places.autopilot, ..places };
    introduce(&mut world, behind, usual_capabilities());
    world.forget();
    world.run_with(3 * SECOND, &[(SECOND, places.autopilot, GIMBAL, gimbal_heartbeat())]);
    assert_eq!(of_device(world.take(places.autopilot)), []);
    assert_eq!(world.snapshot().gimbals[0].presented, None);
    world.send(places.autopilot, AUTOPILOT, &setpoint(-30.0, 0.0, 0));
    assert!(world.snapshot().conflicts[0].contains("MNT1_TYPE"));
}

/// R22: "On a link where the gimbal itself is, and where another has the id of the presented device, nothing is presented".
#[test]
fn where_the_gimbal_or_a_namesake_is_nothing_is_presented() {
    // The gimbal of manager 191, which would be presented as 154, under an id of its own.
    let device = MavId::new(1, 50);
    let entry = GimbalSettings { manager_component_id: Some(191), ..GimbalSettings::found("camera".to_owned()) };
    let (mut world, places) = World::empty(Settings { gimbals: vec![entry], ..presenting() });
    world.run_for(SECOND / 2);
    world.send(places.autopilot, AUTOPILOT, &ardupilot_heartbeat());
    let information = MavMessage::GIMBAL_DEVICE_INFORMATION(device_information(world.now, usual_capabilities()));
    world.send(places.autopilot, device, &gimbal_heartbeat());
    world.send(places.autopilot, device, &information);
    world.forget();
    world.run_with(3 * SECOND, &[(SECOND, places.autopilot, device, gimbal_heartbeat())]);
    assert_eq!(of_device(world.take(places.autopilot)), []);
    assert_eq!(world.snapshot().gimbals[0].device.as_deref(), Some("1/50"));
    assert_eq!(world.snapshot().gimbals[0].presented, None);

    // Another device at the autopilot's end under the id that ours would have there.
    let (mut world, places) = with_device(presenting());
    let beats = [
        (SECOND, places.autopilot, GIMBAL, gimbal_heartbeat()),
        (SECOND / 2, places.gimbal, GIMBAL, gimbal_heartbeat()),
    ];
    world.run_with(SECOND, &beats);
    world.forget();
    world.run_with(3 * SECOND, &beats);
    assert!(!ids(&world.take(places.autopilot)).contains(&285), "the device would tell it ten times a second");
    assert_eq!(world.snapshot().gimbals[0].presented, None);
}

/// "The real 154 … is not forwarded to the autopilot's link", under whatever id it is: there it is the one that we present.
#[test]
fn a_gimbal_under_another_id_than_it_is_presented_with_is_not_seen_either() {
    let device = MavId::new(1, 50);
    let entry = GimbalSettings { manager_component_id: Some(191), ..GimbalSettings::found("camera".to_owned()) };
    let (mut world, places) = World::empty(Settings { gimbals: vec![entry], ..presenting() });
    world.run_for(SECOND / 2);
    world.send(places.autopilot, AUTOPILOT, &ardupilot_heartbeat());
    world.send(places.gimbal, device, &gimbal_heartbeat());
    world.forget();
    for message in [
        gimbal_heartbeat(),
        MavMessage::GIMBAL_DEVICE_INFORMATION(device_information(world.now, usual_capabilities())),
        MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(device_status(world.now, 44, -5.0, 10.0)),
    ] {
        world.send(places.gimbal, device, &message);
    }
    world.run_for(SECOND);
    let (seen, on_ground) = (world.take(places.autopilot), world.take(places.ground));
    assert!(seen.iter().all(|arrival| arrival.source() != device));
    assert!(!of_device(seen).is_empty(), "it is presented there");
    assert_eq!(on_ground.iter().filter(|arrival| arrival.source() == device).count(), 3);
}

/// Two links to one autopilot, which routes between them: what the presented device says comes back, and is no other device.
#[test]
fn the_echo_of_the_presented_device_is_dropped() {
    let mut settings = presenting();
    settings.links.push(link("second", Role::Autopilot, Transport::Datagrams));
    let (mut world, places) = World::new(Settings { ..settings });
    let [autopilot, gimbal, ground, second] = places[..] else { panic!("four links") };
    for place in [autopilot, second] {
        world.send(place, AUTOPILOT, &ardupilot_heartbeat());
    }
    introduce(&mut world, crate::support::world::Places { autopilot, gimbal, ground }, usual_capabilities());
    world.forget();
    for _ in 0..5 {
        world.run_for(SECOND);
        for arrival in of_device(world.take(autopilot)) {
            world.send_bytes(second, &arrival.bytes);
        }
        assert!(of_device(world.take(second)).len() > 5, "it is presented there too");
        assert_eq!(of_device(world.take(ground)), []);
        world.send(gimbal, GIMBAL, &gimbal_heartbeat());
        world.forget();
    }
    let snapshot = world.snapshot();
    assert_eq!(snapshot.conflicts, [""; 0]);
    assert!(snapshot.links[3].dropped.get("loop").is_some_and(|loops| *loops > 5));
    assert_eq!(snapshot.gimbals[0].presented.as_ref().map(|presented| presented.device.as_str()), Some("1/154"));
    let gone = world.snapshot().links[0].peers[0].components.contains(&"1/154".to_owned());
    assert!(!gone, "it is not learned from its echo");
    world.input(Input::Shutdown);
    world.send(ground, GCS, &gimbal_heartbeat());
}
