use super::*;
use crate::geometry::{AngularRate, Attitude, EarthFrame, GimbalAngles};
use crate::gimbals::gremsy::packet;
use crate::gimbals::gremsy::status::{OperationState, SystemStatus};
use crate::gimbals::gremsy::version::FirmwareVersion;
use crate::sim::peer::Peer;
use crate::wire::dialect::{
    ATTITUDE_DATA, COMMAND_ACK_DATA, COMMAND_LONG_DATA, GIMBAL_DEVICE_ATTITUDE_STATUS_DATA, MOUNT_ORIENTATION_DATA,
    MessageData, SYS_STATUS_DATA,
};
use crate::wire::{DatagramFrames, encode_to_vec};

mod commands;
mod parameters;
mod start_up;
mod v2;

const AUTOPILOT: MavId = MavId::new(1, 1);
const MANAGER: MavId = MavId::new(1, 191);
const GCS: MavId = MavId::new(255, 190);
const GIMBAL: MavId = MavId::new(1, 154);

fn heartbeat(mavtype: u8) -> HEARTBEAT_DATA {
    HEARTBEAT_DATA { custom_mode: 0, mavtype, autopilot: 8, base_mode: 0, system_status: 4, mavlink_version: 3 }
}

/// A device on the bench: what it is told, what it says, in simulated time.
struct Bench {
    device: Device,
    now: Timestamp,
    sent: Vec<(Timestamp, Vec<u8>)>,
    /// Heading in degrees that the autopilot tells with `ATTITUDE`, 20 times a second, and how fast it turns.
    heading: Option<(f64, f64)>,
}

impl Bench {
    /// Without noise, just switched on.
    fn new(generation: Generation, change: impl FnOnce(&mut DeviceSettings)) -> Self {
        let mut settings = DeviceSettings::of(generation);
        settings.plant.noise = Angle::ZERO;
        change(&mut settings);
        Self { device: Device::new(Timestamp::ZERO, settings), now: Timestamp::ZERO, sent: Vec::new(), heading: None }
    }

    /// The same, woken by its manager and past its start-up, straight ahead.
    fn running(generation: Generation, change: impl FnOnce(&mut DeviceSettings)) -> Self {
        let mut bench = Self::new(generation, change);
        bench.run_for(2500);
        bench.hear(MANAGER, &heartbeat(mav_type::ONBOARD_CONTROLLER));
        bench.run_for(6500);
        bench
    }

    fn hear<M: MessageData>(&mut self, source: MavId, message: &M) {
        self.device.handle_received(self.now, &encode_to_vec(source, 0, message));
        self.drain();
    }

    fn drain(&mut self) {
        self.sent.extend(std::iter::from_fn(|| self.device.poll_output()).map(|bytes| (self.now, bytes)));
    }

    /// Jumps from event to event.
    fn run_for(&mut self, time: u64) {
        let until = self.now + Duration::from_millis(time);
        let tick = 50_000;
        while self.now < until {
            if let Some((heading, rate)) = &mut self.heading
                && self.now.as_micros().is_multiple_of(tick)
            {
                let message = attitude(*heading, *rate);
                *heading += *rate * 0.05;
                self.hear(AUTOPILOT, &message);
            }
            let next_tick = Timestamp::from_micros((self.now.as_micros() / tick + 1) * tick);
            let next = if self.heading.is_some() { until.min(next_tick) } else { until };
            match self.device.poll_timeout().filter(|at| *at < next) {
                Some(at) => {
                    self.now = at.max(self.now);
                    self.device.handle_timeout(self.now);
                    self.drain();
                }
                None => self.now = next,
            }
        }
        self.device.handle_timeout(self.now);
        self.drain();
    }

    fn messages<M: MessageData>(&self) -> Vec<(Timestamp, M)> {
        let decode = |bytes: &[u8]| DatagramFrames::new(bytes).next_frame().and_then(|frame| frame.decode());
        self.sent.iter().filter_map(|(at, bytes)| Some((*at, decode(bytes)?))).collect()
    }

    /// How many came since `from`.
    fn count<M: MessageData>(&self, from: Timestamp) -> usize {
        self.messages::<M>().iter().filter(|(at, _)| *at > from).count()
    }

    fn last<M: MessageData>(&self) -> M {
        self.messages::<M>().pop().expect("it was sent").1
    }

    /// Commands it and waits 30 ms for the answer: when it came, and the result.
    fn ask(&mut self, command: &COMMAND_LONG_DATA) -> Option<(u64, u8)> {
        let asked = self.now;
        self.hear(MANAGER, command);
        self.run_for(30);
        let (at, ack) = self.messages::<COMMAND_ACK_DATA>().pop().filter(|(at, _)| *at >= asked)?;
        assert_eq!((ack.command, ack.target_system, ack.target_component), (command.command, 1, 191));
        Some((at.since(asked).as_millis() as u64, ack.result))
    }

    fn accept(&mut self, command: &COMMAND_LONG_DATA) {
        let (_, result) = self.ask(command).expect("an answer");
        assert_eq!(result, 0, "{command:?}");
    }

    /// Roll, pitch and yaw of the joints in degrees, rounded to a tenth.
    fn pose(&self) -> [f64; 3] {
        let pose = self.device.plant().pose();
        [pose.roll, pose.pitch, pose.yaw].map(|angle| (angle.degrees() * 10.0).round() / 10.0 + 0.0)
    }

    fn operation(&self) -> OperationState {
        SystemStatus::from(&self.last::<SYS_STATUS_DATA>()).operation()
    }
}

fn attitude(heading: f64, rate: f64) -> ATTITUDE_DATA {
    ATTITUDE_DATA {
        time_boot_ms: 0,
        roll: 0.0,
        pitch: 0.0,
        yaw: Angle::from_degrees(heading).wrapped().radians() as f32,
        rollspeed: 0.0,
        pitchspeed: 0.0,
        yawspeed: rate.to_radians() as f32,
    }
}

/// Roll, pitch and yaw in degrees.
fn angles(roll: f64, pitch: f64, yaw: f64) -> GimbalAngles {
    let [roll, pitch, yaw] = [roll, pitch, yaw].map(Angle::from_degrees);
    GimbalAngles { roll, pitch, yaw }
}

fn rates(roll: f64, pitch: f64, yaw: f64) -> [AngularRate; 3] {
    [roll, pitch, yaw].map(AngularRate::from_degrees_per_second)
}

#[track_caller]
fn assert_near(found: f64, expected: f64, tolerance: f64) {
    assert!((found - expected).abs() <= tolerance, "{found} is not {expected} ± {tolerance}");
}
