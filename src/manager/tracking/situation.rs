//! What the tracking has to go by at one moment.

use crate::geometry::{Angle, Position, Yaw, YawFrame};
use crate::gimbals::capabilities::Capabilities;
use crate::gimbals::report::GimbalStatus;
use crate::gimbals::setpoint::{Pointing, Setpoint};
use crate::gimbals::settings::DeviceYawFrame;
use crate::wire::ids::{CapFlags, GimbalFlags};

/// What the tracking has to go by at one moment.
#[derive(Clone, Copy, Debug)]
pub struct Situation<'a> {
    /// The gimbal's latest attitude, if it is fresh.
    pub measured: Option<GimbalStatus>,
    /// The vehicle's heading, as the gimbal or else the autopilot knows it.
    pub heading: Option<Angle>,
    /// The vehicle's position, if it is fresh.
    pub position: Option<Position>,
    /// What the gimbal is told does not reach it yet.
    pub is_held_back: bool,
    pub capabilities: &'a Capabilities,
    pub accepts_earth_yaw: bool,
    pub device_yaw_frame: DeviceYawFrame,
}

impl Situation<'_> {
    /// Whether the gimbal says that its own radio control has it and nobody else. Only one with such an input is
    /// believed: others use that bit for something of their own.
    pub(in crate::manager) fn radio_control_has_it(&self) -> bool {
        self.capabilities.flags.contains(CapFlags::HAS_RC_INPUTS)
            && self.measured.is_some_and(|status| status.flags.contains(GimbalFlags::RC_EXCLUSIVE))
    }

    /// The frame in which the device is told a yaw that is to be held in `frame`.
    pub(super) fn device_frame(&self, frame: YawFrame) -> YawFrame {
        match self.device_yaw_frame {
            DeviceYawFrame::Auto if self.accepts_earth_yaw => frame,
            DeviceYawFrame::Auto | DeviceYawFrame::Vehicle => YawFrame::Vehicle,
            DeviceYawFrame::Earth => YawFrame::Earth,
        }
    }

    /// A setpoint from North for a device that does not know that any more: it stays as it looks from the nose.
    pub(super) fn without_north(&self, setpoint: Setpoint) -> Setpoint {
        match (setpoint, self.measured_pose(YawFrame::Vehicle)) {
            (Setpoint::Point(pointing @ Pointing { yaw: Yaw::InEarthFrame(_), .. }), Some(pose))
                if self.device_frame(YawFrame::Earth) == YawFrame::Vehicle =>
            {
                Setpoint::Point(Pointing { yaw: Yaw::InVehicleFrame(pose.yaw), ..pointing })
            }
            _ => setpoint,
        }
    }

    /// Where the gimbal looks now, yaw in `frame`.
    ///
    /// The vehicle may have turned since the gimbal told it. A yaw that is locked to North has stayed as it was over
    /// ground, any other from the nose, in whichever frame it was told.
    pub(super) fn measured_pose(&self, frame: YawFrame) -> Option<Pose> {
        let status = self.measured?;
        let angles = status.attitude.angles();
        let locked = status.flags.contains(GimbalFlags::YAW_LOCK);
        let kept_in = if locked { YawFrame::Earth } else { YawFrame::Vehicle };
        let kept = status.attitude.yaw().in_frame(kept_in, status.heading.or(self.heading));
        // Without a heading it can be told only as it came.
        let yaw = kept.unwrap_or(status.attitude.yaw()).in_frame(frame, self.heading)?.angle();
        Some(Pose { roll: angles.roll, pitch: angles.pitch, yaw })
    }
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Pose {
    pub(super) roll: Angle,
    pub(super) pitch: Angle,
    pub(super) yaw: Angle,
}
