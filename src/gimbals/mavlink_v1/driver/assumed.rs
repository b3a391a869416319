//! What is assumed of a gimbal that cannot say: what it can do, and where it looks.

use crate::geometry::{Angle, AngularRate, AxisLimits, GimbalAngles, Limits};
use crate::gimbals::capabilities::Capabilities;
use crate::gimbals::mavlink_v1::config::{V1RadioControl, V1Settings};
use crate::timestamp::Timestamp;
use crate::wire::ids::CapFlags;

/// How fast one that does not say where it looks is taken to be.
const OPEN_LOOP_RATE: AngularRate = AngularRate::from_degrees_per_second(30.0);

/// Three axes held to the horizon, yaw against the vehicle.
pub fn capabilities(settings: &V1Settings) -> Capabilities {
    let degrees = Angle::from_degrees;
    let mut flags = CapFlags::HAS_RETRACT
        | CapFlags::HAS_NEUTRAL
        | CapFlags::HAS_ROLL_AXIS
        | CapFlags::HAS_ROLL_LOCK
        | CapFlags::HAS_PITCH_AXIS
        | CapFlags::HAS_PITCH_LOCK
        | CapFlags::HAS_YAW_AXIS
        | CapFlags::HAS_YAW_FOLLOW;
    flags.set(CapFlags::HAS_RC_INPUTS, settings.radio_control != V1RadioControl::None);
    Capabilities {
        flags,
        // What ArduPilot lets pass to one.
        limits: Limits {
            roll: AxisLimits::new(degrees(-180.0), degrees(180.0)),
            pitch: AxisLimits::new(degrees(-90.0), degrees(90.0)),
            yaw: AxisLimits::new(degrees(-180.0), degrees(180.0)),
        },
        turns: false,
        operates: false,
        retract_cuts_motors: false,
        radio_control_untold: settings.radio_control == V1RadioControl::None,
    }
}

/// Where it is taken to look while it does not say so.
#[derive(Clone, Copy, Debug, Default)]
pub struct AssumedPose {
    pub angles: GimbalAngles,
    /// It was carried on up to here.
    pub at: Timestamp,
}

impl AssumedPose {
    /// Moves on to `target` as fast as it is taken to be; without one it stays.
    pub fn carry_on(&mut self, now: Timestamp, target: Option<GimbalAngles>) {
        let most = OPEN_LOOP_RATE.over(now.since(self.at));
        self.at = now;
        let Some(target) = target else { return };
        let step = |at: Angle, to: Angle| at + (to - at).clamp(-most, most);
        self.angles = GimbalAngles {
            roll: step(self.angles.roll, target.roll),
            pitch: step(self.angles.pitch, target.pitch),
            yaw: step(self.angles.yaw, target.yaw),
        };
    }
}
