//! How gimbals are found and looked after (protocol checklist 8.3), and what of 8.1 the core has to do with.

use std::time::Duration;

use gimbald::bridge::settings::{Role, Settings, Transport};
use gimbald::gimbals::settings::{Family, GimbalSettings};
use gimbald::timestamp::Timestamp;
use gimbald::wire::MavId;
use gimbald::wire::dialect::{
    COMMAND_LONG_DATA, GIMBAL_DEVICE_ATTITUDE_STATUS_DATA, GIMBAL_DEVICE_INFORMATION_DATA,
    GIMBAL_DEVICE_SET_ATTITUDE_DATA, GIMBAL_MANAGER_INFORMATION_DATA, GIMBAL_MANAGER_STATUS_DATA, HEARTBEAT_DATA,
    MavMessage,
};

use crate::support::script::{
    ACCEPTED, NAN, TEMPORARILY_REJECTED, ack, autopilot_state, command_long, device_information, device_status,
    gimbal_heartbeat, ground_heartbeat, of, pitchyaw, px4_heartbeat, set_interval, take_control, usual_capabilities,
};
use crate::support::wire::hex;
use crate::support::world::{AUTOPILOT, Arrival, GCS, GIMBAL, MANAGER, Place, Places, World, link, three_links};

const SECOND: Duration = Duration::from_secs(1);

/// "When a v1 HEARTBEAT (GV-2) arrives on any link, it is processed and forwarded byte-identically as v1."
#[test]
fn item_10_a_heartbeat_of_mavlink_1_counts_and_stays_as_it_is() {
    // The bytes of GV-2 as an autopilot: its source is 1/191, which would be us.
    let beat = crate::support::wire::frame_v1(0, 50, 0, &[0, 0, 0, 0, 2, 12, 0, 4, 3]);
    let mut beat = beat;
    beat[4] = 1;
    let sum = crate::support::wire::checksum(&beat[1..beat.len() - 2], 50).to_le_bytes();
    let end = beat.len() - 2;
    beat[end..].copy_from_slice(&sum);
    let (mut world, places) = World::empty(three_links());

    world.send_bytes(places.autopilot, &beat);

    assert!(world.take(places.ground).iter().any(|arrival| arrival.bytes == beat));
    assert_eq!(world.snapshot().vehicle.autopilot.as_deref(), Some("px4"));
}

/// "When a 285 carries flag bits 1024..32768, it is still processed (bits ignored) and forwarded unchanged."
#[test]
fn item_11_unknown_flags_do_not_cost_an_attitude() {
    let (mut world, places) = with_device();
    let status = device_status(world.now, 44 | 0xfc00, -20.0, 30.0);

    let sent = world.send(places.gimbal, GIMBAL, &MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(status));

    assert!(world.take(places.ground).iter().any(|arrival| arrival.bytes == sent));
    assert_near(world.snapshot().gimbals[0].attitude.pitch_deg, -20.0);
    world.run_for(Duration::from_millis(400));
    let told: Vec<GIMBAL_MANAGER_STATUS_DATA> = world.take_messages(places.ground);
    assert!(!told.is_empty() && told.iter().all(|told| told.flags == 44), "281 does not repeat them");
}

/// "When a COMMAND_ACK carries result 10 or 200, or a 286 carries landed_state 128, the message is not dropped by the
/// decoder."
#[test]
fn item_12_unknown_values_do_not_cost_a_message() {
    let (mut world, places) = with_device();
    world.send(places.ground, GCS, &ground_heartbeat());
    world.send(places.autopilot, AUTOPILOT, &px4_heartbeat());
    for result in [10, 200] {
        let answer = MavMessage::COMMAND_ACK(ack(GCS, 1000, result));
        let sent = world.send(places.autopilot, AUTOPILOT, &answer);
        assert!(world.take(places.ground).iter().any(|arrival| arrival.bytes == sent), "result {result}");
    }
    let state = autopilot_state(world.now, MavId::new(0, 0), 90.0);
    let state = gimbald::wire::dialect::AUTOPILOT_STATE_FOR_GIMBAL_DEVICE_DATA { landed_state: 128, ..state };
    let sent = world.send(places.autopilot, AUTOPILOT, &MavMessage::AUTOPILOT_STATE_FOR_GIMBAL_DEVICE(state));
    assert!(world.take(places.gimbal).iter().any(|arrival| arrival.bytes == sent));
    assert_near(world.snapshot().vehicle.heading_deg, 90.0);
}

/// "When a type-26 heartbeat from S/154 appears on the gimbal link, a COMMAND_LONG 512 with param1 = 283 is sent there
/// within 1 s."
/// Protocol checklist 27: "When the broadcast form is emitted it equals GV-12 except for sequence (and CRC)."
#[test]
fn items_25_and_27_a_gimbal_heartbeat_is_asked_who_it_is() {
    let (mut world, places) = World::empty(three_links());
    world.run_for(SECOND / 2);

    let answers = world.ask(places.gimbal, GIMBAL, &gimbal_heartbeat());

    let asked: Vec<&Arrival> = answers.iter().filter(|arrival| arrival.id() == COMMAND_LONG).collect();
    assert_eq!(asked.len(), 1, "in the same moment");
    let golden = hex("fd1e00000a01bf4c000000808d430000000000000000000000000000000000000000000000000002ed94");
    let without_sequence_and_sum = |bytes: &[u8]| [&bytes[..4], &bytes[5..bytes.len() - 2]].concat();
    assert_eq!(without_sequence_and_sum(&asked[0].bytes), without_sequence_and_sum(&golden));
    for elsewhere in [places.autopilot, places.ground] {
        let heard = world.take(elsewhere);
        assert!(heard.iter().all(|arrival| arrival.id() != COMMAND_LONG), "on that link only");
    }
}

/// "When no 283 follows, the request repeats at 1 Hz for 30 s, then every 5 s, forever."
#[test]
fn item_26_the_request_is_repeated_for_ever() {
    let (mut world, places) = World::empty(three_links());
    world.run_with(Duration::from_millis(119_500), &[(SECOND, places.gimbal, GIMBAL, gimbal_heartbeat())]);

    let requests = information_requests(&world.take(places.gimbal));

    let seconds: Vec<u64> = requests.iter().map(|(at, _)| at.as_micros() / 1_000_000).collect();
    let expected: Vec<u64> = (0..=30).chain((35..120).step_by(5)).collect();
    assert_eq!(seconds, expected);
    let (first, later) = requests.split_at(2);
    assert!(first.iter().all(|(_, request)| (request.target_system, request.target_component) == (0, 0)));
    assert!(later.iter().all(|(_, request)| (request.target_system, request.target_component) == (1, 154)));
}

/// Checklist 30, where 285 does not come either: it is heard and cannot be steered, and whoever looks is told why and what to
/// do.
#[test]
fn a_gimbal_that_says_nothing_of_itself_is_named() {
    let (mut world, places) = World::empty(three_links());
    let silent = "it is heard, and tells neither what it is (GIMBAL_DEVICE_INFORMATION) nor where it looks \
                  (GIMBAL_DEVICE_ATTITUDE_STATUS), so that it cannot be steered. Check that what is sent arrives there. If it \
                  does, this is no device of gimbal protocol v2: leave its family out of the configuration, and it is found out";
    let entry = GimbalSettings { family: Family::MavlinkV2, ..GimbalSettings::found("camera".to_owned()) };
    world.start(Settings { gimbals: vec![entry], ..three_links() });
    let beats = [(SECOND, places.gimbal, GIMBAL, gimbal_heartbeat())];
    world.run_with(20 * SECOND, &beats);
    assert_eq!(world.snapshot().gimbals[0].details.faults, [""; 0]);
    world.run_with(6 * SECOND, &beats);
    assert_eq!(world.snapshot().gimbals[0].details.faults, [silent]);
    assert_eq!(world.result_of(places.ground, GCS, &down()), Some(TEMPORARILY_REJECTED));
    assert_eq!(world.snapshot().gimbals[0].rejected["255/190"]["gimbal_unknown_yet"], 1);

    introduce(&mut world, places.gimbal, GIMBAL);
    assert_eq!(world.snapshot().gimbals[0].details.faults, [""; 0]);
    assert_eq!(world.result_of(places.ground, GCS, &down()), Some(ACCEPTED));
}

/// "When 283 arrives, exactly one unsolicited 280 for id 154 is broadcast on all links within 100 ms."
/// Protocol checklist 29: "When 283 arrives without any COMMAND_ACK, discovery still succeeds." (D14 keeps 280 from
/// links of gimbals.)
#[test]
fn items_28_and_29_a_gimbal_that_says_who_it_is_is_announced_once() {
    let (mut world, places) = World::empty(three_links());
    world.send(places.gimbal, GIMBAL, &gimbal_heartbeat());
    world.run_for(SECOND / 2);
    world.forget();

    let information = MavMessage::GIMBAL_DEVICE_INFORMATION(device_information(world.now, usual_capabilities()));
    world.send(places.gimbal, GIMBAL, &information);

    for place in [places.autopilot, places.ground] {
        let announced: Vec<GIMBAL_MANAGER_INFORMATION_DATA> = of(&world.take(place));
        assert_eq!(announced.len(), 1);
        assert_eq!(announced[0].gimbal_device_id, 154);
    }
    world.run_for(Duration::from_secs(2));
    // A device may send it again; that is no news.
    world.send(places.gimbal, GIMBAL, &information);
    for place in [places.autopilot, places.gimbal, places.ground] {
        assert_eq!(world.take_messages::<GIMBAL_MANAGER_INFORMATION_DATA>(place), []);
    }
    assert_eq!(world.snapshot().gimbals[0].model.as_deref(), Some("Scripted"));
}

/// "When 285 arrives for 5 s but never 283, the gimbal becomes usable with configured capabilities."
#[test]
fn item_30_a_gimbal_that_never_says_who_it_is_is_used_all_the_same() {
    let (mut world, places) = World::empty(three_links());
    let status = MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(device_status(Timestamp::ZERO, 44, 0.0, 0.0));
    let repeated = [(SECOND / 10, places.gimbal, GIMBAL, status)];
    world.run_with(Duration::from_millis(4_900), &repeated);
    assert_eq!(world.result_of(places.ground, GCS, &down()), Some(TEMPORARILY_REJECTED));
    world.forget();

    world.run_with(Duration::from_millis(200), &repeated);

    let announced: Vec<GIMBAL_MANAGER_INFORMATION_DATA> = world.take_messages(places.ground);
    assert_eq!(announced.iter().map(|message| message.gimbal_device_id).collect::<Vec<_>>(), [154]);
    assert_eq!(world.result_of(places.ground, GCS, &down()), Some(ACCEPTED));
    let setpoints: Vec<GIMBAL_DEVICE_SET_ATTITUDE_DATA> = world.take_messages(places.gimbal);
    assert_eq!(setpoints.len(), 1);
}

/// "When two devices (154, 171) answer, two managers exist, with separate 280/281 and separate control slots."
#[test]
fn item_31_two_gimbals_have_two_managers() {
    const SECOND_DEVICE: MavId = MavId::new(1, 171);
    const SECOND_MANAGER: MavId = MavId::new(1, 192);
    let (mut world, places) = with_device();
    introduce(&mut world, places.gimbal, SECOND_DEVICE);

    assert_eq!(world.result_of(places.ground, GCS, &take_control()), Some(ACCEPTED));
    world.run_for(SECOND / 2);
    world.forget();
    world.run_for(SECOND);

    let heard = world.take(places.ground);
    for (manager, device, primary) in [(MANAGER, 154, (255, 190)), (SECOND_MANAGER, 171, (0, 0))] {
        let own: Vec<Arrival> = heard.iter().filter(|arrival| arrival.source() == manager).cloned().collect();
        let told: Vec<GIMBAL_MANAGER_STATUS_DATA> = of(&own);
        assert_eq!(told.len(), 5);
        assert!(told.iter().all(|told| told.gimbal_device_id == device));
        assert!(told.iter().all(|told| (told.primary_control_sysid, told.primary_control_compid) == primary));
        let asked = command_long(manager, 512, &[280.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        let information: Vec<GIMBAL_MANAGER_INFORMATION_DATA> = of(&world.ask(places.ground, GCS, &asked));
        assert_eq!(information.iter().map(|message| message.gimbal_device_id).collect::<Vec<_>>(), [device]);
    }
}

/// Guide: "the numbers 1 to 6 can't be used as MAVLink component IDs for any components involved as gimbal managers or
/// gimbal devices"; and component 0 is nobody.
#[test]
fn item_25_a_component_below_7_is_no_gimbal() {
    let (mut world, places) = World::empty(three_links());
    for component in 0..=6 {
        world.send(places.gimbal, MavId::new(1, component), &gimbal_heartbeat());
        let information = device_information(world.now, usual_capabilities());
        world.send(places.gimbal, MavId::new(1, component), &MavMessage::GIMBAL_DEVICE_INFORMATION(information));
    }
    world.run_for(SECOND);

    assert_eq!(world.snapshot().gimbals, []);
    assert!(world.take(places.gimbal).iter().all(|arrival| arrival.id() == 0), "nothing but heartbeats");
}

/// "When 285 comes with ext gimbal_device_id = 1 from compid 191 of another system component, it is attributed to (that
/// component, 1), not to device 154."
/// Protocol checklist 33: "When 285 has ext gimbal_device_id = 7, it is ignored for management, but forwarded."
#[test]
fn items_32_and_33_an_attitude_of_another_gimbal_is_not_taken_for_ours() {
    let (mut world, places) = with_device();
    let status = device_status(world.now, 44, -10.0, 0.0);
    world.send(places.gimbal, GIMBAL, &MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(status));

    for (place, source, gimbal_device_id) in [
        (places.autopilot, AUTOPILOT, 1),
        (places.autopilot, MavId::new(1, 195), 1),
        (places.gimbal, GIMBAL, 7),
        (places.autopilot, MavId::new(1, 160), 7),
    ] {
        let other = device_status(world.now, 44, -80.0, 90.0);
        let other = GIMBAL_DEVICE_ATTITUDE_STATUS_DATA { gimbal_device_id, ..other };
        let sent = world.send(place, source, &MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(other));

        assert!(world.take(places.ground).iter().any(|arrival| arrival.bytes == sent), "forwarded");
        let snapshot = world.snapshot();
        assert_eq!(snapshot.gimbals.len(), 1, "{source} with id {gimbal_device_id} is no device of ours");
        assert_near(snapshot.gimbals[0].attitude.pitch_deg, -10.0);
    }
}

/// Protocol notes 1.7: "Device identity = gimbal_device_id == 0 ? source compid : gimbal_device_id. Values above 6 are invalid". The
/// sender's own component id names itself all the same; any other is named, and nobody is taken for a v1 gimbal for it.
#[test]
fn item_33_a_gimbal_that_names_itself_by_its_component_id_is_that_gimbal() {
    for family in [Family::Auto, Family::MavlinkV2] {
        for (gimbal_device_id, is_itself) in [(0, true), (154, true), (155, false), (255, false)] {
            let entry = GimbalSettings { family, ..GimbalSettings::found("camera".to_owned()) };
            let (mut world, places) = World::empty(Settings { gimbals: vec![entry], ..three_links() });
            let information = GIMBAL_DEVICE_INFORMATION_DATA {
                gimbal_device_id,
                ..device_information(Timestamp::ZERO, usual_capabilities())
            };
            let status = GIMBAL_DEVICE_ATTITUDE_STATUS_DATA {
                gimbal_device_id,
                ..device_status(Timestamp::ZERO, 44, -20.0, 0.0)
            };
            let says = [
                (SECOND, places.gimbal, GIMBAL, gimbal_heartbeat()),
                (SECOND, places.gimbal, GIMBAL, MavMessage::GIMBAL_DEVICE_INFORMATION(information)),
                (SECOND / 10, places.gimbal, GIMBAL, MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(status)),
            ];

            world.run_with(30 * SECOND, &says);

            let result = if is_itself { ACCEPTED } else { TEMPORARILY_REJECTED };
            assert_eq!(world.result_of(places.ground, GCS, &down()), Some(result), "{family:?} {gimbal_device_id}");
            let gimbal = &world.snapshot().gimbals[0];
            let pitch = gimbal.attitude.pitch_deg.map(f64::round);
            assert_eq!((gimbal.family.as_str(), pitch), ("mavlink_v2", is_itself.then_some(-20.0)));
            let wrong = format!(
                "it tells what it is and where it looks (GIMBAL_DEVICE_INFORMATION and GIMBAL_DEVICE_ATTITUDE_STATUS) of a gimbal \
                 with the gimbal_device_id {gimbal_device_id}, which no gimbal has, so that nothing of it counts. Have its firmware \
                 say 0 there, or its own component id"
            );
            assert_eq!(gimbal.details.faults, if is_itself { vec![] } else { vec![wrong] });
        }
    }
}

/// "When neither heartbeat nor 285 of the device arrives for 3 s, the device is lost: set-point streaming stops, status
/// CRITICAL, HTTP reports lost."
#[test]
fn item_34_a_silent_gimbal_is_lost_and_told_nothing_more() {
    let (mut world, places) = with_device();
    assert_eq!(world.result_of(places.ground, GCS, &down()), Some(ACCEPTED));
    world.run_for(Duration::from_micros(2_999_999));
    assert_eq!(world.snapshot().gimbals[0].state, "alive");
    assert!(!world.take_messages::<GIMBAL_DEVICE_SET_ATTITUDE_DATA>(places.gimbal).is_empty());

    world.run_for(Duration::from_micros(1));
    assert_eq!(world.snapshot().gimbals[0].state, "lost");
    world.forget();
    world.run_for(Duration::from_secs(2));

    assert_eq!(world.take_messages::<GIMBAL_DEVICE_SET_ATTITUDE_DATA>(places.gimbal), []);
    let beats: Vec<HEARTBEAT_DATA> = world.take_messages(places.ground);
    assert_eq!(beats.iter().map(|beat| beat.system_status).collect::<Vec<_>>(), [5, 5]);
    // It comes back, and is not moved by what was asked before (D9).
    world.send(places.gimbal, GIMBAL, &gimbal_heartbeat());
    world.run_for(SECOND);
    assert_eq!(world.snapshot().gimbals[0].state, "alive");
    assert_eq!(world.take_messages::<GIMBAL_DEVICE_SET_ATTITUDE_DATA>(places.gimbal), []);
}

/// "When the device's time_boot_ms jumps back by > 1 s, 283 is re-requested within 1 s."
#[test]
fn item_35_a_restarted_gimbal_is_asked_anew() {
    for (back_ms, asked) in [(0, 0), (999, 0), (1_000, 0), (1_001, 1), (20_000, 1)] {
        let (mut world, places) = with_device();
        let status = |millis| {
            let status = device_status(Timestamp::from_millis(millis), 44, 0.0, 0.0);
            MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(status)
        };
        world.send(places.gimbal, GIMBAL, &status(30_000));
        world.forget();

        world.send(places.gimbal, GIMBAL, &status(30_000 - back_ms));

        assert_eq!(information_requests(&world.take(places.gimbal)).len(), asked, "{back_ms} ms back");
    }
}

/// Protocol checklist 26 and 35 again: two devices under one id, each with a clock of its own, look like one that is
/// restarted with every message; it is still asked once a second.
#[test]
fn item_35_a_gimbal_that_seems_to_restart_all_the_time_is_asked_once_a_second() {
    let (mut world, places) = with_device();
    let status = |millis| {
        let status = device_status(Timestamp::from_millis(millis), 44, 0.0, 0.0);
        MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(status)
    };
    let every = Duration::from_millis(200);
    let both = [(every, places.gimbal, GIMBAL, status(90_000)), (every, places.gimbal, GIMBAL, status(30_000))];

    world.run_with(Duration::from_millis(9_500), &both);

    assert_eq!(information_requests(&world.take(places.gimbal)).len(), 10);
}

/// Protocol checklist 35, "time_boot_ms jumps back by > 1 s": by the clock of the same message. Not every device stamps 283 by
/// the one of its 285, and who is asked what it is goes on with what it was told.
#[test]
fn item_35_another_clock_in_283_is_no_restart() {
    type Clock = fn(u32) -> u32;
    let clocks: [Clock; 5] =
        [|millis| millis, |_| 0, |_| 7, |millis| millis + 1_790_000_000, |millis| millis.wrapping_mul(1_000)];
    for of_information in clocks {
        let (mut world, places) = World::empty(three_links());
        let tell = |world: &mut World, millis: u32, what: &[u32]| {
            let stamp = |millis: u32| Timestamp::from_millis(millis.into());
            for message in what {
                let message = match *message {
                    283 => MavMessage::GIMBAL_DEVICE_INFORMATION(device_information(
                        stamp(of_information(millis)),
                        usual_capabilities(),
                    )),
                    _ => MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(device_status(stamp(millis), 44, 0.0, 0.0)),
                };
                world.send(places.gimbal, GIMBAL, &message);
                world.run_for(SECOND / 10);
            }
        };
        let restarts =
            |world: &World| world.snapshot().events.iter().filter(|event| event.what == "gimbal_restarted").count();
        let mode = |world: &World| world.snapshot().gimbals[0].setpoint.as_ref().map(|told| told.mode.clone());
        tell(&mut world, 4_000_000, &[283, 285]);
        assert_eq!(world.result_of(places.ground, GCS, &down()), Some(ACCEPTED));

        tell(&mut world, 4_001_000, &[285, 283, 285, 283, 283, 285]);

        assert_eq!((mode(&world).as_deref(), restarts(&world)), (Some("angle"), 0));

        // One that is a restart may show in both, and counts once: what is asked after it stays.
        let is_one_clock = of_information(1_000) == 1_000;
        for order in [[285, 283], [283, 285]].into_iter().filter(|order| order[0] == 285 || is_one_clock) {
            let (before, at) = (restarts(&world), if order[0] == 285 { 2_000_000 } else { 1_000_000 });
            tell(&mut world, at, &order[..1]);
            assert_eq!(world.result_of(places.ground, GCS, &down()), Some(ACCEPTED));
            tell(&mut world, at + 1_000, &order[1..]);
            tell(&mut world, at + 2_000, &[285, 283]);
            assert_eq!((mode(&world).as_deref(), restarts(&world) <= before + 1), (Some("angle"), true), "{order:?}");
        }
        assert!(restarts(&world) >= 1);
    }
}

/// "duplicate ids, each with what to do about it": also of two on one line, which are told of once, and not as a restart with
/// every message.
#[test]
fn two_devices_of_one_id_on_one_line_are_named() {
    let (mut world, places) = with_device();
    let status = |millis| {
        let status = device_status(Timestamp::from_millis(millis), 44, 0.0, 0.0);
        MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(status)
    };
    let every = Duration::from_millis(200);
    let both = [(every, places.gimbal, GIMBAL, status(90_000)), (every, places.gimbal, GIMBAL, status(30_000))];
    world.run_with(Duration::from_secs(20), &both);

    let snapshot = world.snapshot();
    assert_eq!(
        snapshot.conflicts,
        [
            "two gimbals on one line seem to have the id 1/154: the time since its start jumps to and fro. Neither can be \
             steered. Take one of them off the line, and give it another component id."
        ]
    );
    let restarts = snapshot.events.iter().filter(|event| event.what == "gimbal_restarted").count();
    assert_eq!(restarts, 3, "until that was noticed");

    // A gimbal that starts again now and then is one.
    let (mut world, places) = with_device();
    for millis in [9_000, 2_000, 9_000, 1_000, 9_000, 500, 9_000, 100] {
        world.send(places.gimbal, GIMBAL, &status(millis));
        world.run_for(SECOND);
    }
    assert_eq!(world.snapshot().conflicts, Vec::<String>::new());
}

/// "When failure_flags has 256 (calibration), command 1000 is answered TEMPORARILY_REJECTED and CONFIGURE still
/// ACCEPTED."
#[test]
fn item_36_a_calibrating_gimbal_is_not_steered() {
    let (mut world, places) = with_device();
    report_failure(&mut world, places, 256);

    assert_eq!(world.result_of(places.ground, GCS, &take_control()), Some(ACCEPTED));
    assert_eq!(world.result_of(places.ground, GCS, &down()), Some(TEMPORARILY_REJECTED));
    assert_eq!(world.take_messages::<GIMBAL_DEVICE_SET_ATTITUDE_DATA>(places.gimbal), []);

    report_failure(&mut world, places, 0);
    assert_eq!(world.result_of(places.ground, GCS, &down()), Some(ACCEPTED));
}

/// "A gimbal never keeps turning after its operator is gone", nor when the operator says so: to stop is no way of steering. A rate
/// that runs when the gimbal begins to calibrate ends at the word of who asked for it, and so does a place or an angle;
/// none of it comes back when the calibration is over.
#[test]
fn item_36_a_calibrating_gimbal_is_stopped() {
    let stop = || {
        let MavMessage::COMMAND_LONG(command) = pitchyaw(NAN, NAN, 0.0, 0.0, 44.0) else { unreachable!() };
        MavMessage::COMMAND_LONG(COMMAND_LONG_DATA { param7: 0.0, ..command })
    };
    let told = |world: &mut World, places: Places| -> Vec<[f32; 2]> {
        let told: Vec<GIMBAL_DEVICE_SET_ATTITUDE_DATA> = world.take_messages(places.gimbal);
        assert!(told.iter().all(|told| told.q.iter().all(|q| q.is_nan())), "{told:?}");
        told.iter().map(|told| [told.angular_velocity_y, told.angular_velocity_z]).collect()
    };
    for demand in [pitchyaw(NAN, NAN, 0.0, 10.0, 44.0), down()] {
        let (mut world, places) = with_device();
        assert_eq!(world.result_of(places.ground, GCS, &demand), Some(ACCEPTED));
        world.run_for(SECOND / 4);
        report_failure(&mut world, places, 256);
        assert_eq!(world.result_of(places.ground, GCS, &demand), Some(TEMPORARILY_REJECTED));
        world.forget();

        assert_eq!(world.result_of(places.ground, GCS, &stop()), Some(ACCEPTED));
        assert_eq!(told(&mut world, places), [[0.0, 0.0]], "at once");
        for _ in 0..8 {
            world.run_for(SECOND / 4);
            report_failure(&mut world, places, 256);
        }
        let zeros = told(&mut world, places);
        assert!(zeros.len() >= 3 && zeros.iter().all(|rates| *rates == [0.0, 0.0]), "{zeros:?}");
        assert_eq!(world.snapshot().gimbals[0].setpoint, None);

        // It comes to rest by its rates, and is kept where it then looks.
        report_failure(&mut world, places, 0);
        world.run_for(SECOND / 4);
        let zeros = told(&mut world, places);
        assert!(!zeros.is_empty() && zeros.iter().all(|rates| *rates == [0.0, 0.0]), "{zeros:?}");
    }
}

/// "When failure_flags has any of 8/16/32/64/128, HEARTBEAT turns CRITICAL within 1.1 s."
#[test]
fn item_37_a_hard_failure_shows_in_the_heartbeat() {
    for bit in 0..10 {
        let (mut world, places) = with_device();
        report_failure(&mut world, places, 1 << bit);
        world.forget();

        world.run_for(SECOND);

        let beats: Vec<HEARTBEAT_DATA> = world.take_messages(places.ground);
        let expected = if [8, 16, 32, 64, 128].contains(&(1 << bit)) { 5 } else { 4 };
        assert_eq!(beats.iter().map(|beat| beat.system_status).collect::<Vec<_>>(), [expected], "bit {bit}");
    }
}

/// "When failure_flags has 512 while we are connected, 281 keeps being sent on the gimbal link at ≥ 1 Hz."
#[test]
fn item_38_a_gimbal_that_misses_its_manager_hears_it() {
    let (mut world, places) = with_device();
    report_failure(&mut world, places, 512);
    world.forget();

    let status = device_status(Timestamp::from_secs(60), 44, 0.0, 0.0);
    let status = GIMBAL_DEVICE_ATTITUDE_STATUS_DATA { failure_flags: 512, ..status };
    let status = MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(status);
    world.run_with(Duration::from_secs(10), &[(SECOND / 10, places.gimbal, GIMBAL, status)]);

    let heard: Vec<Arrival> =
        world.take(places.gimbal).into_iter().filter(|arrival| arrival.id() == STATUS_OF_MANAGER).collect();
    assert!(heard.len() >= 10);
    assert!(heard.windows(2).all(|pair| pair[1].at - pair[0].at <= SECOND));
}

/// "When 285 arrives more slowly than 5 Hz for 5 s, one 511(285, 100000) is sent to the device; refusal is tolerated."
#[test]
fn item_39_a_slow_gimbal_is_asked_to_speak_faster_once() {
    for (every_ms, asked) in [(100, 0), (200, 0), (250, 1), (1_000, 1)] {
        let (mut world, places) = with_device();
        let status = MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(device_status(world.now, 44, 0.0, 0.0));
        let every = Duration::from_millis(every_ms);
        world.run_with(Duration::from_millis(5_400), &[(every, places.gimbal, GIMBAL, status.clone())]);
        let refusal = ack(MANAGER, 511, 2);
        world.send(places.gimbal, GIMBAL, &MavMessage::COMMAND_ACK(refusal));
        world.run_with(Duration::from_secs(20), &[(every, places.gimbal, GIMBAL, status)]);

        let commands: Vec<COMMAND_LONG_DATA> = world.take_messages(places.gimbal);
        let expected = set_interval(GIMBAL, 285, 100_000.0);
        let sent: Vec<MavMessage> =
            commands.into_iter().filter(|command| command.command == 511).map(MavMessage::COMMAND_LONG).collect();
        assert_eq!(sent, vec![expected; asked], "every {every_ms} ms");
        assert_eq!(world.snapshot().gimbals[0].state, "alive");
    }
}

/// D2: "a v2 device: its own component id in 280/281; its 283/285 go by untouched."
#[test]
fn d2_what_a_v2_device_says_goes_by_untouched() {
    let (mut world, places) = with_device();
    let information = MavMessage::GIMBAL_DEVICE_INFORMATION(device_information(world.now, usual_capabilities()));
    let status = MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(device_status(world.now, 44, -5.0, 5.0));
    for message in [information, status] {
        world.forget();
        let sent = world.send(places.gimbal, GIMBAL, &message);
        for place in [places.autopilot, places.ground] {
            let heard: Vec<Vec<u8>> = world.take(place).into_iter().map(|arrival| arrival.bytes).collect();
            assert_eq!(heard.iter().filter(|bytes| **bytes == sent).count(), 1);
            assert!(heard.iter().all(|bytes| *bytes == sent || bytes[6] == 191), "and nothing in its stead");
        }
    }
}

/// D1: "Device 154 has manager 191, 171 has 192, 172 has 193, 173 has 194; other gimbals take the free ones".
/// A gimbal is found wherever it is: behind the autopilot, on another UDP link, with an entry or without.
#[test]
#[rustfmt::skip]
fn d1_a_gimbal_is_found_on_any_link_with_an_entry_and_without() {
    for (component, manager) in [(154, 191), (171, 192), (172, 193), (173, 194)] {
        for entry in [None, Some(None), Some(Some(component))] {
            for place_at in 0..4 {
                let mut settings = with_peer_link();
                settings.gimbals.extend(entry.map(|component_id| GimbalSettings {
                    family: Family::Auto,
                    component_id,
                    ..GimbalSettings::found("camera".to_owned())
                }));
                let (mut world, places) = World::new(settings);
                // An entry that names no device takes the first one found, and has the first manager.
                let manager = if entry == Some(None) { 191 } else { manager };

                introduce(&mut world, places[place_at], MavId::new(1, component));

                let snapshot = world.snapshot();
                let found: Vec<_> = snapshot
                    .gimbals
                    .iter()
                    .map(|gimbal| (gimbal.device.clone(), gimbal.manager_component_id, gimbal.state.clone()))
                    .collect();
                let expected = (Some(format!("1/{component}")), manager, "alive".to_owned());
                assert_eq!(found, [expected], "device {component} on link {place_at}, entry {entry:?}");
                let elsewhere = places[(place_at + 2) % 4];
                let announced = world.take(elsewhere);
                let announced: Vec<_> = announced
                    .iter()
                    .filter(|arrival| arrival.id() == INFORMATION_OF_MANAGER)
                    .map(|arrival| arrival.source().component)
                    .collect();
                let gimbal_link = (place_at + 2) % 4 == 1;
                assert_eq!(announced, if gimbal_link { vec![] } else { vec![manager] });
            }
        }
    }
}

/// A gimbal behind the autopilot (chain, autopilot-centric) is steered through it.
#[test]
fn d1_a_gimbal_behind_the_autopilot_is_steered_there() {
    let (mut world, places) = World::empty(three_links());
    world.send(places.autopilot, AUTOPILOT, &px4_heartbeat());
    introduce(&mut world, places.autopilot, GIMBAL);

    assert_eq!(world.result_of(places.ground, GCS, &down()), Some(ACCEPTED));

    let setpoints: Vec<GIMBAL_DEVICE_SET_ATTITUDE_DATA> = world.take_messages(places.autopilot);
    assert_eq!(setpoints.len(), 1);
    assert_eq!((setpoints[0].target_system, setpoints[0].target_component), (1, 154));
    assert_eq!(world.take_messages::<GIMBAL_DEVICE_SET_ATTITUDE_DATA>(places.gimbal), []);
}

/// An entry that names its link is for the gimbal there; one elsewhere is found besides.
#[test]
fn d1_an_entry_with_a_link_is_kept_for_that_link() {
    let mut settings = with_peer_link();
    settings.gimbals.push(GimbalSettings { link: Some(3), ..GimbalSettings::found("camera".to_owned()) });
    let (mut world, places) = World::new(settings);

    introduce(&mut world, places[1], MavId::new(1, 171));
    introduce(&mut world, places[3], GIMBAL);

    let snapshot = world.snapshot();
    let found: Vec<_> = snapshot
        .gimbals
        .iter()
        .map(|gimbal| (gimbal.name.as_str(), gimbal.device.as_deref(), gimbal.manager_component_id))
        .collect();
    assert_eq!(found, [("camera", Some("1/154"), 191), ("gimbal-171", Some("1/171"), 192)]);
}

/// "If the gimbal shows up with a foreign system id it can still be driven …: warn."
#[test]
fn item_25_a_gimbal_of_another_system_is_driven_and_reported() {
    const FOREIGN: MavId = MavId::new(42, 154);
    let (mut world, places) = World::empty(three_links());
    introduce(&mut world, places.gimbal, FOREIGN);

    assert_eq!(world.result_of(places.ground, GCS, &down()), Some(ACCEPTED));

    let setpoints: Vec<GIMBAL_DEVICE_SET_ATTITUDE_DATA> = world.take_messages(places.gimbal);
    assert_eq!((setpoints[0].target_system, setpoints[0].target_component), (42, 154));
    let conflicts = world.snapshot().conflicts;
    assert!(conflicts.len() == 1 && conflicts[0].contains("42/154"), "{conflicts:?}");
    // Elsewhere than on a link of gimbals it is another vehicle's.
    let (mut world, places) = World::empty(three_links());
    introduce(&mut world, places.ground, FOREIGN);
    assert_eq!(world.snapshot().gimbals, []);
}

const COMMAND_LONG: u32 = 76;
const INFORMATION_OF_MANAGER: u32 = 280;
const STATUS_OF_MANAGER: u32 = 281;

fn with_peer_link() -> Settings {
    let mut settings = three_links();
    settings.links.push(link("payload", Role::Peer, Transport::Datagrams));
    settings
}

/// A world in which a scripted device was found on the gimbal link.
fn with_device() -> (World, Places) {
    let (mut world, places) = World::empty(three_links());
    world.run_for(SECOND / 2);
    introduce(&mut world, places.gimbal, GIMBAL);
    world.forget();
    (world, places)
}

/// A heartbeat and 283.
fn introduce(world: &mut World, place: Place, device: MavId) {
    world.send(place, device, &gimbal_heartbeat());
    let information = device_information(world.now, usual_capabilities());
    world.send(place, device, &MavMessage::GIMBAL_DEVICE_INFORMATION(information));
}

fn report_failure(world: &mut World, places: Places, failure_flags: u32) {
    let status = device_status(world.now, 44, 0.0, 0.0);
    let status = GIMBAL_DEVICE_ATTITUDE_STATUS_DATA { failure_flags, ..status };
    world.send(places.gimbal, GIMBAL, &MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(status));
}

fn down() -> MavMessage {
    let MavMessage::COMMAND_LONG(command) = pitchyaw(-45.0, 0.0, NAN, NAN, 44.0) else { unreachable!() };
    MavMessage::COMMAND_LONG(COMMAND_LONG_DATA { param7: 0.0, ..command })
}

/// The requests of 283 with their times.
fn information_requests(arrivals: &[Arrival]) -> Vec<(Timestamp, COMMAND_LONG_DATA)> {
    arrivals
        .iter()
        .filter(|arrival| arrival.id() == COMMAND_LONG && arrival.source() == MANAGER)
        .map(|arrival| (arrival.at, arrival.decode::<COMMAND_LONG_DATA>()))
        .filter(|(_, command)| (command.command, command.param1) == (512, 283.0))
        .collect()
}

fn assert_near(value: Option<f64>, wanted: f64) {
    let value = value.expect("it is known");
    assert!((value - wanted).abs() < 0.01, "{value} instead of {wanted}");
}
