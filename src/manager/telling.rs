//! What the manager tells of itself and of its gimbal: 280, 281, and in the name of a gimbal that is no v2 device 283
//! and 285.

use std::time::Duration;

use super::messages::{self, Interval};
use super::{DeviceState, GimbalManager, ManagerOutput, Surroundings};
use crate::channel::ChannelId;
use crate::timestamp::Timestamp;
use crate::wire::dialect::MavMessage;
use crate::wire::ids::{FailureFlags, GimbalFlags};

impl GimbalManager {
    /// 281 for a device on `channel` that misses its manager (`GIMBAL_DEVICE_ERROR_FLAGS_NO_MANAGER`), where somebody has
    /// switched it off or made it rare; due once a second.
    pub fn reminder(&self, now: Timestamp, channel: ChannelId) -> Option<Box<MavMessage>> {
        const OFTEN_ENOUGH: Duration = Duration::from_secs(1);
        let is_missed = self.status.is_some_and(|(_, status)| status.failures.contains(FailureFlags::NO_MANAGER));
        let is_told = matches!(self.status_schedule.interval(channel), Interval::Every(every) if every <= OFTEN_ENOUGH);
        if is_missed && !is_told { self.status_message(now) } else { None }
    }

    /// The flags for 281: those of the setpoint, with the device's own state bits; the device's while there is none. A gimbal
    /// that is none of v2 is told angles from the nose also when yaw is held to North, as 285 has it.
    pub fn flags(&self) -> GimbalFlags {
        let of_device = GimbalFlags::ACCEPTS_YAW_IN_EARTH_FRAME | GimbalFlags::RC_EXCLUSIVE | GimbalFlags::RC_MIXED;
        let reported = self.status.map_or(GimbalFlags::empty(), |(_, status)| status.flags);
        let mut flags = match self.tracking.last() {
            Some(setpoint) => setpoint.flags().difference(of_device) | reported.intersection(of_device),
            None => reported.intersection(GimbalFlags::from_bits_retain(0x3ff)),
        };
        if self.voice.is_some() && self.tracking.is_locked() {
            flags |= GimbalFlags::YAW_LOCK;
        }
        flags
    }

    /// A 281 to everybody, besides the regular ones.
    pub(super) fn broadcast_status(&mut self, now: Timestamp) {
        self.told_flags = self.flags();
        if let Some(message) = self.status_message(now) {
            self.outputs.push_back(ManagerOutput::Broadcast { channels: None, message });
        }
    }

    /// 280 to everybody, once the gimbal is known. What we say for the gimbal comes before it: MAVSDK 3 knows a name only
    /// if it has 283 before 280.
    pub(super) fn announce(&mut self, now: Timestamp, around: Surroundings<'_>) {
        self.told_can_aim = can_aim(now, around);
        for message in [self.device_information(now), self.information(now, around)].into_iter().flatten() {
            self.outputs.push_back(ManagerOutput::Broadcast { channels: None, message });
        }
    }

    /// 280, once the gimbal is known.
    pub(super) fn information(&self, now: Timestamp, around: Surroundings<'_>) -> Option<Box<MavMessage>> {
        let (device_id, capabilities) = (self.device_id()?, self.capabilities.as_ref()?);
        Some(Box::new(messages::information(now, device_id, capabilities, can_aim(now, around))))
    }

    /// 283 in the name of a gimbal that is no v2 device, once it is known.
    pub(super) fn device_information(&self, now: Timestamp) -> Option<Box<MavMessage>> {
        let (voice, capabilities) = (self.voice.as_ref()?, self.capabilities.as_ref()?);
        self.device.map(|_| Box::new(voice.information(now, &self.identity, capabilities)))
    }

    /// 285 in the name of a gimbal that is no v2 device, once it has told where it looks.
    pub(super) fn device_attitude_status(&self, now: Timestamp, around: Surroundings<'_>) -> Option<Box<MavMessage>> {
        let (is_alive, held) = (self.state == DeviceState::Alive, self.tracking.holds_north());
        let heading = around.vehicle.heading(now);
        self.voice.as_ref()?.attitude_status(now, is_alive, held, heading).map(Box::new)
    }

    /// 281, once there is a gimbal whose device id is known: what it speaks decides on it.
    pub(super) fn status_message(&self, now: Timestamp) -> Option<Box<MavMessage>> {
        if !self.has_settled_id {
            return None;
        }
        let (primary, secondary) = (self.control.primary(), self.control.secondary());
        Some(Box::new(messages::status(now, self.device_id()?, self.flags(), primary, secondary)))
    }
}

/// Whether a region of interest can be accepted: the vehicle tells where it is. That its heading is missing for a moment,
/// where the gimbal needs one, makes no other gimbal of it.
pub(super) fn can_aim(now: Timestamp, around: Surroundings<'_>) -> bool {
    around.vehicle.position(now).is_some()
}
