//! What the device says of itself.

use super::setpoint::Mode;
use super::telling::{self, AttitudeStatus, DeltaYaw};
use super::{Device, StatusFrame};
use crate::geometry::AngularRate;
use crate::sim::plant::YawHold;
use crate::timestamp::Timestamp;
use crate::wire::dialect::{
    CharArray, GIMBAL_DEVICE_ATTITUDE_STATUS_DATA, GIMBAL_DEVICE_INFORMATION_DATA, MESSAGE_INTERVAL_DATA,
};
use crate::wire::ids::{CapFlags, GimbalFlags, message};

impl Device {
    pub(super) fn can_report(&self, id: u32) -> bool {
        matches!(
            id,
            message::HEARTBEAT
                | message::MESSAGE_INTERVAL
                | message::GIMBAL_DEVICE_INFORMATION
                | message::GIMBAL_DEVICE_ATTITUDE_STATUS
        )
    }

    /// Sends message `id`; `argument` says of which message an interval is wanted.
    pub(super) fn report(&mut self, now: Timestamp, id: u32, argument: f64) {
        match id {
            message::HEARTBEAT => self.line.outbox.send(&telling::HEARTBEAT),
            message::MESSAGE_INTERVAL => {
                // A float cast saturates, and turns NaN into 0.
                let message_id = argument.round() as u16;
                let interval_us = self.streams.interval_us(u32::from(message_id));
                self.line.outbox.send(&MESSAGE_INTERVAL_DATA { interval_us, message_id });
            }
            message::GIMBAL_DEVICE_INFORMATION => {
                let information = self.information(now);
                self.line.outbox.send(&information);
            }
            message::GIMBAL_DEVICE_ATTITUDE_STATUS => {
                let status = self.attitude_status(now);
                self.line.outbox.send(&status);
            }
            _ => {}
        }
    }

    fn boot_ms(&self, now: Timestamp) -> u32 {
        (Timestamp::ZERO + now.since(self.boot)).boot_ms()
    }

    fn information(&self, now: Timestamp) -> GIMBAL_DEVICE_INFORMATION_DATA {
        let settings = &self.settings;
        let limits = settings.plant.limits;
        let (roll_min, roll_max) = telling::ends(limits.roll);
        let (pitch_min, pitch_max) = telling::ends(limits.pitch);
        let (yaw_min, yaw_max) = if settings.capabilities.contains(CapFlags::SUPPORTS_INFINITE_YAW) {
            // MAVSDK's gimbal_device_tester knows a yaw without limits by these.
            (f32::NEG_INFINITY, f32::INFINITY)
        } else {
            telling::ends(limits.yaw)
        };
        GIMBAL_DEVICE_INFORMATION_DATA {
            uid: settings.uid,
            time_boot_ms: self.boot_ms(now),
            firmware_version: u32::from_le_bytes(settings.firmware_version),
            hardware_version: u32::from_le_bytes(settings.hardware_version),
            roll_min,
            roll_max,
            pitch_min,
            pitch_max,
            yaw_min,
            yaw_max,
            // The older field holds the lower half of the set.
            cap_flags: settings.capabilities.bits() as u16,
            custom_cap_flags: 0,
            vendor_name: CharArray::from(settings.vendor_name.as_str()),
            model_name: CharArray::from(settings.model_name.as_str()),
            custom_name: CharArray::from(settings.custom_name.as_str()),
            gimbal_device_id: 0,
            cap_flags2: if settings.has_cap_flags2 { settings.capabilities.bits() } else { 0 },
        }
    }

    fn attitude_status(&mut self, now: Timestamp) -> GIMBAL_DEVICE_ATTITUDE_STATUS_DATA {
        let pose = self.plant.measure(now);
        let heading = self.heading.at(now);
        let locked = self.steering.mode() == Mode::Free && self.plant.yaw_hold() == YawHold::Horizon;
        let in_earth = match self.settings.status_frame {
            StatusFrame::EarthWhenKnown => heading,
            StatusFrame::FollowsLock => heading.filter(|_| locked),
            // Where North is not known, what it is locked to is its own zero.
            StatusFrame::Legacy if locked => {
                Some(heading.unwrap_or_else(|| (self.plant.platform_heading(now), AngularRate::ZERO)))
            }
            StatusFrame::Legacy => None,
        };
        let status = AttitudeStatus {
            time_boot_ms: self.boot_ms(now),
            pose,
            yaw_from: in_earth,
            delta_yaw: match self.settings.status_frame {
                StatusFrame::Legacy => DeltaYaw::Unused,
                StatusFrame::EarthWhenKnown | StatusFrame::FollowsLock => DeltaYaw::Told(heading),
            },
            flags: self.flags(locked, heading.is_some(), in_earth.is_some()),
            failures: telling::with_own_failures(self.failures, self.plant.at_limit(), self.latch.manager(now)),
            target: None,
        };
        status.message()
    }

    fn flags(&self, locked: bool, knows_heading: bool, in_earth: bool) -> GimbalFlags {
        let mut flags = telling::mode_flags(self.steering.mode());
        flags.set(GimbalFlags::YAW_LOCK, locked);
        if self.settings.status_frame != StatusFrame::Legacy {
            flags.set(GimbalFlags::YAW_IN_EARTH_FRAME, in_earth);
            flags.set(GimbalFlags::YAW_IN_VEHICLE_FRAME, !in_earth);
            let accepts = knows_heading && self.settings.strictness != super::Strictness::VehicleOnly;
            let accepts = accepts && self.settings.capabilities.contains(CapFlags::SUPPORTS_YAW_IN_EARTH_FRAME);
            flags.set(GimbalFlags::ACCEPTS_YAW_IN_EARTH_FRAME, accepts);
        }
        flags
    }
}
