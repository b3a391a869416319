//! Changes inside a frame that leave it a valid one.

use mavlink_core::calculate_crc;

use crate::sim::random::Random;
use crate::timestamp::Timestamp;
use crate::wire::dialect::{
    ATTITUDE_DATA, ATTITUDE_QUATERNION_DATA, AUTOPILOT_STATE_FOR_GIMBAL_DEVICE_DATA, COMMAND_ACK_DATA,
    GIMBAL_DEVICE_ATTITUDE_STATUS_DATA, GIMBAL_DEVICE_INFORMATION_DATA, GLOBAL_POSITION_INT_DATA, HEARTBEAT_DATA,
    LOCAL_POSITION_NED_DATA, MessageData, SYSTEM_TIME_DATA,
};
use crate::wire::ids::{GimbalFlags, component, mav_autopilot, mav_state, mav_type, message};
use crate::wire::target::message_shape;
use crate::wire::{DatagramFrames, Frame, MavId, Version, encode_to_vec};

/// `LOCAL_POSITION_NED`.
const LOCAL_POSITION_NED: u32 = LOCAL_POSITION_NED_DATA::ID;

/// The id of the message in `bytes`; `None` if they are no frame.
pub fn message_id(bytes: &[u8]) -> Option<u32> {
    DatagramFrames::new(bytes).next_frame().map(|frame| frame.message_id())
}

/// A heartbeat of the autopilot of another vehicle, 99/1.
pub fn foreign_heartbeat() -> Vec<u8> {
    let heartbeat = HEARTBEAT_DATA {
        custom_mode: 0,
        mavtype: mav_type::QUADROTOR,
        autopilot: mav_autopilot::PX4,
        base_mode: 0,
        system_status: mav_state::ACTIVE,
        mavlink_version: 3,
    };
    encode_to_vec(MavId::new(99, 1), 0, &heartbeat)
}

/// What a second device under the ids of the sender of `bytes` says: it looks straight ahead, from its own start on.
pub fn attitude_of_twin(bytes: &[u8], now: Timestamp) -> Vec<u8> {
    let source =
        DatagramFrames::new(bytes).next_frame().map_or(MavId::new(1, component::GIMBAL), |frame| frame.source());
    let attitude = GIMBAL_DEVICE_ATTITUDE_STATUS_DATA {
        time_boot_ms: now.boot_ms(),
        q: [1.0, 0.0, 0.0, 0.0],
        angular_velocity_x: f32::NAN,
        angular_velocity_y: f32::NAN,
        angular_velocity_z: f32::NAN,
        failure_flags: 0,
        flags: (GimbalFlags::ROLL_LOCK | GimbalFlags::PITCH_LOCK | GimbalFlags::YAW_IN_VEHICLE_FRAME).bits(),
        target_system: 0,
        target_component: 0,
        delta_yaw: f32::NAN,
        delta_yaw_velocity: f32::NAN,
        gimbal_device_id: 0,
    };
    encode_to_vec(source, 0, &attitude)
}

/// Addresses a `COMMAND_ACK` to a component that did not ask.
pub fn redirect_ack(bytes: &mut Vec<u8>) {
    edit(bytes, |ack: &mut COMMAND_ACK_DATA| {
        ack.target_system = ack.target_system.wrapping_add(1);
        ack.target_component = ack.target_component.wrapping_add(1);
    });
}

/// Adds `by_ms` to the sender's time since boot, where the message carries it.
pub fn shift_clock(bytes: &mut Vec<u8>, by_ms: i64) {
    let by = by_ms as u32;
    match message_id(bytes) {
        Some(message::SYSTEM_TIME) => edit(bytes, |m: &mut SYSTEM_TIME_DATA| shift(&mut m.time_boot_ms, by)),
        Some(message::ATTITUDE) => edit(bytes, |m: &mut ATTITUDE_DATA| shift(&mut m.time_boot_ms, by)),
        Some(message::ATTITUDE_QUATERNION) => {
            edit(bytes, |m: &mut ATTITUDE_QUATERNION_DATA| shift(&mut m.time_boot_ms, by));
        }
        Some(LOCAL_POSITION_NED) => edit(bytes, |m: &mut LOCAL_POSITION_NED_DATA| shift(&mut m.time_boot_ms, by)),
        Some(message::GLOBAL_POSITION_INT) => {
            edit(bytes, |m: &mut GLOBAL_POSITION_INT_DATA| shift(&mut m.time_boot_ms, by));
        }
        Some(message::GIMBAL_DEVICE_INFORMATION) => {
            edit(bytes, |m: &mut GIMBAL_DEVICE_INFORMATION_DATA| shift(&mut m.time_boot_ms, by));
        }
        Some(message::GIMBAL_DEVICE_ATTITUDE_STATUS) => {
            edit(bytes, |m: &mut GIMBAL_DEVICE_ATTITUDE_STATUS_DATA| shift(&mut m.time_boot_ms, by));
        }
        Some(message::AUTOPILOT_STATE_FOR_GIMBAL_DEVICE) => {
            edit(bytes, |m: &mut AUTOPILOT_STATE_FOR_GIMBAL_DEVICE_DATA| {
                m.time_boot_us = m.time_boot_us.wrapping_add_signed(by_ms.wrapping_mul(1000));
            });
        }
        _ => {}
    }
}

fn shift(time: &mut u32, by: u32) {
    *time = time.wrapping_add(by);
}

/// Makes one float NaN, where the message holds an attitude.
pub fn put_nan(bytes: &mut Vec<u8>, random: &mut Random) {
    match message_id(bytes) {
        Some(message::ATTITUDE) => edit(bytes, |m: &mut ATTITUDE_DATA| {
            spoil([&mut m.roll, &mut m.pitch, &mut m.yaw, &mut m.rollspeed, &mut m.pitchspeed, &mut m.yawspeed], random)
        }),
        Some(message::ATTITUDE_QUATERNION) => edit(bytes, |m: &mut ATTITUDE_QUATERNION_DATA| {
            spoil([&mut m.q1, &mut m.q2, &mut m.q3, &mut m.q4, &mut m.rollspeed, &mut m.yawspeed], random);
        }),
        Some(message::GIMBAL_DEVICE_INFORMATION) => edit(bytes, |m: &mut GIMBAL_DEVICE_INFORMATION_DATA| {
            spoil([&mut m.pitch_min, &mut m.pitch_max, &mut m.yaw_min, &mut m.yaw_max], random);
        }),
        Some(message::GIMBAL_DEVICE_ATTITUDE_STATUS) => edit(bytes, |m: &mut GIMBAL_DEVICE_ATTITUDE_STATUS_DATA| {
            let [w, x, y, z] = m.q.each_mut();
            spoil([w, x, y, z, &mut m.angular_velocity_y, &mut m.angular_velocity_z, &mut m.delta_yaw], random);
        }),
        Some(message::AUTOPILOT_STATE_FOR_GIMBAL_DEVICE) => {
            edit(bytes, |m: &mut AUTOPILOT_STATE_FOR_GIMBAL_DEVICE_DATA| {
                let [w, x, y, z] = m.q.each_mut();
                spoil([w, x, y, z, &mut m.vx, &mut m.vy, &mut m.vz], random);
            });
        }
        _ => {}
    }
}

fn spoil<const N: usize>(floats: [&mut f32; N], random: &mut Random) {
    *floats[random.below(N)] = f32::NAN;
}

/// Moves the sequence number of an unsigned MAVLink 2 frame on by `by`.
pub fn shift_sequence(bytes: &mut [u8], by: u8) {
    let Some(frame) = DatagramFrames::new(bytes).next_frame() else { return };
    let Some(shape) = message_shape(frame.message_id()) else { return };
    if frame.version() != Version::V2 || frame.is_signed() {
        return;
    }
    let end = frame.bytes().len() - 2;
    bytes[4] = bytes[4].wrapping_add(by);
    let crc = calculate_crc(&bytes[1..end], shape.crc_extra);
    bytes[end..end + 2].copy_from_slice(&crc.to_le_bytes());
}

/// Applies `change` to the message of type `M` in `bytes`, if there is one.
fn edit<M: MessageData>(bytes: &mut Vec<u8>, change: impl FnOnce(&mut M)) {
    let read = |frame: Frame<'_>| Some((frame.source(), frame.sequence(), frame.decode::<M>()?));
    let Some((source, sequence, mut content)) = DatagramFrames::new(bytes).next_frame().and_then(read) else { return };
    change(&mut content);
    *bytes = encode_to_vec(source, sequence, &content);
}
