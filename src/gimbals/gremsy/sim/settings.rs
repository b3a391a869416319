//! Which Gremsy a simulated one is.

use crate::geometry::{Angle, AngularRate, AxisLimits, GimbalAngles, Limits};
use crate::gimbals::gremsy::parameters::{ParameterTable, RcType};
use crate::gimbals::gremsy::version::FirmwareVersion;
use crate::sim::plant::PlantSettings;
use crate::sim::system_id::SystemId;
use crate::wire::ids::component;

/// Everything that differs from one Gremsy to another.
#[derive(Clone, Debug, PartialEq)]
pub struct DeviceSettings {
    pub component_id: u8,
    /// Until a vehicle is heard, 1.
    pub system_id: SystemId,
    pub generation: Generation,
    /// What it has wrong and what it is called depends on it.
    pub firmware: FirmwareVersion,
    pub model_name: String,
    /// Orientation, encoders, IMU and attitude come unasked; models of the AEVO series send none of them.
    pub has_usual_streams: bool,
    pub status_target: StatusTarget,
    pub rc_type: RcType,
    /// The fastest that each axis turns when it is told to (`RC_SPD_…`), degrees per second.
    pub control_speed_dps: i16,
    /// Pitch in `MOUNT_ORIENTATION` is the wrong way round.
    pub has_inverted_pitch: bool,
    /// Once its motors were switched off by RETRACT, only a restart helps (v2).
    pub is_latched_by_retract: bool,
    /// Software limits that it comes with, and the rest of the mechanics.
    pub plant: PlantSettings,
}

/// Which protocol it is steered by. Real firmware since 2022 knows both; a simulated one does not mix them, and so finds
/// out who does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Generation {
    /// `DO_MOUNT_CONTROL` and the vendor's own commands.
    V1,
    /// The Gimbal Protocol v2.
    V2,
}

/// Whom `GIMBAL_DEVICE_ATTITUDE_STATUS` is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StatusTarget {
    Everyone,
    /// The manager, as long as there is one.
    Manager,
}

/// How far the firmware with the wrong earth yaw errs. Nothing is published but that it does.
const EARTH_YAW_ERROR: Angle = Angle::from_degrees(35.0);

impl DeviceSettings {
    /// A gimbal of this generation with the firmware that comes with it: 7.7.3 speaks v1 and has the new parameters,
    /// 7.8.9 speaks v2.
    pub fn of(generation: Generation) -> Self {
        let firmware = match generation {
            Generation::V1 => FirmwareVersion::official(7, 7, 3),
            Generation::V2 => FirmwareVersion::official(7, 8, 9),
        };
        let degrees = Angle::from_degrees;
        Self {
            component_id: component::GIMBAL,
            system_id: SystemId::Adopt,
            generation,
            firmware,
            model_name: "MIO".to_owned(),
            has_usual_streams: true,
            status_target: StatusTarget::Everyone,
            rc_type: RcType::SYNC,
            control_speed_dps: 30,
            has_inverted_pitch: false,
            is_latched_by_retract: false,
            plant: PlantSettings {
                // Holding against a vehicle that turns takes more than the speed of control.
                max_rate: AngularRate::from_degrees_per_second(120.0),
                max_acceleration: degrees(240.0).radians(),
                limits: Limits {
                    roll: AxisLimits::new(degrees(-40.0), degrees(40.0)),
                    pitch: AxisLimits::new(degrees(-90.0), degrees(45.0)),
                    yaw: AxisLimits::new(degrees(-320.0), degrees(320.0)),
                },
                // As it hangs without motors.
                initial: GimbalAngles { pitch: degrees(-25.0), ..GimbalAngles::default() },
                ..PlantSettings::default()
            },
        }
    }

    /// Firmware up to 2021: the old parameters, and nothing of the Gimbal Protocol v2.
    pub fn is_old(&self) -> bool {
        !self.firmware.may_speak_v2()
    }

    pub fn table(&self) -> ParameterTable {
        if self.is_old() { ParameterTable::Old } else { ParameterTable::New }
    }

    /// What its yaw from North has too much.
    pub fn earth_yaw_error(&self) -> Angle {
        if self.firmware.has_wrong_earth_yaw() { EARTH_YAW_ERROR } else { Angle::ZERO }
    }
}
