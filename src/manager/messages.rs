//! The messages that a gimbal manager sends.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};
use std::time::Duration;

use crate::geometry::AxisLimits;
use crate::gimbals::capabilities::Capabilities;
use crate::timestamp::Timestamp;
use crate::wire::MavId;
use crate::wire::dialect::{
    COMMAND_ACK_DATA, COMPONENT_INFORMATION_BASIC_DATA, CharArray, GIMBAL_MANAGER_INFORMATION_DATA,
    GIMBAL_MANAGER_STATUS_DATA, HEARTBEAT_DATA, MESSAGE_INTERVAL_DATA, MavMessage, STATUSTEXT_DATA,
};
use crate::wire::ids::{CapFlags, CommandResult, GimbalFlags, mav_autopilot, protocol_capability};

/// `HEARTBEAT` of a manager of that `MAV_TYPE`, which is no autopilot and has no modes.
pub fn heartbeat(mavtype: u8, system_status: u8) -> MavMessage {
    MavMessage::HEARTBEAT(HEARTBEAT_DATA {
        custom_mode: 0,
        mavtype,
        autopilot: mav_autopilot::INVALID,
        base_mode: 0,
        system_status,
        mavlink_version: 3,
    })
}

/// `GIMBAL_MANAGER_INFORMATION` (280).
pub fn information(now: Timestamp, device_id: u8, capabilities: &Capabilities, can_aim: bool) -> MavMessage {
    let flags = manager_capabilities(capabilities.flags, can_aim);
    let limits = &capabilities.limits;
    // Clients draw sliders from these numbers, so they are finite also where the device states none.
    let yaw = if flags.contains(CapFlags::SUPPORTS_INFINITE_YAW) { None } else { limits.yaw };
    let (roll_min, roll_max) = range(limits.roll, flags.contains(CapFlags::HAS_ROLL_AXIS), FRAC_PI_4);
    let (pitch_min, pitch_max) = range(limits.pitch, flags.contains(CapFlags::HAS_PITCH_AXIS), FRAC_PI_2);
    let (yaw_min, yaw_max) = range(yaw, flags.contains(CapFlags::HAS_YAW_AXIS), PI);
    MavMessage::GIMBAL_MANAGER_INFORMATION(GIMBAL_MANAGER_INFORMATION_DATA {
        time_boot_ms: now.boot_ms(),
        cap_flags: flags.bits(),
        roll_min,
        roll_max,
        pitch_min,
        pitch_max,
        yaw_min,
        yaw_max,
        gimbal_device_id: device_id,
    })
}

fn range(limits: Option<AxisLimits>, has_axis: bool, substitute: f64) -> (f32, f32) {
    match limits {
        Some(limits) => (limits.min().radians() as f32, limits.max().radians() as f32),
        None if has_axis => (-substitute as f32, substitute as f32),
        None => (0.0, 0.0),
    }
}

/// The device's capabilities with what the manager adds: yaw in either frame, and pointing at a place.
///
/// `CAN_POINT_LOCATION_LOCAL` stands for taking angles, as ArduPilot's managers say it and Mission Planner reads it, who
/// offers no angles without it. A place in a local frame, which the name may also mean, is refused by result 9.
pub fn manager_capabilities(device: CapFlags, can_aim: bool) -> CapFlags {
    let known = CapFlags::from_bits_retain(0x3ffff);
    let mut flags = device.intersection(known);
    let takes_angles = flags.intersects(CapFlags::HAS_PITCH_AXIS | CapFlags::HAS_YAW_AXIS);
    flags.set(CapFlags::CAN_POINT_LOCATION_LOCAL, takes_angles);
    if flags.contains(CapFlags::HAS_YAW_AXIS) {
        flags |= CapFlags::HAS_YAW_FOLLOW | CapFlags::HAS_YAW_LOCK | CapFlags::SUPPORTS_YAW_IN_EARTH_FRAME;
    }
    flags.set(CapFlags::CAN_POINT_LOCATION_GLOBAL, can_aim);
    flags
}

/// `GIMBAL_MANAGER_STATUS` (281). Nobody is 0/0.
pub fn status(
    now: Timestamp,
    device_id: u8,
    flags: GimbalFlags,
    primary: Option<MavId>,
    secondary: Option<MavId>,
) -> MavMessage {
    let nobody = MavId::new(0, 0);
    let (primary, secondary) = (primary.unwrap_or(nobody), secondary.unwrap_or(nobody));
    MavMessage::GIMBAL_MANAGER_STATUS(GIMBAL_MANAGER_STATUS_DATA {
        time_boot_ms: now.boot_ms(),
        flags: u32::from(flags.bits()),
        gimbal_device_id: device_id,
        primary_control_sysid: primary.system,
        primary_control_compid: primary.component,
        secondary_control_sysid: secondary.system,
        secondary_control_compid: secondary.component,
    })
}

/// `STATUSTEXT` (253) in one piece.
pub fn status_text(severity: u8, text: &str) -> MavMessage {
    MavMessage::STATUSTEXT(STATUSTEXT_DATA { severity, text: CharArray::from(text), id: 0, chunk_seq: 0 })
}

/// `COMMAND_ACK` to whoever sent the command.
pub fn ack(to: MavId, command: u16, result: CommandResult) -> MavMessage {
    MavMessage::COMMAND_ACK(COMMAND_ACK_DATA {
        command,
        result: result as u8,
        progress: u8::MAX,
        result_param2: 0,
        target_system: to.system,
        target_component: to.component,
    })
}

/// How a message is sent, as `MESSAGE_INTERVAL` tells it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Interval {
    Every(Duration),
    Off,
    NotAvailable,
}

/// `MESSAGE_INTERVAL` (244).
pub fn message_interval(message_id: u32, interval: Interval) -> MavMessage {
    MavMessage::MESSAGE_INTERVAL(MESSAGE_INTERVAL_DATA {
        interval_us: match interval {
            Interval::Every(interval) => i32::try_from(interval.as_micros()).unwrap_or(i32::MAX),
            Interval::Off => -1,
            Interval::NotAvailable => 0,
        },
        message_id: u16::try_from(message_id).unwrap_or(u16::MAX),
    })
}

/// `COMPONENT_INFORMATION_BASIC` (396): what tells a client that this component is a gimbal manager.
pub fn component_information_basic(now: Timestamp) -> MavMessage {
    MavMessage::COMPONENT_INFORMATION_BASIC(COMPONENT_INFORMATION_BASIC_DATA {
        capabilities: protocol_capability::COMMAND_INT
            | protocol_capability::MAVLINK2
            | protocol_capability::COMPONENT_IMPLEMENTS_GIMBAL_MANAGER,
        time_boot_ms: now.boot_ms(),
        time_manufacture_s: 0,
        vendor_name: CharArray::from("gimbald"),
        model_name: CharArray::from("gimbal manager"),
        software_version: CharArray::from(env!("CARGO_PKG_VERSION")),
        hardware_version: CharArray::from(""),
        serial_number: CharArray::from(""),
    })
}
