use super::*;
use crate::geometry::{AircraftAngles, AngularRate, Attitude, AxisLimits, EarthFrame, GimbalAngles, Limits};
use crate::sim::peer::Peer;
use crate::sim::plant::PlantSettings;
use crate::wire::dialect::{
    ATTITUDE_DATA, AUTOPILOT_STATE_FOR_GIMBAL_DEVICE_DATA, COMMAND_ACK_DATA, COMMAND_LONG_DATA, CharArray,
    GIMBAL_DEVICE_ATTITUDE_STATUS_DATA, GIMBAL_DEVICE_INFORMATION_DATA, GIMBAL_DEVICE_SET_ATTITUDE_DATA,
    MESSAGE_INTERVAL_DATA, MessageData, PARAM_REQUEST_LIST_DATA, PARAM_VALUE_DATA,
};
use crate::wire::ids::GimbalFlags;
use crate::wire::{DatagramFrames, encode_to_vec};

mod discovery;
mod manager;
mod pointing;
mod status;
mod tester;

const AUTOPILOT: MavId = MavId::new(1, 1);
const MANAGER: MavId = MavId::new(1, 191);
const GCS: MavId = MavId::new(255, 190);

fn millis(millis: u64) -> Timestamp {
    Timestamp::from_millis(millis)
}

/// A device on the bench: what it is told, what it says, in simulated time.
struct Bench {
    device: Device,
    now: Timestamp,
    sent: Vec<(Timestamp, Vec<u8>)>,
    /// Heading in degrees that the autopilot tells with 286, 20 times a second, and how fast it turns.
    heading: Option<(f64, f64)>,
}

impl Bench {
    /// Without noise, and speaking from the start.
    fn new(change: impl FnOnce(&mut DeviceSettings)) -> Self {
        let mut settings = quiet();
        settings.listens_first = Some(Duration::ZERO);
        change(&mut settings);
        Self { device: Device::new(Timestamp::ZERO, settings), now: Timestamp::ZERO, sent: Vec::new(), heading: None }
    }

    fn hear<M: MessageData>(&mut self, source: MavId, message: &M) {
        self.device.handle_received(self.now, &encode_to_vec(source, 0, message));
        self.drain();
    }

    fn drain(&mut self) {
        self.sent.extend(std::iter::from_fn(|| self.device.poll_output()).map(|bytes| (self.now, bytes)));
    }

    /// Jumps from event to event.
    fn run_until(&mut self, until: Timestamp) {
        let step = Duration::from_millis(50);
        while self.now < until {
            let mut next = until;
            if let Some((heading, rate)) = &mut self.heading
                && self.now.as_micros().is_multiple_of(50_000)
            {
                let state = state(*heading);
                *heading += *rate * step.as_secs_f64();
                self.hear(AUTOPILOT, &state);
            }
            if self.heading.is_some() {
                let tick = step.as_micros() as u64;
                next = next.min(Timestamp::from_micros((self.now.as_micros() / tick + 1) * tick));
            }
            if let Some(at) = self.device.poll_timeout().filter(|at| *at < next) {
                self.now = at.max(self.now);
                self.device.handle_timeout(self.now);
                self.drain();
            } else {
                self.now = next;
            }
        }
        self.device.handle_timeout(self.now);
        self.drain();
    }

    fn run_for(&mut self, millis: u64) {
        self.run_until(self.now + Duration::from_millis(millis));
    }

    /// Sends the setpoint 20 times a second for so long.
    fn stream(&mut self, source: MavId, setpoint: &GIMBAL_DEVICE_SET_ATTITUDE_DATA, millis: u64) {
        let until = self.now + Duration::from_millis(millis);
        while self.now < until {
            self.hear(source, setpoint);
            self.run_for(50);
        }
    }

    /// What was sent since the last time of asking.
    fn take<M: MessageData>(&mut self) -> Vec<(Timestamp, M)> {
        let mut found = Vec::new();
        for (at, bytes) in &self.sent {
            let frame = DatagramFrames::new(bytes).next_frame().expect("the device sends frames");
            assert_eq!(frame.source(), self.device.id());
            found.extend(frame.decode().map(|message| (*at, message)));
        }
        self.sent.clear();
        found
    }

    /// The first of its kind since the last time of asking; what was sent stays.
    fn first<M: MessageData>(&self) -> (Timestamp, M) {
        let read = |bytes: &[u8]| DatagramFrames::new(bytes).next_frame().and_then(|frame| frame.decode());
        self.sent.iter().find_map(|(at, bytes)| Some((*at, read(bytes)?))).expect("it was sent")
    }

    fn names(&mut self) -> Vec<&'static str> {
        let name = |(_, bytes): (Timestamp, Vec<u8>)| DatagramFrames::new(&bytes).next_frame().expect("a frame").name();
        std::mem::take(&mut self.sent).into_iter().map(name).collect()
    }

    fn status(&mut self) -> Status {
        self.sent.clear();
        self.hear(GCS, &request(message::GIMBAL_DEVICE_ATTITUDE_STATUS, 1, 154));
        let (_, status) = self.take::<GIMBAL_DEVICE_ATTITUDE_STATUS_DATA>().pop().expect("it answers");
        Status::from(&status)
    }
}

/// The default settings without noise.
fn quiet() -> DeviceSettings {
    let default = DeviceSettings::default();
    DeviceSettings { plant: PlantSettings { noise: Angle::ZERO, ..default.plant.clone() }, ..default }
}

/// `GIMBAL_DEVICE_ATTITUDE_STATUS` for people: degrees.
#[derive(Debug)]
struct Status {
    pitch: f64,
    yaw: f64,
    roll: f64,
    flags: GimbalFlags,
    failures: FailureFlags,
    delta_yaw: f64,
    yaw_rate: f64,
}

impl From<&GIMBAL_DEVICE_ATTITUDE_STATUS_DATA> for Status {
    fn from(status: &GIMBAL_DEVICE_ATTITUDE_STATUS_DATA) -> Self {
        let attitude = Attitude::<EarthFrame>::from_wxyz(status.q).expect("valid").expect("known");
        let angles = attitude.gimbal_angles();
        Self {
            pitch: angles.pitch.degrees(),
            yaw: angles.yaw.degrees(),
            roll: angles.roll.degrees(),
            flags: GimbalFlags::from_bits_retain(status.flags),
            failures: FailureFlags::from_bits_retain(status.failure_flags),
            delta_yaw: f64::from(status.delta_yaw).to_degrees(),
            yaw_rate: f64::from(status.angular_velocity_z).to_degrees(),
        }
    }
}

#[track_caller]
fn assert_near(actual: f64, expected: f64, tolerance: f64) {
    assert!((actual - expected).abs() <= tolerance, "{actual} is not {expected} ± {tolerance}");
}

fn heartbeat(mavtype: u8, autopilot: u8) -> HEARTBEAT_DATA {
    HEARTBEAT_DATA { custom_mode: 0, mavtype, autopilot, base_mode: 0, system_status: 4, mavlink_version: 3 }
}

fn command(number: u16, params: [f32; 2], target_system: u8, target_component: u8) -> COMMAND_LONG_DATA {
    COMMAND_LONG_DATA {
        target_system,
        target_component,
        command: number,
        confirmation: 0,
        param1: params[0],
        param2: params[1],
        param3: 0.0,
        param4: 0.0,
        param5: 0.0,
        param6: 0.0,
        param7: 0.0,
    }
}

fn request(id: u32, system: u8, component: u8) -> COMMAND_LONG_DATA {
    command(command::REQUEST_MESSAGE, [id as f32, 0.0], system, component)
}

const NAN: f32 = f32::NAN;

/// Angles in degrees, without rates.
fn angles(flags: GimbalFlags, pitch: f64, yaw: f64) -> GIMBAL_DEVICE_SET_ATTITUDE_DATA {
    angles_at(flags, pitch, yaw, [NAN; 3])
}

/// Angles in degrees, rates about roll, pitch and yaw in degrees per second.
fn angles_at(flags: GimbalFlags, pitch: f64, yaw: f64, rates: [f32; 3]) -> GIMBAL_DEVICE_SET_ATTITUDE_DATA {
    let angles = GimbalAngles { roll: Angle::ZERO, pitch: Angle::from_degrees(pitch), yaw: Angle::from_degrees(yaw) };
    let q = Attitude::<EarthFrame>::from_gimbal_angles(angles).to_wxyz();
    GIMBAL_DEVICE_SET_ATTITUDE_DATA { q, ..rates_only(flags, rates) }
}

fn rates_only(flags: GimbalFlags, rates: [f32; 3]) -> GIMBAL_DEVICE_SET_ATTITUDE_DATA {
    let [x, y, z] = rates.map(f32::to_radians);
    GIMBAL_DEVICE_SET_ATTITUDE_DATA {
        target_system: 1,
        target_component: 154,
        flags: flags.bits(),
        q: [NAN; 4],
        angular_velocity_x: x,
        angular_velocity_y: y,
        angular_velocity_z: z,
    }
}

const LEVEL: GimbalFlags = GimbalFlags::ROLL_LOCK.union(GimbalFlags::PITCH_LOCK);
const FOLLOW: GimbalFlags = LEVEL.union(GimbalFlags::YAW_IN_VEHICLE_FRAME);
const LOCK: GimbalFlags = LEVEL.union(GimbalFlags::YAW_LOCK).union(GimbalFlags::YAW_IN_EARTH_FRAME);

fn state(heading: f64) -> AUTOPILOT_STATE_FOR_GIMBAL_DEVICE_DATA {
    let angles =
        AircraftAngles { roll: Angle::from_degrees(3.0), pitch: Angle::ZERO, yaw: Angle::from_degrees(heading) };
    AUTOPILOT_STATE_FOR_GIMBAL_DEVICE_DATA {
        time_boot_us: 0,
        q: Attitude::<EarthFrame>::from_aircraft_angles(angles).to_wxyz(),
        q_estimated_delay_us: 0,
        vx: NAN,
        vy: NAN,
        vz: NAN,
        v_estimated_delay_us: 0,
        feed_forward_angular_velocity_z: NAN,
        estimator_status: 831,
        target_system: 0,
        target_component: 0,
        landed_state: 2,
        angular_velocity_z: 0.0,
    }
}

fn manager_status(gimbal_device_id: u8) -> GIMBAL_MANAGER_STATUS_DATA {
    GIMBAL_MANAGER_STATUS_DATA {
        time_boot_ms: 0,
        flags: 0,
        gimbal_device_id,
        primary_control_sysid: 0,
        primary_control_compid: 0,
        secondary_control_sysid: 0,
        secondary_control_compid: 0,
    }
}
