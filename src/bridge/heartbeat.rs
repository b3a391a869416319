//! The heartbeats of our managers.

use std::time::Duration;

use super::roster::Gimbal;
use crate::manager::{DeviceState, messages};
use crate::wire::dialect::MavMessage;
use crate::wire::ids::mav_state;

pub const INTERVAL: Duration = Duration::from_secs(1);

/// `HEARTBEAT` of one manager; its state is that of its gimbal.
pub fn heartbeat(gimbal: &Gimbal, bootstrap: bool) -> MavMessage {
    let state = match gimbal.manager.state() {
        _ if bootstrap => mav_state::BOOT,
        DeviceState::Searching => mav_state::STANDBY,
        DeviceState::Alive if gimbal.manager.has_hard_failure() => mav_state::CRITICAL,
        DeviceState::Alive => mav_state::ACTIVE,
        DeviceState::Lost => mav_state::CRITICAL,
    };
    messages::heartbeat(gimbal.mav_type(), state)
}

/// The last one of a manager that is going away.
pub fn goodbye(gimbal: &Gimbal) -> MavMessage {
    messages::heartbeat(gimbal.mav_type(), mav_state::POWEROFF)
}
