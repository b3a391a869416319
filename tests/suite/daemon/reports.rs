//! What `/api/v1/status` says of a real daemon.

use std::time::Duration;

use gimbald::sim::vehicle::{Vehicle, VehicleSettings};
use gimbald::timestamp::Timestamp;
use serde_json::Value;

use super::{set_pitchyaw, simulated_gimbal};
use crate::support::daemon::{Shared, Site, Station, link, wait_for};
use crate::support::world::{GCS, heartbeat};

/// The fields of `/api/v1/status`, as the interface promises them.
const TOP: &[&str] = &["version", "uptime_s", "system_id", "links", "vehicle", "gimbals", "conflicts"];
const LINK: &[&str] = &[
    "name",
    "role",
    "endpoint",
    "state",
    "reason",
    "rx_frames",
    "tx_frames",
    "rx_bytes",
    "tx_bytes",
    "crc_errors",
    "resync_bytes",
    "dropped_frames",
    "peers",
];
const PEER: &[&str] = &["address", "components", "age_ms"];
const VEHICLE: &[&str] = &[
    "system_id",
    "autopilot",
    "alive",
    "roll_deg",
    "pitch_deg",
    "heading_deg",
    "attitude_age_ms",
    "latitude_deg",
    "longitude_deg",
    "altitude_amsl_m",
    "position_age_ms",
    "yaw_rate_dps",
    "state_for_gimbal",
    "stale",
];
const GIMBAL: &[&str] = &[
    "name",
    "family",
    "manager_component_id",
    "device_id",
    "device",
    "state",
    "vendor",
    "model",
    "firmware",
    "attitude",
    "setpoint",
    "primary",
    "secondary",
    "primary_age_ms",
    "secondary_age_ms",
    "lender",
    "takeover",
    "roi",
    "flags",
    "failure_flags",
    "rejected",
    "presented",
    "details",
];
const ATTITUDE: &[&str] = &["roll_deg", "pitch_deg", "yaw_vehicle_deg", "yaw_earth_deg", "assumed", "age_ms"];
const SETPOINT: &[&str] = &[
    "mode",
    "roll_deg",
    "pitch_deg",
    "yaw_deg",
    "yaw_frame",
    "roll_rate_dps",
    "pitch_rate_dps",
    "yaw_rate_dps",
    "source",
    "stale",
    "nudge_pitch_deg",
    "nudge_yaw_deg",
];

#[track_caller]
fn assert_has(value: &Value, fields: &[&str]) {
    let object = value.as_object().expect("an object");
    let missing: Vec<&&str> = fields.iter().filter(|field| !object.contains_key(**field)).collect();
    assert!(missing.is_empty(), "{missing:?} are missing in {value:#}");
}

fn links() -> String {
    [
        link("autopilot", "autopilot", "serial:{dir}/autopilot:921600"),
        link("gimbal", "gimbal", "serial:{dir}/gimbal:115200"),
        link("ground", "ground", "udpin:{ip}:14550"),
        "[vehicle]\nsystem_id = 1\n".to_owned(),
    ]
    .concat()
}

/// "Angles in degrees, distances in metres, ages in milliseconds, unknown is `null`, never NaN."
/// Protocol checklist 180: "When a value is NaN internally, HTTP JSON has null in its place and is parseable by a strict
/// parser."
#[test]
fn what_is_not_known_is_null() {
    let site = Site::new();
    let daemon = site.start(&links(), &[]);

    let status = wait_for("the status", || daemon.json());

    assert_has(&status, TOP);
    assert_has(&status["links"][0], LINK);
    assert_has(&status["vehicle"], VEHICLE);
    for field in VEHICLE.iter().filter(|field| !["alive", "stale"].contains(*field)) {
        assert_eq!(status["vehicle"][field], Value::Null, "{field}");
    }
    assert_eq!(status["vehicle"]["stale"], serde_json::json!([]), "what was never known is not old");
    assert_eq!((&status["vehicle"]["alive"], &status["system_id"]), (&Value::Bool(false), &Value::from(1)));
    let (_, text) = daemon.get("/api/v1/status").expect("an answer");
    assert!(!text.contains("NaN") && !text.contains("nan"), "{text}");
}

#[test]
fn what_is_known_is_told_in_degrees_and_metres() {
    let site = Site::new();
    let gimbal = simulated_gimbal();
    let _cable = gimbal.plug_in(&site.path("gimbal"));
    let vehicle = Shared::new(Vehicle::new(Timestamp::ZERO, VehicleSettings::default()));
    let _other_cable = vehicle.plug_in(&site.path("autopilot"));
    let daemon = site.start(&links(), &[]);
    daemon.wait_for_gimbal();
    let mut ground = Station::new(GCS, site.port(14_550));
    ground.send(&heartbeat(6, 8));
    ground.send(&set_pitchyaw(-0.5, 0.25, f32::NAN, f32::NAN));

    let near = |value: Option<f64>, wanted: f64| value.is_some_and(|value| (value - wanted).abs() < 0.5);
    let status = daemon.wait_until("the attitude and the position", |status| {
        near(status.gimbals[0].attitude.pitch_deg, (-0.5_f64).to_degrees())
            && near(status.gimbals[0].attitude.yaw_vehicle_deg, 0.25_f64.to_degrees())
            && status.vehicle.latitude_deg.is_some()
            && status.vehicle.heading_deg.is_some()
            && status.gimbals[0].vendor.is_some()
    });

    let json = daemon.json().expect("it answers");
    assert_has(&json["vehicle"], VEHICLE);
    assert_has(&json["links"][1]["peers"][0], PEER);
    assert_has(&json["gimbals"][0], GIMBAL);
    assert_has(&json["gimbals"][0]["attitude"], ATTITUDE);
    assert_has(&json["gimbals"][0]["setpoint"], SETPOINT);
    assert_eq!(json["gimbals"][0]["device"], "1/154");
    assert_eq!(json["gimbals"][0]["roi"], Value::Null);
    assert_eq!(json["links"][1]["peers"][0]["components"], serde_json::json!(["1/154"]));
    let setpoint = status.gimbals[0].setpoint.clone().expect("a setpoint");
    assert_eq!((setpoint.mode.as_str(), setpoint.source.as_deref()), ("angle", Some("255/190")));
    assert!(near(setpoint.pitch_deg, (-0.5_f64).to_degrees()), "{setpoint:?}");
    // Where the simulated vehicle circles.
    let (latitude, longitude) =
        (status.vehicle.latitude_deg.expect("known"), status.vehicle.longitude_deg.expect("known"));
    assert!((latitude - 47.4).abs() < 0.1 && (longitude - 8.55).abs() < 0.1, "{latitude} {longitude}");
    assert!(
        status.vehicle.altitude_amsl_m.is_some_and(|height| (300.0..800.0).contains(&height)),
        "{:?}",
        status.vehicle
    );
    let age = status.gimbals[0].attitude.age_ms.expect("known");
    assert!(age < Duration::from_secs(1).as_millis() as u64, "{age}");
}
