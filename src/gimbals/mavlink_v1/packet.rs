//! The messages between a manager and a v1 gimbal.
//!
//! | Id | Message | Direction |
//! |---|---|---|
//! | 76 | `COMMAND_LONG` 205 `DO_MOUNT_CONTROL`: pitch, roll, yaw in degrees, parameter 7 the mode | to the gimbal |
//! | 265 | `MOUNT_ORIENTATION`: roll and pitch against the horizon, yaw against the vehicle, degrees | from the gimbal |
//! | 158 | `MOUNT_STATUS`: pitch, roll, yaw in hundredths of a degree | from the gimbal |

use crate::geometry::{Angle, Attitude, GimbalAngles, VehicleFrame};
use crate::wire::dialect::{COMMAND_LONG_DATA, MOUNT_ORIENTATION_DATA, MOUNT_STATUS_DATA, MavMessage};
use crate::wire::ids::{command, mount_mode};
use crate::wire::{Frame, MavId};

/// Which way a device counts pitch and yaw in `DO_MOUNT_CONTROL`.
///
/// Its reports count as MAVLink does in either case: `ArduPilot` negates what it sends to a STorM32, which has learned
/// to expect it, and does not negate what comes back; `PX4` negates neither.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Signs {
    /// Up and right are positive.
    #[default]
    Normal,
    /// Down and left are positive.
    Reversed,
}

/// One `DO_MOUNT_CONTROL`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum MountControl {
    Retract,
    Neutral,
    /// Roll and pitch against the horizon, yaw against the vehicle.
    Angles(GimbalAngles),
}

/// 205 for `device`.
pub fn mount_control(device: MavId, control: MountControl, signs: Signs) -> MavMessage {
    let sign = match signs {
        Signs::Normal => 1.0,
        Signs::Reversed => -1.0,
    };
    let (angles, mode) = match control {
        MountControl::Retract => (GimbalAngles::default(), mount_mode::RETRACT),
        MountControl::Neutral => (GimbalAngles::default(), mount_mode::NEUTRAL),
        MountControl::Angles(angles) => (angles, mount_mode::MAVLINK_TARGETING),
    };
    // Adding zero keeps −0 off the wire.
    let signed = |angle: Angle| (sign * angle.degrees() + 0.0) as f32;
    MavMessage::COMMAND_LONG(COMMAND_LONG_DATA {
        param1: signed(angles.pitch),
        param2: angles.roll.degrees() as f32,
        param3: signed(angles.yaw.wrapped()),
        param4: 0.0,
        param5: 0.0,
        param6: 0.0,
        param7: f32::from(mode),
        command: command::DO_MOUNT_CONTROL,
        target_system: device.system,
        target_component: device.component,
        confirmation: 0,
    })
}

/// Where a v1 gimbal says that it looks, yaw against the vehicle. `None` for another message, or numbers that are none.
pub fn read_attitude(frame: &Frame<'_>) -> Option<Attitude<VehicleFrame>> {
    let [roll, pitch, yaw] = if let Some(message) = frame.decode::<MOUNT_ORIENTATION_DATA>() {
        [message.roll, message.pitch, message.yaw].map(f64::from)
    } else {
        let message = frame.decode::<MOUNT_STATUS_DATA>()?;
        [message.pointing_b, message.pointing_a, message.pointing_c].map(|hundredths| f64::from(hundredths) / 100.0)
    };
    if ![roll, pitch, yaw].iter().all(|degrees| degrees.is_finite() && degrees.abs() <= LARGEST_DEG) {
        return None;
    }
    let [roll, pitch, yaw] = [roll, pitch, yaw].map(Angle::from_degrees);
    Some(Attitude::from_gimbal_angles(GimbalAngles { roll, pitch, yaw }))
}

/// No gimbal turns further; what is beyond is another unit.
const LARGEST_DEG: f64 = 720.0;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wire::FrameBuffer;

    const GIMBAL: MavId = MavId::new(1, 154);

    /// `DO_MOUNT_CONTROL`: p1 pitch, p2 roll, p3 yaw in degrees, p7 the mode; "v2 angle pitch −45 yaw +30 vehicle →
    /// generic v1 p1=−45, p3=30; STorM32 mount mode → p1=45, p3=−30" (gimbal statement 34, checklist 176).
    #[test]
    fn statement_34_angles_go_out_in_the_signs_of_the_device() {
        let degrees = Angle::from_degrees;
        let angles = GimbalAngles { roll: degrees(5.0), pitch: degrees(-45.0), yaw: degrees(30.0) };
        for (control, signs, expected) in [
            (MountControl::Angles(angles), Signs::Normal, [-45.0, 5.0, 30.0, 2.0]),
            (MountControl::Angles(angles), Signs::Reversed, [45.0, 5.0, -30.0, 2.0]),
            (MountControl::Neutral, Signs::Reversed, [0.0, 0.0, 0.0, 1.0]),
            (MountControl::Retract, Signs::Normal, [0.0, 0.0, 0.0, 0.0]),
        ] {
            let MavMessage::COMMAND_LONG(command) = mount_control(GIMBAL, control, signs) else { panic!("a command") };
            let sent = [command.param1, command.param2, command.param3, command.param7];
            for (sent, expected) in sent.iter().zip(expected) {
                assert!((sent - expected).abs() < 1e-4 && !(*sent == 0.0 && sent.is_sign_negative()), "{command:?}");
            }
            assert_eq!((command.command, command.target_system, command.target_component), (205, 1, 154));
        }
    }

    /// "MOUNT_STATUS and MOUNT_ORIENTATION … equal −4500 cdeg / −45.0 deg for the same pose and MAV sign."
    #[test]
    fn both_reports_say_the_same() {
        let orientation =
            MOUNT_ORIENTATION_DATA { time_boot_ms: 1, roll: 2.0, pitch: -45.0, yaw: 30.0, yaw_absolute: 120.0 };
        let status = MOUNT_STATUS_DATA {
            pointing_a: -4500,
            pointing_b: 200,
            pointing_c: 3000,
            target_system: 0,
            target_component: 0,
            mount_mode: 2,
        };
        for message in [MavMessage::MOUNT_ORIENTATION(orientation.clone()), MavMessage::MOUNT_STATUS(status)] {
            let mut buffer = FrameBuffer::default();
            let angles = read_attitude(&buffer.encode_any(GIMBAL, 0, &message)).expect("an attitude").gimbal_angles();
            for (angle, expected) in [(angles.roll, 2.0), (angles.pitch, -45.0), (angles.yaw, 30.0)] {
                assert!((angle.degrees() - expected).abs() < 1e-4, "{angles:?}");
            }
        }
        for broken in [f32::NAN, f32::INFINITY, -4500.0] {
            let message =
                MavMessage::MOUNT_ORIENTATION(MOUNT_ORIENTATION_DATA { pitch: broken, ..orientation.clone() });
            assert_eq!(read_attitude(&FrameBuffer::default().encode_any(GIMBAL, 0, &message)), None);
        }
    }
}
