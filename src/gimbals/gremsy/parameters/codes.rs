//! Parameters that are codes and switches.

use std::fmt;

use super::Axis;
use crate::gimbals::operation::RadioType;

/// Where control comes from (`RC_TYPE`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RcType {
    /// One that the published SDK names.
    Named(RadioType),
    /// A number that it does not name; newer firmware has 15.
    Other(i16),
}

impl RcType {
    /// MAVLink: with any other type setpoints are acknowledged and have no effect.
    pub const SYNC: Self = Self::Named(RadioType::Sync);

    pub fn from_code(code: i16) -> Self {
        RadioType::ALL.into_iter().find(|kind| radio_code(*kind) == code).map_or(Self::Other(code), Self::Named)
    }

    pub const fn code(self) -> i16 {
        match self {
            Self::Named(kind) => radio_code(kind),
            Self::Other(code) => code,
        }
    }

    /// The type that a person calls by its name.
    pub fn from_name(name: &str) -> Option<Self> {
        RadioType::ALL.into_iter().find(|kind| kind.name() == name).map(Self::Named)
    }

    /// The names that [`from_name`](Self::from_name) knows.
    pub fn names() -> impl Iterator<Item = &'static str> {
        RadioType::ALL.into_iter().map(RadioType::name)
    }
}

/// The number of a radio type in the vendor's `rc_type_t`.
const fn radio_code(kind: RadioType) -> i16 {
    match kind {
        RadioType::SbusFasst => 1,
        RadioType::Joystick => 2,
        RadioType::Jr11Bit => 4,
        RadioType::Jr10Bit => 5,
        RadioType::Ppm => 6,
        RadioType::Sync => 7,
        RadioType::Lb2Single => 10,
        RadioType::Lb2Normal => 11,
        RadioType::Sync2 => 12,
        RadioType::SbusSfhss => 13,
        RadioType::Herelink => 14,
    }
}

impl fmt::Display for RcType {
    /// As in `sync`; a type without a name is its number.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Named(kind) => f.write_str(kind.name()),
            Self::Other(code) => write!(f, "{code}"),
        }
    }
}

bitflags::bitflags! {
    /// `RC_REVERSE_AXIS`, `JOY_AXIS` in the old table. Unknown bits are kept.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    pub struct AxisFlags: i16 {
        const REVERSE_TILT = 0x01;
        const REVERSE_PAN = 0x02;
        const REVERSE_ROLL = 0x04;
        /// Returns home when it changes from lock to follow or back.
        const HOME_ON_MODE_CHANGE = 0x08;
        /// Leans on the autopilot's attitude, against yaw drift; it has to come 50 to 100 times a second.
        const COMBINE_ATTITUDE = 0x10;
        const _ = !0;
    }
}

impl AxisFlags {
    pub const fn reverse(axis: Axis) -> Self {
        match axis {
            Axis::Tilt => Self::REVERSE_TILT,
            Axis::Roll => Self::REVERSE_ROLL,
            Axis::Pan => Self::REVERSE_PAN,
        }
    }
}

/// What `MOUNT_STATUS` carries (`MAV_TS_ENCNT`, `ENC_TYPE_SEND` in the old table).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EncoderType {
    Angle,
    /// Raw counts, 65 536 to a turn.
    Counts,
}

impl EncoderType {
    pub const fn from_value(value: i16) -> Option<Self> {
        match value {
            0 => Some(Self::Angle),
            1 => Some(Self::Counts),
            _ => None,
        }
    }

    pub const fn value(self) -> i16 {
        match self {
            Self::Angle => 0,
            Self::Counts => 1,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `rc_type_t`: "SBUS_FASST 1, JOYSTICK 2, JR_11BIT 4, JR_10BIT 5, PPM 6, SYNC 7, LB2_SINGLE 10, LB2_NORMAL 11,
    /// SYNC2 12, SBUS_SFHSS 13, HERELINK 14" (gimbals 1.4).
    #[test]
    fn rc_types_have_codes_and_names() {
        let listed: Vec<_> = (0..=15)
            .map(RcType::from_code)
            .filter(|kind| !matches!(kind, RcType::Other(_)))
            .map(|kind| (kind.code(), kind.to_string()))
            .collect();
        let listed: Vec<_> = listed.iter().map(|(code, name)| (*code, name.as_str())).collect();
        assert_eq!(
            listed,
            [
                (1, "sbus_fasst"),
                (2, "joystick"),
                (4, "jr_11bit"),
                (5, "jr_10bit"),
                (6, "ppm"),
                (7, "sync"),
                (10, "lb2_single"),
                (11, "lb2_normal"),
                (12, "sync2"),
                (13, "sbus_sfhss"),
                (14, "herelink"),
            ]
        );
        assert_eq!((RcType::from_code(15).code(), RcType::from_code(15).to_string()), (15, "15".to_owned()));
        assert_eq!(RcType::from_name("sync"), Some(RcType::SYNC));
        assert_eq!(RcType::from_name("15"), None);
        assert_eq!(RcType::names().count(), 11);
    }

    /// "RC_REVERSE_AXIS bits: 0x01 reverse tilt, 0x02 pan, 0x04 roll, 0x08 home on mode change, 0x10 combine attitude"
    /// (gimbals 1.6; the sample is 24).
    #[test]
    fn axis_flags_are_bits_of_one_number() {
        assert_eq!(AxisFlags::from_bits_retain(24), AxisFlags::HOME_ON_MODE_CHANGE | AxisFlags::COMBINE_ATTITUDE);
        assert_eq!(Axis::ALL.map(|axis| AxisFlags::reverse(axis).bits()), [1, 4, 2]);
        assert_eq!(AxisFlags::from_bits_retain(0x61).difference(AxisFlags::REVERSE_TILT).bits(), 0x60);
    }
}
