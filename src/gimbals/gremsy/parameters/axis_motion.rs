//! How an axis moves: the vendor's `gimbal_config_axis_t`.

use super::{Axis, AxisFlags, Parameter, ParameterError, ParameterTable, ParameterWrite, write};

/// Settings of one axis; `None` is left as it is when they are made, and not known or not there when they are read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct AxisMotion {
    /// The axis turns the other way when it is steered.
    pub is_reversed: Option<bool>,
    /// Degrees per second.
    pub control_speed: Option<i16>,
    pub control_smoothing: Option<i16>,
    pub follow_speed: Option<i16>,
    pub follow_smoothing: Option<i16>,
    /// Degrees.
    pub follow_window: Option<i16>,
}

impl AxisMotion {
    /// `value` gives what is known of the parameter with this name.
    pub fn read(table: ParameterTable, axis: Axis, value: impl Fn(&str) -> Option<i16>) -> Self {
        let read = |parameter| table.name(parameter).and_then(&value);
        let flags = read(Parameter::AxisFlags).map(AxisFlags::from_bits_retain);
        Self {
            is_reversed: flags.map(|flags| flags.contains(AxisFlags::reverse(axis))),
            control_speed: read(Parameter::ControlSpeed(axis)),
            control_smoothing: read(Parameter::ControlSmoothing(axis)),
            follow_speed: read(Parameter::FollowSpeed(axis)),
            follow_smoothing: read(Parameter::FollowSmoothing(axis)),
            follow_window: read(Parameter::FollowWindow(axis)),
        }
    }

    /// What to set. The direction is a bit among others, so those have to be known.
    pub fn writes(
        self,
        table: ParameterTable,
        axis: Axis,
        value: impl Fn(&str) -> Option<i16>,
    ) -> Result<Vec<ParameterWrite>, ParameterError> {
        let numbers = [
            (Parameter::ControlSpeed(axis), self.control_speed),
            (Parameter::ControlSmoothing(axis), self.control_smoothing),
            (Parameter::FollowSpeed(axis), self.follow_speed),
            (Parameter::FollowSmoothing(axis), self.follow_smoothing),
            (Parameter::FollowWindow(axis), self.follow_window),
        ];
        let numbers = numbers.into_iter().filter_map(|(parameter, number)| Some((parameter, number?)));
        let mut writes = numbers
            .map(|(parameter, number)| write(table, parameter, number))
            .collect::<Result<Vec<ParameterWrite>, ParameterError>>()?;
        if let Some(is_reversed) = self.is_reversed {
            writes.push(switch(table, AxisFlags::reverse(axis), is_reversed, value)?);
        }
        Ok(writes)
    }
}

/// Turns one of the flags on or off and leaves the others as they are.
pub(super) fn switch(
    table: ParameterTable,
    flag: AxisFlags,
    is_on: bool,
    value: impl Fn(&str) -> Option<i16>,
) -> Result<ParameterWrite, ParameterError> {
    let parameter = Parameter::AxisFlags;
    let name = table.name(parameter).ok_or(ParameterError::Missing(parameter))?;
    let mut flags = AxisFlags::from_bits_retain(value(name).ok_or(ParameterError::Unread(parameter))?);
    flags.set(flag, is_on);
    write(table, parameter, flags.bits())
}

impl AxisFlags {
    /// The parameter that turns these flags on or off and leaves the others as they are; `value` gives what is known of
    /// the parameter with this name.
    pub fn switched(
        self,
        table: ParameterTable,
        is_on: bool,
        value: impl Fn(&str) -> Option<i16>,
    ) -> Result<ParameterWrite, ParameterError> {
        switch(table, self, is_on, value)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(name: &str) -> Option<i16> {
        match name {
            "RC_REVERSE_AXIS" | "JOY_AXIS" => Some(24),
            "RC_SPD_PAN" | "RC_YAW_SPEED" => Some(30),
            "RC_LPF_PAN" | "RC_YAW_LPF" => Some(80),
            "FLW_SP_PAN" | "YAW_FOLLOW" => Some(60),
            "FLW_LPF_PAN" | "YAW_FILTER" => Some(20),
            "FLW_WD_PAN" | "PAN_WINDOW" => Some(5),
            _ => None,
        }
    }

    fn pairs(writes: &[ParameterWrite]) -> Vec<(&str, i16)> {
        writes.iter().map(|write| (write.name, write.value)).collect()
    }

    /// `set/get_gimbal_config_tilt/roll/pan_axis` → `PARAM_SET` / cached `PARAM_VALUE` (gimbals 1.5).
    #[test]
    #[rustfmt::skip]
    fn an_axis_is_set_under_the_names_of_its_table() {
        let motion = AxisMotion {
            is_reversed: Some(true),
            control_speed: Some(45),
            control_smoothing: Some(70),
            follow_speed: Some(50),
            follow_smoothing: Some(30),
            follow_window: Some(8),
        };
        for (table, expected) in [
            (ParameterTable::New, [("RC_SPD_PAN", 45), ("RC_LPF_PAN", 70), ("FLW_SP_PAN", 50), ("FLW_LPF_PAN", 30), ("FLW_WD_PAN", 8), ("RC_REVERSE_AXIS", 26)]),
            (ParameterTable::Old, [("RC_YAW_SPEED", 45), ("RC_YAW_LPF", 70), ("YAW_FOLLOW", 50), ("YAW_FILTER", 30), ("PAN_WINDOW", 8), ("JOY_AXIS", 26)]),
        ] {
            let writes = motion.writes(table, Axis::Pan, sample).expect("all there");
            assert_eq!(pairs(&writes), expected);

            let set = |name: &str| writes.iter().find(|write| write.name == name).map(|write| write.value);
            assert_eq!(AxisMotion::read(table, Axis::Pan, set), motion);
        }
    }

    #[test]
    fn what_is_left_out_is_not_set() {
        let speed = AxisMotion { control_speed: Some(45), ..AxisMotion::default() };
        let writes = speed.writes(ParameterTable::New, Axis::Roll, |_| None).expect("it is there");
        assert_eq!(pairs(&writes), [("RC_SPD_ROLL", 45)]);
        assert_eq!(AxisMotion::default().writes(ParameterTable::New, Axis::Roll, |_| None), Ok(Vec::new()));
    }

    #[test]
    fn roll_does_not_follow_and_a_direction_needs_to_know_the_others() {
        let window = AxisMotion { follow_window: Some(8), ..AxisMotion::default() };
        let missing = ParameterError::Missing(Parameter::FollowWindow(Axis::Roll));
        assert_eq!(window.writes(ParameterTable::New, Axis::Roll, sample), Err(missing));

        let reversed = AxisMotion { is_reversed: Some(true), ..AxisMotion::default() };
        let unread = ParameterError::Unread(Parameter::AxisFlags);
        assert_eq!(reversed.writes(ParameterTable::New, Axis::Roll, |_| None), Err(unread));
    }

    /// "PARAM RC_REVERSE_AXIS bit 0x10" combines attitudes, "bit 0x08" returns home when the mode changes.
    #[test]
    fn switches_leave_the_other_bits_alone() {
        for (flag, is_on, expected) in [
            (AxisFlags::COMBINE_ATTITUDE, false, 8),
            (AxisFlags::COMBINE_ATTITUDE, true, 24),
            (AxisFlags::HOME_ON_MODE_CHANGE, false, 16),
        ] {
            let write = flag.switched(ParameterTable::New, is_on, sample);
            assert_eq!(write, Ok(ParameterWrite { name: "RC_REVERSE_AXIS", value: expected }));
        }
    }
}
