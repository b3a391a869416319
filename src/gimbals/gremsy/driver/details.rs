//! Everything that a Gremsy tells, for whoever looks.

use std::collections::BTreeMap;
use std::time::Duration;

use super::operations::shown_mode;
use super::{Generation, GremsyDriver};
use crate::geometry::{Angle, AngularRate};
use crate::gimbals::details::{AxisDetails, EncoderDetails, GimbalDetails, ImuDetails, StreamDetails};
use crate::gimbals::gremsy::modes::ControlMode;
use crate::gimbals::gremsy::parameters::{
    AngleLimits, Axis, AxisFlags, AxisMotion, EncoderType, MotorControl, Parameter, RcType, TiltSense,
};
use crate::gimbals::operation::{StreamRate, YawMode};
use crate::timestamp::Timestamp;

impl GremsyDriver {
    pub(super) fn tell_details(&self, now: Timestamp) -> GimbalDetails {
        let status = self.heard.status.map(|(_, status)| status);
        let motors = self.table().map(|table| MotorControl::read(table, |name| self.value(name))).unwrap_or_default();
        let flag = |flag| self.axis_flags().map(|flags| flags.contains(flag));
        GimbalDetails {
            generation: self.search.decided().map(|generation| generation.name().to_owned()),
            faults: self.faults.iter().map(ToString::to_string).collect(),
            parameters: self.parameters.values().map(|(name, value)| (name.to_owned(), value)).collect(),
            stage: Some(self.stage().to_owned()),
            version: self.version().map(|version| version.to_string()),
            mode: self.control_mode().map(|mode| mode.name().to_owned()),
            operation: status.map(|status| status.operation().to_string()),
            not_aligned: status.map(|status| status.alignment.names().collect()).unwrap_or_default(),
            motors_on: status.map(|status| status.motors_on()),
            battery_v: status.and_then(|status| status.battery_mv).map(|millivolts| f64::from(millivolts) / 1_000.0),
            load_percent: status.map(|status| f64::from(status.load_permille) / 10.0),
            imu: self.heard.imu.map(|(at, imu)| ImuDetails {
                acceleration_g: imu.acceleration_g(),
                rates_dps: imu.rates().map(AngularRate::degrees_per_second),
                acceleration_raw: imu.acceleration,
                rates_raw: imu.turn,
                time_us: imu.time_us,
                age_ms: millis(now.since(at)),
            }),
            encoders: self.encoders(now),
            axes: Axis::ALL.into_iter().map(|axis| (axis.name().to_owned(), self.axis(axis, &motors))).collect(),
            gyro_filter: motors.gyro_filter.map(f64::from),
            output_filter: motors.output_filter.map(f64::from),
            gain: motors.gain.map(f64::from),
            radio_type: self.number(Parameter::RcType).map(|code| RcType::from_code(code).to_string()),
            encoder_unit: self.told_encoder_type().map(|kind| encoder_unit(kind).to_owned()),
            combined_attitude: flag(AxisFlags::COMBINE_ATTITUDE),
            home_on_mode_change: flag(AxisFlags::HOME_ON_MODE_CHANGE),
            streams: self.streams(now),
            message_ages_ms: self.ages(now),
        }
    }

    fn value(&self, name: &str) -> Option<i16> {
        self.parameters.value(name).map(|value| value as i16)
    }

    fn stage(&self) -> &'static str {
        if self.is_shut_down() {
            "shut_down"
        } else if !self.is_alive {
            "searching"
        } else if self.off.is_some() {
            "restarting"
        } else if self.is_present {
            "running"
        } else if self.parameters.is_settled() {
            "aligning"
        } else {
            "reading_parameters"
        }
    }

    fn control_mode(&self) -> Option<ControlMode> {
        match self.search.decided()? {
            Generation::V1 => {
                let (_, status) = self.heard.status?;
                Some(match shown_mode(status) {
                    _ if !status.motors_on() => ControlMode::Off,
                    YawMode::Lock => ControlMode::Lock,
                    YawMode::Follow => ControlMode::Follow,
                })
            }
            Generation::V2 => self.heard.attitude.map(|(_, status)| ControlMode::from_status(status.flags)),
        }
    }

    fn told_encoder_type(&self) -> Option<EncoderType> {
        self.number(Parameter::EncoderType).and_then(EncoderType::from_value)
    }

    /// The vendor's default, where it does not say.
    pub(super) fn encoder_type(&self) -> EncoderType {
        self.told_encoder_type().unwrap_or(EncoderType::Counts)
    }

    fn encoders(&self, now: Timestamp) -> Option<EncoderDetails> {
        let (at, encoders, unit) = self.heard.encoders.filter(|(.., unit)| *unit == self.encoder_type())?;
        let [tilt_deg, roll_deg, pan_deg] = encoders.angles(unit).map(Angle::degrees);
        Some(EncoderDetails { tilt_deg, roll_deg, pan_deg, raw: encoders.0, age_ms: millis(now.since(at)) })
    }

    fn axis(&self, axis: Axis, motors: &MotorControl) -> AxisDetails {
        let Some(table) = self.table() else { return AxisDetails::default() };
        let motion = AxisMotion::read(table, axis, |name| self.value(name));
        let limits = AngleLimits::read(table, TiltSense::of(table), axis, |name| self.value(name));
        let at = match axis {
            Axis::Tilt => 0,
            Axis::Roll => 1,
            Axis::Pan => 2,
        };
        AxisDetails {
            follow_speed: motion.follow_speed.map(f64::from),
            follow_smoothing: motion.follow_smoothing.map(f64::from),
            follow_window_deg: motion.follow_window.map(f64::from),
            control_speed_dps: motion.control_speed.map(f64::from),
            control_smoothing: motion.control_smoothing.map(f64::from),
            reversed: motion.is_reversed,
            stiffness: motors.stiffness[at].map(f64::from),
            hold_strength: motors.hold_strength[at].map(f64::from),
            min_deg: limits.map(|limits| f64::from(limits.min_deg)),
            max_deg: limits.map(|limits| f64::from(limits.max_deg)),
        }
    }

    fn streams(&self, now: Timestamp) -> BTreeMap<String, StreamDetails> {
        let mut all: BTreeMap<_, StreamDetails> =
            self.streams.heard().map(|stream| (stream, StreamDetails::default())).collect();
        for (stream, rate) in self.streams.wanted() {
            all.entry(stream).or_default().wanted_hz = match rate {
                StreamRate::Off => Some(0.0),
                StreamRate::Default => None,
                StreamRate::Hertz(hertz) => Some(f64::from(hertz)),
            };
        }
        for (stream, details) in &mut all {
            details.measured_hz = self.streams.measured(now, *stream);
        }
        all.into_iter().map(|(stream, details)| (stream.name().to_owned(), details)).collect()
    }

    fn ages(&self, now: Timestamp) -> BTreeMap<String, u64> {
        let heard = &self.heard;
        let all = [
            ("HEARTBEAT", heard.heartbeat),
            ("SYS_STATUS", heard.status.map(|(at, _)| at)),
            ("RAW_IMU", heard.imu.map(|(at, _)| at)),
            ("MOUNT_STATUS", heard.encoders.map(|(at, ..)| at)),
            ("MOUNT_ORIENTATION", heard.orientation.map(|(at, _)| at)),
            ("GIMBAL_DEVICE_INFORMATION", heard.information),
            ("GIMBAL_DEVICE_ATTITUDE_STATUS", heard.device_status),
        ];
        all.into_iter().filter_map(|(name, at)| Some((name.to_owned(), millis(now.since(at?))))).collect()
    }
}

const fn encoder_unit(kind: EncoderType) -> &'static str {
    match kind {
        EncoderType::Counts => "counts",
        EncoderType::Angle => "angles",
    }
}

fn millis(duration: Duration) -> u64 {
    duration.as_millis().try_into().unwrap_or(u64::MAX)
}
