//! What a manager says for a gimbal that is no v2 device: where it looks and who it is.
//!
//! "Non-MAVLink gimbals … the gimbal device id is a number from 1 to 6" (Gimbal Protocol v2): the manager's component
//! sends `GIMBAL_DEVICE_INFORMATION` (283) and `GIMBAL_DEVICE_ATTITUDE_STATUS` (285) with that number. A v2 device speaks
//! for itself.

use std::time::Duration;

use super::intervals::Schedule;
use super::messages::Interval;
use crate::geometry::{Angle, Attitude, AxisLimits, VehicleFrame};
use crate::gimbals::capabilities::Capabilities;
use crate::gimbals::report::{GimbalAttitude, GimbalStatus, Identity};
use crate::timestamp::Timestamp;
use crate::wire::dialect::{CharArray, GIMBAL_DEVICE_ATTITUDE_STATUS_DATA, GIMBAL_DEVICE_INFORMATION_DATA, MavMessage};
use crate::wire::ids::{CapFlags, FailureFlags, GimbalFlags};

/// Such ids are for gimbals without a component of their own.
pub const LAST_NUMBER: u8 = 6;

/// "This message should be broadcast at a low regular rate (e.g. 10 Hz)."
const STATUS_INTERVAL: Duration = Duration::from_millis(100);

/// Speaks for one gimbal.
#[derive(Debug)]
pub struct DeviceVoice {
    number: u8,
    /// Who gets 285, and how often.
    pub schedule: Schedule,
    latest: Option<GimbalStatus>,
}

impl DeviceVoice {
    /// `number`: 1 to 6.
    pub fn new(number: u8) -> Self {
        Self { number, schedule: Schedule::new(Interval::Every(STATUS_INTERVAL)), latest: None }
    }

    /// The gimbal device id.
    pub fn number(&self) -> u8 {
        self.number
    }

    pub fn handle_status(&mut self, status: GimbalStatus) {
        self.latest = Some(status);
    }

    /// Where the gimbal looked when it last told.
    pub fn attitude(&self) -> Option<GimbalAttitude> {
        self.latest.map(|status| status.attitude)
    }

    /// 283.
    pub fn information(&self, now: Timestamp, identity: &Identity, capabilities: &Capabilities) -> MavMessage {
        let limits = &capabilities.limits;
        let bounds = |axis: Option<AxisLimits>| {
            axis.map_or((f32::NAN, f32::NAN), |axis| (axis.min().radians() as f32, axis.max().radians() as f32))
        };
        let (roll_min, roll_max) = bounds(limits.roll);
        let (pitch_min, pitch_max) = bounds(limits.pitch);
        let (yaw_min, yaw_max) = bounds(limits.yaw);
        MavMessage::GIMBAL_DEVICE_INFORMATION(GIMBAL_DEVICE_INFORMATION_DATA {
            uid: 0,
            time_boot_ms: now.boot_ms(),
            firmware_version: identity.firmware.map_or(0, u32::from_le_bytes),
            hardware_version: 0,
            roll_min,
            roll_max,
            pitch_min,
            pitch_max,
            yaw_min,
            yaw_max,
            custom_cap_flags: 0,
            // The older field holds the lower half of the set.
            cap_flags: capabilities.flags.bits() as u16,
            vendor_name: CharArray::from(identity.vendor.as_str()),
            model_name: CharArray::from(identity.model.as_str()),
            custom_name: CharArray::from(identity.custom_name.as_str()),
            gimbal_device_id: self.number,
            cap_flags2: capabilities.flags.intersection(CapFlags::from_bits_retain(0x3_ffff)).bits(),
        })
    }

    /// 285: exactly one frame bit, and `delta_yaw` a number exactly when `heading` is known. `None` before the gimbal
    /// has told an attitude. A gimbal that is lost stays where it was last seen, with `COMMS_ERROR`. Yaw is locked
    /// as it is demanded (`held` to North or not), or, where nobody demands anything, as the gimbal's own mode has it.
    pub fn attitude_status(
        &self,
        now: Timestamp,
        is_alive: bool,
        held: Option<bool>,
        heading: Option<Angle>,
    ) -> Option<MavMessage> {
        let status = self.latest?;
        let number =
            |rate: Option<crate::geometry::AngularRate>| rate.map_or(f32::NAN, |rate| rate.radians_per_second() as f32);
        let (q, frame) = match (status.attitude, heading) {
            (GimbalAttitude::InVehicleFrame(attitude), _) => (attitude.to_wxyz(), GimbalFlags::YAW_IN_VEHICLE_FRAME),
            (GimbalAttitude::InEarthFrame(attitude), Some(heading)) => {
                let attitude: Attitude<VehicleFrame> = attitude.to_vehicle(heading);
                (attitude.to_wxyz(), GimbalFlags::YAW_IN_VEHICLE_FRAME)
            }
            (GimbalAttitude::InEarthFrame(attitude), None) => (attitude.to_wxyz(), GimbalFlags::YAW_IN_EARTH_FRAME),
        };
        let kept = GimbalFlags::RETRACT
            | GimbalFlags::NEUTRAL
            | GimbalFlags::ROLL_LOCK
            | GimbalFlags::PITCH_LOCK
            | GimbalFlags::YAW_LOCK
            | GimbalFlags::RC_EXCLUSIVE
            | GimbalFlags::RC_MIXED;
        let mut flags = status.flags.intersection(kept) | frame;
        flags.set(GimbalFlags::YAW_LOCK, held.unwrap_or(status.flags.contains(GimbalFlags::YAW_LOCK)));
        // A client may ask for yaw from North whenever we can turn it into what the gimbal takes.
        flags.set(GimbalFlags::ACCEPTS_YAW_IN_EARTH_FRAME, heading.is_some());
        let mut failures = status.failures;
        if !is_alive {
            failures |= FailureFlags::COMMS_ERROR;
        }
        Some(MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(GIMBAL_DEVICE_ATTITUDE_STATUS_DATA {
            time_boot_ms: now.boot_ms(),
            q,
            angular_velocity_x: number(status.rates[0]),
            angular_velocity_y: number(status.rates[1]),
            angular_velocity_z: number(status.rates[2]),
            failure_flags: failures.bits(),
            flags: flags.bits(),
            target_system: 0,
            target_component: 0,
            delta_yaw: heading.map_or(f32::NAN, |heading| heading.wrapped().radians() as f32),
            delta_yaw_velocity: f32::NAN,
            gimbal_device_id: self.number,
        }))
    }
}
