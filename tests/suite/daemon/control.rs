//! Control over HTTP and by `gimbald gimbal`, through the real binary.

use std::fs;
use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::os::unix::fs::PermissionsExt;
use std::process::{Command, Stdio};
use std::thread;
use std::time::Duration;

use gimbald::bridge::snapshot::Snapshot;
use gimbald::daemon::clock::Clock;
use gimbald::timestamp::Timestamp;
use gimbald::wire::dialect::GIMBAL_DEVICE_SET_ATTITUDE_DATA;
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;

use super::{simulated_gimbal, three_links};
use crate::gimbald::{Outcome, gimbald};
use crate::support::daemon::{Cable, Daemon, Shared, Site, Station, wait_for};
use crate::support::script::take_control;
use crate::support::world::{GCS, heartbeat};
use gimbald::gimbals::mavlink_v2::sim::Device;

/// `[control] rate_timeout_s` and `command_rate_timeout_s` as they are when nothing is said.
const RATE_TIMEOUT: Duration = Duration::from_secs(2);
const COMMAND_RATE_TIMEOUT: Duration = Duration::from_secs(10);
const TOKEN: &str = "0123456789abcdef-0123456789";
const CAMERA: &str = "gimbal-154";

/// A daemon with a gimbal and a token.
struct Flight {
    site: Site,
    daemon: Daemon,
    gimbal: Shared<Device>,
    _cable: Cable,
}

impl Flight {
    fn new() -> Self {
        let site = Site::new();
        let path = site.path("token");
        fs::write(&path, format!("{TOKEN}\n")).expect("a writable folder");
        fs::set_permissions(&path, fs::Permissions::from_mode(0o600)).expect("our own file");
        let gimbal = simulated_gimbal();
        let cable = gimbal.plug_in(&site.path("gimbal"));
        let daemon = site.start(&three_links(), &[("GIMBALD__HTTP__TOKEN_FILE", "{dir}/token")]);
        daemon.wait_for_gimbal();
        Self { site, daemon, gimbal, _cable: cable }
    }

    /// `gimbald gimbal NAME …` with the token.
    fn order(&self, words: &str) -> Outcome {
        self.run(&format!("{CAMERA} {words} --token-file token"))
    }

    fn run(&self, words: &str) -> Outcome {
        let url = format!("http://{}", self.site.port(8080));
        let arguments: Vec<&str> = ["gimbal"]
            .into_iter()
            .chain(words.split(' '))
            .chain(["--url", &url])
            .filter(|word| !word.is_empty())
            .collect();
        gimbald(self.site.folder.path(), &arguments, &[])
    }

    #[track_caller]
    fn done(&self, words: &str) {
        let outcome = self.order(words);
        let command = words.split(' ').next().unwrap_or_default();
        let expected = Outcome { code: Some(0), output: format!("{CAMERA}: {command} done\n"), errors: String::new() };
        assert_eq!(outcome, expected, "{words}");
    }

    #[track_caller]
    fn refused(&self, words: &str, code: i32, errors: &str) {
        let outcome = self.run(words);
        assert_eq!(outcome.code, Some(code), "{words}: {}", outcome.errors);
        assert!(outcome.errors.contains(errors), "{words}: {}", outcome.errors);
        assert_eq!(outcome.output, "", "{words}");
    }
}

fn is_turning(sent: &GIMBAL_DEVICE_SET_ATTITUDE_DATA) -> bool {
    sent.angular_velocity_z > 0.0
}

/// D5: what is asked on the command line moves the gimbal, and everybody sees who it was.
#[test]
fn a_gimbal_is_controlled_from_the_command_line() {
    let flight = Flight::new();
    flight.done("control take");
    flight.done("point --pitch-deg -30 --yaw-deg 20");
    let near = |value: Option<f64>, wanted: f64| value.is_some_and(|value| (value - wanted).abs() < 1.0);
    let status = flight.daemon.wait_until("the gimbal to look there", |status: &Snapshot| {
        let attitude = &status.gimbals[0].attitude;
        near(attitude.pitch_deg, -30.0) && near(attitude.yaw_vehicle_deg, 20.0)
    });
    let gimbal = &status.gimbals[0];
    assert_eq!(gimbal.primary.as_deref(), Some("http"));
    assert_eq!(gimbal.setpoint.as_ref().and_then(|setpoint| setpoint.source.as_deref()), Some("http"));

    let shown = flight.run(CAMERA);
    assert_eq!(shown.code, Some(0), "{}", shown.errors);
    assert!(shown.output.starts_with(&format!("gimbal {CAMERA}  alive  mavlink_v2")), "{}", shown.output);
    assert!(shown.output.contains("control   http for"), "{}", shown.output);
    let none = "none was read; refresh-parameters reads them\n";
    assert_eq!(flight.run(&format!("{CAMERA} parameters")).output, none);
    flight.done("refresh-parameters");
    let parameters = "SIM_COMP_ID      154\nSIM_RATE_MAX     100\nSIM_TILT_MAX     30\nSIM_TILT_MIN     -90\n";
    assert_eq!(flight.run(&format!("{CAMERA} parameters")).output, parameters);
    flight.done("set-parameter SIM_TILT_MAX 25");
    assert_eq!(flight.run(&format!("{CAMERA} parameters SIM_TILT_MAX")).output, "25\n");
    flight.refused(
        &format!("{CAMERA} set-parameter NIX 1 --token-file token"),
        64,
        "404 Not Found: no parameter \"NIX\" was read from the gimbal",
    );
    flight.refused(
        &format!("{CAMERA} set-parameter SIM_COMP_ID 0.5 --token-file token"),
        64,
        "422 Unprocessable Entity: 0.5 is no whole number from -2147483648 to 2147483647",
    );
    let json = flight.order("neutral --json").output;
    assert_eq!(json, format!("{{\"gimbal\":\"{CAMERA}\",\"done\":\"neutral\"}}\n"));
    flight.done("control release");
    assert_eq!(flight.daemon.status().gimbals[0].primary, None);
}

/// Exit codes by sysexits: 64 for a wrong name or word, 69 for what is not there or cannot, 77 for what is not allowed, 78 for
/// a token file without a token.
#[test]
fn refusals_have_their_exit_codes() {
    let flight = Flight::new();
    let site = &flight.site;
    for (name, content, mode) in
        [("wrong", "another-token-0123456789", 0o600), ("empty", "", 0o600), ("closed", TOKEN, 0o000)]
    {
        fs::write(site.path(name), content).expect("a writable folder");
        fs::set_permissions(site.path(name), fs::Permissions::from_mode(mode)).expect("our own file");
    }
    let config = format!("[http]\ntoken_file = \"{}\"\n", site.path("token").display());
    fs::write(site.path("with-token.toml"), config).expect("a writable folder");

    let camera = |words: &str| format!("{CAMERA} {words}");
    flight.refused(&camera("stop"), 77, "control needs the token: name its file with --token-file");
    flight.refused(&camera("stop --token-file wrong"), 77, "403 Forbidden: this is not the token");
    flight.refused(&camera("stop --token-file empty"), 78, "the token file empty is empty");
    flight.refused(&camera("stop --token-file nowhere"), 78, "the token file nowhere cannot be read");
    if !nix::unistd::geteuid().is_root() {
        flight.refused(&camera("stop --token-file closed"), 77, "cannot be read: Permission denied");
    }
    let shown = flight.run(&camera("neutral --config with-token.toml"));
    assert_eq!((shown.code, shown.errors.as_str()), (Some(0), ""), "the configuration names the token");

    let unknown = format!("no gimbal is called \"lamp\"; there are: {CAMERA}");
    flight.refused("lamp", 64, &unknown);
    flight.refused("lamp stop --token-file token", 64, &unknown);
    flight.refused(&camera("motors off"), 64, "add --yes-motors-off");
    flight.refused(&camera("point --pitch-deg 400 --token-file token"), 64, "expected a number from -180 to 180");
    flight.refused(
        &camera("motors on --token-file token"),
        69,
        "501 Not Implemented: this gimbal has no such function",
    );
    flight.refused(&camera("reboot --yes-reboot --token-file token"), 77, "only who has control may ask for that");
    flight.refused(&camera("roi 47 8 400 --token-file token"), 69, "503 Service Unavailable: no vehicle position");

    let mut ground = Station::new(GCS, site.port(14_550));
    ground.send(&heartbeat(6, 8));
    ground.send(&take_control());
    flight
        .daemon
        .wait_until("the ground station in control", |status| status.gimbals[0].primary.as_deref() == Some("255/190"));
    flight.refused(&camera("stop --token-file token"), 77, "409 Conflict: 255/190 is in control");
    let rejected = flight.daemon.status().gimbals[0].rejected["http"].clone();
    assert_eq!(rejected["not_in_control"], 1, "{rejected:?}");
    assert_eq!(rejected["only_for_the_holder"], 1, "{rejected:?}");
}

/// A folder with a token, and who answers so, one body to each client.
fn daemon_that_answers(
    status: &'static str,
    bodies: &'static [&'static str],
) -> (tempfile::TempDir, String, thread::JoinHandle<()>) {
    let folder = tempfile::tempdir().expect("a folder");
    fs::write(folder.path().join("token"), TOKEN).expect("a writable folder");
    fs::set_permissions(folder.path().join("token"), fs::Permissions::from_mode(0o600)).expect("our own file");
    let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
    let url = format!("http://{}", listener.local_addr().expect("a port"));
    let answers = thread::spawn(move || {
        for body in bodies {
            let (mut stream, _) = listener.accept().expect("a client");
            let length = stream.read(&mut [0; 4096]).expect("a request");
            assert!(length > 0);
            let answer = format!("HTTP/1.1 {status}\r\ncontent-length: {}\r\n\r\n{body}", body.len());
            stream.write_all(answer.as_bytes()).expect("it listens");
        }
    });
    (folder, url, answers)
}

/// "Dangerous ones need the word typed": which gimbal cuts its motors to retract the daemon alone knows; what is to be typed
/// is said in the words of the command line.
#[test]
fn a_retract_that_cuts_the_motors_is_told_what_to_type() {
    let (folder, url, answers) = daemon_that_answers(
        "422 Unprocessable Entity",
        &[r#"{"error": "this is dangerous", "reason": "unconfirmed"}"#, r#"{"error": "this is wrong"}"#],
    );
    for expected in [
        "gimbald: 'motors off' can cost the camera or the flight: with retract_allowed a Gremsy's motors are switched off; \
         the camera falls to where its weight takes it, and some firmware switches the motors on again only after a \
         restart; if it is meant, add --yes-motors-off\n"
            .to_owned(),
        format!("gimbald: gimbald at {url} answers 422 Unprocessable Entity: this is wrong\n"),
    ] {
        let arguments = ["gimbal", "camera", "retract", "--token-file", "token", "--url", &url];
        let outcome = gimbald(folder.path(), &arguments, &[]);
        assert_eq!((outcome.code, outcome.output, outcome.errors), (Some(64), String::new(), expected));
    }
    answers.join().expect("all of them asked");
}

/// What has no daemon's answer was not done by one.
#[test]
fn what_is_no_gimbald_has_done_nothing() {
    let (folder, url, answers) = daemon_that_answers("200 OK", &["", "done", "{\"gimbal\": \"camera\"}"]);
    for why in ["EOF while parsing", "expected value", "missing field `done`"] {
        let arguments = ["gimbal", "camera", "stop", "--token-file", "token", "--url", &url];
        let outcome = gimbald(folder.path(), &arguments, &[]);
        assert_eq!((outcome.code, outcome.output.as_str()), (Some(69), ""), "{why}");
        let expected = format!("what answers at {url} is not a gimbald of this version: {why}");
        assert!(outcome.errors.contains(&expected), "{}", outcome.errors);
    }
    answers.join().expect("all of them asked");
}

/// `turn --for` turns for so long and stops; and when it is killed meanwhile the gimbal stops all the same: "a gimbal that turns
/// after its operator is gone is our worst bug".
#[test]
fn a_gimbal_does_not_turn_on_without_its_operator() {
    let flight = Flight::new();
    let setpoints = || -> Vec<(Timestamp, GIMBAL_DEVICE_SET_ATTITUDE_DATA)> {
        flight.gimbal.take_heard().iter().filter_map(|heard| Some((heard.at, heard.decode()?))).collect()
    };
    flight.done("turn --yaw-dps 10 --for 1");
    let mut told = Vec::new();
    wait_for("the stop on the line", || {
        told.extend(setpoints());
        told.last().filter(|(_, sent)| !is_turning(sent)).map(|_| ())
    });
    let turning: Vec<Timestamp> = told.iter().filter(|(_, sent)| is_turning(sent)).map(|(at, _)| *at).collect();
    let span = turning[turning.len() - 1].since(turning[0]);
    // Sooner than a rate ends that is not asked for again.
    assert!((Duration::from_millis(900)..RATE_TIMEOUT).contains(&span), "{span:?}");

    let url = format!("http://{}", flight.site.port(8080));
    // Who is ended stops it; who is killed leaves that to the time-out of rates, not to that of a single command.
    for (signal, most) in [
        (Signal::SIGINT, RATE_TIMEOUT),
        (Signal::SIGTERM, RATE_TIMEOUT),
        (Signal::SIGHUP, RATE_TIMEOUT),
        (Signal::SIGKILL, COMMAND_RATE_TIMEOUT),
    ] {
        let mut operator = Command::new(env!("CARGO_BIN_EXE_gimbald"))
            .args(["gimbal", CAMERA, "turn", "--yaw-dps", "10", "--for", "60", "--token-file", "token", "--url", &url])
            .current_dir(flight.site.folder.path())
            .stdout(Stdio::null())
            .spawn()
            .expect("cargo built the binary");
        wait_for("the rotation", || setpoints().iter().any(|(_, sent)| is_turning(sent)).then_some(()));
        let gone = flight.gimbal.with(|_, now| now);
        kill(Pid::from_raw(operator.id() as i32), signal).expect("it runs");
        operator.wait().expect("our child");
        let mut last_turning = gone;
        wait_for("the end of the rotation", || {
            let told = setpoints();
            last_turning = told.iter().rfind(|(_, sent)| is_turning(sent)).map_or(last_turning, |(at, _)| *at);
            let stopped = told.last().is_some_and(|(at, sent)| !is_turning(sent) && *at > gone);
            stopped.then_some(())
        });
        let passed = last_turning.since(gone);
        assert!(passed < most, "{signal}: {passed:?}");
    }
}

/// "A token file: refused (exit 78, clear text) when missing …"; and the token is never logged.
#[test]
fn a_daemon_without_its_token_does_not_start() {
    let site = Site::new();
    let mut daemon = site.start(&three_links(), &[("GIMBALD__HTTP__TOKEN_FILE", "{dir}/token")]);
    assert_eq!(daemon.wait(), Some(78));
    let log = fs::read_to_string(site.path("log")).expect("a log");
    let found = "GIMBALD__HTTP__TOKEN_FILE: http.token_file: found";
    assert!(log.contains(found) && log.contains("cannot be read: No such file"), "{log}");

    let flight = Flight::new();
    flight.done("stop");
    flight.refused(&format!("{CAMERA} stop --token-file c.toml"), 78, "does not hold one word");
    let log = fs::read_to_string(flight.site.path("log")).expect("a log");
    assert!(!log.contains(TOKEN), "{log}");
}

/// Bodies without end, clients that do nothing, and wrong tokens by the hundred: frames and the right client go on.
#[test]
fn attacks_do_not_hold_up_who_may() {
    let flight = Flight::new();
    let address = flight.site.port(8080);
    let head = format!("POST /api/v1/gimbals/{CAMERA}/stop HTTP/1.1\r\nHost: {address}\r\n");
    let begin = |rest: &str| {
        let mut stream = TcpStream::connect(address).expect("the daemon listens");
        stream.write_all(format!("{head}{rest}").as_bytes()).expect("it takes the request");
        stream.set_read_timeout(Some(Duration::from_secs(8))).expect("a time-out");
        stream
    };
    // Half of the places wait for bodies that never come, from somebody who has the token.
    let right = format!("Authorization: Bearer {TOKEN}\r\n");
    let slow: Vec<TcpStream> = (0..16).map(|_| begin(&format!("{right}Content-Length: 100\r\n\r\n"))).collect();
    let clock = Clock::start();
    for guess in 0..100 {
        let mut answer = [0; 12];
        let given = format!("Authorization: Bearer guess-{guess:020}\r\nContent-Length: 0\r\n\r\n");
        begin(&given).read_exact(&mut answer).expect("an answer");
        assert_eq!(&answer, b"HTTP/1.1 403");
    }
    for _ in 0..10 {
        let mut huge = begin("Content-Length: 99999999999\r\n\r\n");
        let mut answer = [0; 12];
        huge.read_exact(&mut answer).expect("an answer");
        assert_eq!(&answer, b"HTTP/1.1 401");
        // The daemon reads no further, so this ends some time.
        while huge.write_all(&[b' '; 65_536]).is_ok() && clock.now() < Timestamp::from_secs(7) {}
    }
    flight.done("stop");
    let status = flight.daemon.status();
    assert_eq!(status.gimbals[0].state, "alive");
    for mut stream in slow {
        let mut answer = [0; 12];
        stream.read_exact(&mut answer).expect("an answer");
        assert_eq!(&answer, b"HTTP/1.1 408");
    }
    assert!(flight.daemon.resident_kib() < 64 * 1024);
}
