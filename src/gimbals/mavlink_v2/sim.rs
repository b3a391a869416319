//! A simulated v2 gimbal device, as the Gimbal Protocol v2 describes one.
//!
//! It obeys `GIMBAL_DEVICE_SET_ATTITUDE` of one manager only, says where it looks in
//! `GIMBAL_DEVICE_ATTITUDE_STATUS`, and knows North as long as its autopilot tells it the heading.

pub mod latch;
mod obedience;
mod reports;
pub mod setpoint;
mod settings;
pub mod steering;
pub mod telling;

use std::time::Duration;

pub use settings::{DeviceSettings, Retract, StatusFrame, Strictness};

use self::latch::ManagerLatch;
use self::steering::Steering;
use crate::geometry::Angle;
use crate::sim::command::Command;
use crate::sim::component::{Component, Line};
use crate::sim::heading::HeadingBelief;
use crate::sim::parameters::{IntegerEncoding, ParameterServer, ParameterValue};
use crate::sim::peer::PlatformMotion;
use crate::sim::plant::Plant;
use crate::sim::streams::Streams;
pub use crate::sim::system_id::SystemId;
use crate::timestamp::Timestamp;
use crate::wire::dialect::{GIMBAL_MANAGER_STATUS_DATA, HEARTBEAT_DATA, STORM32_GIMBAL_MANAGER_STATUS_DATA};
use crate::wire::ids::{CommandResult, FailureFlags, command, component, mav_type, message};
use crate::wire::{Frame, MavId};

/// System id while no autopilot was heard.
const FIRST_SYSTEM: u8 = 1;

const HEARTBEAT_INTERVAL: Duration = Duration::from_secs(1);
/// Of the attitude status before the first setpoint, and after it.
const IDLE_INTERVAL: Duration = Duration::from_millis(250);
const ACTIVE_INTERVAL: Duration = Duration::from_millis(100);

/// Setpoints that had no effect.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RefusedSetpoints {
    /// Sent by somebody who is not the manager.
    pub not_manager: u32,
    /// Both YAW_IN bits, a quaternion that is none, or an infinite rate.
    pub malformed: u32,
    /// Frame flags that this device does not take.
    pub frame: u32,
    /// Earth frame while the heading is not known.
    pub no_heading: u32,
    /// Retracted until a restart.
    pub retracted: u32,
}

/// A simulated v2 gimbal device.
#[derive(Debug)]
pub struct Device {
    settings: DeviceSettings,
    boot: Timestamp,
    line: Line,
    streams: Streams,
    parameters: ParameterServer,
    plant: Plant,
    heading: HeadingBelief,
    latch: ManagerLatch,
    steering: Steering,
    has_adopted: bool,
    is_speaking: bool,
    was_steered: bool,
    /// The vehicle's motion comes from outside, and not from what the autopilot says of it.
    is_carried: bool,
    failures: FailureFlags,
    refused: RefusedSetpoints,
}

impl Device {
    pub fn new(now: Timestamp, settings: DeviceSettings) -> Self {
        let system = match settings.system_id {
            SystemId::Adopt => FIRST_SYSTEM,
            SystemId::Fixed(system) => system,
        };
        let parameters = parameters(&settings);
        Self {
            boot: now,
            line: Line::new(MavId::new(system, settings.component_id)),
            streams: Streams::default(),
            parameters,
            plant: Plant::new(now, settings.plant.clone()),
            heading: HeadingBelief::default(),
            latch: ManagerLatch::default(),
            steering: Steering::default(),
            has_adopted: false,
            is_speaking: false,
            was_steered: false,
            is_carried: false,
            failures: FailureFlags::empty(),
            refused: RefusedSetpoints::default(),
            settings,
        }
    }

    pub fn id(&self) -> MavId {
        self.line.id()
    }

    /// The mechanics, to look at.
    pub fn plant(&self) -> &Plant {
        &self.plant
    }

    /// Whom it obeys.
    pub fn manager(&self, now: Timestamp) -> Option<MavId> {
        self.latch.manager(now)
    }

    pub fn refused(&self) -> RefusedSetpoints {
        self.refused
    }

    /// Reports these failures from now on, next to those it finds itself.
    pub fn set_failures(&mut self, failures: FailureFlags) {
        self.failures = failures;
    }

    fn start_speaking(&mut self, now: Timestamp) {
        if self.is_speaking {
            return;
        }
        self.is_speaking = true;
        let status = if self.was_steered { ACTIVE_INTERVAL } else { IDLE_INTERVAL };
        self.streams.add(message::HEARTBEAT, Some(HEARTBEAT_INTERVAL), now);
        self.streams.add(message::GIMBAL_DEVICE_ATTITUDE_STATUS, Some(status), now);
    }

    fn speaks_at(&self) -> Option<Timestamp> {
        self.settings.listens_first.map(|wait| self.boot + wait)
    }

    fn handle_own_system(&mut self, now: Timestamp, frame: &Frame<'_>) {
        let sender = frame.source();
        if let Some(setpoint) = frame.decode() {
            self.handle_set_attitude(now, sender, &setpoint);
        } else if let Some(status) = frame.decode::<GIMBAL_MANAGER_STATUS_DATA>() {
            if status.gimbal_device_id == self.settings.component_id {
                self.latch.handle_announcement(now, sender);
            }
        } else if let Some(status) = frame.decode::<STORM32_GIMBAL_MANAGER_STATUS_DATA>() {
            if status.gimbal_id == self.settings.component_id {
                self.latch.handle_announcement(now, sender);
            }
        } else if let Some(motion) = self.heading.handle_frame(now, frame) {
            self.ride(now, motion);
        }
    }

    fn handle_heartbeat(&mut self, now: Timestamp, sender: MavId, heartbeat: &HEARTBEAT_DATA) {
        let is_autopilot =
            sender.component == component::AUTOPILOT1 && !mav_type::NOT_A_VEHICLE.contains(&heartbeat.mavtype);
        if is_autopilot && !self.has_adopted && self.settings.system_id == SystemId::Adopt {
            self.has_adopted = true;
            self.line.outbox.set_system(sender.system);
        }
        if heartbeat.mavtype != mav_type::GCS {
            self.start_speaking(now);
        }
    }

    fn handle_command(&mut self, now: Timestamp, command: &Command) {
        let answer = match command.number {
            command::REQUEST_MESSAGE => {
                let wanted = command.message_id();
                if self.can_report(wanted) {
                    command.acknowledge(&mut self.line.outbox, CommandResult::Accepted);
                    self.report(now, wanted, command.params[1]);
                    return;
                }
                CommandResult::Denied
            }
            command::SET_MESSAGE_INTERVAL => {
                let id = command.message_id();
                let is_settable = id == message::GIMBAL_DEVICE_ATTITUDE_STATUS;
                if is_settable && self.streams.set_interval(now, id, command.params[1]) {
                    command.acknowledge(&mut self.line.outbox, CommandResult::Accepted);
                    return;
                }
                CommandResult::Denied
            }
            command::GET_MESSAGE_INTERVAL => {
                command.acknowledge(&mut self.line.outbox, CommandResult::Accepted);
                self.report(now, message::MESSAGE_INTERVAL, command.params[0]);
                return;
            }
            _ => CommandResult::Unsupported,
        };
        if command.is_directed() {
            command.acknowledge(&mut self.line.outbox, answer);
        }
    }

    /// Moves with the vehicle as the autopilot tells it, unless the vehicle's own motion is known.
    fn ride(&mut self, now: Timestamp, motion: PlatformMotion) {
        if !self.is_carried {
            let heading = motion.heading.nearest_to(self.plant.platform_heading(now));
            self.plant.set_platform(now, PlatformMotion { heading, ..motion });
        }
    }
}

impl Component for Device {
    fn line(&self) -> &Line {
        &self.line
    }

    fn line_mut(&mut self) -> &mut Line {
        &mut self.line
    }

    /// Moves the mechanics on, stops rates at the moment they expire, and begins to speak when it is time.
    fn advance(&mut self, now: Timestamp) {
        if !self.is_speaking && self.speaks_at().is_some_and(|at| at <= now) {
            self.start_speaking(now);
        }
        self.steering.expire(now, &mut self.plant);
        self.plant.set_heading_reference(self.heading.is_reference(now));
        self.plant.advance(now);
    }

    fn handle_frame(&mut self, now: Timestamp, frame: &Frame<'_>) {
        let sender = frame.source();
        if frame.message_id() == message::HEARTBEAT {
            if let Some(heartbeat) = frame.decode() {
                self.handle_heartbeat(now, sender, &heartbeat);
            }
            return;
        }
        if !frame.target().includes(self.id()) {
            return;
        }
        if let Some(command) = Command::read(frame) {
            if self.is_speaking {
                self.handle_command(now, &command);
            }
            return;
        }
        if self.is_speaking && self.parameters.handle_frame(now, frame, &mut self.line.outbox) {
            return;
        }
        // Nobody of another system steers it or tells it where North is.
        if sender.system == self.id().system {
            self.handle_own_system(now, frame);
        }
    }

    fn send_due(&mut self, now: Timestamp) {
        while let Some(id) = self.streams.pop_due(now) {
            self.report(now, id, 0.0);
        }
        self.parameters.handle_timeout(now, &mut self.line.outbox);
    }

    fn next_due(&self) -> Option<Timestamp> {
        let speaks = if self.is_speaking { self.streams.poll_timeout() } else { self.speaks_at() };
        [self.parameters.poll_timeout(), self.steering.rates_until(), speaks].into_iter().flatten().min()
    }

    fn restart(&mut self, now: Timestamp) {
        *self = Self::new(now, self.settings.clone());
    }

    fn carry(&mut self, now: Timestamp, motion: PlatformMotion) {
        self.is_carried = true;
        self.advance(now);
        self.plant.set_platform(now, motion);
    }
}

fn parameters(settings: &DeviceSettings) -> ParameterServer {
    let pitch = settings.plant.limits.pitch;
    let degrees = |angle: Option<Angle>| ParameterValue::Float(angle.map_or(f32::NAN, |angle| angle.degrees() as f32));
    let list = vec![
        ("SIM_COMP_ID", ParameterValue::Integer(i32::from(settings.component_id))),
        ("SIM_RATE_MAX", ParameterValue::Float(settings.plant.max_rate.degrees_per_second() as f32)),
        ("SIM_TILT_MAX", degrees(pitch.map(|limits| limits.max()))),
        ("SIM_TILT_MIN", degrees(pitch.map(|limits| limits.min()))),
    ];
    ParameterServer::new(list, IntegerEncoding::Bytewise)
}

#[cfg(test)]
mod tests;
