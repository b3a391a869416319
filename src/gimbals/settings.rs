//! What the user may say of one gimbal.

use super::gremsy::config::GremsySettings;
use super::mavlink_v1::config::V1Settings;

/// A `[[gimbal]]` entry.
#[derive(Clone, Debug, PartialEq)]
pub struct GimbalSettings {
    pub name: String,
    pub family: Family,
    /// Index of the link it is on; any link when unset.
    pub link: Option<usize>,
    /// The device's component id; the first gimbal found when unset.
    pub component_id: Option<u8>,
    pub manager_component_id: Option<u8>,
    pub takeover: Takeover,
    /// How often an active setpoint is repeated to the device, 5 to 50.
    pub setpoint_rate_hz: u8,
    pub device_yaw_frame: DeviceYawFrame,
    /// Of a v1 gimbal.
    pub v1: V1Settings,
    /// Ground stations of gimbal protocol v1 are told where it looks, whatever it speaks itself.
    pub v1_status: bool,
    /// Of a Gremsy.
    pub gremsy: GremsySettings,
    /// Full deflection of manual control (288), degrees per second.
    pub manual_pitch_rate_dps: f64,
    pub manual_yaw_rate_dps: f64,
}

impl GimbalSettings {
    /// The settings of a gimbal that was found without an entry.
    pub fn found(name: String) -> Self {
        Self {
            name,
            family: Family::Auto,
            link: None,
            component_id: None,
            manager_component_id: None,
            takeover: Takeover::Open,
            setpoint_rate_hz: 20,
            device_yaw_frame: DeviceYawFrame::Auto,
            v1: V1Settings::default(),
            v1_status: false,
            gremsy: GremsySettings::default(),
            manual_pitch_rate_dps: 30.0,
            manual_yaw_rate_dps: 30.0,
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Family {
    /// Found by listening.
    Auto,
    MavlinkV2,
    MavlinkV1,
    Gremsy,
}

impl Family {
    /// Whether its gimbals may be no v2 devices, so that a device id is kept for each.
    pub const fn may_speak_through_manager(self) -> bool {
        match self {
            Self::Auto | Self::MavlinkV2 => false,
            Self::MavlinkV1 | Self::Gremsy => true,
        }
    }

    /// Whether its gimbals are no v2 devices, so that their manager sends 283 and 285 for them.
    pub const fn speaks_through_manager(self) -> bool {
        match self {
            Self::Auto | Self::MavlinkV2 | Self::Gremsy => false,
            Self::MavlinkV1 => true,
        }
    }

    pub const fn name(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::MavlinkV2 => "mavlink_v2",
            Self::MavlinkV1 => "mavlink_v1",
            Self::Gremsy => "gremsy",
        }
    }
}

/// Who may take control from a holder that did not release it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Takeover {
    /// Anybody; politeness is the client's business (Gimbal Protocol v2).
    Open,
    /// Nobody until the holder releases; our autopilot may borrow.
    Ask,
    /// Whoever ranks higher: ground stations, then our autopilot, then the rest of our system, then anybody else.
    Priority,
    /// Nobody until the holder releases, our autopilot neither.
    Exclusive,
}

impl Takeover {
    pub const fn name(self) -> &'static str {
        match self {
            Self::Open => "open",
            Self::Ask => "ask",
            Self::Priority => "priority",
            Self::Exclusive => "exclusive",
        }
    }
}

/// In which frame the device wants its yaw.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DeviceYawFrame {
    /// What the device reports that it accepts.
    Auto,
    Vehicle,
    Earth,
}
