//! What the window shows: the state of the daemon at one moment.
//!
//! Angles in degrees, distances in metres, ages in milliseconds; what is not known is `None`, never NaN.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::gimbals::details::GimbalDetails;

/// The content of `/api/v1/status`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Snapshot {
    pub version: String,
    pub uptime_s: f64,
    /// `None` until it is settled.
    pub system_id: Option<u8>,
    pub links: Vec<LinkSnapshot>,
    pub vehicle: VehicleSnapshot,
    pub gimbals: Vec<GimbalSnapshot>,
    pub conflicts: Vec<String>,
    /// What happened lately, the latest first.
    #[serde(default)]
    pub events: Vec<EventSnapshot>,
}

#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct EventSnapshot {
    /// Different for each event since the start, and rising.
    pub id: u64,
    /// When it last happened, in seconds since the start.
    pub at_s: f64,
    pub age_ms: u64,
    /// When it first happened: the same refusal again and again is one event.
    pub first_at_s: f64,
    pub count: u64,
    pub gimbal: String,
    /// `taken`, `taken_over`, `borrowed`, `restored`, `delegated`, `released`, `cleared`, `lapsed`, `holder_restarted`, `system_gone`,
    /// `refused`, `acquire_war`, `gimbal_found`, `gimbal_back`, `gimbal_lost`, `gimbal_shut_down`, `gimbal_restarted`,
    /// `gimbal_ready`, `fault`,
    /// `operated`, `operation_failed`, `rates_ended`, `roi_started` or `roi_ended`.
    pub what: String,
    /// Of control: `primary` or `secondary`.
    pub place: Option<String>,
    /// Who did it, or to whom it happened.
    pub who: Option<String>,
    /// Who had control before; of a refusal, who has it and so stood in the way.
    pub from: Option<String>,
    /// Who has control from then on.
    pub to: Option<String>,
    /// Why somebody was refused, or a rotation ended.
    pub reason: Option<String>,
    /// The same as a sentence.
    pub text: String,
}

#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LinkSnapshot {
    pub name: String,
    pub role: String,
    pub endpoint: String,
    /// `up` or `down`.
    pub state: String,
    /// Why it is down.
    pub reason: Option<String>,
    pub rx_frames: u64,
    pub tx_frames: u64,
    pub rx_bytes: u64,
    pub tx_bytes: u64,
    pub crc_errors: u64,
    pub resync_bytes: u64,
    pub dropped_frames: u64,
    /// Why frames towards this link were dropped, or frames from it not delivered.
    pub dropped: BTreeMap<String, u64>,
    pub peers: Vec<PeerSnapshot>,
}

#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PeerSnapshot {
    pub address: String,
    /// Who was heard there, as `system/component`.
    pub components: Vec<String>,
    /// Since anything was heard; `None` before that.
    pub age_ms: Option<u64>,
}

#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct VehicleSnapshot {
    pub system_id: Option<u8>,
    /// `ardupilot`, `px4`, or the number of another `MAV_AUTOPILOT`.
    pub autopilot: Option<String>,
    pub alive: bool,
    pub roll_deg: Option<f64>,
    pub pitch_deg: Option<f64>,
    pub heading_deg: Option<f64>,
    pub attitude_age_ms: Option<u64>,
    pub latitude_deg: Option<f64>,
    pub longitude_deg: Option<f64>,
    pub altitude_amsl_m: Option<f64>,
    pub position_age_ms: Option<u64>,
    /// Turning rate about Down as the autopilot reports it: in 286, where 0 on the wire means that it does not know, or
    /// else with its attitude.
    pub yaw_rate_dps: Option<f64>,
    /// Who tells gimbals the vehicle's state (286): `autopilot` for any component of the vehicle, `synthesized` when we
    /// make it from what the autopilot tells others.
    pub state_for_gimbal: Option<String>,
    /// What was known and is too old to act on: `heading` after a second, which conversions between North and the nose
    /// need, and `position` after five, which ROI needs.
    pub stale: Vec<String>,
}

#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GimbalSnapshot {
    pub name: String,
    /// It has an entry in the configuration, and is missed when it is not there.
    pub configured: bool,
    pub family: String,
    pub manager_component_id: u8,
    pub device_id: Option<u8>,
    /// The device's `system/component`.
    pub device: Option<String>,
    /// `searching`, `alive` or `lost`.
    pub state: String,
    pub vendor: Option<String>,
    pub model: Option<String>,
    pub firmware: Option<String>,
    pub attitude: AttitudeSnapshot,
    pub setpoint: Option<SetpointSnapshot>,
    /// Who holds primary control, as `system/component`, or `http` for programs that ask over HTTP.
    pub primary: Option<String>,
    pub secondary: Option<String>,
    /// For how long they have held it.
    pub primary_age_ms: Option<u64>,
    pub secondary_age_ms: Option<u64>,
    /// Who gets primary control back from the autopilot, which has borrowed it.
    pub lender: Option<String>,
    /// Who may take control from a holder: `open`, `ask`, `priority` or `exclusive`.
    #[serde(default)]
    pub takeover: String,
    pub roi: Option<RoiSnapshot>,
    pub flags: Vec<String>,
    pub failure_flags: Vec<String>,
    /// What the autopilot sees of it, where it is presented to it.
    #[serde(default)]
    pub presented: Option<PresentedSnapshot>,
    /// Sender to reason to count: what was refused.
    pub rejected: BTreeMap<String, BTreeMap<String, u64>>,
    /// What only its family knows of it.
    #[serde(default)]
    pub details: GimbalDetails,
}

impl GimbalSnapshot {
    /// How it is, for people: its state, or that it was shut down.
    pub fn condition(&self) -> &str {
        let is_shut_down = self.state == "lost" && self.details.stage.as_deref() == Some("shut_down");
        if is_shut_down { "shut down" } else { &self.state }
    }
}

/// A gimbal as the autopilot sees it (`[autopilot] present_device`).
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PresentedSnapshot {
    /// The device's `system/component` there.
    pub device: String,
    /// What the autopilot's stream of setpoints does: `silent`, `steady` when it asks for nothing new, `asks`, or
    /// `overruled` while it goes on moving after somebody else took over.
    pub stream: String,
    /// Since it last asked for something.
    pub asked_age_ms: Option<u64>,
}

#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct AttitudeSnapshot {
    pub roll_deg: Option<f64>,
    pub pitch_deg: Option<f64>,
    pub yaw_vehicle_deg: Option<f64>,
    pub yaw_earth_deg: Option<f64>,
    /// The gimbal tells nothing: it is where it would be if it did what it is told.
    #[serde(default)]
    pub assumed: bool,
    pub age_ms: Option<u64>,
}

#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SetpointSnapshot {
    /// `angle`, `rate`, `hold`, `retract`, `neutral` or `roi`.
    pub mode: String,
    #[serde(default)]
    pub roll_deg: Option<f64>,
    pub pitch_deg: Option<f64>,
    pub yaw_deg: Option<f64>,
    /// `vehicle` or `earth`.
    pub yaw_frame: Option<String>,
    #[serde(default)]
    pub roll_rate_dps: Option<f64>,
    pub pitch_rate_dps: Option<f64>,
    pub yaw_rate_dps: Option<f64>,
    /// Whose demand it is, as `system/component`.
    pub source: Option<String>,
    /// It is held as it is, because the position or heading of the vehicle that it follows is not known any more.
    #[serde(default)]
    pub stale: bool,
    /// How far the holder of secondary control has moved the camera from there; part of the angles above.
    #[serde(default)]
    pub nudge_pitch_deg: f64,
    #[serde(default)]
    pub nudge_yaw_deg: f64,
}

#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RoiSnapshot {
    pub latitude_deg: f64,
    pub longitude_deg: f64,
    pub altitude_amsl_m: f64,
}
