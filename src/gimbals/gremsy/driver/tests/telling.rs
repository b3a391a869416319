//! What the driver makes of what a Gremsy tells.

use super::*;
use crate::geometry::Yaw;
use crate::gimbals::report::GimbalAttitude;
use crate::gimbals::setpoint::Pointing;
use crate::wire::dialect::{MOUNT_ORIENTATION_DATA, MOUNT_STATUS_DATA, PARAM_VALUE_DATA, RAW_IMU_DATA};

fn driver(generation: Generation) -> GremsyDriver {
    let settings = GremsySettings { generation: Some(generation), ..GremsySettings::default() };
    let mut driver = GremsyDriver::new(settings);
    driver.adopt(Timestamp::ZERO, GIMBAL);
    driver
}

fn tell_parameter(driver: &mut GremsyDriver, now: Timestamp, name: &str, value: i16) {
    let message = PARAM_VALUE_DATA {
        param_value: f32::from(value),
        param_count: 40,
        param_index: 0,
        param_id: CharArray::from(name),
        param_type: 4,
    };
    hear(driver, now, &message);
}

fn tell_orientation(driver: &mut GremsyDriver, millis: u64, yaw: f32, yaw_absolute: f32) {
    let time_boot_ms = millis as u32;
    let orientation = MOUNT_ORIENTATION_DATA { time_boot_ms, roll: 0.0, pitch: 0.0, yaw, yaw_absolute };
    hear(driver, Timestamp::from_millis(millis), &orientation);
}

fn stage(driver: &GremsyDriver) -> Option<String> {
    driver.details(Timestamp::ZERO).stage
}

/// Gimbal statement 11: "`present` becomes true only after parameters are settled for 1 s and errors_count2 == 0": everything
/// is in place from the first second on, and the parameters still come.
#[test]
fn statement_11_it_is_not_ready_while_parameters_come() {
    for generation in [Generation::V1, Generation::V2] {
        let mut driver = driver(generation);
        let mut at = 0;
        for row in ParameterTable::New.rows() {
            run(&mut driver, at, at + 200);
            at += 200;
            tell_parameter(&mut driver, Timestamp::from_millis(at), row.name, 7);
        }

        run(&mut driver, at, at + 1_000);
        assert_eq!(stage(&driver).as_deref(), Some("reading_parameters"));

        run(&mut driver, at + 1_000, at + 1_001);
        assert_eq!(stage(&driver).as_deref(), Some("running"), "{generation:?}");
    }
}

/// Gimbal statement 21: "Raw encoder 16384 with MAV_TS_ENCNT=1 decodes to 90.00°; −16384 to −90.00°", and hundredths of a degree
/// with 0. 22: "RAW_IMU zacc 8192 decodes to 1.000 g; xgyro 328 to 10.0 °/s."
#[test]
#[rustfmt::skip]
fn statements_21_and_22_what_it_measures_is_shown() {
    for (encoder_unit, [tilt, roll, pan]) in [
        // The vendor's default, where the gimbal does not say.
        (None,         [90.0, 0.0, -90.0]),
        (Some(1),      [90.0, 0.0, -90.0]),
        (Some(0),      [163.84, 0.0, -163.84]),
    ] {
        let mut driver = driver(Generation::V1);
        hear(&mut driver, Timestamp::ZERO, &heartbeat());
        tell_parameter(&mut driver, Timestamp::ZERO, "STIFF_TILT", 20);
        if let Some(unit) = encoder_unit {
            tell_parameter(&mut driver, Timestamp::ZERO, "MAV_TS_ENCNT", unit);
        }
        let (pointing_a, pointing_b, pointing_c) = (16_384, 0, -16_384);
        let encoders = MOUNT_STATUS_DATA { pointing_a, pointing_b, pointing_c, target_system: 0, target_component: 0, mount_mode: 2 };
        hear(&mut driver, Timestamp::ZERO, &encoders);
        hear(&mut driver, Timestamp::ZERO, &RAW_IMU_DATA { zacc: 8192, xgyro: 328, ..RAW_IMU_DATA::DEFAULT });

        let details = driver.details(Timestamp::from_millis(40));
        let encoders = details.encoders.expect("it has told them");
        for (shown, expected) in [(encoders.tilt_deg, tilt), (encoders.roll_deg, roll), (encoders.pan_deg, pan)] {
            assert!((shown - expected).abs() < 1e-9, "{encoder_unit:?} {encoders:?}");
        }
        assert_eq!((encoders.raw, encoders.age_ms), ([16_384, 0, -16_384], 40));
        let imu = details.imu.expect("it has told that");
        assert_eq!(imu.acceleration_g, [0.0, 0.0, 1.0]);
        assert!((imu.rates_dps[0] - 10.0).abs() < 1e-9 && imu.rates_dps[1..] == [0.0, 0.0], "{imu:?}");
    }
}

/// Gimbal statement 21: "Raw encoder 16384 with MAV_TS_ENCNT=1 decodes to 90.00°": what was told in another unit than the
/// gimbal has by now is not shown as if it were in that.
#[test]
fn statement_21_encoders_told_in_the_former_unit_are_not_shown() {
    let mut driver = driver(Generation::V1);
    hear(&mut driver, Timestamp::ZERO, &heartbeat());
    tell_parameter(&mut driver, Timestamp::ZERO, "STIFF_TILT", 20);
    tell_parameter(&mut driver, Timestamp::ZERO, "MAV_TS_ENCNT", 1);
    let (pointing_a, pointing_b, pointing_c) = (16_384, 0, -9_000);
    let encoders =
        MOUNT_STATUS_DATA { pointing_a, pointing_b, pointing_c, target_system: 0, target_component: 0, mount_mode: 2 };
    hear(&mut driver, Timestamp::ZERO, &encoders);
    assert!(driver.details(Timestamp::ZERO).encoders.is_some());

    tell_parameter(&mut driver, Timestamp::ZERO, "MAV_TS_ENCNT", 0);
    assert_eq!(driver.details(Timestamp::ZERO).encoders, None);
    hear(&mut driver, Timestamp::ZERO, &encoders);
    let pan_deg = driver.details(Timestamp::ZERO).encoders.map(|encoders| encoders.pan_deg);
    assert!(pan_deg.is_some_and(|pan_deg| (pan_deg + 90.0).abs() < 1e-9), "{pan_deg:?}");
}

/// Gimbal statement 23: "with y=8, z=7 the type byte is taken from VERSION_Z."
#[test]
fn statement_23_the_stage_of_older_firmware_is_a_parameter() {
    let mut driver = driver(Generation::V2);
    hear(&mut driver, Timestamp::ZERO, &heartbeat());
    let information = GIMBAL_DEVICE_INFORMATION_DATA {
        vendor_name: CharArray::from("GREMSY"),
        firmware_version: 0x0007_0807,
        ..GIMBAL_DEVICE_INFORMATION_DATA::DEFAULT
    };
    hear(&mut driver, Timestamp::ZERO, &information);
    assert_eq!(driver.details(Timestamp::ZERO).version.as_deref(), Some("7.8.7"));

    tell_parameter(&mut driver, Timestamp::ZERO, "STIFF_TILT", 20);
    tell_parameter(&mut driver, Timestamp::ZERO, "VERSION_Z", 0x87);

    assert_eq!(driver.details(Timestamp::ZERO).version.as_deref(), Some("7.8.7 beta"));
}

/// Gimbal statement 19: "In LOCK the attitude yaw comes from yaw_absolute, in FOLLOW from yaw", but for firmware whose yaw from
/// North is wrong, and for a gimbal that does not tell any; and only where the autopilot's attitude is there for 2 s and is used:
/// "without autopilot attitude … it drifts; north is not known. 'combine attitude' fixes this" (gimbals 1.7).
#[test]
#[rustfmt::skip]
fn statement_19_a_yaw_from_north_is_told_where_there_is_a_true_one() {
    for (firmware_version, activity, yaw_absolute, combines, fed_for_ms, is_from_north) in [
        (0x0009_0807,      0x0010,   85.0,         0x10,     2_000,      true),
        (0x0009_0807,      0x0011,   85.0,         0x10,     2_000,      false),
        (0x0004_0807,      0x0010,   85.0,         0x10,     2_000,      false),
        (0x0009_0807,      0x0010,   0.0,          0x10,     2_000,      false),
        (0x0009_0807,      0x0010,   85.0,         0x08,     2_000,      false),
        (0x0009_0807,      0x0010,   85.0,         0x10,     1_990,      false),
        (0x0009_0807,      0x0010,   85.0,         0x10,     0,          false),
    ] {
        let mut driver = driver(Generation::V1);
        hear(&mut driver, Timestamp::ZERO, &heartbeat());
        tell_parameter(&mut driver, Timestamp::ZERO, "STIFF_TILT", 20);
        tell_parameter(&mut driver, Timestamp::ZERO, "RC_REVERSE_AXIS", combines);
        let information = GIMBAL_DEVICE_INFORMATION_DATA { firmware_version, ..GIMBAL_DEVICE_INFORMATION_DATA::DEFAULT };
        hear(&mut driver, Timestamp::ZERO, &information);
        hear(&mut driver, Timestamp::ZERO, &SYS_STATUS_DATA { errors_count1: activity, ..status(0) });
        let heading = Some(Angle::from_degrees(70.0));
        for (millis, heading) in [(500, heading), (1_000, None), (3_000 - fed_for_ms, heading)] {
            driver.handle_vehicle_heading(heading);
            hear(&mut driver, Timestamp::from_millis(millis), &heartbeat());
        }
        while driver.poll_output().is_some() {}

        tell_orientation(&mut driver, 3_000, 15.0, yaw_absolute);

        let told = std::iter::from_fn(|| driver.poll_output()).find_map(|output| match output {
            DriverOutput::Report(Report::Attitude(told)) => Some(told),
            _ => None,
        });
        let told = told.expect("where it looks");
        let expected = if is_from_north { yaw_absolute } else { 15.0 };
        assert_eq!(matches!(told.attitude, GimbalAttitude::InEarthFrame(_)), is_from_north, "{firmware_version:#x}");
        assert_eq!(told.flags.contains(GimbalFlags::YAW_IN_EARTH_FRAME), is_from_north);
        assert!((told.attitude.yaw().angle().degrees() - f64::from(expected)).abs() < 1e-4, "{told:?}");
    }
}

/// "205 yaw earth only if attitude is fed; otherwise vehicle yaw" (gimbals 2.5): once it is told to combine attitudes no more, no yaw
/// from North is taken for it, whenever it tells where it looks next.
#[test]
fn what_it_is_told_of_north_is_known_at_once() {
    let mut driver = driver(Generation::V1);
    let heading = Some(Angle::from_degrees(70.0));
    for millis in [0, 2_500] {
        driver.handle_vehicle_heading(heading);
        hear(&mut driver, Timestamp::from_millis(millis), &heartbeat());
        tell_parameter(&mut driver, Timestamp::from_millis(millis), "STIFF_TILT", 20);
        tell_parameter(&mut driver, Timestamp::from_millis(millis), "RC_REVERSE_AXIS", 0x10);
    }
    let accepts = |driver: &mut GremsyDriver| -> Vec<bool> {
        let outputs = std::iter::from_fn(|| driver.poll_output());
        let told = outputs.filter_map(|output| match output {
            DriverOutput::Report(Report::Attitude(told)) => Some(told.accepts_earth_yaw),
            _ => None,
        });
        told.collect()
    };
    tell_orientation(&mut driver, 2_600, 15.0, 85.0);
    assert_eq!(accepts(&mut driver), [true]);

    tell_parameter(&mut driver, Timestamp::from_millis(2_610), "RC_REVERSE_AXIS", 0x08);
    assert_eq!(accepts(&mut driver), [false]);
    tell_parameter(&mut driver, Timestamp::from_millis(2_620), "RC_REVERSE_AXIS", 0x18);
    assert_eq!(accepts(&mut driver), [true]);
    tell_parameter(&mut driver, Timestamp::from_millis(2_630), "RC_REVERSE_AXIS", 0x18);
    assert_eq!(accepts(&mut driver), Vec::<bool>::new());
}

/// "if the commanded pose differs by > 10° from the report for > 3 s" (gimbals 1.10), also where it is commanded more often than
/// anything is sent and a little otherwise each time, as ArduPilot and a joystick do.
#[test]
fn one_that_does_not_move_is_recognised_while_its_target_changes_all_the_time() {
    let mut driver = driver(Generation::V1);
    run(&mut driver, 0, 12_000);
    let accepted = CommandOutcome::Answered(CommandResult::Accepted as u8);
    let ack = COMMAND_ACK_DATA {
        command: command::DO_MOUNT_CONTROL,
        result: CommandResult::Accepted as u8,
        progress: 0,
        result_param2: 0,
        target_system: 1,
        target_component: 191,
    };
    let recognised = (12_000..20_000).step_by(10).find(|millis| {
        let now = Timestamp::from_millis(*millis);
        if millis.is_multiple_of(20) {
            driver.handle_setpoint(
                now,
                Setpoint::Point(Pointing {
                    roll: Angle::ZERO,
                    pitch: Angle::from_degrees(-60.0 + 1e-6 * *millis as f64),
                    yaw: Yaw::InVehicleFrame(Angle::ZERO),
                    stabilised: Stabilised::BOTH,
                    radio_control: RadioControl::Off,
                }),
            );
            driver.handle_command_outcome(now, &packet::follow(GIMBAL), accepted);
        }
        if millis.is_multiple_of(50) {
            hear(&mut driver, now, &ack);
            tell_orientation(&mut driver, *millis, 0.0, 0.0);
        }
        driver.handle_timeout(now);
        faults(&driver).iter().any(|fault| fault.contains("does not move"))
    });
    assert!(
        recognised.is_some_and(|millis| (15_000..15_300).contains(&millis)),
        "{recognised:?} {:?}",
        faults(&driver)
    );
}

/// A gimbal without a yaw from North turns, and not the vehicle below it.
#[test]
fn a_yaw_from_north_that_is_missing_is_no_turn_of_the_vehicle() {
    for (tells_north, expected) in [(true, 30.0), (false, 20.0)] {
        let mut driver = driver(Generation::V1);
        run(&mut driver, 0, 12_000);
        assert_eq!(stage(&driver).as_deref(), Some("running"));
        // The nose turns right by 10 degrees per second where it is told, and the gimbal left by as much.
        for millis in (12_000..14_000).step_by(50) {
            let yaw = 100.0 - 0.01 * (millis - 12_000) as f32;
            tell_orientation(&mut driver, millis, yaw, if tells_north { 100.0 } else { 0.0 });
        }
        while driver.poll_output().is_some() {}
        let turning = Turning { yaw: AngularRate::from_degrees_per_second(20.0), ..Turning::STOPPED };
        // Its mode was never said, and is first.
        driver.handle_setpoint(Timestamp::from_secs(14), Setpoint::Turn(turning));
        driver.handle_command_outcome(
            Timestamp::from_secs(14),
            &packet::follow(GIMBAL),
            CommandOutcome::Answered(CommandResult::Accepted as u8),
        );

        let sent = std::iter::from_fn(|| driver.poll_output()).find_map(|output| match output {
            DriverOutput::Message(message) => match *message {
                MavMessage::COMMAND_LONG(command) if command.command == command::DO_MOUNT_CONTROL => Some(command),
                _ => None,
            },
            _ => None,
        });
        let rate = sent.expect("it is told the rate").param3;
        assert!((rate - expected).abs() < 0.1, "{tells_north} {rate}");
    }
}
