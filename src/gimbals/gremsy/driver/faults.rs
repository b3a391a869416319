//! What is wrong with a Gremsy or its firmware, and what to do about it.

use std::fmt;

use crate::gimbals::gremsy::parameters::RcType;
use crate::gimbals::gremsy::status::{Activity, Alignment, SystemStatus};
use crate::gimbals::gremsy::version::FirmwareVersion;

/// One of them; it stands in the status as long as it is so, and is told to the pilot once.
#[derive(Clone, Debug, PartialEq)]
pub enum Fault {
    /// `RC_TYPE` is not SYNC.
    RadioType(RcType),
    /// The firmware's yaw from North is wrong.
    EarthYaw(FirmwareVersion),
    /// `MOUNT_ORIENTATION` counts pitch the other way round.
    InvertedPitch,
    /// It acknowledges, and does not move.
    NoEffect,
    /// Its status comes, and its answers do not.
    NoAnswers,
    /// It was told to move while its motors are off.
    MotorsOff,
    /// They were switched off, by "retract" or by name, and do not come back.
    StaysRetracted,
    /// It is configured as a v2 gimbal, and does not tell where it looks as one does.
    NoAttitude,
    /// It does not change between lock and follow.
    ModeRefused,
    /// The same where it is configured as a v1 gimbal and may be a v2 one.
    NotV1,
    /// It answers nothing about parameters.
    NoParameters,
    /// It beats, and says nothing of how it is.
    NoStatus,
    /// It says that somebody else made it.
    OtherMaker(String),
    /// It does not become ready.
    NotAligned(Alignment),
    Sensor,
    Encoder(Alignment),
    MotorPhase,
    MotorAngle,
    BatteryLow,
}

impl Fault {
    /// A few words for `STATUSTEXT`.
    pub const fn short(&self) -> &'static str {
        match self {
            Self::RadioType(_) => "RC_TYPE is not SYNC, may not move",
            Self::EarthYaw(_) => "firmware has a wrong earth yaw",
            Self::InvertedPitch => "reports pitch upside down",
            Self::NoEffect => "acknowledges but does not move",
            Self::NoAnswers => "does not answer commands",
            Self::MotorsOff => "motors are off",
            Self::StaysRetracted => "motors stay off, restart it",
            Self::NoAttitude => "sends no attitude (gremsy_generation)",
            Self::ModeRefused => "refuses lock or follow",
            Self::NotV1 => "is no v1 gimbal (gremsy_generation)",
            Self::NoParameters => "answers no parameters",
            Self::NoStatus => "does not tell its status",
            Self::OtherMaker(_) => "says it is no Gremsy",
            Self::NotAligned(_) => "does not become ready",
            Self::Sensor => "sensor error",
            Self::Encoder(_) => "encoder error",
            Self::MotorPhase => "motor phase error",
            Self::MotorAngle => "motor angle error",
            Self::BatteryLow => "battery is low",
        }
    }

    const fn is_of_status(&self) -> bool {
        matches!(self, Self::Sensor | Self::Encoder(_) | Self::MotorPhase | Self::MotorAngle | Self::BatteryLow)
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::RadioType(kind) => write!(
                f,
                "RC_TYPE is {kind}, not sync: it may acknowledge what it is told and not move. Set the radio type to sync"
            ),
            Self::EarthYaw(version) => write!(
                f,
                "firmware {version} reports a wrong yaw from North: its yaw from the nose and the autopilot's heading are used. \
                 Update the firmware to 7.8.8 or later"
            ),
            Self::InvertedPitch => f.write_str(
                "MOUNT_ORIENTATION counts pitch the other way round: it is turned round here. Say so with \
                 gremsy_report_sign, or update the firmware",
            ),
            Self::NoEffect => f.write_str(
                "it acknowledges what it is told and does not move. Check that the radio type is sync, that the motors are \
                 on, and that nothing blocks the camera",
            ),
            Self::NoAnswers => f.write_str(
                "its status arrives and its answers do not. Check the wire towards the gimbal and the baud rate (115200)",
            ),
            Self::MotorsOff => f.write_str("it was told to move while its motors are off. Switch them on"),
            Self::StaysRetracted => f.write_str(
                "its motors were switched off and do not come back: this firmware needs a restart. Restart the gimbal, and \
                 neither switch its motors off nor set retract_allowed",
            ),
            Self::NoAttitude => f.write_str(
                "it sends no GIMBAL_DEVICE_ATTITUDE_STATUS, as a v2 gimbal does, so it is not known where it looks. Leave \
                 gremsy_generation out to have it found out",
            ),
            Self::ModeRefused => f.write_str(
                "it refuses to change between lock and follow, so it is not told where to look. Check that the radio type is \
                 sync, or restart it",
            ),
            Self::NotV1 => f.write_str(
                "it refuses to change between lock and follow, as a v2 gimbal does that gremsy_generation calls v1. Leave \
                 gremsy_generation out to have it found out; if it is right, check that the radio type is sync, or restart the \
                 gimbal",
            ),
            Self::NoParameters => f.write_str(
                "it answers no parameter requests, so its limits and settings are not known. Update the firmware if they are \
                 needed",
            ),
            Self::NoStatus => {
                f.write_str(
                    "it sends no SYS_STATUS, as every Gremsy does, so it is not known whether it is ready. Is family right? If it is, \
                     check the baud rate, or restart it",
                )
            }
            Self::OtherMaker(vendor) => write!(
                f,
                "it says that {vendor} made it, but its family is gremsy. Is family right? Leave the key out to have it found out"
            ),
            Self::NotAligned(alignment) => {
                let names: Vec<String> = alignment.names().collect();
                write!(
                    f,
                    "it does not become ready: {}. Check that the camera is balanced and free, and restart the gimbal",
                    names.join(", ")
                )
            }
            Self::Sensor => f.write_str("sensor error. Restart it without moving it; if it stays, have it repaired"),
            Self::Encoder(which) => {
                let names: Vec<String> = which.names().collect();
                let names = names.join(", ");
                write!(f, "{names} error. Restart it without moving it; if it stays, have it repaired")
            }
            Self::MotorPhase => f.write_str("motor phase error. Switch it off and have it repaired"),
            Self::MotorAngle => {
                f.write_str("motor angle error. Check that the camera is balanced and free, and restart the gimbal")
            }
            Self::BatteryLow => f.write_str("its battery is low. Check its supply"),
        }
    }
}

/// Those there are, and those that the pilot was told of.
#[derive(Debug, Default)]
pub struct Faults {
    present: Vec<Fault>,
    told: Vec<&'static str>,
}

impl Faults {
    /// The words for the pilot, the first time.
    pub fn raise(&mut self, fault: Fault) -> Option<&'static str> {
        let short = fault.short();
        match self.present.iter_mut().find(|present| present.short() == short) {
            Some(present) => *present = fault,
            None => self.present.push(fault),
        }
        if self.told.contains(&short) {
            return None;
        }
        self.told.push(short);
        Some(short)
    }

    /// It is not so any more.
    pub fn clear(&mut self, is_it: impl Fn(&Fault) -> bool) {
        self.present.retain(|present| !is_it(present));
    }

    /// What a `SYS_STATUS` says of errors; those to tell the pilot of. Sensors that are not in place yet while it starts are none.
    pub fn handle_status(&mut self, status: SystemStatus, is_running: bool) -> Vec<&'static str> {
        let SystemStatus { activity, alignment, .. } = status;
        let failed = if is_running { alignment.intersection(Alignment::SENSORS) } else { Alignment::empty() };
        let encoders = failed.difference(Alignment::IMU);
        let faults = [
            (activity.contains(Activity::SENSOR_ERROR) || failed.contains(Alignment::IMU), Fault::Sensor),
            (!encoders.is_empty(), Fault::Encoder(encoders)),
            (activity.contains(Activity::MOTOR_PHASE_ERROR), Fault::MotorPhase),
            (activity.contains(Activity::MOTOR_ANGLE_ERROR), Fault::MotorAngle),
            (activity.contains(Activity::BATTERY_LOW), Fault::BatteryLow),
        ];
        self.clear(Fault::is_of_status);
        let present = faults.into_iter().filter(|(is_there, _)| *is_there);
        present.filter_map(|(_, fault)| self.raise(fault)).collect()
    }

    pub fn iter(&self) -> impl Iterator<Item = &Fault> {
        self.present.iter()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A `STATUSTEXT` holds 50 characters, with the gimbal's name before it.
    #[test]
    fn the_words_for_the_pilot_are_few_and_each_fault_says_what_to_do() {
        let version = FirmwareVersion::official(7, 8, 4);
        for fault in [
            Fault::RadioType(RcType::Other(15)),
            Fault::EarthYaw(version),
            Fault::InvertedPitch,
            Fault::NoEffect,
            Fault::NoAnswers,
            Fault::MotorsOff,
            Fault::StaysRetracted,
            Fault::NoAttitude,
            Fault::ModeRefused,
            Fault::NoParameters,
            Fault::NoStatus,
            Fault::OtherMaker("STorM32".to_owned()),
            Fault::NotAligned(Alignment::ENCODER_ROLL),
            Fault::NotV1,
            Fault::Sensor,
            Fault::Encoder(Alignment::ENCODER_PAN),
            Fault::MotorPhase,
            Fault::MotorAngle,
            Fault::BatteryLow,
        ] {
            assert!(fault.short().len() <= 38, "{fault:?}");
            assert!(fault.to_string().contains(". "), "{fault} says what to do");
        }
        assert_eq!(
            Fault::NotAligned(Alignment::ENCODER_ROLL | Alignment::IMU).to_string(),
            "it does not become ready: imu, encoder_roll. Check that the camera is balanced and free, and restart the gimbal"
        );
    }

    #[test]
    fn a_fault_is_told_once_also_when_it_comes_back() {
        let mut faults = Faults::default();
        assert_eq!(faults.raise(Fault::NoEffect), Some("acknowledges but does not move"));
        assert_eq!(faults.raise(Fault::NoEffect), None);
        assert_eq!(faults.iter().count(), 1);
        faults.clear(|fault| *fault == Fault::NoEffect);
        assert_eq!(faults.iter().count(), 0);
        assert_eq!(faults.raise(Fault::NoEffect), None);
        assert_eq!(faults.iter().count(), 1);
    }
}
