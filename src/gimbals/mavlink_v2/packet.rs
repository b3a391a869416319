//! The messages between a manager and a gimbal device.
//!
//! | Id | Message | Direction |
//! |---|---|---|
//! | 283 | `GIMBAL_DEVICE_INFORMATION` | from the device, on request |
//! | 284 | `GIMBAL_DEVICE_SET_ATTITUDE` | to the device |
//! | 285 | `GIMBAL_DEVICE_ATTITUDE_STATUS` | from the device |
//! | 76 | `COMMAND_LONG` 512 `REQUEST_MESSAGE`, 511 `SET_MESSAGE_INTERVAL` | to the device |

use std::time::Duration;

use crate::geometry::{
    Angle, AngularRate, Attitude, AxisLimits, EarthFrame, GimbalAngles, Limits, VehicleFrame, Yaw, YawFrame,
};
use crate::gimbals::capabilities::Capabilities;
use crate::gimbals::report::{GimbalAttitude, Identity};
use crate::gimbals::setpoint::{Pointing, Setpoint, Turning, yaw_frame};
use crate::wire::dialect::{
    COMMAND_LONG_DATA, CharArray, GIMBAL_DEVICE_ATTITUDE_STATUS_DATA, GIMBAL_DEVICE_INFORMATION_DATA,
    GIMBAL_DEVICE_SET_ATTITUDE_DATA, MavMessage,
};
use crate::wire::ids::{CapFlags, FailureFlags, GimbalFlags, command};
use crate::wire::{Frame, MavId, Target};

/// Payload bytes of 285 before its extension fields.
const STATUS_BASE_LEN: usize = 40;

/// Of which gimbal 283 or 285 tells, by its `gimbal_device_id`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WhichGimbal {
    /// The component that sends it: 0, or against the rule its own component id, which can only mean itself.
    Sender,
    /// A gimbal without MAVLink behind it, 1 to 6.
    BehindSender,
    /// None: there is no such id.
    Nobody(u8),
}

impl WhichGimbal {
    /// What `gimbal_device_id` means in a message from `sender`.
    pub fn read(gimbal_device_id: u8, sender: MavId) -> Self {
        match gimbal_device_id {
            0 => Self::Sender,
            1..=6 => Self::BehindSender,
            id if id == sender.component => Self::Sender,
            id => Self::Nobody(id),
        }
    }
}

/// 283, decoded.
#[derive(Clone, Debug, PartialEq)]
pub struct DeviceInformation {
    /// Time since the device's start, milliseconds.
    pub boot_ms: u32,
    pub identity: Identity,
    pub capabilities: Capabilities,
    /// Of which gimbal it tells that.
    pub of: WhichGimbal,
}

/// Reads 283; `None` for another message.
pub fn read_information(frame: &Frame<'_>) -> Option<DeviceInformation> {
    let message: GIMBAL_DEVICE_INFORMATION_DATA = frame.decode()?;
    // `cap_flags2` came in 2026 and, where it is sent, holds the whole set.
    let flags = if message.cap_flags2 == 0 { u32::from(message.cap_flags) } else { message.cap_flags2 };
    let axis =
        |min: f32, max: f32| AxisLimits::new(Angle::from_radians(f64::from(min)), Angle::from_radians(f64::from(max)));
    let limits = Limits {
        roll: axis(message.roll_min, message.roll_max),
        pitch: axis(message.pitch_min, message.pitch_max),
        yaw: axis(message.yaw_min, message.yaw_max),
    };
    let flags = CapFlags::from_bits_retain(flags);
    let limits = if flags.contains(CapFlags::SUPPORTS_INFINITE_YAW) { Limits { yaw: None, ..limits } } else { limits };
    Some(DeviceInformation {
        boot_ms: message.time_boot_ms,
        identity: Identity {
            vendor: text(&message.vendor_name),
            model: text(&message.model_name),
            custom_name: text(&message.custom_name),
            firmware: (message.firmware_version != 0).then(|| message.firmware_version.to_le_bytes()),
            uid: (message.uid != 0).then_some(message.uid),
        },
        capabilities: Capabilities {
            flags,
            limits,
            turns: true,
            operates: false,
            retract_cuts_motors: false,
            radio_control_untold: false,
        },
        of: WhichGimbal::read(message.gimbal_device_id, frame.source()),
    })
}

/// The text before the first NUL, without what a terminal or a browser would act on.
fn text<const N: usize>(raw: &CharArray<N>) -> String {
    let bytes: &[u8; N] = raw;
    let end = bytes.iter().position(|byte| *byte == 0).unwrap_or(N);
    String::from_utf8_lossy(&bytes[..end])
        .chars()
        .filter(|char| !char.is_control())
        .collect::<String>()
        .trim()
        .to_owned()
}

/// 285, decoded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DeviceStatus {
    /// Time since the device's start, milliseconds.
    pub boot_ms: u32,
    /// Why there is none is a word for the counters: the quaternion is malformed, or both frame bits are set.
    pub attitude: Result<GimbalAttitude, &'static str>,
    pub rates: [Option<AngularRate>; 3],
    pub flags: GimbalFlags,
    pub failures: FailureFlags,
    /// `delta_yaw` where the frame carried it and it is a number.
    pub delta_yaw: Option<Angle>,
    /// The frame was long enough to carry the extension fields.
    pub extended: bool,
    /// Of which gimbal it tells that.
    pub of: WhichGimbal,
}

/// Reads 285; `None` for another message.
pub fn read_status(frame: &Frame<'_>) -> Option<DeviceStatus> {
    let message: GIMBAL_DEVICE_ATTITUDE_STATUS_DATA = frame.decode()?;
    let flags = GimbalFlags::from_bits_retain(message.flags);
    let rate = |value: f32| value.is_finite().then(|| AngularRate::from_radians_per_second(f64::from(value)));
    let attitude = match yaw_frame(flags) {
        Some(YawFrame::Vehicle) => attitude(message.q).map(GimbalAttitude::InVehicleFrame),
        Some(YawFrame::Earth) => attitude(message.q).map(GimbalAttitude::InEarthFrame),
        None => Err("both_yaw_frames"),
    };
    Some(DeviceStatus {
        boot_ms: message.time_boot_ms,
        attitude,
        rates: [rate(message.angular_velocity_x), rate(message.angular_velocity_y), rate(message.angular_velocity_z)],
        flags,
        failures: FailureFlags::from_bits_retain(message.failure_flags),
        delta_yaw: message.delta_yaw.is_finite().then(|| Angle::from_radians(f64::from(message.delta_yaw)).wrapped()),
        extended: frame.payload().len() > STATUS_BASE_LEN,
        of: WhichGimbal::read(message.gimbal_device_id, frame.source()),
    })
}

fn attitude<F>(q: [f32; 4]) -> Result<Attitude<F>, &'static str> {
    Attitude::from_wxyz(q).ok().flatten().ok_or("malformed_quaternion")
}

/// 284 for `device`. Exactly one frame bit is set, and `YAW_LOCK` exactly with the earth frame.
pub fn set_attitude(device: MavId, setpoint: &Setpoint) -> MavMessage {
    let mut q = [f32::NAN; 4];
    let mut rates = [f32::NAN; 3];
    match *setpoint {
        Setpoint::Retract | Setpoint::Neutral => {}
        Setpoint::Point(Pointing { roll, pitch, yaw, .. }) => {
            let angles = GimbalAngles { roll, pitch, yaw: yaw.angle() };
            q = match yaw {
                Yaw::InVehicleFrame(_) => Attitude::<VehicleFrame>::from_gimbal_angles(angles).to_wxyz(),
                Yaw::InEarthFrame(_) => Attitude::<EarthFrame>::from_gimbal_angles(angles).to_wxyz(),
            };
        }
        Setpoint::Turn(Turning { roll, pitch, yaw, .. }) => {
            let number = |rate: AngularRate| rate.radians_per_second() as f32;
            rates = [roll.map_or(f32::NAN, number), number(pitch), number(yaw)];
        }
    }
    MavMessage::GIMBAL_DEVICE_SET_ATTITUDE(GIMBAL_DEVICE_SET_ATTITUDE_DATA {
        q,
        angular_velocity_x: rates[0],
        angular_velocity_y: rates[1],
        angular_velocity_z: rates[2],
        flags: setpoint.flags().bits(),
        target_system: device.system,
        target_component: device.component,
    })
}

/// `REQUEST_MESSAGE` for `message_id`.
pub fn request_message(target: Target, message_id: u32) -> MavMessage {
    MavMessage::COMMAND_LONG(command_long(target, command::REQUEST_MESSAGE, [message_id as f32, 0.0]))
}

/// The same to one component, which is to answer.
pub fn request_of(target: MavId, message_id: u32) -> COMMAND_LONG_DATA {
    command_long(Target::Component(target), command::REQUEST_MESSAGE, [message_id as f32, 0.0])
}

/// `SET_MESSAGE_INTERVAL` for `message_id`.
pub fn set_message_interval(target: MavId, message_id: u32, interval: Duration) -> COMMAND_LONG_DATA {
    let params = [message_id as f32, interval.as_micros() as f32];
    command_long(Target::Component(target), command::SET_MESSAGE_INTERVAL, params)
}

fn command_long(target: Target, command: u16, [param1, param2]: [f32; 2]) -> COMMAND_LONG_DATA {
    COMMAND_LONG_DATA {
        param1,
        param2,
        param3: 0.0,
        param4: 0.0,
        param5: 0.0,
        param6: 0.0,
        param7: 0.0,
        command,
        target_system: target.system(),
        target_component: target.component(),
        confirmation: 0,
    }
}
