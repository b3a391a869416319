//! The window as its clients see it, over real sockets.

use std::io::{self, ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tokio::net::TcpListener;
use tokio::sync::{mpsc, oneshot, watch};

mod asking;

use super::server::{Limits, attend, run};
use super::{canned, spawn};
use crate::bridge::snapshot::Snapshot;
use crate::config::settings::HttpSettings;
use crate::daemon::window::{CoreHandle, CoreRequest};
use crate::manager::asked::{Answer as Outcome, Asked};
use crate::token::Token;

/// "Angles in degrees, distances in metres, ages in milliseconds, unknown is `null`."
#[test]
fn status_is_the_whole_snapshot() {
    let window = Window::of(canned::snapshot());

    let answer = window.get("/api/v1/status");

    assert_eq!((answer.status, answer.header("content-type")), (200, Some("application/json")));
    let nothing = json!({
        "generation": null, "faults": [], "parameters": {}, "stage": null, "version": null, "mode": null,
        "operation": null, "not_aligned": [], "motors_on": null, "battery_v": null, "load_percent": null, "imu": null,
        "encoders": null, "axes": {}, "gyro_filter": null, "output_filter": null, "gain": null, "radio_type": null,
        "encoder_unit": null, "combined_attitude": null, "home_on_mode_change": null, "streams": {},
        "message_ages_ms": {},
    });
    let mut of_the_family = nothing.clone();
    of_the_family["generation"] = "v2".into();
    of_the_family["faults"] = json!(["firmware 7.8.7 reports a wrong yaw from North"]);
    of_the_family["parameters"] = json!({"RC_TYPE": 7.0});
    let expected = json!({
        "version": "0.1.0",
        "uptime_s": 3725.5,
        "system_id": 1,
        "links": [
            {
                "name": "autopilot", "role": "autopilot", "endpoint": "udpin:0.0.0.0:14540", "state": "up", "reason": null,
                "rx_frames": 123_456, "tx_frames": 7890, "rx_bytes": 4_938_240, "tx_bytes": 315_600,
                "crc_errors": 2, "resync_bytes": 17, "dropped_frames": 40, "dropped": {"duplicate": 3, "queue_full": 37},
                "peers": [{"address": "127.0.0.1:14550", "components": ["1/1"], "age_ms": 3}],
            },
            {
                "name": "gimbal", "role": "gimbal", "endpoint": "serial:/dev/serial0:115200",
                "state": "down", "reason": "no such file or directory",
                "rx_frames": 0, "tx_frames": 0, "rx_bytes": 0, "tx_bytes": 0,
                "crc_errors": 0, "resync_bytes": 0, "dropped_frames": 0, "dropped": {}, "peers": [],
            },
        ],
        "vehicle": {
            "system_id": 1, "autopilot": "ardupilot", "alive": true,
            "roll_deg": 2.5, "pitch_deg": -1.25, "heading_deg": 87.0, "attitude_age_ms": 12,
            "latitude_deg": 47.397_742, "longitude_deg": 8.545_594, "altitude_amsl_m": 488.5, "position_age_ms": 95,
            "yaw_rate_dps": 3.5, "state_for_gimbal": "synthesized", "stale": [],
        },
        "gimbals": [
            {
                "name": "camera", "configured": true, "family": "mavlink_v2", "manager_component_id": 191, "device_id": 154,
                "device": "1/154", "state": "alive", "vendor": "Acme", "model": "Pixy", "firmware": "7.8.1",
                "attitude": {
                    "roll_deg": 0.25, "pitch_deg": -42.5, "yaw_vehicle_deg": 30.0, "yaw_earth_deg": 117.0, "assumed": false,
                    "age_ms": 18,
                },
                "setpoint": {
                    "mode": "angle", "pitch_deg": -45.0, "yaw_deg": 120.0, "yaw_frame": "earth",
                    "pitch_rate_dps": null, "yaw_rate_dps": null, "source": "255/190", "stale": false,
                    "nudge_pitch_deg": -2.5, "nudge_yaw_deg": 0.0,
                },
                "primary": "255/190", "secondary": null, "primary_age_ms": 61_500, "secondary_age_ms": null,
                "lender": null, "takeover": "ask",
                "roi": {"latitude_deg": 47.4, "longitude_deg": 8.55, "altitude_amsl_m": 430.0},
                "flags": ["yaw_lock", "roll_lock"], "failure_flags": ["motor_error"],
                "rejected": {"1/100": {"not_in_control": 12}},
                "presented": {"device": "1/154", "stream": "steady", "asked_age_ms": 12_000},
                "details": of_the_family,
            },
            {
                "name": "lamp", "configured": true, "family": "auto", "manager_component_id": 192, "device_id": null,
                "device": null, "state": "searching", "vendor": null, "model": null, "firmware": null,
                "attitude": {
                    "roll_deg": null, "pitch_deg": null, "yaw_vehicle_deg": null, "yaw_earth_deg": null, "assumed": false,
                    "age_ms": null,
                },
                "setpoint": null, "primary": null, "secondary": null, "primary_age_ms": null, "secondary_age_ms": null,
                "lender": null, "takeover": "open", "roi": null,
                "flags": [], "failure_flags": [], "rejected": {}, "presented": null,
                "details": nothing,
            },
        ],
        "conflicts": ["1/191 is also used by 10.0.0.7: set its component id to another value"],
        "events": [
            {
                "id": 8, "at_s": 3725.25, "age_ms": 250, "first_at_s": 3700.0, "count": 12, "gimbal": "camera",
                "what": "refused", "place": null, "who": "1/100", "from": "255/190", "to": null,
                "reason": "not_in_control", "text": "1/100 was refused: 255/190 is in control",
            },
            {
                "id": 7, "at_s": 3664.0, "age_ms": 61_500, "first_at_s": 3664.0, "count": 1, "gimbal": "camera",
                "what": "taken_over", "place": "primary", "who": "255/190", "from": "1/1", "to": "255/190",
                "reason": null, "text": "255/190 took control from 1/1",
            },
        ],
    });
    assert_eq!(answer.json(), expected);
}

/// Protocol checklist 180: "When a value is NaN internally, HTTP JSON has null in its place and is parseable by a
/// strict parser."
#[test]
fn what_is_no_number_is_null() {
    let mut snapshot = canned::snapshot();
    snapshot.vehicle.roll_deg = Some(f64::NAN);
    snapshot.vehicle.altitude_amsl_m = Some(f64::INFINITY);
    snapshot.gimbals[0].attitude.pitch_deg = Some(f64::NEG_INFINITY);
    let window = Window::of(snapshot);

    let status = window.get("/api/v1/status").json();

    assert_eq!(status["vehicle"]["roll_deg"], Value::Null);
    assert_eq!(status["vehicle"]["altitude_amsl_m"], Value::Null);
    assert_eq!(status["gimbals"][0]["attitude"]["pitch_deg"], Value::Null);
}

/// "200 when every configured link is up and every configured gimbal is alive, else 503 with the reasons, as JSON
/// {ready, reasons[]}."
#[test]
fn readiness_has_reasons() {
    let answer = Window::of(canned::snapshot()).get("/readyz");
    let reasons = ["link gimbal is down: no such file or directory", "gimbal lamp is searching"];
    assert_eq!((answer.status, answer.json()), (503, json!({"ready": false, "reasons": reasons})));

    let mut snapshot = canned::snapshot();
    snapshot.links.truncate(1);
    snapshot.gimbals.truncate(1);
    let answer = Window::of(snapshot).get("/readyz");
    assert_eq!((answer.status, answer.json()), (200, json!({"ready": true, "reasons": []})));
}

#[test]
fn health_is_one_word() {
    let answer = Window::of(Snapshot::default()).get("/healthz");
    assert_eq!((answer.status, answer.body.as_str()), (200, "ok"));
}

/// "503 with a JSON error if the core does not answer" within 500 ms; `/healthz` gives it 1 s.
#[test]
fn a_core_that_hangs_is_told_in_time() {
    let window = Window::open(None, Limits::default());
    for (path, least, expected) in [
        ("/api/v1/status", 500, json!({"error": "the core did not answer within 500 ms"})),
        ("/readyz", 500, json!({"ready": false, "reasons": ["the core did not answer within 500 ms"]})),
        ("/healthz", 1000, json!({"error": "the core did not answer within 1 s"})),
    ] {
        let start = now();
        let answer = window.get(path);
        assert_eq!((answer.status, answer.json()), (503, expected), "{path}");
        assert!(start.elapsed() < Duration::from_millis(least + 3000), "{path} took {:?}", start.elapsed());
    }
}

#[test]
fn the_page_needs_no_core() {
    let answer = Window::open(None, Limits::default()).get("/");
    assert_eq!((answer.status, answer.header("content-type")), (200, Some("text/html; charset=utf-8")));
    assert_eq!(answer.body, include_str!("page.html"));
    let policy = answer.header("content-security-policy").expect("a policy");
    assert!(policy.starts_with("default-src 'none'; style-src 'sha256-"), "{policy}");
}

/// "Unknown path 404 JSON, other methods 405."
#[test]
fn what_is_not_there_is_refused_as_json() {
    let window = Window::of(Snapshot::default());
    for path in ["/api/v1/nothing", "/index.html", "/../etc/passwd", "/%00", "/api/v1/status/"] {
        let answer = window.get(path);
        let error = json!({"error": "no such page; there are /, /api/v1/status, /api/v1/gimbals, /api/v1/openapi.json, /healthz and /readyz"});
        assert_eq!((answer.status, answer.json()), (404, error), "{path}");
    }
    for method in ["GET", "POST"] {
        let path = "/api/v1/gimbals/camera/locck";
        let answer = window.ask(&format!("{method} {path} HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n"));
        let error = answer.json()["error"].as_str().expect("a sentence").to_owned();
        assert_eq!(answer.status, 404, "{method}");
        assert!(error.starts_with("a gimbal has nothing of that name; there are, to be read: attitude, "), "{error}");
        assert!(error.contains("; to be asked for with POST: control, point, turn, stop, lock, "), "{error}");
    }
    for method in ["POST", "PUT", "DELETE", "OPTIONS", "PATCH", "TRACE"] {
        let answer =
            window.ask(&format!("{method} /api/v1/status HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n"));
        let error = json!({"error": "another method is needed here; Allow says which: GET reads, POST with the token asks for something"});
        assert_eq!((answer.status, answer.json(), answer.header("allow")), (405, error, Some("GET,HEAD")), "{method}");
    }
}

#[test]
fn every_answer_says_how_it_may_be_used() {
    let window = Window::of(Snapshot::default());
    for path in ["/", "/api/v1/status", "/healthz", "/readyz", "/nothing"] {
        let answer = window.get(path);
        assert_eq!(answer.header("cache-control"), Some("no-store"), "{path}");
        assert_eq!(answer.header("x-content-type-options"), Some("nosniff"), "{path}");
        assert_eq!(answer.header("referrer-policy"), Some("no-referrer"), "{path}");
        assert_eq!(answer.header("cross-origin-resource-policy"), Some("same-origin"), "{path}");
        assert_eq!(answer.header("access-control-allow-origin"), None, "{path}");
        assert!(
            answer.header("content-security-policy").is_some_and(|policy| policy.starts_with("default-src 'none'"))
        );
    }
}

/// A name made to point at loopback (DNS rebinding) gets neither the status nor the page.
#[test]
fn another_host_is_refused() {
    let window = Window::of(canned::snapshot());
    for path in ["/", "/api/v1/status"] {
        let answer =
            window.ask(&format!("GET {path} HTTP/1.1\r\nHost: evil.example:8080\r\nConnection: close\r\n\r\n"));
        assert_eq!(answer.status, 403, "{path}");
        assert!(answer.json()["error"].as_str().is_some_and(|error| error.contains("http://localhost")));
    }
}

/// "At most 32 connections": for whoever comes later goes the oldest that asks for nothing.
#[test]
fn connections_that_ask_for_nothing_make_room() {
    let limits = Limits { connections: 2, header: FOREVER, lifetime: FOREVER, ..Limits::default() };
    let window = Window::open(Some(Snapshot::default()), limits);
    let mut first = window.connect();
    first.write_all(b"GET /healthz HT").expect("the kernel takes it");
    let mut second = window.connect();
    let mut third = window.connect();

    third.write_all(HEALTHZ).expect("the kernel takes the request");

    assert_eq!(Answer::read(third).body, "ok");
    first.set_read_timeout(Some(PATIENCE)).expect("a time-out");
    assert_eq!(first.read(&mut [0]).expect("the connection is closed"), 0);
    second.write_all(HEALTHZ).expect("the kernel takes the request");
    assert_eq!(Answer::read(second).body, "ok", "there was room for two");
}

/// Whoever has asked gets the answer, and whoever comes waits for that.
#[test]
fn connections_that_are_answered_are_not_cut() {
    let limits = Limits { connections: 1, ..Limits::default() };
    // It hangs, so that the answer takes a second.
    let window = Window::open(None, limits);
    let mut first = window.connect();
    first.write_all(HEALTHZ).expect("the kernel takes the request");
    let mut second = window.connect();
    second.write_all(b"GET / HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n").expect("the kernel takes it");

    let error = json!({"error": "the core did not answer within 1 s"});
    assert_eq!(Answer::read(first).json(), error);
    assert_eq!(Answer::read(second).status, 200);
}

/// Who asks on and on without reading, or sends a body by halves, keeps nobody out.
#[test]
fn connections_that_only_keep_us_busy_make_room() {
    let token: Token = "0123456789abcdef0123456789abcdef".parse().expect("a token");
    let limits = Limits { connections: 2, header: FOREVER, body: FOREVER, lifetime: FOREVER, ..Limits::default() };
    // Each answer takes the interval between two snapshots, so these would be there for minutes.
    let on_and_on = b"GET /api/v1/status HTTP/1.1\r\nHost: localhost\r\n\r\n".repeat(5000);
    let half = b"POST /api/v1/gimbals/camera/turn HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\n\
        Authorization: Bearer 0123456789abcdef0123456789abcdef\r\nContent-Length: 14\r\n\r\n{\"y";
    for busy in [&on_and_on[..], half] {
        let window = Window::controlled(Some(Snapshot::default()), Some(token.clone()), Ok(()), limits);
        let mut guests: Vec<_> = (0..10).map(|_| window.connect()).collect();
        for guest in &mut guests {
            guest.set_nonblocking(true).expect("a flag");
            // As much as the kernel takes; it may be cut already.
            let _ = guest.write(busy);
        }

        assert_eq!(window.get("/healthz").body, "ok");
    }
}

/// A client that sends its headers by the byte, or nothing at all, loses its place.
#[test]
fn slow_headers_are_cut() {
    let header = Duration::from_millis(200);
    let window = Window::open(Some(Snapshot::default()), Limits { header, lifetime: FOREVER, ..Limits::default() });
    for beginning in ["", "GET /healthz HT", "GET /healthz HTTP/1.1\r\nHost: localhost\r\n"] {
        let start = now();
        let mut client = window.connect();
        client.write_all(beginning.as_bytes()).expect("the kernel takes it");
        let mut answer = String::new();
        client.read_to_string(&mut answer).expect("the connection is closed");
        assert!(!answer.contains("200 OK"), "{beginning:?} got {answer:?}");
        assert!(start.elapsed() >= header, "{beginning:?} was cut after {:?}", start.elapsed());
    }
    let mut idle = window.connect();
    idle.write_all(b"GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n").expect("the kernel takes it");
    assert_eq!(Answer::read(idle).body, "ok", "answered, then closed although the client would stay");
}

/// Answers that nobody reads do not hold a place for ever.
#[test]
fn clients_that_do_not_read_are_cut() {
    let short = Duration::from_millis(200);
    let limits = Limits { lifetime: short, farewell: short, ..Limits::default() };
    let window = Window::open(Some(Snapshot::default()), limits);
    let mut client = window.connect();
    client.set_write_timeout(Some(PATIENCE)).expect("a time-out");
    let request = b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n".repeat(100);
    let error = loop {
        if let Err(error) = client.write_all(&request) {
            break error;
        }
    };
    assert!(matches!(error.kind(), ErrorKind::ConnectionReset | ErrorKind::BrokenPipe), "{error}");
}

#[test]
fn headers_without_end_are_refused() {
    let window = Window::of(Snapshot::default());
    let mut client = window.connect();
    let padding = format!("GET /healthz HTTP/1.1\r\nHost: localhost\r\nX-Padding: {}\r\n\r\n", "a".repeat(64 * 1024));
    client.write_all(padding.as_bytes()).expect("the kernel takes it");
    let mut status_line = [0; 12];
    client.read_exact(&mut status_line).expect("an answer");
    assert_eq!(&status_line, b"HTTP/1.1 431");
}

/// "The listening port taken or address not there yet: log a WARN with the remedy once and retry, never fatal."
#[test]
fn a_port_that_is_taken_is_tried_again() {
    let journal = Journal::default();
    let writer = journal.clone();
    let subscriber = tracing_subscriber::fmt().with_ansi(false).with_writer(move || writer.clone()).finish();
    let _guard = tracing::subscriber::set_default(subscriber);
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().expect("a runtime");
    runtime.block_on(async {
        let occupant = std::net::TcpListener::bind("127.0.0.1:0").expect("a port");
        let address = occupant.local_addr().expect("its address");
        let (core, _requests, _snapshots) = core();
        let retry = Duration::from_millis(20);
        let settings = HttpSettings { listen: address, token: None };
        tokio::spawn(run(settings, core, Limits { retry, ..Limits::default() }));
        let in_time = async {
            while !journal.text().contains("trying again") {
                tokio::time::sleep(retry).await;
            }
            tokio::time::sleep(3 * retry).await;
            drop(occupant);
            while !journal.text().contains("can be opened") {
                tokio::time::sleep(retry).await;
            }
        };
        tokio::time::timeout(PATIENCE, in_time).await.expect("it opens once the port is free");
        TcpStream::connect(address).expect("it listens");
    });
    let text = journal.text();
    let warnings: Vec<_> = text.lines().filter(|line| line.contains(" WARN ")).collect();
    assert_eq!(warnings.len(), 1, "{text}");
    assert!(warnings[0].contains("set another [http] listen"), "{text}");
}

#[test]
fn the_thread_ends_with_the_core() {
    let (core, requests, snapshots) = core();
    let settings = HttpSettings { listen: LOOPBACK.parse().expect("an address"), token: None };
    let thread = spawn(settings, core).expect("a thread");
    assert!(!thread.is_finished());
    drop((requests, snapshots));
    let start = now();
    while !thread.is_finished() {
        assert!(start.elapsed() < PATIENCE, "the thread outlives the core");
        std::thread::yield_now();
    }
    thread.join().expect("no panic");
}

const LOOPBACK: &str = "127.0.0.1:0";
const HEALTHZ: &[u8] = b"GET /healthz HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n";
/// Longer than any test takes.
const FOREVER: Duration = Duration::from_secs(600);
/// How long a test waits for what must happen.
const PATIENCE: Duration = Duration::from_secs(20);

#[expect(clippy::disallowed_methods, reason = "time-outs of real sockets show in real time only")]
fn now() -> Instant {
    Instant::now()
}

fn core() -> (CoreHandle, mpsc::Receiver<CoreRequest>, watch::Sender<Arc<Snapshot>>) {
    let (requests, received) = mpsc::channel(4);
    let (published, snapshots) = watch::channel(Arc::default());
    (CoreHandle { requests, snapshots }, received, published)
}

/// A window on a port of its own, and the core behind it.
struct Window {
    address: SocketAddr,
    stop: Option<oneshot::Sender<()>>,
    thread: Option<JoinHandle<()>>,
    /// What the core was asked to do.
    asked: std::sync::mpsc::Receiver<(String, Asked)>,
}

impl Window {
    fn of(snapshot: Snapshot) -> Self {
        Self::open(Some(snapshot), Limits::default())
    }

    /// Without a snapshot the core hangs.
    fn open(snapshot: Option<Snapshot>, limits: Limits) -> Self {
        Self::controlled(snapshot, None, Ok(()), limits)
    }

    /// With a core that answers so whatever it is asked.
    fn controlled(snapshot: Option<Snapshot>, token: Option<Token>, outcome: Outcome, limits: Limits) -> Self {
        let (told, address) = std::sync::mpsc::channel();
        let (tell, asked) = std::sync::mpsc::channel();
        let (stop, stopped) = oneshot::channel();
        let thread = std::thread::spawn(move || {
            let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().expect("a runtime");
            runtime.block_on(async {
                let listener = TcpListener::bind(LOOPBACK).await.expect("a port");
                let address = listener.local_addr().expect("its address");
                told.send(address).expect("the test waits");
                let (core, mut requests, published) = core();
                let answer = async {
                    while let (Some(snapshot), Some(request)) = (&snapshot, requests.recv().await) {
                        match request {
                            CoreRequest::Refresh => drop(published.send_replace(Arc::new(snapshot.clone()))),
                            CoreRequest::Ask { gimbal, asked, answer } => {
                                // A test may not care, and an asker may have gone.
                                let _ = tell.send((gimbal, asked));
                                let _ = answer.send(outcome.clone());
                            }
                        }
                    }
                    std::future::pending::<()>().await;
                };
                tokio::select! {
                    () = attend(listener, address, core, token, limits) => {}
                    () = answer => {}
                    _ = stopped => {}
                }
            });
        });
        let address = address.recv_timeout(PATIENCE).expect("the window opens");
        Self { address, stop: Some(stop), thread: Some(thread), asked }
    }

    fn connect(&self) -> TcpStream {
        let stream = TcpStream::connect(self.address).expect("the window listens");
        stream.set_read_timeout(Some(PATIENCE)).expect("a time-out");
        stream
    }

    fn get(&self, path: &str) -> Answer {
        self.ask(&format!("GET {path} HTTP/1.1\r\nHost: {}\r\nConnection: close\r\n\r\n", self.address))
    }

    fn ask(&self, request: &str) -> Answer {
        let mut stream = self.connect();
        stream.write_all(request.as_bytes()).expect("the window takes the request");
        Answer::read(stream)
    }
}

impl Drop for Window {
    fn drop(&mut self) {
        drop(self.stop.take());
        if let Some(thread) = self.thread.take()
            && thread.join().is_err()
            && !std::thread::panicking()
        {
            panic!("the window's thread panicked");
        }
    }
}

struct Answer {
    status: u16,
    head: String,
    body: String,
}

impl Answer {
    fn read(mut stream: TcpStream) -> Self {
        let mut text = String::new();
        stream.read_to_string(&mut text).expect("a whole answer");
        let (head, body) = text.split_once("\r\n\r\n").expect("headers, then a body");
        let status = head.split(' ').nth(1).and_then(|status| status.parse().ok()).expect("a status");
        Self { status, head: head.to_owned(), body: body.to_owned() }
    }

    fn header(&self, name: &str) -> Option<&str> {
        let mut lines = self.head.lines().filter_map(|line| line.split_once(": "));
        lines.find(|(key, _)| key.eq_ignore_ascii_case(name)).map(|(_, value)| value)
    }

    fn json(&self) -> Value {
        assert_eq!(self.header("content-type"), Some("application/json"));
        serde_json::from_str(&self.body).expect("strict JSON")
    }
}

#[derive(Clone, Default)]
struct Journal(Arc<Mutex<Vec<u8>>>);

impl Journal {
    fn text(&self) -> String {
        String::from_utf8(self.0.lock().expect("not poisoned").clone()).expect("text")
    }
}

impl Write for Journal {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.lock().expect("not poisoned").write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}
