//! How far an axis may go: the vendor's software limits.

use super::{Axis, Parameter, ParameterError, ParameterTable, ParameterWrite, write};

/// Software limits of one axis, whole degrees; up and right are positive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AngleLimits {
    pub min_deg: i16,
    pub max_deg: i16,
}

/// How a gimbal counts the tilt in its limits.
///
/// The vendor's SDK negates and swaps them since October 2024, and did not before; the firmware did not change, so what
/// an old SDK wrote reads mirrored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TiltSense {
    /// Down is positive: limits are negated and swap places.
    DownPositive,
    /// As everywhere else.
    UpPositive,
}

impl TiltSense {
    /// What a gimbal with this table is taken for unless it is known otherwise.
    pub const fn of(table: ParameterTable) -> Self {
        match table {
            ParameterTable::Old => Self::UpPositive,
            ParameterTable::New => Self::DownPositive,
        }
    }
}

impl AngleLimits {
    /// `value` gives what is known of the parameter with this name; `None` unless both limits are.
    pub fn read(
        table: ParameterTable,
        tilt: TiltSense,
        axis: Axis,
        value: impl Fn(&str) -> Option<i16>,
    ) -> Option<Self> {
        let read = |parameter| table.name(parameter).and_then(&value);
        let stored = Self { min_deg: read(Parameter::LimitMin(axis))?, max_deg: read(Parameter::LimitMax(axis))? };
        Some(stored.turned(axis, tilt))
    }

    /// What to set, the smaller number first.
    pub fn writes(
        self,
        table: ParameterTable,
        tilt: TiltSense,
        axis: Axis,
    ) -> Result<[ParameterWrite; 2], ParameterError> {
        let Self { min_deg: min, max_deg: max } = self;
        if min > max {
            return Err(ParameterError::Crossed { min, max });
        }
        // Named as it was given, not as the gimbal counts it.
        let range = Parameter::LimitMin(axis).range();
        if let Some((field, value)) =
            [("min_deg", min), ("max_deg", max)].into_iter().find(|(_, value)| !range.contains(value))
        {
            return Err(ParameterError::Limit { axis, field, value });
        }
        let stored = self.turned(axis, tilt);
        Ok([
            write(table, Parameter::LimitMin(axis), stored.min_deg)?,
            write(table, Parameter::LimitMax(axis), stored.max_deg)?,
        ])
    }

    /// From the way the gimbal stores them to ours, or back.
    const fn turned(self, axis: Axis, tilt: TiltSense) -> Self {
        match (axis, tilt) {
            (Axis::Tilt, TiltSense::DownPositive) => {
                Self { min_deg: self.max_deg.saturating_neg(), max_deg: self.min_deg.saturating_neg() }
            }
            _ => self,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn round_trip(
        table: ParameterTable,
        tilt: TiltSense,
        axis: Axis,
        min_deg: i16,
        max_deg: i16,
    ) -> [(&'static str, i16); 2] {
        let limits = AngleLimits { min_deg, max_deg };
        let writes = limits.writes(table, tilt, axis).expect("in range");
        let stored = |name: &str| writes.iter().find(|write| write.name == name).map(|write| write.value);
        assert_eq!(AngleLimits::read(table, tilt, axis, stored), Some(limits));
        writes.map(|write| (write.name, write.value))
    }

    /// Gimbal statement 15: "Setting pitch limits −90…+45 results in RC_LIM_MIN_TILT = −45 and RC_LIM_MAX_TILT = 90;
    /// reading back gives −90…+45."
    #[test]
    fn statement_15_pitch_limits_are_negated_and_swapped() {
        let new = ParameterTable::New;
        assert_eq!(
            round_trip(new, TiltSense::of(new), Axis::Tilt, -90, 45),
            [("RC_LIM_MIN_TILT", -45), ("RC_LIM_MAX_TILT", 90)]
        );
        assert_eq!(
            round_trip(new, TiltSense::of(new), Axis::Pan, -320, 300),
            [("RC_LIM_MIN_PAN", -320), ("RC_LIM_MAX_PAN", 300)]
        );
        assert_eq!(
            round_trip(new, TiltSense::of(new), Axis::Roll, -30, 40),
            [("RC_LIM_MIN_ROLL", -30), ("RC_LIM_MAX_ROLL", 40)]
        );
    }

    /// Gimbal statement 16: "The same limits on an old-table gimbal use TRAVEL_MIN_PIT/TRAVEL_MAX_PIT un-negated
    /// (profile-dependent) and round-trip."
    #[test]
    fn statement_16_pitch_limits_of_the_old_table_are_as_they_are() {
        let old = ParameterTable::Old;
        assert_eq!(
            round_trip(old, TiltSense::of(old), Axis::Tilt, -90, 45),
            [("TRAVEL_MIN_PIT", -90), ("TRAVEL_MAX_PIT", 45)]
        );
        assert_eq!(
            round_trip(old, TiltSense::DownPositive, Axis::Tilt, -90, 45),
            [("TRAVEL_MIN_PIT", -45), ("TRAVEL_MAX_PIT", 90)]
        );
        assert_eq!(
            round_trip(ParameterTable::New, TiltSense::UpPositive, Axis::Tilt, -90, 45),
            [("RC_LIM_MIN_TILT", -90), ("RC_LIM_MAX_TILT", 45)]
        );
    }

    #[test]
    fn limits_that_make_no_sense_are_refused() {
        let limits = AngleLimits { min_deg: 45, max_deg: -90 };
        let crossed = ParameterError::Crossed { min: 45, max: -90 };
        assert_eq!(limits.writes(ParameterTable::New, TiltSense::DownPositive, Axis::Tilt), Err(crossed));

        let limits = AngleLimits { min_deg: i16::MIN, max_deg: 0 };
        let far = ParameterError::Limit { axis: Axis::Tilt, field: "min_deg", value: i16::MIN };
        assert_eq!(limits.writes(ParameterTable::New, TiltSense::DownPositive, Axis::Tilt), Err(far));

        let half = |name: &str| (name == "RC_LIM_MIN_PAN").then_some(-90);
        assert_eq!(AngleLimits::read(ParameterTable::New, TiltSense::DownPositive, Axis::Pan, half), None);
    }
}
