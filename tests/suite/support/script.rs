//! What scripted peers say, and what they are answered.

use std::time::Duration;

use gimbald::geometry::{Angle, Attitude, GimbalAngles, VehicleFrame};
use gimbald::timestamp::Timestamp;
use gimbald::wire::MavId;
use gimbald::wire::dialect::{
    AUTOPILOT_STATE_FOR_GIMBAL_DEVICE_DATA, COMMAND_ACK_DATA, COMMAND_INT_DATA, COMMAND_LONG_DATA, CharArray,
    GIMBAL_DEVICE_ATTITUDE_STATUS_DATA, GIMBAL_DEVICE_INFORMATION_DATA, GIMBAL_MANAGER_SET_ATTITUDE_DATA,
    GIMBAL_MANAGER_SET_MANUAL_CONTROL_DATA, GIMBAL_MANAGER_SET_PITCHYAW_DATA, GLOBAL_POSITION_INT_DATA,
    MOUNT_CONFIGURE_DATA, MOUNT_CONTROL_DATA, MavMessage,
};
use gimbald::wire::ids::CapFlags;

use super::world::{Arrival, MANAGER, Place, World, heartbeat};

pub const NAN: f32 = f32::NAN;

pub const ACCEPTED: u8 = 0;
pub const TEMPORARILY_REJECTED: u8 = 1;
pub const DENIED: u8 = 2;
pub const UNSUPPORTED: u8 = 3;
pub const FAILED: u8 = 4;
pub const UNSUPPORTED_MAV_FRAME: u8 = 9;

/// What usual devices can do.
pub fn usual_capabilities() -> CapFlags {
    CapFlags::HAS_RETRACT
        | CapFlags::HAS_NEUTRAL
        | CapFlags::HAS_ROLL_AXIS
        | CapFlags::HAS_ROLL_LOCK
        | CapFlags::HAS_PITCH_AXIS
        | CapFlags::HAS_PITCH_LOCK
        | CapFlags::HAS_YAW_AXIS
        | CapFlags::HAS_YAW_FOLLOW
        | CapFlags::HAS_YAW_LOCK
}

/// `MAV_TYPE` 26 as a gimbal sends it, with `MAV_AUTOPILOT_INVALID`.
pub fn gimbal_heartbeat() -> MavMessage {
    heartbeat(26, 8)
}

pub fn ground_heartbeat() -> MavMessage {
    heartbeat(6, 8)
}

/// A multicopter of ArduPilot.
pub fn ardupilot_heartbeat() -> MavMessage {
    heartbeat(2, 3)
}

/// A multicopter of PX4.
pub fn px4_heartbeat() -> MavMessage {
    heartbeat(2, 12)
}

/// `COMMAND_LONG` with parameters 1 to 7; those left out are NaN.
pub fn command_long(target: MavId, command: u16, params: &[f32]) -> MavMessage {
    let param = |number: usize| params.get(number - 1).copied().unwrap_or(NAN);
    MavMessage::COMMAND_LONG(COMMAND_LONG_DATA {
        param1: param(1),
        param2: param(2),
        param3: param(3),
        param4: param(4),
        param5: param(5),
        param6: param(6),
        param7: param(7),
        command,
        target_system: target.system,
        target_component: target.component,
        confirmation: 0,
    })
}

/// `DO_SET_ROI_LOCATION` as `COMMAND_INT` to the first manager for its device: degrees, and metres in `frame`.
pub fn roi_location(frame: u8, [latitude, longitude]: [f64; 2], altitude: f32) -> MavMessage {
    let scaled = |degrees: f64| (degrees * 1e7).round() as i32;
    in_frame(frame, command_int(MANAGER, 195, [154.0, NAN, NAN, NAN], scaled(latitude), scaled(longitude), altitude))
}

/// The same command in another frame.
pub fn in_frame(frame: u8, command: MavMessage) -> MavMessage {
    match command {
        MavMessage::COMMAND_INT(command) => MavMessage::COMMAND_INT(COMMAND_INT_DATA { frame, ..command }),
        other => panic!("{other:?} has no frame"),
    }
}

/// The same command to another component.
pub fn to(target: MavId, command: MavMessage) -> MavMessage {
    let (target_system, target_component) = (target.system, target.component);
    match command {
        MavMessage::COMMAND_INT(command) => {
            MavMessage::COMMAND_INT(COMMAND_INT_DATA { target_system, target_component, ..command })
        }
        MavMessage::COMMAND_LONG(command) => {
            MavMessage::COMMAND_LONG(COMMAND_LONG_DATA { target_system, target_component, ..command })
        }
        other => panic!("{other:?} is no command"),
    }
}

/// The same command, sent `confirmation` times before.
pub fn again(confirmation: u8, command: MavMessage) -> MavMessage {
    match command {
        MavMessage::COMMAND_LONG(command) => MavMessage::COMMAND_LONG(COMMAND_LONG_DATA { confirmation, ..command }),
        other => panic!("{other:?} does not count"),
    }
}

/// `GLOBAL_POSITION_INT` at degrees and metres above mean sea level, without a heading.
pub fn global_position(at: Timestamp, [latitude, longitude, amsl]: [f64; 3], above_home: f64) -> MavMessage {
    MavMessage::GLOBAL_POSITION_INT(GLOBAL_POSITION_INT_DATA {
        time_boot_ms: at.boot_ms(),
        lat: (latitude * 1e7).round() as i32,
        lon: (longitude * 1e7).round() as i32,
        alt: (amsl * 1e3).round() as i32,
        relative_alt: (above_home * 1e3).round() as i32,
        vx: 0,
        vy: 0,
        vz: 0,
        hdg: u16::MAX,
    })
}

/// `COMMAND_INT` in frame 3 with parameters 1 to 4.
pub fn command_int(target: MavId, command: u16, params: [f32; 4], x: i32, y: i32, z: f32) -> MavMessage {
    let [param1, param2, param3, param4] = params;
    MavMessage::COMMAND_INT(COMMAND_INT_DATA {
        param1,
        param2,
        param3,
        param4,
        x,
        y,
        z,
        command,
        target_system: target.system,
        target_component: target.component,
        frame: 3,
        current: 0,
        autocontinue: 0,
    })
}

/// `DO_GIMBAL_MANAGER_CONFIGURE` to the first manager for its device.
pub fn configure(primary: [f32; 2], secondary: [f32; 2]) -> MavMessage {
    let params = [primary[0], primary[1], secondary[0], secondary[1], NAN, NAN, 154.0];
    command_long(MANAGER, 1001, &params)
}

/// The sender takes primary control, by −2.
pub fn take_control() -> MavMessage {
    configure([-2.0, -2.0], [-1.0, -1.0])
}

/// `DO_GIMBAL_MANAGER_PITCHYAW` to the first manager for its device; degrees, degrees per second.
pub fn pitchyaw(pitch: f32, yaw: f32, pitch_rate: f32, yaw_rate: f32, flags: f32) -> MavMessage {
    command_long(MANAGER, 1000, &[pitch, yaw, pitch_rate, yaw_rate, flags, 0.0, 154.0])
}

/// `MOUNT_CONFIGURE`, which older programs send instead of a command.
pub fn mount_configure(target: MavId, mount_mode: u8) -> MavMessage {
    MavMessage::MOUNT_CONFIGURE(MOUNT_CONFIGURE_DATA {
        target_system: target.system,
        target_component: target.component,
        mount_mode,
        stab_roll: 1,
        stab_pitch: 1,
        stab_yaw: 1,
    })
}

/// `MOUNT_CONTROL`: pitch, roll and yaw in hundredths of a degree, or a place.
pub fn mount_control(target: MavId, [input_a, input_b, input_c]: [i32; 3]) -> MavMessage {
    MavMessage::MOUNT_CONTROL(MOUNT_CONTROL_DATA {
        target_system: target.system,
        target_component: target.component,
        input_a,
        input_b,
        input_c,
        save_position: 0,
    })
}

/// `REQUEST_MESSAGE`.
pub fn request_message(target: MavId, message_id: u32) -> MavMessage {
    command_long(target, 512, &[message_id as f32, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
}

/// `SET_MESSAGE_INTERVAL`, microseconds.
pub fn set_interval(target: MavId, message_id: u32, interval_us: f32) -> MavMessage {
    command_long(target, 511, &[message_id as f32, interval_us, 0.0, 0.0, 0.0, 0.0, 0.0])
}

/// `GIMBAL_MANAGER_SET_PITCHYAW` to the first manager; radians, radians per second.
pub fn set_pitchyaw(pitch: f32, yaw: f32, pitch_rate: f32, yaw_rate: f32, flags: u32) -> MavMessage {
    MavMessage::GIMBAL_MANAGER_SET_PITCHYAW(GIMBAL_MANAGER_SET_PITCHYAW_DATA {
        flags,
        pitch,
        yaw,
        pitch_rate,
        yaw_rate,
        target_system: MANAGER.system,
        target_component: MANAGER.component,
        gimbal_device_id: 0,
    })
}

/// `GIMBAL_MANAGER_SET_ATTITUDE` to the first manager.
pub fn set_attitude(q: [f32; 4], rates: [f32; 3], flags: u32) -> MavMessage {
    MavMessage::GIMBAL_MANAGER_SET_ATTITUDE(GIMBAL_MANAGER_SET_ATTITUDE_DATA {
        flags,
        q,
        angular_velocity_x: rates[0],
        angular_velocity_y: rates[1],
        angular_velocity_z: rates[2],
        target_system: MANAGER.system,
        target_component: MANAGER.component,
        gimbal_device_id: 0,
    })
}

/// `GIMBAL_MANAGER_SET_MANUAL_CONTROL` to the first manager; −1 to 1.
pub fn set_manual_control(pitch: f32, yaw: f32, pitch_rate: f32, yaw_rate: f32) -> MavMessage {
    MavMessage::GIMBAL_MANAGER_SET_MANUAL_CONTROL(GIMBAL_MANAGER_SET_MANUAL_CONTROL_DATA {
        flags: 44,
        pitch,
        yaw,
        pitch_rate,
        yaw_rate,
        target_system: MANAGER.system,
        target_component: MANAGER.component,
        gimbal_device_id: 0,
    })
}

/// `GIMBAL_DEVICE_INFORMATION` of a device with limits of ±0.5, −1.5…0.5 and ±2 rad.
pub fn device_information(at: Timestamp, capabilities: CapFlags) -> GIMBAL_DEVICE_INFORMATION_DATA {
    GIMBAL_DEVICE_INFORMATION_DATA {
        uid: 1,
        time_boot_ms: at.boot_ms(),
        firmware_version: 1,
        hardware_version: 1,
        roll_min: -0.5,
        roll_max: 0.5,
        pitch_min: -1.5,
        pitch_max: 0.5,
        yaw_min: -2.0,
        yaw_max: 2.0,
        custom_cap_flags: 0,
        cap_flags: capabilities.bits() as u16,
        vendor_name: CharArray::from("Acme"),
        model_name: CharArray::from("Scripted"),
        custom_name: CharArray::from(""),
        gimbal_device_id: 0,
        cap_flags2: 0,
    }
}

/// `GIMBAL_DEVICE_ATTITUDE_STATUS` with these flags and angles in degrees, at rest, level, `delta_yaw` unknown.
pub fn device_status(at: Timestamp, flags: u16, pitch_deg: f64, yaw_deg: f64) -> GIMBAL_DEVICE_ATTITUDE_STATUS_DATA {
    GIMBAL_DEVICE_ATTITUDE_STATUS_DATA {
        time_boot_ms: at.boot_ms(),
        q: quaternion(pitch_deg, yaw_deg),
        angular_velocity_x: 0.0,
        angular_velocity_y: 0.0,
        angular_velocity_z: 0.0,
        failure_flags: 0,
        flags,
        target_system: 0,
        target_component: 0,
        delta_yaw: NAN,
        delta_yaw_velocity: NAN,
        gimbal_device_id: 0,
    }
}

/// A level camera's attitude as a quaternion, w first.
pub fn quaternion(pitch_deg: f64, yaw_deg: f64) -> [f32; 4] {
    let degrees = Angle::from_degrees;
    let angles = GimbalAngles { roll: Angle::ZERO, pitch: degrees(pitch_deg), yaw: degrees(yaw_deg) };
    Attitude::<VehicleFrame>::from_gimbal_angles(angles).to_wxyz()
}

/// Roll, pitch and yaw of a quaternion, degrees.
pub fn roll_pitch_yaw_deg(q: [f32; 4]) -> [f64; 3] {
    let attitude: Attitude<VehicleFrame> = Attitude::from_wxyz(q).expect("well formed").expect("a number");
    let angles = attitude.gimbal_angles();
    [angles.roll, angles.pitch, angles.yaw].map(Angle::degrees)
}

/// Pitch and yaw of a quaternion, degrees.
pub fn pitch_yaw_deg(q: [f32; 4]) -> (f64, f64) {
    let [_, pitch, yaw] = roll_pitch_yaw_deg(q);
    (pitch, yaw)
}

/// `AUTOPILOT_STATE_FOR_GIMBAL_DEVICE` to `target`, on a vehicle that looks to `heading_deg`.
pub fn autopilot_state(at: Timestamp, target: MavId, heading_deg: f64) -> AUTOPILOT_STATE_FOR_GIMBAL_DEVICE_DATA {
    AUTOPILOT_STATE_FOR_GIMBAL_DEVICE_DATA {
        time_boot_us: at.as_micros(),
        q: quaternion(0.0, heading_deg),
        q_estimated_delay_us: 0,
        vx: 0.0,
        vy: 0.0,
        vz: 0.0,
        v_estimated_delay_us: 0,
        feed_forward_angular_velocity_z: NAN,
        estimator_status: 0,
        target_system: target.system,
        target_component: target.component,
        landed_state: 2,
        angular_velocity_z: 0.25,
    }
}

/// The answer of the first manager to `to`.
pub fn ack(to: MavId, command: u16, result: u8) -> COMMAND_ACK_DATA {
    COMMAND_ACK_DATA {
        command,
        result,
        progress: 255,
        result_param2: 0,
        target_system: to.system,
        target_component: to.component,
    }
}

impl World {
    /// Says something and gives what arrives there in the same moment; what arrives elsewhere can be taken after it.
    pub fn ask(&mut self, from: Place, source: MavId, message: &MavMessage) -> Vec<Arrival> {
        self.forget();
        self.send(from, source, message);
        self.take(from)
    }

    /// Sends a command and gives the result of its one answer, `None` without an answer.
    pub fn result_of(&mut self, from: Place, source: MavId, message: &MavMessage) -> Option<u8> {
        let number = match message {
            MavMessage::COMMAND_LONG(command) => command.command,
            MavMessage::COMMAND_INT(command) => command.command,
            other => panic!("{other:?} is no command"),
        };
        let answers = self.ask(from, source, message);
        let acks: Vec<COMMAND_ACK_DATA> = of(&answers);
        assert!(acks.len() <= 1, "answered more than once: {acks:?}");
        let ack_received = acks.first()?;
        assert_eq!(*ack_received, ack(source, number, ack_received.result));
        Some(ack_received.result)
    }

    /// Runs on while `messages` are sent again and again, those whose time it is first.
    pub fn run_with(&mut self, duration: Duration, repeated: &[(Duration, Place, MavId, MavMessage)]) {
        let end = self.now + duration;
        let mut due: Vec<Timestamp> = repeated.iter().map(|_| self.now).collect();
        while let Some((at, next)) = due.iter().copied().enumerate().min_by_key(|(_, next)| *next)
            && next < end
        {
            self.run_for(next - self.now);
            let (every, place, source, message) = &repeated[at];
            self.send(*place, *source, message);
            due[at] += *every;
        }
        self.run_for(end - self.now);
    }
}

/// The messages of one type among what arrived.
pub fn of<M: gimbald::wire::dialect::MessageData>(arrivals: &[Arrival]) -> Vec<M> {
    arrivals.iter().filter(|arrival| arrival.id() == M::ID).map(Arrival::decode).collect()
}

/// The ids of what arrived, in order.
pub fn ids(arrivals: &[Arrival]) -> Vec<u32> {
    arrivals.iter().map(Arrival::id).collect()
}
