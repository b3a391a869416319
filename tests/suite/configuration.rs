//! What `gimbald check` says of wrong configurations, word for word.

use std::fs;
use std::os::unix::fs::{PermissionsExt, symlink};
use std::os::unix::net::UnixListener;
use std::path::Path;
use std::time::Duration;

use nix::sys::stat::Mode;
use nix::unistd::mkfifo;

use gimbald::bridge::settings::{LinkSettings, Role, Settings, SystemId, Transport};
use gimbald::config::settings::{DaemonSettings, Directories, HttpSettings};
use gimbald::config::{self, problem::Problems};
use gimbald::geometry::Angle;
use gimbald::gimbals::gremsy::config::GremsySettings;
use gimbald::gimbals::gremsy::driver::Generation;
use gimbald::gimbals::mavlink_v1::config::{V1RadioControl, V1Settings};
use gimbald::gimbals::settings::{DeviceYawFrame, Family, GimbalSettings, Takeover};
use gimbald::gimbals::signs::{Sign, Signs};
use gimbald::manager::settings::{AltitudeReference, ControlSettings, Firewall};

use crate::gimbald::{Outcome, gimbald};

/// A link, so that what is wrong is what the test is about.
const LINK: &str = "[[link]]\nname = \"ground\"\nrole = \"ground\"\nendpoint = \"udpin:0.0.0.0:14550\"\n";

fn check(text: &str, variables: &[(&str, &str)]) -> Outcome {
    let folder = tempfile::tempdir().expect("a temporary folder");
    fs::write(folder.path().join("c.toml"), text).expect("a writable folder");
    gimbald(folder.path(), &["check", "--config", "c.toml"], variables)
}

fn refused(lines: &[&str]) -> Outcome {
    Outcome { code: Some(78), output: String::new(), errors: lines.iter().map(|line| format!("{line}\n")).collect() }
}

/// `LINK` with `text` behind it (so that `text` begins in line 5) is refused with exactly these lines.
#[track_caller]
fn assert_refused(text: &str, lines: &[&str]) {
    assert_eq!(check(&format!("{LINK}{text}"), &[]), refused(lines), "{text}");
}

#[test]
fn a_right_file_is_summed_up_in_one_line() {
    let outcome = check(LINK, &[]);
    let output = "c.toml: ok; links: ground (udpin:0.0.0.0:14550); gimbals: those that are found; page: \
                  http://127.0.0.1:8080\n";
    assert_eq!(outcome, Outcome { code: Some(0), output: output.to_owned(), errors: String::new() });
}

/// "every problem at once with file, line, key, what was expected".
#[test]
fn every_problem_of_a_file_is_reported_at_once_in_the_order_of_its_lines() {
    let text = r#"[vehicle]
system_id = 0

[[link]]
name = "gimbal"
role = "gimabl"
endpoint = "serial:/dev/serial0:fast"

[[link]]
name = "ground"
role = "ground"
endpoint = "udpot:192.168.1.255:14550"
max_rate_hz = { 285 = 4, 281 = 0, foo = 1 }
colour = 1

[[link]]
name = "Gimbal"

[[gimbal]]
name = "camera"
link = "gimbl"
family = "mavlink_v3"

[htp]

[control]
lease_timeout_s = -1
"#;
    let lines = [
        r#"c.toml:2: vehicle.system_id: found 0; expected "auto" or a whole number from 1 to 255"#,
        r#"c.toml:6: link.gimbal.role: found "gimabl"; expected gimbal, autopilot, ground or peer; did you mean gimbal?"#,
        r#"c.toml:7: link.gimbal.endpoint: found "serial:/dev/serial0:fast"; expected a baud rate from 1200 to 4000000 behind the last colon"#,
        r#"c.toml:12: link.ground.endpoint: found "udpot:192.168.1.255:14550"; expected KIND:… with KIND one of serial, udpin, udpout, udpbcast, tcpin, tcpout; did you mean udpout?"#,
        "c.toml:13: link.ground.max_rate_hz.281: found 0; expected a number of messages per second from 0.001 to 1000",
        "c.toml:13: link.ground.max_rate_hz.foo: found 1; expected a message id from 0 to 16777215 as the key",
        "c.toml:14: link.ground.colour: unknown key; expected one of name, role, endpoint, max_rate_hz",
        "c.toml:16: link.Gimbal.role: missing; expected gimbal, autopilot, ground or peer",
        "c.toml:16: link.Gimbal.endpoint: missing; expected an endpoint, for example udpin:0.0.0.0:14550",
        r#"c.toml:17: link.Gimbal.name: found "Gimbal", the name in line 5; expected a name that differs from all others in more than case and - or _"#,
        r#"c.toml:21: gimbal.camera.link: found "gimbl"; expected the name of a link, one of gimbal, ground, Gimbal; did you mean gimbal?"#,
        r#"c.toml:22: gimbal.camera.family: found "mavlink_v3"; expected auto, mavlink_v2, mavlink_v1 or gremsy; did you mean mavlink_v2?"#,
        "c.toml:24: htp: unknown key; expected one of vehicle, link, gimbal, autopilot, control, roi, http; did you mean http?",
        "c.toml:27: control.lease_timeout_s: found -1; expected a number of seconds from 0.001 to 3600",
    ];
    assert_eq!(check(text, &[]), refused(&lines));
}

#[test]
fn a_file_that_is_no_toml_has_one_problem() {
    for (text, line) in [
        ("[vehicle\nx = 1", "c.toml:1: not TOML; expected a TOML file, but: unclosed table, expected `]`"),
        ("[http]\na = 1\na = 2\n", "c.toml:3: not TOML; expected a TOML file, but: duplicate key"),
        (
            "\n\nrole = ground",
            "c.toml:3: not TOML; expected a TOML file, but: string values must be quoted, expected literal string",
        ),
    ] {
        assert_eq!(check(text, &[("GIMBALD__NONSENSE", "1")]), refused(&[line]), "{text}");
    }
}

#[test]
fn a_file_that_cannot_be_read_is_a_problem_of_the_configuration() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let check = |name| gimbald(folder.path(), &["check", "--config", name], &[]);
    fs::write(folder.path().join("latin1.toml"), b"# a\n# caf\xe9\n").expect("a writable folder");

    assert_eq!(
        check("absent.toml"),
        refused(&["absent.toml: no such file; expected a readable TOML file: name it with --config, or install \
             config/gimbald.toml there"])
    );
    assert_eq!(
        check("latin1.toml"),
        refused(&["latin1.toml:2: a byte that is not UTF-8; expected a TOML file in UTF-8"])
    );
}

/// A FIFO would wait for a writer, and `/dev/zero` never ends.
#[test]
fn only_a_regular_file_of_at_most_1_mib_is_read() {
    const EXPECTED: &str = "expected a regular file, in TOML, of at most 1 MiB";
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = |name| folder.path().join(name);
    let check = |name| gimbald(folder.path(), &["check", "--config", name], &[]);
    fs::create_dir(path("folder")).expect("a writable folder");
    mkfifo(&path("fifo"), Mode::S_IRUSR | Mode::S_IWUSR).expect("a writable folder");
    let _socket = UnixListener::bind(path("socket")).expect("a writable folder");
    symlink("/dev/zero", path("link-to-zero")).expect("a writable folder");
    let filled_to = |len: usize| format!("{LINK}#{}", "x".repeat(len - LINK.len() - 1));
    fs::write(path("large"), filled_to(1_048_576)).expect("a writable folder");
    fs::write(path("too-large"), filled_to(1_048_577)).expect("a writable folder");

    for (name, found) in [
        ("folder", "a directory"),
        ("fifo", "a FIFO"),
        ("socket", "a socket"),
        ("/dev/zero", "a device"),
        ("link-to-zero", "a device"),
        ("too-large", "larger than 1 MiB"),
    ] {
        assert_eq!(check(name), refused(&[&format!("{name}: {found}; {EXPECTED}")]));
    }
    assert_eq!(check("large").code, Some(0));
}

#[test]
fn wrong_arguments_are_usage_errors_and_never_reach_the_configuration() {
    for arguments in [&["chek"][..], &["check", "--log", "gimbald=loud"], &["check", "c.toml"], &["sim"], &[]] {
        let outcome = gimbald(Path::new("/"), arguments, &[]);
        assert_eq!((outcome.code, outcome.output.as_str()), (Some(64), ""), "{arguments:?}");
        assert!(outcome.errors.contains("--help"), "{}", outcome.errors);
    }
}

#[test]
fn a_file_without_a_link_has_nothing_to_do() {
    let missing = "c.toml: link: missing; expected at least one [[link]] with name, role and endpoint";
    for text in ["", "[http]\n", "link = []\n"] {
        assert_eq!(check(text, &[]), refused(&[missing]), "{text:?}");
    }
}

/// The core has 64 channels, and each peer of a link takes one.
#[test]
fn there_are_at_most_32_links() {
    let links = |count: usize| -> String {
        let link = |number| {
            format!("[[link]]\nname = \"l{number}\"\nrole = \"peer\"\nendpoint = \"udpin:0.0.0.0:{number}\"\n")
        };
        (1..=count).map(link).collect()
    };
    assert_eq!(check(&links(32), &[]).code, Some(0));
    for count in [33, 80] {
        let line = format!("c.toml:129: link: link 33 of {count}; expected at most 32 links");
        assert_eq!(check(&links(count), &[]), refused(&[&line]));
    }
    // A gimbal on a link that is one too many has no problem of its own.
    let text = format!("{}[[gimbal]]\nname = \"camera\"\nlink = \"l33\"\n", links(33));
    assert_eq!(check(&text, &[]), refused(&["c.toml:129: link: link 33 of 33; expected at most 32 links"]));
}

#[test]
fn a_section_of_the_wrong_kind_is_said_to_be_one() {
    for (text, line) in [
        ("[link]\nname = \"x\"\n", "c.toml:1: link: found a table; expected one or more tables [[link]]"),
        ("link = [1]\n", "c.toml:1: link: found 1; expected one or more tables [[link]]"),
    ] {
        assert_eq!(check(text, &[]), refused(&[line]), "{text}");
    }
    assert_refused("[[http]]\n", &["c.toml:5: http: found an array; expected a table [http]"]);
    assert_eq!(
        check(&format!("http = 1\n{LINK}"), &[("GIMBALD__HTTP__LISTEN", "127.0.0.1:1")]),
        refused(&["c.toml:1: http: found 1; expected a table [http]"])
    );
}

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

/// "a fifth needs `manager_component_id`".
/// Client checklist E5: "Configuring M … as 100–105 is refused", and as a device.
#[test]
fn managers_have_ids_of_their_own() {
    const EXPECTED: &str = "expected a component id from 7 to 255 that nobody else on the vehicle has, for example 195";
    let gimbals = |ids: &[Option<u8>]| -> String {
        let entry = |(number, id): (usize, &Option<u8>)| match id {
            Some(id) => format!("[[gimbal]]\nname = \"g{number}\"\nmanager_component_id = {id}\n"),
            None => format!("[[gimbal]]\nname = \"g{number}\"\n"),
        };
        ids.iter().enumerate().map(entry).collect()
    };
    let four = [None; 4];
    assert_eq!(check(&format!("{LINK}{}", gimbals(&four)), &[]).code, Some(0));
    assert_refused(
        &gimbals(&[None; 5]),
        &[&format!("c.toml:13: gimbal.g4.manager_component_id: missing, and 191 to 194 are taken; {EXPECTED}")],
    );
    assert_eq!(check(&format!("{LINK}{}", gimbals(&[None, None, None, None, Some(195)])), &[]).code, Some(0));
    assert_refused(
        &gimbals(&[Some(192), None, None, None, None]),
        &[&format!("c.toml:14: gimbal.g4.manager_component_id: missing, and 191 to 194 are taken; {EXPECTED}")],
    );
    for (id, owner) in
        [(100, "a camera's"), (105, "a camera's"), (154, "a gimbal device's"), (175, "a gimbal device's")]
    {
        assert_refused(
            &gimbals(&[Some(id)]),
            &[&format!("c.toml:7: gimbal.g0.manager_component_id: found {id}, which is {owner} id; {EXPECTED}")],
        );
    }
    assert_refused(
        &gimbals(&[Some(200), Some(200)]),
        &[&format!(
            "c.toml:10: gimbal.g1.manager_component_id: found 200, which another gimbal's manager has; {EXPECTED}"
        )],
    );
}

/// Device ids 1 to 6 are for gimbals that are no v2 devices; their manager may have the component id of a gimbal, and they
/// know no yaw from North.
#[test]
fn gimbals_that_are_no_v2_devices_have_numbers() {
    let entry = |number: usize| {
        let manager = 200 + number;
        format!("[[gimbal]]\nname = \"g{number}\"\nfamily = \"mavlink_v1\"\nmanager_component_id = {manager}\n")
    };
    let entries = |count: usize| (0..count).map(entry).collect::<String>();
    assert_eq!(check(&format!("{LINK}{}", entries(6)), &[]).code, Some(0));
    assert_refused(
        &entries(7),
        &["c.toml:31: gimbal.g6.family: found \"mavlink_v1\", a family of gimbals that may be no v2 devices, for the \
             seventh time; expected at most 6 gimbals of such families"],
    );
    let v1 = |lines: &str| format!("[[gimbal]]\nname = \"a\"\nfamily = \"mavlink_v1\"\n{lines}");
    assert_eq!(check(&format!("{LINK}{}", v1("manager_component_id = 154\n")), &[]).code, Some(0));
    assert_refused(
        &v1("device_yaw_frame = \"earth\"\n"),
        &["c.toml:8: gimbal.a.device_yaw_frame: found \"earth\", which a gimbal of this family cannot have; expected \
             auto or vehicle"],
    );
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

#[test]
fn devices_have_ids_of_their_own_on_their_link() {
    // The entry of b begins in the line after that of a.
    let two = |a: &str, b: &str| {
        let device = "component_id = 154\n";
        format!("[[gimbal]]\nname = \"a\"\n{device}{a}[[gimbal]]\nname = \"b\"\n{b}{device}")
    };
    let on_ground = "link = \"ground\"\n";
    let same = "gimbal.b.component_id: found 154, which another gimbal on this link has; expected an id of its own, or another link";
    assert_refused(&two("", ""), &[&format!("c.toml:10: {same}")]);
    // A gimbal without a link may turn out to be on the same one.
    assert_refused(&two(on_ground, ""), &[&format!("c.toml:11: {same}")]);
    assert_refused(&two(on_ground, on_ground), &[&format!("c.toml:12: {same}")]);
    let manager = "gimbal.a.component_id: found 191, which is a manager's id; expected the component id of the device, for example 154";
    assert_refused("[[gimbal]]\nname = \"a\"\ncomponent_id = 191\n", &[&format!("c.toml:7: {manager}")]);
    let own = "gimbal.a.component_id: found 154, which is a manager's id; expected the component id of the device, for example 171";
    let both = "[[gimbal]]\nname = \"a\"\nfamily = \"mavlink_v1\"\ncomponent_id = 154\nmanager_component_id = 154\n";
    assert_refused(both, &[&format!("c.toml:8: {own}")]);
    let second_link = "[[link]]\nname = \"radio\"\nrole = \"ground\"\nendpoint = \"udpin:0.0.0.0:14551\"\n";
    let apart = two(on_ground, "link = \"radio\"\n");
    assert_eq!(check(&format!("{LINK}{second_link}{apart}"), &[]).code, Some(0));
}

#[test]
fn two_links_cannot_share_a_port() {
    #[rustfmt::skip]
    let rows = [
        ("udpin:0.0.0.0:14550",    "udpin:127.0.0.1:14550",  Some("the port of the link in line 4; expected a port of its own")),
        ("udpin:10.0.0.1:14550",   "udpin:127.0.0.1:14550",  None),
        ("udpin:0.0.0.0:14550",    "tcpin:0.0.0.0:14550",    None),
        ("udpin:127.0.0.1:0",      "udpin:127.0.0.1:0",      None),
        ("tcpin:[::]:5760",        "tcpin:0.0.0.0:5760",     Some("the port of the link in line 4; expected a port of its own")),
        ("serial:/dev/ttyX:57600", "serial:/dev/ttyX:9600",  Some("the serial port of the link in line 4; expected a serial port of its own")),
        ("serial:/dev/null:57600", "serial:/dev/./null:1200", Some("the serial port of the link in line 4; expected a serial port of its own")),
        ("serial:/dev/ttyX:57600", "serial:/dev/ttyY:57600", None),
        ("udpout:10.0.0.1:14550",  "udpout:10.0.0.1:14550",  Some("the peer of the link in line 4; expected a peer of its own")),
        ("udpout:10.0.0.1:14550",  "udpout:10.0.0.1:14551",  None),
        ("udpin:0.0.0.0:14550",    "udpout:127.0.0.1:14550", Some("the port of the link in line 4; expected the port of another program at one end")),
        ("tcpout:127.0.0.1:5760",  "tcpin:127.0.0.1:5760",   Some("the peer of the link in line 4; expected the port of another program at one end")),
        ("udpin:0.0.0.0:14550",    "udpout:10.0.0.1:14550",  None),
        ("udpin:10.0.0.1:14550",   "udpout:127.0.0.1:14550", None),
    ];
    for (first, second, problem) in rows {
        let text = format!("{}{}", LINK.replace("udpin:0.0.0.0:14550", first), {
            LINK.replace("ground\"\nrole", "second\"\nrole").replace("udpin:0.0.0.0:14550", second)
        });
        let outcome = check(&text, &[]);
        match problem {
            Some(problem) => {
                let line = format!("c.toml:8: link.second.endpoint: found \"{second}\", {problem}");
                assert_eq!(outcome, refused(&[&line]));
            }
            None => assert_eq!((outcome.code, outcome.errors.as_str()), (Some(0), ""), "{first} {second}"),
        }
    }
    let page = "c.toml:4: link.ground.endpoint: found \"tcpin:0.0.0.0:8080\", the port of http.listen; expected a port of its own";
    assert_eq!(check(&LINK.replace("udpin:0.0.0.0:14550", "tcpin:0.0.0.0:8080"), &[]), refused(&[page]));
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

/// `config::load` of a file with this text.
fn load(text: &str, variables: &[(&str, &str)]) -> Result<DaemonSettings, Problems> {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("c.toml");
    fs::write(&path, text).expect("a writable folder");
    config::load(&path, variables.iter().map(|(name, value)| ((*name).to_owned(), (*value).to_owned())))
}

/// Every key, with another value than its default.
const EVERY_KEY: &str = r#"
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
role = "ground"
endpoint = "udpbcast:10.0.0.255:14550"
max_rate_hz = { 285 = 4, 281 = 0.5 }
[[gimbal]]
name = "nose-cam"
link = "ground"
family = "auto"
component_id = 171
manager_component_id = 200
takeover = "ask"
setpoint_rate_hz = 30
device_yaw_frame = "earth"
v1_sign = { pitch = -1, roll = 1.0, yaw = -1 }
v1_report_sign = "reversed"
v1_configure = true
v1_radio_control = "mode"
v1_status = true
gremsy_generation = "v1"
gremsy_report_sign = "reversed"
retract_allowed = true
stow_pitch_deg = -45
stow_yaw_deg = 90
manual_pitch_rate_dps = 12.5
manual_yaw_rate_dps = 45
[vehicle]
system_id = 7
[autopilot]
present_device = true
[control]
unclaimed = "closed"
lease_timeout_s = 3
rate_timeout_s = 0.5
command_rate_timeout_s = 0
firewall = "warn"
snoop_autopilot = true
accept_centidegrees = true
px4_release_quirk = true
synthesize_286 = "off"
[roi]
altitude_reference = "amsl"
[http]
listen = "[::1]:9090"
token_file = "/nowhere/token"
"#;

/// A file with a token, and the folder it lives in.
fn token_file() -> (tempfile::TempDir, std::path::PathBuf) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("token");
    fs::write(&path, "0123456789abcdef\n").expect("a writable folder");
    fs::set_permissions(&path, fs::Permissions::from_mode(0o600)).expect("our own file");
    (folder, path)
}

#[test]
fn every_key_arrives_where_it_belongs() {
    let link = |name: &str, role, endpoint: &str, transport, speaks_first, max_rates: &[(u32, u64)]| LinkSettings {
        name: name.to_owned(),
        role,
        endpoint: endpoint.to_owned(),
        transport,
        speaks_first,
        max_rates: max_rates.iter().map(|(id, millis)| (*id, Duration::from_millis(*millis))).collect(),
    };
    let (serial, tcp, broadcast) = ("serial:/dev/ttyUSB0:57600", "tcpin:127.0.0.1:5760", "udpbcast:10.0.0.255:14550");
    let expected = DaemonSettings {
        core: Settings {
            system_id: SystemId::Fixed(7),
            stored_system_id: None,
            left_turning: Vec::new(),
            links: vec![
                link("nose", Role::Gimbal, serial, Transport::Serial { baud: 57_600 }, false, &[]),
                link("autopilot", Role::Autopilot, tcp, Transport::Stream, false, &[]),
                link("ground", Role::Ground, broadcast, Transport::Datagrams, true, &[(281, 2000), (285, 250)]),
            ],
            gimbals: vec![GimbalSettings {
                name: "nose-cam".to_owned(),
                family: Family::Auto,
                link: Some(2),
                component_id: Some(171),
                manager_component_id: Some(200),
                takeover: Takeover::Ask,
                setpoint_rate_hz: 30,
                device_yaw_frame: DeviceYawFrame::Earth,
                v1: V1Settings {
                    sign: Signs::REVERSED,
                    report_sign: Signs::REVERSED,
                    configures: true,
                    radio_control: V1RadioControl::Mode,
                },
                v1_status: true,
                gremsy: GremsySettings {
                    generation: Some(Generation::V1),
                    retract_allowed: true,
                    stow_pitch: Angle::from_degrees(-45.0),
                    stow_yaw: Angle::from_degrees(90.0),
                    report_sign: Some(Signs::REVERSED),
                },
                manual_pitch_rate_dps: 12.5,
                manual_yaw_rate_dps: 45.0,
            }],
            control: ControlSettings {
                open_when_unclaimed: false,
                lease_timeout: Duration::from_secs(3),
                rate_timeout: Duration::from_millis(500),
                command_rate_timeout: Duration::ZERO,
                firewall: Firewall::Warn,
                snoop_autopilot: true,
                accept_centidegrees: true,
                px4_release_quirk: true,
                synthesize_286: false,
                roi_altitude: AltitudeReference::Amsl,
            },
            present_device: true,
        },
        endpoints: vec![serial.parse().expect(serial), tcp.parse().expect(tcp), broadcast.parse().expect(broadcast)],
        http: Some(HttpSettings {
            listen: "[::1]:9090".parse().expect("an address"),
            token: Some("0123456789abcdef".parse().expect("a token")),
        }),
        directories: Directories { state: Some("/var/lib/gimbald".into()), runtime: Some("/run/gimbald".into()) },
    };
    let (_folder, token) = token_file();
    let text = EVERY_KEY.replace("/nowhere/token", &token.to_string_lossy());
    assert_eq!(
        load(&text, &[("STATE_DIRECTORY", "/var/lib/gimbald:/var/lib/other"), ("RUNTIME_DIRECTORY", "/run/gimbald")]),
        Ok(expected)
    );
}

#[test]
fn what_is_not_said_has_its_default() {
    let loaded = load(LINK, &[("STATE_DIRECTORY", "")]).expect("a right file");

    assert_eq!(loaded.core.system_id, SystemId::Auto);
    assert_eq!(loaded.core.gimbals, []);
    assert_eq!(loaded.core.control, ControlSettings::default());
    assert!(!loaded.core.present_device);
    let listen = "127.0.0.1:8080".parse().expect("an address");
    assert_eq!(loaded.http, Some(HttpSettings { listen, token: None }));
    assert_eq!(loaded.directories, Directories::default());

    let loaded = load(&format!("{LINK}[[gimbal]]\nname = \"camera\"\n"), &[]).expect("a right file");
    assert_eq!(loaded.core.gimbals, [GimbalSettings::found("camera".to_owned())]);
}

/// A link whose other end waits to be spoken to must send the first byte.
#[test]
fn links_that_call_speak_first() {
    for (endpoint, transport, speaks_first) in [
        ("serial:/dev/ttyUSB0:57600", Transport::Serial { baud: 57_600 }, false),
        ("udpin:0.0.0.0:1", Transport::Datagrams, false),
        ("udpout:10.0.0.1:1", Transport::Datagrams, true),
        ("udpbcast:10.0.0.255:1", Transport::Datagrams, true),
        ("tcpin:0.0.0.0:1", Transport::Stream, false),
        ("tcpout:10.0.0.1:1", Transport::Stream, true),
    ] {
        let loaded = load(&LINK.replace("udpin:0.0.0.0:14550", endpoint), &[]).expect(endpoint);
        let link = &loaded.core.links[0];
        assert_eq!((link.transport, link.speaks_first), (transport, speaks_first), "{endpoint}");
    }
}

/// A table of signs names the axes that differ from its words.
#[test]
fn each_axis_of_a_gimbal_has_a_sign_of_its_own() {
    let signs = |given: &str| {
        let text = format!("{LINK}[[gimbal]]\nname = \"camera\"\nv1_sign = {given}\n");
        load(&text, &[]).map(|loaded| loaded.core.gimbals[0].v1.sign)
    };
    let opposite = Sign::Opposite;
    for (given, expected) in [
        ("\"normal\"", Signs::NORMAL),
        ("\"reversed\"", Signs::REVERSED),
        ("{}", Signs::NORMAL),
        ("{ pitch = -1 }", Signs { pitch: opposite, ..Signs::NORMAL }),
        ("{ roll = -1, yaw = 1 }", Signs { roll: opposite, ..Signs::NORMAL }),
        ("{ pitch = -1.0, yaw = -1 }", Signs::REVERSED),
    ] {
        assert_eq!(signs(given), Ok(expected), "{given}");
    }
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
