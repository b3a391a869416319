//! When what is asked of a Gremsy by its name is done.

use super::*;
use crate::gimbals::driver::CommandOutcome;
use crate::gimbals::operation::{Operation, OperationError, OperationId, OperationResult, YawMode};
use crate::wire::dialect::{COMMAND_LONG_DATA, MOUNT_ORIENTATION_DATA};

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

/// What came of it since, and the commands.
fn outcome(driver: &mut GremsyDriver) -> (Vec<OperationResult>, Vec<COMMAND_LONG_DATA>) {
    let (mut results, mut commands) = (Vec::new(), Vec::new());
    while let Some(output) = driver.poll_output() {
        match output {
            DriverOutput::Operated { id, result } => {
                assert_eq!(id, ID);
                results.push(result);
            }
            DriverOutput::Command(command) => commands.push(*command),
            DriverOutput::Message(_) | DriverOutput::Report(_) => {}
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
    assert_eq!(outcome(&mut driver).0, [], "it follows");
    hear(&mut driver, now, &SYS_STATUS_DATA { errors_count1: 0x0010, ..status(0) });
    assert_eq!(outcome(&mut driver).0, [Ok(())]);
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
        assert_eq!(outcome(&mut driver).0, [expected], "last heard at {last_heard_ms}");
    }
}
