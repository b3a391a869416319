//! What the parameters are called.

use super::{Axis, Parameter};

/// The names of one time of firmware.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ParameterTable {
    /// Firmware up to 2021.
    Old,
    /// Firmware from 7.7.3 on.
    New,
}

/// One parameter of a table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Row {
    pub parameter: Parameter,
    pub name: &'static str,
    /// Its place, as the vendor's SDK has it; `None` where only the name is known.
    pub index: Option<u16>,
}

impl ParameterTable {
    /// Names that only one of the tables has, and no other make that is known: whoever answers to one is a Gremsy.
    pub const TELLING_NAMES: [&str; 2] = ["STIFF_TILT", "PITCH_P"];

    /// The table whose names these are, by the names that only one of them has; `None` for a gimbal that lists neither.
    pub fn recognised_by<'a>(names: impl IntoIterator<Item = &'a str>) -> Option<Self> {
        names.into_iter().find_map(|name| match name {
            "STIFF_TILT" => Some(Self::New),
            "PITCH_P" => Some(Self::Old),
            _ => None,
        })
    }

    pub const fn rows(self) -> &'static [Row] {
        match self {
            Self::Old => OLD,
            Self::New => NEW,
        }
    }

    /// What `parameter` is called; `None` where there is none.
    pub fn name(self, parameter: Parameter) -> Option<&'static str> {
        self.rows().iter().find(|row| row.parameter == parameter).map(|row| row.name)
    }
}

const fn row(index: u16, name: &'static str, parameter: Parameter) -> Row {
    Row { parameter, name, index: Some(index) }
}

const fn named(name: &'static str, parameter: Parameter) -> Row {
    Row { parameter, name, index: None }
}

const NEW: &[Row] = &[
    row(0, "VERSION_X", Parameter::VersionX),
    row(2, "STIFF_TILT", Parameter::Stiffness(Axis::Tilt)),
    row(4, "STIFF_ROLL", Parameter::Stiffness(Axis::Roll)),
    row(5, "STIFF_PAN", Parameter::Stiffness(Axis::Pan)),
    row(6, "FILTER_OUT", Parameter::OutputFilter),
    row(8, "PWR_TILT", Parameter::HoldStrength(Axis::Tilt)),
    row(9, "PWR_ROLL", Parameter::HoldStrength(Axis::Roll)),
    row(10, "PWR_PAN", Parameter::HoldStrength(Axis::Pan)),
    row(14, "FLW_LPF_TILT", Parameter::FollowSmoothing(Axis::Tilt)),
    row(16, "FLW_LPF_PAN", Parameter::FollowSmoothing(Axis::Pan)),
    row(21, "RC_TYPE", Parameter::RcType),
    row(22, "GYRO_LPF", Parameter::GyroFilter),
    row(23, "RC_LIM_MIN_TILT", Parameter::LimitMin(Axis::Tilt)),
    row(24, "RC_LIM_MAX_TILT", Parameter::LimitMax(Axis::Tilt)),
    row(25, "RC_LIM_MIN_ROLL", Parameter::LimitMin(Axis::Roll)),
    row(26, "RC_LIM_MAX_ROLL", Parameter::LimitMax(Axis::Roll)),
    row(27, "RC_LPF_TILT", Parameter::ControlSmoothing(Axis::Tilt)),
    row(28, "RC_LPF_ROLL", Parameter::ControlSmoothing(Axis::Roll)),
    row(29, "RC_LPF_PAN", Parameter::ControlSmoothing(Axis::Pan)),
    row(39, "FLW_WD_TILT", Parameter::FollowWindow(Axis::Tilt)),
    row(40, "FLW_WD_PAN", Parameter::FollowWindow(Axis::Pan)),
    row(41, "RC_SPD_TILT", Parameter::ControlSpeed(Axis::Tilt)),
    row(42, "RC_SPD_ROLL", Parameter::ControlSpeed(Axis::Roll)),
    row(43, "RC_SPD_PAN", Parameter::ControlSpeed(Axis::Pan)),
    row(44, "RC_REVERSE_AXIS", Parameter::AxisFlags),
    row(45, "VERSION_Y", Parameter::VersionY),
    row(46, "VERSION_Z", Parameter::VersionZ),
    row(47, "RC_LIM_MIN_PAN", Parameter::LimitMin(Axis::Pan)),
    row(48, "RC_LIM_MAX_PAN", Parameter::LimitMax(Axis::Pan)),
    row(52, "MAV_TS_ENCNT", Parameter::EncoderType),
    named("FLW_SP_TILT", Parameter::FollowSpeed(Axis::Tilt)),
    named("FLW_SP_PAN", Parameter::FollowSpeed(Axis::Pan)),
    named("ENABLE_ADRC", Parameter::AdaptiveControl),
    named("CTRL_ANGLE_MODE", Parameter::AnglePath),
    named("MT_ELEC_PWR", Parameter::MotorPower),
];

const OLD: &[Row] = &[
    row(0, "VERSION_X", Parameter::VersionX),
    row(2, "PITCH_P", Parameter::Stiffness(Axis::Tilt)),
    row(3, "PITCH_I", Parameter::Gain),
    row(5, "ROLL_P", Parameter::Stiffness(Axis::Roll)),
    row(8, "YAW_P", Parameter::Stiffness(Axis::Pan)),
    row(9, "YAW_I", Parameter::OutputFilter),
    row(11, "PITCH_POWER", Parameter::HoldStrength(Axis::Tilt)),
    row(12, "ROLL_POWER", Parameter::HoldStrength(Axis::Roll)),
    row(13, "YAW_POWER", Parameter::HoldStrength(Axis::Pan)),
    row(14, "PITCH_FOLLOW", Parameter::FollowSpeed(Axis::Tilt)),
    row(16, "YAW_FOLLOW", Parameter::FollowSpeed(Axis::Pan)),
    row(17, "PITCH_FILTER", Parameter::FollowSmoothing(Axis::Tilt)),
    row(19, "YAW_FILTER", Parameter::FollowSmoothing(Axis::Pan)),
    row(29, "GYRO_LPF", Parameter::GyroFilter),
    row(30, "TRAVEL_MIN_PIT", Parameter::LimitMin(Axis::Tilt)),
    row(31, "TRAVEL_MAX_PIT", Parameter::LimitMax(Axis::Tilt)),
    row(32, "TRAVEL_MIN_ROLL", Parameter::LimitMin(Axis::Roll)),
    row(33, "TRAVEL_MAX_ROLL", Parameter::LimitMax(Axis::Roll)),
    row(36, "RC_PITCH_LPF", Parameter::ControlSmoothing(Axis::Tilt)),
    row(37, "RC_ROLL_LPF", Parameter::ControlSmoothing(Axis::Roll)),
    row(38, "RC_YAW_LPF", Parameter::ControlSmoothing(Axis::Pan)),
    row(57, "TILT_WINDOW", Parameter::FollowWindow(Axis::Tilt)),
    row(58, "PAN_WINDOW", Parameter::FollowWindow(Axis::Pan)),
    row(60, "RC_PITCH_SPEED", Parameter::ControlSpeed(Axis::Tilt)),
    row(61, "RC_ROLL_SPEED", Parameter::ControlSpeed(Axis::Roll)),
    row(62, "RC_YAW_SPEED", Parameter::ControlSpeed(Axis::Pan)),
    row(63, "JOY_AXIS", Parameter::AxisFlags),
    row(67, "VERSION_Y", Parameter::VersionY),
    row(68, "VERSION_Z", Parameter::VersionZ),
    row(69, "TRAVEL_MIN_PAN", Parameter::LimitMin(Axis::Pan)),
    row(70, "TRAVEL_MAX_PAN", Parameter::LimitMax(Axis::Pan)),
    row(72, "HEARTBEAT_EMIT", Parameter::HeartbeatEmit),
    row(73, "STATUS_RATE", Parameter::StatusRate),
    row(74, "ENC_CNT_RATE", Parameter::EncoderRate),
    row(75, "ENC_TYPE_SEND", Parameter::EncoderType),
    row(76, "ORIEN_RATE", Parameter::OrientationRate),
    row(77, "IMU_RATE", Parameter::ImuRate),
];

#[cfg(test)]
mod tests {
    use super::*;

    /// Gimbal statement 17: "Table family is recognised from STIFF_TILT vs PITCH_P names alone."
    #[test]
    fn statement_17_the_table_is_recognised_by_two_names() {
        for (names, expected) in [
            (vec!["VERSION_X", "STIFF_TILT"], Some(ParameterTable::New)),
            (vec!["VERSION_X", "PITCH_P"], Some(ParameterTable::Old)),
            (vec!["VERSION_X", "GYRO_LPF", "VERSION_Y", "VERSION_Z"], None),
            (vec![], None),
        ] {
            assert_eq!(ParameterTable::recognised_by(names), expected);
        }
        for table in [ParameterTable::Old, ParameterTable::New] {
            let all = table.rows().iter().map(|row| row.name);
            assert_eq!(ParameterTable::recognised_by(all), Some(table));
        }
    }

    /// `param_id` has 16 bytes, and each name and purpose and place comes once.
    #[test]
    fn rows_are_unique_and_fit() {
        for table in [ParameterTable::Old, ParameterTable::New] {
            for (index, row) in table.rows().iter().enumerate() {
                assert!(row.name.len() <= 16, "{row:?}");
                for other in &table.rows()[index + 1..] {
                    assert!(row.name != other.name && row.parameter != other.parameter, "{row:?} {other:?}");
                    assert!(row.index.is_none() || row.index != other.index, "{row:?} {other:?}");
                }
                assert_eq!(table.name(row.parameter), Some(row.name));
            }
        }
        assert_eq!(ParameterTable::New.name(Parameter::Gain), None);
        assert_eq!(ParameterTable::Old.name(Parameter::RcType), None);
    }
}
