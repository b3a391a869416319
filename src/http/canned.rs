//! A snapshot with everything in it, for tests.

use std::collections::BTreeMap;

use crate::bridge::snapshot::{
    AttitudeSnapshot, EventSnapshot, GimbalSnapshot, LinkSnapshot, PeerSnapshot, PresentedSnapshot, RoiSnapshot,
    SetpointSnapshot, Snapshot, VehicleSnapshot,
};
use crate::gimbals::details::GimbalDetails;

/// Two links, of which one is down; one gimbal that is held, and one that is searched for.
pub fn snapshot() -> Snapshot {
    Snapshot {
        version: "0.1.0".into(),
        uptime_s: 3725.5,
        system_id: Some(1),
        links: vec![autopilot_link(), gimbal_link()],
        vehicle: VehicleSnapshot {
            system_id: Some(1),
            autopilot: Some("ardupilot".into()),
            alive: true,
            roll_deg: Some(2.5),
            pitch_deg: Some(-1.25),
            heading_deg: Some(87.0),
            attitude_age_ms: Some(12),
            latitude_deg: Some(47.397_742),
            longitude_deg: Some(8.545_594),
            altitude_amsl_m: Some(488.5),
            position_age_ms: Some(95),
            yaw_rate_dps: Some(3.5),
            state_for_gimbal: Some("synthesized".into()),
            stale: Vec::new(),
        },
        gimbals: vec![held_gimbal(), searched_gimbal()],
        conflicts: vec!["1/191 is also used by 10.0.0.7: set its component id to another value".into()],
        events: vec![refusal(), take_over()],
    }
}

fn autopilot_link() -> LinkSnapshot {
    LinkSnapshot {
        name: "autopilot".into(),
        role: "autopilot".into(),
        endpoint: "udpin:0.0.0.0:14540".into(),
        state: "up".into(),
        reason: None,
        rx_frames: 123_456,
        tx_frames: 7_890,
        rx_bytes: 4_938_240,
        tx_bytes: 315_600,
        crc_errors: 2,
        resync_bytes: 17,
        dropped_frames: 40,
        dropped: BTreeMap::from([("duplicate".into(), 3), ("queue_full".into(), 37)]),
        peers: vec![PeerSnapshot {
            address: "127.0.0.1:14550".into(),
            components: vec!["1/1".into()],
            age_ms: Some(3),
        }],
    }
}

fn gimbal_link() -> LinkSnapshot {
    LinkSnapshot {
        name: "gimbal".into(),
        role: "gimbal".into(),
        endpoint: "serial:/dev/serial0:115200".into(),
        state: "down".into(),
        reason: Some("no such file or directory".into()),
        ..LinkSnapshot::default()
    }
}

fn held_gimbal() -> GimbalSnapshot {
    GimbalSnapshot {
        name: "camera".into(),
        configured: true,
        family: "mavlink_v2".into(),
        manager_component_id: 191,
        device_id: Some(154),
        device: Some("1/154".into()),
        state: "alive".into(),
        vendor: Some("Acme".into()),
        model: Some("Pixy".into()),
        firmware: Some("7.8.1".into()),
        attitude: AttitudeSnapshot {
            roll_deg: Some(0.25),
            pitch_deg: Some(-42.5),
            yaw_vehicle_deg: Some(30.0),
            yaw_earth_deg: Some(117.0),
            assumed: false,
            age_ms: Some(18),
        },
        setpoint: Some(SetpointSnapshot {
            mode: "angle".into(),
            roll_deg: Some(2.0),
            pitch_deg: Some(-45.0),
            yaw_deg: Some(120.0),
            yaw_frame: Some("earth".into()),
            roll_rate_dps: None,
            pitch_rate_dps: None,
            yaw_rate_dps: None,
            source: Some("255/190".into()),
            stale: false,
            nudge_pitch_deg: -2.5,
            nudge_yaw_deg: 0.0,
        }),
        primary: Some("255/190".into()),
        secondary: None,
        primary_age_ms: Some(61_500),
        secondary_age_ms: None,
        lender: None,
        takeover: "ask".into(),
        roi: Some(RoiSnapshot { latitude_deg: 47.4, longitude_deg: 8.55, altitude_amsl_m: 430.0 }),
        flags: vec!["yaw_lock".into(), "roll_lock".into()],
        failure_flags: vec!["motor_error".into()],
        rejected: BTreeMap::from([("1/100".into(), BTreeMap::from([("not_in_control".into(), 12)]))]),
        presented: Some(PresentedSnapshot {
            device: "1/154".into(),
            stream: "steady".into(),
            asked_age_ms: Some(12_000),
        }),
        details: GimbalDetails {
            generation: Some("v2".into()),
            faults: vec!["firmware 7.8.7 reports a wrong yaw from North".into()],
            parameters: BTreeMap::from([("RC_TYPE".into(), 7.0)]),
            ..GimbalDetails::default()
        },
    }
}

fn searched_gimbal() -> GimbalSnapshot {
    GimbalSnapshot {
        name: "lamp".into(),
        configured: true,
        family: "auto".into(),
        manager_component_id: 192,
        state: "searching".into(),
        takeover: "open".into(),
        ..GimbalSnapshot::default()
    }
}

fn refusal() -> EventSnapshot {
    EventSnapshot {
        id: 8,
        at_s: 3725.25,
        age_ms: 250,
        first_at_s: 3700.0,
        count: 12,
        gimbal: "camera".into(),
        what: "refused".into(),
        place: None,
        who: Some("1/100".into()),
        from: Some("255/190".into()),
        to: None,
        reason: Some("not_in_control".into()),
        text: "1/100 was refused: 255/190 is in control".into(),
    }
}

fn take_over() -> EventSnapshot {
    EventSnapshot {
        id: 7,
        at_s: 3664.0,
        age_ms: 61_500,
        first_at_s: 3664.0,
        count: 1,
        gimbal: "camera".into(),
        what: "taken_over".into(),
        place: Some("primary".into()),
        who: Some("255/190".into()),
        from: Some("1/1".into()),
        to: Some("255/190".into()),
        reason: None,
        text: "255/190 took control from 1/1".into(),
    }
}
