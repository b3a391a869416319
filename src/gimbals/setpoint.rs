//! What a gimbal is told.

use crate::geometry::{Angle, AngularRate, Yaw, YawFrame};
use crate::wire::ids::GimbalFlags;

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
    pub radio_control: RadioControl,
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
    pub radio_control: RadioControl,
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

/// What part the radio control inputs of the gimbal itself have.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum RadioControl {
    #[default]
    Off,
    /// `RC_MIXED`: combined with what the gimbal is told, as the device sees fit.
    Mixed,
    /// `RC_EXCLUSIVE`: the gimbal ignores what it is told.
    Exclusive,
}

impl Turning {
    pub const STOPPED: Self = Self {
        roll: None,
        pitch: AngularRate::ZERO,
        yaw: AngularRate::ZERO,
        yaw_frame: YawFrame::Vehicle,
        stabilised: Stabilised::BOTH,
        radio_control: RadioControl::Off,
    };

    pub fn is_zero(&self) -> bool {
        [self.roll.unwrap_or(AngularRate::ZERO), self.pitch, self.yaw].iter().all(|rate| rate.is_zero())
    }

    /// The same at rest.
    pub fn stopped(self) -> Self {
        Self { roll: self.roll.map(|_| AngularRate::ZERO), pitch: AngularRate::ZERO, yaw: AngularRate::ZERO, ..self }
    }
}

impl Setpoint {
    /// What of it can be told while nothing newer is known: an angle as it is, a rotation as none.
    pub fn at_rest(self) -> Self {
        match self {
            Self::Turn(turning) => Self::Turn(turning.stopped()),
            Self::Point(_) | Self::Retract | Self::Neutral => self,
        }
    }
}

impl RadioControl {
    pub fn of_flags(flags: GimbalFlags) -> Self {
        if flags.contains(GimbalFlags::RC_EXCLUSIVE) {
            Self::Exclusive
        } else if flags.contains(GimbalFlags::RC_MIXED) {
            Self::Mixed
        } else {
            Self::Off
        }
    }

    pub const fn flags(self) -> GimbalFlags {
        match self {
            Self::Off => GimbalFlags::empty(),
            Self::Mixed => GimbalFlags::RC_MIXED,
            Self::Exclusive => GimbalFlags::RC_EXCLUSIVE,
        }
    }
}

impl Setpoint {
    /// The flags as 284 and 281 show them: exactly one frame bit, and `YAW_LOCK` exactly with the earth frame.
    pub fn flags(&self) -> GimbalFlags {
        match *self {
            Setpoint::Retract => GimbalFlags::RETRACT | frame_flags(YawFrame::Vehicle) | lock_flags(Stabilised::BOTH),
            Setpoint::Neutral => GimbalFlags::NEUTRAL | frame_flags(YawFrame::Vehicle) | lock_flags(Stabilised::BOTH),
            Setpoint::Point(Pointing { yaw, stabilised, radio_control, .. }) => {
                frame_flags(yaw.frame()) | lock_flags(stabilised) | radio_control.flags()
            }
            Setpoint::Turn(Turning { yaw_frame, stabilised, radio_control, .. }) => {
                frame_flags(yaw_frame) | lock_flags(stabilised) | radio_control.flags()
            }
        }
    }
}

fn frame_flags(frame: YawFrame) -> GimbalFlags {
    match frame {
        YawFrame::Vehicle => GimbalFlags::YAW_IN_VEHICLE_FRAME,
        YawFrame::Earth => GimbalFlags::YAW_IN_EARTH_FRAME | GimbalFlags::YAW_LOCK,
    }
}

fn lock_flags(stabilised: Stabilised) -> GimbalFlags {
    let mut flags = GimbalFlags::empty();
    flags.set(GimbalFlags::ROLL_LOCK, stabilised.roll);
    flags.set(GimbalFlags::PITCH_LOCK, stabilised.pitch);
    flags
}

/// What yaw is measured from; the frame bits decide, `YAW_LOCK` for senders older than them. Both bits at once mean
/// nothing: `None`.
pub fn yaw_frame(flags: GimbalFlags) -> Option<YawFrame> {
    let vehicle = flags.contains(GimbalFlags::YAW_IN_VEHICLE_FRAME);
    let earth = flags.contains(GimbalFlags::YAW_IN_EARTH_FRAME);
    match (vehicle, earth) {
        (true, true) => None,
        (true, false) => Some(YawFrame::Vehicle),
        (false, true) => Some(YawFrame::Earth),
        (false, false) if flags.contains(GimbalFlags::YAW_LOCK) => Some(YawFrame::Earth),
        (false, false) => Some(YawFrame::Vehicle),
    }
}
