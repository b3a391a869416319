use std::time::Duration;

use super::*;
use crate::geometry::Yaw;
use crate::gimbals::mavlink_v1::sim::{Device, DeviceSettings, Feedback as Reports, SystemId};
use crate::gimbals::setpoint::Stabilised;
use crate::gimbals::signs::{Sign, Signs};
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
    /// What is sent until it is answered.
    ordered: Vec<(Timestamp, COMMAND_LONG_DATA)>,
    reports: Vec<(Timestamp, Report)>,
}

impl Line {
    fn new(signs: Signs, reports: Reports) -> Self {
        let settings = V1Settings { sign: signs, ..V1Settings::default() };
        Self::with(settings, DeviceSettings { signs, feedback: reports, ..DeviceSettings::default() })
    }

    fn with(settings: V1Settings, device: DeviceSettings) -> Self {
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

    fn tell(&mut self, setpoint: Setpoint) {
        self.driver.handle_setpoint(self.now, setpoint);
        self.settle();
    }

    /// What was ordered last arrives, and is answered.
    fn answer(&mut self) {
        let (_, command) = self.ordered.last().expect("something was ordered").clone();
        self.gimbal.handle_received(self.now, &encode_to_vec(MANAGER, 0, &command));
        self.driver.handle_command_outcome(self.now, &command, CommandOutcome::Answered(0));
        self.settle();
    }

    /// Flags of the latest attitude that was reported.
    fn flags(&self) -> GimbalFlags {
        let flags = self.reports.iter().rev().find_map(|(_, report)| match report {
            Report::Attitude(status) => Some(status.flags),
            _ => None,
        });
        flags.expect("it is reported")
    }

    /// The parameters of what was sent last.
    fn told(&self) -> [f32; 4] {
        let (_, command) = self.sent.last().expect("it was told");
        [command.param1, command.param2, command.param3, command.param7]
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
    for signs in [Signs::NORMAL, Signs::REVERSED] {
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
    let mut line = Line::new(Signs::NORMAL, Reports::Orientation);
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
    let mut line = Line::new(Signs::NORMAL, Reports::Orientation);
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
    let mut line = Line::new(Signs::NORMAL, Reports::Nothing);
    line.run_for(4 * SECOND);
    assert!(line.is_open_loop());
    let last = line.reports.iter().rev().find_map(|(_, report)| match report {
        Report::Attitude(status) => Some(status.is_assumed),
        _ => None,
    });
    assert_eq!(last, Some(true));
    assert_near(line.reported(), (0.0, 0.0));

    line.point(-60.0, 0.0);
    line.run_for(SECOND);
    assert_near(line.reported(), (-30.0, 0.0));
    line.run_for(2 * SECOND);
    assert_near(line.reported(), (-60.0, 0.0));

    // One that tells where it looks after all is believed at once, and not marked any more.
    let orientation =
        MOUNT_ORIENTATION_DATA { time_boot_ms: 9_000, roll: 0.0, pitch: 10.0, yaw: 20.0, yaw_absolute: 20.0 };
    let bytes = encode_to_vec(GIMBAL, 0, &orientation);
    line.driver.handle_received(line.now, &DatagramFrames::new(&bytes).next_frame().expect("a frame"));
    line.settle();
    assert!(!line.is_open_loop());
    assert_near(line.reported(), (10.0, 20.0));
}

/// D9: a gimbal that was lost is not moved when it comes back, until somebody asks.
#[test]
fn a_gimbal_that_was_lost_is_told_nothing_until_asked() {
    let mut line = Line::new(Signs::NORMAL, Reports::Orientation);
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

/// "Do not mistake … always store a per-profile sign vector": each axis has its own, in what the gimbal is told and in what
/// it reports.
#[test]
fn each_axis_has_a_sign_of_its_own_both_ways() {
    let only_pitch = Signs { pitch: Sign::Opposite, ..Signs::NORMAL };
    let only_yaw = Signs { yaw: Sign::Opposite, ..Signs::NORMAL };
    for (sign, report_sign) in [(only_pitch, only_yaw), (only_yaw, only_pitch), (Signs::REVERSED, Signs::REVERSED)] {
        for feedback in [Reports::Orientation, Reports::Status] {
            let settings = V1Settings { sign, report_sign, ..V1Settings::default() };
            let device =
                DeviceSettings { signs: sign, report_signs: report_sign, feedback, ..DeviceSettings::default() };
            let mut line = Line::with(settings, device);
            line.run_for(3 * SECOND);
            line.point(-45.0, 30.0);
            line.run_for(3 * SECOND);
            assert_near(line.reported(), (-45.0, 30.0));
            let pose = line.gimbal.plant().pose();
            assert_near((pose.pitch.degrees(), pose.yaw.degrees()), (-45.0, 30.0));
        }
    }
}

/// "On change of control type: COMMAND_LONG 204"; "send one command and keep only the newest (coalesce) while an ACKed mode
/// command is outstanding". ArduPilot never sends 204, nor do we by default.
#[test]
fn a_gimbal_that_needs_it_is_configured_before_each_change_of_mode() {
    let settings = V1Settings { configures: true, ..V1Settings::default() };
    let mut line = Line::with(settings, DeviceSettings { needs_configuring: true, ..DeviceSettings::default() });
    line.run_for(3 * SECOND);
    for pitch in [-10.0, -20.0, -30.0] {
        line.point(pitch, 0.0);
        line.run_for(SECOND / 10);
    }
    assert_eq!(line.sent, [], "nothing is told before the mode is");
    assert_eq!(line.ordered.len(), 1);
    let (_, command) = &line.ordered[0];
    let COMMAND_LONG_DATA { param1, param2, param3, param4, param5, param6, param7, command, .. } = command;
    assert_eq!((*command, [*param1, *param2, *param3, *param4]), (204, [2.0, 1.0, 1.0, 0.0]));
    assert_eq!([*param5, *param6, *param7], [2.0, 2.0, 0.0], "roll, pitch, yaw");

    line.answer();
    assert_eq!(line.sent.len(), 1, "the newest only");
    assert_eq!(line.told(), [-30.0, 0.0, 0.0, 2.0]);
    line.point(-40.0, 0.0);
    line.run_for(SECOND);
    assert_eq!((line.ordered.len(), line.told()), (1, [-40.0, 0.0, 0.0, 2.0]), "once for each mode");

    for (setpoint, mode) in [(Setpoint::Retract, 0.0), (pointing(-5.0, 0.0), 2.0), (Setpoint::Neutral, 1.0)] {
        line.sent.clear();
        line.tell(setpoint);
        assert_eq!((line.ordered.last().map(|(_, command)| command.param1), line.sent.len()), (Some(mode), 0));
        line.answer();
        line.run_for(SECOND / 50);
        assert_eq!(line.told()[3], mode);
        assert_eq!(f32::from(line.gimbal.mode()), mode);
    }

    // Whoever does not take it does without.
    line.sent.clear();
    line.point(-15.0, 0.0);
    let (_, order) = line.ordered.last().expect("ordered").clone();
    line.driver.handle_command_outcome(line.now, &order, CommandOutcome::Unanswered);
    line.settle();
    line.run_for(SECOND);
    assert_eq!(line.told(), [-15.0, 0.0, 0.0, 2.0]);

    let mut line = Line::with(V1Settings::default(), DeviceSettings::default());
    line.run_for(3 * SECOND);
    line.point(-10.0, 0.0);
    line.tell(Setpoint::Neutral);
    assert_eq!(line.ordered, [], "by default it is never sent");
}

/// "After gimbal HEARTBEAT loss > 5 s forget FOLLOW/LOCK state and re-send mode on return": with the next demand, since 204
/// alone moves some gimbals.
#[test]
fn the_mode_is_forgotten_with_the_gimbal_and_sent_again_when_it_is_back() {
    let settings = V1Settings { configures: true, ..V1Settings::default() };
    let mut line = Line::with(settings, DeviceSettings { needs_configuring: true, ..DeviceSettings::default() });
    line.run_for(3 * SECOND);
    line.point(-10.0, 0.0);
    line.answer();
    line.is_cut = true;
    line.run_for(6 * SECOND);
    line.is_cut = false;
    line.run_for(3 * SECOND);
    assert_eq!(line.ordered.len(), 1, "nobody has asked for anything");

    line.sent.clear();
    line.point(-20.0, 0.0);

    assert_eq!((line.ordered.len(), line.sent.len()), (2, 0));
    line.answer();
    assert_eq!(line.told(), [-20.0, 0.0, 0.0, 2.0]);
}

/// A gimbal that was restarted within the time in which it would be lost, by its clock or by its word, is not moved before
/// somebody asks (D9); a clock that wraps after 49 days is no restart.
#[test]
fn a_gimbal_that_was_restarted_is_told_nothing_until_asked() {
    for reports in [Reports::Orientation, Reports::Status] {
        let mut line = Line::new(Signs::NORMAL, reports);
        line.run_for(6 * SECOND);
        line.point(-30.0, 0.0);
        line.run_for(SECOND);
        line.reports.clear();
        line.sent.clear();
        line.gimbal.handle_reboot(line.now);
        line.run_for(5 * SECOND);
        assert_eq!(line.sent, [], "{reports:?}");
        let restarts = line.reports.iter().filter(|(_, report)| *report == Report::Restarted).count();
        assert_eq!(restarts, 1, "{reports:?}");
        assert!(!line.reports.iter().any(|(_, report)| *report == Report::Lost));
        line.point(-20.0, 0.0);
        assert_eq!(line.told(), [-20.0, 0.0, 0.0, 2.0]);
    }

    let mut driver = MavlinkV1Driver::new(V1Settings::default());
    driver.adopt(Timestamp::ZERO, GIMBAL);
    let mut restarts = |time_boot_ms| {
        let orientation = MOUNT_ORIENTATION_DATA { time_boot_ms, roll: 0.0, pitch: 0.0, yaw: 0.0, yaw_absolute: 0.0 };
        let bytes = encode_to_vec(GIMBAL, 0, &orientation);
        driver.handle_received(Timestamp::ZERO, &DatagramFrames::new(&bytes).next_frame().expect("a frame"));
        std::iter::from_fn(|| driver.poll_output()).any(|output| output == DriverOutput::Report(Report::Restarted))
    };
    for (time_boot_ms, restarted) in
        [(u32::MAX - 50, false), (49, false), (5_000, false), (4_500, false), (5_000, false), (100, true), (0, false)]
    {
        assert_eq!(restarts(time_boot_ms), restarted, "{time_boot_ms}");
    }
}

/// "RC_EXCLUSIVE: stop sending", or "205 p7=3" to one that knows it; the next angle takes the gimbal back.
#[test]
fn radio_control_gets_the_gimbal_by_silence_or_by_its_mode() {
    let handed_over = |pitch_deg| match pointing(pitch_deg, 0.0) {
        Setpoint::Point(pointing) => Setpoint::Point(Pointing { radio_control: RadioControl::Exclusive, ..pointing }),
        other => other,
    };
    for (radio_control, told) in [(V1RadioControl::Silence, 0), (V1RadioControl::Mode, 3)] {
        let settings = V1Settings { radio_control, ..V1Settings::default() };
        let mut line = Line::with(settings, DeviceSettings::default());
        line.run_for(3 * SECOND);
        line.point(-10.0, 0.0);
        line.run_for(SECOND * 11 / 10);
        assert!(!line.flags().contains(GimbalFlags::RC_EXCLUSIVE));
        line.sent.clear();
        for _ in 0..10 {
            line.tell(handed_over(-10.0));
            line.run_for(SECOND / 10);
        }
        assert_eq!(line.sent.len(), told, "at once, and every half second");
        assert!(line.sent.iter().all(|(_, command)| command.param7 == 3.0));
        assert!(line.flags().contains(GimbalFlags::RC_EXCLUSIVE));

        line.sent.clear();
        line.point(-20.0, 0.0);
        line.run_for(SECOND);
        assert_eq!(line.told(), [-20.0, 0.0, 0.0, 2.0]);
        assert!(!line.flags().contains(GimbalFlags::RC_EXCLUSIVE));
    }
    // Without radio control of its own nothing is handed over.
    let mut line = Line::with(V1Settings::default(), DeviceSettings::default());
    line.run_for(3 * SECOND);
    line.tell(handed_over(-10.0));
    assert_eq!(line.told(), [-10.0, 0.0, 0.0, 2.0]);
}

/// "Treat HEARTBEAT.system_status ≠ ACTIVE as not ready: hold targets"; one that never sets it is ready.
#[test]
fn what_is_asked_while_the_gimbal_stands_by_is_held() {
    for (state, ready) in [(0, true), (1, false), (2, false), (3, false), (4, true), (5, true), (6, true), (7, false)] {
        let mut driver = MavlinkV1Driver::new(V1Settings::default());
        driver.adopt(Timestamp::ZERO, GIMBAL);
        let mut hear = |now: Timestamp, state: u8| {
            let heartbeat = HEARTBEAT_DATA {
                custom_mode: 0,
                mavtype: 26,
                autopilot: 8,
                base_mode: 0,
                system_status: state,
                mavlink_version: 3,
            };
            let bytes = encode_to_vec(GIMBAL, 0, &heartbeat);
            driver.handle_received(now, &DatagramFrames::new(&bytes).next_frame().expect("a frame"));
            if state != mav_state::ACTIVE || now == Timestamp::ZERO {
                driver.handle_setpoint(now, pointing(-20.0, 0.0));
            }
            let outputs = std::iter::from_fn(|| driver.poll_output());
            outputs.filter(|output| matches!(output, DriverOutput::Message(_))).count()
        };
        assert_eq!(hear(Timestamp::ZERO, state), usize::from(ready), "state {state}");
        assert_eq!(hear(Timestamp::from_millis(100), 4), usize::from(!ready), "state {state}");
    }
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
