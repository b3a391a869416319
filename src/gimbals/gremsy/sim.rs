//! A simulated Gremsy of either generation.
//!
//! It says nothing before it has heard a heartbeat, takes its time to start, forgets its message rates and keeps its
//! parameters when it is switched off, answers commands late, and goes on turning at a rate that nobody repeats. With
//! another RC type than SYNC it acknowledges and does not move.

mod answers;
mod commands;
mod motion;
mod motors;
mod parameters;
mod power;
mod reports;
mod setpoints;
mod settings;

use std::time::Duration;

pub use setpoints::Ignored;
pub use settings::{DeviceSettings, Generation, StatusTarget};

use self::answers::Answers;
use self::motors::Motors;
use self::power::Power;
use super::parameters::AxisFlags;
use crate::geometry::Angle;
use crate::gimbals::mavlink_v2::sim::latch::ManagerLatch;
use crate::gimbals::mavlink_v2::sim::steering::Steering;
use crate::sim::command::Command;
use crate::sim::component::{Component, Line};
use crate::sim::heading::HeadingBelief;
use crate::sim::parameters::ParameterServer;
use crate::sim::peer::PlatformMotion;
use crate::sim::plant::Plant;
use crate::sim::random::Random;
use crate::sim::streams::Streams;
use crate::sim::system_id::SystemId;
use crate::timestamp::Timestamp;
use crate::wire::dialect::{GIMBAL_MANAGER_STATUS_DATA, HEARTBEAT_DATA};
use crate::wire::ids::{FailureFlags, component, mav_type, message};
use crate::wire::{Frame, MavId};

/// System id while no vehicle was heard.
const FIRST_SYSTEM: u8 = 1;

const HEARTBEAT_INTERVAL: Duration = Duration::from_secs(1);
/// Of orientation, encoders and IMU, and of the attitude status once a setpoint has come.
const USUAL_INTERVAL: Duration = Duration::from_millis(100);
/// Of the attitude status before that.
const IDLE_INTERVAL: Duration = Duration::from_millis(250);

/// A simulated Gremsy.
#[derive(Debug)]
pub struct Device {
    settings: DeviceSettings,
    power: Power,
    line: Line,
    answers: Answers,
    streams: Streams,
    allowance: reports::Allowance,
    parameters: ParameterServer,
    plant: Plant,
    motors: Motors,
    heading: HeadingBelief,
    /// What its own horizon counted when it was switched on: where it takes North to be while nobody tells it.
    zero: Angle,
    /// Yaw is held to the horizon (v1).
    is_locked: bool,
    /// The RC receiver steers.
    is_with_rc: bool,
    steering: Steering,
    latch: ManagerLatch,
    is_mapping: bool,
    was_steered: bool,
    has_adopted: bool,
    /// The vehicle's motion comes from outside, and not from what the autopilot says of it.
    is_carried: bool,
    random: Random,
    failures: FailureFlags,
    ignored: Ignored,
}

impl Device {
    pub fn new(now: Timestamp, settings: DeviceSettings) -> Self {
        let system = match settings.system_id {
            SystemId::Adopt => FIRST_SYSTEM,
            SystemId::Fixed(system) => system,
        };
        let mut device = Self {
            power: Power::on_at(now),
            line: Line::new(MavId::new(system, settings.component_id)),
            answers: Answers::default(),
            streams: Streams::default(),
            allowance: reports::Allowance::full(now),
            parameters: parameters::parameters(&settings),
            plant: Plant::new(now, settings.plant.clone()),
            motors: Motors::Off,
            heading: HeadingBelief::default(),
            zero: Angle::ZERO,
            is_locked: false,
            is_with_rc: false,
            steering: Steering::default(),
            latch: ManagerLatch::default(),
            is_mapping: false,
            was_steered: false,
            has_adopted: false,
            is_carried: false,
            random: Random::new(settings.plant.seed),
            failures: FailureFlags::empty(),
            ignored: Ignored::default(),
            settings,
        };
        device.switch_on(now);
        device
    }

    pub fn id(&self) -> MavId {
        self.line.id()
    }

    /// The mechanics, to look at.
    pub fn plant(&self) -> &Plant {
        &self.plant
    }

    /// Whom it obeys (v2).
    pub fn manager(&self, now: Timestamp) -> Option<MavId> {
        self.latch.manager(now)
    }

    /// What was told and had no effect.
    pub fn ignored(&self) -> Ignored {
        self.ignored
    }

    /// The value of a parameter, by its name.
    pub fn parameter(&self, name: &str) -> Option<i16> {
        parameters::short(&self.parameters, name)
    }

    /// Reports these failures from now on, next to those it finds itself (v2).
    pub fn set_failures(&mut self, failures: FailureFlags) {
        self.failures = failures;
    }

    /// Starts from the beginning at `on_at`, all but the parameters forgotten; what is still to be sent is sent.
    fn switch_on(&mut self, on_at: Timestamp) {
        self.power = Power::on_at(on_at);
        self.motors = Motors::Starting { until: self.power.settled_at() };
        self.plant.release_motors();
        self.answers = Answers::default();
        self.streams = Streams::default();
        self.allowance = reports::Allowance::full(on_at);
        self.parameters.forget_questions();
        self.heading = HeadingBelief::default();
        self.is_locked = false;
        self.is_with_rc = false;
        self.steering = Steering::default();
        self.latch = ManagerLatch::default();
        self.is_mapping = false;
        self.was_steered = false;
        self.apply_parameters();
    }

    fn is_v2(&self) -> bool {
        self.settings.generation == Generation::V2
    }

    fn wake(&mut self, now: Timestamp) {
        if !self.power.wake() {
            return;
        }
        let usual = |interval| self.settings.has_usual_streams.then_some(interval);
        self.streams.add(message::HEARTBEAT, Some(HEARTBEAT_INTERVAL), now);
        self.streams.add(message::SYS_STATUS, Some(HEARTBEAT_INTERVAL), now);
        for id in [message::MOUNT_STATUS, message::RAW_IMU] {
            self.streams.add(id, usual(USUAL_INTERVAL), now);
        }
        if self.is_v2() {
            self.streams.add(message::GIMBAL_DEVICE_ATTITUDE_STATUS, usual(IDLE_INTERVAL), now);
            self.streams.add(message::MOUNT_ORIENTATION, None, now);
        } else {
            self.streams.add(message::MOUNT_ORIENTATION, usual(USUAL_INTERVAL), now);
        }
    }

    fn handle_heartbeat(&mut self, now: Timestamp, sender: MavId, heartbeat: &HEARTBEAT_DATA) {
        let is_vehicle =
            sender.component == component::AUTOPILOT1 && !mav_type::NOT_A_VEHICLE.contains(&heartbeat.mavtype);
        if is_vehicle && !self.has_adopted && self.settings.system_id == SystemId::Adopt {
            self.has_adopted = true;
            self.line.outbox.set_system(sender.system);
        }
        self.wake(now);
    }

    /// Moves with the vehicle as the autopilot tells it, unless the vehicle's own motion is known.
    fn ride(&mut self, now: Timestamp, motion: PlatformMotion) {
        if !self.is_carried {
            let heading = motion.heading.nearest_to(self.plant.platform_heading(now));
            self.plant.set_platform(now, PlatformMotion { heading, ..motion });
        }
    }

    /// The autopilot's attitude is leaned on only when the parameter says so.
    fn leans_on_autopilot(&self) -> bool {
        self.axis_flags().contains(AxisFlags::COMBINE_ATTITUDE)
    }

    /// Where it believes the vehicle's nose to be: against North when its autopilot tells it, and against wherever it
    /// was switched on when not. Some firmware errs in either case.
    fn own_heading(&self, now: Timestamp) -> Angle {
        let told = self.heading.at(now).filter(|_| self.leans_on_autopilot());
        let heading = told.map_or_else(|| self.plant.horizon(now) - self.zero, |(heading, _)| heading);
        heading + self.settings.earth_yaw_error()
    }
}

impl Component for Device {
    fn line(&self) -> &Line {
        &self.line
    }

    fn line_mut(&mut self) -> &mut Line {
        &mut self.line
    }

    fn advance(&mut self, now: Timestamp) {
        if let Motors::Starting { until } = self.motors
            && until <= now
        {
            self.plant.advance(until);
            self.motors = Motors::On;
            self.plant.engage_motors();
            self.go_ahead();
        }
        self.steering.expire(now, &mut self.plant);
        let is_reference = self.leans_on_autopilot() && self.heading.is_reference(now);
        self.plant.set_heading_reference(is_reference);
        self.plant.advance(now);
    }

    fn handle_frame(&mut self, now: Timestamp, frame: &Frame<'_>) {
        if !self.power.hears(now) {
            return;
        }
        let sender = frame.source();
        if frame.message_id() == message::HEARTBEAT {
            if let Some(heartbeat) = frame.decode() {
                self.handle_heartbeat(now, sender, &heartbeat);
            }
            return;
        }
        if !self.power.is_awake() || !frame.target().includes(self.id()) {
            return;
        }
        if let Some(command) = Command::read(frame) {
            self.handle_command(now, &command);
        } else if self.parameters.handle_frame(now, frame, &mut self.line.outbox) {
            self.apply_parameters();
        } else if sender.system == self.id().system {
            // Nobody of another system steers it or tells it where North is.
            if let Some(motion) = self.heading.handle_frame(now, frame) {
                self.ride(now, motion);
            } else if self.is_v2() {
                if let Some(setpoint) = frame.decode() {
                    self.handle_set_attitude(now, sender, &setpoint);
                } else if let Some(status) = frame.decode::<GIMBAL_MANAGER_STATUS_DATA>()
                    && status.gimbal_device_id == self.settings.component_id
                {
                    self.latch.handle_announcement(now, sender);
                }
            }
        }
    }

    fn send_due(&mut self, now: Timestamp) {
        self.answers.send_due(now, &mut self.line.outbox);
        while let Some(id) = self.streams.pop_due(now) {
            if self.allowance.takes(now) {
                self.report(now, id);
            }
        }
        self.parameters.handle_timeout(now, &mut self.line.outbox);
    }

    fn next_due(&self) -> Option<Timestamp> {
        let starting = match self.motors {
            Motors::Starting { until } => Some(until),
            Motors::On | Motors::Off => None,
        };
        let others = [self.answers.poll_timeout(), self.streams.poll_timeout(), self.parameters.poll_timeout()];
        others.into_iter().chain([starting, self.steering.rates_until()]).flatten().min()
    }

    fn restart(&mut self, now: Timestamp) {
        self.line.outbox.clear();
        self.zero = self.plant.platform_heading(now);
        self.switch_on(now);
    }

    fn carry(&mut self, now: Timestamp, motion: PlatformMotion) {
        if !self.is_carried {
            self.is_carried = true;
            self.zero = motion.heading;
        }
        self.advance(now);
        self.plant.set_platform(now, motion);
    }
}

#[cfg(test)]
mod tests;
