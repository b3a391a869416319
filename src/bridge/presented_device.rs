//! A gimbal as it is presented to the autopilot: a gimbal device of its own, that is really us (D18).
//!
//! What it says is the manager's knowledge of the real gimbal, in the words of a Gimbal Protocol v2 device: heartbeats of
//! type `GIMBAL` from the start, because ArduPilot looks for a gimbal early or never; 283 once the gimbal is known; 285 ten
//! times a second, always in the vehicle frame, because ArduPilot takes it for that whatever its flags say.

use std::time::Duration;

use crate::channel::{ChannelId, ChannelSet};
use crate::geometry::Angle;
use crate::gimbals::capabilities::Capabilities;
use crate::gimbals::report::GimbalAttitude;
use crate::manager::intervals::InvalidInterval;
use crate::manager::messages::{self, Interval};
use crate::manager::voice::DeviceVoice;
use crate::manager::{DeviceState, GimbalManager};
use crate::timestamp::Timestamp;
use crate::wire::dialect::MavMessage;
use crate::wire::ids::{CapFlags, component};

/// A v2 device is its component, and has no number.
const NO_NUMBER: u8 = 0;

/// What the gimbal told longer ago than this is not where it looks now.
const STALE: Duration = Duration::from_secs(1);

/// The component ids of gimbal devices, which ArduPilot gives to its mounts in this order.
const COMPONENTS: [u8; 6] = [
    component::GIMBAL,
    component::GIMBAL2,
    component::GIMBAL3,
    component::GIMBAL4,
    component::GIMBAL5,
    component::GIMBAL6,
];

/// One gimbal towards the autopilot.
#[derive(Debug)]
pub struct PresentedDevice {
    /// The component id of its manager.
    pub manager: u8,
    /// Its own.
    pub component: u8,
    voice: DeviceVoice,
}

impl PresentedDevice {
    pub fn new(manager: u8, component: u8) -> Self {
        Self { manager, component, voice: DeviceVoice::new(NO_NUMBER) }
    }

    /// It speaks on that channel from now on.
    pub fn open_channel(&mut self, now: Timestamp, channel: ChannelId) {
        self.voice.schedule.open(now, channel);
    }

    pub fn close_channel(&mut self, channel: ChannelId) {
        self.voice.schedule.close(channel);
    }

    /// 283, once the gimbal is known.
    pub fn information(&self, now: Timestamp, manager: &GimbalManager) -> Option<MavMessage> {
        let known = manager.capabilities().filter(|_| manager.device().is_some())?;
        let capabilities = Capabilities { flags: capabilities(known.flags), ..*known };
        Some(self.voice.information(now, manager.identity(), &capabilities))
    }

    /// 285 in the vehicle frame; `None` before the gimbal has told where it looks, or while it tells it from North and
    /// nobody knows the heading.
    pub fn attitude_status(
        &mut self,
        now: Timestamp,
        manager: &GimbalManager,
        heading: Option<Angle>,
    ) -> Option<MavMessage> {
        let mut is_fresh = false;
        let mut of_gimbal = None;
        if let Some((at, status)) = manager.status() {
            self.voice.handle_status(*status);
            is_fresh = now.since(at) <= STALE;
            of_gimbal = status.heading;
        }
        let heading = of_gimbal.or(heading);
        let is_alive = manager.state() == DeviceState::Alive && is_fresh;
        if heading.is_none() && matches!(self.voice.attitude(), Some(GimbalAttitude::InEarthFrame(_))) {
            return None;
        }
        self.voice.attitude_status(now, is_alive, manager.tracking().holds_north(), heading)
    }

    /// The channels on which 285 is due.
    pub fn take_due(&mut self, now: Timestamp) -> ChannelSet {
        self.voice.schedule.take_due(now)
    }

    pub fn poll_timeout(&self) -> Option<Timestamp> {
        self.voice.schedule.poll_timeout()
    }

    pub fn set_interval(&mut self, now: Timestamp, channel: ChannelId, micros: f32) -> Result<(), InvalidInterval> {
        self.voice.schedule.set(now, channel, micros)
    }

    pub fn interval(&self, channel: ChannelId) -> Interval {
        self.voice.schedule.interval(channel)
    }
}

/// What a gimbal can do through us: its own, with yaw in either frame, and pointing at places.
fn capabilities(device: CapFlags) -> CapFlags {
    // "Takes angles", which that flag stands for in managers, goes without saying in a device.
    messages::manager_capabilities(device, true)
        .difference(CapFlags::CAN_POINT_LOCATION_LOCAL)
        .union(device.intersection(CapFlags::CAN_POINT_LOCATION_LOCAL))
}

/// The component id under which the gimbal of a manager is presented: the place of its own among `managers` says which, or
/// the first that is free. `taken` are those of gimbals that are presented already.
pub fn component_of(manager: u8, managers: &[u8], taken: &[u8]) -> Option<u8> {
    let place = managers.iter().filter(|other| **other < manager).count();
    let own = COMPONENTS.get(place).copied();
    own.into_iter().chain(COMPONENTS).find(|component| !taken.contains(component))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// "The gimbal of manager 191 as 154, the second as 171", whose mounts ArduPilot looks for under these ids, and the first
    /// for no other than 154.
    #[test]
    fn each_manager_has_its_device() {
        for (managers, expected) in [
            (vec![191, 192, 193, 194], vec![154, 171, 172, 173]),
            (vec![192, 191], vec![171, 154]),
            (vec![195], vec![154]),
            (vec![192], vec![154]),
            (vec![191, 194], vec![154, 171]),
            (vec![195, 191, 196], vec![171, 154, 172]),
            (vec![191, 192, 193, 194, 195, 196], vec![154, 171, 172, 173, 174, 175]),
        ] {
            let mut found = Vec::new();
            for manager in &managers {
                found.push(component_of(*manager, &managers, &found).expect("one is free"));
            }
            assert_eq!(found, expected, "{managers:?}");
        }
        assert_eq!(component_of(191, &[195, 191], &[154]), Some(171), "found later than 195's");
        assert_eq!(component_of(197, &[197], &COMPONENTS), None, "there are six ids");
    }

    /// "283 with true capabilities": what we do for the gimbal is added, and what it cannot do stays away.
    #[test]
    fn capabilities_are_the_gimbals_and_ours() {
        let gimbal = CapFlags::HAS_PITCH_AXIS | CapFlags::HAS_PITCH_LOCK;
        assert_eq!(capabilities(gimbal), gimbal | CapFlags::CAN_POINT_LOCATION_GLOBAL);
        let gimbal = gimbal | CapFlags::HAS_YAW_AXIS | CapFlags::HAS_RETRACT;
        let yaw = CapFlags::HAS_YAW_FOLLOW | CapFlags::HAS_YAW_LOCK | CapFlags::SUPPORTS_YAW_IN_EARTH_FRAME;
        assert_eq!(capabilities(gimbal), gimbal | yaw | CapFlags::CAN_POINT_LOCATION_GLOBAL);
    }
}
