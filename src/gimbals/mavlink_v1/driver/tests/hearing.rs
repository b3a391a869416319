//! What is believed of a v1 gimbal, and for how long.

use super::*;
use crate::geometry::AxisLimits;
use crate::gimbals::capabilities::Capabilities;
use crate::sim::peer::Peer;
use crate::wire::dialect::{CharArray, MessageData, PARAM_VALUE_DATA};
use crate::wire::ids::CapFlags;

/// "ArduPilot refuses |pitch| > 90, |roll| > 180, |yaw| > 360": so far is the least that a v1 gimbal is taken to go, which
/// cannot say; "capabilities say what the gimbal can really do": no rates, no yaw from North, radio control only where the
/// user says so.
#[test]
fn a_gimbal_that_cannot_say_what_it_can_is_taken_to_do_what_v1_has() {
    for (radio_control, has_inputs) in
        [(V1RadioControl::None, false), (V1RadioControl::Silence, true), (V1RadioControl::Mode, true)]
    {
        let settings = V1Settings { radio_control, ..V1Settings::default() };
        let mut line = Line::with(settings, DeviceSettings::default());
        line.run_for(3 * SECOND);
        let known: Vec<Capabilities> = line
            .reports
            .iter()
            .filter_map(|(_, report)| match report {
                Report::Known(_, capabilities) => Some(*capabilities),
                _ => None,
            })
            .collect();
        assert_eq!(known.len(), 1);
        let Capabilities { flags, limits, turns, operates, retract_cuts_motors, radio_control_untold } = known[0];
        let inputs = if has_inputs { CapFlags::HAS_RC_INPUTS } else { CapFlags::empty() };
        assert_eq!(flags, plain_flags() | inputs, "{radio_control:?}");
        assert_eq!((turns, operates, retract_cuts_motors, radio_control_untold), (false, false, false, !has_inputs));
        let degrees = |limits: Option<AxisLimits>| {
            limits.map(|limits| [limits.min().degrees().round() as i32, limits.max().degrees().round() as i32])
        };
        assert_eq!(degrees(limits.roll), Some([-180, 180]));
        assert_eq!(degrees(limits.pitch), Some([-90, 90]));
        assert_eq!(degrees(limits.yaw), Some([-180, 180]));
    }
}

fn plain_flags() -> CapFlags {
    CapFlags::HAS_RETRACT
        | CapFlags::HAS_NEUTRAL
        | CapFlags::HAS_ROLL_AXIS
        | CapFlags::HAS_ROLL_LOCK
        | CapFlags::HAS_PITCH_AXIS
        | CapFlags::HAS_PITCH_LOCK
        | CapFlags::HAS_YAW_AXIS
        | CapFlags::HAS_YAW_FOLLOW
}

/// Of one that tells where it looks in both ways, `MOUNT_ORIENTATION` is believed and `MOUNT_STATUS`, which may be the
/// encoders, is not.
#[test]
fn who_tells_where_it_looks_in_two_ways_is_believed_in_one() {
    let mut line = Line::new(Signs::NORMAL, Reports::Orientation);
    line.run_for(3 * SECOND);
    line.reports.clear();
    for _ in 0..10 {
        line.hear(&mount_status(-4_500));
        line.run_for(SECOND / 10);
    }
    assert_near(line.reported(), (0.0, 0.0));
    let told = line.reports.iter().filter(|(_, report)| matches!(report, Report::Attitude(_))).count();
    assert!((9..=11).contains(&told), "{told}");
}

/// Gimbal statement 47: "Without any v1 feedback 285 is produced open loop, slew-limited, and marked", on every axis; one
/// that tells it again is not guessed about any more.
#[test]
fn statement_47_each_axis_is_guessed_slowly_until_it_is_told() {
    let mut line = Line::new(Signs::NORMAL, Reports::Nothing);
    line.run_for(4 * SECOND);
    let Setpoint::Point(ahead) = pointing(-60.0, 90.0) else { panic!("it is a direction") };
    line.tell(Setpoint::Point(Pointing { roll: Angle::from_degrees(45.0), ..ahead }));
    line.run_for(SECOND);
    assert_eq!(guesses(&line).last(), Some(&[30, -30, 30]));
    line.hear(&MOUNT_ORIENTATION_DATA { time_boot_ms: 9_000, roll: 5.0, pitch: 10.0, yaw: 20.0, yaw_absolute: 20.0 });
    line.reports.clear();
    line.run_for(SECOND);
    assert_eq!(guesses(&line), [[0; 3]; 0]);
    // Silent for two seconds, it is guessed about from where it was last.
    line.run_for(SECOND * 12 / 10);
    assert!(line.is_open_loop());
    assert_eq!(guesses(&line), [[5, 10, 20], [8, 7, 23], [11, 4, 26]]);
}

/// Roll, pitch and yaw of every attitude that was reported, whole degrees.
fn guesses(line: &Line) -> Vec<[i32; 3]> {
    let degrees = |angle: Angle| angle.degrees().round() as i32;
    let angles = line.reports.iter().filter_map(|(_, report)| match report {
        Report::Attitude(status) => Some(status.attitude.angles()),
        _ => None,
    });
    angles.map(|angles| [angles.roll, angles.pitch, angles.yaw].map(degrees)).collect()
}

/// "After gimbal HEARTBEAT loss > 5 s forget FOLLOW/LOCK state and re-send mode on return"; one that was restarted has
/// forgotten it just so.
#[test]
fn the_mode_is_forgotten_by_a_gimbal_that_was_restarted() {
    let settings = V1Settings { configures: true, ..V1Settings::default() };
    let mut line = Line::with(settings, DeviceSettings { needs_configuring: true, ..DeviceSettings::default() });
    line.run_for(6 * SECOND);
    line.point(-10.0, 0.0);
    line.answer();
    line.gimbal.handle_reboot(line.now);
    line.run_for(5 * SECOND);
    assert_eq!(line.ordered.len(), 1, "nobody has asked for anything");
    line.sent.clear();
    line.point(-20.0, 0.0);
    assert_eq!((line.ordered.len(), line.sent.len()), (2, 0));
    line.answer();
    assert_eq!(line.told(), [-20.0, 0.0, 0.0, 2.0]);
}

/// "Send one command and keep only the newest (coalesce) while an ACKed mode command is outstanding": what comes of an
/// earlier one says nothing of that.
#[test]
fn the_answer_to_an_earlier_mode_is_not_taken_for_that_to_the_latest() {
    let settings = V1Settings { configures: true, ..V1Settings::default() };
    let mut line = Line::with(settings, DeviceSettings::default());
    line.run_for(6 * SECOND);
    line.point(-10.0, 0.0);
    let (_, earlier) = line.ordered[0].clone();
    line.gimbal.handle_reboot(line.now);
    line.run_for(5 * SECOND);
    line.tell(Setpoint::Retract);
    assert_eq!(line.ordered.iter().map(|(_, order)| order.param1).collect::<Vec<_>>(), [2.0, 0.0]);
    line.driver.handle_command_outcome(line.now, &earlier, CommandOutcome::Answered(0));
    line.settle();
    assert_eq!(line.sent, []);
    line.answer();
    assert_eq!(line.told(), [0.0, 0.0, 0.0, 0.0]);
}

/// "RC_EXCLUSIVE: stop sending": to be silent takes no mode, so a gimbal that wants one told is not told that either.
#[test]
fn a_gimbal_is_left_to_its_radio_control_without_being_configured_for_it() {
    let settings = V1Settings { configures: true, radio_control: V1RadioControl::Silence, ..V1Settings::default() };
    let mut line = Line::with(settings, DeviceSettings { needs_configuring: true, ..DeviceSettings::default() });
    line.run_for(3 * SECOND);
    line.point(-10.0, 0.0);
    line.answer();
    line.run_for(SECOND / 10);
    line.sent.clear();
    let Setpoint::Point(pointing) = pointing(-10.0, 0.0) else { panic!("it is one") };
    line.tell(Setpoint::Point(Pointing { radio_control: RadioControl::Exclusive, ..pointing }));
    line.run_for(2 * SECOND);
    assert_eq!((line.ordered.len(), line.sent.len()), (1, 0));
    assert!(line.flags().contains(GimbalFlags::RC_EXCLUSIVE));
}

/// One that is taken for a plain v1 gimbal and says that it is a Gremsy is named; another that comes in its place is not.
#[test]
fn what_a_gimbal_said_of_its_maker_is_forgotten_with_it() {
    let mut line = Line::new(Signs::NORMAL, Reports::Orientation);
    line.run_for(3 * SECOND);
    let faults = |line: &Line| line.driver.details(line.now).faults;
    assert_eq!(faults(&line), [""; 0]);
    line.hear(&PARAM_VALUE_DATA {
        param_value: 20.0,
        param_count: 1,
        param_index: 0,
        param_id: CharArray::from("STIFF_TILT"),
        param_type: 4,
    });
    assert_eq!(faults(&line), [gremsy::wrong_family(Family::MavlinkV1)]);
    line.is_cut = true;
    line.run_for(6 * SECOND);
    line.is_cut = false;
    line.run_for(2 * SECOND);
    assert_eq!(faults(&line), [""; 0]);
}

/// What it does while nobody hears it does not count: after a silence it has eight seconds anew.
#[test]
fn a_gimbal_that_was_silent_is_not_found_to_rest_at_once() {
    let mut line = Line::new(Signs::NORMAL, Reports::Nothing);
    let orientation =
        |time_boot_ms| MOUNT_ORIENTATION_DATA { time_boot_ms, roll: 0.0, pitch: 0.0, yaw: 0.0, yaw_absolute: 0.0 };
    // It says ACTIVE with its third heartbeat.
    line.run_for(SECOND * 21 / 10);
    line.point(-30.0, 0.0);
    let mut boot_ms = 1_000;
    let mut tell = |line: &mut Line, tenths: u32| {
        for _ in 0..tenths {
            boot_ms += 100;
            line.hear(&orientation(boot_ms));
            line.run_for(SECOND / 10);
        }
    };
    let found = |line: &Line| {
        line.reports.iter().any(|(_, report)| *report == Report::Fault("is told angles but does not move"))
    };
    tell(&mut line, 50);
    line.run_for(4 * SECOND);
    tell(&mut line, 78);
    assert!(!found(&line));
    tell(&mut line, 5);
    assert!(found(&line));
}

fn mount_status(pitch_cdeg: i32) -> MOUNT_STATUS_DATA {
    MOUNT_STATUS_DATA {
        pointing_a: pitch_cdeg,
        pointing_b: 0,
        pointing_c: 0,
        target_system: 0,
        target_component: 0,
        mount_mode: 2,
    }
}

impl Line {
    /// The gimbal says something besides.
    fn hear<M: MessageData>(&mut self, message: &M) {
        let bytes = encode_to_vec(GIMBAL, 0, message);
        self.driver.handle_received(self.now, &DatagramFrames::new(&bytes).next_frame().expect("a frame"));
        self.settle();
    }
}
