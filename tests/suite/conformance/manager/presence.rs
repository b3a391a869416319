//! How clients find a manager and its gimbal (client checklist E1 to E33).

use std::time::Duration;

use gimbald::bridge::settings::{Settings, SystemId};
use gimbald::gimbals::mavlink_v2::sim::{self, Device, DeviceSettings};
use gimbald::sim::vehicle::{Vehicle, VehicleSettings};
use gimbald::timestamp::Timestamp;
use gimbald::wire::MavId;
use gimbald::wire::dialect::{
    COMMAND_ACK_DATA, GIMBAL_DEVICE_INFORMATION_DATA, GIMBAL_MANAGER_INFORMATION_DATA, GIMBAL_MANAGER_STATUS_DATA,
    MESSAGE_INTERVAL_DATA, MavMessage, REQUEST_DATA_STREAM_DATA,
};
use gimbald::wire::ids::CapFlags;

use super::{COMPANION, FIELD, SECOND, fly, look, run_looking, told_control, with_gimbal, with_gimbal_that};
use crate::support::script::{
    ACCEPTED, DENIED, NAN, TEMPORARILY_REJECTED, ack, autopilot_state, command_int, command_long, device_information,
    device_status, gimbal_heartbeat, ground_heartbeat, ids, of, pitchyaw, px4_heartbeat, request_message, roi_location,
    set_interval, usual_capabilities,
};
use crate::support::world::{AUTOPILOT, Arrival, GCS, GIMBAL, MANAGER, Place, World, heartbeat, three_links};

const EVERYBODY: MavId = MavId::new(0, 0);
const HEARTBEAT: u32 = 0;
/// `MAV_CMD_REQUEST_MESSAGE`.
const REQUEST: u16 = 512;

/// Client checklist E1: "Every frame the daemon emits has the configured vehicle system id; there is no frame with another
/// one or with 0", whether that id is found out or configured.
#[test]
fn client_item_e1_all_that_we_say_is_said_under_the_vehicles_system_id() {
    for system_id in [SystemId::Auto, SystemId::Fixed(7)] {
        let (mut world, places) = World::empty(Settings { system_id, ..three_links() });
        let vehicle = VehicleSettings { system_id: 7, ..VehicleSettings::default() };
        world.install(places.autopilot, Vehicle::new(Timestamp::ZERO, vehicle));
        let gimbal = DeviceSettings { system_id: sim::SystemId::Fixed(7), ..DeviceSettings::default() };
        world.install(places.gimbal, Device::new(Timestamp::ZERO, gimbal));
        let (manager, device) = (MavId::new(7, 191), MavId::new(7, 154));
        let angle = command_long(manager, 1000, &[-20.0, 0.0, NAN, NAN, 44.0, 0.0, 154.0]);

        world.run_with(
            Duration::from_secs(20),
            &[(SECOND, places.ground, GCS, ground_heartbeat()), (SECOND, places.ground, GCS, angle)],
        );

        for (place, living_there) in
            [(places.autopilot, MavId::new(7, 1)), (places.gimbal, device), (places.ground, GCS)]
        {
            let heard = world.take(place);
            let others = [GCS, MavId::new(7, 1), device].map(|id| (id != living_there).then_some(id));
            let ours: Vec<MavId> =
                heard.iter().map(Arrival::source).filter(|source| !others.contains(&Some(*source))).collect();
            let others: Vec<&MavId> = ours.iter().filter(|source| **source != manager).collect();
            assert!(ours.len() > 50 && others.is_empty(), "{system_id:?}: {others:?}");
        }
    }
}

/// Client checklist E2: "M's first HEARTBEAT leaves within 1 s of start and not later than any other frame of M", where the
/// system id is known at the start; otherwise nothing is said before it is (protocol checklist 14).
#[test]
fn client_item_e2_the_heartbeat_is_the_first_that_is_said() {
    let stored = Settings { system_id: SystemId::Auto, stored_system_id: Some(1), ..three_links() };
    for settings in [three_links(), stored] {
        let (mut world, places) = World::empty(settings);
        world.run_for(SECOND);
        for place in [places.autopilot, places.gimbal, places.ground] {
            let heard = world.take(place);
            assert_eq!((heard[0].at, heard[0].id(), heard[0].source()), (Timestamp::ZERO, HEARTBEAT, MANAGER));
        }
    }
}

/// Client checklist E3: "HEARTBEAT spacing stays within 0.8–1.2 s over 60 s, also while streams and commands are at full
/// load."
#[test]
fn client_item_e3_the_heartbeat_keeps_its_pace_under_load() {
    let (mut world, places) = with_gimbal();
    let status = device_status(world.now, 44, 0.0, 0.0);
    let load = [
        (SECOND / 50, places.gimbal, GIMBAL, MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(status)),
        (SECOND / 50, places.ground, GCS, pitchyaw(-20.0, 10.0, NAN, NAN, 44.0)),
        (SECOND / 20, places.ground, GCS, request_message(MANAGER, 280)),
        (SECOND / 20, places.ground, COMPANION, set_interval(MANAGER, 281, 20_000.0)),
    ];

    world.run_with(Duration::from_secs(60), &load);

    for place in [places.autopilot, places.gimbal, places.ground] {
        let heard = world.take(place);
        let beats: Vec<Timestamp> = heard.iter().filter(|at| at.id() == HEARTBEAT).map(|at| at.at).collect();
        assert_eq!(beats.len(), 60);
        assert!(beats.windows(2).all(|pair| pair[1] - pair[0] == SECOND), "{beats:?}");
    }
}

/// Client checklist E7: "512/p1=280 to M, params 2–7 zero: ACCEPTED then 280 within 1 s of the ACK."
/// Client checklist E8: "512/p1=280 to M, params 2–7 NaN: same result."
/// Client checklist E9: "512/p1=280 to component 0: ACK with source M, and 280."
/// Client checklist E11: "Exactly one ACK per request; its source is the addressed component, command 512."
/// Client checklist E12: "ACK target fields are the sender's ids."
#[test]
fn client_items_e7_to_e9_e11_and_e12_a_request_has_one_answer_and_what_was_asked_for() {
    let (mut world, places) = with_gimbal();
    for sender in [GCS, COMPANION, MavId::new(245, 190)] {
        world.send(places.ground, sender, &heartbeat(18, 8));
        for target in [MANAGER, MavId::new(1, 0), EVERYBODY] {
            for rest in [0.0, NAN] {
                let request = command_long(target, REQUEST, &[280.0, rest, rest, rest, rest, rest, rest]);

                let answers = world.ask(places.ground, sender, &request);

                assert_eq!(ids(&answers), [77, 280], "{sender} asked {target}, the rest is {rest}");
                assert!(answers.iter().all(|answer| answer.at == world.now && answer.source() == MANAGER));
                assert_eq!(of::<COMMAND_ACK_DATA>(&answers), [ack(sender, REQUEST, ACCEPTED)]);
                assert_eq!(of::<GIMBAL_MANAGER_INFORMATION_DATA>(&answers)[0].gimbal_device_id, 154);
            }
        }
    }
}

/// Client checklist E10: "512/p1=280 to component 0 in the first second after daemon start is answered within 1 s." No
/// gimbal was heard by then, so the answer is "later", and 280 comes by itself as soon as one was.
#[test]
fn client_item_e10_a_request_in_the_first_second_is_answered() {
    for millis in [0, 1, 300, 999] {
        let (mut world, places) = World::empty(three_links());
        world.run_for(Duration::from_millis(millis));

        let answers = world.ask(places.ground, GCS, &request_message(MavId::new(1, 0), 280));
        assert_eq!(of::<COMMAND_ACK_DATA>(&answers), [ack(GCS, REQUEST, TEMPORARILY_REJECTED)]);
        assert_eq!(ids(&answers), [77]);

        world.run_for(SECOND);
        world.forget();
        announce(&mut world, places.gimbal, GIMBAL, usual_capabilities());
        let told: Vec<GIMBAL_MANAGER_INFORMATION_DATA> = world.take_messages(places.ground);
        assert_eq!(told.iter().map(|told| told.gimbal_device_id).collect::<Vec<_>>(), [154]);
    }
}

/// Client checklist E13: "18 requests for 280 in 20 s are all answered: no once-only flag."
/// Client checklist E14: "25 requests for 280 in 5 bursts of 5 within a few ms are all answered in order."
#[test]
fn client_items_e13_and_e14_every_request_is_answered() {
    for (requests, pause) in [(18, vec![Duration::from_micros(1_111_111)]), (25, bursts_of_five())] {
        let (mut world, places) = with_gimbal();
        for request in 0..requests {
            let answers = world.ask(places.ground, GCS, &request_message(MANAGER, 280));
            assert_eq!(ids(&answers), [77, 280], "request {request} of {requests}");
            run_looking(&mut world, places, pause[request % pause.len()], 0.0, 0.0);
        }
    }

    // Also when all stand in one datagram.
    let (mut world, places) = with_gimbal();
    let request = world.send(places.ground, GCS, &request_message(MANAGER, 280));
    world.forget();
    world.send_bytes(places.ground, &request.repeat(5));
    assert_eq!(ids(&world.take(places.ground)), [77, 280].repeat(5));
}

fn bursts_of_five() -> Vec<Duration> {
    [1, 1, 2, 1, 4_000].map(Duration::from_millis).to_vec()
}

/// Client checklist E15: "280, 281 never carry gimbal_device_id 0; both carry the same id for the same gimbal."
/// Client checklist E16: "With two devices … a single request yields one 280 per device", here from the manager component
/// that each of them has.
/// Client checklist E17: "With two gimbals in the default layout, each has its own manager component and both are listed."
#[test]
fn client_items_e15_to_e17_two_gimbals_are_found_as_two() {
    let (mut world, places) = World::empty(three_links());
    world.send(places.ground, GCS, &ground_heartbeat());
    let second = MavId::new(1, 171);
    announce(&mut world, places.gimbal, GIMBAL, usual_capabilities());
    announce(&mut world, places.gimbal, second, usual_capabilities());

    let answers = world.ask(places.ground, GCS, &request_message(EVERYBODY, 280));

    let told: Vec<(u32, MavId)> = answers.iter().map(|answer| (answer.id(), answer.source())).collect();
    let other = MavId::new(1, 192);
    assert_eq!(told, [(77, MANAGER), (280, MANAGER), (77, other), (280, other)]);
    world.run_for(SECOND);
    let mut heard = world.take(places.ground);
    heard.extend(answers);
    for (manager, device) in [(MANAGER, GIMBAL), (other, second)] {
        assert!(heard.iter().any(|arrival| arrival.id() == HEARTBEAT && arrival.source() == manager));
        let ours: Vec<Arrival> = heard.iter().filter(|arrival| arrival.source() == manager).cloned().collect();
        let information: Vec<GIMBAL_MANAGER_INFORMATION_DATA> = of(&ours);
        let status: Vec<GIMBAL_MANAGER_STATUS_DATA> = of(&ours);
        assert_eq!(information.iter().map(|told| told.gimbal_device_id).collect::<Vec<_>>(), [device.component]);
        assert!(status.len() >= 5 && status.iter().all(|told| told.gimbal_device_id == device.component));
    }
}

/// Client checklist E18: "512/p1=283 to M (device in the same component): ACCEPTED, then 283". A v2 device is a component
/// of its own, so the manager has none to send and says so; what it says besides is 285, which goes on.
/// Client checklist E23: "With 283 knowledge missing the daemon … refuses at once: never silence."
/// Client checklist E24: "If 283 is refused, 285 keeps streaming so that the gimbal is listed in ≤ 6 s."
#[test]
fn client_items_e18_e23_and_e24_the_manager_has_no_283_of_its_own() {
    let (mut world, places) = World::empty(three_links());
    world.send(places.ground, GCS, &ground_heartbeat());
    assert_eq!(world.ask(places.ground, GCS, &request_message(MANAGER, 283)).len(), 1, "before any gimbal is known");
    assert_eq!(world.result_of(places.ground, GCS, &request_message(MANAGER, 283)), Some(DENIED));

    announce(&mut world, places.gimbal, GIMBAL, usual_capabilities());
    assert_eq!(world.result_of(places.ground, GCS, &request_message(MANAGER, 283)), Some(DENIED));
    world.forget();
    look(&mut world, places, -10.0, 0.0);
    let heard = world.take(places.ground);
    assert_eq!((heard[0].at, heard[0].id(), heard[0].source()), (world.now, 285, GIMBAL));
}

/// Client checklist E19: "With a separate device component, 283 has source = device component and gimbal_device_id 0."
/// Client checklist E20: "283's vendor, model and custom strings are zero-padded and show up unchanged."
#[test]
fn client_items_e19_and_e20_what_a_device_is_called_comes_from_the_device() {
    let (mut world, places) = World::empty(three_links());
    let names = DeviceSettings {
        vendor_name: "Acme".to_owned(),
        model_name: "A name that fills all 32 letters".to_owned(),
        custom_name: "über".to_owned(),
        ..DeviceSettings::default()
    };
    world.install(places.gimbal, Device::new(Timestamp::ZERO, names));
    world.send(places.ground, GCS, &ground_heartbeat());
    world.run_for(Duration::from_secs(5));

    let answers = world.ask(places.ground, GCS, &request_message(GIMBAL, 283));

    assert_eq!(ids(&answers), [77, 283]);
    assert!(answers.iter().all(|answer| answer.source() == GIMBAL), "none of it is from us");
    let told: &GIMBAL_DEVICE_INFORMATION_DATA = &of(&answers)[0];
    let padded = |text: &str| {
        let mut bytes = [0; 32];
        bytes[..text.len()].copy_from_slice(text.as_bytes());
        bytes
    };
    assert_eq!(told.gimbal_device_id, 0);
    assert_eq!(*told.vendor_name, padded("Acme"));
    assert_eq!(*told.model_name, padded("A name that fills all 32 letters"));
    assert_eq!(*told.custom_name, padded("über"));
}

/// Client checklist E21: "512/p1=283 with zero params to 154 while it is M: answered; to 171–175 while they are nobody:
/// total silence." 154 is the device here, and the request is its own to answer.
/// Client checklist E22: "512/p1=283 to system 0, component 0: 283 sent; not more than one ACK per component of ours."
#[test]
fn client_items_e21_and_e22_a_request_for_the_device_is_answered_by_the_device_alone() {
    let (mut world, places) = with_gimbal();
    for (target, reaches_the_gimbal) in
        [(154, true), (171, false), (172, false), (173, false), (174, false), (175, false)]
    {
        let answers = world.ask(places.ground, GCS, &request_message(MavId::new(1, target), 283));

        assert_eq!(answers, [], "asked {target}");
        assert_eq!(world.take(places.autopilot), []);
        let heard = world.take(places.gimbal);
        assert_eq!(ids(&heard), if reaches_the_gimbal { vec![76] } else { vec![] }, "asked {target}");
    }
    assert_eq!(world.ask(places.ground, GCS, &request_message(EVERYBODY, 283)), [], "none of ours is concerned");
    assert_eq!(ids(&world.take(places.gimbal)), [76]);

    let (mut world, places) = World::with_one_gimbal(three_links());
    let answers = world.ask(places.ground, GCS, &request_message(EVERYBODY, 283));
    assert!(answers.iter().any(|answer| answer.id() == 283 && answer.source() == GIMBAL), "{:?}", ids(&answers));
    assert!(answers.iter().all(|answer| answer.source() != MANAGER));
}

/// Client checklist E25: "512 for a message we do not have, addressed to M: UNSUPPORTED once. Addressed to component 0:
/// silence." The answer is DENIED: after UNSUPPORTED MAVSDK asks again by an older command.
#[test]
fn client_item_e25_a_message_that_we_do_not_have_is_denied_once() {
    let (mut world, places) = with_gimbal();
    for message_id in [30, 33, 148, 259, 283, 285] {
        assert_eq!(world.result_of(places.ground, GCS, &request_message(MANAGER, message_id)), Some(DENIED));
        for target in [MavId::new(1, 0), EVERYBODY] {
            assert_eq!(world.ask(places.ground, GCS, &request_message(target, message_id)), []);
        }
    }
}

/// Client checklist E26: "Any command addressed to another component (1, 100, 191): no answer, no effect, with default
/// configuration." Ours is 191, so others are asked here.
/// Client checklist E27: "Any command to another system id: no answer, no effect."
#[test]
fn client_items_e26_and_e27_what_others_are_asked_is_no_business_of_ours() {
    let (mut world, places) = with_gimbal();
    world.send(places.autopilot, AUTOPILOT, &px4_heartbeat());
    let before = world.snapshot().gimbals;
    for target in [
        AUTOPILOT,
        MavId::new(1, 100),
        MavId::new(1, 192),
        MavId::new(1, 154),
        MavId::new(2, 191),
        MavId::new(2, 0),
        MavId::new(2, 154),
    ] {
        for command in [
            request_message(target, 280),
            set_interval(target, 281, -1.0),
            command_long(target, 1000, &[-30.0, 20.0, NAN, NAN, 44.0, 0.0, 154.0]),
            command_int(target, 1000, [-30.0, 20.0, NAN, NAN], 44, 0, 154.0),
            command_long(target, 1001, &[-2.0, -2.0, -1.0, -1.0, NAN, NAN, 154.0]),
            command_int(target, 195, [154.0, NAN, NAN, NAN], 473_977_418, 85_455_938, 10.0),
            command_long(target, 197, &[154.0]),
            command_long(target, 9_999, &[]),
        ] {
            assert_eq!(world.ask(places.ground, GCS, &command), [], "{command:?}");
            assert!(world.take(places.gimbal).iter().all(|arrival| arrival.id() != 284), "{command:?}");
        }
    }
    let after = world.snapshot().gimbals;
    assert_eq!(
        (&after[0].primary, &after[0].setpoint, &after[0].roi, &after[0].rejected),
        (&before[0].primary, &before[0].setpoint, &before[0].roi, &before[0].rejected)
    );
    run_looking(&mut world, places, SECOND, 0.0, 0.0);
    assert_eq!(told_control(&world.take(places.ground)), Some((EVERYBODY, EVERYBODY)), "and 281 still comes");
}

/// Client checklist E28: "511 for 280 with 30 s: ACCEPTED, 280 is emitted every 30 s ± 10 %; 510 for 280: ACCEPTED,
/// MESSAGE_INTERVAL with 30,000,000."
#[test]
fn client_item_e28_the_information_can_be_had_every_30_seconds() {
    let (mut world, places) = with_gimbal();
    assert_eq!(world.result_of(places.ground, GCS, &set_interval(MANAGER, 280, 30_000_000.0)), Some(ACCEPTED));
    let start = world.now;

    run_looking(&mut world, places, Duration::from_secs(100), 0.0, 0.0);

    let told = world.take(places.ground);
    let times: Vec<Duration> = told.iter().filter(|at| at.id() == 280).map(|at| at.at - start).collect();
    assert_eq!(times, [30, 60, 90].map(Duration::from_secs));
    assert!(world.take(places.autopilot).iter().all(|arrival| arrival.id() != 280), "on the link that asked");
    let answers = world.ask(places.ground, GCS, &command_long(MANAGER, 510, &[280.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]));
    assert_eq!(ids(&answers), [77, 244]);
    let interval = MESSAGE_INTERVAL_DATA { interval_us: 30_000_000, message_id: 280 };
    assert_eq!(of::<MESSAGE_INTERVAL_DATA>(&answers), [interval]);
}

/// Client checklist E29: "REQUEST_DATA_STREAM to M: ignored, no answer."
#[test]
fn client_item_e29_the_old_way_to_ask_for_streams_is_ignored() {
    let (mut world, places) = with_gimbal();
    for target in [MANAGER, MavId::new(1, 0), EVERYBODY] {
        let request = MavMessage::REQUEST_DATA_STREAM(REQUEST_DATA_STREAM_DATA {
            req_message_rate: 50,
            target_system: target.system,
            target_component: target.component,
            req_stream_id: 0,
            start_stop: 1,
        });
        assert_eq!(world.ask(places.ground, GCS, &request), []);
    }
    world.forget();
    run_looking(&mut world, places, SECOND, 0.0, 0.0);
    let ours = world.take(places.ground).into_iter().filter(|arrival| arrival.source() == MANAGER).count();
    assert_eq!(ours, 6, "a heartbeat and five statuses");
}

/// Client checklist E30: "Discovery works when the client begins 60 s after the manager, and when the manager begins 60 s
/// after the client": the client asks whoever beats, as soon as it hears it.
#[test]
fn client_item_e30_discovery_does_not_depend_on_who_is_first() {
    for (gimbal_at, client_at) in [(1, 61), (61, 1), (1, 1)] {
        let (mut world, places) = World::empty(Settings { system_id: SystemId::Auto, ..three_links() });
        world.install(places.autopilot, Vehicle::new(Timestamp::ZERO, VehicleSettings::default()));
        let (mut asked, mut found) = (false, false);
        for second in 0..80 {
            if second == gimbal_at {
                world.install(places.gimbal, Device::new(world.now, DeviceSettings::default()));
            }
            if second >= client_at {
                world.send(places.ground, GCS, &ground_heartbeat());
                let heard = world.take(places.ground);
                let beats = heard.iter().any(|arrival| arrival.id() == HEARTBEAT && arrival.source() == MANAGER);
                if beats && !asked {
                    asked = true;
                    world.send(places.ground, GCS, &request_message(MANAGER, 280));
                }
                found |= heard.iter().chain(world.arrivals(places.ground)).any(|arrival| arrival.id() == 280);
            }
            world.run_for(SECOND);
        }
        assert!(asked && found, "gimbal after {gimbal_at} s, client after {client_at} s");
        let heard = world.take(places.ground);
        assert!(heard.iter().any(|arrival| arrival.id() == 281) && heard.iter().any(|arrival| arrival.id() == 285));
    }
}

/// Client checklist E31: "280 has HAS_PITCH_AXIS, HAS_YAW_AXIS (as the device has), CAN_POINT_LOCATION_LOCAL whenever angles
/// are accepted, CAN_POINT_LOCATION_GLOBAL exactly if ROI is accepted."
/// Client checklist E32: "HAS_RETRACT set exactly if flag 1 works; HAS_YAW_LOCK exactly if lock works."
/// Client checklist E33: "280's limits are radians, min ≤ max, finite."
#[test]
fn client_items_e31_to_e33_the_information_says_what_works() {
    let pitch_only = CapFlags::HAS_PITCH_AXIS | CapFlags::HAS_PITCH_LOCK;
    for (capabilities, can_retract, has_yaw) in [
        (usual_capabilities(), true, true),
        (usual_capabilities().difference(CapFlags::HAS_RETRACT), false, true),
        (pitch_only | CapFlags::HAS_YAW_AXIS, false, true),
        // Nobody states an end of what has none.
        (usual_capabilities() | CapFlags::SUPPORTS_INFINITE_YAW, true, true),
        (pitch_only | CapFlags::HAS_RETRACT, true, false),
    ] {
        let (mut world, places) = with_gimbal_that(capabilities, three_links());
        world.send(places.autopilot, AUTOPILOT, &px4_heartbeat());
        let state = autopilot_state(world.now, EVERYBODY, 30.0);
        world.send(places.autopilot, AUTOPILOT, &MavMessage::AUTOPILOT_STATE_FOR_GIMBAL_DEVICE(state));
        let told = |world: &mut World| {
            let answers = world.ask(places.ground, GCS, &request_message(MANAGER, 280));
            let told: Vec<GIMBAL_MANAGER_INFORMATION_DATA> = of(&answers);
            told[0].clone()
        };
        let global = CapFlags::CAN_POINT_LOCATION_GLOBAL;
        assert!(!CapFlags::from_bits_retain(told(&mut world).cap_flags).contains(global), "there is no position");
        fly(&mut world, places, FIELD, 30.0);
        let told = told(&mut world);
        let has = |flag: CapFlags| CapFlags::from_bits_retain(told.cap_flags).contains(flag);

        assert!(has(CapFlags::HAS_PITCH_AXIS));
        assert_eq!(has(CapFlags::HAS_YAW_AXIS), has_yaw);
        assert!(has(CapFlags::CAN_POINT_LOCATION_LOCAL) && has(global));
        assert_eq!(world.result_of(places.ground, GCS, &roi_location(0, [47.4, 8.5], 400.0)), Some(ACCEPTED));
        for (min, max) in
            [(told.roll_min, told.roll_max), (told.pitch_min, told.pitch_max), (told.yaw_min, told.yaw_max)]
        {
            assert!(min.is_finite() && max.is_finite() && min <= max && min >= -3.15 && max <= 3.15, "{told:?}");
        }

        assert_eq!(has(CapFlags::HAS_RETRACT), can_retract);
        let retract = world.result_of(places.ground, GCS, &pitchyaw(NAN, NAN, NAN, NAN, 1.0));
        assert_eq!(retract, Some(if can_retract { ACCEPTED } else { DENIED }));
        assert_eq!(has(CapFlags::HAS_YAW_LOCK), has_yaw);
        if has_yaw {
            // Also where the device has no lock: then it is told to turn against the vehicle.
            assert_eq!(
                world.result_of(places.ground, GCS, &pitchyaw(-10.0, 40.0, NAN, NAN, 28.0)),
                Some(ACCEPTED),
                "{capabilities:?}"
            );
        }
    }
}

/// A device says that it is there and what it can do.
fn announce(world: &mut World, place: Place, device: MavId, capabilities: CapFlags) {
    world.send(place, device, &gimbal_heartbeat());
    let information = device_information(world.now, capabilities);
    world.send(place, device, &MavMessage::GIMBAL_DEVICE_INFORMATION(information));
}
