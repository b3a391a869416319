//! How a Gremsy is, as its `SYS_STATUS` says.
//!
//! | Field | Content |
//! |---|---|
//! | `errors_count1` | what it does, [`Activity`] |
//! | `errors_count2` | what is wrong or not yet in place, [`Alignment`] |
//! | `load` | share of its cycle that is used, thousandths |
//! | `voltage_battery` | millivolts |

use std::fmt;

use crate::wire::Frame;
use crate::wire::dialect::SYS_STATUS_DATA;

bitflags::bitflags! {
    /// `errors_count1`. Unknown bits are kept.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    pub struct Activity: u16 {
        /// Following the vehicle; without it, locked.
        const FOLLOW = 0x0001;
        const MISSED_STEP = 0x0002;
        const SENSOR_ERROR = 0x0004;
        const BATTERY_LOW = 0x0008;
        const MOTORS_ON = 0x0010;
        const MOTORS_STARTING = 0x0020;
        const AUTO_TUNE = 0x0040;
        const CAN_LINK_UP = 0x0080;
        const SEARCHING_HOME = 0x0100;
        const SETTING_HOME = 0x0200;
        const CALIBRATING = 0x0400;
        const STARTING_UP = 0x0800;
        const REMOTE = 0x1000;
        const INVERTED = 0x2000;
        const MOTOR_PHASE_ERROR = 0x4000;
        const MOTOR_ANGLE_ERROR = 0x8000;
        const _ = !0;
    }

    /// `errors_count2`: anything in it means that the gimbal is not aligned. Unknown bits are kept.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    pub struct Alignment: u16 {
        const IMU = 0x0001;
        const ENCODER_TILT = 0x0002;
        const ENCODER_ROLL = 0x0004;
        const ENCODER_PAN = 0x0008;
        const JOYSTICK = 0x0010;
        const INVERTED = 0x0020;
        const PAN_HOME_SEARCH = 0x0040;
        const ANGLE_TILT = 0x0080;
        const ANGLE_ROLL = 0x0100;
        const ANGLE_PAN = 0x0200;
        const MOVE_TILT = 0x0400;
        const MOVE_ROLL = 0x0800;
        const MOVE_PAN = 0x1000;
        const _ = !0;
    }

    /// The vendor's `operation_state_t`: off when it is empty.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    pub struct OperationState: u8 {
        const INIT = 0x01;
        const ON = 0x02;
        const LOCK = 0x04;
        const FOLLOW = 0x08;
        const SEARCH_HOME = 0x10;
        const SET_HOME = 0x20;
        const ERROR = 0x40;
    }
}

impl Activity {
    const ERRORS: Self = Self::SENSOR_ERROR.union(Self::MOTOR_PHASE_ERROR).union(Self::MOTOR_ANGLE_ERROR);
    const START_UP: Self = Self::STARTING_UP.union(Self::MOTORS_STARTING);
}

impl Alignment {
    /// The sensors that the vendor's `sensor_state` names.
    pub const SENSORS: Self = Self::IMU.union(Self::ENCODER_TILT).union(Self::ENCODER_ROLL).union(Self::ENCODER_PAN);

    /// What is not in place, as words: `encoder_roll`, in the order of the bits.
    pub fn names(self) -> impl Iterator<Item = String> {
        self.iter_names().map(|(name, _)| name.to_ascii_lowercase())
    }
}

impl OperationState {
    pub const OFF: Self = Self::empty();
}

impl fmt::Display for OperationState {
    /// As in `on, follow`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.is_empty() {
            return f.write_str("off");
        }
        for (index, (name, _)) in self.iter_names().enumerate() {
            let comma = if index == 0 { "" } else { ", " };
            write!(f, "{comma}{}", name.to_ascii_lowercase().replace('_', " "))?;
        }
        Ok(())
    }
}

/// One `SYS_STATUS`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SystemStatus {
    pub activity: Activity,
    pub alignment: Alignment,
    /// `None` where the gimbal does not measure it.
    pub battery_mv: Option<u16>,
    /// Share of its cycle that is used, thousandths; to stay below 1000.
    pub load_permille: u16,
}

/// Reads `SYS_STATUS`; `None` for another message.
pub fn read_system_status(frame: &Frame<'_>) -> Option<SystemStatus> {
    frame.decode().map(|message: SYS_STATUS_DATA| SystemStatus::from(&message))
}

impl From<&SYS_STATUS_DATA> for SystemStatus {
    fn from(message: &SYS_STATUS_DATA) -> Self {
        Self {
            activity: Activity::from_bits_retain(message.errors_count1),
            alignment: Alignment::from_bits_retain(message.errors_count2),
            battery_mv: (message.voltage_battery != u16::MAX).then_some(message.voltage_battery),
            load_permille: message.load,
        }
    }
}

impl SystemStatus {
    /// Sensors that are not there yet are no error while the gimbal starts; broken ones are, and so is everything that
    /// `errors_count1` calls one.
    pub fn operation(self) -> OperationState {
        let Self { activity, alignment, .. } = self;
        let is_starting = activity.intersects(Activity::START_UP);
        let is_broken = activity.intersects(Activity::ERRORS)
            || (alignment.intersects(Alignment::SENSORS) && !activity.contains(Activity::STARTING_UP));
        let mut state = if is_broken {
            OperationState::ERROR
        } else if is_starting {
            OperationState::INIT
        } else if !self.motors_on() {
            OperationState::OFF
        } else if activity.contains(Activity::FOLLOW) {
            OperationState::ON | OperationState::FOLLOW
        } else {
            OperationState::ON | OperationState::LOCK
        };
        state.set(OperationState::SEARCH_HOME, activity.contains(Activity::SEARCHING_HOME));
        state.set(OperationState::SET_HOME, activity.contains(Activity::SETTING_HOME));
        state
    }

    pub fn motors_on(self) -> bool {
        self.activity.contains(Activity::MOTORS_ON)
    }

    /// Nothing keeps it from being steered: the vendor waits for this before it calls a gimbal present.
    pub fn is_aligned(self) -> bool {
        self.alignment.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn status(errors_count1: u16, errors_count2: u16) -> SystemStatus {
        SystemStatus {
            activity: Activity::from_bits_retain(errors_count1),
            alignment: Alignment::from_bits_retain(errors_count2),
            battery_mv: None,
            load_permille: 0,
        }
    }

    /// Gimbal statement 24: "SYS_STATUS ec1=0x0011, ec2=0 → ON|FOLLOW; ec1=0x0010 → ON|LOCK; ec1=0x0000 → OFF;
    /// ec1=0x0830 → INIT; ec1=0x4010 → ERROR; ec2=0x04 → ERROR with encoder-roll."
    #[test]
    #[rustfmt::skip]
    fn statement_24_operation_state_and_sensors() {
        let (on, follow, lock) = (OperationState::ON, OperationState::FOLLOW, OperationState::LOCK);
        let (init, off, error) = (OperationState::INIT, OperationState::OFF, OperationState::ERROR);
        let (searching, setting) = (OperationState::SEARCH_HOME, OperationState::SET_HOME);
        for (ec1,    ec2,    expected,                sensors,                    text) in [
            (0x0011, 0x0000, on | follow,             "",                         "on, follow"),
            (0x0010, 0x0000, on | lock,               "",                         "on, lock"),
            (0x0000, 0x0000, off,                     "",                         "off"),
            (0x0830, 0x0000, init,                    "",                         "init"),
            (0x0020, 0x0000, init,                    "",                         "init"),
            (0x4010, 0x0000, error,                   "",                         "error"),
            (0x8011, 0x0000, error,                   "",                         "error"),
            (0x0004, 0x0000, error,                   "",                         "error"),
            (0x0011, 0x0004, error,                   "encoder_roll",             "error"),
            (0x0000, 0x0004, error,                   "encoder_roll",             "error"),
            (0x0111, 0x0040, on | follow | searching, "pan_home_search",          "on, follow, search home"),
            (0x0210, 0x0000, on | lock | setting,     "",                         "on, lock, set home"),
            // "Start-up flags: ec1 = 0x0800|0x0020 for 4.0 s (errors_count2 = 0x0E meanwhile)" (gimbals 5.3).
            (0x0820, 0x000e, init,           "encoder_tilt encoder_roll encoder_pan", "init"),
        ] {
            let status = status(ec1, ec2);

            assert_eq!(status.operation(), expected, "{ec1:#06x} {ec2:#06x}");
            assert_eq!(status.operation().to_string(), text);
            assert_eq!(status.alignment.names().collect::<Vec<_>>().join(" "), sensors);
            assert_eq!(status.is_aligned(), ec2 == 0);
            assert_eq!(status.motors_on(), ec1 & 0x10 != 0);
        }
    }

    /// "`load` and `voltage_battery` of SYS_STATUS are passed through" (gimbals 1.4).
    #[test]
    fn voltage_and_load_pass_through() {
        let message = |voltage_battery| SYS_STATUS_DATA {
            onboard_control_sensors_present: 0,
            onboard_control_sensors_enabled: 0,
            onboard_control_sensors_health: 0,
            load: 412,
            voltage_battery,
            current_battery: -1,
            battery_remaining: -1,
            drop_rate_comm: 0,
            errors_comm: 0,
            errors_count1: 0x0011,
            errors_count2: 0,
            errors_count3: 0,
            errors_count4: 0,
            onboard_control_sensors_present_extended: 0,
            onboard_control_sensors_enabled_extended: 0,
            onboard_control_sensors_health_extended: 0,
        };
        let expected = SystemStatus { battery_mv: Some(14_800), load_permille: 412, ..status(0x0011, 0) };

        assert_eq!(SystemStatus::from(&message(14_800)), expected);
        assert_eq!(SystemStatus::from(&message(u16::MAX)), SystemStatus { battery_mv: None, ..expected });
    }
}
