//! What the device says.

use std::time::Duration;

use super::motors::Motors;
use super::{Device, StatusTarget};
use crate::geometry::{Angle, AngularRate};
use crate::gimbals::gremsy::modes::MAPPING;
use crate::gimbals::gremsy::parameters::EncoderType;
use crate::gimbals::gremsy::status::{Activity, Alignment};
use crate::gimbals::mavlink_v2::sim::setpoint::Mode;
use crate::gimbals::mavlink_v2::sim::telling::{self, AttitudeStatus, DeltaYaw};
use crate::sim::plant::YawHold;
use crate::timestamp::Timestamp;
use crate::wire::dialect::{
    CharArray, GIMBAL_DEVICE_ATTITUDE_STATUS_DATA, GIMBAL_DEVICE_INFORMATION_DATA, MOUNT_ORIENTATION_DATA,
    MOUNT_STATUS_DATA, RAW_IMU_DATA, SYS_STATUS_DATA,
};
use crate::wire::ids::{CapFlags, FailureFlags, GimbalFlags, message, mount_mode};

/// More messages a second are dropped, but for a few at once.
const MOST_PER_SECOND: f64 = 200.0;
const MOST_AT_ONCE: f64 = 20.0;

const BATTERY_MV: u16 = 14_800;
const LOAD_PERMILLE: u16 = 420;

const COUNTS_PER_G: f64 = 8192.0;
const COUNTS_PER_DEGREE_PER_SECOND: f64 = 32.8;
const COUNTS_PER_DEGREE: f64 = 65_536.0 / 360.0;

/// How many messages it still sends.
#[derive(Clone, Copy, Debug)]
pub struct Allowance {
    left: f64,
    at: Timestamp,
}

impl Allowance {
    pub const fn full(now: Timestamp) -> Self {
        Self { left: MOST_AT_ONCE, at: now }
    }

    /// True when one more is sent.
    pub fn takes(&mut self, now: Timestamp) -> bool {
        let earned = MOST_PER_SECOND * now.since(self.at).as_secs_f64();
        self.left = (self.left + earned).min(MOST_AT_ONCE);
        self.at = now;
        let is_enough = self.left >= 1.0;
        if is_enough {
            self.left -= 1.0;
        }
        is_enough
    }
}

impl Device {
    pub(super) fn report(&mut self, now: Timestamp, id: u32) {
        match id {
            message::HEARTBEAT => self.line.outbox.send(&telling::HEARTBEAT),
            message::SYS_STATUS => {
                let status = self.system_status(now);
                self.line.outbox.send(&status);
            }
            message::RAW_IMU => {
                let imu = self.raw_imu(now);
                self.line.outbox.send(&imu);
            }
            message::MOUNT_ORIENTATION => {
                let orientation = self.mount_orientation(now);
                self.line.outbox.send(&orientation);
            }
            message::MOUNT_STATUS => {
                let status = self.mount_status(now);
                self.line.outbox.send(&status);
            }
            message::GIMBAL_DEVICE_INFORMATION => {
                let information = self.information(now);
                self.line.outbox.send(&information);
            }
            message::GIMBAL_DEVICE_ATTITUDE_STATUS => {
                let status = self.attitude_status(now);
                self.line.outbox.send(&status);
            }
            _ => {}
        }
    }

    fn clock(&self, now: Timestamp) -> Duration {
        self.power.uptime(now)
    }

    fn boot_ms(&self, now: Timestamp) -> u32 {
        (Timestamp::ZERO + self.clock(now)).boot_ms()
    }

    fn is_holding_horizon(&self) -> bool {
        if self.is_v2() {
            self.steering.mode() == Mode::Free && self.plant.yaw_hold() == YawHold::Horizon
        } else {
            self.is_locked
        }
    }

    fn system_status(&self, now: Timestamp) -> SYS_STATUS_DATA {
        let is_starting = self.power.is_starting(now);
        let mut activity = Activity::empty();
        let mut alignment = Alignment::empty();
        if is_starting {
            activity |= Activity::STARTING_UP | Activity::MOTORS_STARTING;
            alignment |= Alignment::ENCODER_TILT | Alignment::ENCODER_ROLL | Alignment::ENCODER_PAN;
        } else {
            activity.set(Activity::FOLLOW, !self.is_holding_horizon());
            activity.set(Activity::MOTORS_ON, self.motors == Motors::On);
            activity.set(Activity::MOTORS_STARTING, matches!(self.motors, Motors::Starting { .. }));
            activity.set(Activity::REMOTE, self.is_with_rc);
            activity.set(Activity::SENSOR_ERROR, self.failures.contains(FailureFlags::ENCODER_ERROR));
            activity.set(Activity::MOTOR_PHASE_ERROR, self.failures.contains(FailureFlags::MOTOR_ERROR));
            alignment.set(Alignment::ENCODER_PAN, self.failures.contains(FailureFlags::ENCODER_ERROR));
        }
        SYS_STATUS_DATA {
            onboard_control_sensors_present: 0,
            onboard_control_sensors_enabled: 0,
            onboard_control_sensors_health: 0,
            load: LOAD_PERMILLE,
            voltage_battery: BATTERY_MV,
            current_battery: -1,
            battery_remaining: -1,
            drop_rate_comm: 0,
            errors_comm: 0,
            errors_count1: activity.bits(),
            errors_count2: alignment.bits(),
            errors_count3: 0,
            errors_count4: 0,
            onboard_control_sensors_present_extended: 0,
            onboard_control_sensors_enabled_extended: 0,
            onboard_control_sensors_health_extended: 0,
        }
    }

    fn raw_imu(&mut self, now: Timestamp) -> RAW_IMU_DATA {
        let pose = self.plant.measure(now);
        let (roll, pitch) = (pose.roll.radians(), pose.pitch.radians());
        // A float cast saturates.
        let gravity = |share: f64| (COUNTS_PER_G * share).round() as i16;
        let turn = |rate: AngularRate| (COUNTS_PER_DEGREE_PER_SECOND * rate.degrees_per_second()).round() as i16;
        RAW_IMU_DATA {
            time_usec: self.clock(now).as_micros() as u64,
            xacc: gravity(-pitch.sin()),
            yacc: gravity(roll.sin() * pitch.cos()),
            zacc: gravity(roll.cos() * pitch.cos()),
            xgyro: turn(pose.roll_rate),
            ygyro: turn(pose.pitch_rate),
            zgyro: turn(pose.yaw_rate),
            xmag: 0,
            ymag: 0,
            zmag: 0,
            id: 0,
            temperature: 0,
        }
    }

    fn mount_orientation(&mut self, now: Timestamp) -> MOUNT_ORIENTATION_DATA {
        let pose = self.plant.measure(now);
        let pitch = if self.settings.has_inverted_pitch { -pose.pitch } else { pose.pitch };
        MOUNT_ORIENTATION_DATA {
            time_boot_ms: self.boot_ms(now),
            roll: pose.roll.degrees() as f32,
            pitch: pitch.degrees() as f32,
            yaw: pose.yaw.wrapped().degrees() as f32,
            yaw_absolute: (pose.yaw + self.own_heading(now)).wrapped().degrees() as f32,
        }
    }

    /// The encoders. They count on through turns, and what does not fit comes back from the other side.
    fn mount_status(&mut self, now: Timestamp) -> MOUNT_STATUS_DATA {
        let pose = self.plant.measure(now);
        let per_degree = match self.encoder_type() {
            EncoderType::Counts => COUNTS_PER_DEGREE,
            EncoderType::Angle => 100.0,
        };
        let number = |angle: Angle| i32::from((angle.degrees() * per_degree).round() as i64 as i16);
        MOUNT_STATUS_DATA {
            pointing_a: number(pose.pitch),
            pointing_b: number(pose.roll),
            pointing_c: number(pose.yaw),
            target_system: 0,
            target_component: 0,
            mount_mode: if self.is_with_rc { mount_mode::RC_TARGETING } else { mount_mode::MAVLINK_TARGETING },
        }
    }

    fn information(&self, now: Timestamp) -> GIMBAL_DEVICE_INFORMATION_DATA {
        let settings = &self.settings;
        let limits = self.plant.limits();
        let (roll_min, roll_max) = telling::ends(limits.roll);
        let (pitch_min, pitch_max) = telling::ends(limits.pitch);
        let (yaw_min, yaw_max) = telling::ends(limits.yaw);
        let capabilities = CapFlags::HAS_RETRACT
            | CapFlags::HAS_NEUTRAL
            | CapFlags::HAS_ROLL_AXIS
            | CapFlags::HAS_ROLL_LOCK
            | CapFlags::HAS_PITCH_AXIS
            | CapFlags::HAS_PITCH_LOCK
            | CapFlags::HAS_YAW_AXIS
            | CapFlags::HAS_YAW_FOLLOW
            | CapFlags::HAS_YAW_LOCK;
        GIMBAL_DEVICE_INFORMATION_DATA {
            uid: 0x4752_454d,
            time_boot_ms: self.boot_ms(now),
            firmware_version: u32::from_le_bytes(settings.firmware.to_information()),
            hardware_version: 0,
            roll_min,
            roll_max,
            pitch_min,
            pitch_max,
            yaw_min,
            yaw_max,
            cap_flags: capabilities.bits() as u16,
            custom_cap_flags: 0,
            vendor_name: CharArray::from("GREMSY"),
            model_name: CharArray::from(settings.model_name.as_str()),
            custom_name: CharArray::from(""),
            gimbal_device_id: 0,
            cap_flags2: 0,
        }
    }

    fn attitude_status(&mut self, now: Timestamp) -> GIMBAL_DEVICE_ATTITUDE_STATUS_DATA {
        let pose = self.plant.measure(now);
        let told = self.heading.at(now).filter(|_| self.leans_on_autopilot());
        let heading_rate = told.map_or(AngularRate::ZERO, |(_, rate)| rate);
        let north = (self.own_heading(now), heading_rate);
        let is_locked = self.is_holding_horizon();
        let tells_frame = self.settings.firmware.tells_yaw_frame();
        let is_in_earth = if tells_frame {
            // 7.8.7 gives yaw from the vehicle's nose whatever holds it (seen on a Pixy LR: QGroundControl pull request
            // 14865).
            is_locked && told.is_some() && !self.settings.firmware.has_wrong_earth_yaw()
        } else {
            is_locked
        };
        let mut flags = telling::mode_flags(self.steering.mode());
        flags.set(GimbalFlags::YAW_LOCK, is_locked);
        flags.set(MAPPING, self.is_mapping);
        if tells_frame {
            flags.set(GimbalFlags::YAW_IN_EARTH_FRAME, is_in_earth);
            flags.set(GimbalFlags::YAW_IN_VEHICLE_FRAME, !is_in_earth);
            flags.set(GimbalFlags::ACCEPTS_YAW_IN_EARTH_FRAME, told.is_some());
        }
        let status = AttitudeStatus {
            time_boot_ms: self.boot_ms(now),
            pose,
            yaw_from: is_in_earth.then_some(north),
            delta_yaw: if tells_frame { DeltaYaw::Told(told.map(|_| north)) } else { DeltaYaw::Unused },
            flags,
            failures: self.failure_flags(now),
            target: match self.settings.status_target {
                StatusTarget::Everyone => None,
                StatusTarget::Manager => self.latch.manager(now),
            },
        };
        status.message()
    }

    fn failure_flags(&self, now: Timestamp) -> FailureFlags {
        let mut flags = telling::with_own_failures(self.failures, self.plant.at_limit(), self.latch.manager(now));
        flags.set(FailureFlags::CALIBRATION_RUNNING, self.power.is_starting(now));
        flags
    }
}
