//! Commands in general (protocol checklist 8.9), and what holds at the end and at the window (8.14).

use gimbald::bridge::Input;
use gimbald::timestamp::Timestamp;
use gimbald::wire::MavId;
use gimbald::wire::dialect::{COMMAND_ACK_DATA, COMMAND_CANCEL_DATA, COMMAND_LONG_DATA, HEARTBEAT_DATA, MavMessage};

use super::frames::turn_vehicle;
use super::{SECOND, Setpoint, assert_near, look, only_setpoint, run_looking, setpoints, with_gimbal};
use crate::support::script::{
    ACCEPTED, DENIED, NAN, TEMPORARILY_REJECTED, UNSUPPORTED, ack, command_int, command_long, configure,
    device_information, gimbal_heartbeat, ids, of, pitch_yaw_deg, pitchyaw, px4_heartbeat, request_message,
    set_attitude, set_pitchyaw, take_control, to, usual_capabilities,
};
use crate::support::world::{GCS, MANAGER, World, three_links};

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

/// Commands about gimbals and cameras that we do not carry out are refused by name to who addressed exactly us, in either
/// form, and by silence to who asked everybody.
/// Protocol checklist 138: "When 246 arrives with p4 = 0, the daemon does not reboot."
/// Client checklist E120: "198: supported or UNSUPPORTED; never silence when addressed to M."
#[test]
#[rustfmt::skip]
fn items_128_and_138_what_we_do_not_do_is_refused_by_name() {
    let (mut world, places) = with_gimbal();
    turn_vehicle(&mut world, places, 0.0);
    let named = [
        (196,    UNSUPPORTED, "do_set_roi_wpnext_offset_unsupported"),
        (198,    UNSUPPORTED, "do_set_roi_sysid_unsupported"),
        (246,    DENIED,      "preflight_reboot_shutdown_denied"),
        (1002,   UNSUPPORTED, "do_gimbal_manager_track_rectangle_unsupported"),
        (32_100, UNSUPPORTED, "request_operator_control_unsupported"),
        (42_501, UNSUPPORTED, "gimbal_reset_unsupported"),
    ];
    for (number, result, reason) in named {
        for params in [[0.0; 7], [1.0; 7], [NAN; 7], [3.0, 0.0, 0.0, 0.0, 47.4, 8.5, 400.0]] {
            let by_long = command_long(MANAGER, number, &params);
            let by_int = command_int(MANAGER, number, [params[0]; 4], 474_000_000, 85_000_000, 400.0);
            for command in [by_long, by_int] {
                assert_eq!(world.result_of(places.ground, GCS, &command), Some(result), "{command:?}");
                for target in [MavId::new(1, 0), MavId::new(0, 0)] {
                    let to_everybody = world.ask(places.ground, GCS, &to(target, command.clone()));
                    assert_eq!(to_everybody, [], "{target} {number}");
                }
            }
        }
        let rejected = world.snapshot().gimbals[0].rejected["255/190"].clone();
        assert_eq!(rejected[reason], 8, "{rejected:?}");
    }
    assert_eq!(setpoints(&mut world, places), []);
    assert_eq!(world.snapshot().gimbals[0].rejected["255/190"].len(), named.len());
}

/// "When COMMAND_CANCEL arrives and nothing runs, it is ignored."
#[test]
fn item_135_there_is_nothing_to_cancel() {
    let (mut world, places) = with_gimbal();
    for (target_system, target_component) in [(1, 191), (1, 0), (0, 0)] {
        for command in [195, 512, 1000] {
            let cancel = COMMAND_CANCEL_DATA { command, target_system, target_component };
            assert_eq!(world.ask(places.ground, GCS, &MavMessage::COMMAND_CANCEL(cancel)), []);
        }
    }
    assert_eq!(setpoints(&mut world, places), []);
}

/// D5: what another vehicle asks of everybody is not our business; what it asks of us alone is refused.
/// A frame under our own id is nobody's request.
#[test]
fn others_who_are_no_clients_get_nothing_done() {
    let (mut world, places) = with_gimbal();
    let stranger = MavId::new(2, 1);
    world.send(places.ground, stranger, &px4_heartbeat());
    for command in [pitchyaw(-10.0, 0.0, NAN, NAN, 44.0), take_control(), command_long(MANAGER, 197, &[])] {
        assert_eq!(world.result_of(places.ground, stranger, &command), Some(DENIED));
        for target in [MavId::new(0, 0), MavId::new(1, 0)] {
            let unnamed = match to(target, command.clone()) {
                MavMessage::COMMAND_LONG(command) => {
                    MavMessage::COMMAND_LONG(COMMAND_LONG_DATA { param7: 0.0, ..command })
                }
                other => other,
            };
            assert_eq!(world.ask(places.ground, stranger, &unnamed), [], "{target} {command:?}");
        }
        world.forget();
        world.send(places.ground, MANAGER, &command);
        assert!(world.take(places.ground).iter().all(|arrival| arrival.id() != 77));
    }
    assert_eq!(setpoints(&mut world, places), []);
    assert_eq!(world.snapshot().gimbals[0].primary, None);
}

/// Parameter 7 of 512: "0: Flight-stack default, 1: address of requestor, 2: broadcast." First the answer to who asked.
#[test]
fn a_message_is_sent_to_whom_it_was_asked_for() {
    let (mut world, places) = with_gimbal();
    let other = world.open(2);
    for (message_id, expected) in [(280.0, 280), (281.0, 281), (396.0, 396), (244.0, 244), (0.0, 0)] {
        for (response_target, to_everybody) in [(0.0, false), (1.0, false), (2.0, true), (NAN, false), (7.0, false)] {
            let params = [message_id, 281.0, 0.0, 0.0, 0.0, 0.0, response_target];
            let answers = world.ask(places.ground, GCS, &command_long(MANAGER, 512, &params));
            assert_eq!(ids(&answers), [77, expected], "{message_id} to {response_target}");
            for elsewhere in [other, places.autopilot] {
                let heard: Vec<u32> = ids(&world.take(elsewhere)).into_iter().filter(|id| *id != 76).collect();
                assert_eq!(heard, if to_everybody { vec![expected] } else { vec![] }, "{message_id} {response_target}");
            }
        }
    }
}

/// What 512 and 511 are answered by us, and by us among everybody. 283 and 285 are the device's, which is a component of its
/// own; D23: "An unknown message id in a directed REQUEST_MESSAGE is DENIED".
#[test]
#[rustfmt::skip]
fn requests_for_messages_have_their_answers() {
    let (mut world, places) = with_gimbal();
    let nobody = MavId::new(0, 0);
    for (number, message_id, interval_us,     directed,       everybody) in [
        (512,    283,        0.0,             Some(DENIED),   None),
        (512,    285,        0.0,             Some(DENIED),   None),
        (512,    148,        0.0,             Some(DENIED),   None),
        (511,    281,        0.0,             Some(ACCEPTED), Some(ACCEPTED)),
        (511,    281,        5_000_000.0,     Some(ACCEPTED), Some(ACCEPTED)),
        (511,    281,        -1.0,            Some(ACCEPTED), Some(ACCEPTED)),
        (511,    281,        1e30,            Some(ACCEPTED), Some(ACCEPTED)),
        (511,    281,        NAN,             Some(ACCEPTED), Some(ACCEPTED)),
        (511,    281,        -2.0,            Some(DENIED),   Some(DENIED)),
        (511,    281,        -0.5,            Some(DENIED),   Some(DENIED)),
        (511,    281,        f32::INFINITY,   Some(DENIED),   Some(DENIED)),
        (511,    281,        f32::NEG_INFINITY, Some(DENIED), Some(DENIED)),
        (511,    283,        0.0,             Some(DENIED),   None),
        (511,    285,        100_000.0,       Some(DENIED),   None),
        (511,    30,         100_000.0,       Some(DENIED),   None),
        (511,    0,          0.0,             Some(DENIED),   None),
    ] {
        let command = command_long(MANAGER, number, &[message_id as f32, interval_us, 0.0, 0.0, 0.0, 0.0, 0.0]);
        assert_eq!(world.result_of(places.ground, GCS, &command), directed, "{number} {message_id} {interval_us}");
        let result = world.result_of(places.ground, GCS, &to(nobody, command));
        assert_eq!(result, everybody, "{number} {message_id} {interval_us}");
        run_looking(&mut world, places, SECOND / 10, 0.0, 0.0);
    }
    let rejected = &world.snapshot().gimbals[0].rejected["255/190"];
    assert_eq!((rejected["message_of_the_device"], rejected["heartbeat_is_fixed"]), (4, 1));
}

/// Client checklist E86: "1000 addressed to component 0 with p7 = 0: executed by every gimbal, one ACK per manager component."
/// To component 0 with the id of one: that one's manager answers, and nobody else.
#[test]
fn client_item_e86_each_manager_answers_for_its_own_gimbal() {
    let (mut world, places) = with_gimbal();
    let second = MavId::new(1, 171);
    world.send(places.gimbal, second, &gimbal_heartbeat());
    let information = device_information(world.now, usual_capabilities());
    world.send(places.gimbal, second, &MavMessage::GIMBAL_DEVICE_INFORMATION(information));
    for (target, id, answering) in [
        (0, 0.0, vec![191, 192]),
        (0, NAN, vec![191, 192]),
        (0, 154.0, vec![191]),
        (0, 171.0, vec![192]),
        (0, 99.0, vec![]),
        (191, 0.0, vec![191]),
        (192, 171.0, vec![192]),
    ] {
        for target_system in [0, 1] {
            let target = MavId::new(target_system, target);
            if target.component != 0 && target_system == 0 {
                continue;
            }
            for number in [1000, 1001] {
                let mut params = [-10.0, 0.0, NAN, NAN, 44.0, NAN, id];
                if number == 1001 {
                    params = [-1.0, -1.0, -1.0, -1.0, NAN, NAN, id];
                }
                let answers = world.ask(places.ground, GCS, &command_long(target, number, &params));
                let acks = answers.iter().filter(|answer| answer.id() == 77);
                let from: Vec<u8> = acks.map(|answer| answer.source().component).collect();
                assert_eq!(from, answering, "{number} to {target} for {id}");
                let told = world.take(places.gimbal).into_iter().filter(|arrival| arrival.id() == 284);
                let told: Vec<u8> = told.map(|arrival| arrival.source().component).collect();
                assert_eq!(told, if number == 1000 { answering.clone() } else { vec![] }, "{target} for {id}");
            }
        }
    }
}

/// Who has no gimbal yet says so to who asks it, and to everybody only while nobody here has one: a client would take its
/// refusal for the answer.
#[test]
fn a_manager_without_a_gimbal_is_silent_among_others() {
    let second = MavId::new(1, 171);
    let (mut world, places) = World::empty(three_links());
    let requests = [
        request_message(MavId::new(0, 0), 280),
        command_long(MavId::new(1, 0), 1000, &[-10.0, 0.0, NAN, NAN, 44.0, NAN, 0.0]),
        command_long(MavId::new(1, 0), 197, &[]),
    ];
    for request in &requests {
        let answers = world.ask(places.ground, GCS, request);
        let acks = answers.iter().filter(|answer| answer.id() == 77);
        let acks: Vec<(u8, u8)> =
            acks.map(|ack| (ack.source().component, ack.decode::<COMMAND_ACK_DATA>().result)).collect();
        assert_eq!(acks, [(191, TEMPORARILY_REJECTED)], "{request:?}");
    }
    world.send(places.gimbal, second, &gimbal_heartbeat());
    let information = device_information(world.now, usual_capabilities());
    world.send(places.gimbal, second, &MavMessage::GIMBAL_DEVICE_INFORMATION(information));
    for request in requests {
        let answers = world.ask(places.ground, GCS, &request);
        assert!(answers.iter().all(|answer| answer.source().component == 192), "{request:?}");
        assert_eq!(of::<COMMAND_ACK_DATA>(&answers).len(), 1);
        let to_the_other = world.result_of(places.ground, GCS, &to(MANAGER, request));
        assert_eq!(to_the_other, Some(TEMPORARILY_REJECTED), "who is asked answers");
    }
}

/// "command TEMPORARILY_REJECTED" while there is no device, also for an id: the gimbal may be that one when it comes.
#[test]
fn without_a_gimbal_commands_are_to_come_again() {
    let (mut world, places) = World::empty(three_links());
    for command in [
        pitchyaw(-10.0, 0.0, NAN, NAN, 44.0),
        command_long(MANAGER, 1000, &[-10.0, 0.0, NAN, NAN, 44.0, NAN, 0.0]),
        command_long(MANAGER, 197, &[]),
        command_long(MANAGER, 205, &[-10.0, 0.0, 0.0, NAN, NAN, NAN, 2.0]),
    ] {
        assert_eq!(world.result_of(places.ground, GCS, &command), Some(TEMPORARILY_REJECTED), "{command:?}");
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

/// "When stopped by SIGTERM during a rate set-point, a zero-rate 284 is sent before exit, then one POWEROFF heartbeat." The
/// zero is sent again and again meanwhile, because each may be lost; where nothing turns there is nothing to wait for.
#[test]
fn item_179_at_the_end_the_gimbal_is_stopped_and_goodbye_said() {
    let (mut world, places) = with_gimbal();
    world.send(places.ground, GCS, &set_pitchyaw(NAN, NAN, 0.3, 0.3, 44));
    run_looking(&mut world, places, SECOND, 0.0, 0.0);
    world.forget();

    let ended = world.now;
    world.input(Input::Shutdown);
    assert!(!world.bridge.is_finished());
    world.run_for(SECOND / 2);

    let heard = world.take(places.gimbal);
    let told: Vec<u32> = ids(&heard).into_iter().filter(|id| *id != 281).collect();
    assert_eq!(told, [284, 284, 284, 284, 284, 284, 0]);
    for (zero, after_ms) in heard.iter().filter(|arrival| arrival.id() == 284).zip([0, 80, 160, 240, 320, 400]) {
        let stopped: Setpoint = zero.decode();
        assert_eq!((stopped.angular_velocity_y, stopped.angular_velocity_z), (0.0, 0.0));
        assert_eq!((zero.at - ended).as_millis(), after_ms);
    }
    assert_eq!(world.stored_turning, ["gimbal-154\t1/154"], "whether it has heard one is not known");
    for place in [places.autopilot, places.ground] {
        let beats: Vec<HEARTBEAT_DATA> = of(&world.take(place));
        assert_eq!(beats.iter().map(|beat| beat.system_status).collect::<Vec<_>>(), [7]);
    }
    assert!(world.bridge.is_finished());
    // "Then one POWEROFF heartbeat", however often it is told to end.
    world.input(Input::Shutdown);
    world.run_for(SECOND / 2);
    let beats: Vec<HEARTBEAT_DATA> = world.take_messages(places.ground);
    assert_eq!(beats, [], "one goodbye");

    let (mut world, places) = with_gimbal();
    world.input(Input::Shutdown);
    assert!(world.bridge.is_finished());
    let beats: Vec<HEARTBEAT_DATA> = world.take_messages(places.ground);
    assert_eq!(beats.last().map(|beat| beat.system_status), Some(7));
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
/// Client checklist E96: "Truncated trailing zeros (COMMAND_LONG of 32 bytes, COMMAND_INT of 33) decode well."
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

    for (command, length, yaw) in [
        // `confirmation`.
        (pitchyaw(-10.0, 20.0, NAN, NAN, 44.0), 32, 20.0),
        // `autocontinue` and `current`.
        (command_int(MANAGER, 1000, [-10.0, 40.0, NAN, NAN], 44, 0, 154.0), 33, 40.0),
    ] {
        world.forget();
        let sent = world.send(places.ground, GCS, &command);
        assert_eq!(sent[1], length);
        assert_eq!(of::<COMMAND_ACK_DATA>(&world.take(places.ground)), [ack(GCS, 1000, ACCEPTED)]);
        assert_near(pitch_yaw_deg(only_setpoint(&mut world, places).q).1, yaw, 0.01);
    }
}
