//! What there is to read, and whom it is told.

use super::*;

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
                    "mode": "angle", "roll_deg": 2.0, "pitch_deg": -45.0, "yaw_deg": 120.0, "yaw_frame": "earth",
                    "roll_rate_dps": null, "pitch_rate_dps": null, "yaw_rate_dps": null, "source": "255/190", "stale": false,
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
    assert_eq!(answer.body, include_str!("../page.html"));
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
