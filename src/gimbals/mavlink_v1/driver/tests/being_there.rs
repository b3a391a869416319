//! A gimbal that is not ready, was lost or was restarted: what it was told is forgotten.

use super::*;
use crate::sim::peer::Peer;

/// "Treat HEARTBEAT.system_status ≠ ACTIVE as not ready": what was asked before is not done then, for nobody may want it any
/// more; it says ACTIVE with its third heartbeat.
#[test]
fn a_gimbal_that_starts_up_is_told_what_is_asked_when_it_is_ready() {
    let mut line = Line::new(Signs::NORMAL, Reports::Orientation);
    line.point(-20.0, 10.0);
    line.run_for(Duration::from_millis(2_100));
    assert_eq!(line.sent, []);
    let readiness: Vec<_> =
        line.reports.iter().filter(|(_, report)| matches!(report, Report::Readiness(_))).cloned().collect();
    assert_eq!(
        readiness,
        [
            (Timestamp::ZERO, Report::Readiness(Readiness::Starting)),
            (Timestamp::from_secs(2), Report::Readiness(Readiness::Ready))
        ]
    );

    line.point(-45.0, 30.0);
    let (_, command) = &line.sent[0];
    assert_eq!((command.param1, command.param3, command.param7), (-45.0, 30.0, 2.0));
}

/// The same of each state; one that never sets it is ready.
#[test]
fn what_is_asked_while_the_gimbal_stands_by_is_not_done_later() {
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
        assert_eq!(hear(Timestamp::from_millis(100), state), 0, "state {state}: too soon, or not ready");
        assert_eq!(hear(Timestamp::from_secs(1), mav_state::ACTIVE), usize::from(ready), "state {state}");
    }
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
