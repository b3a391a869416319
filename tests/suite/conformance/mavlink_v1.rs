//! A v1 gimbal behind the core: what it is told for what v2 clients ask, what they see of it, what it asks of the vehicle
//! (gimbal notes 2.4 and 2.5).

mod obedience;
mod streams;

use std::time::Duration;

use gimbald::actions::Action;
use gimbald::bridge::settings::Settings;
use gimbald::gimbals::mavlink_v1::config::V1Settings;
use gimbald::gimbals::operation::OperationError;
use gimbald::gimbals::settings::{Family, GimbalSettings};
use gimbald::gimbals::signs::Signs;
use gimbald::manager::asked::NotDone;
use gimbald::wire::MavId;
use gimbald::wire::dialect::{
    COMMAND_LONG_DATA, CharArray, GIMBAL_DEVICE_ATTITUDE_STATUS_DATA, GIMBAL_DEVICE_INFORMATION_DATA,
    GIMBAL_DEVICE_SET_ATTITUDE_DATA, GIMBAL_MANAGER_SET_PITCHYAW_DATA, HEARTBEAT_DATA, MOUNT_ORIENTATION_DATA,
    MavMessage, PARAM_REQUEST_LIST_DATA, PARAM_REQUEST_READ_DATA, PARAM_SET_DATA, PARAM_VALUE_DATA,
};

use crate::support::script::{
    ACCEPTED, DENIED, NAN, TEMPORARILY_REJECTED, UNSUPPORTED, ack, autopilot_state, command_long, device_information,
    device_status, gimbal_heartbeat, ground_heartbeat, of, pitch_yaw_deg, px4_heartbeat, quaternion, request_message,
    set_pitchyaw, usual_capabilities,
};
use crate::support::world::{AUTOPILOT, GCS, GIMBAL, MANAGER, Places, World, heartbeat, three_links};

const SECOND: Duration = Duration::from_secs(1);

/// A world with a scripted v1 gimbal that looks ahead, and a ground station that was heard.
fn with_gimbal(gimbal: GimbalSettings) -> (World, Places) {
    let (mut world, places) = World::empty(Settings { gimbals: vec![gimbal], ..three_links() });
    world.run_for(SECOND / 2);
    world.send(places.ground, GCS, &ground_heartbeat());
    world.send(places.gimbal, GIMBAL, &heartbeat(26, 0));
    report(&mut world, places, 0.0, 0.0);
    world.run_for(SECOND / 10);
    world.forget();
    (world, places)
}

fn v1_gimbal() -> GimbalSettings {
    GimbalSettings { family: Family::MavlinkV1, ..GimbalSettings::found("camera".to_owned()) }
}

/// The gimbal says where it looks, yaw from the nose.
fn report(world: &mut World, places: Places, pitch: f32, yaw: f32) {
    let time_boot_ms = world.now.boot_ms();
    let orientation = MOUNT_ORIENTATION_DATA { time_boot_ms, roll: 0.0, pitch, yaw, yaw_absolute: NAN };
    world.send(places.gimbal, GIMBAL, &MavMessage::MOUNT_ORIENTATION(orientation));
}

/// The autopilot says where the vehicle's nose points.
fn turn_vehicle(world: &mut World, places: Places, heading_deg: f64) {
    world.send(places.autopilot, AUTOPILOT, &px4_heartbeat());
    let state = autopilot_state(world.now, MavId::new(0, 0), heading_deg);
    world.send(places.autopilot, AUTOPILOT, &MavMessage::AUTOPILOT_STATE_FOR_GIMBAL_DEVICE(state));
}

/// Pitch, roll, yaw and mode of every `DO_MOUNT_CONTROL` that reached the gimbal; it must be told nothing else about where
/// to look, and nobody else be told it.
fn told(world: &mut World, places: Places) -> Vec<[f32; 4]> {
    for elsewhere in [places.autopilot, places.ground] {
        let heard: Vec<COMMAND_LONG_DATA> = world.take_messages(elsewhere);
        assert!(heard.iter().all(|command| ![204, 205].contains(&command.command)), "{heard:?}");
    }
    let heard = world.take(places.gimbal);
    assert!(heard.iter().all(|arrival| ![284, 157, 156].contains(&arrival.id())));
    let commands: Vec<COMMAND_LONG_DATA> = of(&heard);
    commands
        .iter()
        .map(|command| {
            assert_eq!((command.command, command.target_system, command.target_component), (205, 1, 154));
            assert_eq!([command.param4, command.param5, command.param6], [0.0; 3]);
            [command.param1, command.param2, command.param3, command.param7]
        })
        .collect()
}

fn only(told: Vec<[f32; 4]>) -> [f32; 4] {
    assert_eq!(told.len(), 1, "{told:?}");
    told[0]
}

fn assert_near(told: [f32; 4], wanted: [f32; 4]) {
    assert!(told.iter().zip(wanted).all(|(told, wanted)| (told - wanted).abs() < 2e-3), "{told:?} not {wanted:?}");
}

/// Looks by command 1000 for the gimbal with id 1.
fn look(world: &mut World, places: Places, [pitch, yaw]: [f32; 2], flags: f32) {
    let command = command_long(MANAGER, 1000, &[pitch, yaw, NAN, NAN, flags, 0.0, 1.0]);
    assert_eq!(world.result_of(places.ground, GCS, &command), Some(ACCEPTED));
}

/// Gimbal statement 34: "v2 angle pitch −45 yaw +30 vehicle → generic v1 p1=−45, p3=30; STorM32 mount mode → p1=45, p3=−30."
/// Protocol checklist 176: "When a STorM32 device is configured `v1_sign = reversed`, DO_MOUNT_CONTROL output has negated pitch
/// and yaw."
#[test]
fn item_176_angles_reach_a_v1_gimbal_in_its_signs() {
    for (sign, expected) in [(Signs::NORMAL, [-45.0, 0.0, 30.0, 2.0]), (Signs::REVERSED, [45.0, 0.0, -30.0, 2.0])] {
        let v1 = V1Settings { sign, ..V1Settings::default() };
        let (mut world, places) = with_gimbal(GimbalSettings { v1, ..v1_gimbal() });
        look(&mut world, places, [-45.0, 30.0], 44.0);
        assert_near(only(told(&mut world, places)), expected);
    }
}

/// "What it is told meanwhile it would do when it is ready, long after it was asked for. So it is not told: whoever asks is
/// refused, and may ask again": of each state in which it is not ready, and of what was asked before that.
#[test]
fn nothing_that_is_asked_of_one_that_is_not_ready_is_done_later() {
    const ACTIVE: u8 = 4;
    let beat = |world: &mut World, places: Places, system_status: u8| {
        let MavMessage::HEARTBEAT(usual) = heartbeat(26, 0) else { unreachable!() };
        world.send(places.gimbal, GIMBAL, &MavMessage::HEARTBEAT(HEARTBEAT_DATA { system_status, ..usual }));
        report(world, places, 0.0, 0.0);
        world.run_for(SECOND);
    };
    for state in [2, 3, 7] {
        for rate in [NAN, 20.0] {
            let what = format!("state {state}, rate {rate}");
            let (mut world, places) = with_gimbal(v1_gimbal());
            look(&mut world, places, [-10.0, 20.0], 44.0);
            world.forget();
            beat(&mut world, places, state);
            let angle = if rate.is_nan() { 60.0 } else { NAN };
            let ask = command_long(MANAGER, 1000, &[NAN, angle, NAN, rate, 44.0, 0.0, 1.0]);
            assert_eq!(world.result_of(places.ground, GCS, &ask), Some(TEMPORARILY_REJECTED), "{what}");
            for state in [state, state, ACTIVE, ACTIVE, ACTIVE] {
                beat(&mut world, places, state);
            }
            assert_eq!(told(&mut world, places), [[0.0; 4]; 0], "{what}");

            look(&mut world, places, [-30.0, 5.0], 44.0);
            assert_near(only(told(&mut world, places)), [-30.0, 0.0, 5.0, 2.0]);
        }
    }
}

/// Protocol checklist 175: "When a v1 gimbal sends MOUNT_ORIENTATION pitch −30 yaw 15, a synthesised 285 with flags 44 and
/// matching q appears."
#[test]
fn item_175_what_a_v1_gimbal_reports_is_an_attitude_status() {
    let (mut world, places) = with_gimbal(v1_gimbal());
    report(&mut world, places, -30.0, 15.0);
    world.forget();
    world.run_for(SECOND / 10);
    let heard = world.take(places.ground);
    let status: Vec<_> = heard.iter().filter(|arrival| arrival.id() == 285).collect();
    assert_eq!((status.len(), status[0].source()), (1, MANAGER));
    let status: GIMBAL_DEVICE_ATTITUDE_STATUS_DATA = status[0].decode();
    assert_eq!((status.flags, status.gimbal_device_id, status.failure_flags), (44, 1, 0));
    assert!(status.delta_yaw.is_nan(), "no heading is known");
    let wanted = quaternion(-30.0, 15.0);
    assert!(status.q.iter().zip(wanted).all(|(told, wanted)| (told - wanted).abs() < 1e-6), "{:?}", status.q);
}

/// Gimbal statement 47: "Without any v1 feedback 285 is produced open loop, slew-limited, and marked": by the manager, ten
/// times a second, at 30 degrees a second; 283 and the status say that it is a guess.
#[test]
fn statement_47_what_a_v1_gimbal_does_not_report_is_guessed_and_said_to_be() {
    let (mut world, places) = World::empty(Settings { gimbals: vec![v1_gimbal()], ..three_links() });
    let beats = [(SECOND, places.gimbal, GIMBAL, heartbeat(26, 0)), (SECOND, places.ground, GCS, ground_heartbeat())];
    world.run_with(4 * SECOND, &beats);
    look(&mut world, places, [-60.0, 90.0], 44.0);
    let mut guesses = Vec::new();
    for _ in 0..4 {
        world.forget();
        world.run_with(SECOND, &beats);
        let heard = world.take(places.ground);
        let told: Vec<_> = heard.iter().filter(|arrival| arrival.id() == 285).collect();
        assert!(told.len() == 10 && told.iter().all(|arrival| arrival.source() == MANAGER), "{}", told.len());
        let last: GIMBAL_DEVICE_ATTITUDE_STATUS_DATA = told[9].decode();
        let (pitch, yaw) = pitch_yaw_deg(last.q);
        guesses.push([pitch.round() as i32, yaw.round() as i32]);
        assert!(world.snapshot().gimbals[0].attitude.assumed);
    }
    // The last of each second is a tenth old.
    assert_eq!(guesses, [[-27, 27], [-57, 57], [-60, 87], [-60, 90]]);

    world.send(places.ground, GCS, &request_message(MANAGER, 283));
    let told: Vec<GIMBAL_DEVICE_INFORMATION_DATA> = of(&world.take(places.ground));
    assert_eq!(told.iter().map(|told| told.custom_name.to_str()).collect::<Vec<_>>(), [Ok("open loop")]);
}

/// Gimbal statement 35: "Earth yaw 90 with heading 70 gives v1 p3 = 20; heading changing to 100 gives −10 without a new client
/// command." Gimbal statement 36: "Yaw conversion wraps: earth 170, heading −170 → −20."
#[test]
fn statements_35_and_36_yaw_from_north_is_told_from_the_nose() {
    let (mut world, places) = with_gimbal(v1_gimbal());
    turn_vehicle(&mut world, places, 70.0);
    look(&mut world, places, [-10.0, 90.0], 92.0);
    assert_near(only(told(&mut world, places)), [-10.0, 0.0, 20.0, 2.0]);
    // Shortly before it is due again.
    world.run_for(SECOND * 9 / 200);
    turn_vehicle(&mut world, places, 100.0);
    assert_near(only(told(&mut world, places)), [-10.0, 0.0, -10.0, 2.0]);

    turn_vehicle(&mut world, places, -170.0);
    look(&mut world, places, [-10.0, 170.0], 92.0);
    world.run_for(SECOND / 50);
    let told = told(&mut world, places);
    assert_near(*told.last().expect("it is told"), [-10.0, 0.0, -20.0, 2.0]);
}

/// 281: "High level gimbal manager flags currently applied": yaw is held to North also where that is our doing.
#[test]
fn a_yaw_that_we_hold_to_north_is_shown_as_held() {
    let (mut world, places) = with_gimbal(v1_gimbal());
    turn_vehicle(&mut world, places, 70.0);
    let flags = |world: &World| world.snapshot().gimbals[0].flags.clone();
    let from_the_nose = ["roll_lock", "pitch_lock", "yaw_in_vehicle_frame"];
    look(&mut world, places, [-10.0, 20.0], 44.0);
    assert_eq!(flags(&world), from_the_nose);
    look(&mut world, places, [-10.0, 90.0], 92.0);
    assert_eq!(flags(&world), ["roll_lock", "pitch_lock", "yaw_lock", "yaw_in_vehicle_frame"]);
    look(&mut world, places, [-10.0, 20.0], 44.0);
    assert_eq!(flags(&world), from_the_nose);
}

/// Gimbal statement 37: "v2 rate on a rate-less v1 gimbal is integrated at 50 Hz, clamped at the limits, and stops" after
/// `rate_timeout_s`: here at 50 Hz by `setpoint_rate_hz`, which is 20 by default (D11).
#[test]
fn statement_37_a_rate_becomes_angles_that_move_and_end() {
    let (mut world, places) = with_gimbal(GimbalSettings { setpoint_rate_hz: 50, ..v1_gimbal() });
    // It follows, and says so ten times a second.
    let mut looks = -20.0;
    let mut keep = |world: &mut World, duration: Duration| -> Vec<[f32; 4]> {
        let mut all = Vec::new();
        for _ in 0..(duration.as_millis() / 100) {
            report(world, places, looks, 0.0);
            world.run_for(SECOND / 10);
            all.extend(told(world, places));
            looks = all.last().map_or(looks, |told| told[0]);
        }
        all
    };
    report(&mut world, places, -20.0, 0.0);
    let turn = gimbald::wire::dialect::GIMBAL_MANAGER_SET_PITCHYAW_DATA {
        flags: 44,
        pitch: NAN,
        yaw: NAN,
        pitch_rate: -10_f32.to_radians(),
        yaw_rate: 0.0,
        target_system: 1,
        target_component: 191,
        gimbal_device_id: 1,
    };
    world.send(places.ground, GCS, &MavMessage::GIMBAL_MANAGER_SET_PITCHYAW(turn.clone()));
    let moved = keep(&mut world, SECOND);
    assert!((49..=51).contains(&moved.len()), "{}", moved.len());
    for pair in moved.windows(2) {
        assert!((pair[1][0] - pair[0][0] + 0.2).abs() < 1e-3, "a fiftieth of 10 degrees: {pair:?}");
    }
    let ended = keep(&mut world, 2 * SECOND);
    assert_near(ended[ended.len() - 1], [-40.0, 0.0, 0.0, 2.0]);
    assert_eq!(ended[ended.len() - 2], ended[ended.len() - 1], "two seconds after the last it stands");

    // To the end of its reach, and not beyond.
    let down = command_long(MANAGER, 1000, &[NAN, NAN, -60.0, 0.0, 44.0, 0.0, 1.0]);
    assert_eq!(world.result_of(places.ground, GCS, &down), Some(ACCEPTED));
    let down = keep(&mut world, 3 * SECOND);
    assert!(down.iter().all(|told| told[0] >= -90.0));
    assert_near(down[down.len() - 1], [-90.0, 0.0, 0.0, 2.0]);

    // And back from there at once, whatever it was asked for beyond.
    let up = command_long(MANAGER, 1000, &[NAN, NAN, 20.0, 0.0, 44.0, 0.0, 1.0]);
    assert_eq!(world.result_of(places.ground, GCS, &up), Some(ACCEPTED));
    let up = keep(&mut world, SECOND / 2);
    assert!((-81.0..=-79.0).contains(&up[up.len() - 1][0]), "{up:?}");
}

/// D9: "no change of … link state moves the camera by itself": while the heading is not known, a rate about North that cannot be told
/// turns nothing, and is not made up for when it is known again.
#[test]
fn a_rate_that_cannot_be_told_is_not_made_up_for() {
    let (mut world, places) = with_gimbal(v1_gimbal());
    let fly = |world: &mut World, duration: Duration, is_known: bool| -> Vec<[f32; 4]> {
        let mut all = Vec::new();
        for _ in 0..(duration.as_millis() / 100) {
            if is_known {
                turn_vehicle(world, places, 0.0);
            }
            let yaw = all.last().map_or(0.0, |told: &[f32; 4]| told[2]);
            report(world, places, 0.0, yaw);
            world.run_for(SECOND / 10);
            all.extend(told(world, places));
        }
        all
    };
    fly(&mut world, SECOND, true);
    let turn = command_long(MANAGER, 1000, &[NAN, NAN, 0.0, 20.0, 92.0, 0.0, 1.0]);
    assert_eq!(world.result_of(places.ground, GCS, &turn), Some(ACCEPTED));
    let turned = fly(&mut world, SECOND, true);
    assert!((turned.last().expect("it turns")[2] - 20.0).abs() < 3.0, "{turned:?}");

    let unknown = fly(&mut world, 15 * SECOND, false);
    let again = fly(&mut world, 3 * SECOND, true);

    let held = unknown.last().expect("the last is held")[2];
    assert!((20.0..45.0).contains(&held), "it is noticed after a second that it cannot be told: {unknown:?}");
    assert!(again.len() >= 3 && again.iter().all(|told| (told[2] - held).abs() < 0.1), "{held} {again:?}");
}

/// D7: "On expiry the rate falls to zero within 0.2 s, then the attitude is held", also where the gimbal is slower than what it is
/// asked for: the angles that it is told do not run away from it, and it does not go on to them when its operator lets go.
#[test]
fn a_gimbal_slower_than_its_rate_stands_when_the_rate_ends() {
    for ends in ["zero", "release", "time-out"] {
        let configure = |ids: f32| command_long(MANAGER, 1001, &[ids, ids, -1.0, -1.0, 0.0, 0.0, 1.0]);
        let (mut world, places) = with_gimbal(v1_gimbal());
        report(&mut world, places, -20.0, 0.0);
        assert_eq!(world.result_of(places.ground, GCS, &configure(-2.0)), Some(ACCEPTED), "{ends}");
        let turn = |rate: f32| match set_pitchyaw(NAN, NAN, 0.0, rate.to_radians(), 44) {
            MavMessage::GIMBAL_MANAGER_SET_PITCHYAW(turn) => {
                MavMessage::GIMBAL_MANAGER_SET_PITCHYAW(GIMBAL_MANAGER_SET_PITCHYAW_DATA {
                    gimbal_device_id: 1,
                    ..turn
                })
            }
            other => other,
        };
        let (mut yaw, mut latest) = (0.0, 0.0);
        // It turns by 8 degrees per second at most, and is asked for 25.
        let mut step = |world: &mut World, asked: Option<f32>| -> f32 {
            if let Some(rate) = asked {
                world.send(places.ground, GCS, &turn(rate));
            }
            report(world, places, -20.0, yaw);
            world.run_for(SECOND / 10);
            latest = told(world, places).last().map_or(latest, |told| told[2]);
            yaw += (latest - yaw).clamp(-0.8, 0.8);
            latest
        };
        for _ in 0..50 {
            let told = step(&mut world, Some(25.0));
            assert!(told <= 8.0 * 5.0 + 25.0 + 0.1, "{ends}: {told}");
        }
        let more = match ends {
            "zero" => usize::from(step(&mut world, Some(0.0)) < 0.0),
            "release" => {
                assert_eq!(world.result_of(places.ground, GCS, &configure(-3.0)), Some(ACCEPTED));
                0
            }
            // Two seconds after it was last asked for.
            _ => 20,
        };
        for _ in 0..more {
            step(&mut world, None);
        }
        step(&mut world, None);
        let at_end = step(&mut world, None);
        for _ in 0..100 {
            step(&mut world, None);
        }
        let last = step(&mut world, None);
        assert!((last - at_end).abs() < 0.01, "{ends}: {at_end} to {last}");
        let looks = world.snapshot().gimbals[0].attitude.yaw_vehicle_deg.expect("it says so");
        assert!((looks - f64::from(last)).abs() < 0.5, "{ends}: {looks}");
        let before = 40.0 + 0.8 * more as f64;
        assert!(looks < before + 8.0, "{ends}: it looks to {looks}");
    }
}

/// Gimbal statement 48: "… the daemon's client code supplies both angles": a client that names one axis has the other
/// kept where the gimbal is, and neither a v1 gimbal nor a v2 device is ever told one angle alone, which ArduPilot would
/// refuse.
#[test]
fn statement_48_one_angle_is_told_with_the_other() {
    let (mut world, places) = with_gimbal(v1_gimbal());
    report(&mut world, places, -5.0, 25.0);
    for (angles, expected) in [([-30.0, NAN], [-30.0, 0.0, 25.0, 2.0]), ([NAN, 40.0], [-30.0, 0.0, 40.0, 2.0])] {
        world.run_for(SECOND / 20);
        world.forget();
        look(&mut world, places, angles, 44.0);
        assert_near(only(told(&mut world, places)), expected);
    }

    let (mut world, places) = World::empty(three_links());
    world.run_for(SECOND / 2);
    world.send(places.gimbal, GIMBAL, &gimbal_heartbeat());
    let information = device_information(world.now, usual_capabilities());
    world.send(places.gimbal, GIMBAL, &MavMessage::GIMBAL_DEVICE_INFORMATION(information));
    let status = device_status(world.now, 44, -5.0, 25.0);
    world.send(places.gimbal, GIMBAL, &MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(status));
    world.forget();
    let command = command_long(MANAGER, 1000, &[-30.0, NAN, NAN, NAN, 44.0, 0.0, 154.0]);
    assert_eq!(world.result_of(places.ground, GCS, &command), Some(ACCEPTED));
    let setpoints: Vec<GIMBAL_DEVICE_SET_ATTITUDE_DATA> = world.take_messages(places.gimbal);
    assert_eq!(setpoints.len(), 1);
    let (pitch, yaw) = pitch_yaw_deg(setpoints[0].q);
    assert!((pitch + 30.0).abs() < 1e-3 && (yaw - 25.0).abs() < 1e-3, "{pitch} {yaw}");
}

/// "Parameters: PARAM_REQUEST_LIST/READ/SET reach the gimbal and come back through the router", byte for byte, whether they
/// name the gimbal or everybody, and to whoever asked.
#[test]
fn parameters_reach_a_v1_gimbal_and_come_back() {
    let (mut world, places) = with_gimbal(v1_gimbal());
    let name = || CharArray::from("TILT_MAX");
    for (target_system, target_component) in [(1, 154), (1, 0)] {
        for request in [
            MavMessage::PARAM_REQUEST_LIST(PARAM_REQUEST_LIST_DATA { target_system, target_component }),
            MavMessage::PARAM_REQUEST_READ(PARAM_REQUEST_READ_DATA {
                param_index: -1,
                target_system,
                target_component,
                param_id: name(),
            }),
            MavMessage::PARAM_SET(PARAM_SET_DATA {
                param_value: 45.0,
                target_system,
                target_component,
                param_id: name(),
                param_type: 9,
            }),
        ] {
            world.forget();
            let asked = world.send(places.ground, GCS, &request);
            let at_gimbal: Vec<_> = world.take(places.gimbal).into_iter().map(|arrival| arrival.bytes).collect();
            assert_eq!(at_gimbal, [asked], "{request:?}");
            let value =
                PARAM_VALUE_DATA { param_value: 45.0, param_count: 1, param_index: 0, param_id: name(), param_type: 9 };
            let answer = world.send(places.gimbal, GIMBAL, &MavMessage::PARAM_VALUE(value));
            let heard: Vec<_> = world.take(places.ground).into_iter().map(|arrival| arrival.bytes).collect();
            assert_eq!(heard, [answer], "{request:?}");
        }
    }
}

/// "RC_EXCLUSIVE: … 205 p7=3" through the whole: a v2 client hands the gimbal over, sees in 285 and 281 that radio control
/// has it, and takes it back.
#[test]
fn a_v2_client_hands_a_v1_gimbal_to_its_radio_control() {
    use gimbald::gimbals::mavlink_v1::config::V1RadioControl;
    let v1 = V1Settings { radio_control: V1RadioControl::Mode, ..V1Settings::default() };
    let (mut world, places) = with_gimbal(GimbalSettings { v1, ..v1_gimbal() });
    let keep = |world: &mut World| {
        for _ in 0..10 {
            report(world, places, -20.0, 0.0);
            world.run_for(SECOND / 10);
        }
    };
    look(&mut world, places, [NAN, NAN], 256.0 + 44.0);
    assert_eq!(world.snapshot().gimbals[0].setpoint, None, "it does not look where anybody told it to");
    assert_near(only(told(&mut world, places)), [0.0, 0.0, 0.0, 3.0]);
    keep(&mut world);
    let status: Vec<GIMBAL_DEVICE_ATTITUDE_STATUS_DATA> = world.take_messages(places.ground);
    assert!(status.len() >= 9 && status.iter().all(|status| status.flags == 256 | 44), "{status:?}");
    assert_eq!(told(&mut world, places), [[0.0, 0.0, 0.0, 3.0]; 2], "every half second");
    world.run_for(SECOND / 20);
    look(&mut world, places, [-30.0, 10.0], 44.0);
    assert_near(only(told(&mut world, places)), [-30.0, 0.0, 10.0, 2.0]);
    keep(&mut world);
    let status: Vec<GIMBAL_DEVICE_ATTITUDE_STATUS_DATA> = world.take_messages(places.ground);
    assert!(status.iter().all(|status| status.flags == 44), "{status:?}");
}

/// "Bad input gets a clear error naming the place and the remedy": a client that asks for it is refused, and whoever looks is
/// told by which key the gimbal would be handed over.
#[test]
fn whoever_wants_a_v1_gimbal_to_follow_radio_control_learns_the_key() {
    let commands = [
        (command_long(MANAGER, 1000, &[NAN, NAN, NAN, NAN, 256.0 + 44.0, 0.0, 1.0]), DENIED),
        (command_long(MANAGER, 204, &[3.0]), UNSUPPORTED),
        (command_long(MANAGER, 205, &[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 3.0]), UNSUPPORTED),
    ];
    for (command, result) in commands {
        let (mut world, places) = with_gimbal(v1_gimbal());
        assert_eq!(world.result_of(places.ground, GCS, &command), Some(result), "{command:?}");
        assert_eq!(told(&mut world, places), [[0.0; 4]; 0]);
        let event = world.snapshot().events[0].clone();
        assert_eq!((event.what.as_str(), event.reason.as_deref()), ("refused", Some("v1_radio_control_is_none")));
        assert_eq!(
            event.text,
            "255/190 was refused: v1_radio_control is \"none\", so this gimbal is taken to have no radio control of its own. If \
             it has one, say in its [[gimbal]] entry how that gets the gimbal: v1_radio_control = \"silence\" (whenever the \
             gimbal is told nothing) or \"mode\" (by DO_MOUNT_CONTROL in mode 3), and restart gimbald"
        );
    }
}

/// "Each reachable three ways": by its name it is handed over as by a client's demand, until the next one; where
/// it is not known to have radio control, "bad input gets a clear error naming the place and the remedy".
#[test]
fn a_v1_gimbal_is_left_to_its_radio_control_by_its_name() {
    use gimbald::gimbals::mavlink_v1::config::V1RadioControl;
    let asked = |world: &mut World, command: &str, body: &str| {
        let action = Action::of_command(command).expect(command);
        let asked = action.read(None, body.as_bytes()).expect(body);
        world.answers.clear();
        world.ask_by_name("camera", &asked);
        world.run_for(SECOND / 10);
        std::mem::take(&mut world.answers).into_iter().map(|(_, answer)| answer).collect::<Vec<_>>()
    };
    let (mut world, places) = with_gimbal(v1_gimbal());
    assert_eq!(
        asked(&mut world, "radio-control", ""),
        [Err(NotDone::Operation(OperationError::NotConfigured(
            "v1_radio_control is \"none\", so this gimbal is taken to have no radio control of its own. If it has one, say in \
             its [[gimbal]] entry how that gets the gimbal: v1_radio_control = \"silence\" (whenever the gimbal is told nothing) \
             or \"mode\" (by DO_MOUNT_CONTROL in mode 3), and restart gimbald"
        )))],
    );
    assert_eq!(told(&mut world, places), [[0.0; 4]; 0]);

    let v1 = V1Settings { radio_control: V1RadioControl::Mode, ..V1Settings::default() };
    let (mut world, places) = with_gimbal(GimbalSettings { v1, ..v1_gimbal() });
    assert_eq!(asked(&mut world, "point", r#"{"pitch_deg": -40}"#), [Ok(())]);
    world.forget();
    assert_eq!(asked(&mut world, "radio-control", ""), [Ok(())]);
    for _ in 0..20 {
        report(&mut world, places, -20.0, 0.0);
        world.run_for(SECOND / 10);
    }
    assert_eq!(told(&mut world, places), [[0.0, 0.0, 0.0, 3.0]; 5], "at once and every half second, and nothing else");
    assert_eq!(asked(&mut world, "point", r#"{"pitch_deg": -30}"#), [Ok(())]);
    assert_eq!(told(&mut world, places), [[-30.0, 0.0, 0.0, 2.0]]);
}

/// A gimbal that wants it is configured once, and told the newest when it has answered; the answer is not the client's.
#[test]
fn a_gimbal_that_wants_it_is_configured_first() {
    let v1 = V1Settings { configures: true, ..V1Settings::default() };
    let (mut world, places) = with_gimbal(GimbalSettings { v1, ..v1_gimbal() });
    look(&mut world, places, [-30.0, 10.0], 44.0);
    look(&mut world, places, [-40.0, 10.0], 44.0);
    world.run_for(SECOND * 3 / 5);
    let sent: Vec<COMMAND_LONG_DATA> = world.take_messages(places.gimbal);
    let sent: Vec<_> = sent.iter().map(|sent| (sent.command, sent.param1, sent.confirmation)).collect();
    assert_eq!(sent, [(204, 2.0, 1)], "after half a second once more");
    world.forget();
    world.send(places.gimbal, GIMBAL, &MavMessage::COMMAND_ACK(ack(MANAGER, 204, ACCEPTED)));
    assert_near(only(told(&mut world, places)), [-40.0, 0.0, 10.0, 2.0]);
}

/// D9: "the start of every ramp, are the measured attitude": while the gimbal has not answered that it is configured, a rate turns
/// nothing that it would have to make up for at once, and one that has ended by then moves nothing any more.
#[test]
fn a_rate_begins_when_the_gimbal_is_configured_or_does_without() {
    let v1 = V1Settings { configures: true, ..V1Settings::default() };
    let rate = |rate: f32| command_long(MANAGER, 1000, &[NAN, NAN, 0.0, rate, 44.0, 0.0, 1.0]);
    let standing = |world: &mut World, places: Places, times: u32| {
        for _ in 0..times {
            report(world, places, -20.0, 5.0);
            world.run_for(SECOND / 10);
        }
    };
    for (answers, ends) in [(true, false), (false, false), (false, true)] {
        let (mut world, places) = with_gimbal(GimbalSettings { v1, ..v1_gimbal() });
        report(&mut world, places, -20.0, 5.0);
        assert_eq!(world.result_of(places.ground, GCS, &rate(30.0)), Some(ACCEPTED));
        standing(&mut world, places, 10);
        if ends {
            assert_eq!(world.result_of(places.ground, GCS, &rate(0.0)), Some(ACCEPTED));
        }
        standing(&mut world, places, 4);
        let sent: Vec<COMMAND_LONG_DATA> = world.take_messages(places.gimbal);
        assert!(sent.iter().all(|sent| sent.command == 204), "{sent:?}");

        if answers {
            world.send(places.gimbal, GIMBAL, &MavMessage::COMMAND_ACK(ack(MANAGER, 204, ACCEPTED)));
        } else {
            world.run_for(SECOND / 5);
        }
        let first = told(&mut world, places)[0];
        assert_near(first, [-20.0, 0.0, 5.0, 2.0]);
        standing(&mut world, places, 5);
        let last = *told(&mut world, places).last().expect("it is told on");
        let turned = if ends { 5.0..=5.01 } else { 17.0..=27.0 };
        assert!(turned.contains(&last[2]), "{answers} {ends}: {last:?}");
    }
}
