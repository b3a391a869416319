//! Which autopilot it is.

use std::borrow::Cow;

use crate::wire::ids::mav_autopilot;

/// The family of an autopilot (`MAV_AUTOPILOT`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Autopilot {
    ArduPilot,
    Px4,
    Other(u8),
}

impl Autopilot {
    pub(super) fn from_number(number: u8) -> Self {
        match number {
            mav_autopilot::ARDUPILOTMEGA => Self::ArduPilot,
            mav_autopilot::PX4 => Self::Px4,
            other => Self::Other(other),
        }
    }

    /// `ardupilot`, `px4`, or the number of another `MAV_AUTOPILOT`.
    pub fn name(self) -> Cow<'static, str> {
        match self {
            Self::ArduPilot => Cow::Borrowed("ardupilot"),
            Self::Px4 => Cow::Borrowed("px4"),
            Self::Other(number) => Cow::Owned(number.to_string()),
        }
    }
}
