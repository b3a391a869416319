use super::*;
use crate::geometry::{Angle, Yaw};
use crate::gimbals::mavlink_v1::sim::{DeviceSettings, Feedback as Reports};
use crate::gimbals::setpoint::Stabilised;
use crate::gimbals::signs::{Sign, Signs};
use crate::wire::{DatagramFrames, encode_to_vec};

mod being_there;
mod hearing;
mod line;
mod modes;

use self::line::Line;

const MANAGER: MavId = MavId::new(1, 191);
const GIMBAL: MavId = MavId::new(1, 154);

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
