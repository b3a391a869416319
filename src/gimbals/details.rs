//! What a gimbal tells beyond what every gimbal has, for whoever looks.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

/// The part of a gimbal's state that its family knows; part of `/api/v1/status`. What a gimbal does not tell is `None`,
/// or missing.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GimbalDetails {
    /// Which of its family's protocols it speaks.
    pub generation: Option<String>,
    /// Faults of this gimbal or its firmware, and what to do about them.
    pub faults: Vec<String>,
    /// Its parameters by name, as far as they were read.
    pub parameters: BTreeMap<String, f64>,
    /// How far it has started: `searching`, `reading_parameters`, `aligning` or `running`; `restarting` when it was told to,
    /// and `shut_down` after it was told that, until it is heard again.
    pub stage: Option<String>,
    /// Its firmware as its maker writes it, such as `7.8.9 alpha`.
    pub version: Option<String>,
    /// `off`, `lock`, `follow`, `mapping` or `reset`.
    pub mode: Option<String>,
    /// What it does, as its status says: `off`, or some of `init`, `on`, `lock`, `follow`, `search home`, `set home`,
    /// `error`, with commas between.
    pub operation: Option<String>,
    /// Sensors and joints that are not in place, by their names.
    pub not_aligned: Vec<String>,
    pub motors_on: Option<bool>,
    pub battery_v: Option<f64>,
    /// Share of its cycle that is used.
    pub load_percent: Option<f64>,
    pub imu: Option<ImuDetails>,
    pub encoders: Option<EncoderDetails>,
    /// `tilt`, `roll` and `pan`.
    pub axes: BTreeMap<String, AxisDetails>,
    pub gyro_filter: Option<f64>,
    pub output_filter: Option<f64>,
    pub gain: Option<f64>,
    /// What its radio receiver is; `sync` is MAVLink. A number where the type has no name.
    pub radio_type: Option<String>,
    /// `counts` or `angles`.
    pub encoder_unit: Option<String>,
    /// Whether the autopilot's attitude keeps its yaw from drifting.
    pub combined_attitude: Option<bool>,
    /// Whether it returns home whenever lock and follow are switched.
    pub home_on_mode_change: Option<bool>,
    /// `encoders`, `mount_orientation`, `attitude_status` and `raw_imu`.
    pub streams: BTreeMap<String, StreamDetails>,
    /// For how long each of its messages was not heard, by the message's name.
    pub message_ages_ms: BTreeMap<String, u64>,
}

/// The inertial sensors in the camera's frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ImuDetails {
    /// x, y, z, in units of gravity.
    pub acceleration_g: [f64; 3],
    /// About x, y, z, degrees per second.
    pub rates_dps: [f64; 3],
    /// x, y, z as sent.
    pub acceleration_raw: [i16; 3],
    pub rates_raw: [i16; 3],
    /// By the gimbal's clock.
    pub time_us: u64,
    pub age_ms: u64,
}

/// The joints, which are no attitude: the vehicle's own is not in them.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct EncoderDetails {
    pub tilt_deg: f64,
    pub roll_deg: f64,
    pub pan_deg: f64,
    /// Tilt, roll and pan as sent: counts, 65536 to the turn, or hundredths of a degree.
    pub raw: [i16; 3],
    pub age_ms: u64,
}

/// How one axis is set; numbers without a unit are the gimbal's own scale.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct AxisDetails {
    pub follow_speed: Option<f64>,
    pub follow_smoothing: Option<f64>,
    pub follow_window_deg: Option<f64>,
    pub control_speed_dps: Option<f64>,
    pub control_smoothing: Option<f64>,
    pub reversed: Option<bool>,
    pub stiffness: Option<f64>,
    pub hold_strength: Option<f64>,
    /// Software limits; up and right are positive.
    pub min_deg: Option<f64>,
    pub max_deg: Option<f64>,
}

/// How often a message is wanted, and comes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct StreamDetails {
    /// 0 where it is switched off; `None` where the gimbal sends it as it likes.
    pub wanted_hz: Option<f64>,
    /// Over the last seconds.
    pub measured_hz: Option<f64>,
}
