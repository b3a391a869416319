//! What can be asked of a gimbal by its name, beyond where it looks: motors, modes of its own, settings, streams.
//!
//! Where it looks is a demand, which every family understands ([`Setpoint`](super::setpoint::Setpoint)). An operation is
//! for the families that have the like; the others answer [`OperationError::Unsupported`].

mod settings;

use std::fmt;

pub use self::settings::{Axis, AxisMotion, EncoderUnit, MotorAxis, MotorControl, RadioType};

use crate::geometry::AxisLimits;

/// Tells the answers to several operations apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct OperationId(pub u64);

/// What is asked.
#[derive(Clone, Debug, PartialEq)]
pub enum Operation {
    /// Switches the motors; without them the camera falls to where its weight takes it.
    Motors(Motors),
    Restart(Restart),
    /// Holds the camera where it looks, yaw to the vehicle's nose or to North.
    SetYawMode(YawMode),
    /// Looks straight down, for surveys; what becomes of yaw is the gimbal's affair.
    Mapping,
    Reset(ResetMode),
    /// Leaves the gimbal to its own radio receiver until the next demand.
    RadioControl,
    /// Asks the gimbal once more who it is.
    RequestInformation,
    /// How often the gimbal sends one of its messages.
    SetStreamRate {
        stream: Stream,
        rate: StreamRate,
    },
    /// Reads every parameter again.
    RefreshParameters,
    /// Writes a parameter by its name of at most 16 bytes.
    SetParameter {
        name: String,
        value: f64,
    },
    SetAxisMotion {
        axis: Axis,
        motion: AxisMotion,
    },
    SetMotorControl(MotorControl),
    /// Software limits.
    SetLimits {
        axis: Axis,
        limits: AxisLimits,
    },
    SetRadioType(RadioType),
    SetEncoderUnit(EncoderUnit),
    /// Lets the autopilot's attitude keep yaw from drifting.
    SetCombinedAttitude(bool),
    /// Lets the gimbal return home whenever lock and follow are switched.
    SetHomeOnModeChange(bool),
}

impl Operation {
    /// A word for counters and the person looking.
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Motors(Motors::Off) => "motors_off",
            Self::Motors(Motors::On) => "motors_on",
            Self::Restart(Restart::Reboot) => "reboot",
            Self::Restart(Restart::Shutdown) => "shutdown",
            Self::SetYawMode(YawMode::Follow) => "yaw_mode_follow",
            Self::SetYawMode(YawMode::Lock) => "yaw_mode_lock",
            Self::Mapping => "mapping",
            Self::Reset(_) => "reset",
            Self::RadioControl => "radio_control",
            Self::RequestInformation => "information",
            Self::SetStreamRate { .. } => "stream_rate",
            Self::RefreshParameters => "refresh_parameters",
            Self::SetParameter { .. } => "set_parameter",
            Self::SetAxisMotion { .. } => "axis_motion",
            Self::SetMotorControl(_) => "motor_control",
            Self::SetLimits { .. } => "limits",
            Self::SetRadioType(_) => "radio_type",
            Self::SetEncoderUnit(_) => "encoder_unit",
            Self::SetCombinedAttitude(_) => "combined_attitude",
            Self::SetHomeOnModeChange(_) => "home_on_mode_change",
        }
    }

    /// All that is asked, in words.
    pub fn describe(&self) -> String {
        let on = |is_on: bool| if is_on { "on" } else { "off" };
        match self {
            Self::Reset(mode) => format!("reset {}", mode.name()),
            Self::SetStreamRate { stream, rate } => format!("stream rate {} {rate}", stream.name()),
            Self::SetParameter { name, value } => format!("parameter {name} = {value}"),
            Self::SetAxisMotion { axis, motion } => format!("motion of {}: {motion}", axis.name()),
            Self::SetMotorControl(motors) => format!("motor control: {motors}"),
            Self::SetLimits { axis, limits } => {
                let [min, max] = [limits.min(), limits.max()].map(|limit| (limit.degrees() * 10.0).round() / 10.0);
                format!("limits of {}: {min}° to {max}°", axis.name())
            }
            Self::SetRadioType(kind) => format!("radio type {}", kind.name()),
            Self::SetEncoderUnit(EncoderUnit::Counts) => "encoder unit counts".to_owned(),
            Self::SetEncoderUnit(EncoderUnit::Angles) => "encoder unit angles".to_owned(),
            Self::SetCombinedAttitude(is_on) => format!("combined attitude {}", on(*is_on)),
            Self::SetHomeOnModeChange(is_on) => format!("home on mode change {}", on(*is_on)),
            Self::Motors(_)
            | Self::Restart(_)
            | Self::SetYawMode(_)
            | Self::Mapping
            | Self::RadioControl
            | Self::RequestInformation
            | Self::RefreshParameters => self.name().replace('_', " "),
        }
    }

    /// Whether it takes the place of where the gimbal was told to look: the setpoint, said again, would undo it.
    pub const fn ends_demand(&self) -> bool {
        matches!(
            self,
            Self::Motors(Motors::Off)
                | Self::Restart(_)
                | Self::SetYawMode(_)
                | Self::Mapping
                | Self::Reset(_)
                | Self::RadioControl
        )
    }

    /// Whether only who may steer the gimbal may do it: all that can move the camera, now or by a setting.
    pub const fn needs_control(&self) -> bool {
        !matches!(self, Self::RequestInformation | Self::SetStreamRate { .. } | Self::RefreshParameters)
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Motors {
    Off,
    On,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Restart {
    Reboot,
    Shutdown,
}

/// What yaw is kept to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum YawMode {
    /// The vehicle's nose.
    Follow,
    /// North, or where the gimbal takes it to be.
    Lock,
}

/// Where a reset turns the camera.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ResetMode {
    /// Yaw to the nose.
    Yaw,
    /// Pitch to the horizon and yaw to the nose.
    PitchAndYaw,
    /// Straight down, or up where the gimbal hangs the other way, and yaw to the nose.
    PitchDownUpAndYaw,
    /// The same and yaw as it is.
    PitchDownUp,
    /// Straight down as for a survey.
    PitchMapping,
}

impl ResetMode {
    pub const ALL: [Self; 5] =
        [Self::Yaw, Self::PitchAndYaw, Self::PitchDownUpAndYaw, Self::PitchDownUp, Self::PitchMapping];

    pub const fn name(self) -> &'static str {
        match self {
            Self::Yaw => "yaw",
            Self::PitchAndYaw => "pitch_and_yaw",
            Self::PitchDownUpAndYaw => "pitch_down_up_and_yaw",
            Self::PitchDownUp => "pitch_down_up",
            Self::PitchMapping => "pitch_mapping",
        }
    }
}

/// A message that a gimbal can stream.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Stream {
    /// `MOUNT_STATUS` (158), where it carries encoders.
    Encoders,
    /// `MOUNT_ORIENTATION` (265).
    MountOrientation,
    /// `GIMBAL_DEVICE_ATTITUDE_STATUS` (285).
    AttitudeStatus,
    /// `RAW_IMU` (27).
    RawImu,
}

impl Stream {
    pub const ALL: [Self; 4] = [Self::Encoders, Self::MountOrientation, Self::AttitudeStatus, Self::RawImu];

    pub const fn name(self) -> &'static str {
        match self {
            Self::Encoders => "encoders",
            Self::MountOrientation => "mount_orientation",
            Self::AttitudeStatus => "attitude_status",
            Self::RawImu => "raw_imu",
        }
    }
}

/// How often a message is sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StreamRate {
    Off,
    /// As often as the gimbal does by itself.
    Default,
    /// Times a second, 1 to 200.
    Hertz(u8),
}

impl fmt::Display for StreamRate {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Off => f.write_str("off"),
            Self::Default => f.write_str("default"),
            Self::Hertz(hertz) => write!(f, "{hertz} Hz"),
        }
    }
}

/// What is said of a gimbal that starts to whoever asks something of it.
pub const STARTING: &str = "the gimbal is starting; wait until it is ready, some 15 s, and ask again";

/// Why an operation was not done.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum OperationError {
    #[error("this gimbal has no such function")]
    Unsupported,
    /// The gimbal may have such a function, and its entry does not say so; with what to do.
    #[error("{0}")]
    NotConfigured(&'static str),
    #[error("{0}")]
    Invalid(String),
    #[error("the gimbal is not there")]
    NotThere,
    #[error("{}", STARTING)]
    NotReady,
    #[error("the gimbal is busy with what was asked of it before. Try again")]
    Busy,
    /// `MAV_RESULT_DENIED`.
    #[error("the gimbal denied it")]
    Denied,
    /// `MAV_RESULT_TEMPORARILY_REJECTED`.
    #[error("the gimbal rejected it for the moment")]
    Rejected,
    /// `MAV_RESULT_UNSUPPORTED`.
    #[error("the gimbal does not know the command")]
    UnsupportedByDevice,
    /// `MAV_RESULT_FAILED`, or a result that is not known.
    #[error("the gimbal failed to do it")]
    Failed,
    #[error("the gimbal did not answer")]
    NoAnswer,
    /// It may not be done to one that turns.
    #[error("the gimbal may still be turning, and is being stopped; ask again when it stands")]
    StillTurning,
    /// It was asked for parameters and has told none at all.
    #[error(
        "the gimbal tells no parameters: it has none, as many that speak v1, or does not hear that it is asked for them; check \
         the line towards it"
    )]
    NoParameters,
    /// Answered, and yet it is not so.
    #[error("the gimbal answered, but did not do it: {0}")]
    NoEffect(String),
}

/// What became of an operation.
pub type OperationResult = Result<(), OperationError>;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Angle;

    /// What was asked is told with its numbers, and only with those that were given.
    #[test]
    fn what_is_asked_is_told_whole() {
        let limits = AxisLimits::new(Angle::from_degrees(-45.0), Angle::from_degrees(30.5)).expect("in order");
        let pan = MotorAxis { stiffness: Some(40.0), hold_strength: None };
        let motion = AxisMotion { follow_speed: Some(50.0), reversed: Some(true), ..AxisMotion::default() };
        for (operation, text) in [
            (Operation::Restart(Restart::Reboot), "reboot"),
            (Operation::Reset(ResetMode::PitchAndYaw), "reset pitch_and_yaw"),
            (Operation::SetParameter { name: "PWR_PAN".to_owned(), value: 60.0 }, "parameter PWR_PAN = 60"),
            (Operation::SetAxisMotion { axis: Axis::Pan, motion }, "motion of pan: follow_speed 50, reversed true"),
            (
                Operation::SetMotorControl(MotorControl { pan, gain: Some(3.0), ..MotorControl::default() }),
                "motor control: pan_stiffness 40, gain 3",
            ),
            (Operation::SetLimits { axis: Axis::Tilt, limits }, "limits of tilt: -45° to 30.5°"),
            (Operation::SetRadioType(RadioType::Herelink), "radio type herelink"),
            (
                Operation::SetStreamRate { stream: Stream::RawImu, rate: StreamRate::Hertz(50) },
                "stream rate raw_imu 50 Hz",
            ),
            (Operation::SetCombinedAttitude(false), "combined attitude off"),
        ] {
            assert_eq!(operation.describe(), text);
        }
    }
}
