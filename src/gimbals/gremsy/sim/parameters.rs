//! The parameters of the device, and what they change.

use std::time::Duration;

use super::{Device, DeviceSettings};
use crate::geometry::{Angle, AngularRate, AxisLimits, Limits};
use crate::gimbals::gremsy::parameters::{
    AngleLimits, Axis, AxisFlags, EncoderType, Parameter, ParameterTable, RcType, Row, TiltSense,
};
use crate::sim::parameters::{self as server, IntegerEncoding, ParameterServer, ParameterValue, Writable};

/// Writing into flash takes from 20 to 200 ms.
const FLASH: Duration = Duration::from_millis(20);
const FLASH_SPREAD: Duration = Duration::from_millis(180);

pub fn parameters(settings: &DeviceSettings) -> ParameterServer {
    let rows = settings.table().rows();
    let first_free = rows.iter().filter_map(|row| row.index).max().map_or(0, |index| index + 1);
    // Of some only the name is known; they come last.
    let mut free = first_free..;
    let list = rows.iter().map(|row| {
        let index = row.index.or_else(|| free.next()).unwrap_or(first_free);
        let value = ParameterValue::Short(first_value(settings, row));
        let writable = match row.parameter {
            Parameter::VersionX | Parameter::VersionY | Parameter::VersionZ => Writable::Nothing,
            other => Writable::Within(other.range()),
        };
        server::Parameter { name: row.name, index, value, writable }
    });
    ParameterServer::with_parameters(list.collect(), IntegerEncoding::CCast).with_flash(
        FLASH,
        FLASH_SPREAD,
        settings.plant.seed,
    )
}

/// The samples of the vendor's print-out, but for what the settings say.
fn first_value(settings: &DeviceSettings, row: &Row) -> i16 {
    let [x, y, z] = settings.firmware.to_parameters();
    let of = |axis: Axis, [tilt, roll, pan]: [i16; 3]| match axis {
        Axis::Tilt => tilt,
        Axis::Roll => roll,
        Axis::Pan => pan,
    };
    match row.parameter {
        Parameter::VersionX => x,
        Parameter::VersionY => y,
        Parameter::VersionZ => z,
        Parameter::Stiffness(axis) | Parameter::HoldStrength(axis) => of(axis, [20, 70, 60]),
        Parameter::Gain => 120,
        Parameter::OutputFilter => 1,
        Parameter::GyroFilter => 4,
        Parameter::FollowSpeed(_) => 60,
        Parameter::FollowSmoothing(_) => 20,
        Parameter::FollowWindow(axis) => of(axis, [5, 0, 20]),
        Parameter::ControlSpeed(_) => settings.control_speed_dps,
        Parameter::ControlSmoothing(_) => 80,
        Parameter::LimitMin(_) | Parameter::LimitMax(_) => limit(settings, row.name),
        Parameter::AxisFlags => AxisFlags::COMBINE_ATTITUDE.bits(),
        Parameter::RcType => settings.rc_type.code(),
        Parameter::EncoderType => EncoderType::Counts.value(),
        Parameter::AdaptiveControl | Parameter::AnglePath => 0,
        Parameter::MotorPower => 100,
        Parameter::HeartbeatEmit => 1,
        Parameter::StatusRate => 1,
        Parameter::EncoderRate | Parameter::OrientationRate | Parameter::ImuRate => 10,
    }
}

/// The limit that goes by this name, as the gimbal stores it.
fn limit(settings: &DeviceSettings, name: &str) -> i16 {
    let table = settings.table();
    let limits = settings.plant.limits;
    let whole = |angle: Angle| angle.degrees().round() as i16;
    [(Axis::Tilt, limits.pitch), (Axis::Roll, limits.roll), (Axis::Pan, limits.yaw)]
        .into_iter()
        .filter_map(|(axis, limits)| Some((axis, limits?)))
        .filter_map(|(axis, limits)| {
            let limits = AngleLimits { min_deg: whole(limits.min()), max_deg: whole(limits.max()) };
            limits.writes(table, TiltSense::of(table), axis).ok()
        })
        .flatten()
        .find(|write| write.name == name)
        .map_or(0, |write| write.value)
}

/// The value of a parameter, by its name.
pub fn short(parameters: &ParameterServer, name: &str) -> Option<i16> {
    match parameters.value(name)? {
        ParameterValue::Short(value) => Some(value),
        ParameterValue::Integer(_) | ParameterValue::Float(_) => None,
    }
}

impl Device {
    /// Does what the parameters say.
    pub(super) fn apply_parameters(&mut self) {
        let table = self.settings.table();
        let limits = |axis| {
            let limits = AngleLimits::read(table, TiltSense::of(table), axis, |name| self.parameter(name))?;
            let [min, max] = [limits.min_deg, limits.max_deg].map(|degrees| Angle::from_degrees(f64::from(degrees)));
            AxisLimits::new(min, max)
        };
        let all = Limits { roll: limits(Axis::Roll), pitch: limits(Axis::Tilt), yaw: limits(Axis::Pan) };
        let speeds = [Axis::Roll, Axis::Tilt, Axis::Pan].map(|axis| {
            let degrees = self.value(Parameter::ControlSpeed(axis)).unwrap_or_default();
            AngularRate::from_degrees_per_second(f64::from(degrees))
        });
        let is_direct = self.value(Parameter::AnglePath) == Some(1);
        self.plant.set_limits(all);
        self.plant.set_speed_limits(speeds);
        self.plant.set_direct_way(is_direct);
    }

    /// Setpoints have no effect otherwise. Firmware with the old table has no such parameter.
    pub(super) fn takes_setpoints(&self) -> bool {
        self.value(Parameter::RcType).is_none_or(|code| RcType::from_code(code) == RcType::SYNC)
    }

    pub(super) fn axis_flags(&self) -> AxisFlags {
        AxisFlags::from_bits_retain(self.value(Parameter::AxisFlags).unwrap_or_default())
    }

    pub(super) fn encoder_type(&self) -> EncoderType {
        self.value(Parameter::EncoderType).and_then(EncoderType::from_value).unwrap_or(EncoderType::Angle)
    }

    fn value(&self, parameter: Parameter) -> Option<i16> {
        self.parameter(self.table().name(parameter)?)
    }

    fn table(&self) -> ParameterTable {
        self.settings.table()
    }
}
