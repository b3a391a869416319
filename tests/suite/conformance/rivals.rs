//! Others who are, or seem to be, what we are, or whom we know: rival managers and masters, and ids that two use
//! (protocol notes 4.7; ).

use std::time::Duration;

use gimbald::bridge::settings::{Role, Settings, SystemId, Transport};
use gimbald::gimbals::settings::{GimbalSettings, Takeover};
use gimbald::manager::settings::{ControlSettings, Firewall};
use gimbald::timestamp::Timestamp;
use gimbald::wire::MavId;
use gimbald::wire::dialect::{
    ATTITUDE_DATA, COMMAND_LONG_DATA, GIMBAL_DEVICE_ATTITUDE_STATUS_DATA, GIMBAL_DEVICE_SET_ATTITUDE_DATA,
    GIMBAL_MANAGER_INFORMATION_DATA, GIMBAL_MANAGER_STATUS_DATA, MavMessage,
};

use crate::support::script::{
    ACCEPTED, DENIED, NAN, ack, autopilot_state, command_long, configure, device_information, device_status,
    gimbal_heartbeat, ground_heartbeat, of, pitchyaw, px4_heartbeat, quaternion, set_interval, set_pitchyaw,
    take_control, usual_capabilities,
};
use crate::support::world::{AUTOPILOT, GCS, GIMBAL, MANAGER, Place, Places, World, heartbeat, link, three_links};

const SECOND: Duration = Duration::from_secs(1);

/// "raise an HTTP warning when one (sysid, compid) is alive on two links": their control is shared, as the messages
/// know ids only. A station that was restarted on another port, or falls silent on one of two connections, is one.
#[test]
fn a67_two_stations_under_one_id_are_told() {
    let beat = |place| (SECOND, place, GCS, ground_heartbeat());
    for (at_once, told) in [(true, 1), (false, 0)] {
        let (mut world, places) = with_device();
        let gimbal = (SECOND, places.gimbal, GIMBAL, gimbal_heartbeat());
        let second = world.open(2);
        world.run_with(5 * SECOND, &[gimbal.clone(), beat(places.ground)]);
        if at_once {
            world.run_with(5 * SECOND, &[gimbal.clone(), beat(places.ground), beat(second)]);
        } else {
            world.run_with(5 * SECOND, &[gimbal.clone(), beat(second)]);
        }
        let conflicts = world.snapshot().conflicts;
        assert_eq!(conflicts.len(), told, "{conflicts:?}");
        assert!(conflicts.iter().all(|text| text.contains("255/190") && text.contains("both on link ground")));

        // One takes control, and the other has it.
        assert_eq!(world.result_of(places.ground, GCS, &take_control()), Some(ACCEPTED));
        assert_eq!(world.result_of(second, GCS, &pitchyaw(-10.0, 0.0, NAN, NAN, 44.0)), Some(ACCEPTED));

        // When one of them is gone, so is the conflict.
        world.run_with(31 * SECOND, &[gimbal, beat(second)]);
        assert_eq!(world.snapshot().conflicts, [""; 0]);
    }
}

/// A vehicle under the system id of ours, seen where ground stations are, neither turns our camera nor moves our
/// vehicle, as long as our own autopilot is heard; and it is told.
#[test]
fn a57_a_second_vehicle_under_our_system_id_is_not_believed() {
    let (mut world, places) = with_device();
    let attitude = |yaw: f32| {
        MavMessage::ATTITUDE(ATTITUDE_DATA {
            time_boot_ms: 1,
            roll: 0.0,
            pitch: 0.0,
            yaw,
            rollspeed: 0.0,
            pitchspeed: 0.0,
            yawspeed: 0.0,
        })
    };
    let tenth = SECOND / 10;
    let ours =
        [(SECOND, places.autopilot, AUTOPILOT, px4_heartbeat()), (tenth, places.autopilot, AUTOPILOT, attitude(0.0))];
    let other = [(SECOND, places.ground, AUTOPILOT, px4_heartbeat()), (tenth, places.ground, AUTOPILOT, attitude(2.0))];
    world.run_with(3 * SECOND, &[&ours[..], &other[..]].concat());
    assert_eq!(world.snapshot().vehicle.heading_deg.map(f64::round), Some(0.0));
    let conflicts = world.snapshot().conflicts;
    assert!(conflicts.len() == 1 && conflicts[0].contains("1/1, which is our autopilot"), "{conflicts:?}");
    assert!(conflicts[0].contains("link ground"), "{conflicts:?}");

    // When ours falls silent it may have been the same one, on two ways.
    world.run_with(6 * SECOND, &other);
    assert_eq!(world.snapshot().vehicle.heading_deg.map(f64::round), Some(115.0));
}

/// D5: "Other vehicles' systems are routed, but never gate, latch or steer", and one under our system id is another vehicle
/// where it is not believed. It is answered where it spoke: our own autopilot, to which the same ids lead, has not asked.
#[test]
fn a57_a_second_vehicle_under_our_system_id_has_no_say() {
    let camera = GimbalSettings { takeover: Takeover::Ask, ..GimbalSettings::found("camera".to_owned()) };
    let control =
        ControlSettings { open_when_unclaimed: false, lease_timeout: 3 * SECOND, ..ControlSettings::default() };
    let (mut world, places) = World::empty(Settings { gimbals: vec![camera], control, ..three_links() });
    introduce(&mut world, places.gimbal, GIMBAL);
    let status = GIMBAL_DEVICE_ATTITUDE_STATUS_DATA { time_boot_ms: 1 << 30, ..device_status(world.now, 44, 0.0, 0.0) };
    let gimbal = (SECOND / 10, places.gimbal, GIMBAL, MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(status));
    let station = (SECOND, places.ground, GCS, ground_heartbeat());
    let ours = (SECOND, places.autopilot, AUTOPILOT, px4_heartbeat());
    let other = (SECOND, places.ground, AUTOPILOT, px4_heartbeat());
    world.run_with(3 * SECOND, &[gimbal.clone(), station.clone(), ours, other.clone()]);
    assert_eq!(world.result_of(places.ground, GCS, &take_control()), Some(ACCEPTED));

    for asked in [
        take_control(),
        configure([1.0, 1.0], [-1.0, -1.0]),
        configure([0.0, 0.0], [-1.0, -1.0]),
        configure([-1.0, -1.0], [-2.0, -2.0]),
        pitchyaw(-10.0, 0.0, NAN, NAN, 44.0),
        command_long(MANAGER, 197, &[154.0, NAN, NAN, NAN, NAN, NAN, NAN]),
    ] {
        assert_eq!(world.result_of(places.ground, AUTOPILOT, &asked), Some(DENIED), "{asked:?}");
        assert!(world.take(places.autopilot).iter().all(|arrival| arrival.id() != 77), "{asked:?}");
    }
    world.forget();
    world.send(places.ground, AUTOPILOT, &set_pitchyaw(NAN, NAN, 0.0, 0.1, 44));
    assert_eq!(world.take_messages::<GIMBAL_DEVICE_SET_ATTITUDE_DATA>(places.gimbal), []);
    let in_control = |world: &World| {
        let camera = world.snapshot().gimbals[0].clone();
        (camera.primary, camera.secondary, camera.lender)
    };
    let id = |id: MavId| Some(id.to_string());
    assert_eq!(in_control(&world), (id(GCS), None, None));
    let rejected = world.snapshot().gimbals[0].rejected.clone();
    assert!(rejected.len() == 1 && rejected["1/1"].len() == 1 && rejected["1/1"]["other_vehicle"] == 7, "{rejected:?}");

    // Ours is obeyed all the same, and the other does not keep it in control when it is silent.
    assert_eq!(world.result_of(places.autopilot, AUTOPILOT, &take_control()), Some(ACCEPTED));
    assert_eq!(in_control(&world), (id(AUTOPILOT), None, id(GCS)));
    world.run_with(4 * SECOND, &[gimbal, station, other]);
    assert_eq!(in_control(&world), (id(GCS), None, None));
}

/// R18: what such a vehicle's autopilot says to everybody, or to its own gimbal, which may have the id of ours, does not
/// reach ours: the state of another vehicle would tilt its horizon.
#[test]
fn a57_what_a_second_vehicle_under_our_system_id_says_is_not_for_our_gimbal() {
    let (mut world, places) = with_device();
    world.send(places.autopilot, AUTOPILOT, &px4_heartbeat());
    let state = |target| MavMessage::AUTOPILOT_STATE_FOR_GIMBAL_DEVICE(autopilot_state(Timestamp::ZERO, target, 200.0));
    let said = [
        px4_heartbeat(),
        state(MavId::new(0, 0)),
        state(GIMBAL),
        command_long(MavId::new(0, 0), 512, &[283.0]),
        command_long(GIMBAL, 512, &[283.0]),
    ];
    for (from, heard) in [(places.ground, false), (places.autopilot, true)] {
        for message in &said {
            world.forget();
            let sent = world.send(from, AUTOPILOT, message);
            let is_heard = world.take(places.gimbal).iter().any(|arrival| arrival.bytes == sent);
            assert_eq!(is_heard, heard, "{message:?}");
        }
    }
}

/// "Latch only from links marked `autopilot`": while we use the fallback id for want of an autopilot, a vehicle that has
/// it is not ours, and neither is its gimbal; the user is told.
#[test]
fn a57_a_vehicle_that_has_the_fallback_id_is_not_ours() {
    let (mut world, places) = World::empty(Settings { system_id: SystemId::Auto, ..three_links() });
    // One that was there before and has gone is none of ours either.
    world.send(places.ground, AUTOPILOT, &px4_heartbeat());
    world.run_for(11 * SECOND);
    assert_eq!((world.snapshot().system_id, world.snapshot().vehicle.system_id), (Some(1), None));

    world.run_with(5 * SECOND, &[(SECOND, places.ground, AUTOPILOT, px4_heartbeat())]);
    introduce(&mut world, places.ground, GIMBAL);
    let snapshot = world.snapshot();
    assert_eq!((snapshot.vehicle.system_id, snapshot.gimbals.len()), (None, 0));
    assert!(snapshot.conflicts.len() == 1 && snapshot.conflicts[0].contains("another vehicle has system id 1"));

    // A gimbal on its own link is ours all the same, and so is the autopilot when it comes.
    introduce(&mut world, places.gimbal, MavId::new(1, 171));
    let take = command_long(MavId::new(1, 192), 1001, &[-2.0, -2.0, -1.0, -1.0, NAN, NAN, 0.0]);
    assert_eq!(world.result_of(places.ground, AUTOPILOT, &take), Some(DENIED), "that vehicle does not have it");
    assert_eq!(world.snapshot().gimbals[0].rejected["1/1"]["other_vehicle"], 1);
    world.run_with(5 * SECOND, &[(SECOND, places.autopilot, AUTOPILOT, px4_heartbeat())]);
    let snapshot = world.snapshot();
    assert_eq!((snapshot.vehicle.system_id, snapshot.gimbals[0].device.as_deref()), (Some(1), Some("1/171")));
    assert_eq!(world.stored_system_ids, [1], "it is worth keeping now");
}

/// Without a link of role autopilot the autopilot is where the ground stations are, as on a hub.
#[test]
fn a57_on_a_hub_the_autopilot_is_found_under_the_fallback_id() {
    let hub = link("hub", Role::Ground, Transport::Datagrams);
    let (mut world, places) = World::new(Settings { links: vec![hub], ..Settings::default() });
    world.run_with(12 * SECOND, &[(SECOND, places[0], AUTOPILOT, px4_heartbeat())]);
    introduce(&mut world, places[0], GIMBAL);
    let snapshot = world.snapshot();
    assert_eq!((snapshot.system_id, snapshot.vehicle.system_id, snapshot.gimbals.len()), (Some(1), Some(1), 1));
    assert_eq!(snapshot.conflicts, [""; 0]);
}

/// A-43, for each autopilot and each thing it may say of a gimbal: "detect: 284 or 280/281 for our device id from another
/// component of our system", with "the setting to change on PX4 or ArduPilot".
#[test]
#[rustfmt::skip]
fn a43_the_manager_of_an_autopilot_is_named_with_its_setting() {
    let (px4, ardupilot) = (px4_heartbeat(), heartbeat(2, 3));
    for (autopilot, message, kind, setting) in [
        (&px4,       status_of(154),     "is a gimbal manager too", "MNT_MODE_IN to -1 (disabled), or MNT_MODE_OUT to 3"),
        (&px4,       information_of(0),  "is a gimbal manager too", "MNT_MODE_IN to -1 (disabled), or MNT_MODE_OUT to 3"),
        (&px4,       attitude_of(1),     "is a gimbal manager too", "MNT_MODE_IN to -1 (disabled), or MNT_MODE_OUT to 3"),
        (&px4,       setpoint_to(1, 0),  "steers gimbal 1/154",     "MNT_MODE_IN to -1 (disabled), or MNT_MODE_OUT to 3"),
        (&px4,       setpoint_to(1, 154), "steers gimbal 1/154",    "MNT_MODE_IN to -1 (disabled), or MNT_MODE_OUT to 3"),
        (&ardupilot, status_of(1),       "is a gimbal manager too", "MNT1_TYPE to 0"),
        (&ardupilot, information_of(2),  "is a gimbal manager too", "MNT2_TYPE to 0"),
        (&ardupilot, attitude_of(1),     "is a gimbal manager too", "MNT1_TYPE to 0"),
        (&ardupilot, setpoint_to(1, 154), "steers gimbal 1/154",    "MNT1_TYPE to 0"),
        (&ardupilot, mount_control(),    "steers gimbal 1/154",     "MNT1_TYPE to 0"),
    ] {
        let (mut world, places) = with_device();
        world.send(places.autopilot, AUTOPILOT, autopilot);
        world.send(places.autopilot, AUTOPILOT, &message);

        let conflicts = world.snapshot().conflicts;
        assert!(
            conflicts.len() == 1 && ["1/1", kind, setting].iter().all(|text| conflicts[0].contains(text)),
            "{message:?}: {conflicts:?}"
        );
        // It is over when it has been silent for half a minute.
        world.run_with(31 * SECOND, &[(SECOND, places.autopilot, AUTOPILOT, autopilot.clone())]);
        assert_eq!(world.snapshot().conflicts, [""; 0]);
    }
}

/// ArduPilot says nothing of its mounts unasked ("280, 281 and its own 285 are never streamed"), and a gimbal behind it
/// it steers past us: it is asked. The answer is ours, and clients see it only when they ask themselves.
#[test]
fn a43_an_autopilot_that_manages_the_gimbal_behind_it_is_found() {
    let ardupilot = heartbeat(2, 3);
    for (behind, asked) in [(true, 3), (false, 0)] {
        let (mut world, places) = World::empty(three_links());
        world.send(places.autopilot, AUTOPILOT, &ardupilot);
        introduce(&mut world, if behind { places.autopilot } else { places.gimbal }, GIMBAL);
        let mut requests = 0;
        for _ in 0..590 {
            world.run_with(
                SECOND / 10,
                &[
                    (SECOND, places.autopilot, AUTOPILOT, ardupilot.clone()),
                    (SECOND, if behind { places.autopilot } else { places.gimbal }, GIMBAL, gimbal_heartbeat()),
                ],
            );
            let to_autopilot: Vec<COMMAND_LONG_DATA> = world.take_messages(places.autopilot);
            world.forget();
            for request in to_autopilot {
                if (request.command, request.param1, request.target_component) != (512, 280.0, 1) {
                    continue;
                }
                requests += 1;
                world.send(places.autopilot, AUTOPILOT, &MavMessage::COMMAND_ACK(ack(MANAGER, 512, ACCEPTED)));
                let ours = world.send(places.autopilot, AUTOPILOT, &information_of(1));
                assert!(world.take(places.ground).iter().all(|arrival| arrival.bytes != ours));
                let theirs = world.send(places.autopilot, AUTOPILOT, &information_of(1));
                assert!(world.take(places.ground).iter().any(|arrival| arrival.bytes == theirs));
            }
        }
        assert_eq!(requests, asked, "behind the autopilot: {behind}");
        let conflicts = world.snapshot().conflicts;
        assert_eq!(conflicts.len(), usize::from(behind), "{conflicts:?}");
        assert!(conflicts.iter().all(|text| text.contains("MNT1_TYPE")));
    }
}

/// An autopilot on another system id than the configuration names is not ours, and the user is told which to set.
#[test]
fn a57_an_autopilot_on_another_system_id_than_configured_is_told() {
    let (mut world, places) = World::empty(Settings { system_id: SystemId::Fixed(42), ..three_links() });
    world.run_with(5 * SECOND, &[(SECOND, places.autopilot, MavId::new(7, 1), px4_heartbeat())]);
    let snapshot = world.snapshot();
    assert_eq!((snapshot.system_id, snapshot.vehicle.system_id), (Some(42), None));
    let told = &snapshot.conflicts;
    assert!(told.len() == 1 && told[0].contains("sends as 7/1") && told[0].contains("\"auto\" or to 7"), "{told:?}");
}

/// Another companion that manages our gimbal is named; one that manages another is none of our business, and what both
/// say reaches the clients: it may be all that they know of that gimbal.
#[test]
fn a43_another_companions_manager_is_named_where_it_claims_our_gimbal() {
    for (device, told) in [(154, 1), (171, 0), (1, 0)] {
        for message in [status_of(device), information_of(device)] {
            let (mut world, places) = with_device();
            let sent = world.send(places.autopilot, MavId::new(1, 195), &message);

            assert!(world.take(places.ground).iter().any(|arrival| arrival.bytes == sent), "device {device}");
            let conflicts = world.snapshot().conflicts;
            assert_eq!(conflicts.len(), told, "device {device}: {conflicts:?}");
            assert!(conflicts.iter().all(|text| text.contains("1/195") && text.contains("Switch that component's")));
        }
    }
}

/// Who speaks under the id of our own manager is told of as that, and not as its rival besides; and of what an autopilot says
/// of a gimbal only 1 to 6 are gimbals that it drives itself.
#[test]
fn a43_neither_our_own_id_nor_a_devices_own_word_is_a_rival_manager() {
    let (mut world, places) = with_device();
    world.send(places.ground, MANAGER, &status_of(154));
    let conflicts = world.snapshot().conflicts;
    assert!(conflicts.len() == 1 && !conflicts[0].contains("Switch that component's"), "{conflicts:?}");

    for (device_id, told) in [(0, 0), (7, 0), (1, 1), (6, 1)] {
        let (mut world, places) = with_device();
        world.send(places.autopilot, AUTOPILOT, &heartbeat(2, 3));
        world.send(places.autopilot, AUTOPILOT, &attitude_of(device_id));
        assert_eq!(world.snapshot().conflicts.len(), told, "device {device_id}");
    }
}

/// What a rival says as a manager is for clients, and not for the gimbal, which takes whoever speaks to it as a manager
/// for its own (D14).
#[test]
fn a44_the_gimbal_hears_of_no_manager_but_ours() {
    let (mut world, places) = with_device();
    world.send(places.autopilot, AUTOPILOT, &px4_heartbeat());
    world.forget();
    for message in [status_of(154), information_of(154), setpoint_to(1, 154), setpoint_to(1, 0), mount_control()] {
        world.send(places.autopilot, AUTOPILOT, &message);
        world.send(places.ground, GCS, &message);
    }
    assert_eq!(world.take(places.gimbal), []);
}

/// "If nothing in 10 s, log 'no gimbal heartbeat: check COM2 wiring, baud …'" (gimbals 1.10): a gimbal that waits for a heartbeat is
/// silent at a wrong baud rate. It is over with the first that is heard, and no other line is meant.
#[test]
fn a_serial_line_to_a_gimbal_on_which_nothing_ever_comes_is_named() {
    let named = "nothing ever came on link serial. Is the gimbal switched on and its wiring right (a Gremsy's is COM2, or COM4), \
                 and is 57600 its baud rate? With gimbald stopped, 'gimbald scan' finds it out.";
    for (role, configured, named) in
        [(Role::Gimbal, false, Some(named)), (Role::Gimbal, true, Some(named)), (Role::Peer, true, None)]
    {
        let links = vec![link("serial", role, Transport::Serial { baud: 57_600 })];
        let entry = GimbalSettings::found("camera".to_owned());
        let gimbals = Vec::from_iter(configured.then_some(entry));
        let system_id = SystemId::Fixed(1);
        let (mut world, places) = World::new(Settings { links, gimbals, system_id, ..Settings::default() });
        world.run_for(9 * SECOND);
        assert_eq!(world.snapshot().conflicts, [""; 0], "{role:?}");
        world.run_for(30 * SECOND);
        assert_eq!(world.snapshot().conflicts, Vec::from_iter(named), "{role:?} {configured}");
        world.send(places[0], GIMBAL, &gimbal_heartbeat());
        world.run_for(2 * SECOND);
        assert_eq!(world.snapshot().conflicts, [""; 0], "{role:?} {configured}");
        world.run_for(60 * SECOND);
        assert_eq!(world.snapshot().conflicts, [""; 0], "{role:?}: it was heard once");
    }
}

/// A wrong baud rate looks like this: bytes come, and no frame. It is over when frames come.
#[test]
fn a_serial_line_without_mavlink_is_named() {
    let named = [
        "what comes on link serial is no MAVLink. Is 57600 its baud rate? With gimbald stopped, 'gimbald scan' finds it out.",
    ];
    let noise: Vec<u8> = (0..100).map(|at: u8| at.wrapping_mul(37) & 0x7f).collect();
    let shown = |transport, with_frames: bool| {
        let links = vec![link("serial", Role::Gimbal, transport)];
        let (mut world, places) = World::new(Settings { links, ..Settings::default() });
        let mut seen = Vec::new();
        for second in 0..6 {
            world.send_bytes(places[0], &noise);
            if with_frames && second % 2 == 0 {
                world.send(places[0], GIMBAL, &heartbeat(26, 8));
            }
            world.run_for(SECOND);
            seen.push(world.snapshot().conflicts.contains(&named[0].to_owned()));
        }
        seen
    };
    let serial = Transport::Serial { baud: 57_600 };
    assert_eq!(shown(serial, false), [false, false, true, true, true, true]);
    assert_eq!(shown(serial, true), [false; 6]);
    // There every datagram is whole or nothing, and no rate can be wrong.
    assert_eq!(shown(Transport::Datagrams, false), [false; 6]);
}

/// R15: "addressed to us or to component 0, through the same gate": who says it to no component in particular is nobody's
/// rival, but where the gimbal obeys it besides.
#[test]
fn r15_a_mount_command_to_component_0_is_for_the_manager() {
    for (firewall, conflict) in [(Firewall::On, None), (Firewall::Warn, Some("255/190 steers gimbal 1/154"))] {
        for target in [MavId::new(1, 0), MavId::new(0, 0)] {
            let control = ControlSettings { firewall, ..ControlSettings::default() };
            let (mut world, places) = World::empty(Settings { control, ..three_links() });
            world.send(places.autopilot, AUTOPILOT, &px4_heartbeat());
            introduce(&mut world, places.gimbal, GIMBAL);
            world.forget();

            world.send(places.ground, GCS, &command_long(target, 205, &[-30.0, 0.0, 0.0, 0.0, 0.0, 0.0, 2.0]));

            let snapshot = world.snapshot();
            let setpoint = snapshot.gimbals[0].setpoint.as_ref().expect("it was obeyed");
            assert_eq!(
                (setpoint.pitch_deg.map(f64::round), setpoint.source.as_deref()),
                (Some(-30.0), Some("255/190"))
            );
            let said = world.take(places.gimbal).into_iter().filter(|arrival| arrival.source() == GCS).count();
            assert_eq!(said, usize::from(conflict.is_some()), "to the gimbal itself");
            assert_eq!(snapshot.conflicts.len(), said, "{:?}", snapshot.conflicts);
            assert!(snapshot.conflicts.iter().all(|text| conflict.is_some_and(|named| text.contains(named))));
        }
    }
}

/// D10 where the gimbal is behind the autopilot: what passes us on its way there is kept away; what the autopilot does
/// itself we can only tell of.
#[test]
fn a43_behind_the_autopilot_the_firewall_holds_as_far_as_it_can() {
    for (firewall, delivered) in [(Firewall::On, 0), (Firewall::Warn, 3)] {
        let control = ControlSettings { firewall, ..ControlSettings::default() };
        let (mut world, places) = World::empty(Settings { control, ..three_links() });
        world.send(places.autopilot, AUTOPILOT, &px4_heartbeat());
        introduce(&mut world, places.autopilot, GIMBAL);
        world.forget();

        for message in [setpoint_to(1, 154), setpoint_to(1, 0), mount_control()] {
            world.send(places.ground, GCS, &message);
        }
        let passed = world.take(places.autopilot).into_iter().filter(|arrival| arrival.source() == GCS).count();
        assert_eq!(passed, delivered);
        let conflicts = world.snapshot().conflicts;
        assert!(conflicts.len() == 1 && conflicts[0].contains("255/190 steers gimbal 1/154"), "{conflicts:?}");

        world.send(places.autopilot, AUTOPILOT, &setpoint_to(1, 154));
        let conflicts = world.snapshot().conflicts;
        assert!(conflicts[1].contains("without passing here") && conflicts[1].contains("MNT_MODE_IN"), "{conflicts:?}");
        // Commands for the autopilot itself are its own business.
        let own = command_long(AUTOPILOT, 205, &[-10.0, 0.0, 0.0, 0.0, 0.0, 0.0, 2.0]);
        let sent = world.send(places.ground, GCS, &own);
        assert!(world.take(places.autopilot).iter().any(|arrival| arrival.bytes == sent));
    }
}

/// D10: "a device's own 280/281 do not leave its link", wherever the gimbal is, and from its first word on where its
/// link is one of gimbals.
#[test]
fn d10_a_gimbal_that_acts_as_a_manager_is_told_and_kept_to_its_link() {
    for behind_autopilot in [false, true] {
        let (mut world, places) = World::empty(three_links());
        let place = if behind_autopilot { places.autopilot } else { places.gimbal };
        if behind_autopilot {
            introduce(&mut world, place, GIMBAL);
        }
        world.forget();
        for message in [information_of(154), status_of(154)] {
            world.send(place, GIMBAL, &message);
        }
        assert!(world.take(places.ground).iter().all(|arrival| arrival.source() != GIMBAL));
        let conflicts = world.snapshot().conflicts;
        assert!(conflicts.len() == 1 && conflicts[0].contains("gimbal device mode"), "{conflicts:?}");
        // It is a device of ours all the same.
        introduce(&mut world, place, GIMBAL);
        assert_eq!(world.result_of(places.ground, GCS, &pitchyaw(-10.0, 0.0, NAN, NAN, 44.0)), Some(ACCEPTED));
    }
}

/// Protocol notes A-43 and the trap of two sources: neither 280 nor 285 of an autopilot is mixed with the gimbal's, in
/// what we show and in what we say.
#[test]
fn items_32_and_33_a_rival_manager_changes_nothing_of_ours() {
    let (mut world, places) = with_device();
    world.send(places.autopilot, AUTOPILOT, &px4_heartbeat());
    world.send(
        places.gimbal,
        GIMBAL,
        &MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(device_status(world.now, 44, -10.0, 5.0)),
    );
    world.run_for(SECOND / 2);
    let before = world.snapshot().gimbals[0].clone();
    world.forget();

    for id in [0, 1, 2, 154] {
        for message in [attitude_of(id), information_of(id), status_of(id), device_information_of(id)] {
            world.send(places.autopilot, AUTOPILOT, &message);
        }
    }

    let mut after = world.snapshot().gimbals[0].clone();
    after.attitude.age_ms = before.attitude.age_ms;
    assert_eq!(after, before);
    assert_eq!(world.snapshot().gimbals.len(), 1);
    world.run_for(SECOND);
    let heard = world.take(places.ground);
    let ours: Vec<_> = heard.into_iter().filter(|arrival| arrival.source() == MANAGER).collect();
    let told = of::<GIMBAL_MANAGER_STATUS_DATA>(&ours);
    assert!(told.len() >= 5 && told.iter().all(|told| (told.gimbal_device_id, told.primary_control_sysid) == (154, 0)));
    assert_eq!(of::<GIMBAL_MANAGER_INFORMATION_DATA>(&ours), []);
}

/// "keep 281 streaming on the gimbal link", also where somebody has switched it off: a gimbal that misses its manager
/// hears it each second.
#[test]
fn item_38_a_gimbal_that_misses_its_manager_hears_it_wherever_it_is() {
    for behind_autopilot in [false, true] {
        let (mut world, places) = World::empty(three_links());
        let place = if behind_autopilot { places.autopilot } else { places.gimbal };
        world.send(places.autopilot, AUTOPILOT, &px4_heartbeat());
        introduce(&mut world, place, GIMBAL);
        world.send(place, AUTOPILOT, &set_interval(MANAGER, 281, -1.0));
        let missing = |flag| {
            let status = GIMBAL_DEVICE_ATTITUDE_STATUS_DATA {
                failure_flags: flag,
                ..device_status(Default::default(), 44, 0.0, 0.0)
            };
            (SECOND / 10, place, GIMBAL, MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(status))
        };
        let mut heard_in = |flag, seconds: u32| {
            world.run_with(2 * SECOND, &[missing(flag)]);
            world.forget();
            world.run_with(seconds * SECOND, &[missing(flag)]);
            world.take_messages::<GIMBAL_MANAGER_STATUS_DATA>(place).len()
        };
        assert_eq!(heard_in(0, 5), 0, "it was switched off");
        assert_eq!(heard_in(512, 5), 5, "once a second, behind the autopilot: {behind_autopilot}");
        assert_eq!(heard_in(0, 5), 0);
    }
}

/// A ground station on the vehicle's own system id is served like any other.
#[test]
fn a_ground_station_on_the_vehicles_system_id_is_served() {
    let (mut world, places) = with_device();
    let station = MavId::new(1, 190);
    world.send(places.ground, station, &ground_heartbeat());
    assert_eq!(world.result_of(places.ground, station, &take_control()), Some(ACCEPTED));
    assert_eq!(world.result_of(places.ground, station, &pitchyaw(-10.0, 0.0, NAN, NAN, 44.0)), Some(ACCEPTED));
    assert_eq!(world.take_messages::<GIMBAL_DEVICE_SET_ATTITUDE_DATA>(places.gimbal).len(), 1);
    assert_eq!(world.snapshot().conflicts, [""; 0]);
}

fn with_device() -> (World, Places) {
    let (mut world, places) = World::empty(three_links());
    world.run_for(SECOND / 2);
    introduce(&mut world, places.gimbal, GIMBAL);
    world.forget();
    (world, places)
}

fn introduce(world: &mut World, place: Place, device: MavId) {
    world.send(place, device, &gimbal_heartbeat());
    let information = device_information(world.now, usual_capabilities());
    world.send(place, device, &MavMessage::GIMBAL_DEVICE_INFORMATION(information));
}

/// `GIMBAL_MANAGER_STATUS` of somebody who holds a gimbal himself.
fn status_of(gimbal_device_id: u8) -> MavMessage {
    MavMessage::GIMBAL_MANAGER_STATUS(GIMBAL_MANAGER_STATUS_DATA {
        time_boot_ms: 1,
        flags: 12,
        gimbal_device_id,
        primary_control_sysid: 1,
        primary_control_compid: 1,
        secondary_control_sysid: 0,
        secondary_control_compid: 0,
    })
}

fn information_of(gimbal_device_id: u8) -> MavMessage {
    MavMessage::GIMBAL_MANAGER_INFORMATION(GIMBAL_MANAGER_INFORMATION_DATA {
        time_boot_ms: 1,
        cap_flags: 1,
        roll_min: 0.0,
        roll_max: 0.0,
        pitch_min: -0.1,
        pitch_max: 0.1,
        yaw_min: -0.1,
        yaw_max: 0.1,
        gimbal_device_id,
    })
}

fn attitude_of(gimbal_device_id: u8) -> MavMessage {
    let status = device_status(Default::default(), 44, -80.0, 90.0);
    MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(GIMBAL_DEVICE_ATTITUDE_STATUS_DATA { gimbal_device_id, ..status })
}

fn device_information_of(gimbal_device_id: u8) -> MavMessage {
    let information = device_information(Default::default(), usual_capabilities());
    MavMessage::GIMBAL_DEVICE_INFORMATION(gimbald::wire::dialect::GIMBAL_DEVICE_INFORMATION_DATA {
        gimbal_device_id,
        pitch_min: -0.1,
        ..information
    })
}

fn setpoint_to(target_system: u8, target_component: u8) -> MavMessage {
    MavMessage::GIMBAL_DEVICE_SET_ATTITUDE(GIMBAL_DEVICE_SET_ATTITUDE_DATA {
        q: quaternion(-30.0, 0.0),
        angular_velocity_x: NAN,
        angular_velocity_y: NAN,
        angular_velocity_z: NAN,
        flags: 44,
        target_system,
        target_component,
    })
}

/// `DO_MOUNT_CONTROL` as ArduPilot's SToRM32 backend sends it.
fn mount_control() -> MavMessage {
    command_long(GIMBAL, 205, &[-30.0, 0.0, 0.0, 0.0, 0.0, 0.0, 2.0])
}
