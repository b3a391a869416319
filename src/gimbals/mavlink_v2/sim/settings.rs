//! Which device a simulated one is.

use std::time::Duration;

use crate::geometry::{Angle, AxisLimits, Limits};
use crate::sim::plant::PlantSettings;
use crate::sim::system_id::SystemId;
use crate::wire::ids::{CapFlags, component};

/// Everything that differs from one v2 device to another.
#[derive(Clone, Debug, PartialEq)]
pub struct DeviceSettings {
    pub component_id: u8,
    /// Until a vehicle is heard, 1.
    pub system_id: SystemId,
    /// How long it listens for a heartbeat other than a ground station's before it speaks; for ever when `None`.
    pub listens_first: Option<Duration>,
    pub vendor_name: String,
    pub model_name: String,
    pub custom_name: String,
    /// Major, minor, patch, and development stage.
    pub firmware_version: [u8; 4],
    pub hardware_version: [u8; 4],
    pub uid: u64,
    pub capabilities: CapFlags,
    /// Whether `GIMBAL_DEVICE_INFORMATION` has `cap_flags2`, which came in March 2026.
    pub has_cap_flags2: bool,
    pub strictness: Strictness,
    pub status_frame: StatusFrame,
    pub retract: Retract,
    /// How long a rate holds that is not repeated; for ever when `None`.
    pub rate_expiry: Option<Duration>,
    pub plant: PlantSettings,
}

/// Which frame flags of `GIMBAL_DEVICE_SET_ATTITUDE` the device takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Strictness {
    /// One YAW_IN bit, or none: then YAW_LOCK tells the frame.
    Legacy,
    /// Exactly one YAW_IN bit.
    Strict,
    /// Only yaw in the vehicle frame, said by its bit or by no bit at all.
    VehicleOnly,
}

/// In which frame `GIMBAL_DEVICE_ATTITUDE_STATUS` gives yaw.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StatusFrame {
    /// Earth whenever the heading is known, else vehicle.
    EarthWhenKnown,
    /// Earth while yaw is locked and the heading is known, else vehicle.
    FollowsLock,
    /// Without YAW_IN bits and delta_yaw: earth while YAW_LOCK is set, else vehicle.
    Legacy,
}

/// What the device does with RETRACT.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Retract {
    /// Goes to zero on all axes and stays there.
    Stow,
    MotorsOff,
    /// Motors off, and deaf to every setpoint until it restarts.
    MotorsOffUntilReboot,
}

impl Default for DeviceSettings {
    /// A three-axis device that turns without end and passes MAVSDK's `gimbal_device_tester`.
    fn default() -> Self {
        let degrees = Angle::from_degrees;
        Self {
            component_id: component::GIMBAL,
            system_id: SystemId::Adopt,
            listens_first: Some(Duration::from_secs(3)),
            vendor_name: "gimbald".to_owned(),
            model_name: "Simulated v2".to_owned(),
            custom_name: String::new(),
            firmware_version: [1, 0, 0, 0],
            hardware_version: [1, 0, 0, 0],
            uid: 0x5349_4d32,
            capabilities: CapFlags::HAS_RETRACT
                | CapFlags::HAS_NEUTRAL
                | CapFlags::HAS_ROLL_AXIS
                | CapFlags::HAS_ROLL_LOCK
                | CapFlags::HAS_PITCH_AXIS
                | CapFlags::HAS_PITCH_LOCK
                | CapFlags::HAS_YAW_AXIS
                | CapFlags::HAS_YAW_FOLLOW
                | CapFlags::HAS_YAW_LOCK
                | CapFlags::SUPPORTS_INFINITE_YAW
                | CapFlags::SUPPORTS_YAW_IN_EARTH_FRAME,
            has_cap_flags2: false,
            strictness: Strictness::Legacy,
            status_frame: StatusFrame::EarthWhenKnown,
            retract: Retract::Stow,
            rate_expiry: Some(Duration::from_secs(1)),
            plant: PlantSettings {
                limits: Limits {
                    roll: AxisLimits::new(degrees(-45.0), degrees(45.0)),
                    pitch: AxisLimits::new(degrees(-90.0), degrees(30.0)),
                    yaw: None,
                },
                ..PlantSettings::default()
            },
        }
    }
}
