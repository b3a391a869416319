//! The mode that is configured before a setpoint, and the one that leaves the gimbal to its radio control.

use super::*;

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
