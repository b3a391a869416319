//! Variables of the environment in the place of keys.

use gimbald::bridge::settings::Role;

use super::*;

#[test]
fn names_can_be_written_in_a_variable() {
    assert_refused(
        "[[gimbal]]\nname = \"nose cam\"\n[[gimbal]]\nname = \"\"\n[[gimbal]]\nname = 7\n",
        &[
            "c.toml:6: gimbal.name: found \"nose cam\"; expected a name of letters, digits, - and _",
            "c.toml:8: gimbal.name: found \"\"; expected a name of letters, digits, - and _",
            "c.toml:10: gimbal.name: found 7; expected a name of letters, digits, - and _",
        ],
    );
    assert_refused(
        "[[gimbal]]\nname = \"nose-cam\"\n[[gimbal]]\nname = \"Nose_Cam\"\n",
        &[
            r#"c.toml:8: gimbal.Nose_Cam.name: found "Nose_Cam", the name in line 6; expected a name that differs from all others in more than case and - or _"#,
        ],
    );
}

#[test]
fn a_wrong_variable_is_named() {
    let variables = [
        ("GIMBALD__CONTROL__FIREWALL", "maybe"),
        ("GIMBALD__CONTROL__LEASE_TIMEOT_S", "1"),
        ("GIMBALD__HTPP__LISTEN", "127.0.0.1:1"),
        ("GIMBALD__LINK__GROUND__MAX_RATE_HZ", "{}"),
        ("GIMBALD__LINK__GROUND__NAME", "sky"),
        ("GIMBALD__LINK__GRUND__ENDPOINT", "udpin:0.0.0.0:1"),
        ("GIMBALD__GIMBAL__CAMERA__TAKEOVER", "ask"),
        ("GIMBALD__VEHICLE", "1"),
        ("GIMBALD__VEHICLE__SYSTEM_ID", "300"),
        ("GIMBALD_LOG", "no concern of ours"),
    ];
    const KINDS: &str = "GIMBALD__SECTION__KEY with VEHICLE, AUTOPILOT, CONTROL, ROI or HTTP, or \
                         GIMBALD__LINK__NAME__KEY, or GIMBALD__GIMBAL__NAME__KEY";
    let lines = [
        r#"GIMBALD__CONTROL__FIREWALL: control.firewall: found "maybe"; expected on or warn"#,
        "GIMBALD__CONTROL__LEASE_TIMEOT_S: control.lease_timeot_s: unknown key; expected one of unclaimed, lease_timeout_s, rate_timeout_s, command_rate_timeout_s, firewall, snoop_autopilot, accept_centidegrees, px4_release_quirk, synthesize_286; did you mean lease_timeout_s?",
        "GIMBALD__GIMBAL__CAMERA__TAKEOVER: no gimbal in the file; expected a variable of a gimbal that the file has",
        &format!("GIMBALD__HTPP__LISTEN: an unknown variable; expected {KINDS}; did you mean GIMBALD__HTTP__?"),
        "GIMBALD__LINK__GROUND__MAX_RATE_HZ: link.ground.max_rate_hz: a variable for a table; expected it to be set in the file",
        "GIMBALD__LINK__GROUND__NAME: a variable for a name; expected names to be set in the file",
        r#"GIMBALD__LINK__GRUND__ENDPOINT: no link named "grund" in the file; expected one of ground; did you mean ground?"#,
        &format!("GIMBALD__VEHICLE: an unknown variable; expected {KINDS}"),
        r#"GIMBALD__VEHICLE__SYSTEM_ID: vehicle.system_id: found "300"; expected "auto" or a whole number from 1 to 255"#,
    ];
    assert_eq!(check(LINK, &variables), refused(&lines));
}

/// What is recommended is possible there.
#[test]
fn a_variable_is_not_told_of_tables() {
    let gimbal = format!("{LINK}[[gimbal]]\nname = \"camera\"\nfamily = \"mavlink_v1\"\n");
    let variables = [("GIMBALD__GIMBAL__CAMERA__V1_SIGN", "{ pitch = -1 }")];
    let line = r#"GIMBALD__GIMBAL__CAMERA__V1_SIGN: gimbal.camera.v1_sign: found "{ pitch = -1 }"; expected normal or reversed (signs of single axes can be set in the file)"#;
    assert_eq!(check(&gimbal, &variables), refused(&[line]));
}

/// A name may hold the `__` that separates the parts of a variable, and `_` beside it.
#[test]
fn variables_reach_names_with_underscores() {
    for (name, variable) in [
        ("a_", "GIMBALD__LINK__A___ROLE"),
        ("nose__cam", "GIMBALD__LINK__NOSE__CAM__ROLE"),
        ("nose--cam", "GIMBALD__LINK__NOSE__CAM__ROLE"),
    ] {
        let text =
            format!("{}{LINK}", LINK.replace("\"ground\"\nrole", &format!("{name:?}\nrole")).replace("14550", "1"));
        let loaded = load(&text, &[(variable, "peer")]).expect(variable);
        let roles: Vec<Role> = loaded.core.links.iter().map(|link| link.role).collect();
        assert_eq!(roles, [Role::Peer, Role::Ground], "{name}");
        assert_eq!(
            check(&text, &[(&variable.replace("ROLE", "NAME"), "x"), (&variable.replace("ROLE", "COLOUR"), "x")])
                .errors,
            format!(
                "{}: link.{name}.colour: unknown key; expected one of name, role, endpoint, max_rate_hz\n\
                 {}: a variable for a name; expected names to be set in the file\n",
                variable.replace("ROLE", "COLOUR"),
                variable.replace("ROLE", "NAME")
            )
        );
    }
}

/// What looks like a number or a flag stays what was written until a setting asks for it.
#[test]
fn variables_are_taken_as_what_their_setting_is() {
    let text = format!(
        "{}{LINK}[[gimbal]]\nname = \"camera\"\n",
        LINK.replace("\"ground\"\nrole", "\"007\"\nrole").replace("14550", "1")
    );
    let loaded = load(&text, &[("GIMBALD__GIMBAL__CAMERA__LINK", "007")]).expect("the name of a link");
    assert_eq!(loaded.core.gimbals[0].link, Some(0));
    let variables = [("GIMBALD__CONTROL__SNOOP_AUTOPILOT", "TRUE"), ("GIMBALD__VEHICLE__SYSTEM_ID", "yes")];
    let lines = [
        r#"GIMBALD__CONTROL__SNOOP_AUTOPILOT: control.snoop_autopilot: found "TRUE"; expected true or false"#,
        r#"GIMBALD__VEHICLE__SYSTEM_ID: vehicle.system_id: found "yes"; expected "auto" or a whole number from 1 to 255"#,
    ];
    assert_eq!(check(LINK, &variables), refused(&lines));
}

/// Every key of every section is read from a variable as it is from the file.
#[test]
fn variables_override_the_file() {
    let (_folder, token) = token_file();
    let token = token.to_str().expect("a path in UTF-8");
    let variables = [
        ("GIMBALD__LINK__Ground__ROLE", "ground"),
        ("GIMBALD__LINK__GROUND__ENDPOINT", "udpbcast:10.0.0.255:14550"),
        ("GIMBALD__GIMBAL__NOSE_CAM__LINK", "ground"),
        ("GIMBALD__GIMBAL__NOSE_CAM__FAMILY", "auto"),
        ("GIMBALD__GIMBAL__NOSE_CAM__COMPONENT_ID", "171"),
        ("GIMBALD__GIMBAL__nose_cam__MANAGER_COMPONENT_ID", "200"),
        ("GIMBALD__GIMBAL__NOSE-CAM__TAKEOVER", "ask"),
        ("GIMBALD__GIMBAL__NOSE_CAM__SETPOINT_RATE_HZ", "30"),
        ("GIMBALD__GIMBAL__NOSE_CAM__DEVICE_YAW_FRAME", "earth"),
        ("GIMBALD__GIMBAL__NOSE_CAM__V1_SIGN", "reversed"),
        ("GIMBALD__GIMBAL__NOSE_CAM__V1_REPORT_SIGN", "reversed"),
        ("GIMBALD__GIMBAL__NOSE_CAM__V1_CONFIGURE", "true"),
        ("GIMBALD__GIMBAL__NOSE_CAM__V1_RADIO_CONTROL", "mode"),
        ("GIMBALD__GIMBAL__NOSE_CAM__V1_STATUS", "true"),
        ("GIMBALD__GIMBAL__NOSE_CAM__GREMSY_GENERATION", "v1"),
        ("GIMBALD__GIMBAL__NOSE_CAM__GREMSY_REPORT_SIGN", "reversed"),
        ("GIMBALD__GIMBAL__NOSE_CAM__RETRACT_ALLOWED", "true"),
        ("GIMBALD__GIMBAL__NOSE_CAM__STOW_PITCH_DEG", "-45"),
        ("GIMBALD__GIMBAL__NOSE_CAM__STOW_YAW_DEG", "90"),
        ("GIMBALD__GIMBAL__NOSE_CAM__MANUAL_PITCH_RATE_DPS", "12.5"),
        ("GIMBALD__GIMBAL__NOSE_CAM__MANUAL_YAW_RATE_DPS", "45"),
        ("GIMBALD__VEHICLE__SYSTEM_ID", "7"),
        ("GIMBALD__AUTOPILOT__PRESENT_DEVICE", "true"),
        ("GIMBALD__CONTROL__UNCLAIMED", "closed"),
        ("GIMBALD__CONTROL__LEASE_TIMEOUT_S", "3"),
        ("GIMBALD__CONTROL__RATE_TIMEOUT_S", "0.5"),
        ("GIMBALD__CONTROL__COMMAND_RATE_TIMEOUT_S", "0"),
        ("GIMBALD__CONTROL__FIREWALL", "warn"),
        ("GIMBALD__CONTROL__SNOOP_AUTOPILOT", "true"),
        ("GIMBALD__CONTROL__ACCEPT_CENTIDEGREES", "true"),
        ("GIMBALD__CONTROL__PX4_RELEASE_QUIRK", "true"),
        ("GIMBALD__CONTROL__SYNTHESIZE_286", "off"),
        ("GIMBALD__ROI__ALTITUDE_REFERENCE", "amsl"),
        ("GIMBALD__HTTP__LISTEN", "[::1]:9090"),
        ("GIMBALD__HTTP__TOKEN_FILE", token),
    ];
    let bare = r#"
[[link]]
name = "nose"
role = "gimbal"
endpoint = "serial:/dev/ttyUSB0:57600"
[[link]]
name = "autopilot"
role = "autopilot"
endpoint = "tcpin:127.0.0.1:5760"
[[link]]
name = "ground"
role = "peer"
endpoint = "udpin:0.0.0.0:1"
max_rate_hz = { 285 = 4, 281 = 0.5 }
[[gimbal]]
name = "nose-cam"
family = "mavlink_v2"
takeover = "open"
"#;

    let from_file = load(&EVERY_KEY.replace("/nowhere/token", token), &[]).expect("a right file");
    let from_variables = load(bare, &variables).expect("right variables");

    assert_eq!(from_variables, from_file);
    // Every key that a variable can set is in the list above.
    let names: Vec<String> = variables.iter().map(|(name, _)| name.to_uppercase()).collect();
    for (section, keys) in config::schema::keys() {
        for key in keys.into_iter().filter(|key| !matches!(*key, "name" | "max_rate_hz")) {
            let covered = names.iter().any(|name| {
                name.starts_with(&format!("GIMBALD__{}__", section.to_uppercase()))
                    && name.ends_with(&format!("__{}", key.to_uppercase()))
            });
            assert!(covered, "{section}.{key}");
        }
    }
}
