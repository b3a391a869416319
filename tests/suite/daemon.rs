//! The real binary as a process, with real ports around it.
//!
//! The only tests in real time: every wait has a condition and a deadline.

mod control;
mod endings;
mod garbage;
mod gimbal_ids;
mod load;
mod ports;
mod reports;
mod restart;
mod unplugged;

use gimbald::gimbals::mavlink_v2::sim::{Device, DeviceSettings};
use gimbald::timestamp::Timestamp;
use gimbald::wire::dialect::{ATTITUDE_DATA, GIMBAL_MANAGER_SET_PITCHYAW_DATA, MavMessage};

use crate::support::daemon::{Shared, link};
use crate::support::script::command_long;
use crate::support::world::MANAGER;

/// A gimbal on a serial line, an autopilot and a ground station on UDP; our system id is 1.
fn three_links() -> String {
    [
        "[vehicle]\nsystem_id = 1\n".to_owned(),
        link("autopilot", "autopilot", "udpin:{ip}:14540"),
        link("gimbal", "gimbal", "serial:{dir}/gimbal:115200"),
        link("ground", "ground", "udpin:{ip}:14550"),
    ]
    .concat()
}

/// A ground station on UDP; our system id is 1.
fn one_link() -> String {
    ["[vehicle]\nsystem_id = 1\n".to_owned(), link("ground", "ground", "udpin:{ip}:14550")].concat()
}

fn simulated_gimbal() -> Shared<Device> {
    Shared::new(Device::new(Timestamp::ZERO, DeviceSettings::default()))
}

/// 287 for every gimbal, in radians and radians per second, in the vehicle's frame.
fn set_pitchyaw(pitch: f32, yaw: f32, pitch_rate: f32, yaw_rate: f32) -> MavMessage {
    MavMessage::GIMBAL_MANAGER_SET_PITCHYAW(GIMBAL_MANAGER_SET_PITCHYAW_DATA {
        flags: 0,
        pitch,
        yaw,
        pitch_rate,
        yaw_rate,
        target_system: MANAGER.system,
        target_component: MANAGER.component,
        gimbal_device_id: 0,
    })
}

fn command(number: u16, param1: f32, target: gimbald::wire::MavId) -> MavMessage {
    command_long(target, number, &[param1, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
}

/// Telemetry with a number in it.
fn attitude(number: u32) -> MavMessage {
    MavMessage::ATTITUDE(ATTITUDE_DATA {
        time_boot_ms: number,
        roll: 0.0,
        pitch: 0.0,
        yaw: 0.0,
        rollspeed: 0.0,
        pitchspeed: 0.0,
        // Keeps the frame from being cut short.
        yawspeed: 0.01,
    })
}
