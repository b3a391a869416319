//! Which way a device counts its angles.

use crate::geometry::{Angle, GimbalAngles};

/// Which way one axis is counted: as MAVLink does, or the other way round.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Sign {
    #[default]
    Same,
    Opposite,
}

/// The signs of the three axes: in MAVLink rolling right, pitching up and yawing right are positive.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Signs {
    pub roll: Sign,
    pub pitch: Sign,
    pub yaw: Sign,
}

impl Sign {
    pub fn apply(self, angle: Angle) -> Angle {
        match self {
            Self::Same => angle,
            Self::Opposite => -angle,
        }
    }
}

impl Signs {
    /// As MAVLink counts.
    pub const NORMAL: Self = Self { roll: Sign::Same, pitch: Sign::Same, yaw: Sign::Same };

    /// Pitch and yaw the other way round, as ArduPilot tells them to a STorM32.
    pub const REVERSED: Self = Self { roll: Sign::Same, pitch: Sign::Opposite, yaw: Sign::Opposite };

    /// From MAVLink's signs to the device's, and as well from the device's to MAVLink's.
    pub fn apply(self, angles: GimbalAngles) -> GimbalAngles {
        GimbalAngles {
            roll: self.roll.apply(angles.roll),
            pitch: self.pitch.apply(angles.pitch),
            yaw: self.yaw.apply(angles.yaw),
        }
    }
}
