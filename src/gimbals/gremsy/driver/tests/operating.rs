//! When what is asked of a Gremsy by its name is done.

use super::*;
use crate::gimbals::driver::CommandOutcome;
use crate::gimbals::operation::{Motors, Operation, OperationError, OperationId, OperationResult, YawMode};
use crate::wire::dialect::{COMMAND_LONG_DATA, GIMBAL_DEVICE_ATTITUDE_STATUS_DATA, MOUNT_ORIENTATION_DATA};

const ID: OperationId = OperationId(7);

/// One that has run for so many seconds.
fn running(seconds: u64) -> GremsyDriver {
    let mut driver =
        GremsyDriver::new(GremsySettings { generation: Some(Generation::V1), ..GremsySettings::default() });
    driver.adopt(Timestamp::ZERO, GIMBAL);
    run(&mut driver, 0, seconds * 1_000);
    assert_eq!(driver.details(Timestamp::from_secs(seconds)).stage.as_deref(), Some("running"));
    driver
}

/// What came of it since, and the commands; nothing else is told it.
fn outcome(driver: &mut GremsyDriver) -> (Vec<OperationResult>, Vec<COMMAND_LONG_DATA>) {
    let (mut results, mut commands) = (Vec::new(), Vec::new());
    while let Some(output) = driver.poll_output() {
        match output {
            DriverOutput::Operated { id, result } => {
                assert_eq!(id, ID);
                results.push(result);
            }
            DriverOutput::Command(command) => commands.push(*command),
            DriverOutput::Message(message) => panic!("{message:?}"),
            DriverOutput::Report(_) => {}
        }
    }
    (results, commands)
}

/// Known firmware fault: "ACK without effect". A mode is taken when the status shows it; an answer beside a status that shows
/// the former one is not enough.
#[test]
fn a_mode_is_taken_when_the_status_shows_it() {
    let mut driver = running(15);
    driver.handle_operation(Timestamp::from_secs(15), ID, Operation::SetYawMode(YawMode::Lock));
    let (results, commands) = outcome(&mut driver);
    assert_eq!((results, commands.len()), (vec![], 1));
    assert_eq!((commands[0].command, commands[0].param7), (31_011, 1.0));
    let now = Timestamp::from_millis(15_100);
    driver.handle_command_outcome(now, &commands[0], CommandOutcome::Answered(0));
    hear(&mut driver, now, &status(0));
    assert_eq!(outcome(&mut driver), (vec![], vec![]), "it follows");
    hear(&mut driver, now, &SYS_STATUS_DATA { errors_count1: 0x0010, ..status(0) });
    assert_eq!(outcome(&mut driver), (vec![Ok(())], vec![]));
}

/// "RETRACT in v2 cuts motors": a camera that falls as it was told to turn is told no zeros, which are a mode of their own, from
/// then on; nor is one that turned on until then, on a vehicle that turns.
#[test]
fn no_zeros_are_said_to_one_that_is_being_switched_off() {
    let mut driver =
        GremsyDriver::new(GremsySettings { generation: Some(Generation::V2), ..GremsySettings::default() });
    driver.adopt(Timestamp::ZERO, GIMBAL);
    run(&mut driver, 0, 15_000);
    let turning = Turning { yaw: AngularRate::from_degrees_per_second(20.0), ..Turning::STOPPED };
    driver.handle_setpoint(Timestamp::from_secs(15), Setpoint::Turn(turning));
    driver.handle_operation(Timestamp::from_secs(15), ID, Operation::Motors(Motors::Off));
    let mut sent = Vec::new();
    for millis in (15_000..22_000_u32).step_by(50) {
        let now = Timestamp::from_millis(millis.into());
        let half = 0.01_f32.to_radians() * (millis - 15_000) as f32;
        let retracted = if millis >= 18_300 { GimbalFlags::RETRACT } else { GimbalFlags::empty() };
        let status = GIMBAL_DEVICE_ATTITUDE_STATUS_DATA {
            time_boot_ms: millis,
            q: [half.cos(), 0.0, 0.0, half.sin()],
            flags: (GimbalFlags::ROLL_LOCK | GimbalFlags::PITCH_LOCK | retracted).bits(),
            ..GIMBAL_DEVICE_ATTITUDE_STATUS_DATA::DEFAULT
        };
        hear(&mut driver, now, &status);
        driver.handle_timeout(now);
        let retracts = |flags| GimbalFlags::from_bits_retain(flags).contains(GimbalFlags::RETRACT);
        sent.extend(setpoints(&mut driver).into_iter().map(|sent| (millis, retracts(sent.flags))));
    }
    let expected = [(15_000, false)].into_iter().chain((15_000..=18_000).step_by(100).map(|at| (at, false)));
    let expected = expected.chain((18_000..18_300).step_by(100).map(|at| (at, true)));
    assert_eq!(sent, expected.collect::<Vec<_>>(), "the rate, zeros, and the word for its motors");
}

/// A gimbal that is told to start again, does not answer and falls silent has done it; one that goes on telling where it looks
/// has not.
#[test]
fn a_restart_without_an_answer_is_done_by_a_gimbal_that_falls_silent() {
    for (last_heard_ms, expected) in [(15_100, Ok(())), (15_900, Err(OperationError::NoAnswer))] {
        let mut driver = running(15);
        driver.handle_operation(Timestamp::from_secs(15), ID, Operation::Restart(Restart::Reboot));
        let (results, commands) = outcome(&mut driver);
        assert_eq!((results, commands.len()), (vec![], 1));
        assert_eq!((commands[0].command, commands[0].param4), (246, 1.0));
        let orientation =
            MOUNT_ORIENTATION_DATA { time_boot_ms: last_heard_ms, roll: 0.0, pitch: 0.0, yaw: 0.0, yaw_absolute: 0.0 };
        hear(&mut driver, Timestamp::from_millis(last_heard_ms.into()), &orientation);
        driver.handle_command_outcome(Timestamp::from_secs(16), &commands[0], CommandOutcome::Unanswered);
        assert_eq!(outcome(&mut driver), (vec![expected], vec![]), "last heard at {last_heard_ms}");
    }
}
