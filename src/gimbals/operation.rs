//! What can be asked of a gimbal by its name, beyond where it looks: motors, modes of its own, settings, streams.
//!
//! Where it looks is a demand, which every family understands ([`Setpoint`](super::setpoint::Setpoint)). An operation is
//! for the families that have the like; the others answer [`OperationError::Unsupported`].

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

/// How often a message is sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StreamRate {
    Off,
    /// As often as the gimbal does by itself.
    Default,
    /// Times a second, 1 to 200.
    Hertz(u8),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Axis {
    /// Pitch.
    Tilt,
    Roll,
    /// Yaw.
    Pan,
}

/// How one axis moves; what is `None` stays as it is.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AxisMotion {
    /// How fast it follows the vehicle; the gimbal's own scale.
    pub follow_speed: Option<f64>,
    /// How smoothly it follows the vehicle; the gimbal's own scale.
    pub follow_smoothing: Option<f64>,
    /// How far the vehicle may turn before it follows, degrees.
    pub follow_window_deg: Option<f64>,
    /// The highest speed under control, degrees per second.
    pub control_speed_dps: Option<f64>,
    /// How smoothly it starts and stops under control; the gimbal's own scale.
    pub control_smoothing: Option<f64>,
    /// Turns the other way under radio control.
    pub reversed: Option<bool>,
}

/// How the motors hold the camera; the gimbal's own scales. What is `None` stays as it is.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MotorControl {
    pub tilt: MotorAxis,
    pub roll: MotorAxis,
    pub pan: MotorAxis,
    pub gyro_filter: Option<f64>,
    pub output_filter: Option<f64>,
    /// Only older gimbals have it.
    pub gain: Option<f64>,
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MotorAxis {
    pub stiffness: Option<f64>,
    pub hold_strength: Option<f64>,
}

/// The kind of radio receiver that the gimbal listens to; [`Sync`](Self::Sync) is control by MAVLink.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RadioType {
    SbusFasst,
    Joystick,
    Jr11Bit,
    Jr10Bit,
    Ppm,
    Sync,
    Lb2Single,
    Lb2Normal,
    Sync2,
    SbusSfhss,
    Herelink,
}

/// What `MOUNT_STATUS` carries.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EncoderUnit {
    /// 65536 to the turn.
    Counts,
    Angles,
}

/// Why an operation was not done.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum OperationError {
    #[error("this gimbal has no such function")]
    Unsupported,
    #[error("{0}")]
    Invalid(String),
    #[error("the gimbal is not there")]
    NotThere,
    #[error("the gimbal is still starting")]
    NotReady,
    #[error("the same is being done already")]
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
    /// Answered, and yet it is not so.
    #[error("the gimbal answered, but did not do it: {0}")]
    NoEffect(String),
    #[error("the configuration does not allow it: {0}")]
    NotAllowed(&'static str),
}

/// What became of an operation.
pub type OperationResult = Result<(), OperationError>;
