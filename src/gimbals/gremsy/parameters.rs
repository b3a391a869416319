//! The parameters of a Gremsy: what each is for, and what it is called.
//!
//! There are two tables of names, one of the firmware up to 2021 and one of the firmware since (7.7.3). Which one a
//! gimbal has is told by the names that it lists. All values are int16, sent as numbers in the float field
//! (`PARAM_SET` with `param_type` INT16), and matched by name: indices are sparse and differ.

mod axis_motion;
mod codes;
mod limits;
mod motor_control;
mod tables;

use std::fmt;
use std::ops::RangeInclusive;

pub use crate::gimbals::operation::Axis;
pub use axis_motion::AxisMotion;
pub use codes::{AxisFlags, EncoderType, RcType};
pub use limits::{AngleLimits, TiltSense};
pub use motor_control::MotorControl;
pub use tables::{ParameterTable, Row};

/// What a parameter is for, the same in both tables.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Parameter {
    VersionX,
    VersionY,
    VersionZ,
    /// How hard the axis corrects movement.
    Stiffness(Axis),
    /// Power of the axis' motor.
    HoldStrength(Axis),
    /// How fast an axis returns; one for all of them, in the old table only.
    Gain,
    OutputFilter,
    GyroFilter,
    FollowSpeed(Axis),
    FollowSmoothing(Axis),
    /// How far the vehicle turns before the axis follows, degrees.
    FollowWindow(Axis),
    /// The fastest that the axis turns when it is steered, degrees per second.
    ControlSpeed(Axis),
    ControlSmoothing(Axis),
    /// The smaller and the larger number of the software limit as the gimbal stores them, degrees ([`AngleLimits`]).
    LimitMin(Axis),
    LimitMax(Axis),
    /// Which axes are reversed, and two switches that found room there ([`AxisFlags`]).
    AxisFlags,
    /// Where control comes from ([`RcType`]).
    RcType,
    /// What `MOUNT_STATUS` carries ([`EncoderType`]).
    EncoderType,
    AdaptiveControl,
    /// 0 the shortest way to an angle, 1 the direct one.
    AnglePath,
    /// Electrical power of the motors, percent.
    MotorPower,
    /// Whether the gimbal sends HEARTBEAT.
    HeartbeatEmit,
    /// Rates of the old table, hertz.
    StatusRate,
    EncoderRate,
    OrientationRate,
    ImuRate,
}

impl Parameter {
    /// The values that are taken; narrower limits of single models are the gimbal's to enforce.
    ///
    /// The vendor's SDK carries settings as one byte and limits as whole degrees. How far limits may go is not
    /// published; the widest sample is ±320° of pan.
    pub const fn range(self) -> RangeInclusive<i16> {
        match self {
            Self::VersionX | Self::VersionY | Self::VersionZ => 0..=255,
            Self::LimitMin(Axis::Pan) | Self::LimitMax(Axis::Pan) => -360..=360,
            Self::LimitMin(_) | Self::LimitMax(_) => -180..=180,
            Self::EncoderType | Self::AdaptiveControl | Self::AnglePath | Self::HeartbeatEmit => 0..=1,
            Self::MotorPower => 50..=100,
            Self::StatusRate | Self::EncoderRate | Self::OrientationRate | Self::ImuRate => 0..=200,
            Self::RcType => 0..=31,
            Self::AxisFlags
            | Self::Stiffness(_)
            | Self::HoldStrength(_)
            | Self::Gain
            | Self::OutputFilter
            | Self::GyroFilter
            | Self::FollowSpeed(_)
            | Self::FollowSmoothing(_)
            | Self::FollowWindow(_)
            | Self::ControlSpeed(_)
            | Self::ControlSmoothing(_) => 0..=255,
        }
    }
}

impl fmt::Display for Parameter {
    /// As in `follow speed of the pan axis`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (what, axis) = match self {
            Self::VersionX => ("first number of the version", None),
            Self::VersionY => ("second number of the version", None),
            Self::VersionZ => ("third number of the version", None),
            Self::Stiffness(axis) => ("stiffness", Some(axis)),
            Self::HoldStrength(axis) => ("hold strength", Some(axis)),
            Self::Gain => ("gain", None),
            Self::OutputFilter => ("output filter", None),
            Self::GyroFilter => ("gyro filter", None),
            Self::FollowSpeed(axis) => ("follow speed", Some(axis)),
            Self::FollowSmoothing(axis) => ("follow smoothing", Some(axis)),
            Self::FollowWindow(axis) => ("follow window", Some(axis)),
            Self::ControlSpeed(axis) => ("control speed", Some(axis)),
            Self::ControlSmoothing(axis) => ("control smoothing", Some(axis)),
            Self::LimitMin(axis) => ("smaller limit", Some(axis)),
            Self::LimitMax(axis) => ("larger limit", Some(axis)),
            Self::AxisFlags => ("axis flags", None),
            Self::RcType => ("RC type", None),
            Self::EncoderType => ("encoder type", None),
            Self::AdaptiveControl => ("adaptive control", None),
            Self::AnglePath => ("angle path", None),
            Self::MotorPower => ("motor power", None),
            Self::HeartbeatEmit => ("emission of heartbeats", None),
            Self::StatusRate => ("rate of the status", None),
            Self::EncoderRate => ("rate of the encoders", None),
            Self::OrientationRate => ("rate of the orientation", None),
            Self::ImuRate => ("rate of the IMU", None),
        };
        f.write_str(what)?;
        axis.map_or(Ok(()), |axis| write!(f, " of the {} axis", axis.name()))
    }
}

/// One parameter to set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ParameterWrite {
    pub name: &'static str,
    pub value: i16,
}

/// Why a setting cannot be made.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ParameterError {
    #[error("gimbals with this firmware have no {0}")]
    Missing(Parameter),
    #[error("the {parameter} is to be from {} to {}, not {value}", .parameter.range().start(), .parameter.range().end())]
    OutOfRange { parameter: Parameter, value: i32 },
    #[error("{field} of the {} axis is to be from {} to {}, not {value}", .axis.name(), Parameter::LimitMin(*.axis).range().start(), Parameter::LimitMin(*.axis).range().end())]
    Limit { axis: Axis, field: &'static str, value: i16 },
    #[error("{0} shares a parameter with other settings, and that has not been read yet")]
    Unread(Parameter),
    #[error("the smaller limit ({min}) is above the larger ({max})")]
    Crossed { min: i16, max: i16 },
}

/// `value` for `parameter` under its name in `table`.
pub fn write(table: ParameterTable, parameter: Parameter, value: i16) -> Result<ParameterWrite, ParameterError> {
    let name = table.name(parameter).ok_or(ParameterError::Missing(parameter))?;
    if !parameter.range().contains(&value) {
        return Err(ParameterError::OutOfRange { parameter, value: i32::from(value) });
    }
    Ok(ParameterWrite { name, value })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_cannot_be_set_is_named() {
        let error = |table, parameter, value| write(table, parameter, value).expect_err("an error").to_string();

        assert_eq!(error(ParameterTable::Old, Parameter::RcType, 7), "gimbals with this firmware have no RC type");
        assert_eq!(
            error(ParameterTable::New, Parameter::ControlSpeed(Axis::Pan), 256),
            "the control speed of the pan axis is to be from 0 to 255, not 256"
        );
    }
}
