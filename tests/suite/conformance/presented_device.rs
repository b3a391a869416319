//! `[autopilot] present_device` (D18): the gimbal as a device of the autopilot, which ArduPilot drives with `MNT1_TYPE` = 6.

mod arbitration;
mod ardupilot;
mod kept_apart;

use std::time::Duration;

use gimbald::bridge::settings::Settings;
use gimbald::bridge::snapshot::PresentedSnapshot;
use gimbald::gimbals::settings::GimbalSettings;
use gimbald::wire::MavId;
use gimbald::wire::dialect::{
    COMMAND_ACK_DATA, GIMBAL_DEVICE_ATTITUDE_STATUS_DATA, GIMBAL_DEVICE_INFORMATION_DATA,
    GIMBAL_DEVICE_SET_ATTITUDE_DATA, HEARTBEAT_DATA, MESSAGE_INTERVAL_DATA, MavMessage, PARAM_REQUEST_LIST_DATA,
};
use gimbald::wire::ids::CapFlags;

use crate::support::script::{
    ACCEPTED, DENIED, NAN, TEMPORARILY_REJECTED, UNSUPPORTED, ack, ardupilot_heartbeat, command_long,
    device_information, device_status, gimbal_heartbeat, ids, of, pitch_yaw_deg, quaternion, request_message,
    set_interval, usual_capabilities,
};
use crate::support::world::{AUTOPILOT, Arrival, GCS, GIMBAL, MANAGER, Places, World, three_links};

const SECOND: Duration = Duration::from_secs(1);

/// The period of ArduPilot's stream.
const PERIOD: Duration = Duration::from_millis(20);

const EVERYBODY: MavId = MavId::new(0, 0);

/// 284 as ArduPilot sends it: flags 0 or 28 (roll, pitch and yaw lock), no frame bits; an angle in degrees.
fn setpoint(pitch: f64, yaw: f64, flags: u16) -> MavMessage {
    MavMessage::GIMBAL_DEVICE_SET_ATTITUDE(GIMBAL_DEVICE_SET_ATTITUDE_DATA {
        q: quaternion(pitch, yaw),
        angular_velocity_x: NAN,
        angular_velocity_y: NAN,
        angular_velocity_z: NAN,
        flags,
        target_system: 1,
        target_component: 154,
    })
}

/// The same with rates, in degrees per second.
fn turning(pitch_rate: f64, yaw_rate: f64) -> MavMessage {
    MavMessage::GIMBAL_DEVICE_SET_ATTITUDE(GIMBAL_DEVICE_SET_ATTITUDE_DATA {
        q: [NAN; 4],
        angular_velocity_x: 0.0,
        angular_velocity_y: pitch_rate.to_radians() as f32,
        angular_velocity_z: yaw_rate.to_radians() as f32,
        flags: 28,
        target_system: 1,
        target_component: 154,
    })
}

fn presenting() -> Settings {
    Settings { present_device: true, ..three_links() }
}

/// An ArduPilot and a gimbal that are known, in a daemon that presents it.
fn with_device(settings: Settings) -> (World, Places) {
    let (mut world, places) = World::empty(settings);
    world.run_for(SECOND / 2);
    world.send(places.autopilot, AUTOPILOT, &ardupilot_heartbeat());
    introduce(&mut world, places, usual_capabilities());
    world.run_for(SECOND);
    world.send(places.autopilot, AUTOPILOT, &ardupilot_heartbeat());
    world.forget();
    (world, places)
}

fn introduce(world: &mut World, places: Places, capabilities: CapFlags) {
    world.send(places.gimbal, GIMBAL, &gimbal_heartbeat());
    let information = MavMessage::GIMBAL_DEVICE_INFORMATION(device_information(world.now, capabilities));
    world.send(places.gimbal, GIMBAL, &information);
    let status = MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(device_status(world.now, 44, -5.0, 10.0));
    world.send(places.gimbal, GIMBAL, &status);
}

/// What the presented device said.
fn of_device(arrivals: Vec<Arrival>) -> Vec<Arrival> {
    arrivals.into_iter().filter(|arrival| arrival.source() == GIMBAL).collect()
}

/// "Heartbeat type GIMBAL from S/154 from early on (ArduPilot searches from boot, gives up 60 s later or when armed)":
/// before there is a gimbal, once a second, on the links of autopilots and nowhere else. It is told how the gimbal is.
#[test]
fn it_beats_before_there_is_a_gimbal() {
    let (mut world, places) = World::empty(presenting());
    world.run_for(SECOND * 7 / 2);
    let beats: Vec<HEARTBEAT_DATA> = of(&of_device(world.take(places.autopilot)));
    let expected = HEARTBEAT_DATA {
        custom_mode: 0,
        mavtype: 26,
        autopilot: 8,
        base_mode: 0,
        system_status: 3,
        mavlink_version: 3,
    };
    assert_eq!(beats, vec![expected.clone(); 4]);
    assert_eq!(of_device([world.take(places.ground), world.take(places.gimbal)].concat()), []);

    introduce(&mut world, places, usual_capabilities());
    world.forget();
    world.run_for(SECOND);
    let beats: Vec<HEARTBEAT_DATA> = of(&of_device(world.take(places.autopilot)));
    assert_eq!(beats, [HEARTBEAT_DATA { system_status: 4, ..expected.clone() }]);
    world.run_for(4 * SECOND);
    let beats: Vec<HEARTBEAT_DATA> = of(&of_device(world.take(places.autopilot)));
    assert_eq!(beats.last(), Some(&HEARTBEAT_DATA { system_status: 5, ..expected.clone() }), "the gimbal is lost");

    world.input(gimbald::bridge::Input::Shutdown);
    let beats: Vec<HEARTBEAT_DATA> = of(&of_device(world.take(places.autopilot)));
    assert_eq!(beats, [HEARTBEAT_DATA { system_status: 7, ..expected }], "the goodbye");
}

/// Without the setting nothing of it is there.
#[test]
fn without_the_setting_no_device_is_presented() {
    let (mut world, places) = with_device(three_links());
    world.send(places.autopilot, AUTOPILOT, &request_message(GIMBAL, 283));
    world.run_for(2 * SECOND);
    assert_eq!(of_device(world.take(places.autopilot)), []);
    assert_eq!(world.snapshot().gimbals[0].presented, None);
}

/// "Answers to REQUEST_MESSAGE 283 to 1/154 (and 0/0)", as often as it is asked; "283 with true capabilities": the gimbal's
/// names and limits, and what we add. Before the gimbal is known it is TEMPORARILY_REJECTED.
#[test]
fn it_tells_what_the_gimbal_is() {
    let (mut world, places) = World::empty(presenting());
    world.run_for(SECOND);
    world.send(places.autopilot, AUTOPILOT, &ardupilot_heartbeat());
    for target in [GIMBAL, EVERYBODY] {
        let answers = of_device(world.ask(places.autopilot, AUTOPILOT, &request_message(target, 283)));
        let acks: Vec<COMMAND_ACK_DATA> = of(&answers);
        assert_eq!((answers.len(), acks), (1, vec![ack(AUTOPILOT, 512, TEMPORARILY_REJECTED)]), "{target}");
    }

    introduce(&mut world, places, usual_capabilities());
    for target in [GIMBAL, MavId::new(1, 0), EVERYBODY, GIMBAL] {
        let answers = of_device(world.ask(places.autopilot, AUTOPILOT, &request_message(target, 283)));
        assert_eq!(ids(&answers), [77, 283], "{target}");
        assert_eq!(answers[0].decode::<COMMAND_ACK_DATA>(), ack(AUTOPILOT, 512, ACCEPTED));
        let ours: GIMBAL_DEVICE_INFORMATION_DATA = answers[1].decode();
        let added = CapFlags::SUPPORTS_YAW_IN_EARTH_FRAME | CapFlags::CAN_POINT_LOCATION_GLOBAL;
        let capabilities = usual_capabilities() | added;
        let expected = GIMBAL_DEVICE_INFORMATION_DATA {
            uid: ours.uid,
            hardware_version: ours.hardware_version,
            cap_flags: capabilities.bits() as u16,
            cap_flags2: capabilities.bits(),
            ..device_information(world.now, usual_capabilities())
        };
        assert_eq!(ours, expected);
    }
}

/// "285 always in vehicle frame with YAW_IN_VEHICLE_FRAME, broadcast at a usable rate": ArduPilot takes the numbers for that
/// whatever the flags say. A gimbal that tells its yaw from North is turned by its own heading, or the vehicle's.
#[test]
fn it_tells_the_attitude_in_the_vehicle_frame() {
    // As the gimbal tells it: YAW_IN_VEHICLE_FRAME with lock bits; YAW_IN_EARTH_FRAME with its idea of the heading.
    for (flags, yaw, delta_yaw, expected) in
        [(44, 10.0, NAN, Some(10.0)), (28 | 64, 100.0, 90.0_f32, Some(10.0)), (28 | 64, 100.0, NAN, None)]
    {
        let (mut world, places) = with_device(presenting());
        let status = GIMBAL_DEVICE_ATTITUDE_STATUS_DATA {
            delta_yaw: delta_yaw.to_radians(),
            ..device_status(world.now, flags, -20.0, yaw)
        };
        let status = MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(status);
        world.forget();
        world.run_with(SECOND, &[(SECOND / 20, places.gimbal, GIMBAL, status)]);

        let told: Vec<GIMBAL_DEVICE_ATTITUDE_STATUS_DATA> = of(&of_device(world.take(places.autopilot)));
        let Some(expected) = expected else {
            assert_eq!(told, [], "nobody knows the heading");
            continue;
        };
        assert_eq!(told.len(), 10, "ten a second");
        for told in told {
            let (pitch, yaw) = pitch_yaw_deg(told.q);
            assert!((pitch + 20.0).abs() < 0.01 && (yaw - expected).abs() < 0.01, "{pitch} {yaw}");
            assert_eq!(told.flags & (32 | 64), 32);
            assert_eq!((told.gimbal_device_id, told.failure_flags), (0, 0));
        }
    }
}

/// An attitude that is old is not told as if it were new: ArduPilot would take the gimbal for healthy.
#[test]
fn an_old_attitude_is_told_as_a_fault() {
    const COMMS_ERROR: u32 = 128;
    let (mut world, places) = with_device(presenting());
    world.run_for(SECOND / 2);
    world.forget();
    world.run_with(2 * SECOND, &[(SECOND, places.gimbal, GIMBAL, gimbal_heartbeat())]);
    let told: Vec<GIMBAL_DEVICE_ATTITUDE_STATUS_DATA> = of(&of_device(world.take(places.autopilot)));
    assert_eq!(told.len(), 20);
    assert!(told.iter().all(|status| status.failure_flags == COMMS_ERROR));
    // So is a fresh one of a gimbal whose line was cut: it is lost at once.
    introduce(&mut world, places, usual_capabilities());
    world.forget();
    world.unplug(places.gimbal);
    world.run_for(SECOND / 2);
    let told: Vec<GIMBAL_DEVICE_ATTITUDE_STATUS_DATA> = of(&of_device(world.take(places.autopilot)));
    assert_eq!(told.iter().map(|status| status.failure_flags).collect::<Vec<_>>(), [COMMS_ERROR; 5]);
}

/// "ACKs for commands to S/154, SET_MESSAGE_INTERVAL; a full answer set as a real device": each command has one answer, and
/// nothing reaches the real gimbal. A list of no parameters has no answer.
#[test]
#[rustfmt::skip]
fn it_answers_as_a_device() {
    let (mut world, places) = with_device(presenting());
    let status = MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(device_status(world.now, 44, -5.0, 10.0));
    world.send(places.gimbal, GIMBAL, &status);
    for (command, result, more) in [
        (request_message(GIMBAL, 285),                         ACCEPTED,    &[285][..]),
        (request_message(GIMBAL, 0),                           ACCEPTED,    &[0]),
        (request_message(GIMBAL, 280),                         DENIED,      &[]),
        (request_message(GIMBAL, 148),                         DENIED,      &[]),
        (set_interval(GIMBAL, 285, 50_000.0),                  ACCEPTED,    &[]),
        (set_interval(GIMBAL, 285, NAN),                       ACCEPTED,    &[]),
        (set_interval(GIMBAL, 285, -3.0),                      DENIED,      &[]),
        (set_interval(GIMBAL, 281, 50_000.0),                  DENIED,      &[]),
        (command_long(GIMBAL, 510, &[285.0]),                  ACCEPTED,    &[244]),
        (command_long(GIMBAL, 510, &[0.0]),                    ACCEPTED,    &[244]),
        (command_long(GIMBAL, 510, &[148.0]),                  DENIED,      &[]),
        (command_long(GIMBAL, 1000, &[-10.0, 0.0, NAN, NAN]),  UNSUPPORTED, &[]),
        (command_long(GIMBAL, 1001, &[-2.0, -2.0, -1.0, -1.0]), UNSUPPORTED, &[]),
        (command_long(GIMBAL, 246, &[0.0, 0.0, 0.0, 1.0]),     DENIED,      &[]),
        (command_long(GIMBAL, 400, &[1.0]),                    UNSUPPORTED, &[]),
    ] {
        let number = match &command { MavMessage::COMMAND_LONG(command) => command.command, _ => 0 };
        world.forget();
        world.send(places.autopilot, AUTOPILOT, &command);
        let answers = world.take(places.autopilot);
        assert_eq!(ids(&answers), [&[77][..], more].concat(), "{command:?}");
        assert_eq!(answers[0].decode::<COMMAND_ACK_DATA>(), ack(AUTOPILOT, number, result), "{command:?}");
        assert!(answers.iter().all(|answer| answer.source() == GIMBAL));
        assert_eq!(world.take(places.gimbal), [], "{command:?}");
    }
    // What everybody is told and it does not know is somebody else's business.
    for target in [EVERYBODY, MavId::new(1, 0)] {
        for command in [command_long(target, 400, &[1.0]), request_message(target, 148)] {
            let answers = world.ask(places.autopilot, AUTOPILOT, &command);
            assert_eq!(of_device(answers), [], "{command:?}");
        }
    }
    let list = PARAM_REQUEST_LIST_DATA { target_system: 1, target_component: 154 };
    assert_eq!(world.ask(places.autopilot, AUTOPILOT, &MavMessage::PARAM_REQUEST_LIST(list)), []);
    assert_eq!(world.take(places.gimbal), []);
    // The ground station's, on its own link, are for the real one.
    world.send(places.ground, GCS, &request_message(GIMBAL, 148));
    assert_eq!(ids(&world.take(places.gimbal)), [76]);
}

/// `SET_MESSAGE_INTERVAL` of 285 holds for the link it came on.
#[test]
fn its_attitude_comes_as_often_as_it_is_asked_for() {
    let (mut world, places) = with_device(presenting());
    for (interval_us, expected) in [(50_000.0, 20), (-1.0, 0), (0.0, 10)] {
        world.send(places.autopilot, AUTOPILOT, &set_interval(GIMBAL, 285, interval_us));
        world.forget();
        world.run_for(SECOND);
        let told: Vec<GIMBAL_DEVICE_ATTITUDE_STATUS_DATA> = world.take_messages(places.autopilot);
        assert_eq!(told.len(), expected, "{interval_us}");
    }
    let answers = world.ask(places.autopilot, AUTOPILOT, &command_long(GIMBAL, 510, &[285.0]));
    let interval: Vec<MESSAGE_INTERVAL_DATA> = of(&answers);
    assert_eq!(interval, [MESSAGE_INTERVAL_DATA { interval_us: 100_000, message_id: 285 }]);
}

/// "with ArduPilot configured `MNT1_TYPE` = 6": its first mount looks for 154 and no other, so the gimbal that is there is that
/// one, whatever its own id, with an entry or without.
#[test]
fn a_gimbal_alone_is_what_the_first_mount_looks_for() {
    let alone = MavId::new(1, 171);
    let entry = GimbalSettings { component_id: Some(171), ..GimbalSettings::found("camera".to_owned()) };
    for gimbals in [vec![], vec![entry]] {
        let (mut world, places) = World::empty(Settings { gimbals, ..presenting() });
        let beats = [(SECOND, places.autopilot, AUTOPILOT, ardupilot_heartbeat())];
        world.run_with(3 * SECOND, &beats);
        let sources: Vec<_> = of_device(world.take(places.autopilot)).iter().map(Arrival::source).collect();
        assert_eq!(sources, [GIMBAL; 4], "it is there before the gimbal");
        world.send(places.gimbal, alone, &gimbal_heartbeat());
        let information = device_information(world.now, usual_capabilities());
        world.send(places.gimbal, alone, &MavMessage::GIMBAL_DEVICE_INFORMATION(information));
        // No more than three seconds are waited for one that comes before it.
        world.run_with(4 * SECOND, &beats);
        let presented = world
            .snapshot()
            .gimbals
            .into_iter()
            .filter_map(|gimbal| Some((gimbal.manager_component_id, gimbal.presented?.device)));
        assert_eq!(presented.collect::<Vec<_>>(), [(192, "1/154".to_owned())]);
        assert_eq!(world.ask(places.autopilot, AUTOPILOT, &request_message(GIMBAL, 283)).len(), 2, "ACK and 283");
    }
}

/// "The first gimbal, by the ids of the managers, is the device 154 there", whichever beats first; and no longer than a moment is
/// waited for the one that comes before another, which may not be there.
#[test]
fn the_order_in_which_gimbals_beat_decides_nothing() {
    let second = MavId::new(1, 171);
    for (between, expected) in [
        (SECOND / 10, [(191, "1/154"), (192, "1/171")]),
        (2 * SECOND, [(191, "1/154"), (192, "1/171")]),
        // Found later than others it takes the first that is free.
        (5 * SECOND, [(191, "1/171"), (192, "1/154")]),
    ] {
        let (mut world, places) = World::empty(presenting());
        let beats = [(SECOND, places.autopilot, AUTOPILOT, ardupilot_heartbeat())];
        world.run_with(5 * SECOND, &beats);
        let tell = |world: &mut World, device| {
            world.send(places.gimbal, device, &gimbal_heartbeat());
            let information = device_information(world.now, usual_capabilities());
            world.send(places.gimbal, device, &MavMessage::GIMBAL_DEVICE_INFORMATION(information));
        };
        tell(&mut world, second);
        for _ in 0..between.as_millis() / 100 {
            world.run_with(SECOND / 10, &beats);
            tell(&mut world, second);
        }
        for _ in 0..50 {
            tell(&mut world, GIMBAL);
            tell(&mut world, second);
            world.run_with(SECOND / 10, &beats);
        }
        let gimbals = world.snapshot().gimbals;
        let mut presented: Vec<_> = gimbals
            .into_iter()
            .filter_map(|gimbal| Some((gimbal.manager_component_id, gimbal.presented?.device)))
            .collect();
        presented.sort();
        let expected = expected.map(|(manager, device)| (manager, device.to_owned()));
        assert_eq!(presented, expected, "{between:?}");
    }
}

/// "The gimbal of manager 191 as 154, the second as 171, since ArduPilot's instance 2 wants 171."
#[test]
fn a_second_gimbal_is_a_second_device() {
    let (mut world, places) = with_device(presenting());
    let second = MavId::new(1, 171);
    world.send(places.gimbal, second, &gimbal_heartbeat());
    let information = MavMessage::GIMBAL_DEVICE_INFORMATION(device_information(world.now, usual_capabilities()));
    world.send(places.gimbal, second, &information);
    world.run_for(SECOND);
    let answers = world.ask(places.autopilot, AUTOPILOT, &request_message(second, 283));
    assert_eq!(ids(&answers), [77, 283]);
    assert!(answers.iter().all(|answer| answer.source() == second));

    let presented: Vec<_> = world.snapshot().gimbals.into_iter().map(|gimbal| gimbal.presented).collect();
    let as_device =
        |device: &str| Some(PresentedSnapshot { device: device.into(), stream: "silent".into(), asked_age_ms: None });
    assert_eq!(presented, [as_device("1/154"), as_device("1/171")]);

    // Each is steered by what is addressed to it.
    let MavMessage::GIMBAL_DEVICE_SET_ATTITUDE(to_first) = setpoint(-30.0, 0.0, 0) else { panic!("it is one") };
    let to_second = |pitch| {
        let q = quaternion(pitch, 0.0);
        MavMessage::GIMBAL_DEVICE_SET_ATTITUDE(GIMBAL_DEVICE_SET_ATTITUDE_DATA {
            q,
            target_component: 171,
            ..to_first.clone()
        })
    };
    world.send(places.autopilot, AUTOPILOT, &to_second(0.0));
    world.forget();
    world.send(places.autopilot, AUTOPILOT, &to_second(-10.0));
    let told: Vec<GIMBAL_DEVICE_SET_ATTITUDE_DATA> = world.take_messages(places.gimbal);
    assert_eq!(told.iter().map(|told| told.target_component).collect::<Vec<_>>(), [171]);
    let sources: Vec<_> = world.snapshot().gimbals.into_iter().map(|gimbal| gimbal.setpoint.is_some()).collect();
    assert_eq!(sources, [false, true]);
    assert_eq!(MANAGER, MavId::new(1, 191));
}
