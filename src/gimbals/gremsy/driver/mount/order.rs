//! What a Gremsy that speaks v1 is to do, and the commands that say it.

use crate::geometry::{AngularRate, GimbalAngles};
use crate::gimbals::gremsy::packet;
use crate::gimbals::operation::{ResetMode, YawMode};
use crate::wire::MavId;
use crate::wire::dialect::COMMAND_LONG_DATA;

/// What the gimbal is to do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Order {
    Point {
        angles: GimbalAngles,
        mode: YawMode,
    },
    Turn {
        /// About roll, pitch and yaw.
        rates: [AngularRate; 3],
        mode: YawMode,
    },
    Home,
    /// Switches the motors off.
    Retract,
    /// To its own radio receiver.
    RadioControl,
}

impl Order {
    pub fn is_stop(self) -> bool {
        matches!(self, Self::Turn { rates, .. } if rates.iter().all(|rate| rate.is_zero()))
    }

    pub fn turns(self) -> bool {
        matches!(self, Self::Turn { .. }) && !self.is_stop()
    }

    /// What says it, where it is said again and again.
    pub fn repeated(self, device: MavId) -> Option<COMMAND_LONG_DATA> {
        match self {
            Self::Point { angles, .. } => {
                Some(packet::rotate_to(device, GimbalAngles { yaw: angles.yaw.wrapped(), ..angles }))
            }
            Self::Turn { rates, .. } => Some(packet::turn_at(device, rates)),
            Self::Home | Self::Retract | Self::RadioControl => None,
        }
    }

    /// What says it, where it is given out once.
    pub fn given_once(self, device: MavId) -> Option<COMMAND_LONG_DATA> {
        match self {
            Self::Home => Some(packet::reset(device, ResetMode::PitchAndYaw)),
            Self::Retract => Some(packet::set_motors(device, false)),
            Self::RadioControl => Some(packet::hand_to_rc(device)),
            Self::Point { .. } | Self::Turn { .. } => None,
        }
    }
}
