//! What a Gremsy is told.
//!
//! | Id | Message | Content |
//! |---|---|---|
//! | 76 | `COMMAND_LONG` 204 `DO_MOUNT_CONFIGURE` | p1 = 3: the RC receiver steers |
//! | 76 | `COMMAND_LONG` 205 `DO_MOUNT_CONTROL` | p1 pitch, p2 roll, p3 yaw in degrees or degrees per second, p6 = 1 angles or 2 rates, p7 = 2 (v1) |
//! | 76 | `COMMAND_LONG` 246 `PREFLIGHT_REBOOT_SHUTDOWN` | p4 = 1, or p3 the action and p4 = 154 |
//! | 76 | `COMMAND_LONG` 31010 `USER_1` | p7 = 1 motors on, 0 off (v1) |
//! | 76 | `COMMAND_LONG` 31011 `USER_2` | p7 = 1 lock, 2 follow, 4 reset as p6 says (v1) |
//! | 76 | `COMMAND_LONG` 511, 512 | p1 a message id, p2 its interval in microseconds |
//! | 284 | `GIMBAL_DEVICE_SET_ATTITUDE` | angles, rates, or flags alone (v2, [`super::modes`]) |
//!
//! Up and right are positive. 204, 246, 511 and 512 are the same in both generations.

use crate::geometry::{AngularRate, GimbalAngles};
use crate::gimbals::operation::ResetMode;
use crate::wire::MavId;
use crate::wire::dialect::COMMAND_LONG_DATA;
use crate::wire::ids::{command, component, mount_mode};

/// What the numbers of a `DO_MOUNT_CONTROL` are: the vendor's `input_mode_t`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InputMode {
    Angle,
    Speed,
}

impl InputMode {
    pub const fn code(self) -> u8 {
        match self {
            Self::Angle => 1,
            Self::Speed => 2,
        }
    }
}

/// The number of a reset in the vendor's `gimbal_reset_mode_t`.
pub const fn reset_code(mode: ResetMode) -> u8 {
    match mode {
        ResetMode::Yaw => 1,
        // The vendor's "return home".
        ResetMode::PitchAndYaw => 3,
        ResetMode::PitchDownUpAndYaw => 11,
        ResetMode::PitchDownUp => 12,
        ResetMode::PitchMapping => 13,
    }
}

/// The reset of that number.
pub fn reset_of(code: u8) -> Option<ResetMode> {
    ResetMode::ALL.into_iter().find(|mode| reset_code(*mode) == code)
}

/// What parameter 7 of `USER_2` asks for.
pub mod user_2 {
    pub const LOCK: u8 = 1;
    pub const FOLLOW: u8 = 2;
    pub const RESET: u8 = 4;
}

/// The vendor's `reboot_action_t`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RebootAction {
    Reboot,
    Shutdown,
}

/// How often a message is to come: the vendor's `rate_action_t`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MessageRate {
    Off,
    Default,
    /// The vendor offers 1 to 50, 75 and 100, and speaks of 200 at most.
    Hertz(u8),
}

impl MessageRate {
    /// Parameter 2 of `SET_MESSAGE_INTERVAL`.
    pub const fn interval_us(self) -> i32 {
        match self {
            Self::Off => -1,
            Self::Default | Self::Hertz(0) => 0,
            Self::Hertz(hertz) => 1_000_000 / hertz as i32,
        }
    }
}

/// Motors on or off (v1).
pub fn set_motors(device: MavId, on: bool) -> COMMAND_LONG_DATA {
    command_long(device, command::USER_1, [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, f32::from(u8::from(on))])
}

/// Yaw held against the horizon (v1).
pub fn lock(device: MavId) -> COMMAND_LONG_DATA {
    set_mode(device, user_2::LOCK, 0)
}

/// Yaw turning with the vehicle (v1).
pub fn follow(device: MavId) -> COMMAND_LONG_DATA {
    set_mode(device, user_2::FOLLOW, 0)
}

/// Back to a start (v1).
pub fn reset(device: MavId, mode: ResetMode) -> COMMAND_LONG_DATA {
    set_mode(device, user_2::RESET, reset_code(mode))
}

fn set_mode(device: MavId, mode: u8, reset: u8) -> COMMAND_LONG_DATA {
    command_long(device, command::USER_2, [0.0, 0.0, 0.0, 0.0, 0.0, f32::from(reset), f32::from(mode)])
}

/// To these angles: yaw against the horizon when it is locked, against the vehicle when it follows (v1).
pub fn rotate_to(device: MavId, angles: GimbalAngles) -> COMMAND_LONG_DATA {
    let degrees = [angles.pitch, angles.roll, angles.yaw].map(|angle| angle.degrees());
    mount_control(device, degrees, InputMode::Angle)
}

/// At these rates about roll, pitch and yaw, until told otherwise (v1).
pub fn turn_at(device: MavId, [roll, pitch, yaw]: [AngularRate; 3]) -> COMMAND_LONG_DATA {
    mount_control(device, [pitch, roll, yaw].map(AngularRate::degrees_per_second), InputMode::Speed)
}

fn mount_control(device: MavId, pitch_roll_yaw: [f64; 3], input: InputMode) -> COMMAND_LONG_DATA {
    // Adding zero keeps −0 off the wire.
    let [pitch, roll, yaw] = pitch_roll_yaw.map(|number| (number + 0.0) as f32);
    let (input, targeting) = (f32::from(input.code()), f32::from(mount_mode::MAVLINK_TARGETING));
    command_long(device, command::DO_MOUNT_CONTROL, [pitch, roll, yaw, 0.0, 0.0, input, targeting])
}

/// Hands the gimbal to its RC receiver.
pub fn hand_to_rc(device: MavId) -> COMMAND_LONG_DATA {
    let mode = f32::from(mount_mode::RC_TARGETING);
    command_long(device, command::DO_MOUNT_CONFIGURE, [mode, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
}

/// Starts the gimbal again, in the form that every firmware knows. The vendor's SDK waits for no answer.
pub fn reboot(device: MavId) -> COMMAND_LONG_DATA {
    command_long(device, command::PREFLIGHT_REBOOT_SHUTDOWN, [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
}

/// Starts the gimbal again or shuts it down, in the form of firmware that knows both.
pub fn reboot_or_shutdown(device: MavId, action: RebootAction) -> COMMAND_LONG_DATA {
    let action = match action {
        RebootAction::Reboot => 1.0,
        RebootAction::Shutdown => 2.0,
    };
    let gimbal = f32::from(component::GIMBAL);
    command_long(device, command::PREFLIGHT_REBOOT_SHUTDOWN, [0.0, 0.0, action, gimbal, 0.0, 0.0, 0.0])
}

/// How often `message_id` is to come.
pub fn set_message_rate(device: MavId, message_id: u32, rate: MessageRate) -> COMMAND_LONG_DATA {
    let params = [message_id as f32, rate.interval_us() as f32, 0.0, 0.0, 0.0, 0.0, 0.0];
    command_long(device, command::SET_MESSAGE_INTERVAL, params)
}

/// One `message_id`, once.
pub fn request_message(device: MavId, message_id: u32) -> COMMAND_LONG_DATA {
    command_long(device, command::REQUEST_MESSAGE, [message_id as f32, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
}

fn command_long(device: MavId, command: u16, params: [f32; 7]) -> COMMAND_LONG_DATA {
    let [param1, param2, param3, param4, param5, param6, param7] = params;
    COMMAND_LONG_DATA {
        param1,
        param2,
        param3,
        param4,
        param5,
        param6,
        param7,
        command,
        target_system: device.system,
        target_component: device.component,
        confirmation: 0,
    }
}

#[cfg(test)]
mod tests;
