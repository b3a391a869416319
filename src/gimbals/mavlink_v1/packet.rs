//! The messages between a manager and a v1 gimbal.
//!
//! | Id | Message | Direction |
//! |---|---|---|
//! | 76 | `COMMAND_LONG` 205 `DO_MOUNT_CONTROL`: pitch, roll, yaw in degrees, parameter 7 the mode | to the gimbal |
//! | 76 | `COMMAND_LONG` 204 `DO_MOUNT_CONFIGURE`: the mode, and what the numbers of 205 mean | to the gimbal that needs it |
//! | 265 | `MOUNT_ORIENTATION`: roll and pitch against the horizon, yaw against the vehicle, degrees | from the gimbal |
//! | 158 | `MOUNT_STATUS`: pitch, roll, yaw in hundredths of a degree | from the gimbal |

use crate::geometry::{Angle, Attitude, GimbalAngles, VehicleFrame};
use crate::gimbals::signs::Signs;
use crate::wire::dialect::{COMMAND_LONG_DATA, MOUNT_ORIENTATION_DATA, MOUNT_STATUS_DATA, MavMessage};
use crate::wire::ids::{command, mount_mode};
use crate::wire::{Frame, MavId};

/// One `DO_MOUNT_CONTROL`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum MountControl {
    Retract,
    Neutral,
    /// Roll and pitch against the horizon, yaw against the vehicle.
    Angles(GimbalAngles),
    /// The gimbal's own radio control has it.
    RadioControl,
}

impl MountControl {
    /// Its `MAV_MOUNT_MODE`.
    pub const fn mode(self) -> u8 {
        match self {
            Self::Retract => mount_mode::RETRACT,
            Self::Neutral => mount_mode::NEUTRAL,
            Self::Angles(_) => mount_mode::MAVLINK_TARGETING,
            Self::RadioControl => mount_mode::RC_TARGETING,
        }
    }
}

/// 205 for `device`, which counts by `signs`: `ArduPilot` negates pitch and yaw towards a STorM32, which has learned to
/// expect it; `PX4` negates nothing.
pub fn mount_control(device: MavId, control: MountControl, signs: Signs) -> MavMessage {
    let angles = match control {
        MountControl::Angles(angles) => GimbalAngles { yaw: angles.yaw.wrapped(), ..angles },
        MountControl::Retract | MountControl::Neutral | MountControl::RadioControl => GimbalAngles::default(),
    };
    let GimbalAngles { roll, pitch, yaw } = signs.apply(angles);
    // Adding zero keeps −0 off the wire.
    let degrees = |angle: Angle| (angle.degrees() + 0.0) as f32;
    MavMessage::COMMAND_LONG(COMMAND_LONG_DATA {
        param1: degrees(pitch),
        param2: degrees(roll),
        param3: degrees(yaw),
        param4: 0.0,
        param5: 0.0,
        param6: 0.0,
        param7: f32::from(control.mode()),
        command: command::DO_MOUNT_CONTROL,
        target_system: device.system,
        target_component: device.component,
        confirmation: 0,
    })
}

/// 204 for `device`: the mode that the next 205 is in, and what its numbers mean. Roll and pitch are held to the horizon
/// and are angles against it (2), yaw is neither and counts from the nose (0), in the order roll, pitch, yaw.
pub fn mount_configure(device: MavId, mode: u8) -> COMMAND_LONG_DATA {
    COMMAND_LONG_DATA {
        param1: f32::from(mode),
        param2: 1.0,
        param3: 1.0,
        param4: 0.0,
        param5: 2.0,
        param6: 2.0,
        param7: 0.0,
        command: command::DO_MOUNT_CONFIGURE,
        target_system: device.system,
        target_component: device.component,
        confirmation: 0,
    }
}

/// Where a v1 gimbal that counts by `signs` says that it looks, yaw against the vehicle. `None` for another message, or numbers that are none.
pub fn read_attitude(frame: &Frame<'_>, signs: Signs) -> Option<Attitude<VehicleFrame>> {
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
    Some(Attitude::from_gimbal_angles(signs.apply(GimbalAngles { roll, pitch, yaw })))
}

/// No gimbal turns further; what is beyond is another unit.
const LARGEST_DEG: f64 = 720.0;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gimbals::signs::Sign;
    use crate::wire::FrameBuffer;

    const GIMBAL: MavId = MavId::new(1, 154);

    /// `DO_MOUNT_CONTROL`: p1 pitch, p2 roll, p3 yaw in degrees, p7 the mode; "v2 angle pitch −45 yaw +30 vehicle →
    /// generic v1 p1=−45, p3=30; STorM32 mount mode → p1=45, p3=−30" (gimbal statement 34, protocol checklist 176).
    /// Protocol checklist 176: "When a STorM32 device is configured `v1_sign = reversed`, DO_MOUNT_CONTROL output has negated
    /// pitch and yaw." Each axis has its own sign besides.
    #[test]
    fn statement_34_angles_go_out_in_the_signs_of_the_device() {
        let degrees = Angle::from_degrees;
        let angles = GimbalAngles { roll: degrees(5.0), pitch: degrees(-45.0), yaw: degrees(30.0) };
        let only_pitch = Signs { pitch: Sign::Opposite, ..Signs::NORMAL };
        let only_roll = Signs { roll: Sign::Opposite, ..Signs::NORMAL };
        for (control, signs, expected) in [
            (MountControl::Angles(angles), Signs::NORMAL, [-45.0, 5.0, 30.0, 2.0]),
            (MountControl::Angles(angles), Signs::REVERSED, [45.0, 5.0, -30.0, 2.0]),
            (MountControl::Angles(angles), only_pitch, [45.0, 5.0, 30.0, 2.0]),
            (MountControl::Angles(angles), only_roll, [-45.0, -5.0, 30.0, 2.0]),
            // Whichever way round it was said.
            (
                MountControl::Angles(GimbalAngles { yaw: degrees(190.0), ..angles }),
                Signs::NORMAL,
                [-45.0, 5.0, -170.0, 2.0],
            ),
            (MountControl::Neutral, Signs::REVERSED, [0.0, 0.0, 0.0, 1.0]),
            (MountControl::Retract, Signs::NORMAL, [0.0, 0.0, 0.0, 0.0]),
            (MountControl::RadioControl, Signs::REVERSED, [0.0, 0.0, 0.0, 3.0]),
        ] {
            let MavMessage::COMMAND_LONG(command) = mount_control(GIMBAL, control, signs) else { panic!("a command") };
            let sent = [command.param1, command.param2, command.param3, command.param7];
            for (sent, expected) in sent.iter().zip(expected) {
                assert!((sent - expected).abs() < 1e-4 && !(*sent == 0.0 && sent.is_sign_negative()), "{command:?}");
            }
            assert_eq!((command.command, command.target_system, command.target_component), (205, 1, 154));
        }
    }

    /// Gimbal statement 46, as a gimbal says it: "MOUNT_STATUS and MOUNT_ORIENTATION … equal −4500 cdeg / −45.0 deg for the
    /// same pose and MAV sign", and the same again from one whose reports count the other way (mavros has met a gimbal whose
    /// `MOUNT_ORIENTATION` had pitch inverted).
    #[test]
    fn both_reports_say_the_same() {
        for (signs, sign) in [(Signs::NORMAL, 1.0), (Signs { pitch: Sign::Opposite, ..Signs::NORMAL }, -1.0)] {
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
                let attitude = read_attitude(&buffer.encode_any(GIMBAL, 0, &message), signs).expect("an attitude");
                let angles = attitude.gimbal_angles();
                for (angle, expected) in [(angles.roll, 2.0), (angles.pitch, sign * -45.0), (angles.yaw, 30.0)] {
                    assert!((angle.degrees() - expected).abs() < 1e-4, "{angles:?}");
                }
            }
            for broken in [f32::NAN, f32::INFINITY, -4500.0] {
                let message =
                    MavMessage::MOUNT_ORIENTATION(MOUNT_ORIENTATION_DATA { pitch: broken, ..orientation.clone() });
                assert_eq!(read_attitude(&FrameBuffer::default().encode_any(GIMBAL, 0, &message), signs), None);
            }
        }
    }
}
