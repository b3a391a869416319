//! What each key may be.

use super::*;

/// Client checklist E5: "Configuring M as 1, as 0 … is refused or warned at start."
#[test]
fn numbers_have_ranges_and_kinds() {
    for (line, problem) in [
        ("setpoint_rate_hz = 4", "found 4; expected a whole number from 5 to 50"),
        ("setpoint_rate_hz = 51", "found 51; expected a whole number from 5 to 50"),
        ("setpoint_rate_hz = 20.0", "found 20.0; expected a whole number from 5 to 50"),
        ("setpoint_rate_hz = \"20\"", "found \"20\"; expected a whole number from 5 to 50"),
        ("component_id = 6", "found 6; expected a whole number from 7 to 255"),
        ("component_id = 256", "found 256; expected a whole number from 7 to 255"),
        ("manager_component_id = 0", "found 0; expected a whole number from 7 to 255"),
        ("manager_component_id = 1", "found 1; expected a whole number from 7 to 255"),
        ("component_id = 99999999999999999999", "found 99999999999999999999; expected a whole number from 7 to 255"),
        ("manual_yaw_rate_dps = 0", "found 0; expected a number of degrees per second from 0.1 to 720"),
        ("manual_yaw_rate_dps = nan", "found NaN; expected a number of degrees per second from 0.1 to 720"),
        ("manual_pitch_rate_dps = inf", "found inf; expected a number of degrees per second from 0.1 to 720"),
        ("takeover = \"polite\"", "found \"polite\"; expected open, ask, priority or exclusive"),
        ("takeover = true", "found true; expected open, ask, priority or exclusive"),
        ("device_yaw_frame = \"erath\"", "found \"erath\"; expected auto, vehicle or earth; did you mean earth?"),
        (
            "v1_sign = \"negated\"",
            "found \"negated\"; expected normal or reversed, or a table such as { pitch = -1, yaw = -1 }",
        ),
        ("v1_sign = { pitch = -2 }", "found a table; expected 1 or -1 for pitch, not -2"),
        ("v1_sign = { pitch = 0 }", "found a table; expected 1 or -1 for pitch, not 0"),
        ("v1_sign = { pitch = \"-1\" }", "found a table; expected 1 or -1 for pitch, not \"-1\""),
        ("v1_report_sign = { tilt = -1 }", "found a table; expected roll, pitch or yaw in the place of tilt"),
        (
            "v1_report_sign = { pitch = -2, yow = 1, roll = 4 }",
            "found a table; expected 1 or -1 for pitch, not -2; 1 or -1 for roll, not 4; roll, pitch or yaw in the place \
             of yow; did you mean yaw?",
        ),
        ("v1_report_sign = -1", "found -1; expected normal or reversed, or a table such as { pitch = -1, yaw = -1 }"),
        ("v1_status = 10", "found 10; expected true or false"),
        ("v1_configure = \"px4\"", "found \"px4\"; expected true or false"),
        ("v1_radio_control = \"mod\"", "found \"mod\"; expected none, silence or mode; did you mean mode?"),
        ("family = \"siyi\"", "found \"siyi\"; expected auto, mavlink_v2, mavlink_v1 or gremsy"),
        (
            "gremsy_report_sign = \"up\"",
            "found \"up\"; expected auto, normal or reversed, or a table such as { pitch = -1, yaw = -1 }",
        ),
        ("gremsy_generation = \"v3\"", "found \"v3\"; expected auto, v1 or v2; did you mean v1?"),
        ("retract_allowed = 1", "found 1; expected true or false"),
        ("stow_pitch_deg = 91", "found 91; expected a number of degrees from -90 to 90"),
        ("stow_yaw_deg = -181", "found -181; expected a number of degrees from -180 to 180"),
        ("link = 1", "found 1; expected the name of a link as text"),
    ] {
        let (key, _) = line.split_once(' ').expect("key and value");
        assert_refused(
            &format!("[[gimbal]]\nname = \"camera\"\n{line}\n"),
            &[&format!("c.toml:7: gimbal.camera.{key}: {problem}")],
        );
    }
    for (line, problem) in [
        ("lease_timeout_s = 0", "found 0; expected a number of seconds from 0.001 to 3600"),
        ("lease_timeout_s = 3600.1", "found 3600.1; expected a number of seconds from 0.001 to 3600"),
        ("rate_timeout_s = 1e-9", "found 1e-9; expected a number of seconds from 0.001 to 3600"),
        ("command_rate_timeout_s = -1", "found -1; expected a number of seconds from 0.001 to 3600, or 0 for never"),
        ("unclaimed = \"close\"", "found \"close\"; expected open or closed; did you mean closed?"),
        ("firewall = \"off\"", "found \"off\"; expected on or warn"),
        ("snoop_autopilot = \"true\"", "found \"true\"; expected true or false"),
        ("accept_centidegrees = 100", "found 100; expected true or false"),
        ("px4_release_quirk = 1979-05-27", "found a date; expected true or false"),
        ("synthesize_286 = true", "found true; expected auto or off"),
        ("synthesize_286 = \"on\"", "found \"on\"; expected auto or off"),
    ] {
        let (key, _) = line.split_once(' ').expect("key and value");
        assert_refused(&format!("[control]\n{line}\n"), &[&format!("c.toml:6: control.{key}: {problem}")]);
    }
    for line in ["281 = 1e-300", "281 = 1e9", "281 = -1", "281 = \"4\"", "281 = nan"] {
        let outcome = check(&format!("{LINK}max_rate_hz = {{ {line} }}\n"), &[]);
        assert!(outcome.errors.ends_with("; expected a number of messages per second from 0.001 to 1000\n"), "{line}");
    }
    for id in ["16777216", "-1", "0281", "\"\""] {
        let outcome = check(&format!("{LINK}max_rate_hz = {{ {id} = 1 }}\n"), &[]);
        assert!(outcome.errors.ends_with("; expected a message id from 0 to 16777215 as the key\n"), "{id}");
    }
}

/// "Bad input gets a clear error naming the place and the remedy": a key that another family has is not passed over.
#[test]
fn keys_of_another_family_are_refused() {
    let entry = |family: &str, lines: &str| format!("[[gimbal]]\nname = \"a\"\nfamily = \"{family}\"\n{lines}");
    let of_v1 = "v1_sign = \"reversed\"\nv1_configure = true\n";
    let of_gremsy = "gremsy_generation = \"v1\"\nretract_allowed = true\n";
    for (family, lines) in [("mavlink_v1", of_v1), ("gremsy", of_gremsy), ("auto", of_v1), ("auto", of_gremsy)] {
        assert_eq!(check(&format!("{LINK}{}", entry(family, lines)), &[]).code, Some(0), "{family} {lines}");
    }
    for (family, lines, other, found) in [
        ("mavlink_v2", of_gremsy, "gremsy", [("gremsy_generation", "\"v1\""), ("retract_allowed", "true")]),
        ("mavlink_v1", of_gremsy, "gremsy", [("gremsy_generation", "\"v1\""), ("retract_allowed", "true")]),
        ("gremsy", of_v1, "mavlink_v1", [("v1_sign", "\"reversed\""), ("v1_configure", "true")]),
        ("mavlink_v2", of_v1, "mavlink_v1", [("v1_sign", "\"reversed\""), ("v1_configure", "true")]),
    ] {
        let lines_told: Vec<String> = (8..)
            .zip(found)
            .map(|(line, (key, value))| {
                format!(
                    "c.toml:{line}: gimbal.a.{key}: found {value}, which has no effect with family = \"{family}\"; \
                     expected family = \"{other}\" or \"auto\", or no such key"
                )
            })
            .collect();
        assert_refused(&entry(family, lines), &lines_told.iter().map(String::as_str).collect::<Vec<_>>());
    }
}

/// What was found is shown up to 60 characters; what is longer ends with `…` behind them.
#[test]
fn long_values_keys_and_names_are_shown_by_their_beginning() {
    let quoted = |length: usize| format!("\"{}\"", "ä".repeat(length - 2));
    let cut = format!("\"{}…", "ä".repeat(59));
    for (value, shown) in [
        (quoted(60), quoted(60)),
        (quoted(61), cut.clone()),
        (quoted(500_000), cut.clone()),
        ("9".repeat(1_000_000), format!("{}…", "9".repeat(60))),
    ] {
        assert_eq!(
            check(&format!("{LINK}[control]\nfirewall = {value}\n"), &[]),
            refused(&[&format!("c.toml:6: control.firewall: found {shown}; expected on or warn")]),
        );
    }
    assert_eq!(
        check(LINK, &[("GIMBALD__CONTROL__FIREWALL", &"ä".repeat(50_000))]),
        refused(&[&format!("GIMBALD__CONTROL__FIREWALL: control.firewall: found {cut}; expected on or warn")]),
    );
    let (long, shown) = ("x".repeat(400_000), format!("{}…", "x".repeat(60)));
    assert_eq!(
        check(&format!("{LINK}[http]\n{long} = 1\n"), &[]),
        refused(&[&format!("c.toml:6: http.{shown}: unknown key; expected one of listen, token_file")]),
    );
    assert_eq!(
        check(
            &format!(
                "{}role = 1\n[[gimbal]]\nname = \"g\"\nlink = \"y\"\n",
                LINK.replace("\"ground\"\nrole = \"ground\"", &format!("\"{long}\""))
            ),
            &[]
        ),
        refused(&[&format!(
            "c.toml:4: link.{shown}.role: found 1; expected gimbal, autopilot, ground or peer\n\
                  c.toml:7: gimbal.g.link: found \"y\"; expected the name of a link, one of {shown}"
        )]),
    );
    // A long name is not compared with another long one.
    assert_eq!(
        check(
            &format!(
                "{}[[gimbal]]\nname = \"g\"\nlink = \"{long}y\"\n",
                LINK.replace("\"ground\"\nrole", &format!("\"{long}\"\nrole"))
            ),
            &[]
        ),
        refused(&[&format!(
            "c.toml:7: gimbal.g.link: found \"{}…; expected the name of a link, one of {shown}",
            "x".repeat(59)
        )])
    );
}

#[test]
fn endpoints_say_what_is_wrong_with_them() {
    for (endpoint, expected) in [
        ("serial:/dev/ttyUSB0", "serial:PATH:BAUD, for example serial:/dev/ttyUSB0:115200"),
        (
            "udpout:gcs.local:14550",
            "an IP address and a port behind the first colon, for example 127.0.0.1:14550 or [::1]:14550",
        ),
        ("udpout:10.0.0.1:0", "a port from 1 to 65535"),
        ("tcp:10.0.0.1:1", "KIND:… with KIND one of serial, udpin, udpout, udpbcast, tcpin, tcpout"),
    ] {
        let outcome = check(&LINK.replace("udpin:0.0.0.0:14550", endpoint), &[]);
        let line = format!("c.toml:4: link.ground.endpoint: found \"{endpoint}\"; expected {expected}");
        assert_eq!(outcome, refused(&[&line]));
    }
}

/// "mode 0600": a token that is missing, empty, readable by others or somebody else's is refused, and never shown.
#[test]
fn a_token_that_is_no_secret_is_refused() {
    let (_folder, token) = token_file();
    let path = token.display();
    let text = format!("[http]\ntoken_file = \"{path}\"\n");
    let refusal = |what: &str| {
        format!(
            "c.toml:6: http.token_file: found \"{path}\", which {what}; expected a file with one word of 16 to 256 characters that only the user who runs gimbald can read: openssl rand -hex 32, chown gimbald, chmod 0600"
        )
    };
    for (mode, right) in [(0o600, true), (0o400, true), (0o640, false), (0o604, false), (0o666, false)] {
        fs::set_permissions(&token, fs::Permissions::from_mode(mode)).expect("our own file");
        if right {
            assert_eq!(check(&format!("{LINK}{text}"), &[]).code, Some(0), "{mode:o}");
        } else {
            assert_refused(&text, &[&refusal(&format!("has mode {mode:04o}, so that others can read or change it"))]);
        }
    }
    fs::set_permissions(&token, fs::Permissions::from_mode(0o600)).expect("our own file");
    for (content, what) in
        [("\n", "is empty"), ("short", "does not hold one word of 16 to 256 printable ASCII characters")]
    {
        fs::write(&token, content).expect("our own file");
        assert_refused(&text, &[&refusal(what)]);
    }
    fs::remove_file(&token).expect("our own file");
    assert_refused(&text, &[&refusal("cannot be read: No such file or directory (os error 2)")]);
    assert_refused(
        "[http]\ntoken_file = \"token\"\n",
        &[
            "c.toml:6: http.token_file: found \"token\"; expected an absolute path as text, for example \"/etc/gimbald/http-token\"",
        ],
    );
    assert_refused(
        "[http]\nlisten = \"\"\n",
        &[
            "c.toml:6: http.listen: found \"\"; expected an IP address and a port as text, for example \"127.0.0.1:8080\"",
        ],
    );
}

/// A device can be presented only to an autopilot, and only where no manager of ours has its component id.
#[test]
fn a_device_that_cannot_be_presented_is_a_problem() {
    assert_refused(
        "[autopilot]\npresent_device = true\n[[gimbal]]\nname = \"camera\"\nfamily = \"mavlink_v1\"\n\
         manager_component_id = 154\n",
        &[
            "c.toml:6: autopilot.present_device: found true; expected false, or a link of role autopilot",
            "c.toml:10: gimbal.camera.manager_component_id: found 154, which is a gimbal device's id; expected a component id from 7 to 255 that nobody else on the vehicle has, for example 195",
        ],
    );
}
