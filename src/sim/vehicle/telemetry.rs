//! The messages a simulated autopilot sends of itself.

use std::time::Duration;

use super::flight::{self, HEIGHT_M, HOME, Motion, SPEED_MPS};
use super::{Autopilot, StateForGimbals, Vehicle};
use crate::geometry::{Angle, Attitude, EarthFrame, Position};
use crate::timestamp::Timestamp;
use crate::wire::dialect::{
    ATTITUDE_DATA, ATTITUDE_QUATERNION_DATA, ATTITUDE_TARGET_DATA, AUTOPILOT_STATE_FOR_GIMBAL_DEVICE_DATA,
    AUTOPILOT_VERSION_DATA, BATTERY_STATUS_DATA, EKF_STATUS_REPORT_DATA, ESTIMATOR_STATUS_DATA,
    EXTENDED_SYS_STATE_DATA, GLOBAL_POSITION_INT_DATA, GPS_RAW_INT_DATA, HEARTBEAT_DATA, HOME_POSITION_DATA,
    LOCAL_POSITION_NED_DATA, MISSION_CURRENT_DATA, MessageData, PROTOCOL_VERSION_DATA, RC_CHANNELS_DATA,
    SYS_STATUS_DATA, SYSTEM_TIME_DATA, VFR_HUD_DATA,
};
use crate::wire::ids::{component, mav_autopilot, mav_state, mav_type, message};

pub(super) const GPS_RAW_INT: u32 = GPS_RAW_INT_DATA::ID;
pub(super) const LOCAL_POSITION_NED: u32 = LOCAL_POSITION_NED_DATA::ID;
pub(super) const MISSION_CURRENT: u32 = MISSION_CURRENT_DATA::ID;
pub(super) const RC_CHANNELS: u32 = RC_CHANNELS_DATA::ID;
pub(super) const VFR_HUD: u32 = VFR_HUD_DATA::ID;
pub(super) const BATTERY_STATUS: u32 = BATTERY_STATUS_DATA::ID;
pub(super) const EKF_STATUS_REPORT: u32 = EKF_STATUS_REPORT_DATA::ID;
pub(super) const ESTIMATOR_STATUS: u32 = ESTIMATOR_STATUS_DATA::ID;
pub(super) const HOME_POSITION: u32 = HOME_POSITION_DATA::ID;
pub(super) const EXTENDED_SYS_STATE: u32 = EXTENDED_SYS_STATE_DATA::ID;
pub(super) const ATTITUDE_TARGET: u32 = ATTITUDE_TARGET_DATA::ID;
pub(super) const PROTOCOL_VERSION: u32 = PROTOCOL_VERSION_DATA::ID;

/// `MAV_MODE_FLAG`.
const ARMED: u8 = 128;
const STABILIZE: u8 = 16;
const GUIDED: u8 = 8;
const AUTO: u8 = 4;
const CUSTOM_MODE: u8 = 1;

/// `MAV_LANDED_STATE_IN_AIR`.
const IN_AIR: u8 = 2;

/// Attitude, velocity and position, relative and absolute, height above ground, predictions: all good.
const ESTIMATOR_FLAGS: u16 = 1 | 2 | 4 | 8 | 16 | 32 | 64 | 256 | 512;

/// `MAV_SYS_STATUS_SENSOR`: gyro, accelerometer, magnetometer, pressure, GPS, rate and attitude control, RC, AHRS,
/// battery.
const SENSORS: u32 = 1 | 2 | 4 | 8 | 32 | 1024 | 2048 | 4096 | 65_536 | 2_097_152 | 33_554_432;

/// `MAV_PROTOCOL_CAPABILITY`.
mod capability {
    pub const PARAM_FLOAT: u64 = 2;
    pub const MISSION_INT: u64 = 4;
    pub const COMMAND_INT: u64 = 8;
    pub const PARAM_ENCODE_BYTEWISE: u64 = 16;
    pub const MAVLINK2: u64 = 8192;
    pub const MISSION_FENCE: u64 = 16_384;
    pub const MISSION_RALLY: u64 = 32_768;
    pub const PARAM_ENCODE_C_CAST: u64 = 131_072;
}

/// What is sent unasked, and how many milliseconds apart; without a number, only on request.
pub(super) fn usual_streams(autopilot: Autopilot, state: StateForGimbals) -> Vec<(u32, Option<Duration>)> {
    let family = match autopilot {
        Autopilot::Px4 => (ESTIMATOR_STATUS, 500),
        Autopilot::ArduPilot => (EKF_STATUS_REPORT, 500),
    };
    let every = [
        (message::HEARTBEAT, 1000),
        (message::SYS_STATUS, 1000),
        (message::SYSTEM_TIME, 1000),
        (GPS_RAW_INT, 200),
        (message::ATTITUDE, 20),
        (message::ATTITUDE_QUATERNION, 40),
        (LOCAL_POSITION_NED, 100),
        (message::GLOBAL_POSITION_INT, 100),
        (MISSION_CURRENT, 1000),
        (RC_CHANNELS, 200),
        (VFR_HUD, 200),
        (BATTERY_STATUS, 2000),
        (HOME_POSITION, 2000),
        (EXTENDED_SYS_STATE, 1000),
        (ATTITUDE_TARGET, 100),
        family,
    ];
    let mut streams: Vec<_> = every.into_iter().map(|(id, millis)| (id, Some(Duration::from_millis(millis)))).collect();
    if state == StateForGimbals::Told {
        let interval = (autopilot == Autopilot::Px4).then_some(Duration::from_millis(50));
        streams.push((message::AUTOPILOT_STATE_FOR_GIMBAL_DEVICE, interval));
    }
    streams
}

impl Vehicle {
    /// Sends message `id`; false when it is none that it sends.
    #[expect(clippy::too_many_lines, reason = "one arm for each message, in order of their numbers")]
    pub(super) fn report(&mut self, now: Timestamp, id: u32) -> bool {
        let flown = Timestamp::ZERO + now.since(self.boot);
        let motion = flight::motion_at(flown);
        let time_boot_ms = self.clock(now).boot_ms();
        let time_usec = self.clock(now).as_micros();
        let system = self.id().system;
        let out = &mut self.line.outbox;
        match id {
            message::HEARTBEAT => {
                let heartbeat = self.heartbeat();
                self.line.outbox.send(&heartbeat);
            }
            message::SYS_STATUS => out.send(&SYS_STATUS_DATA {
                onboard_control_sensors_present: SENSORS,
                onboard_control_sensors_enabled: SENSORS,
                onboard_control_sensors_health: SENSORS,
                load: 300,
                voltage_battery: 15_800,
                current_battery: 1200,
                drop_rate_comm: 0,
                errors_comm: 0,
                errors_count1: 0,
                errors_count2: 0,
                errors_count3: 0,
                errors_count4: 0,
                battery_remaining: 80,
                onboard_control_sensors_present_extended: 0,
                onboard_control_sensors_enabled_extended: 0,
                onboard_control_sensors_health_extended: 0,
            }),
            message::SYSTEM_TIME => {
                let unix = self.settings.unix_time_us;
                let time_unix_usec = unix.map_or(0, |unix| unix + now.as_micros());
                out.send(&SYSTEM_TIME_DATA { time_unix_usec, time_boot_ms });
            }
            GPS_RAW_INT => out.send(&gps_raw_int(time_usec, &motion)),
            message::ATTITUDE => {
                let [rollspeed, pitchspeed, yawspeed] = body_rates(&motion);
                out.send(&ATTITUDE_DATA {
                    time_boot_ms,
                    roll: motion.attitude.roll.radians() as f32,
                    pitch: motion.attitude.pitch.radians() as f32,
                    yaw: motion.attitude.yaw.wrapped().radians() as f32,
                    rollspeed,
                    pitchspeed,
                    yawspeed,
                });
            }
            message::ATTITUDE_QUATERNION => {
                let [q1, q2, q3, q4] = quaternion(&motion);
                let [rollspeed, pitchspeed, yawspeed] = body_rates(&motion);
                out.send(&ATTITUDE_QUATERNION_DATA {
                    time_boot_ms,
                    q1,
                    q2,
                    q3,
                    q4,
                    rollspeed,
                    pitchspeed,
                    yawspeed,
                    repr_offset_q: [0.0; 4],
                });
            }
            ATTITUDE_TARGET => {
                let [body_roll_rate, body_pitch_rate, body_yaw_rate] = body_rates(&motion);
                out.send(&ATTITUDE_TARGET_DATA {
                    time_boot_ms,
                    q: quaternion(&motion),
                    body_roll_rate,
                    body_pitch_rate,
                    body_yaw_rate,
                    thrust: 0.45,
                    type_mask: 0,
                });
            }
            LOCAL_POSITION_NED => {
                let [x, y, z] = motion.offset_m.map(|metres| metres as f32);
                let [vx, vy, vz] = motion.velocity_mps.map(|speed| speed as f32);
                out.send(&LOCAL_POSITION_NED_DATA { time_boot_ms, x, y, z, vx, vy, vz });
            }
            message::GLOBAL_POSITION_INT => {
                let (lat, lon, alt) = degrees_and_millimetres(motion.position);
                let [vx, vy, vz] = motion.velocity_mps.map(|speed| (speed * 100.0).round() as i16);
                out.send(&GLOBAL_POSITION_INT_DATA {
                    time_boot_ms,
                    lat,
                    lon,
                    alt,
                    relative_alt: millimetres(HEIGHT_M),
                    vx,
                    vy,
                    vz,
                    hdg: centidegrees(motion.attitude.yaw),
                });
            }
            MISSION_CURRENT => out.send(&MISSION_CURRENT_DATA {
                seq: 0,
                total: 0,
                mission_state: 1,
                mission_mode: 0,
                mission_id: 0,
                fence_id: 0,
                rally_points_id: 0,
            }),
            RC_CHANNELS => out.send(&rc_channels(time_boot_ms)),
            VFR_HUD => out.send(&VFR_HUD_DATA {
                airspeed: SPEED_MPS as f32,
                groundspeed: SPEED_MPS as f32,
                alt: motion.position.altitude_m as f32,
                climb: 0.0,
                heading: (centidegrees(motion.attitude.yaw) / 100) as i16,
                throttle: 45,
            }),
            BATTERY_STATUS => out.send(&battery_status()),
            message::AUTOPILOT_VERSION => {
                let version = self.version();
                self.line.outbox.send(&version);
            }
            EKF_STATUS_REPORT => out.send(&EKF_STATUS_REPORT_DATA {
                velocity_variance: 0.02,
                pos_horiz_variance: 0.02,
                pos_vert_variance: 0.02,
                compass_variance: 0.02,
                terrain_alt_variance: 0.0,
                flags: ESTIMATOR_FLAGS,
                airspeed_variance: 0.0,
            }),
            ESTIMATOR_STATUS => out.send(&ESTIMATOR_STATUS_DATA {
                time_usec,
                vel_ratio: 0.02,
                pos_horiz_ratio: 0.02,
                pos_vert_ratio: 0.02,
                mag_ratio: 0.02,
                hagl_ratio: 0.02,
                tas_ratio: 0.02,
                pos_horiz_accuracy: 0.5,
                pos_vert_accuracy: 0.5,
                flags: ESTIMATOR_FLAGS,
            }),
            HOME_POSITION => {
                let (latitude, longitude, altitude) = degrees_and_millimetres(HOME);
                out.send(&HOME_POSITION_DATA {
                    latitude,
                    longitude,
                    altitude,
                    x: 0.0,
                    y: 0.0,
                    z: 0.0,
                    q: [1.0, 0.0, 0.0, 0.0],
                    approach_x: f32::NAN,
                    approach_y: f32::NAN,
                    approach_z: f32::NAN,
                    time_usec,
                });
            }
            EXTENDED_SYS_STATE => out.send(&EXTENDED_SYS_STATE_DATA { vtol_state: 0, landed_state: IN_AIR }),
            message::AUTOPILOT_STATE_FOR_GIMBAL_DEVICE => {
                let state = state_for_gimbals(self.settings.autopilot, system, time_usec, &motion);
                out.send(&state);
            }
            PROTOCOL_VERSION => out.send(&PROTOCOL_VERSION_DATA {
                version: 200,
                min_version: 100,
                max_version: 200,
                spec_version_hash: [0; 8],
                library_version_hash: [0; 8],
            }),
            message::GIMBAL_MANAGER_SET_PITCHYAW => return self.demand_of_client(now),
            id => return self.report_of_mount(now, id),
        }
        true
    }

    fn heartbeat(&self) -> HEARTBEAT_DATA {
        let (autopilot, mode) = match self.settings.autopilot {
            Autopilot::Px4 => (mav_autopilot::PX4, STABILIZE | GUIDED | AUTO | CUSTOM_MODE),
            Autopilot::ArduPilot => (mav_autopilot::ARDUPILOTMEGA, STABILIZE | GUIDED | CUSTOM_MODE),
        };
        HEARTBEAT_DATA {
            custom_mode: self.custom_mode,
            mavtype: mav_type::QUADROTOR,
            autopilot,
            base_mode: mode | if self.is_armed { ARMED } else { 0 },
            system_status: mav_state::ACTIVE,
            mavlink_version: 3,
        }
    }

    fn version(&self) -> AUTOPILOT_VERSION_DATA {
        let always = capability::MISSION_INT
            | capability::COMMAND_INT
            | capability::MAVLINK2
            | capability::MISSION_FENCE
            | capability::MISSION_RALLY;
        // Versions 1.16.0 and 4.6.0, both official releases.
        let (parameters, flight_sw_version) = match self.settings.autopilot {
            Autopilot::Px4 => (capability::PARAM_ENCODE_BYTEWISE, 0x0110_00ff),
            Autopilot::ArduPilot => (capability::PARAM_FLOAT | capability::PARAM_ENCODE_C_CAST, 0x0406_00ff),
        };
        AUTOPILOT_VERSION_DATA {
            capabilities: always | parameters,
            uid: 0x5349_4d56 + u64::from(self.id().system),
            flight_sw_version,
            middleware_sw_version: 0,
            os_sw_version: 0,
            board_version: 0,
            vendor_id: 0,
            product_id: 0,
            flight_custom_version: [0; 8],
            middleware_custom_version: [0; 8],
            os_custom_version: [0; 8],
            uid2: [0; 18],
        }
    }
}

/// PX4 addresses everybody and leaves the yaw rate unknown; ArduPilot addresses its own system and tells no landed
/// state (both observed on their simulators).
fn state_for_gimbals(
    autopilot: Autopilot,
    system: u8,
    time_boot_us: u64,
    motion: &Motion,
) -> AUTOPILOT_STATE_FOR_GIMBAL_DEVICE_DATA {
    let heading_rate = motion.heading_rate.radians_per_second() as f32;
    let (target_system, landed_state, angular_velocity_z) = match autopilot {
        Autopilot::Px4 => (0, IN_AIR, 0.0),
        Autopilot::ArduPilot => (system, 0, heading_rate),
    };
    let time_boot_us = match autopilot {
        Autopilot::Px4 => time_boot_us,
        // A counter of 32 bits, widened.
        Autopilot::ArduPilot => time_boot_us & u64::from(u32::MAX),
    };
    let [vx, vy, vz] = motion.velocity_mps.map(|speed| speed as f32);
    AUTOPILOT_STATE_FOR_GIMBAL_DEVICE_DATA {
        time_boot_us,
        q: quaternion(motion),
        q_estimated_delay_us: 0,
        vx,
        vy,
        vz,
        v_estimated_delay_us: 0,
        feed_forward_angular_velocity_z: heading_rate,
        estimator_status: ESTIMATOR_FLAGS,
        target_system,
        target_component: 0,
        landed_state,
        angular_velocity_z,
    }
}

fn gps_raw_int(time_usec: u64, motion: &Motion) -> GPS_RAW_INT_DATA {
    let (lat, lon, alt) = degrees_and_millimetres(motion.position);
    GPS_RAW_INT_DATA {
        time_usec,
        lat,
        lon,
        alt,
        eph: 70,
        epv: 110,
        vel: (SPEED_MPS * 100.0).round() as u16,
        // The nose points along the track.
        cog: centidegrees(motion.attitude.yaw),
        fix_type: 3,
        satellites_visible: 14,
        alt_ellipsoid: alt + 47_000,
        h_acc: 500,
        v_acc: 800,
        vel_acc: 100,
        hdg_acc: 0,
        yaw: 0,
    }
}

fn rc_channels(time_boot_ms: u32) -> RC_CHANNELS_DATA {
    const CENTRE: u16 = 1500;
    const UNUSED: u16 = u16::MAX;
    RC_CHANNELS_DATA {
        time_boot_ms,
        chan1_raw: CENTRE,
        chan2_raw: CENTRE,
        chan3_raw: CENTRE,
        chan4_raw: CENTRE,
        chan5_raw: CENTRE,
        chan6_raw: CENTRE,
        chan7_raw: CENTRE,
        chan8_raw: CENTRE,
        chan9_raw: UNUSED,
        chan10_raw: UNUSED,
        chan11_raw: UNUSED,
        chan12_raw: UNUSED,
        chan13_raw: UNUSED,
        chan14_raw: UNUSED,
        chan15_raw: UNUSED,
        chan16_raw: UNUSED,
        chan17_raw: UNUSED,
        chan18_raw: UNUSED,
        chancount: 8,
        rssi: 200,
    }
}

fn battery_status() -> BATTERY_STATUS_DATA {
    const NO_CELL: u16 = u16::MAX;
    let mut voltages = [NO_CELL; 10];
    voltages[..4].fill(3950);
    BATTERY_STATUS_DATA {
        current_consumed: 900,
        energy_consumed: -1,
        temperature: i16::MAX,
        voltages,
        current_battery: 1200,
        id: 0,
        battery_function: 0,
        mavtype: 0,
        battery_remaining: 80,
        time_remaining: 0,
        charge_state: 1,
        voltages_ext: [0; 4],
        mode: 0,
        fault_bitmask: 0,
    }
}

fn quaternion(motion: &Motion) -> [f32; 4] {
    Attitude::<EarthFrame>::from_aircraft_angles(motion.attitude).to_wxyz()
}

fn body_rates(motion: &Motion) -> [f32; 3] {
    motion.body_rates.map(|rate| rate.radians_per_second() as f32)
}

/// Latitude and longitude in 1e-7 degrees, altitude in millimetres.
fn degrees_and_millimetres(position: Position) -> (i32, i32, i32) {
    let scaled = |degrees: f64| (degrees * 1e7).round() as i32;
    (scaled(position.latitude_deg), scaled(position.longitude_deg), millimetres(position.altitude_m))
}

fn millimetres(metres: f64) -> i32 {
    (metres * 1000.0).round() as i32
}

/// From 0 to 35,999.
fn centidegrees(heading: Angle) -> u16 {
    ((heading.degrees() * 100.0).round() as i64).rem_euclid(36_000) as u16
}

/// The component an autopilot is.
pub(super) const COMPONENT: u8 = component::AUTOPILOT1;
