//! From what was asked to what the device can do.

use super::setpoint::{Pointing, Setpoint, Stabilised, Turning};
use crate::geometry::{Angle, Limits, Yaw, YawFrame};
use crate::wire::ids::CapFlags;

/// `setpoint` with its yaw in `frame` and its angles within `limits`.
///
/// `heading` turns one frame into the other; `None` when it is needed and not known. `yaw_now` is where the gimbal
/// looks in the vehicle frame, from which the way round its end stops is chosen. A rotation cannot be expressed in another
/// frame: there it is none, so that what the device turned at in its former frame ends.
pub fn to_device(
    setpoint: Setpoint,
    frame: YawFrame,
    heading: Option<Angle>,
    limits: &Limits,
    yaw_now: Angle,
) -> Option<Setpoint> {
    match setpoint {
        Setpoint::Point(pointing) => {
            let yaw = match pointing.yaw.in_frame(frame, heading)? {
                Yaw::InVehicleFrame(angle) => Yaw::InVehicleFrame(limits.clamp_yaw(angle, yaw_now).wrapped()),
                Yaw::InEarthFrame(angle) => Yaw::InEarthFrame(angle.wrapped()),
            };
            Some(Setpoint::Point(Pointing {
                roll: limits.clamp_roll(pointing.roll),
                pitch: limits.clamp_pitch(pointing.pitch),
                yaw,
                ..pointing
            }))
        }
        Setpoint::Turn(turning) if turning.yaw_frame != frame => {
            Some(Setpoint::Turn(Turning { yaw_frame: frame, ..turning.stopped() }))
        }
        Setpoint::Retract | Setpoint::Neutral | Setpoint::Turn(_) => Some(setpoint),
    }
}

/// Holding to the horizon cannot be switched off on an axis that cannot follow the airframe: many clients send
/// no lock bits without meaning an unstabilised camera.
pub fn stabilised(wanted: Stabilised, flags: CapFlags) -> Stabilised {
    Stabilised {
        roll: wanted.roll || !flags.contains(CapFlags::HAS_ROLL_FOLLOW),
        pitch: wanted.pitch || !flags.contains(CapFlags::HAS_PITCH_FOLLOW),
    }
}
