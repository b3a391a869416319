use std::time::Duration;

use super::*;
use crate::geometry::Yaw;
use crate::gimbals::mavlink_v1::sim::{Device, DeviceSettings, Feedback as Reports, SystemId};
use crate::gimbals::setpoint::{Pointing, RadioControl, Stabilised};
use crate::sim::peer::Peer;
use crate::sim::plant::PlantSettings;
use crate::wire::dialect::{COMMAND_LONG_DATA, MavMessage};
use crate::wire::{DatagramFrames, FrameBuffer, encode_to_vec};

const MANAGER: MavId = MavId::new(1, 191);
const GIMBAL: MavId = MavId::new(1, 154);

/// The driver and a simulated gimbal on a line, in simulated time.
struct Line {
    now: Timestamp,
    driver: MavlinkV1Driver,
    gimbal: Device,
    /// The line is cut: neither hears the other.
    is_cut: bool,
    sent: Vec<(Timestamp, COMMAND_LONG_DATA)>,
    reports: Vec<(Timestamp, Report)>,
}

impl Line {
    fn new(signs: Signs, reports: Reports) -> Self {
        let plant = PlantSettings { noise: Angle::ZERO, ..DeviceSettings::default().plant };
        let settings = DeviceSettings {
            system_id: SystemId::Fixed(1),
            signs,
            feedback: reports,
            plant,
            ..DeviceSettings::default()
        };
        let mut driver = MavlinkV1Driver::new(signs);
        driver.adopt(Timestamp::ZERO, GIMBAL);
        let gimbal = Device::new(Timestamp::ZERO, settings);
        let mut line =
            Self { now: Timestamp::ZERO, driver, gimbal, is_cut: false, sent: Vec::new(), reports: Vec::new() };
        line.gimbal.handle_timeout(Timestamp::ZERO);
        line.settle();
        line
    }

    fn settle(&mut self) {
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
                    DriverOutput::Command(command) => panic!("{command:?} waits for an answer"),
                    DriverOutput::Operated { .. } => panic!("nothing was asked"),
                    DriverOutput::Report(report) => self.reports.push((self.now, report)),
                }
            }
            if !busy {
                return;
            }
        }
    }

    fn run_for(&mut self, duration: Duration) {
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

    fn point(&mut self, pitch_deg: f64, yaw_deg: f64) {
        self.driver.handle_setpoint(self.now, pointing(pitch_deg, yaw_deg));
        self.settle();
    }

    /// Pitch and yaw of the latest attitude that was reported, degrees.
    fn reported(&self) -> (f64, f64) {
        let attitude = self.reports.iter().rev().find_map(|(_, report)| match report {
            Report::Attitude(status) => Some(status.attitude.angles()),
            _ => None,
        });
        let angles = attitude.expect("it is reported");
        (angles.pitch.degrees(), angles.yaw.degrees())
    }

    fn is_open_loop(&self) -> bool {
        let identity = self.reports.iter().rev().find_map(|(_, report)| match report {
            Report::Known(identity, _) => Some(identity),
            _ => None,
        });
        identity.expect("it is known").custom_name == "open loop"
    }
}

fn pointing(pitch_deg: f64, yaw_deg: f64) -> Setpoint {
    let degrees = Angle::from_degrees;
    Setpoint::Point(Pointing {
        roll: Angle::ZERO,
        pitch: degrees(pitch_deg),
        yaw: Yaw::InVehicleFrame(degrees(yaw_deg)),
        stabilised: Stabilised::BOTH,
        radio_control: RadioControl::default(),
    })
}

fn assert_near(reported: (f64, f64), expected: (f64, f64)) {
    let off = (reported.0 - expected.0).abs().max((reported.1 - expected.1).abs());
    assert!(off < 0.2, "{reported:?} instead of {expected:?}");
}

const SECOND: Duration = Duration::from_secs(1);

/// Gimbal statements 34 and 46: what is told in MAVLink's signs comes back in them, whichever way the device counts,
/// and whichever message it reports with.
#[test]
fn statements_34_and_46_a_gimbal_goes_where_it_is_told_in_either_sign() {
    for signs in [Signs::Normal, Signs::Reversed] {
        for reports in [Reports::Orientation, Reports::Status] {
            let mut line = Line::new(signs, reports);
            line.run_for(3 * SECOND);
            line.point(-45.0, 30.0);
            line.run_for(3 * SECOND);
            assert_near(line.reported(), (-45.0, 30.0));
            assert!(!line.is_open_loop());
        }
    }
}

/// "Treat HEARTBEAT.system_status ≠ ACTIVE as not ready: hold targets"; nothing is sent before the first demand.
#[test]
fn a_gimbal_that_starts_up_is_told_when_it_is_ready() {
    let mut line = Line::new(Signs::Normal, Reports::Orientation);
    line.point(-20.0, 10.0);
    line.point(-45.0, 30.0);
    line.run_for(Duration::from_millis(1_900));
    assert_eq!(line.sent, []);

    line.run_for(Duration::from_millis(200));

    let (at, command) = &line.sent[0];
    assert_eq!((*at, line.sent.len()), (Timestamp::from_secs(2), 1), "it says ACTIVE with its third heartbeat");
    assert_eq!((command.param1, command.param3, command.param7), (-45.0, 30.0, 2.0));
}

/// "Send 205 (COMMAND_LONG, mode 2) at ≥ 2 Hz"; "never send 204/205 faster than 50 Hz … keep only the newest".
#[test]
fn a_setpoint_is_repeated_twice_a_second_and_never_sent_faster_than_fifty_hertz() {
    let mut line = Line::new(Signs::Normal, Reports::Orientation);
    line.run_for(3 * SECOND);
    for step in 0..200 {
        line.point(-f64::from(step) / 10.0, 0.0);
        line.run_for(Duration::from_millis(5));
    }
    line.run_for(SECOND);
    let times: Vec<Timestamp> = line.sent.iter().map(|(at, _)| *at).collect();
    assert!(times.windows(2).all(|pair| pair[1].since(pair[0]) >= Duration::from_millis(20)), "{times:?}");
    let last: Vec<f32> = line.sent.iter().rev().take(3).map(|(_, command)| command.param1).collect();
    assert_eq!(last, [-19.9, -19.9, -19.9], "the newest wins, and is repeated");
    let mut repeats = times.windows(2).rev().map(|pair| pair[1].since(pair[0]));
    assert_eq!(repeats.next(), Some(Duration::from_millis(500)));
}

/// Gimbal statement 47: "Without any v1 feedback 285 is produced open loop, slew-limited, and marked."
#[test]
fn statement_47_without_reports_the_attitude_is_a_slow_guess() {
    let mut line = Line::new(Signs::Normal, Reports::Nothing);
    line.run_for(4 * SECOND);
    assert!(line.is_open_loop());
    assert_near(line.reported(), (0.0, 0.0));

    line.point(-60.0, 0.0);
    line.run_for(SECOND);
    assert_near(line.reported(), (-30.0, 0.0));
    line.run_for(2 * SECOND);
    assert_near(line.reported(), (-60.0, 0.0));
}

/// D9: a gimbal that was lost is not moved when it comes back, until somebody asks.
#[test]
fn a_gimbal_that_was_lost_is_told_nothing_until_asked() {
    let mut line = Line::new(Signs::Normal, Reports::Orientation);
    line.run_for(3 * SECOND);
    line.point(-30.0, 0.0);
    line.run_for(SECOND);
    line.is_cut = true;
    line.run_for(6 * SECOND);
    assert!(line.reports.iter().any(|(_, report)| *report == Report::Lost));
    line.sent.clear();

    line.is_cut = false;
    line.run_for(5 * SECOND);

    assert_eq!(line.sent, []);
    assert!(matches!(line.reports.last(), Some((_, Report::Attitude(_)))));
}

/// With a fixed system id it speaks first: over UDP the other side may be waiting for that.
#[test]
fn a_gimbal_with_an_id_of_its_own_speaks_first() {
    let settings = DeviceSettings { system_id: SystemId::Fixed(1), ..DeviceSettings::default() };
    let mut gimbal = Device::new(Timestamp::ZERO, settings);
    assert_eq!(gimbal.poll_timeout(), Some(Timestamp::ZERO));

    gimbal.handle_timeout(Timestamp::ZERO);

    let first = gimbal.poll_output().expect("it speaks");
    assert_eq!(DatagramFrames::new(&first).next_frame().expect("a frame").message_id(), message::HEARTBEAT);
}

/// "Wait for a HEARTBEAT. Ignore type 6 (GCS) … Adopt that sysid" (gimbal statement 33).
#[test]
fn statement_33_a_gimbal_takes_the_system_of_a_vehicle_and_not_of_a_ground_station() {
    let heartbeat = |mavtype| HEARTBEAT_DATA {
        custom_mode: 0,
        mavtype,
        autopilot: 3,
        base_mode: 0,
        system_status: 4,
        mavlink_version: 3,
    };
    let mut gimbal = Device::new(Timestamp::ZERO, DeviceSettings::default());
    gimbal.handle_timeout(Timestamp::ZERO);
    gimbal.handle_received(Timestamp::ZERO, &encode_to_vec(MavId::new(255, 190), 0, &heartbeat(6)));
    assert_eq!(gimbal.poll_output(), None);

    gimbal.handle_received(Timestamp::ZERO, &encode_to_vec(MavId::new(7, 1), 0, &heartbeat(2)));

    let first = gimbal.poll_output().expect("it speaks");
    assert_eq!(DatagramFrames::new(&first).next_frame().expect("a frame").source(), MavId::new(7, 154));
}
