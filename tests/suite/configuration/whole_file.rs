//! The file as a whole: one that is right, one that is none, and every problem of one at once.

use std::os::unix::fs::symlink;
use std::os::unix::net::UnixListener;
use std::path::Path;

use nix::sys::stat::Mode;
use nix::unistd::mkfifo;

use super::*;

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
