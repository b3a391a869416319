//! One answer, at once, whatever else goes on (client checklist E121 to E134, protocol checklist 178).

use std::collections::BTreeSet;
use std::time::Duration;

use gimbald::bridge::settings::{Role, Transport};
use gimbald::timestamp::Timestamp;
use gimbald::wire::MavId;
use gimbald::wire::dialect::{
    COMMAND_ACK_DATA, GIMBAL_MANAGER_INFORMATION_DATA, GIMBAL_MANAGER_STATUS_DATA, GLOBAL_POSITION_INT_DATA,
    MavMessage, PARAM_REQUEST_LIST_DATA, PARAM_REQUEST_READ_DATA, PING_DATA,
};

use super::{
    COMPANION, SECOND, assert_near, is_nan, only_setpoint, run_looking, setpoints, told_control, with_gimbal,
    with_gimbal_that,
};
use crate::support::script::{
    ACCEPTED, DENIED, NAN, TEMPORARILY_REJECTED, UNSUPPORTED, ack, autopilot_state, command_int, command_long,
    device_status, ground_heartbeat, ids, of, pitch_yaw_deg, pitchyaw, px4_heartbeat, request_message, set_interval,
    set_manual_control, set_pitchyaw, take_control, usual_capabilities,
};
use crate::support::wire::{Random, checksum};
use crate::support::world::{AUTOPILOT, Arrival, GCS, MANAGER, World, link, three_links};

const FAILED: u8 = 4;
const IN_PROGRESS: u8 = 5;

/// Client checklist E121: "No answer of ours ever has result IN_PROGRESS", of all commands that there can be: each has one
/// answer, and it says what becomes of the command.
#[test]
fn client_item_e121_no_command_is_answered_in_progress() {
    let (mut world, places) = with_gimbal();
    let mut results = BTreeSet::new();
    for number in 0..=u16::MAX {
        let fill = if number % 2 == 0 { NAN } else { 1.0 };
        let answers = world.ask(places.ground, GCS, &command_long(MANAGER, number, &[fill; 7]));
        let acks: Vec<COMMAND_ACK_DATA> = of(&answers);
        assert_eq!(acks, [ack(GCS, number, acks[0].result)]);
        results.insert(acks[0].result);
    }
    assert!(results.contains(&UNSUPPORTED) && !results.contains(&IN_PROGRESS), "{results:?}");
}

/// Client checklist E122: "99 % of ACKs leave within 50 ms, all within 400 ms, with a device that does not answer at all."
/// Here: in the moment of the command.
/// Client checklist E123: "An ACK never waits for the device's motion or for its reply."
#[test]
fn client_items_e122_and_e123_no_answer_waits_for_the_gimbal() {
    let (mut world, places) = with_gimbal();
    for round in 0..50 {
        for command in [
            take_control(),
            pitchyaw(-30.0, f32::from(i16::from(round as u8)), NAN, NAN, 44.0),
            pitchyaw(NAN, NAN, 5.0, 0.0, 44.0),
            pitchyaw(NAN, NAN, NAN, NAN, 2.0),
            request_message(MANAGER, 280),
            set_interval(MANAGER, 281, 0.0),
        ] {
            let answers = world.ask(places.ground, GCS, &command);
            let acks: Vec<&Arrival> = answers.iter().filter(|answer| answer.id() == 77).collect();
            assert_eq!(acks.len(), 1, "{command:?}");
            assert_eq!((acks[0].at, acks[0].decode::<COMMAND_ACK_DATA>().result), (world.now, ACCEPTED));
        }
        // It says where it looks, and never goes anywhere.
        run_looking(&mut world, places, SECOND / 10, 0.0, 0.0);
    }
}

/// Client checklist E124: "Device unplugged: 1000 gets TEMPORARILY_REJECTED or FAILED, 280/281 still flow, ownership
/// works."
#[test]
fn client_item_e124_without_its_gimbal_a_manager_goes_on_answering() {
    let (mut world, places) = with_gimbal();
    world.unplug(places.gimbal);
    world.forget();

    assert_eq!(world.result_of(places.ground, GCS, &pitchyaw(-30.0, 0.0, NAN, NAN, 44.0)), Some(FAILED));
    let answers = world.ask(places.ground, GCS, &request_message(MANAGER, 280));
    assert_eq!(ids(&answers), [77, 280]);
    assert_eq!(of::<GIMBAL_MANAGER_INFORMATION_DATA>(&answers)[0].gimbal_device_id, 154);
    assert_eq!(world.result_of(places.ground, GCS, &take_control()), Some(ACCEPTED));
    world.forget();
    world.run_for(SECOND);
    let heard = world.take(places.ground);
    assert_eq!(of::<GIMBAL_MANAGER_STATUS_DATA>(&heard).len(), 5);
    assert_eq!(told_control(&heard), Some((GCS, MavId::new(0, 0))));
    assert_eq!(world.result_of(places.ground, COMPANION, &pitchyaw(-30.0, 0.0, NAN, NAN, 44.0)), Some(DENIED));

    // Before any gimbal was there it is "later"; a message is ignored.
    let (mut world, places) = World::empty(three_links());
    world.send(places.ground, GCS, &ground_heartbeat());
    for flags in [44.0, 2.0] {
        let command = command_long(MANAGER, 1000, &[-30.0, 0.0, NAN, NAN, flags, 0.0, 0.0]);
        assert_eq!(world.result_of(places.ground, GCS, &command), Some(TEMPORARILY_REJECTED));
    }
    assert_eq!(world.ask(places.ground, GCS, &set_pitchyaw(-0.5, 0.0, NAN, NAN, 44)), []);
}

/// Client checklist E125: "Two clients sending the same command number at the same time get one ACK each, targeted to
/// each", on one link and on two.
#[test]
fn client_item_e125_two_clients_have_an_answer_each() {
    let other = MavId::new(254, 190);
    for same_link in [true, false] {
        let (mut world, places) = with_gimbal();
        let second = if same_link { places.ground } else { places.autopilot };
        world.send(second, other, &ground_heartbeat());
        world.forget();

        world.send(places.ground, GCS, &request_message(MANAGER, 280));
        world.send(second, other, &request_message(MANAGER, 280));

        let mut heard = world.take(places.ground);
        heard.extend(world.take(second));
        let ours: Vec<Arrival> = heard.into_iter().filter(|arrival| arrival.source() == MANAGER).collect();
        assert_eq!(of::<COMMAND_ACK_DATA>(&ours), [ack(GCS, 512, ACCEPTED), ack(other, 512, ACCEPTED)]);
        assert_eq!(of::<GIMBAL_MANAGER_INFORMATION_DATA>(&ours).len(), 2);
    }
}

/// Client checklist E130: "PING, PARAM_REQUEST_READ to component 1, command 520 to component 1: no answer of ours."
#[test]
fn client_item_e130_what_the_autopilot_is_asked_is_not_answered_by_us() {
    let (mut world, places) = with_gimbal();
    world.send(places.autopilot, AUTOPILOT, &px4_heartbeat());
    let ping = |target: MavId| {
        let (target_system, target_component) = (target.system, target.component);
        MavMessage::PING(PING_DATA { time_usec: 1, seq: 2, target_system, target_component })
    };
    let read = MavMessage::PARAM_REQUEST_READ(PARAM_REQUEST_READ_DATA {
        param_index: -1,
        target_system: 1,
        target_component: 1,
        param_id: "SYSID_THISMAV".into(),
    });
    let list = MavMessage::PARAM_REQUEST_LIST(PARAM_REQUEST_LIST_DATA { target_system: 1, target_component: 1 });
    let capabilities = command_long(AUTOPILOT, 520, &[1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    let everybody = MavId::new(0, 0);
    for message in [ping(everybody), ping(AUTOPILOT), read, list, capabilities] {
        world.forget();
        let sent = world.send(places.ground, GCS, &message);
        assert_eq!(world.take(places.ground), [], "{message:?}");
        let passed: Vec<Vec<u8>> = world.take(places.autopilot).into_iter().map(|arrival| arrival.bytes).collect();
        assert_eq!(passed, [sent]);
    }
}

/// Client checklist E132: "Everything we send is MAVLink 2 …; MAVLink 1 commands of a client are still read."
#[test]
fn client_item_e132_we_speak_mavlink_2_and_read_mavlink_1() {
    let (mut world, places) = with_gimbal();
    for command in [take_control(), pitchyaw(-20.0, 10.0, NAN, NAN, 44.0), request_message(MANAGER, 280)] {
        let (number, frame) = in_mavlink_1(&command);
        world.send_bytes(places.ground, &frame);
        let answers = world.take(places.ground);
        assert!(of::<COMMAND_ACK_DATA>(&answers).contains(&ack(GCS, number, ACCEPTED)), "{command:?}");
    }
    let (pitch, yaw) = pitch_yaw_deg(only_setpoint(&mut world, places).q);
    assert_near(pitch, -20.0, 0.01);
    assert_near(yaw, 10.0, 0.01);
    run_looking(&mut world, places, Duration::from_secs(5), 0.0, 0.0);
    for place in [places.autopilot, places.gimbal, places.ground] {
        let ours = world.take(place).into_iter().filter(|arrival| arrival.source() == MANAGER);
        assert!(ours.map(|arrival| arrival.bytes[0]).all(|magic| magic == 0xfd));
    }
}

/// Client checklist E133: "Client address changes its port (restart): the new one gets streams at once, the old one is
/// dropped after its time."
#[test]
fn client_item_e133_a_client_that_comes_from_another_port_is_served_there() {
    let (mut world, places) = with_gimbal();
    world.send(places.ground, GCS, &take_control());
    let restarted = world.open(2);
    world.send(restarted, GCS, &ground_heartbeat());
    world.forget();

    // It holds what it held, and its answers come to where it is.
    assert_eq!(world.result_of(restarted, GCS, &pitchyaw(-30.0, 0.0, NAN, NAN, 44.0)), Some(ACCEPTED));
    world.forget();
    world.run_for(SECOND);
    assert_eq!(world.take_messages::<GIMBAL_MANAGER_STATUS_DATA>(restarted).len(), 5);

    // What an address was asked for as its rate ends with it; the link drops it after a minute of silence.
    world.send(places.ground, GCS, &set_interval(MANAGER, 281, -1.0));
    world.unplug(places.ground);
    world.forget();
    world.run_for(SECOND);
    assert_eq!(world.take(places.ground), []);
    assert_eq!(world.take_messages::<GIMBAL_MANAGER_STATUS_DATA>(restarted).len(), 5);
}

/// Client checklist E134: "Random bytes, truncated frames, bad CRC between good frames: no lost good frame beyond the one
/// hit." Each command that is whole is answered once, on a serial line and in datagrams.
#[test]
fn client_item_e134_noise_between_commands_costs_none() {
    let mut settings = three_links();
    settings.links[2] = link("ground", Role::Ground, Transport::Serial { baud: 115_200 });
    for settings in [three_links(), settings] {
        let (mut world, places) = with_gimbal_that(usual_capabilities(), settings);
        let mut random = Random::new(134);
        let whole = world.send(places.ground, GCS, &request_message(MANAGER, 281));
        let mut damaged = whole.clone();
        *damaged.last_mut().expect("it has a checksum") ^= 0x10;
        run_looking(&mut world, places, SECOND, 0.0, 0.0);
        for round in 0..200 {
            let mut bytes = Vec::new();
            for _ in 0..3 {
                let noise = match round % 4 {
                    0 => Vec::new(),
                    1 => (0..random.below(60)).map(|_| random.byte() & 0x7f).collect(),
                    2 => damaged.clone(),
                    _ => whole[..random.below(whole.len())].to_vec(),
                };
                bytes.extend(noise);
                bytes.extend(&whole);
            }
            world.forget();
            world.send_bytes(places.ground, &bytes);
            run_looking(&mut world, places, SECOND, 0.0, 0.0);
            let heard = world.take(places.ground);
            assert_eq!(of::<COMMAND_ACK_DATA>(&heard), vec![ack(GCS, 512, ACCEPTED); 3], "round {round}");
        }
    }
}

/// "When the AP link is silent for 5 s, ROI and earth-frame conversion report stale, the gimbal keeps its last vehicle-frame
/// set-point."
#[test]
fn item_178_without_the_autopilot_what_needs_it_is_refused_and_the_rest_goes_on() {
    let (mut world, places) = with_gimbal();
    let roi = command_int(MANAGER, 195, [154.0, NAN, NAN, NAN], 473_977_418, 85_455_938, 10.0);
    let north = pitchyaw(-20.0, 40.0, NAN, NAN, 92.0);
    world.send(places.autopilot, AUTOPILOT, &px4_heartbeat());
    let state = MavMessage::AUTOPILOT_STATE_FOR_GIMBAL_DEVICE(autopilot_state(world.now, MavId::new(0, 0), 30.0));
    world.send(places.autopilot, AUTOPILOT, &state);
    world.send(places.autopilot, AUTOPILOT, &MavMessage::GLOBAL_POSITION_INT(position()));
    assert_eq!(world.result_of(places.ground, GCS, &roi), Some(ACCEPTED));
    assert_eq!(world.result_of(places.ground, GCS, &north), Some(ACCEPTED));
    assert_eq!(world.result_of(places.ground, GCS, &pitchyaw(-30.0, 20.0, NAN, NAN, 44.0)), Some(ACCEPTED));
    let vehicle = world.snapshot().vehicle;
    assert!(vehicle.alive && vehicle.heading_deg.is_some() && vehicle.latitude_deg.is_some());
    let _ = setpoints(&mut world, places);

    run_looking(&mut world, places, Duration::from_secs(6), -30.0, 20.0);

    let vehicle = world.snapshot().vehicle;
    assert!(!vehicle.alive && vehicle.heading_deg.is_none() && vehicle.latitude_deg.is_none(), "shown as unknown");
    let told = setpoints(&mut world, places);
    assert_eq!(told.len(), 120);
    for (at, setpoint) in &told {
        let (pitch, yaw) = pitch_yaw_deg(setpoint.q);
        assert_near(pitch, -30.0, 0.01);
        assert_near(yaw, 20.0, 0.01);
        assert_eq!(setpoint.flags, 44, "{at}");
        assert!(is_nan(&[setpoint.angular_velocity_x, setpoint.angular_velocity_y, setpoint.angular_velocity_z]));
    }
    for command in [roi, north] {
        assert_eq!(world.result_of(places.ground, GCS, &command), Some(TEMPORARILY_REJECTED), "{command:?}");
    }
    assert_eq!(world.result_of(places.ground, GCS, &pitchyaw(-10.0, 0.0, NAN, NAN, 44.0)), Some(ACCEPTED));
}

/// Neither the answer to a message nor to what is malformed is ever sent: only commands are answered.
#[test]
fn messages_have_no_answer() {
    let (mut world, places) = with_gimbal();
    let status = MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(device_status(world.now, 44, 0.0, 0.0));
    for message in [
        set_pitchyaw(-0.2, 0.1, NAN, NAN, 44),
        set_pitchyaw(-0.2, 0.1, NAN, NAN, 96),
        set_manual_control(0.5, NAN, NAN, NAN),
        status,
    ] {
        let heard = world.ask(places.ground, GCS, &message);
        assert!(heard.iter().all(|arrival| arrival.id() == 281), "{message:?}: {:?}", ids(&heard));
    }
}

fn position() -> GLOBAL_POSITION_INT_DATA {
    GLOBAL_POSITION_INT_DATA {
        time_boot_ms: Timestamp::from_secs(1).boot_ms(),
        lat: 473_977_418,
        lon: 85_455_938,
        alt: 500_000,
        relative_alt: 50_000,
        vx: 0,
        vy: 0,
        vz: 0,
        hdg: 3_000,
    }
}

/// A `COMMAND_LONG` of the ground station as a frame of MAVLink 1, and its number.
fn in_mavlink_1(command: &MavMessage) -> (u16, Vec<u8>) {
    let MavMessage::COMMAND_LONG(command) = command else { panic!("{command:?} is no COMMAND_LONG") };
    let mut frame = vec![0xfe, 33, 0, GCS.system, GCS.component, 76];
    let params = [
        command.param1,
        command.param2,
        command.param3,
        command.param4,
        command.param5,
        command.param6,
        command.param7,
    ];
    frame.extend(params.iter().flat_map(|param| param.to_le_bytes()));
    frame.extend(command.command.to_le_bytes());
    frame.extend([command.target_system, command.target_component, command.confirmation]);
    let sum = checksum(&frame[1..], 152);
    frame.extend(sum.to_le_bytes());
    (command.command, frame)
}
