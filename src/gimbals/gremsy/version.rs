//! Which firmware a Gremsy has, and what is known of it.

use std::cmp::Ordering;
use std::fmt;
use std::str::FromStr;

/// A firmware version as the vendor writes it, such as `7.8.9 alpha`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FirmwareVersion {
    pub x: u8,
    pub y: u8,
    pub z: u8,
    pub stage: Stage,
}

/// How far a release is; each is older than the next.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Stage {
    Alpha,
    Beta,
    Candidate,
    Official,
}

impl Stage {
    /// The upper two bits of a byte; 255 is the vendor's second way to say official.
    const fn from_byte(byte: u8) -> Self {
        match byte & STAGE_BITS {
            _ if byte == u8::MAX => Self::Official,
            0x40 => Self::Alpha,
            0x80 => Self::Beta,
            0xc0 => Self::Candidate,
            _ => Self::Official,
        }
    }

    const fn bits(self) -> u8 {
        match self {
            Self::Official => 0,
            Self::Alpha => 0x40,
            Self::Beta => 0x80,
            Self::Candidate => 0xc0,
        }
    }

    /// What stands behind the numbers.
    const fn suffix(self) -> &'static str {
        match self {
            Self::Alpha => " alpha",
            Self::Beta => " beta",
            Self::Candidate => " rc",
            Self::Official => "",
        }
    }
}

const STAGE_BITS: u8 = 0xc0;

impl FirmwareVersion {
    pub const fn official(x: u8, y: u8, z: u8) -> Self {
        Self { x, y, z, stage: Stage::Official }
    }

    /// From `GIMBAL_DEVICE_INFORMATION.firmware_version`, whose lowest byte is x.
    ///
    /// Its highest byte is the stage from 7.8.9 on; before, the parameter `VERSION_Z` tells it, and the release counts
    /// as official until that is known.
    pub fn from_information(bytes: [u8; 4], version_z: Option<i16>) -> Self {
        let [x, y, z, stage] = bytes;
        let stage = if (y == 8 && z > 8) || y > 8 {
            Stage::from_byte(stage)
        } else {
            version_z.map_or(Stage::Official, |z| Stage::from_byte(low_byte(z) & STAGE_BITS))
        };
        Self { x, y, z, stage }
    }

    /// From the parameters `VERSION_X`, `VERSION_Y` and `VERSION_Z`.
    pub fn from_parameters(x: i16, y: i16, z: i16) -> Self {
        let z = low_byte(z);
        Self { x: low_byte(x), y: low_byte(y), z: z & !STAGE_BITS, stage: Stage::from_byte(z & STAGE_BITS) }
    }

    /// As `GIMBAL_DEVICE_INFORMATION.firmware_version` tells it.
    pub fn to_information(self) -> [u8; 4] {
        let stage = if (self.y == 8 && self.z > 8) || self.y > 8 { self.stage.bits() } else { 0 };
        [self.x, self.y, self.z, stage]
    }

    /// As `VERSION_X`, `VERSION_Y` and `VERSION_Z` tell it.
    pub fn to_parameters(self) -> [i16; 3] {
        [self.x, self.y, self.z & !STAGE_BITS | self.stage.bits()].map(i16::from)
    }

    /// The Gimbal Protocol v2 may be there (the vendor's SDK counts on it from here on).
    pub fn may_speak_v2(self) -> bool {
        self.is_at_least([7, 7, 3])
    }

    /// `GIMBAL_DEVICE_ATTITUDE_STATUS` has a YAW_IN flag and `delta_yaw`; before, YAW_LOCK tells the frame.
    pub fn tells_yaw_frame(self) -> bool {
        self.is_at_least([7, 8, 7])
    }

    /// Its yaw from North is wrong (seen with 7.8.0, 7.8.4 and 7.8.7 on a Pixy LR: ArduPilot pull request 33444); that
    /// from the vehicle's nose is right.
    pub fn has_wrong_earth_yaw(self) -> bool {
        self.is_at_least([7, 8, 0]) && !self.is_at_least([7, 8, 8])
    }

    fn is_at_least(self, version: [u8; 3]) -> bool {
        self.numbers() >= version
    }

    const fn numbers(self) -> [u8; 3] {
        [self.x, self.y, self.z]
    }
}

/// A parameter carries it as an int16; its upper byte has no meaning.
fn low_byte(value: i16) -> u8 {
    value.to_le_bytes()[0]
}

impl Ord for FirmwareVersion {
    fn cmp(&self, other: &Self) -> Ordering {
        (self.numbers(), self.stage).cmp(&(other.numbers(), other.stage))
    }
}

impl PartialOrd for FirmwareVersion {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

/// Why a text is no firmware version.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("expected three numbers such as 7.8.9")]
pub struct VersionError;

impl FromStr for FirmwareVersion {
    type Err = VersionError;

    /// Reads an official version, such as `7.8.9`.
    fn from_str(text: &str) -> Result<Self, VersionError> {
        let numbers: Vec<u8> = text.split('.').map(str::parse).collect::<Result<_, _>>().map_err(|_| VersionError)?;
        let [x, y, z] = numbers[..] else { return Err(VersionError) };
        // The parameter VERSION_Z has no room for more.
        if z > !STAGE_BITS { Err(VersionError) } else { Ok(Self::official(x, y, z)) }
    }
}

impl fmt::Display for FirmwareVersion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}.{}.{}{}", self.x, self.y, self.z, self.stage.suffix())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Gimbal statement 23: "firmware_version 0x00070807 → 7.8.7 official; 0x40090807 → 7.8.9 alpha; with y=8, z=7 the
    /// type byte is taken from VERSION_Z."
    #[test]
    #[rustfmt::skip]
    fn statement_23_version_from_the_device_information() {
        for (number,           version_z,        expected,        stage) in [
            (0x0007_0807_u32,  None,             "7.8.7",         Stage::Official),
            (0x4009_0807,      None,             "7.8.9 alpha",   Stage::Alpha),
            (0x8009_0807,      Some(0x49),       "7.8.9 beta",    Stage::Beta),
            (0xc000_0907,      None,             "7.9.0 rc",      Stage::Candidate),
            (0xff09_0807,      None,             "7.8.9",         Stage::Official),
            // y = 8 and z = 7: not from the highest byte.
            (0x4007_0807,      Some(0x07),       "7.8.7",         Stage::Official),
            (0x0007_0807,      Some(0x87),       "7.8.7 beta",    Stage::Beta),
            (0x4008_0807,      Some(0xc8),       "7.8.8 rc",      Stage::Candidate),
        ] {
            let bytes = number.to_le_bytes();
            let version = FirmwareVersion::from_information(bytes, version_z);
            assert_eq!((version.to_string().as_str(), version.stage), (expected, stage), "{number:#010x}");
        }
    }

    /// "Old param route: z = VERSION_Z & 0x3F, type = VERSION_Z & 0xC0" (gimbals 1.8).
    #[test]
    fn version_from_parameters() {
        for (x, y, z, expected) in
            [(7, 5, 6, "7.5.6"), (7, 8, 0x47, "7.8.7 alpha"), (7, 7, 0x83, "7.7.3 beta"), (7, 7, 0xc3, "7.7.3 rc")]
        {
            let version = FirmwareVersion::from_parameters(x, y, z);
            assert_eq!(version.to_string(), expected);
            assert_eq!(version.to_parameters(), [x, y, z]);
        }
    }

    #[test]
    fn a_version_is_read_as_it_is_written() {
        assert_eq!("7.8.9".parse(), Ok(FirmwareVersion::official(7, 8, 9)));
        for text in ["", "7.8", "7.8.9.1", "7.8.x", "7.8.64", "7.8.256", "7.8.9 alpha"] {
            assert_eq!(text.parse::<FirmwareVersion>(), Err(VersionError), "{text:?}");
        }
    }

    #[test]
    fn both_ways_of_telling_a_version_come_back() {
        for version in [
            FirmwareVersion::official(7, 8, 6),
            FirmwareVersion { stage: Stage::Beta, ..FirmwareVersion::official(7, 8, 4) },
            FirmwareVersion { stage: Stage::Alpha, ..FirmwareVersion::official(7, 8, 9) },
        ] {
            let [x, y, z] = version.to_parameters();
            assert_eq!(FirmwareVersion::from_parameters(x, y, z), version);
            assert_eq!(FirmwareVersion::from_information(version.to_information(), Some(z)), version);
        }
    }

    #[test]
    fn versions_are_ordered_by_number_and_then_by_stage() {
        let ordered = [
            FirmwareVersion::official(7, 5, 6),
            FirmwareVersion::official(7, 7, 3),
            FirmwareVersion { stage: Stage::Alpha, ..FirmwareVersion::official(7, 8, 9) },
            FirmwareVersion { stage: Stage::Beta, ..FirmwareVersion::official(7, 8, 9) },
            FirmwareVersion { stage: Stage::Candidate, ..FirmwareVersion::official(7, 8, 9) },
            FirmwareVersion::official(7, 8, 9),
            FirmwareVersion::official(7, 8, 10),
        ];
        assert!(ordered.is_sorted_by(|former, latter| former < latter), "{ordered:?}");
    }

    /// Gimbals 1.7, 1.8 and 5.4: v2 from 7.7.3 on, YAW_IN flags from 7.8.7 on, a wrong earth yaw in 7.8.0 to 7.8.7.
    #[test]
    #[rustfmt::skip]
    fn what_is_known_of_each_version() {
        for (x, y, z,   v2,     frame,  wrong_earth_yaw) in [
            (7, 5, 6,   false,  false,  false),
            (7, 7, 2,   false,  false,  false),
            (7, 7, 3,   true,   false,  false),
            (7, 8, 0,   true,   false,  true),
            (7, 8, 6,   true,   false,  true),
            (7, 8, 7,   true,   true,   true),
            (7, 8, 8,   true,   true,   false),
            (7, 8, 9,   true,   true,   false),
            (7, 9, 0,   true,   true,   false),
            (8, 0, 0,   true,   true,   false),
        ] {
            let version = FirmwareVersion::official(x, y, z);
            let found = (version.may_speak_v2(), version.tells_yaw_frame(), version.has_wrong_earth_yaw());
            assert_eq!(found, (v2, frame, wrong_earth_yaw), "{version}");
            // An early build of a version is taken for it.
            let alpha = FirmwareVersion { stage: Stage::Alpha, ..version };
            assert_eq!(alpha.tells_yaw_frame(), frame);
        }
    }
}
