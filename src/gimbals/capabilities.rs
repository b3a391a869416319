//! What a gimbal can do.

use crate::geometry::Limits;
use crate::wire::ids::CapFlags;

/// Capabilities and end stops as the device states them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Capabilities {
    pub flags: CapFlags,
    pub limits: Limits,
    /// It turns at a rate by itself; otherwise its angles are turned for it.
    pub turns: bool,
    /// Its maker's commands for motors, modes and a restart are for it.
    pub operates: bool,
    /// What it does for "retract" is to switch its motors off: dangerous, by whatever name it is asked for.
    pub retract_cuts_motors: bool,
    /// It cannot tell whether it has a radio control of its own, and the configuration (`v1_radio_control`) says no.
    pub radio_control_untold: bool,
}

impl Capabilities {
    /// What is assumed of a gimbal that reports its attitude and never says what it can do: pitch and yaw, held to
    /// the horizon, following the vehicle.
    pub fn assumed() -> Self {
        let flags = CapFlags::HAS_ROLL_LOCK
            | CapFlags::HAS_PITCH_AXIS
            | CapFlags::HAS_PITCH_LOCK
            | CapFlags::HAS_YAW_AXIS
            | CapFlags::HAS_YAW_FOLLOW;
        Self {
            flags,
            limits: Limits::default(),
            turns: true,
            operates: false,
            retract_cuts_motors: false,
            radio_control_untold: false,
        }
    }

    /// Why it is not handed to a radio control of its own; `known` where it is known to have none.
    pub fn why_no_radio_control(&self, known: &'static str) -> &'static str {
        if self.radio_control_untold { "v1_radio_control_is_none" } else { known }
    }
}
