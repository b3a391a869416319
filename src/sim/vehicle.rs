//! A simulated autopilot, circling, that QGroundControl and MAVSDK take for a vehicle.
//!
//! It sends what PX4 or ArduPilot sends at similar rates, and answers what a ground station asks before it shows a
//! vehicle: version, parameters, mission, fence and rally points. It drives no gimbal unless it is told to, as ArduPilot
//! drives a gimbal device (`mount`), or as PX4 asks a gimbal manager (`manager_client`).

mod answers;
mod flight;
mod manager_client;
mod mount;
mod parameters;
mod telemetry;

use std::time::Duration;

pub use manager_client::ClientVersion;

pub use flight::{HEIGHT_M, HOME, Motion, RADIUS_M, SPEED_MPS};

use manager_client::ManagerClient;
use mount::Mount;

use crate::sim::component::{Component, Line};
use crate::sim::parameters::{ParameterServer, ParameterValue};
use crate::sim::peer::PlatformMotion;
use crate::sim::streams::Streams;
use crate::timestamp::Timestamp;
use crate::wire::ids::message;
use crate::wire::{Frame, MavId};

/// Which autopilot a simulated vehicle has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Autopilot {
    Px4,
    ArduPilot,
}

/// What it does about `AUTOPILOT_STATE_FOR_GIMBAL_DEVICE`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StateForGimbals {
    /// PX4 streams it and ArduPilot sends it when asked.
    Told,
    /// It does not know it, and says so.
    Denied,
    /// It does not answer a request for it.
    Ignored,
    /// It accepts a request for it and sends nothing, as ArduPilot does with other messages.
    Promised,
}

/// How it drives a gimbal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GimbalOutput {
    None,
    /// ArduPilot with `MNT1_TYPE` 6: a gimbal device of its own.
    Device,
    /// PX4 with `MNT_MODE_OUT` 3: through an external manager.
    Manager(ClientVersion),
}

/// Everything that differs from one simulated vehicle to another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VehicleSettings {
    pub autopilot: Autopilot,
    pub system_id: u8,
    pub state_for_gimbals: StateForGimbals,
    pub gimbal_output: GimbalOutput,
    /// What its clock reads when it is started; it reads on from zero after a reboot.
    pub uptime: Duration,
    /// Microseconds since 1970 when `now` is zero; unknown when `None`.
    pub unix_time_us: Option<u64>,
}

impl Default for VehicleSettings {
    fn default() -> Self {
        Self {
            autopilot: Autopilot::Px4,
            system_id: 1,
            state_for_gimbals: StateForGimbals::Told,
            gimbal_output: GimbalOutput::None,
            uptime: Duration::ZERO,
            unix_time_us: None,
        }
    }
}

/// A simulated autopilot in flight.
#[derive(Debug)]
pub struct Vehicle {
    settings: VehicleSettings,
    boot: Timestamp,
    line: Line,
    streams: Streams,
    parameters: ParameterServer,
    mount: Option<Mount>,
    client: Option<ManagerClient>,
    is_armed: bool,
    custom_mode: u32,
}

impl Vehicle {
    pub fn new(now: Timestamp, settings: VehicleSettings) -> Self {
        let mut streams = Streams::default();
        for (id, usual) in telemetry::usual_streams(settings.autopilot, settings.state_for_gimbals) {
            streams.add(id, usual, now);
        }
        let (mount, client) = match settings.gimbal_output {
            GimbalOutput::None => (None, None),
            GimbalOutput::Device => (Some(Mount::new()), None),
            GimbalOutput::Manager(version) => (None, Some(ManagerClient::new(version))),
        };
        let on_request: &[u32] = match settings.gimbal_output {
            GimbalOutput::None => &[],
            GimbalOutput::Device => &mount::REPORTS,
            GimbalOutput::Manager(_) => &[message::GIMBAL_MANAGER_SET_PITCHYAW],
        };
        for id in on_request {
            streams.add(*id, None, now);
        }
        Self {
            boot: now,
            line: Line::new(MavId::new(settings.system_id, telemetry::COMPONENT)),
            streams,
            parameters: parameters::parameters(settings.autopilot, settings.system_id, settings.gimbal_output),
            mount,
            client,
            is_armed: true,
            custom_mode: match settings.autopilot {
                // Main mode auto, sub mode loiter.
                Autopilot::Px4 => 4 << 16 | 3 << 24,
                // Circle.
                Autopilot::ArduPilot => 7,
            },
            settings,
        }
    }

    pub fn id(&self) -> MavId {
        self.line.id()
    }

    /// Where it is and how it moves.
    pub fn motion(&self, now: Timestamp) -> Motion {
        flight::motion_at(Timestamp::ZERO + now.since(self.boot))
    }

    /// The same as a gimbal on it feels it.
    pub fn platform_motion(&self, now: Timestamp) -> PlatformMotion {
        let motion = self.motion(now);
        // Bank and pitch do not change on the circle.
        PlatformMotion { heading: motion.attitude.yaw, heading_rate: motion.heading_rate, ..PlatformMotion::default() }
    }

    pub fn parameter(&self, name: &str) -> Option<ParameterValue> {
        self.parameters.value(name)
    }

    /// What its clock reads.
    fn clock(&self, now: Timestamp) -> Timestamp {
        Timestamp::ZERO + self.settings.uptime + now.since(self.boot)
    }

    /// Whether it answers requests for a message as if it knew it.
    fn promises(&self, id: u32) -> bool {
        id == message::AUTOPILOT_STATE_FOR_GIMBAL_DEVICE && self.settings.state_for_gimbals == StateForGimbals::Promised
    }

    /// Whether it does not answer requests for a message at all.
    fn ignores(&self, id: u32) -> bool {
        id == message::AUTOPILOT_STATE_FOR_GIMBAL_DEVICE && self.settings.state_for_gimbals == StateForGimbals::Ignored
    }
}

impl Component for Vehicle {
    fn line(&self) -> &Line {
        &self.line
    }

    fn line_mut(&mut self) -> &mut Line {
        &mut self.line
    }

    /// It is where its clock puts it.
    fn advance(&mut self, _now: Timestamp) {}

    fn handle_frame(&mut self, now: Timestamp, frame: &Frame<'_>) {
        self.hear_for_mount(now, frame);
        self.hear_for_client(now, frame);
        if frame.target().includes(self.id()) {
            self.handle_request(now, frame);
        }
    }

    fn send_due(&mut self, now: Timestamp) {
        while let Some(id) = self.streams.pop_due(now) {
            self.report(now, id);
        }
        self.ask_for_mount(now);
        self.repeat_claim(now);
        self.parameters.handle_timeout(now, &mut self.line.outbox);
    }

    fn next_due(&self) -> Option<Timestamp> {
        let timers = [
            self.streams.poll_timeout(),
            self.parameters.poll_timeout(),
            self.mount.as_ref().and_then(Mount::poll_timeout),
            self.client.as_ref().and_then(ManagerClient::poll_timeout),
        ];
        timers.into_iter().flatten().min()
    }

    fn restart(&mut self, now: Timestamp) {
        *self = Self::new(now, VehicleSettings { uptime: Duration::ZERO, ..self.settings });
    }
}

#[cfg(test)]
mod tests;
