//! A simulated v1 gimbal, as ArduPilot's contract for MAVLink gimbals describes one.
//!
//! It waits for the heartbeat of a vehicle, takes its system id, and then obeys `DO_MOUNT_CONTROL`. It knows nothing of
//! gimbal devices and managers.

use std::time::Duration;

use crate::geometry::{Angle, AxisLimits, GimbalAngles, Limits};
use crate::gimbals::signs::Signs;
use crate::sim::command::Command;
use crate::sim::component::{Component, Line};
use crate::sim::parameters::{IntegerEncoding, ParameterServer, ParameterValue};
use crate::sim::peer::PlatformMotion;
use crate::sim::plant::{Drive, Plant, PlantSettings, YawHold};
use crate::sim::streams::Streams;
pub use crate::sim::system_id::SystemId;
use crate::timestamp::Timestamp;
use crate::wire::dialect::{
    ATTITUDE_DATA, HEARTBEAT_DATA, MOUNT_ORIENTATION_DATA, MOUNT_STATUS_DATA, REQUEST_DATA_STREAM_DATA,
};
use crate::wire::ids::{
    CommandResult, command, component, mav_autopilot, mav_data_stream, mav_state, mav_type, message, mount_mode,
};
use crate::wire::{Frame, MavId};

const HEARTBEAT_INTERVAL: Duration = Duration::from_secs(1);

/// The motors take so long to find themselves; until then it is not `MAV_STATE_ACTIVE`.
const START_UP: Duration = Duration::from_secs(2);

/// Everything that differs from one v1 gimbal to another.
#[derive(Clone, Debug, PartialEq)]
pub struct DeviceSettings {
    pub component_id: u8,
    /// Until a vehicle is heard, it is silent.
    pub system_id: SystemId,
    /// How it counts in what it is told.
    pub signs: Signs,
    /// How it counts in what it reports.
    pub report_signs: Signs,
    pub feedback: Feedback,
    /// Asks the vehicle for `ATTITUDE` ten times a second and `GLOBAL_POSITION_INT` twice, as the contract allows.
    pub asks_for_streams: bool,
    /// `DO_MOUNT_CONTROL` in another mode than the last `DO_MOUNT_CONFIGURE` named is refused, and in any before the first.
    pub needs_configuring: bool,
    pub plant: PlantSettings,
}

/// How it says where it looks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Feedback {
    /// `MOUNT_ORIENTATION`, ten times a second.
    Orientation,
    /// `MOUNT_STATUS`, four times a second.
    Status,
    Nothing,
}

impl Default for DeviceSettings {
    fn default() -> Self {
        let degrees = Angle::from_degrees;
        Self {
            component_id: component::GIMBAL,
            system_id: SystemId::Adopt,
            signs: Signs::NORMAL,
            report_signs: Signs::NORMAL,
            feedback: Feedback::Orientation,
            asks_for_streams: false,
            needs_configuring: false,
            plant: PlantSettings {
                limits: Limits {
                    roll: AxisLimits::new(degrees(-45.0), degrees(45.0)),
                    pitch: AxisLimits::new(degrees(-90.0), degrees(45.0)),
                    yaw: AxisLimits::new(degrees(-180.0), degrees(180.0)),
                },
                ..PlantSettings::default()
            },
        }
    }
}

/// A simulated v1 gimbal.
#[derive(Debug)]
pub struct Device {
    settings: DeviceSettings,
    boot: Timestamp,
    /// The vehicle it belongs to.
    vehicle: Option<MavId>,
    line: Line,
    streams: Streams,
    parameters: ParameterServer,
    plant: Plant,
    mode: u8,
    /// The mode of the last `DO_MOUNT_CONFIGURE`.
    configured: Option<u8>,
    is_speaking: bool,
    /// The vehicle's motion comes from outside, and not from its `ATTITUDE`.
    is_carried: bool,
}

impl Device {
    pub fn new(now: Timestamp, settings: DeviceSettings) -> Self {
        let system = match settings.system_id {
            SystemId::Adopt => 0,
            SystemId::Fixed(system) => system,
        };
        let limit = |angle: fn(AxisLimits) -> Angle| {
            let angle = settings.plant.limits.pitch.map(angle);
            ParameterValue::Float(angle.map_or(f32::NAN, |angle| angle.degrees() as f32))
        };
        let parameters = vec![("SIM_TILT_MAX", limit(AxisLimits::max)), ("SIM_TILT_MIN", limit(AxisLimits::min))];
        Self {
            boot: now,
            vehicle: None,
            line: Line::new(MavId::new(system, settings.component_id)),
            streams: Streams::default(),
            parameters: ParameterServer::new(parameters, IntegerEncoding::Bytewise),
            plant: Plant::new(now, settings.plant.clone()),
            mode: mount_mode::MAVLINK_TARGETING,
            configured: None,
            is_speaking: false,
            is_carried: false,
            settings,
        }
    }

    pub fn id(&self) -> MavId {
        self.line.id()
    }

    /// The `MAV_MOUNT_MODE` it is in.
    pub fn mode(&self) -> u8 {
        self.mode
    }

    /// The mechanics, to look at.
    pub fn plant(&self) -> &Plant {
        &self.plant
    }

    fn start_speaking(&mut self, now: Timestamp) {
        if self.is_speaking {
            return;
        }
        self.is_speaking = true;
        self.streams.add(message::HEARTBEAT, Some(HEARTBEAT_INTERVAL), now);
        match self.settings.feedback {
            Feedback::Orientation => {
                self.streams.add(message::MOUNT_ORIENTATION, Some(Duration::from_millis(100)), now);
            }
            Feedback::Status => self.streams.add(message::MOUNT_STATUS, Some(Duration::from_millis(250)), now),
            Feedback::Nothing => {}
        }
    }

    /// "Wait for a HEARTBEAT. Ignore type 6 (GCS) … Remember source sysid/compid. Adopt that sysid."
    fn handle_heartbeat(&mut self, now: Timestamp, source: MavId, heartbeat: &HEARTBEAT_DATA) {
        if self.vehicle.is_some() || mav_type::NOT_A_VEHICLE.contains(&heartbeat.mavtype) {
            return;
        }
        self.vehicle = Some(source);
        if self.settings.system_id == SystemId::Adopt {
            self.line.outbox.set_system(source.system);
        }
        self.start_speaking(now);
        if self.settings.asks_for_streams {
            for (req_stream_id, req_message_rate) in [(mav_data_stream::EXTRA1, 10), (mav_data_stream::POSITION, 2)] {
                self.line.outbox.send(&REQUEST_DATA_STREAM_DATA {
                    req_message_rate,
                    target_system: source.system,
                    target_component: source.component,
                    req_stream_id,
                    start_stop: 1,
                });
            }
        }
    }

    fn handle_command(&mut self, now: Timestamp, command: &Command) {
        let result = match command.number {
            command::DO_MOUNT_CONTROL => self.mount_control(command),
            command::DO_MOUNT_CONFIGURE => {
                let result = self.set_mode(command.params[0]);
                self.configured = (result == CommandResult::Accepted).then_some(self.mode).or(self.configured);
                result
            }
            command::SET_MESSAGE_INTERVAL => {
                let id = command.message_id();
                let known = matches!(id, message::MOUNT_ORIENTATION | message::MOUNT_STATUS);
                if known && !self.streams.contains(id) {
                    self.streams.add(id, None, now);
                }
                if known && self.streams.set_interval(now, id, command.params[1]) {
                    CommandResult::Accepted
                } else {
                    CommandResult::Unsupported
                }
            }
            _ => CommandResult::Unsupported,
        };
        if command.is_directed() || result == CommandResult::Accepted {
            command.acknowledge(&mut self.line.outbox, result);
        }
    }

    /// A float cast saturates, and turns NaN into 0.
    fn set_mode(&mut self, mode: f64) -> CommandResult {
        match mode.round() as u8 {
            mode @ (mount_mode::RETRACT | mount_mode::NEUTRAL) => {
                self.mode = mode;
                let ahead = Drive::To { angle: Angle::ZERO, speed: None };
                self.plant.set_roll(ahead);
                self.plant.set_pitch(ahead);
                self.plant.set_yaw(YawHold::Vehicle, ahead);
                CommandResult::Accepted
            }
            mode @ (mount_mode::MAVLINK_TARGETING | mount_mode::RC_TARGETING) => {
                self.mode = mode;
                CommandResult::Accepted
            }
            _ => CommandResult::Failed,
        }
    }

    fn mount_control(&mut self, command: &Command) -> CommandResult {
        let [pitch, roll, yaw, .., mode] = command.params;
        if self.settings.needs_configuring && self.configured.map(f64::from) != Some(mode) {
            return CommandResult::Denied;
        }
        let result = self.set_mode(mode);
        if result != CommandResult::Accepted || self.mode != mount_mode::MAVLINK_TARGETING {
            return result;
        }
        if ![pitch, roll, yaw].iter().all(|degrees| degrees.is_finite()) {
            return CommandResult::Denied;
        }
        let [roll, pitch, yaw] = [roll, pitch, yaw].map(Angle::from_degrees);
        let GimbalAngles { roll, pitch, yaw } = self.settings.signs.apply(GimbalAngles { roll, pitch, yaw });
        let to = |angle: Angle| Drive::To { angle, speed: None };
        self.plant.set_pitch(to(pitch));
        self.plant.set_roll(to(roll));
        self.plant.set_yaw(YawHold::Vehicle, to(yaw));
        CommandResult::Accepted
    }

    fn ride(&mut self, now: Timestamp, attitude: &ATTITUDE_DATA) {
        let numbers = [attitude.yaw, attitude.yawspeed, attitude.rollspeed, attitude.pitchspeed];
        if self.is_carried || !numbers.iter().all(|number| number.is_finite()) {
            return;
        }
        let [yaw, yaw_rate, roll_rate, pitch_rate] = numbers.map(f64::from);
        let rate = crate::geometry::AngularRate::from_radians_per_second;
        let heading = Angle::from_radians(yaw).nearest_to(self.plant.platform_heading(now));
        self.plant.set_platform(
            now,
            PlatformMotion {
                heading,
                heading_rate: rate(yaw_rate),
                roll_rate: rate(roll_rate),
                pitch_rate: rate(pitch_rate),
            },
        );
    }

    fn report(&mut self, now: Timestamp, id: u32) {
        let pose = self.plant.measure(now);
        let absolute = (pose.yaw + self.plant.platform_heading(now)).wrapped();
        let told = GimbalAngles { roll: pose.roll, pitch: pose.pitch, yaw: pose.yaw.wrapped() };
        let told = self.settings.report_signs.apply(told);
        let up = now.since(self.boot);
        match id {
            message::HEARTBEAT => self.line.outbox.send(&HEARTBEAT_DATA {
                custom_mode: 0,
                mavtype: mav_type::GIMBAL,
                autopilot: mav_autopilot::GENERIC,
                base_mode: 0,
                system_status: if up < START_UP { mav_state::BOOT } else { mav_state::ACTIVE },
                mavlink_version: 3,
            }),
            message::MOUNT_ORIENTATION => {
                self.line.outbox.send(&MOUNT_ORIENTATION_DATA {
                    time_boot_ms: (Timestamp::ZERO + up).boot_ms(),
                    roll: told.roll.degrees() as f32,
                    pitch: told.pitch.degrees() as f32,
                    yaw: told.yaw.degrees() as f32,
                    yaw_absolute: absolute.degrees() as f32,
                });
            }
            message::MOUNT_STATUS => {
                let hundredths = |angle: Angle| (angle.degrees() * 100.0).round() as i32;
                self.line.outbox.send(&MOUNT_STATUS_DATA {
                    pointing_a: hundredths(told.pitch),
                    pointing_b: hundredths(told.roll),
                    pointing_c: hundredths(told.yaw),
                    target_system: 0,
                    target_component: 0,
                    mount_mode: self.mode,
                });
            }
            _ => {}
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

    fn advance(&mut self, now: Timestamp) {
        self.plant.advance(now);
        if matches!(self.settings.system_id, SystemId::Fixed(_)) {
            self.start_speaking(now);
        }
    }

    fn handle_frame(&mut self, now: Timestamp, frame: &Frame<'_>) {
        if let Some(heartbeat) = frame.decode::<HEARTBEAT_DATA>() {
            self.handle_heartbeat(now, frame.source(), &heartbeat);
            return;
        }
        if self.vehicle == Some(frame.source())
            && let Some(attitude) = frame.decode::<ATTITUDE_DATA>()
        {
            self.ride(now, &attitude);
        }
        if !self.is_speaking || !frame.target().includes(self.id()) {
            return;
        }
        if let Some(command) = Command::read(frame) {
            self.handle_command(now, &command);
        } else {
            self.parameters.handle_frame(now, frame, &mut self.line.outbox);
        }
    }

    fn send_due(&mut self, now: Timestamp) {
        while let Some(id) = self.streams.pop_due(now) {
            self.report(now, id);
        }
        self.parameters.handle_timeout(now, &mut self.line.outbox);
    }

    fn next_due(&self) -> Option<Timestamp> {
        // Under an id of its own it waits for nobody.
        if !self.is_speaking && matches!(self.settings.system_id, SystemId::Fixed(_)) {
            return Some(self.boot);
        }
        [self.streams.poll_timeout(), self.parameters.poll_timeout()].into_iter().flatten().min()
    }

    fn restart(&mut self, now: Timestamp) {
        *self = Self::new(now, self.settings.clone());
    }

    fn carry(&mut self, now: Timestamp, motion: PlatformMotion) {
        self.is_carried = true;
        self.plant.advance(now);
        self.plant.set_platform(now, motion);
    }
}

#[cfg(test)]
mod tests;
