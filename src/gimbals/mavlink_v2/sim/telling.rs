//! What v2 devices say of themselves alike, whoever made them; each fills in what is its own.

use super::setpoint::Mode;
use crate::geometry::{Angle, AngularRate, Attitude, AxisLimits, EarthFrame, GimbalAngles};
use crate::sim::plant::{AtLimit, Pose};
use crate::wire::MavId;
use crate::wire::dialect::{GIMBAL_DEVICE_ATTITUDE_STATUS_DATA, HEARTBEAT_DATA};
use crate::wire::ids::{FailureFlags, GimbalFlags, mav_autopilot, mav_state, mav_type};

pub const HEARTBEAT: HEARTBEAT_DATA = HEARTBEAT_DATA {
    custom_mode: 0,
    mavtype: mav_type::GIMBAL,
    autopilot: mav_autopilot::INVALID,
    base_mode: 0,
    system_status: mav_state::ACTIVE,
    mavlink_version: 3,
};

/// Where North is for a device: the heading of the vehicle, and how fast that turns.
pub type North = (Angle, AngularRate);

/// What `GIMBAL_DEVICE_ATTITUDE_STATUS` says.
#[derive(Clone, Copy, Debug)]
pub struct AttitudeStatus {
    pub time_boot_ms: u32,
    /// As the joints have it: yaw from the vehicle's nose.
    pub pose: Pose,
    /// Where yaw is told from North, as `flags` then say.
    pub yaw_from: Option<North>,
    /// In `delta_yaw` and `delta_yaw_velocity`.
    pub delta_yaw: DeltaYaw,
    pub flags: GimbalFlags,
    pub failures: FailureFlags,
    /// `None`: everyone.
    pub target: Option<MavId>,
}

/// What a device says of the vehicle's heading.
#[derive(Clone, Copy, Debug)]
pub enum DeltaYaw {
    /// It is older than the fields, and leaves them zero.
    Unused,
    /// NaN while it does not know.
    Told(Option<North>),
}

impl AttitudeStatus {
    pub fn message(self) -> GIMBAL_DEVICE_ATTITUDE_STATUS_DATA {
        let Pose { roll, pitch, yaw, roll_rate, pitch_rate, yaw_rate } = self.pose;
        let (yaw, yaw_rate) = match self.yaw_from {
            Some((heading, heading_rate)) => (yaw + heading, yaw_rate + heading_rate),
            None => (yaw, yaw_rate),
        };
        // The frame is told by the flags, so the type's frame is a formality here.
        let attitude = Attitude::<EarthFrame>::from_gimbal_angles(GimbalAngles { roll, pitch, yaw });
        let (delta_yaw, delta_yaw_velocity) = match self.delta_yaw {
            DeltaYaw::Unused => (0.0, 0.0),
            DeltaYaw::Told(Some((heading, rate))) => {
                (heading.wrapped().radians() as f32, rate.radians_per_second() as f32)
            }
            DeltaYaw::Told(None) => (f32::NAN, f32::NAN),
        };
        let target = self.target.unwrap_or(MavId::new(0, 0));
        GIMBAL_DEVICE_ATTITUDE_STATUS_DATA {
            time_boot_ms: self.time_boot_ms,
            q: attitude.to_wxyz(),
            angular_velocity_x: roll_rate.radians_per_second() as f32,
            angular_velocity_y: pitch_rate.radians_per_second() as f32,
            angular_velocity_z: yaw_rate.radians_per_second() as f32,
            failure_flags: self.failures.bits(),
            flags: self.flags.bits(),
            target_system: target.system,
            target_component: target.component,
            delta_yaw,
            delta_yaw_velocity,
            gimbal_device_id: 0,
        }
    }
}

/// The flags of a mode, to which those of yaw are added.
pub fn mode_flags(mode: Mode) -> GimbalFlags {
    match mode {
        // Retracted it does not stabilise.
        Mode::Retract => GimbalFlags::RETRACT,
        Mode::Neutral => GimbalFlags::NEUTRAL | GimbalFlags::ROLL_LOCK | GimbalFlags::PITCH_LOCK,
        Mode::Free => GimbalFlags::ROLL_LOCK | GimbalFlags::PITCH_LOCK,
    }
}

/// `failures` and what a device finds itself: joints at their limits, and nobody who manages it.
pub fn with_own_failures(failures: FailureFlags, limit: AtLimit, manager: Option<MavId>) -> FailureFlags {
    let mut flags = failures;
    flags.set(FailureFlags::AT_ROLL_LIMIT, limit.roll);
    flags.set(FailureFlags::AT_PITCH_LIMIT, limit.pitch);
    flags.set(FailureFlags::AT_YAW_LIMIT, limit.yaw);
    flags.set(FailureFlags::NO_MANAGER, manager.is_none());
    flags
}

/// The two ends of an axis in `GIMBAL_DEVICE_INFORMATION`: NaN where it has none.
pub fn ends(axis: Option<AxisLimits>) -> (f32, f32) {
    let end = |angle: Angle| angle.radians() as f32;
    axis.map_or((f32::NAN, f32::NAN), |axis| (end(axis.min()), end(axis.max())))
}
