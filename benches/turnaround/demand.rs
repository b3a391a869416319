//! What the ground station wants, each time something else, and how its fulfilment looks.

use gimbald::geometry::{Angle, Attitude, EarthFrame};
use gimbald::wire::dialect::{
    COMMAND_ACK_DATA, COMMAND_LONG_DATA, GIMBAL_DEVICE_SET_ATTITUDE_DATA, GIMBAL_MANAGER_SET_PITCHYAW_DATA,
    HEARTBEAT_DATA, TUNNEL_DATA,
};
use gimbald::wire::{Frame, MavId, encode_to_vec};

pub const AUTOPILOT: MavId = MavId::new(1, 1);
pub const GROUND: MavId = MavId::new(255, 190);
const MANAGER: MavId = MavId::new(1, 191);
const DEVICE: u8 = 154;
const PITCHYAW: u16 = 1000;
/// Roll and pitch level, yaw from the vehicle's nose.
const FLAGS: u16 = 44;

/// Two pitch angles that differ by less are the same one; degrees.
const SAME: f64 = 0.005;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Demand {
    /// `GIMBAL_MANAGER_SET_PITCHYAW`.
    SetPitchyaw,
    /// `COMMAND_LONG` with `MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW`.
    Command,
}

/// What is waited for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Effect {
    /// `GIMBAL_DEVICE_SET_ATTITUDE`, at the gimbal's end.
    Setpoint,
    /// `COMMAND_ACK`, at the ground station's.
    Answer,
}

impl Demand {
    /// The frame that asks for `pitch` in degrees.
    pub fn frame(self, sequence: u8, pitch: f64) -> Vec<u8> {
        match self {
            Self::SetPitchyaw => {
                let message = GIMBAL_MANAGER_SET_PITCHYAW_DATA {
                    flags: u32::from(FLAGS),
                    pitch: pitch.to_radians() as f32,
                    yaw: 0.2,
                    pitch_rate: f32::NAN,
                    yaw_rate: f32::NAN,
                    target_system: MANAGER.system,
                    target_component: MANAGER.component,
                    gimbal_device_id: DEVICE,
                };
                encode_to_vec(GROUND, sequence, &message)
            }
            Self::Command => {
                let message = COMMAND_LONG_DATA {
                    param1: pitch as f32,
                    param2: 10.0,
                    param3: f32::NAN,
                    param4: f32::NAN,
                    param5: f32::from(FLAGS),
                    param6: 0.0,
                    param7: f32::from(DEVICE),
                    command: PITCHYAW,
                    target_system: MANAGER.system,
                    target_component: MANAGER.component,
                    confirmation: 0,
                };
                encode_to_vec(GROUND, sequence, &message)
            }
        }
    }
}

/// Whether `frame` sends the gimbal to `pitch` in degrees.
pub fn is_setpoint(frame: &Frame<'_>, pitch: f64) -> bool {
    let Some(setpoint) = frame.decode::<GIMBAL_DEVICE_SET_ATTITUDE_DATA>() else { return false };
    // Pitch is the same in either frame.
    let Ok(Some(attitude)) = Attitude::<EarthFrame>::from_wxyz(setpoint.q) else { return false };
    (attitude.gimbal_angles().pitch - Angle::from_degrees(pitch)).abs() < Angle::from_degrees(SAME)
}

pub fn is_acceptance(frame: &Frame<'_>) -> bool {
    frame.decode::<COMMAND_ACK_DATA>().is_some_and(|ack| {
        (ack.command, ack.result, ack.target_system, ack.target_component)
            == (PITCHYAW, 0, GROUND.system, GROUND.component)
    })
}

pub fn heartbeat(source: MavId, sequence: u8, mavtype: u8, autopilot: u8) -> Vec<u8> {
    let message =
        HEARTBEAT_DATA { custom_mode: 0, mavtype, autopilot, base_mode: 0, system_status: 4, mavlink_version: 3 };
    encode_to_vec(source, sequence, &message)
}

/// 64 bytes of the ground station for the autopilot.
pub fn foreign_of_ground(sequence: u8) -> Vec<u8> {
    const TEXT: usize = 47;
    let mut payload = [0; 128];
    payload[..TEXT].fill(b'g');
    let message = TUNNEL_DATA {
        payload_type: 0,
        target_system: AUTOPILOT.system,
        target_component: AUTOPILOT.component,
        payload_length: TEXT as u8,
        payload,
    };
    encode_to_vec(GROUND, sequence, &message)
}
