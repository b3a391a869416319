use super::*;
use crate::geometry::{AngularRate, YawFrame};
use crate::gimbals::gremsy::packet;
use crate::gimbals::operation::Restart;
use crate::gimbals::setpoint::{RadioControl, Stabilised};
use crate::wire::dialect::{
    CharArray, GIMBAL_DEVICE_INFORMATION_DATA, GIMBAL_DEVICE_SET_ATTITUDE_DATA, HEARTBEAT_DATA, MessageData,
    SYS_STATUS_DATA,
};
use crate::wire::ids::{GimbalFlags, mav_state};
use crate::wire::{DatagramFrames, encode_to_vec};

mod operating;
mod telling;

const GIMBAL: MavId = MavId::new(1, 154);

fn hear<M: MessageData>(driver: &mut GremsyDriver, now: Timestamp, message: &M) {
    let bytes = encode_to_vec(GIMBAL, 0, message);
    driver.handle_received(now, &DatagramFrames::new(&bytes).next_frame().expect("a frame"));
}

fn setpoints(driver: &mut GremsyDriver) -> Vec<GIMBAL_DEVICE_SET_ATTITUDE_DATA> {
    let mut all = Vec::new();
    while let Some(output) = driver.poll_output() {
        if let DriverOutput::Message(message) = output
            && let MavMessage::GIMBAL_DEVICE_SET_ATTITUDE(setpoint) = *message
        {
            all.push(setpoint);
        }
    }
    all
}

fn heartbeat() -> HEARTBEAT_DATA {
    HEARTBEAT_DATA {
        custom_mode: 0,
        mavtype: 26,
        autopilot: 8,
        base_mode: 0,
        system_status: mav_state::ACTIVE,
        mavlink_version: 3,
    }
}

/// Motors on, following; `not_aligned` as `errors_count2`.
fn status(not_aligned: u16) -> SYS_STATUS_DATA {
    SYS_STATUS_DATA {
        onboard_control_sensors_present: 0,
        onboard_control_sensors_enabled: 0,
        onboard_control_sensors_health: 0,
        load: 0,
        voltage_battery: 0,
        current_battery: 0,
        battery_remaining: 0,
        drop_rate_comm: 0,
        errors_comm: 0,
        errors_count1: 0x0011,
        errors_count2: not_aligned,
        errors_count3: 0,
        errors_count4: 0,
        onboard_control_sensors_present_extended: 0,
        onboard_control_sensors_enabled_extended: 0,
        onboard_control_sensors_health_extended: 0,
    }
}

/// A gimbal that beats and is ready, without parameters, for so many milliseconds.
fn run(driver: &mut GremsyDriver, from: u64, to: u64) -> Vec<(u64, GIMBAL_DEVICE_SET_ATTITUDE_DATA)> {
    run_with(driver, from, to, &status(0))
}

/// The same with another status.
fn run_with(
    driver: &mut GremsyDriver,
    from: u64,
    to: u64,
    status: &SYS_STATUS_DATA,
) -> Vec<(u64, GIMBAL_DEVICE_SET_ATTITUDE_DATA)> {
    let heartbeat = heartbeat();
    let mut sent = Vec::new();
    for millis in from..to {
        let now = Timestamp::from_millis(millis);
        if millis.is_multiple_of(1_000) {
            hear(driver, now, &heartbeat);
            hear(driver, now, status);
        }
        if driver.poll_timeout().is_some_and(|due| due <= now) {
            driver.handle_timeout(now);
            assert!(driver.poll_timeout().is_none_or(|due| due > now), "a timeout that never passes at {now}");
        }
        sent.extend(setpoints(driver).into_iter().map(|setpoint| (millis, setpoint)));
    }
    sent
}

/// Nobody repeats a rotation, for whatever reason: it ends in v2 as well.
#[test]
fn a_rate_in_v2_that_nobody_repeats_is_stopped() {
    let mut driver =
        GremsyDriver::new(GremsySettings { generation: Some(Generation::V2), ..GremsySettings::default() });
    driver.adopt(Timestamp::ZERO, GIMBAL);
    assert_eq!(run(&mut driver, 0, 12_000), []);
    assert_eq!(driver.details(Timestamp::from_secs(12)).stage.as_deref(), Some("running"));
    let turning = Turning {
        roll: None,
        pitch: AngularRate::ZERO,
        yaw: AngularRate::from_degrees_per_second(20.0),
        yaw_frame: YawFrame::Vehicle,
        stabilised: Stabilised::BOTH,
        radio_control: RadioControl::Off,
    };

    driver.handle_setpoint(Timestamp::from_secs(12), Setpoint::Turn(turning));
    let sent = run(&mut driver, 12_000, 16_000);

    let rates: Vec<(u64, bool)> = sent.iter().map(|(at, sent)| (*at, sent.angular_velocity_z == 0.0)).collect();
    // It answers none of them, so they are said for a second in which it is heard: each of its beats vouches for half a one.
    let zeros = (12_500..14_000).step_by(100).map(|at| (at, true));
    assert_eq!(rates, [(12_000, false)].into_iter().chain(zeros).collect::<Vec<_>>());
}

/// Zeros into the void stop nothing: they go on, less often, until the gimbal was heard for a second.
#[test]
fn a_stop_in_v2_is_said_on_until_the_gimbal_is_heard() {
    let mut driver =
        GremsyDriver::new(GremsySettings { generation: Some(Generation::V2), ..GremsySettings::default() });
    driver.adopt(Timestamp::ZERO, GIMBAL);
    run(&mut driver, 0, 12_000);
    let turning = Turning { yaw: AngularRate::from_degrees_per_second(20.0), ..Turning::STOPPED };
    driver.handle_setpoint(Timestamp::from_secs(12), Setpoint::Turn(turning));
    setpoints(&mut driver);
    let mut sent = Vec::new();
    for millis in 12_000..30_000 {
        let now = Timestamp::from_millis(millis);
        if driver.poll_timeout().is_some_and(|due| due <= now) {
            driver.handle_timeout(now);
        }
        sent.extend(setpoints(&mut driver).into_iter().map(|zero| (millis, zero.angular_velocity_z)));
    }
    assert!(sent.iter().all(|(_, rate)| *rate == 0.0), "{sent:?}");
    let lost = 11_000 + LOST_AFTER.as_millis() as u64;
    let (there, away): (Vec<u64>, Vec<u64>) = sent.iter().map(|(at, _)| *at).partition(|at| *at < lost);
    assert_eq!(there, (12_500..lost).step_by(100).collect::<Vec<_>>());
    assert!(away.len() >= 13 && away.windows(2).all(|pair| pair[1] - pair[0] >= 1_000), "{away:?}");
    assert!(driver.may_be_turning());

    let sent: Vec<u64> = run(&mut driver, 30_000, 40_000).iter().map(|(at, _)| *at).collect();
    assert_eq!(sent.first(), Some(&30_000), "as soon as it is heard");
    assert!(sent.last().is_some_and(|last| (31_000..32_000).contains(last)), "{sent:?}");
    assert!(!driver.may_be_turning());
}

/// A stop takes no knowledge of the gimbal: before it is known what it speaks, zeros in both protocols, until it answers
/// one or is known not to speak v1.
#[test]
fn a_stop_is_said_before_the_gimbal_is_known() {
    let mut driver = GremsyDriver::new(GremsySettings::default());
    driver.adopt(Timestamp::ZERO, GIMBAL);
    hear(&mut driver, Timestamp::ZERO, &heartbeat());
    assert_eq!(zeros(&mut driver), (0, 0));

    driver.handle_setpoint(Timestamp::ZERO, Setpoint::Turn(Turning::STOPPED));

    assert_eq!(zeros(&mut driver), (1, 1));
    assert!(driver.may_be_turning());
    let (mut v1, mut v2) = (0, 0);
    for millis in (10_u64..3_000).step_by(10) {
        if millis.is_multiple_of(100) {
            hear(&mut driver, Timestamp::from_millis(millis), &heartbeat());
        }
        driver.handle_timeout(Timestamp::from_millis(millis));
        let (more_v1, more_v2) = zeros(&mut driver);
        (v1, v2) = (v1 + more_v1, v2 + more_v2);
    }
    assert_eq!((v1, v2), (29, 9));
    let ack = COMMAND_ACK_DATA {
        command: command::DO_MOUNT_CONTROL,
        result: CommandResult::Accepted as u8,
        progress: 0,
        result_param2: 0,
        target_system: 1,
        target_component: 191,
    };
    // One for each that may still be answered.
    for _ in 0..6 {
        hear(&mut driver, Timestamp::from_secs(3), &ack);
    }
    assert!(!driver.may_be_turning());
}

/// Zeros of v1 and of v2 that are to be sent.
fn zeros(driver: &mut GremsyDriver) -> (usize, usize) {
    let (mut v1, mut v2) = (0, 0);
    while let Some(output) = driver.poll_output() {
        let DriverOutput::Message(message) = output else { continue };
        v1 += usize::from(*message == MavMessage::COMMAND_LONG(packet::turn_at(GIMBAL, [AngularRate::ZERO; 3])));
        v2 += usize::from(matches!(*message, MavMessage::GIMBAL_DEVICE_SET_ATTITUDE(zero)
            if (zero.angular_velocity_x, zero.angular_velocity_y, zero.angular_velocity_z) == (0.0, 0.0, 0.0)));
    }
    (v1, v2)
}

fn faults(driver: &GremsyDriver) -> Vec<String> {
    driver.details(Timestamp::ZERO).faults
}

/// A joint that searches its home while the gimbal runs keeps it from nothing: it has become ready.
#[test]
fn one_that_has_become_ready_is_not_said_to_become_ready_no_more() {
    let mut driver = GremsyDriver::new(GremsySettings::default());
    driver.adopt(Timestamp::ZERO, GIMBAL);
    run_with(&mut driver, 0, 25_000, &status(0x0040));
    assert!(faults(&driver).iter().any(|fault| fault.starts_with("it does not become ready: pan_home_search.")));
    run(&mut driver, 25_000, 27_000);
    assert_eq!(driver.details(Timestamp::from_secs(27)).stage.as_deref(), Some("running"));
    let ready = faults(&driver);

    run_with(&mut driver, 27_000, 60_000, &status(0x0040));

    assert_eq!(faults(&driver), ready);
    let details = driver.details(Timestamp::from_secs(60));
    assert_eq!((details.stage.as_deref(), details.not_aligned), (Some("running"), vec!["pan_home_search".to_owned()]));
}

/// "ERROR if (ec1 & 0xC004) or (ec2 & 0x0F)" (gimbals 1.4): what fails of these while it runs is a fault as long as it is so; while it
/// starts it is only not in place yet.
#[test]
fn a_sensor_that_fails_while_it_runs_is_a_fault() {
    for (alignment, fault) in [
        (0x0001, Some("sensor error. Restart it without moving it; if it stays, have it repaired")),
        (0x0002, Some("encoder_tilt error. Restart it without moving it; if it stays, have it repaired")),
        (0x000c, Some("encoder_roll, encoder_pan error. Restart it without moving it; if it stays, have it repaired")),
        (0x0040, None),
    ] {
        let mut driver = GremsyDriver::new(GremsySettings::default());
        driver.adopt(Timestamp::ZERO, GIMBAL);
        run_with(&mut driver, 0, 15_000, &status(alignment));
        assert_eq!(faults(&driver), Vec::<String>::new(), "it starts");
        run(&mut driver, 15_000, 27_000);
        assert_eq!(driver.details(Timestamp::from_secs(27)).stage.as_deref(), Some("running"));
        let before = faults(&driver);

        run_with(&mut driver, 27_000, 30_000, &status(alignment));
        let expected: Vec<String> = before.iter().cloned().chain(fault.map(str::to_owned)).collect();
        assert_eq!(faults(&driver), expected, "{alignment:#x}");
        run(&mut driver, 30_000, 32_000);
        assert_eq!(faults(&driver), before, "{alignment:#x}");
    }
}

/// "It stands in the status as long as it is so": firmware with a wrong yaw from North was replaced.
#[test]
fn a_fault_of_the_firmware_ends_with_it() {
    let mut driver = GremsyDriver::new(GremsySettings::default());
    driver.adopt(Timestamp::ZERO, GIMBAL);
    let with_firmware = |driver: &mut GremsyDriver, millis, firmware_version| {
        let information = GIMBAL_DEVICE_INFORMATION_DATA {
            vendor_name: CharArray::from("GREMSY"),
            firmware_version,
            ..GIMBAL_DEVICE_INFORMATION_DATA::DEFAULT
        };
        hear(driver, Timestamp::from_millis(millis), &information);
        run(driver, millis, millis + 20_000);
        faults(driver).iter().any(|fault| fault.contains("reports a wrong yaw from North"))
    };
    run(&mut driver, 0, 1_000);
    assert!(with_firmware(&mut driver, 1_000, 0x0004_0807));
    assert!(!with_firmware(&mut driver, 21_000, 0x0009_0807));
}

/// One that was told to start again is silent for ten seconds and waited for, but not for ever.
#[test]
fn one_that_does_not_come_back_is_lost_after_twenty_seconds() {
    let mut driver =
        GremsyDriver::new(GremsySettings { generation: Some(Generation::V1), ..GremsySettings::default() });
    driver.adopt(Timestamp::ZERO, GIMBAL);
    run(&mut driver, 0, 12_000);
    let now = Timestamp::from_secs(12);
    driver.handle_operation(now, OperationId(1), Operation::Restart(Restart::Reboot));
    let accepted = CommandOutcome::Answered(CommandResult::Accepted as u8);
    driver.handle_command_outcome(now, &packet::reboot(GIMBAL), accepted);

    let mut lost = Vec::new();
    for millis in 12_000..40_000 {
        let now = Timestamp::from_millis(millis);
        if driver.poll_timeout().is_some_and(|due| due <= now) {
            driver.handle_timeout(now);
        }
        while let Some(output) = driver.poll_output() {
            lost.extend((output == DriverOutput::Report(Report::Lost)).then_some(millis));
        }
    }

    assert_eq!(lost, [32_000]);
}
