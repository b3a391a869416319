//! How hard the axes hold: the vendor's `gimbal_motor_control_t` with the filters.

use super::{Axis, Parameter, ParameterError, ParameterTable, ParameterWrite, write};

/// Settings of the motors; `None` is left as it is when they are made, and not known or not there when they are read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MotorControl {
    /// Of tilt, roll and pan.
    pub stiffness: [Option<i16>; 3],
    /// Of tilt, roll and pan.
    pub hold_strength: [Option<i16>; 3],
    pub gyro_filter: Option<i16>,
    pub output_filter: Option<i16>,
    /// Only firmware with the old table has it.
    pub gain: Option<i16>,
}

impl MotorControl {
    /// `value` gives what is known of the parameter with this name.
    pub fn read(table: ParameterTable, value: impl Fn(&str) -> Option<i16>) -> Self {
        let read = |parameter| table.name(parameter).and_then(&value);
        Self {
            stiffness: Axis::ALL.map(|axis| read(Parameter::Stiffness(axis))),
            hold_strength: Axis::ALL.map(|axis| read(Parameter::HoldStrength(axis))),
            gyro_filter: read(Parameter::GyroFilter),
            output_filter: read(Parameter::OutputFilter),
            gain: read(Parameter::Gain),
        }
    }

    pub fn writes(self, table: ParameterTable) -> Result<Vec<ParameterWrite>, ParameterError> {
        let each = |parameter: fn(Axis) -> Parameter, values: [Option<i16>; 3]| {
            Axis::ALL.into_iter().map(parameter).zip(values)
        };
        each(Parameter::Stiffness, self.stiffness)
            .chain(each(Parameter::HoldStrength, self.hold_strength))
            .chain([
                (Parameter::GyroFilter, self.gyro_filter),
                (Parameter::OutputFilter, self.output_filter),
                (Parameter::Gain, self.gain),
            ])
            .filter_map(|(parameter, number)| Some((parameter, number?)))
            .map(|(parameter, number)| write(table, parameter, number))
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `set/get_gimbal_motor_control` → `PARAM`, "`gain` argument ignored on new firmware" (gimbals 1.5): here it is
    /// refused there, so that nobody believes it was set.
    #[test]
    #[rustfmt::skip]
    fn motors_are_set_under_the_names_of_the_table() {
        let motors = MotorControl {
            stiffness: [Some(20), Some(70), Some(60)],
            hold_strength: [Some(40), None, Some(41)],
            gyro_filter: Some(2),
            output_filter: Some(3),
            gain: None,
        };
        for (table, expected) in [
            (ParameterTable::New, [("STIFF_TILT", 20), ("STIFF_ROLL", 70), ("STIFF_PAN", 60), ("PWR_TILT", 40), ("PWR_PAN", 41), ("GYRO_LPF", 2), ("FILTER_OUT", 3)]),
            (ParameterTable::Old, [("PITCH_P", 20), ("ROLL_P", 70), ("YAW_P", 60), ("PITCH_POWER", 40), ("YAW_POWER", 41), ("GYRO_LPF", 2), ("YAW_I", 3)]),
        ] {
            let writes = motors.writes(table).expect("all there");
            assert_eq!(writes.iter().map(|write| (write.name, write.value)).collect::<Vec<_>>(), expected);

            let set = |name: &str| writes.iter().find(|write| write.name == name).map(|write| write.value);
            assert_eq!(MotorControl::read(table, set), motors);
        }
        let gain = MotorControl { gain: Some(120), ..MotorControl::default() };
        assert_eq!(gain.writes(ParameterTable::Old), Ok(vec![ParameterWrite { name: "PITCH_I", value: 120 }]));
        assert_eq!(gain.writes(ParameterTable::New), Err(ParameterError::Missing(Parameter::Gain)));
    }
}
