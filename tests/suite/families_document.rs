//! `docs/families/` against the tests that it names: statements about gimbals, each a row with its number.

use std::collections::BTreeMap;
use std::ops::RangeInclusive;

use gimbald::actions::ACTIONS;
use gimbald::gimbals::details::GimbalDetails;

use crate::support::documented::{self, Row, Rule, assert_none, wrongly_named_tests};

/// Each document, and the statements that must be there; others may.
const DOCUMENTS: [(&str, RangeInclusive<u32>); 2] =
    [("docs/families/mavlink_v1.md", 33..=48), ("docs/families/gremsy.md", 1..=32)];

/// The statements that are there, each once, with nothing left empty.
#[test]
fn every_statement_is_there_once() {
    for (document, required) in DOCUMENTS {
        let mut problems = Vec::new();
        let mut seen = BTreeMap::new();
        for row in rows(document) {
            if let Some(first) = seen.insert(row.rule, row.line) {
                problems.push(format!("line {}: {} stands in line {first} already", row.line, row.rule));
            }
            if !row.is_whole(3) {
                problems.push(format!("line {}: {} has not 3 cells with something in each", row.line, row.rule));
            }
        }
        let missing = required.map(Rule::Statement).filter(|rule| !seen.contains_key(rule));
        problems.extend(missing.map(|rule| format!("no {rule}")));
        assert_none(document, &problems);
    }
}

/// Every test that a document names exists and names the statement itself.
#[test]
fn every_named_test_is_there_and_says_what_it_shows() {
    for (document, _) in DOCUMENTS {
        assert_none(document, &wrongly_named_tests(&rows(document)));
    }
}

/// The functions of the vendor's guide ("Public Member Functions"), and those that its SDK has besides.
const GREMSY_FUNCTIONS: [&str; 51] = [
    "Gimbal_Interface",
    "~Gimbal_Interface",
    "start",
    "stop",
    "start_read_thread",
    "start_write_thread",
    "handle_quit",
    "get_flag_exit",
    "get_connection",
    "present",
    "set_gimbal_reboot",
    "set_gimbal_rc_input_sync",
    "set_gimbal_motor",
    "get_gimbal_mode",
    "set_gimbal_reset_mode",
    "set_gimbal_lock_mode_sync",
    "set_gimbal_follow_mode_sync",
    "set_gimbal_mapping_sync",
    "set_gimbal_return_home_sync",
    "set_gimbal_rotation_sync",
    "set_gimbal_rotation_rate_sync",
    "get_gimbal_status",
    "get_gimbal_raw_imu",
    "get_gimbal_attitude",
    "get_gimbal_encoder",
    "get_gimbal_timestamps",
    "get_gimbal_version",
    "set_gimbal_config_tilt_axis",
    "get_gimbal_config_tilt_axis",
    "set_gimbal_config_roll_axis",
    "get_gimbal_config_roll_axis",
    "set_gimbal_config_pan_axis",
    "get_gimbal_config_pan_axis",
    "get_gimbal_motor_control",
    "set_gimbal_motor_control",
    "set_msg_encoder_rate",
    "set_msg_mnt_orient_rate",
    "set_msg_attitude_status_rate",
    "set_msg_raw_imu_rate",
    "set_gimbal_encoder_type_send",
    "get_gimbal_encoder_type_send",
    "request_gimbal_device_info",
    "set_gimbal_combine_attitude",
    "set_gimbal_return_home_when_change_mode",
    "set_limit_angle_pitch",
    "get_limit_angle_pitch",
    "set_limit_angle_yaw",
    "get_limit_angle_yaw",
    "set_limit_angle_roll",
    "get_limit_angle_roll",
    "set_rc_type",
];

/// "A table in `docs/families/gremsy.md`: every SDK function, how to do it with gimbald in each of the three ways, the wire
/// message, the test." Every way that it names is there.
#[test]
fn every_function_of_gremsys_sdk_is_there_with_its_ways_and_its_test() {
    let document = documented::read(&documented::root().join("docs/families/gremsy.md"));
    let known = documented::tests();
    let details = serde_json::to_value(GimbalDetails::default()).expect("it is JSON");
    let mut problems = Vec::new();
    for function in GREMSY_FUNCTIONS {
        let rows: Vec<&str> = document.lines().filter(|line| line.starts_with(&format!("| `{function}` |"))).collect();
        let [row] = rows[..] else {
            problems.push(format!("{function} has {} rows", rows.len()));
            continue;
        };
        let cells: Vec<&str> = row.trim_matches('|').split('|').map(str::trim).collect();
        let [_, mavlink, http, command, wire, tests] = cells[..] else {
            problems.push(format!("{function} has {} cells", cells.len()));
            continue;
        };
        if [mavlink, http, command, wire, tests].iter().any(|cell| cell.is_empty()) {
            problems.push(format!("{function} has an empty cell"));
        }
        let is_posted = http.starts_with("`POST`");
        for name in documented::quoted(http).iter().filter(|name| !matches!(name.as_str(), "GET" | "POST")) {
            let is_path = ACTIONS.iter().any(|action| action.path == name);
            let is_read = matches!(name.as_str(), "state" | "details" | "attitude" | "healthz" | "running" | "age_ms")
                || details.get(name).is_some();
            if is_posted && !is_path || !is_posted && !is_read {
                problems.push(format!("{function}: nothing over HTTP is called {name}"));
            }
        }
        for name in documented::quoted(command) {
            let is_known = name == "gimbald status" || ACTIONS.iter().any(|action| action.command == name);
            if !is_known {
                problems.push(format!("{function}: there is no command {name}"));
            }
        }
        let named = documented::quoted(tests);
        let unknown = named.iter().filter(|name| !known.contains_key(*name));
        problems.extend(unknown.map(|name| format!("{function}: there is no test {name}")));
        if named.is_empty() {
            problems.push(format!("{function} names no test"));
        }
    }
    assert_none("docs/families/gremsy.md", &problems);
}

fn rows(document: &str) -> Vec<Row> {
    documented::rows(document, |text| text.parse().ok().map(Rule::Statement))
}
