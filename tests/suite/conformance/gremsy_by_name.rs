//! A Gremsy by its name: "Gremsy owners can do from gimbald everything that the vendor's SDK does", over HTTP and on the
//! command line, which have their bodies from the same table as these tests, in simulated time.

use std::time::Duration;

use gimbald::actions::Action;
use gimbald::bridge::settings::Settings;
use gimbald::gimbals::gremsy::sim::{Device, DeviceSettings, Generation};
use gimbald::gimbals::operation::OperationError;
use gimbald::gimbals::settings::{Family, GimbalSettings};
use gimbald::manager::asked::{Answer, NotDone};
use gimbald::manager::request::Refusal;
use gimbald::sim::vehicle::{Vehicle, VehicleSettings};
use gimbald::timestamp::Timestamp;
use gimbald::wire::dialect::COMMAND_LONG_DATA;
use gimbald::wire::ids::{CommandResult, command, message};
use serde_json::Value;

use crate::support::world::{Places, World, three_links};

const SECOND: Duration = Duration::from_secs(1);

/// A flying vehicle with a Gremsy that has started.
fn with_gremsy(generation: Generation) -> (World, Places) {
    let gremsy = GimbalSettings { family: Family::Gremsy, ..GimbalSettings::found("camera".to_owned()) };
    let (mut world, places) = World::empty(Settings { gimbals: vec![gremsy], ..three_links() });
    world.install(places.autopilot, Vehicle::new(Timestamp::ZERO, VehicleSettings::default()));
    world.install(places.gimbal, Device::new(Timestamp::ZERO, DeviceSettings::of(generation)));
    world.run_for(25 * SECOND);
    assert_eq!(world.snapshot().gimbals[0].details.stage.as_deref(), Some("running"), "{generation:?}");
    (world, places)
}

/// Asks for something as it would come over HTTP, and gives its one answer.
fn ask(world: &mut World, command: &str, in_path: Option<&str>, body: &str) -> Answer {
    let action = Action::of_command(command).expect(command);
    let asked = action.read(in_path, body.as_bytes()).unwrap_or_else(|wrong| panic!("{command} {body}: {wrong}"));
    world.answers.clear();
    let id = world.ask_by_name("camera", &asked);
    let end = world.now + 21 * SECOND;
    while world.answers.is_empty() && world.now < end {
        world.run_for(SECOND / 100);
    }
    let [(answered, answer)] = &world.answers[..] else { panic!("{command}: {:?}", world.answers) };
    assert_eq!(*answered, id);
    answer.clone()
}

/// "Without autopilot attitude … north is not known" (gimbals 1.7): also in its maker's mode LOCK a Gremsy is not kept to North
/// without a vehicle's heading, which it is that is missing, and as its yaw from the nose is known it follows.
#[test]
fn without_an_autopilot_a_gremsy_is_not_kept_to_north_and_follows() {
    let gremsy = GimbalSettings { family: Family::Gremsy, ..GimbalSettings::found("camera".to_owned()) };
    let (mut world, places) = World::empty(Settings { gimbals: vec![gremsy], ..three_links() });
    world.install(places.gimbal, Device::new(Timestamp::ZERO, DeviceSettings::of(Generation::V1)));
    world.run_for(25 * SECOND);
    take(&mut world);
    done(&mut world, "yaw-mode", None, r#"{"mode": "lock"}"#);
    world.run_for(SECOND);

    let no_heading = Err(NotDone::Refused { refusal: Refusal::later("no_heading"), holder: None });
    assert_eq!(ask(&mut world, "lock", None, ""), no_heading);
    done(&mut world, "follow", None, "");
}

#[track_caller]
fn done(world: &mut World, command: &str, in_path: Option<&str>, body: &str) {
    assert_eq!(ask(world, command, in_path, body), Ok(()), "{command} {body}");
}

/// Who asks for nothing loses control after ten seconds.
fn take(world: &mut World) {
    done(world, "control", None, r#"{"action": "take"}"#);
}

fn details(world: &World, pointer: &str) -> Value {
    let details = serde_json::to_value(&world.snapshot().gimbals[0].details).expect("plain data");
    details.pointer(pointer).cloned().unwrap_or(Value::Null)
}

/// What moved it or switched something since this was last asked: commands with their first parameter, and how many setpoints
/// of v2.
fn orders(world: &mut World, places: Places) -> (Vec<(u16, f32)>, usize) {
    let arrivals = world.take(places.gimbal);
    let commands = arrivals.iter().filter_map(|arrival| arrival.frame().decode::<COMMAND_LONG_DATA>());
    let moves =
        commands.filter(|told| !matches!(told.command, command::REQUEST_MESSAGE | command::SET_MESSAGE_INTERVAL));
    let setpoints = arrivals.iter().filter(|arrival| arrival.id() == message::GIMBAL_DEVICE_SET_ATTITUDE).count();
    (moves.map(|told| (told.command, told.param1)).collect(), setpoints)
}

/// Degrees; yaw from the nose.
fn looks(world: &World) -> (f64, f64) {
    let attitude = &world.snapshot().gimbals[0].attitude;
    (attitude.pitch_deg.expect("known").round() + 0.0, attitude.yaw_vehicle_deg.expect("known").round() + 0.0)
}

/// Motors, modes and resets: each shows in what the gimbal tells and where it looks, and no setpoint of before undoes it.
#[test]
fn a_gremsy_does_what_moves_it() {
    for generation in [Generation::V1, Generation::V2] {
        let (mut world, _) = with_gremsy(generation);
        take(&mut world);
        let turned = |world: &mut World, command: &str, body: &str| {
            take(world);
            done(world, "point", None, r#"{"pitch_deg": -40, "yaw_deg": 30}"#);
            world.run_for(4 * SECOND);
            take(world);
            assert_eq!(looks(world), (-40.0, 30.0), "{generation:?} {command} {body}");
            done(world, command, None, body);
            world.run_for(5 * SECOND);
            looks(world)
        };
        assert_eq!(turned(&mut world, "mapping", "").0, -90.0, "{generation:?}");
        for (mode, expected) in
            [("yaw", (-40.0, 0.0)), ("pitch_and_yaw", (0.0, 0.0)), ("pitch_down_up_and_yaw", (-90.0, 0.0))]
        {
            let body = format!(r#"{{"mode": "{mode}"}}"#);
            assert_eq!(turned(&mut world, "reset", &body), expected, "{generation:?} {mode}");
        }
        for mode in ["pitch_down_up", "pitch_mapping"] {
            let body = format!(r#"{{"mode": "{mode}"}}"#);
            assert_eq!(turned(&mut world, "reset", &body).0, -90.0, "{generation:?} {mode}");
        }
        assert_eq!(turned(&mut world, "neutral", ""), (0.0, 0.0), "{generation:?}");
        for mode in ["lock", "follow"] {
            take(&mut world);
            done(&mut world, "yaw-mode", None, &format!(r#"{{"mode": "{mode}"}}"#));
            world.run_for(2 * SECOND);
            assert_eq!(details(&world, "/mode"), mode, "{generation:?}");
        }
        take(&mut world);
        done(&mut world, "motors", None, r#"{"state": "off", "confirm": "motors off"}"#);
        world.run_for(2 * SECOND);
        assert_eq!(details(&world, "/motors_on"), false, "{generation:?}");
        world.run_for(5 * SECOND);
        assert_eq!(details(&world, "/motors_on"), false, "{generation:?}: they stay off");
        take(&mut world);
        done(&mut world, "motors", None, r#"{"state": "on"}"#);
        world.run_for(5 * SECOND);
        assert_eq!(details(&world, "/motors_on"), true, "{generation:?}");
    }
}

/// Settings and parameters: each is read back from the gimbal.
#[test]
#[rustfmt::skip]
fn a_gremsy_is_set() {
    for generation in [Generation::V1, Generation::V2] {
        let (mut world, _) = with_gremsy(generation);
        for (command, in_path, body, pointer, expected) in [
            ("radio-type",          None,            r#"{"type": "herelink"}"#,                    "/radio_type",                  Value::from("herelink")),
            ("radio-type",          None,            r#"{"type": "sync"}"#,                        "/radio_type",                  "sync".into()),
            ("set-parameter",       Some("PWR_PAN"), r#"{"value": 55}"#,                           "/parameters/PWR_PAN",          55.0.into()),
            ("axis",                Some("pan"),     r#"{"follow_smoothing": 40}"#,                "/axes/pan/follow_smoothing",   40.0.into()),
            ("axis",                Some("roll"),    r#"{"control_speed_dps": 25}"#,               "/axes/roll/control_speed_dps", 25.0.into()),
            ("axis",                Some("tilt"),    r#"{"reversed": true}"#,                      "/axes/tilt/reversed",          true.into()),
            ("axis",                Some("tilt"),    r#"{"reversed": false}"#,                     "/axes/tilt/reversed",          false.into()),
            ("motor-control",       None,            r#"{"tilt_stiffness": 30}"#,                  "/axes/tilt/stiffness",         30.0.into()),
            ("motor-control",       None,            r#"{"gyro_filter": 3}"#,                      "/gyro_filter",                 3.0.into()),
            ("limits",              Some("tilt"),    r#"{"min_deg": -80, "max_deg": 40}"#,         "/axes/tilt/min_deg",           (-80.0).into()),
            ("limits",              Some("tilt"),    r#"{"min_deg": -80, "max_deg": 41}"#,         "/axes/tilt/max_deg",           41.0.into()),
            ("limits",              Some("pan"),     r#"{"min_deg": -100, "max_deg": 90}"#,        "/axes/pan/max_deg",            90.0.into()),
            ("limits",              Some("pan"),     r#"{"min_deg": -101, "max_deg": 90}"#,        "/axes/pan/min_deg",            (-101.0).into()),
            ("limits",              Some("roll"),    r#"{"min_deg": -15, "max_deg": 20}"#,         "/axes/roll/min_deg",           (-15.0).into()),
            ("limits",              Some("roll"),    r#"{"min_deg": -15, "max_deg": 21}"#,         "/axes/roll/max_deg",           21.0.into()),
            ("encoder-unit",        None,            r#"{"unit": "angles"}"#,                      "/encoder_unit",                "angles".into()),
            ("combined-attitude",   None,            r#"{"enabled": false}"#,                      "/combined_attitude",           false.into()),
            ("combined-attitude",   None,            r#"{"enabled": true}"#,                       "/combined_attitude",           true.into()),
            ("home-on-mode-change", None,            r#"{"enabled": true}"#,                       "/home_on_mode_change",         true.into()),
            ("stream-rate",         None,            r#"{"stream": "raw_imu", "rate_hz": 20}"#,    "/streams/raw_imu/wanted_hz",   20.0.into()),
            ("stream-rate",         None,            r#"{"stream": "encoders", "rate_hz": "off"}"#, "/streams/encoders/wanted_hz", 0.0.into()),
            ("stream-rate",         None,            r#"{"stream": "mount_orientation", "rate_hz": 25}"#, "/streams/mount_orientation/wanted_hz", 25.0.into()),
            ("refresh-parameters",  None,            "",                                           "/parameters/PWR_PAN",          55.0.into()),
            ("information",         None,            "",                                           "/radio_type",                  "sync".into()),
        ] {
            done(&mut world, command, in_path, body);
            assert_eq!(details(&world, pointer), expected, "{generation:?} {command} {body}");
        }
        // A v1 gimbal does not know the message.
        let attitude = ask(&mut world, "stream-rate", None, r#"{"stream": "attitude_status", "rate_hz": 15}"#);
        match generation {
            Generation::V1 => assert_eq!(attitude, Err(NotDone::Operation(OperationError::UnsupportedByDevice))),
            Generation::V2 => {
                assert_eq!(attitude, Ok(()));
                assert_eq!(details(&world, "/streams/attitude_status/wanted_hz"), 15.0);
            }
        }
        let unknown = ask(&mut world, "set-parameter", Some("NO_SUCH"), r#"{"value": 1}"#);
        assert!(matches!(unknown, Err(NotDone::Operation(_))), "{unknown:?}");
    }
}

/// "Dangerous ones (motors off, reboot)": a gimbal that starts again is back, and a shut one is lost; neither turns or moves by
/// what was asked before.
#[test]
fn a_gremsy_is_restarted_and_shut_down() {
    for generation in [Generation::V1, Generation::V2] {
        let (mut world, places) = with_gremsy(generation);
        take(&mut world);
        done(&mut world, "turn", None, r#"{"yaw_dps": 10}"#);
        world.run_for(SECOND / 2);
        done(&mut world, "reboot", None, r#"{"confirm": "reboot"}"#);
        world.forget();
        world.run_for(40 * SECOND);
        assert_eq!(world.snapshot().gimbals[0].state, "alive", "{generation:?}");
        assert_eq!(details(&world, "/stage"), "running", "{generation:?}");
        let before = looks(&world);
        world.run_for(5 * SECOND);
        assert_eq!(looks(&world), before, "{generation:?}: it stands");
        assert_eq!(orders(&mut world, places), (vec![], 0), "{generation:?}: it is told nothing after that");

        take(&mut world);
        done(&mut world, "shutdown", None, r#"{"confirm": "shutdown"}"#);
        world.run_for(10 * SECOND);
        assert_eq!(world.snapshot().gimbals[0].state, "lost", "{generation:?}");
        take(&mut world);
        // "the gimbal was shut down; switch it on", whatever is asked of it.
        let refusal = Refusal { result: CommandResult::Failed, reason: "gimbal_shut_down" };
        for (command, body) in [
            ("motors", r#"{"state": "on"}"#),
            ("reboot", r#"{"confirm": "reboot"}"#),
            ("refresh-parameters", ""),
            ("point", r#"{"pitch_deg": 0}"#),
        ] {
            let answer = ask(&mut world, command, None, body);
            assert_eq!(answer, Err(NotDone::Refused { refusal, holder: None }), "{generation:?} {command}");
        }
    }
}

/// `set_gimbal_rc_input_sync`: it is left to its radio receiver until the next demand.
#[test]
fn a_gremsy_is_left_to_its_radio_receiver() {
    for generation in [Generation::V1, Generation::V2] {
        let (mut world, places) = with_gremsy(generation);
        done(&mut world, "point", None, r#"{"pitch_deg": -40}"#);
        world.run_for(3 * SECOND);
        assert_eq!(looks(&world).0, -40.0, "{generation:?}");
        world.forget();
        done(&mut world, "radio-control", None, "");
        let handed_over = orders(&mut world, places);
        assert_eq!(handed_over, (vec![(command::DO_MOUNT_CONFIGURE, 3.0)], 0), "{generation:?}");
        world.run_for(3 * SECOND);
        assert_eq!(orders(&mut world, places), (vec![], 0), "{generation:?}: it is told nothing");
        assert_eq!(world.snapshot().gimbals[0].setpoint, None, "{generation:?}");
        done(&mut world, "point", None, r#"{"pitch_deg": -20}"#);
        world.run_for(3 * SECOND);
        assert_eq!(looks(&world).0, -20.0, "{generation:?}");
    }
}
