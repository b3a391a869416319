//! The driver at one end of a line, a simulated gimbal at the other.

use super::*;
use crate::gimbals::mavlink_v1::sim::{Device, SystemId};
use crate::sim::peer::Peer;
use crate::sim::plant::PlantSettings;
use crate::wire::FrameBuffer;
use crate::wire::dialect::MavMessage;

/// The driver and a simulated gimbal on a line, in simulated time.
pub struct Line {
    pub now: Timestamp,
    pub driver: MavlinkV1Driver,
    pub gimbal: Device,
    /// The line is cut: neither hears the other.
    pub is_cut: bool,
    pub sent: Vec<(Timestamp, COMMAND_LONG_DATA)>,
    /// What is sent until it is answered.
    pub ordered: Vec<(Timestamp, COMMAND_LONG_DATA)>,
    pub reports: Vec<(Timestamp, Report)>,
}

impl Line {
    pub fn new(signs: Signs, reports: Reports) -> Self {
        let settings = V1Settings { sign: signs, ..V1Settings::default() };
        Self::with(settings, DeviceSettings { signs, feedback: reports, ..DeviceSettings::default() })
    }

    pub fn with(settings: V1Settings, device: DeviceSettings) -> Self {
        let plant = PlantSettings { noise: Angle::ZERO, ..device.plant };
        let device = DeviceSettings { system_id: SystemId::Fixed(1), plant, ..device };
        let mut driver = MavlinkV1Driver::new(settings);
        driver.adopt(Timestamp::ZERO, GIMBAL);
        let mut line = Self {
            now: Timestamp::ZERO,
            driver,
            gimbal: Device::new(Timestamp::ZERO, device),
            is_cut: false,
            sent: Vec::new(),
            ordered: Vec::new(),
            reports: Vec::new(),
        };
        line.gimbal.handle_timeout(Timestamp::ZERO);
        line.settle();
        line
    }

    pub fn settle(&mut self) {
        loop {
            let mut busy = false;
            while let Some(bytes) = self.gimbal.poll_output() {
                busy = true;
                if !self.is_cut {
                    let frame = DatagramFrames::new(&bytes).next_frame().expect("it sends frames");
                    self.driver.handle_received(self.now, &frame);
                }
            }
            while let Some(output) = self.driver.poll_output() {
                busy = true;
                match output {
                    DriverOutput::Message(message) => {
                        let bytes = FrameBuffer::default().encode_any(MANAGER, 0, &message).bytes().to_vec();
                        let MavMessage::COMMAND_LONG(command) = *message else { panic!("only commands go to it") };
                        self.sent.push((self.now, command));
                        if !self.is_cut {
                            self.gimbal.handle_received(self.now, &bytes);
                        }
                    }
                    DriverOutput::Command(command) => self.ordered.push((self.now, *command)),
                    DriverOutput::Operated { .. } => panic!("nothing was asked"),
                    DriverOutput::Report(report) => self.reports.push((self.now, report)),
                }
            }
            if !busy {
                return;
            }
        }
    }

    pub fn run_for(&mut self, duration: Duration) {
        let end = self.now + duration;
        loop {
            let next = [self.driver.poll_timeout(), self.gimbal.poll_timeout()].into_iter().flatten().min();
            let Some(next) = next.filter(|next| *next <= end) else { break };
            self.now = next.max(self.now);
            if self.gimbal.poll_timeout().is_some_and(|at| at <= self.now) {
                self.gimbal.handle_timeout(self.now);
            }
            if self.driver.poll_timeout().is_some_and(|at| at <= self.now) {
                self.driver.handle_timeout(self.now);
            }
            self.settle();
        }
        self.now = end;
        self.gimbal.handle_timeout(end);
        self.settle();
    }

    pub fn point(&mut self, pitch_deg: f64, yaw_deg: f64) {
        self.driver.handle_setpoint(self.now, pointing(pitch_deg, yaw_deg));
        self.settle();
    }

    pub fn tell(&mut self, setpoint: Setpoint) {
        self.driver.handle_setpoint(self.now, setpoint);
        self.settle();
    }

    /// What was ordered last arrives, and is answered.
    pub fn answer(&mut self) {
        let (_, command) = self.ordered.last().expect("something was ordered").clone();
        self.gimbal.handle_received(self.now, &encode_to_vec(MANAGER, 0, &command));
        self.driver.handle_command_outcome(self.now, &command, CommandOutcome::Answered(0));
        self.settle();
    }

    /// Flags of the latest attitude that was reported.
    pub fn flags(&self) -> GimbalFlags {
        let flags = self.reports.iter().rev().find_map(|(_, report)| match report {
            Report::Attitude(status) => Some(status.flags),
            _ => None,
        });
        flags.expect("it is reported")
    }

    /// The parameters of what was sent last.
    pub fn told(&self) -> [f32; 4] {
        let (_, command) = self.sent.last().expect("it was told");
        [command.param1, command.param2, command.param3, command.param7]
    }

    /// Pitch and yaw of the latest attitude that was reported, degrees.
    pub fn reported(&self) -> (f64, f64) {
        let attitude = self.reports.iter().rev().find_map(|(_, report)| match report {
            Report::Attitude(status) => Some(status.attitude.angles()),
            _ => None,
        });
        let angles = attitude.expect("it is reported");
        (angles.pitch.degrees(), angles.yaw.degrees())
    }

    pub fn is_open_loop(&self) -> bool {
        let identity = self.reports.iter().rev().find_map(|(_, report)| match report {
            Report::Known(identity, _) => Some(identity),
            _ => None,
        });
        identity.expect("it is known").custom_name == "open loop"
    }
}
