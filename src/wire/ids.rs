//! Identities, and the numbers of the MAVLink definitions that gimbald names.

use std::fmt;

/// System and component id together: who sends or receives.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct MavId {
    pub system: u8,
    pub component: u8,
}

impl MavId {
    pub const fn new(system: u8, component: u8) -> Self {
        Self { system, component }
    }
}

impl fmt::Display for MavId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.system, self.component)
    }
}

/// `MAV_COMPONENT`.
pub mod component {
    pub const AUTOPILOT1: u8 = 1;
    pub const CAMERA: u8 = 100;
    pub const CAMERA6: u8 = 105;
    pub const GIMBAL: u8 = 154;
    pub const GIMBAL2: u8 = 171;
    pub const GIMBAL3: u8 = 172;
    pub const GIMBAL4: u8 = 173;
    pub const GIMBAL5: u8 = 174;
    pub const GIMBAL6: u8 = 175;
    pub const MISSIONPLANNER: u8 = 190;
    pub const ONBOARD_COMPUTER: u8 = 191;
    pub const ONBOARD_COMPUTER4: u8 = 194;
}

/// Message ids.
pub mod message {
    pub const HEARTBEAT: u32 = 0;
    pub const SYS_STATUS: u32 = 1;
    pub const SYSTEM_TIME: u32 = 2;
    pub const PARAM_REQUEST_READ: u32 = 20;
    pub const PARAM_REQUEST_LIST: u32 = 21;
    pub const PARAM_VALUE: u32 = 22;
    pub const PARAM_SET: u32 = 23;
    pub const RAW_IMU: u32 = 27;
    pub const ATTITUDE: u32 = 30;
    pub const ATTITUDE_QUATERNION: u32 = 31;
    pub const LOCAL_POSITION_NED: u32 = 32;
    pub const GLOBAL_POSITION_INT: u32 = 33;
    pub const REQUEST_DATA_STREAM: u32 = 66;
    pub const MANUAL_CONTROL: u32 = 69;
    pub const COMMAND_INT: u32 = 75;
    pub const COMMAND_LONG: u32 = 76;
    pub const COMMAND_ACK: u32 = 77;
    pub const COMMAND_CANCEL: u32 = 80;
    pub const ATTITUDE_TARGET: u32 = 83;
    pub const POSITION_TARGET_LOCAL_NED: u32 = 85;
    pub const POSITION_TARGET_GLOBAL_INT: u32 = 87;
    pub const RADIO_STATUS: u32 = 109;
    pub const TIMESYNC: u32 = 111;
    pub const AUTOPILOT_VERSION: u32 = 148;
    pub const MOUNT_CONFIGURE: u32 = 156;
    pub const MOUNT_CONTROL: u32 = 157;
    pub const MOUNT_STATUS: u32 = 158;
    pub const RADIO: u32 = 166;
    pub const EKF_STATUS_REPORT: u32 = 193;
    pub const ESTIMATOR_STATUS: u32 = 230;
    pub const HOME_POSITION: u32 = 242;
    pub const MESSAGE_INTERVAL: u32 = 244;
    pub const EXTENDED_SYS_STATE: u32 = 245;
    pub const STATUSTEXT: u32 = 253;
    pub const CAMERA_INFORMATION: u32 = 259;
    pub const MOUNT_ORIENTATION: u32 = 265;
    pub const GIMBAL_MANAGER_INFORMATION: u32 = 280;
    pub const GIMBAL_MANAGER_STATUS: u32 = 281;
    pub const GIMBAL_MANAGER_SET_ATTITUDE: u32 = 282;
    pub const GIMBAL_DEVICE_INFORMATION: u32 = 283;
    pub const GIMBAL_DEVICE_SET_ATTITUDE: u32 = 284;
    pub const GIMBAL_DEVICE_ATTITUDE_STATUS: u32 = 285;
    pub const AUTOPILOT_STATE_FOR_GIMBAL_DEVICE: u32 = 286;
    pub const GIMBAL_MANAGER_SET_PITCHYAW: u32 = 287;
    pub const GIMBAL_MANAGER_SET_MANUAL_CONTROL: u32 = 288;
    pub const PARAM_EXT_REQUEST_READ: u32 = 320;
    pub const PARAM_EXT_REQUEST_LIST: u32 = 321;
    pub const PARAM_EXT_SET: u32 = 323;
    pub const TUNNEL: u32 = 385;
    pub const COMPONENT_INFORMATION_BASIC: u32 = 396;
    pub const STORM32_GIMBAL_MANAGER_INFORMATION: u32 = 60_010;
    pub const STORM32_GIMBAL_MANAGER_STATUS: u32 = 60_011;
}

/// `MAV_CMD`.
pub mod command {
    pub const DO_SET_ROI_LOCATION: u16 = 195;
    pub const DO_SET_ROI_WPNEXT_OFFSET: u16 = 196;
    pub const DO_SET_ROI_NONE: u16 = 197;
    pub const DO_SET_ROI_SYSID: u16 = 198;
    pub const DO_SET_ROI: u16 = 201;
    pub const DO_MOUNT_CONFIGURE: u16 = 204;
    pub const DO_MOUNT_CONTROL: u16 = 205;
    pub const DO_MOUNT_CONTROL_QUAT: u16 = 220;
    pub const PREFLIGHT_REBOOT_SHUTDOWN: u16 = 246;
    pub const GET_MESSAGE_INTERVAL: u16 = 510;
    pub const SET_MESSAGE_INTERVAL: u16 = 511;
    pub const REQUEST_MESSAGE: u16 = 512;
    pub const REQUEST_PROTOCOL_VERSION: u16 = 519;
    pub const REQUEST_AUTOPILOT_CAPABILITIES: u16 = 520;
    pub const DO_GIMBAL_MANAGER_PITCHYAW: u16 = 1000;
    pub const DO_GIMBAL_MANAGER_CONFIGURE: u16 = 1001;
    /// `MAV_CMD_DO_GIMBAL_MANAGER_TRACK_RECTANGLE` until 2020; no id of today.
    pub const DO_GIMBAL_MANAGER_TRACK_RECTANGLE: u16 = 1002;
    pub const USER_1: u16 = 31_010;
    pub const USER_2: u16 = 31_011;
    pub const REQUEST_OPERATOR_CONTROL: u16 = 32_100;
    pub const GIMBAL_RESET: u16 = 42_501;
}

/// `MAV_MOUNT_MODE`.
pub mod mount_mode {
    pub const RETRACT: u8 = 0;
    pub const NEUTRAL: u8 = 1;
    pub const MAVLINK_TARGETING: u8 = 2;
    pub const RC_TARGETING: u8 = 3;
    pub const GPS_POINT: u8 = 4;
    pub const SYSID_TARGET: u8 = 5;
    pub const HOME_LOCATION: u8 = 6;
    pub const WPNEXT_OFFSET: u8 = 7;
}

/// `MAV_ROI`.
pub mod mav_roi {
    pub const NONE: u8 = 0;
    pub const LOCATION: u8 = 3;
}

/// `MAV_RESULT`, the answer in a `COMMAND_ACK`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum CommandResult {
    Accepted = 0,
    TemporarilyRejected = 1,
    Denied = 2,
    Unsupported = 3,
    Failed = 4,
    InProgress = 5,
    UnsupportedMavFrame = 9,
}

/// `MAV_TYPE`.
pub mod mav_type {
    pub const GENERIC: u8 = 0;
    pub const QUADROTOR: u8 = 2;
    pub const ANTENNA_TRACKER: u8 = 5;
    pub const GCS: u8 = 6;
    pub const ONBOARD_CONTROLLER: u8 = 18;
    pub const GIMBAL: u8 = 26;
    pub const ADSB: u8 = 27;
    pub const CAMERA: u8 = 30;

    /// Types that no vehicle has: a heartbeat with one of them is no autopilot's.
    pub const NOT_A_VEHICLE: [u8; 20] = [
        ANTENNA_TRACKER,
        GCS,
        ONBOARD_CONTROLLER,
        GIMBAL,
        ADSB,
        CAMERA,
        31,
        32,
        33,
        34,
        36,
        37,
        38,
        39,
        40,
        41,
        42,
        44,
        48,
        49,
    ];
}

/// `MAV_AUTOPILOT`.
pub mod mav_autopilot {
    pub const GENERIC: u8 = 0;
    pub const ARDUPILOTMEGA: u8 = 3;
    pub const INVALID: u8 = 8;
    pub const PX4: u8 = 12;
}

/// `MAV_STATE`.
pub mod mav_state {
    pub const BOOT: u8 = 1;
    pub const CALIBRATING: u8 = 2;
    pub const STANDBY: u8 = 3;
    pub const ACTIVE: u8 = 4;
    pub const CRITICAL: u8 = 5;
    pub const POWEROFF: u8 = 7;
}

/// `MAV_SEVERITY`, of a `STATUSTEXT`.
pub mod severity {
    pub const WARNING: u8 = 4;
    pub const NOTICE: u8 = 5;
    pub const INFO: u8 = 6;
}

/// `MAV_DATA_STREAM`.
pub mod mav_data_stream {
    pub const ALL: u8 = 0;
    pub const POSITION: u8 = 6;
    pub const EXTRA1: u8 = 10;
}

/// `MAV_FRAME`, as far as positions come in it.
pub mod mav_frame {
    pub const GLOBAL: u8 = 0;
    pub const GLOBAL_RELATIVE_ALT: u8 = 3;
    pub const GLOBAL_INT: u8 = 5;
    pub const GLOBAL_RELATIVE_ALT_INT: u8 = 6;
    pub const GLOBAL_TERRAIN_ALT: u8 = 10;
    pub const GLOBAL_TERRAIN_ALT_INT: u8 = 11;
}

/// `ATTITUDE_TARGET_TYPEMASK`.
pub mod attitude_target_typemask {
    pub const BODY_ROLL_RATE_IGNORE: u8 = 1;
    pub const BODY_PITCH_RATE_IGNORE: u8 = 2;
    pub const BODY_YAW_RATE_IGNORE: u8 = 4;
    pub const ATTITUDE_IGNORE: u8 = 128;
}

/// `POSITION_TARGET_TYPEMASK`.
pub mod position_target_typemask {
    pub const YAW_RATE_IGNORE: u16 = 2_048;
}

/// `ESTIMATOR_STATUS_FLAGS`.
pub mod estimator_status {
    /// Attitude, velocities, positions, their predictions: the flags that `EKF_STATUS_FLAGS` has at the same places.
    pub const IN_COMMON: u16 = 1_023;
    pub const GPS_GLITCH: u16 = 1_024;
}

/// `EKF_STATUS_FLAGS`.
pub mod ekf_status {
    pub const UNINITIALIZED: u16 = 1_024;
    pub const GPS_GLITCHING: u16 = 32_768;
}

/// `MAV_PROTOCOL_CAPABILITY`.
pub mod protocol_capability {
    pub const COMMAND_INT: u64 = 8;
    pub const MAVLINK2: u64 = 8_192;
    pub const COMPONENT_IMPLEMENTS_GIMBAL_MANAGER: u64 = 262_144;
}

bitflags::bitflags! {
    /// `GIMBAL_DEVICE_FLAGS`, and the low word of `GIMBAL_MANAGER_FLAGS`. Unknown bits are kept.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    pub struct GimbalFlags: u16 {
        const RETRACT = 1;
        const NEUTRAL = 2;
        const ROLL_LOCK = 4;
        const PITCH_LOCK = 8;
        const YAW_LOCK = 16;
        const YAW_IN_VEHICLE_FRAME = 32;
        const YAW_IN_EARTH_FRAME = 64;
        const ACCEPTS_YAW_IN_EARTH_FRAME = 128;
        const RC_EXCLUSIVE = 256;
        const RC_MIXED = 512;
        const _ = !0;
    }

    /// `GIMBAL_DEVICE_CAP_FLAGS` and `GIMBAL_MANAGER_CAP_FLAGS`, which are identical. Unknown bits are kept.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    pub struct CapFlags: u32 {
        const HAS_RETRACT = 1;
        const HAS_NEUTRAL = 2;
        const HAS_ROLL_AXIS = 4;
        const HAS_ROLL_FOLLOW = 8;
        const HAS_ROLL_LOCK = 16;
        const HAS_PITCH_AXIS = 32;
        const HAS_PITCH_FOLLOW = 64;
        const HAS_PITCH_LOCK = 128;
        const HAS_YAW_AXIS = 256;
        const HAS_YAW_FOLLOW = 512;
        const HAS_YAW_LOCK = 1024;
        const SUPPORTS_INFINITE_YAW = 2048;
        const SUPPORTS_YAW_IN_EARTH_FRAME = 4096;
        const HAS_RC_INPUTS = 8192;
        const CAN_POINT_LOCATION_LOCAL = 65_536;
        const CAN_POINT_LOCATION_GLOBAL = 131_072;
        const _ = !0;
    }

    /// `GIMBAL_DEVICE_ERROR_FLAGS`. Unknown bits are kept.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    pub struct FailureFlags: u32 {
        const AT_ROLL_LIMIT = 1;
        const AT_PITCH_LIMIT = 2;
        const AT_YAW_LIMIT = 4;
        const ENCODER_ERROR = 8;
        const POWER_ERROR = 16;
        const MOTOR_ERROR = 32;
        const SOFTWARE_ERROR = 64;
        const COMMS_ERROR = 128;
        const CALIBRATION_RUNNING = 256;
        const NO_MANAGER = 512;
        const _ = !0;
    }
}

impl FailureFlags {
    /// The errors that make a gimbal unhealthy; limits, calibration and a missing manager do not.
    pub const HARD: Self = Self::ENCODER_ERROR
        .union(Self::POWER_ERROR)
        .union(Self::MOTOR_ERROR)
        .union(Self::SOFTWARE_ERROR)
        .union(Self::COMMS_ERROR);
}
