//! What a gimbal is told.

use crate::geometry::{Angle, AngularRate, Yaw, YawFrame};

/// One order to a gimbal, the same for every family.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Setpoint {
    /// To the safe position, stabilisation off.
    Retract,
    /// To the device's own idea of straight ahead.
    Neutral,
    Point(Pointing),
    Turn(Turning),
}

/// An attitude to take and keep, in yaw-roll-pitch order.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pointing {
    pub roll: Angle,
    pub pitch: Angle,
    /// Its frame also says what it is kept to: the vehicle's nose, or North.
    pub yaw: Yaw,
    pub stabilised: Stabilised,
}

/// A continuous rotation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Turning {
    /// `None` where nobody asked for a roll rate.
    pub roll: Option<AngularRate>,
    pub pitch: AngularRate,
    pub yaw: AngularRate,
    pub yaw_frame: YawFrame,
    pub stabilised: Stabilised,
}

/// Which axes are held to the horizon rather than to the airframe (`ROLL_LOCK`, `PITCH_LOCK`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stabilised {
    pub roll: bool,
    pub pitch: bool,
}

impl Stabilised {
    pub const BOTH: Self = Self { roll: true, pitch: true };
}
