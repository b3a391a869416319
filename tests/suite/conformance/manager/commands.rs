//! Commands in general (protocol checklist 8.9), and what holds at the end and at the window (8.14).

use gimbald::bridge::Input;
use gimbald::timestamp::Timestamp;
use gimbald::wire::MavId;
use gimbald::wire::dialect::{COMMAND_ACK_DATA, COMMAND_LONG_DATA, HEARTBEAT_DATA, MavMessage};

use super::{SECOND, Setpoint, assert_near, look, only_setpoint, run_looking, with_gimbal};
use crate::support::script::{
    ACCEPTED, DENIED, NAN, UNSUPPORTED, ack, command_int, command_long, configure, ids, of, pitch_yaw_deg, pitchyaw,
    request_message, set_attitude, set_pitchyaw, take_control,
};
use crate::support::world::{GCS, MANAGER};

/// "When an unknown command is addressed exactly to S/191, ACK UNSUPPORTED is sent now with target = sender."
/// Protocol checklist 129: "When an unknown command has target_component 0 or target 0/0, no ACK is sent."
#[test]
fn items_128_and_129_an_unknown_command_is_answered_by_who_was_asked() {
    let (mut world, places) = with_gimbal();
    for number in [2000, 31_000, 520, 400] {
        let to_us = command_long(MANAGER, number, &[0.0; 7]);
        let answers = world.ask(places.ground, GCS, &to_us);
        assert_eq!(of::<COMMAND_ACK_DATA>(&answers), [ack(GCS, number, UNSUPPORTED)]);
        assert_eq!((answers.len(), answers[0].source()), (1, MANAGER));
        for target in [MavId::new(1, 0), MavId::new(0, 0), MavId::new(0, 191), MavId::new(9, 191)] {
            assert_eq!(world.ask(places.ground, GCS, &command_long(target, number, &[0.0; 7])), [], "{target}");
        }
    }
}

/// "When any command is answered, COMMAND_ACK has target_system/component of the sender, source S/191, and goes only to
/// links on which the sender was seen."
#[test]
fn item_130_an_answer_goes_to_who_asked() {
    let (mut world, places) = with_gimbal();
    let second = world.open(2);
    let other = MavId::new(255, 191);
    for (sender, place, elsewhere) in [(GCS, places.ground, second), (other, second, places.ground)] {
        for command in [
            request_message(MANAGER, 280),
            take_control(),
            pitchyaw(-10.0, 0.0, NAN, NAN, 44.0),
            command_long(MANAGER, 2000, &[]),
        ] {
            let answers = world.ask(place, sender, &command);
            let acks: Vec<COMMAND_ACK_DATA> = of(&answers);
            assert_eq!(acks.len(), 1);
            assert_eq!((acks[0].target_system, acks[0].target_component), (sender.system, sender.component));
            assert!(answers.iter().all(|arrival| arrival.source() == MANAGER));
            for place in [elsewhere, places.autopilot, places.gimbal] {
                assert!(world.take(place).iter().all(|arrival| arrival.id() != 77), "{sender}");
            }
        }
        // Whoever comes next finds the gimbal free.
        let release = configure([-3.0, -3.0], [-1.0, -1.0]);
        assert_eq!(world.result_of(place, sender, &release), Some(ACCEPTED));
    }
}

/// "When the same COMMAND_LONG arrives three times, three identical ACKs are sent."
#[test]
fn item_131_every_repeat_is_answered() {
    let (mut world, places) = with_gimbal();
    for command in [take_control(), pitchyaw(-10.0, 0.0, NAN, NAN, 44.0), pitchyaw(0.0, 0.0, NAN, NAN, 96.0)] {
        let answers: Vec<Vec<COMMAND_ACK_DATA>> =
            (0..3).map(|_| of(&world.ask(places.ground, GCS, &command))).collect();
        assert!(answers.iter().all(|acks| acks.len() == 1 && *acks == answers[0]), "{answers:?}");
    }
}

/// "When 1000 arrives as COMMAND_INT with x = 44 and z = 154, flags 44 and id 154 are used without scaling."
#[test]
fn item_136_a_command_int_carries_flags_and_id_as_they_are() {
    let (mut world, places) = with_gimbal();
    let command = |x, z| command_int(MANAGER, 1000, [-20.0, 10.0, NAN, NAN], x, 0, z);

    assert_eq!(world.result_of(places.ground, GCS, &command(44, 154.0)), Some(ACCEPTED));

    let setpoint: Setpoint = only_setpoint(&mut world, places);
    let (pitch, yaw) = pitch_yaw_deg(setpoint.q);
    assert_near(pitch, -20.0, 0.001);
    assert_near(yaw, 10.0, 0.001);
    assert_eq!(setpoint.flags, 44);
    assert_eq!(world.result_of(places.ground, GCS, &command(44, 153.0)), Some(DENIED));
    assert_eq!(world.result_of(places.ground, GCS, &command(96, 154.0)), Some(DENIED));
    assert_eq!(world.result_of(places.ground, GCS, &command(i32::MAX, 154.0)), Some(ACCEPTED), "no flags");
    assert_eq!(world.result_of(places.ground, GCS, &command(-1, 154.0)), Some(DENIED));
}

/// "When stopped by SIGTERM during a rate set-point, a zero-rate 284 is sent before exit, then one POWEROFF heartbeat."
#[test]
fn item_179_at_the_end_the_gimbal_is_stopped_and_goodbye_said() {
    let (mut world, places) = with_gimbal();
    world.send(places.ground, GCS, &set_pitchyaw(NAN, NAN, 0.3, 0.3, 44));
    run_looking(&mut world, places, SECOND, 0.0, 0.0);
    world.forget();

    world.input(Input::Shutdown);

    let heard = world.take(places.gimbal);
    let told: Vec<u32> = ids(&heard).into_iter().filter(|id| *id != 281).collect();
    assert_eq!(told, [284, 0]);
    let stopped: Setpoint = heard.iter().find(|arrival| arrival.id() == 284).expect("it was told").decode();
    assert_eq!((stopped.angular_velocity_y, stopped.angular_velocity_z), (0.0, 0.0));
    for place in [places.autopilot, places.ground] {
        let beats: Vec<HEARTBEAT_DATA> = of(&world.take(place));
        assert_eq!(beats.iter().map(|beat| beat.system_status).collect::<Vec<_>>(), [7]);
    }
    assert!(world.bridge.is_finished());
    world.run_for(SECOND / 2);
    let beats: Vec<HEARTBEAT_DATA> = world.take_messages(places.ground);
    assert_eq!(beats, [], "one goodbye");
}

/// "When a value is NaN internally, HTTP JSON has null in its place and is parseable by a strict parser." What the
/// window is given holds no number that is none.
#[test]
fn item_180_what_is_not_known_is_null() {
    let (mut world, places) = with_gimbal();
    let status = crate::support::script::device_status(Timestamp::ZERO, 44, 0.0, 0.0);
    let status = gimbald::wire::dialect::GIMBAL_DEVICE_ATTITUDE_STATUS_DATA {
        angular_velocity_x: NAN,
        angular_velocity_y: f32::INFINITY,
        delta_yaw: f32::INFINITY,
        ..status
    };
    world.send(places.gimbal, crate::support::world::GIMBAL, &MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(status));
    for demand in [
        set_attitude([NAN; 4], [NAN, NAN, 0.1], 44),
        set_pitchyaw(NAN, NAN, NAN, NAN, 44),
        set_pitchyaw(0.1, NAN, NAN, 0.1, 44),
        pitchyaw(NAN, NAN, NAN, NAN, 3.0),
    ] {
        world.send(places.ground, GCS, &demand);
        let written = serde_json::to_string(&world.snapshot()).expect("a snapshot can be written");
        let read: serde_json::Value = serde_json::from_str(&written).expect("and read");
        assert_eq!(read["gimbals"][0]["attitude"]["yaw_earth_deg"], serde_json::Value::Null);
        assert_eq!(read["vehicle"]["heading_deg"], serde_json::Value::Null);
        assert_eq!(read["gimbals"][0]["primary"], serde_json::Value::Null);
    }
    look(&mut world, places, -10.0, 0.0);
    assert_eq!(world.snapshot().gimbals[0].attitude.yaw_earth_deg, None);
}

/// A frame that is cut anywhere by the sender's rule on zeros is read the same: `confirmation` and targets read 0.
#[test]
fn item_131_a_shortened_command_is_a_command() {
    let (mut world, places) = with_gimbal();
    // To everybody: targets and confirmation are zero, and cut off.
    let command = MavMessage::COMMAND_LONG(COMMAND_LONG_DATA {
        param1: 280.0,
        param2: 0.0,
        param3: 0.0,
        param4: 0.0,
        param5: 0.0,
        param6: 0.0,
        param7: 0.0,
        command: 512,
        target_system: 0,
        target_component: 0,
        confirmation: 0,
    });
    world.forget();
    let sent = world.send(places.ground, GCS, &command);
    assert_eq!(sent[1], 30, "three bytes are cut off");
    assert_eq!(ids(&world.take(places.ground)), [77, 280]);
}
