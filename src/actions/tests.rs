use super::*;
use crate::geometry::{Angle, AngularRate, YawFrame};
use crate::gimbals::operation::{Axis, AxisMotion, Operation, RadioType, ResetMode, Stream, StreamRate};
use crate::manager::request::AxisDemand;
use crate::manager::roi::Datum;

fn read(command: &str, in_path: Option<&str>, body: &str) -> Result<Asked, String> {
    let action = Action::of_command(command).expect(command);
    action.read(in_path, body.as_bytes()).map_err(|wrong| wrong.to_string())
}

#[test]
fn every_command_and_every_path_is_there_once() {
    for (at, action) in ACTIONS.iter().enumerate() {
        for other in &ACTIONS[..at] {
            assert_ne!(action.path, other.path);
            assert_ne!(action.command, other.command);
        }
        assert_eq!(action.path.contains('{'), action.path_field().is_some(), "{}", action.path);
        for (at, field) in action.fields.iter().enumerate() {
            assert!(action.fields[..at].iter().all(|other| other.name != field.name), "{}", field.name);
            assert_ne!(field.name, CONFIRM);
        }
    }
}

/// Whatever the word of the table says, the reading asks for it, and tells what it may cost.
#[test]
fn what_is_dangerous_has_its_word() {
    for (command, body, word, cost) in [
        (
            "motors",
            r#"{"state": "off"}"#,
            "motors off",
            "the camera falls to where its weight takes it; to a Gremsy that speaks v2 it is RETRACT, and some firmware \
             switches the motors on again only after a restart",
        ),
        ("reboot", "", "reboot", "the camera is not held until the gimbal has started"),
        ("shutdown", "{}", "shutdown", "the camera is not held any more, and the gimbal must be switched on by hand"),
    ] {
        let action = Action::of_command(command).expect(command);
        assert_eq!(action.word(), Some(word));
        let refusal = format!("this is dangerous: {cost}; it is done when the body says \"confirm\": \"{word}\"");
        assert_eq!(read(command, None, body), Err(refusal.clone()));
        for wrong in ["true", "\"yes\"", "\"\"", "null", "1"] {
            let body = format!(r#"{{"state": "off", "confirm": {wrong}}}"#)
                .replace(if command == "motors" { "" } else { r#""state": "off", "# }, "");
            assert_eq!(read(command, None, &body), Err(refusal.clone()), "{body}");
        }
        let state = if command == "motors" { r#""state": "off", "# } else { "" };
        let asked = read(command, None, &format!(r#"{{{state}"confirm": "{word}"}}"#)).expect("confirmed");
        assert!(asked.is_dangerous());
        assert_eq!(danger_of(&asked).map(|danger| danger.word), Some(word));
    }
    let on = read("motors", None, r#"{"state": "on"}"#).expect("not dangerous");
    assert!(!on.is_dangerous());
    for (body, may_cut_motors) in [("", false), (r#"{"confirm": "motors off"}"#, true), (r#"{"confirm": ""}"#, false)] {
        assert_eq!(read("retract", None, body), Ok(Asked::Retract { may_cut_motors }), "the core asks for it: {body}");
    }
    assert!(read("neutral", None, r#"{"confirm": "neutral"}"#).is_err(), "no word is needed there");
}

#[test]
#[rustfmt::skip]
fn what_is_wrong_is_said() {
    for (command, in_path, body, expected) in [
        ("point", None, "", "nothing is asked for; expected at least one of pitch_deg, yaw_deg, roll_deg"),
        ("point", None, "[]", "the body is no JSON object: invalid type: sequence, expected an object at line 1 column 0"),
        ("point", None, "{", "the body is no JSON object: EOF while parsing an object at line 1 column 1"),
        ("point", None, "{} {}", "the body is no JSON object: trailing characters at line 1 column 4"),
        ("point", None, r#"{"pitch_deg": NaN}"#, "the body is no JSON object: expected value at line 1 column 15"),
        ("point", None, r#"{"pitch_deg": 1e999}"#, "the body is no JSON object: number out of range at line 1 column 19"),
        ("point", None, r#"{"pitch_deg": 181}"#, "pitch_deg: found 181; expected a number from -180 to 180"),
        ("point", None, r#"{"pitch_deg": "-30"}"#, "pitch_deg: found \"-30\"; expected a number from -180 to 180"),
        ("point", None, r#"{"pitch_deg": null}"#, "pitch_deg: found null; expected a number from -180 to 180"),
        ("point", None, r#"{"pitch_deg": 1, "pitch_deg": 2}"#, "pitch_deg is there twice"),
        ("point", None, r#"{"pitch": 1}"#, "pitch: unknown field; expected pitch_deg, yaw_deg, roll_deg, yaw_frame, pitch_rate_dps, yaw_rate_dps"),
        ("point", None, r#"{"pitch_deg": 1, "yaw_frame": "north"}"#, "yaw_frame: found \"north\"; expected vehicle or earth"),
        ("point", None, r#"{"yaw_deg": 1, "pitch_rate_dps": 1}"#, "a rate without an angle on its axis; to turn there is turn"),
        ("stop", None, r#"{"now": true}"#, "now: unknown field; expected none"),
        ("roi", None, r#"{"latitude_deg": 47}"#, "longitude_deg is missing; expected a number from -180 to 180"),
        ("control", None, "{}", "action is missing; expected take or release"),
        ("stream-rate", None, r#"{"stream": "raw_imu", "rate_hz": 0}"#, "rate_hz: found 0; expected a whole number from 1 to 200, or off or default"),
        ("stream-rate", None, r#"{"stream": "raw_imu", "rate_hz": 1.5}"#, "rate_hz: found 1.5; expected a whole number from 1 to 200, or off or default"),
        ("set-parameter", Some("A_NAME_OF_17_CHAR"), r#"{"value": 1}"#, "parameter: found \"A_NAME_OF_17_CHAR\"; expected a name of 1 to 16 printable ASCII characters"),
        ("set-parameter", Some("PWR PAN"), r#"{"value": 1}"#, "parameter: found \"PWR PAN\"; expected a name of 1 to 16 printable ASCII characters"),
        ("set-parameter", Some("PWR_PAN"), r#"{"parameter": "PWR_PAN", "value": 1}"#, "parameter: unknown field; expected value"),
        ("axis", Some("yaw"), r#"{"follow_speed": 1}"#, "axis: found \"yaw\"; expected tilt, roll or pan"),
        ("limits", Some("pan"), r#"{"min_deg": 10, "max_deg": -10}"#, "min_deg must not be above max_deg"),
        ("combined-attitude", None, r#"{"enabled": 1}"#, "enabled: found 1; expected true or false"),
    ] {
        assert_eq!(read(command, in_path, body), Err(expected.to_owned()), "{command} {body}");
    }
    let long = format!(r#"{{"action": "{}"}}"#, "x".repeat(3000));
    assert!(read("control", None, &long).expect_err("no such action").len() < 150, "a long value is cut");
}

#[test]
fn what_is_right_is_asked() {
    let demand = |degrees: Option<f64>, rate: Option<f64>| AxisDemand {
        angle: degrees.map(Angle::from_degrees),
        rate: rate.map(AngularRate::from_degrees_per_second),
    };
    let (pitch, yaw) = (demand(Some(-30.0), Some(5.0)), demand(Some(-90.0), None));
    let expected = Asked::Point { roll: demand(None, None), pitch, yaw, yaw_frame: YawFrame::Earth };
    let body = r#"{"pitch_deg": -30, "pitch_rate_dps": 5, "yaw_deg": 270, "yaw_frame": "earth"}"#;
    let Ok(Asked::Point { roll, pitch, yaw, yaw_frame }) = read("point", None, body) else { panic!("it is right") };
    let rounded = yaw.angle.map(|yaw| Angle::from_degrees(yaw.degrees().round()));
    assert_eq!(Asked::Point { roll, pitch, yaw: AxisDemand { angle: rounded, ..yaw }, yaw_frame }, expected);

    for (command, in_path, body, operation) in [
        ("radio-type", None, r#"{"type": "herelink"}"#, Operation::SetRadioType(RadioType::Herelink)),
        ("radio-type", None, r#"{"type": "sync"}"#, Operation::SetRadioType(RadioType::Sync)),
        (
            "stream-rate",
            None,
            r#"{"stream": "encoders", "rate_hz": 20}"#,
            Operation::SetStreamRate { stream: Stream::Encoders, rate: StreamRate::Hertz(20) },
        ),
        (
            "stream-rate",
            None,
            r#"{"stream": "raw_imu", "rate_hz": "off"}"#,
            Operation::SetStreamRate { stream: Stream::RawImu, rate: StreamRate::Off },
        ),
        (
            "set-parameter",
            Some("PWR_PAN"),
            r#"{"value": 60}"#,
            Operation::SetParameter { name: "PWR_PAN".to_owned(), value: 60.0 },
        ),
        (
            "axis",
            Some("pan"),
            r#"{"follow_speed": 7, "reversed": false}"#,
            Operation::SetAxisMotion {
                axis: Axis::Pan,
                motion: AxisMotion { follow_speed: Some(7.0), reversed: Some(false), ..AxisMotion::default() },
            },
        ),
        ("home-on-mode-change", None, r#"{"enabled": true}"#, Operation::SetHomeOnModeChange(true)),
    ] {
        assert_eq!(read(command, in_path, body), Ok(Asked::Operation(operation)), "{command}");
    }
}

/// Whatever has several values is asked for by the name of each.
#[test]
fn every_name_is_read_as_what_it_names() {
    let asked = |operation| Ok(Asked::Operation(operation));
    for kind in RadioType::ALL {
        let body = format!(r#"{{"type": "{}"}}"#, kind.name());
        assert_eq!(read("radio-type", None, &body), asked(Operation::SetRadioType(kind)));
    }
    for mode in ResetMode::ALL {
        let body = format!(r#"{{"mode": "{}"}}"#, mode.name());
        assert_eq!(read("reset", None, &body), asked(Operation::Reset(mode)));
    }
    for stream in Stream::ALL {
        let body = format!(r#"{{"stream": "{}", "rate_hz": "default"}}"#, stream.name());
        let operation = Operation::SetStreamRate { stream, rate: StreamRate::Default };
        assert_eq!(read("stream-rate", None, &body), asked(operation));
    }
    for axis in Axis::ALL {
        let motion = AxisMotion { control_speed_dps: Some(7.0), ..AxisMotion::default() };
        let body = r#"{"control_speed_dps": 7}"#;
        assert_eq!(read("axis", Some(axis.name()), body), asked(Operation::SetAxisMotion { axis, motion }));
    }
}

#[test]
fn a_path_holds_its_field_whatever_it_is() {
    let action = Action::of_command("set-parameter").expect("it is there");
    assert_eq!(action.path_with(Some("A/B C%ä")), "parameters/A%2FB%20C%25%C3%A4");
    assert_eq!(Action::of_command("stop").expect("it is there").path_with(None), "stop");
}

/// "`altitude_reference`: mean sea level (the default), or home".
#[test]
fn the_altitude_of_a_place_counts_from_what_is_named() {
    let roi = Action::of_command("roi").expect("it is there");
    for (reference, expected) in [
        ("", Datum::MeanSeaLevel),
        (r#", "altitude_reference": "amsl""#, Datum::MeanSeaLevel),
        (r#", "altitude_reference": "home""#, Datum::Home),
    ] {
        let body = format!(r#"{{"latitude_deg": 47.5, "longitude_deg": 8.5, "altitude_m": 50{reference}}}"#);
        let asked = roi.read(None, body.as_bytes());
        let (latitude_deg, longitude_deg, altitude_m) = (47.5, 8.5, 50.0);
        assert_eq!(asked, Ok(Asked::LookAt { latitude_deg, longitude_deg, altitude_m, datum: expected }), "{body}");
    }
}
