//! Which parameters an operation sets.

use crate::geometry::{Angle, AxisLimits};
use crate::gimbals::gremsy::parameters::{
    self, AngleLimits, AxisFlags, EncoderType, MotorControl, Parameter, ParameterError, ParameterTable, ParameterWrite,
    RcType, TiltSense,
};
use crate::gimbals::operation::{self, EncoderUnit, Operation, OperationError};

/// The parameters that `operation` sets, in `table`; `None` for an operation that is no setting. `value` gives what is
/// known of the parameter with a name.
pub fn writes(
    operation: &Operation,
    table: ParameterTable,
    value: impl Fn(&str) -> Option<i16>,
) -> Option<Result<Vec<ParameterWrite>, OperationError>> {
    let flag = |flag: AxisFlags, on| flag.switched(table, on, &value).map(|write| vec![write]).map_err(refused);
    Some(match operation {
        Operation::SetAxisMotion { axis, motion } => axis_motion(motion).and_then(|motion| {
            let writes = motion.writes(table, *axis, &value).map_err(refused)?;
            not_empty(writes)
        }),
        Operation::SetMotorControl(control) => {
            motor_control(control).and_then(|control| not_empty(control.writes(table).map_err(refused)?))
        }
        Operation::SetLimits { axis, limits } => angle_limits(*limits).and_then(|limits| {
            let writes = limits.writes(table, TiltSense::of(table), *axis).map_err(refused)?;
            Ok(writes.to_vec())
        }),
        Operation::SetRadioType(kind) => one(table, Parameter::RcType, RcType::Named(*kind).code()),
        Operation::SetEncoderUnit(unit) => {
            let kind = match unit {
                EncoderUnit::Counts => EncoderType::Counts,
                EncoderUnit::Angles => EncoderType::Angle,
            };
            one(table, Parameter::EncoderType, kind.value())
        }
        Operation::SetCombinedAttitude(on) => flag(AxisFlags::COMBINE_ATTITUDE, *on),
        Operation::SetHomeOnModeChange(on) => flag(AxisFlags::HOME_ON_MODE_CHANGE, *on),
        _ => return None,
    })
}

fn one(table: ParameterTable, parameter: Parameter, value: i16) -> Result<Vec<ParameterWrite>, OperationError> {
    parameters::write(table, parameter, value).map(|write| vec![write]).map_err(refused)
}

fn not_empty(writes: Vec<ParameterWrite>) -> Result<Vec<ParameterWrite>, OperationError> {
    if writes.is_empty() { Err(OperationError::Invalid("nothing is to be set".to_owned())) } else { Ok(writes) }
}

fn refused(error: ParameterError) -> OperationError {
    match error {
        ParameterError::Unread(_) => OperationError::NotReady,
        ParameterError::Missing(_)
        | ParameterError::OutOfRange { .. }
        | ParameterError::Limit { .. }
        | ParameterError::Crossed { .. } => OperationError::Invalid(error.to_string()),
    }
}

fn whole(what: &str, value: Option<f64>) -> Result<Option<i16>, OperationError> {
    let Some(value) = value else { return Ok(None) };
    let in_range = (f64::from(i16::MIN)..=f64::from(i16::MAX)).contains(&value);
    if in_range && value.fract() == 0.0 {
        Ok(Some(value as i16))
    } else {
        Err(OperationError::Invalid(format!("the {what} is to be a whole number, not {value}")))
    }
}

fn axis_motion(motion: &operation::AxisMotion) -> Result<parameters::AxisMotion, OperationError> {
    Ok(parameters::AxisMotion {
        is_reversed: motion.reversed,
        control_speed: whole("control speed", motion.control_speed_dps)?,
        control_smoothing: whole("control smoothing", motion.control_smoothing)?,
        follow_speed: whole("follow speed", motion.follow_speed)?,
        follow_smoothing: whole("follow smoothing", motion.follow_smoothing)?,
        follow_window: whole("follow window", motion.follow_window_deg)?,
    })
}

fn motor_control(control: &operation::MotorControl) -> Result<MotorControl, OperationError> {
    let axes = [control.tilt, control.roll, control.pan];
    let each = |what, value: fn(&operation::MotorAxis) -> Option<f64>| {
        let mut numbers = [None; 3];
        for (number, axis) in numbers.iter_mut().zip(&axes) {
            *number = whole(what, value(axis))?;
        }
        Ok::<_, OperationError>(numbers)
    };
    Ok(MotorControl {
        stiffness: each("stiffness", |axis| axis.stiffness)?,
        hold_strength: each("hold strength", |axis| axis.hold_strength)?,
        gyro_filter: whole("gyro filter", control.gyro_filter)?,
        output_filter: whole("output filter", control.output_filter)?,
        gain: whole("gain", control.gain)?,
    })
}

fn angle_limits(limits: AxisLimits) -> Result<AngleLimits, OperationError> {
    // Degrees that went through radians come back a little beside themselves.
    let degrees = |angle: Angle| {
        let rounded = angle.degrees().round();
        if (angle.degrees() - rounded).abs() > 1e-6 || rounded.abs() > f64::from(i16::MAX) {
            return Err(OperationError::Invalid(format!("limits are whole degrees, not {}", angle.degrees())));
        }
        Ok(rounded as i16)
    };
    Ok(AngleLimits { min_deg: degrees(limits.min())?, max_deg: degrees(limits.max())? })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gimbals::operation::{AxisMotion, MotorAxis, RadioType};

    fn pairs(operation: &Operation, table: ParameterTable) -> Result<Vec<(&'static str, i16)>, String> {
        let value = |name: &str| (name == "RC_REVERSE_AXIS" || name == "JOY_AXIS").then_some(0x08);
        let writes = writes(operation, table, value).expect("a setting");
        writes
            .map(|writes| writes.into_iter().map(|write| (write.name, write.value)).collect())
            .map_err(|error| error.to_string())
    }

    fn limits(min: f64, max: f64) -> Operation {
        let degrees = Angle::from_degrees;
        let limits = AxisLimits::new(degrees(min), degrees(max)).expect("in order");
        Operation::SetLimits { axis: operation::Axis::Tilt, limits }
    }

    /// Gimbal statement 15: "Setting pitch limits −90…+45 results in RC_LIM_MIN_TILT = −45 and RC_LIM_MAX_TILT = 90". 16:
    /// "The same limits on an old-table gimbal use TRAVEL_MIN_PIT/TRAVEL_MAX_PIT un-negated".
    #[test]
    fn statements_15_and_16_pitch_limits_by_the_table() {
        let new = pairs(&limits(-90.0, 45.0), ParameterTable::New);
        assert_eq!(new, Ok(vec![("RC_LIM_MIN_TILT", -45), ("RC_LIM_MAX_TILT", 90)]));
        let old = pairs(&limits(-90.0, 45.0), ParameterTable::Old);
        assert_eq!(old, Ok(vec![("TRAVEL_MIN_PIT", -90), ("TRAVEL_MAX_PIT", 45)]));
    }

    #[test]
    fn each_setting_is_written_under_its_name() {
        let motor = MotorAxis { stiffness: Some(20.0), hold_strength: None };
        let control =
            operation::MotorControl { pan: motor, gyro_filter: Some(4.0), ..operation::MotorControl::default() };
        let motion = AxisMotion { reversed: Some(true), control_speed_dps: Some(45.0), ..AxisMotion::default() };
        let motion = Operation::SetAxisMotion { axis: operation::Axis::Pan, motion };
        for (operation, expected) in [
            (Operation::SetMotorControl(control), vec![("STIFF_PAN", 20), ("GYRO_LPF", 4)]),
            (motion, vec![("RC_SPD_PAN", 45), ("RC_REVERSE_AXIS", 0x0a)]),
            (Operation::SetRadioType(RadioType::Sync), vec![("RC_TYPE", 7)]),
            (Operation::SetEncoderUnit(EncoderUnit::Angles), vec![("MAV_TS_ENCNT", 0)]),
            (Operation::SetCombinedAttitude(true), vec![("RC_REVERSE_AXIS", 0x18)]),
            (Operation::SetHomeOnModeChange(false), vec![("RC_REVERSE_AXIS", 0x00)]),
        ] {
            assert_eq!(pairs(&operation, ParameterTable::New), Ok(expected), "{operation:?}");
        }
    }

    #[test]
    fn what_cannot_be_set_says_why() {
        let half = AxisMotion { control_speed_dps: Some(0.5), ..AxisMotion::default() };
        let refused =
            |motion| pairs(&Operation::SetAxisMotion { axis: operation::Axis::Roll, motion }, ParameterTable::New);
        assert_eq!(refused(half), Err("the control speed is to be a whole number, not 0.5".to_owned()));
        assert_eq!(refused(AxisMotion::default()), Err("nothing is to be set".to_owned()));
        assert_eq!(
            pairs(&Operation::SetRadioType(RadioType::Sync), ParameterTable::Old),
            Err("gimbals with this firmware have no RC type".to_owned())
        );
        assert_eq!(
            pairs(&limits(-90.5, 45.0), ParameterTable::New),
            Err("limits are whole degrees, not -90.5".to_owned())
        );
        assert_eq!(writes(&Operation::RefreshParameters, ParameterTable::New, |_| None), None);
    }
}
