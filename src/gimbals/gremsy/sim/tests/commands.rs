//! What a v1 gimbal does when it is commanded.

use super::*;
use crate::gimbals::gremsy::packet::MessageRate;
use crate::gimbals::gremsy::parameters::RcType;
use crate::gimbals::operation::ResetMode;
use crate::wire::dialect::{GIMBAL_DEVICE_INFORMATION_DATA, MOUNT_STATUS_DATA, RAW_IMU_DATA};

/// "205 → ACK after 5–30 ms; p6 = 1 angle / 2 rate" (gimbals 5.3), at no more than `RC_SPD_…`.
#[test]
fn it_turns_to_angles_at_the_speed_of_control() {
    let mut bench = Bench::running(Generation::V1, |_| ());

    let (after, result) = bench.ask(&packet::rotate_to(GIMBAL, angles(5.0, -30.0, 60.0))).expect("an answer");
    assert!((5..=30).contains(&after) && result == 0, "{after} ms, {result}");
    bench.run_for(970);
    // 30°/s: after a second it is not yet half way, after three it is there.
    let [_, _, yaw] = bench.pose();
    assert!((24.0..=30.0).contains(&yaw), "{yaw}");
    bench.run_for(2500);
    assert_eq!(bench.pose(), [5.0, -30.0, 60.0]);

    let orientation = bench.last::<MOUNT_ORIENTATION_DATA>();
    for (found, expected) in [(orientation.roll, 5.0), (orientation.pitch, -30.0), (orientation.yaw, 60.0)] {
        assert_near(f64::from(found), expected, 0.1);
    }
}

/// "holds the rate until the next 205, no built-in dead-man" (gimbals 5.3).
#[test]
fn a_rate_holds_until_something_else_is_asked() {
    let mut bench = Bench::running(Generation::V1, |_| ());
    bench.accept(&packet::turn_at(GIMBAL, rates(0.0, -2.0, 10.0)));
    bench.run_for(15_000);
    let [_, pitch, yaw] = bench.pose();
    assert_near(pitch, -30.0, 0.5);
    assert_near(yaw, 150.0, 1.0);

    // More than the speed of control is that speed.
    bench.accept(&packet::turn_at(GIMBAL, rates(0.0, 0.0, -90.0)));
    let from = bench.pose()[2];
    bench.run_for(2000);
    assert_near(bench.pose()[2], from - 60.0, 3.0);

    bench.accept(&packet::turn_at(GIMBAL, rates(0.0, 0.0, 0.0)));
    bench.run_for(3000);
    let still = bench.pose();
    bench.run_for(5000);
    assert_eq!(bench.pose(), still);
}

/// "p7 must be 2, else FAILED"; numbers that are none, and an input mode that is none, are DENIED.
#[test]
fn what_makes_no_sense_is_refused() {
    let command = packet::rotate_to(GIMBAL, angles(0.0, -30.0, 0.0));
    let mut bench = Bench::running(Generation::V1, |_| ());
    for (command, expected) in [
        (COMMAND_LONG_DATA { param7: 0.0, ..command.clone() }, 4),
        (COMMAND_LONG_DATA { param6: 0.0, ..command.clone() }, 2),
        (COMMAND_LONG_DATA { param6: 3.0, ..command.clone() }, 2),
        (COMMAND_LONG_DATA { param1: f32::NAN, ..command.clone() }, 2),
        (COMMAND_LONG_DATA { param7: 3.0, command: 31_011, ..command.clone() }, 2),
        (COMMAND_LONG_DATA { param6: 2.0, param7: 4.0, command: 31_011, ..command.clone() }, 2),
        (COMMAND_LONG_DATA { param7: 2.0, command: 31_010, ..command.clone() }, 2),
        (COMMAND_LONG_DATA { param1: 0.0, command: 204, ..command.clone() }, 2),
        (COMMAND_LONG_DATA { command: 400, ..command.clone() }, 3),
    ] {
        assert_eq!(bench.ask(&command).map(|(_, result)| result), Some(expected), "{command:?}");
    }
    bench.run_for(2000);
    assert_eq!(bench.pose(), [0.0, 0.0, 0.0]);

    // "2020-era firmware/API: 0 angle relative to body".
    let mut old = Bench::running(Generation::V1, |settings| settings.firmware = FirmwareVersion::official(7, 5, 6));
    old.accept(&COMMAND_LONG_DATA { param6: 0.0, ..command });
    old.run_for(2000);
    assert_eq!(old.pose(), [0.0, -30.0, 0.0]);
}

/// "31011: p7 1/2 switch LOCK/FOLLOW in ≤ 50 ms with bumpless yaw" (gimbals 5.3); "LOCK: yaw holds an inertial heading;
/// angle targets are earth-frame. FOLLOW: yaw target is relative to the vehicle" (1.7).
#[test]
fn lock_holds_the_horizon_and_follow_the_vehicle() {
    let mut bench = Bench::running(Generation::V1, |_| ());
    bench.heading = Some((70.0, 0.0));
    bench.run_for(3000);
    bench.accept(&packet::rotate_to(GIMBAL, angles(0.0, -10.0, 20.0)));
    bench.run_for(2000);
    assert_eq!(bench.pose(), [0.0, -10.0, 20.0]);

    bench.accept(&packet::lock(GIMBAL));
    bench.run_for(20);
    assert_eq!(bench.pose(), [0.0, -10.0, 20.0]);
    bench.heading = Some((70.0, 10.0));
    bench.run_for(4000);
    bench.heading = Some((110.0, 0.0));
    bench.run_for(2000);
    assert_near(bench.pose()[2], -20.0, 0.5);
    assert_eq!(bench.operation(), OperationState::ON | OperationState::LOCK);
    let said = bench.last::<MOUNT_ORIENTATION_DATA>();
    assert_near(f64::from(said.yaw_absolute), 90.0, 0.5);
    assert_near(f64::from(said.yaw), -20.0, 0.5);

    // From North.
    bench.accept(&packet::rotate_to(GIMBAL, angles(0.0, 0.0, 130.0)));
    bench.run_for(3000);
    assert_near(bench.pose()[2], 20.0, 0.5);

    bench.accept(&packet::follow(GIMBAL));
    bench.run_for(20);
    assert_near(bench.pose()[2], 20.0, 0.5);
    bench.heading = Some((110.0, 10.0));
    bench.run_for(3000);
    assert_near(bench.pose()[2], 20.0, 0.5);
}

/// "SPEED inputs are earth-frame rates in both modes" (gimbals 1.7).
#[test]
fn rates_are_against_the_horizon_in_either_mode() {
    let mut bench = Bench::running(Generation::V1, |_| ());
    bench.heading = Some((0.0, 10.0));
    bench.run_for(2000);
    bench.accept(&packet::turn_at(GIMBAL, rates(0.0, 0.0, 10.0)));
    bench.run_for(500);
    let from = bench.pose()[2];
    bench.run_for(3000);
    assert_near(bench.pose()[2], from, 0.5);
    // At rest in FOLLOW it turns with the vehicle.
    bench.accept(&packet::turn_at(GIMBAL, rates(0.0, 0.0, 0.0)));
    bench.run_for(500);
    let from = bench.pose()[2];
    bench.run_for(2000);
    assert_near(bench.pose()[2], from, 0.1);
}

/// `gimbal_reset_mode_t`: 1 yaw 0; 3 all 0; 11 pitch −90, roll and yaw 0; 12 and 13 pitch −90 (gimbals 1.5).
#[test]
#[rustfmt::skip]
fn resets_go_to_their_start() {
    for (mode,                         expected) in [
        (ResetMode::Yaw,               [5.0, -30.0, 0.0]),
        (ResetMode::PitchAndYaw,       [0.0, 0.0, 0.0]),
        (ResetMode::PitchDownUpAndYaw, [0.0, -90.0, 0.0]),
        (ResetMode::PitchDownUp,       [5.0, -90.0, 40.0]),
        (ResetMode::PitchMapping,      [5.0, -90.0, 40.0]),
    ] {
        let mut bench = Bench::running(Generation::V1, |_| ());
        bench.accept(&packet::rotate_to(GIMBAL, angles(5.0, -30.0, 40.0)));
        bench.run_for(3000);
        bench.accept(&packet::reset(GIMBAL, mode));
        bench.run_for(4000);
        assert_eq!(bench.pose(), expected, "{mode:?}");
    }
}

/// "31010: motors off ≤ 200 ms / on takes 3.0 s with ec1 bits 0x20" (gimbals 5.3).
#[test]
fn motors_are_off_at_once_and_on_after_three_seconds() {
    let mut bench = Bench::running(Generation::V1, |_| ());
    bench.accept(&packet::set_motors(GIMBAL, false));
    assert!(!bench.device.plant().motors_on());
    bench.run_for(3000);
    assert_eq!(bench.operation(), OperationState::OFF);
    // "θ relaxes to gravity rest (pitch −25°)" (5.1). It is not moved by a setpoint.
    bench.accept(&packet::rotate_to(GIMBAL, angles(0.0, 10.0, 40.0)));
    bench.run_for(3000);
    assert_near(bench.pose()[1], -25.0, 0.2);
    assert_near(bench.pose()[2], 0.0, 0.2);
    assert_eq!(bench.device.ignored(), Ignored { motors_off: 1, ..Ignored::default() });

    bench.accept(&packet::set_motors(GIMBAL, true));
    bench.run_for(2900);
    assert!(!bench.device.plant().motors_on());
    assert_eq!(bench.operation(), OperationState::INIT);
    bench.run_for(3100);
    assert_eq!(bench.operation(), OperationState::ON | OperationState::FOLLOW);
    assert_eq!(bench.pose(), [0.0, 0.0, 0.0]);
}

/// "RC_TYPE ≠ 7 → 205 ACKed but ignored (reproduces the gTune trap)" (gimbals 5.3).
#[test]
fn with_another_rc_type_it_acknowledges_and_does_not_move() {
    let mut bench = Bench::running(Generation::V1, |settings| settings.rc_type = RcType::from_code(1));
    bench.accept(&packet::rotate_to(GIMBAL, angles(0.0, -30.0, 40.0)));
    bench.accept(&packet::turn_at(GIMBAL, rates(0.0, 0.0, 10.0)));
    bench.run_for(3000);
    assert_eq!(bench.pose(), [0.0, 0.0, 0.0]);
    assert_eq!(bench.device.ignored(), Ignored { rc_type: 2, ..Ignored::default() });

    bench.hear(MANAGER, &parameters::set("RC_TYPE", 7.0));
    bench.accept(&packet::rotate_to(GIMBAL, angles(0.0, -30.0, 0.0)));
    bench.run_for(3000);
    assert_eq!(bench.pose(), [0.0, -30.0, 0.0]);
}

/// "511: known ids 27, 158, 265, 285 (v2 only) → ACCEPTED, unknown → UNSUPPORTED; cap at 100 Hz" (gimbals 5.3).
#[test]
fn rates_of_its_messages_can_be_set() {
    let mut bench = Bench::running(Generation::V1, |_| ());
    let mut ask = |id, rate| bench.ask(&packet::set_message_rate(GIMBAL, id, rate)).expect("an answer").1;
    for id in [message::RAW_IMU, message::MOUNT_STATUS, message::MOUNT_ORIENTATION] {
        assert_eq!(ask(id, MessageRate::Hertz(20)), 0);
    }
    for id in [message::GIMBAL_DEVICE_ATTITUDE_STATUS, message::HEARTBEAT, message::SYS_STATUS, 0] {
        assert_eq!(ask(id, MessageRate::Hertz(20)), 3, "{id}");
    }
    assert_eq!(ask(message::RAW_IMU, MessageRate::Off), 0);
    assert_eq!(ask(message::MOUNT_STATUS, MessageRate::Default), 0);
    let mut fast = packet::set_message_rate(GIMBAL, message::MOUNT_ORIENTATION, MessageRate::Hertz(100));
    fast.param2 = 1000.0;
    bench.accept(&fast);
    let from = bench.now;
    bench.run_for(2000);
    assert_eq!(bench.count::<RAW_IMU_DATA>(from), 0);
    assert_eq!(bench.count::<MOUNT_STATUS_DATA>(from), 20);
    assert_eq!(bench.count::<MOUNT_ORIENTATION_DATA>(from), 200);
}

/// "sum of rates > 200 msg/s → messages dropped" (gimbals 5.3).
#[test]
fn more_than_two_hundred_messages_a_second_are_too_many() {
    let mut bench = Bench::running(Generation::V1, |_| ());
    for id in [message::RAW_IMU, message::MOUNT_STATUS, message::MOUNT_ORIENTATION] {
        bench.accept(&packet::set_message_rate(GIMBAL, id, MessageRate::Hertz(100)));
    }
    bench.run_for(1000);
    bench.sent.clear();
    bench.run_for(5000);
    assert_near(bench.sent.len() as f64, 1000.0, 2.0);
}

/// "512/283 → one message" (gimbals 5.3); "variant old_fw … ignores 283/284/285".
#[test]
fn it_says_who_it_is_unless_it_is_old() {
    let mut bench = Bench::running(Generation::V1, |_| ());
    bench.accept(&packet::request_message(GIMBAL, message::GIMBAL_DEVICE_INFORMATION));
    let all = bench.messages::<GIMBAL_DEVICE_INFORMATION_DATA>();
    assert_eq!(all.len(), 1);
    let information = &all[0].1;
    assert_eq!(information.vendor_name.to_str(), Ok("GREMSY"));
    assert_eq!(information.firmware_version, 0x0003_0707);
    assert_near(f64::from(information.pitch_min), -90_f64.to_radians(), 1e-6);
    assert_near(f64::from(information.pitch_max), 45_f64.to_radians(), 1e-6);

    let mut old = Bench::running(Generation::V1, |settings| settings.firmware = FirmwareVersion::official(7, 5, 6));
    let asked = packet::request_message(GIMBAL, message::GIMBAL_DEVICE_INFORMATION);
    assert_eq!(old.ask(&asked).map(|(_, result)| result), Some(3));
    assert_eq!(old.messages::<GIMBAL_DEVICE_INFORMATION_DATA>().len(), 0);
}

/// "set_gimbal_rc_input_sync: CMD 204, p1 = 3 … gives control back to the RC receiver" (gimbals 1.5).
#[test]
fn it_can_be_handed_to_its_rc_receiver() {
    let mut bench = Bench::running(Generation::V1, |_| ());
    bench.accept(&packet::hand_to_rc(GIMBAL));
    bench.run_for(1100);
    assert_eq!(bench.last::<SYS_STATUS_DATA>().errors_count1, 0x1011);
    assert_eq!(bench.last::<MOUNT_STATUS_DATA>().mount_mode, 3);

    bench.accept(&packet::rotate_to(GIMBAL, angles(0.0, -30.0, 0.0)));
    bench.run_for(2000);
    assert_eq!(bench.last::<SYS_STATUS_DATA>().errors_count1, 0x0011);
    assert_eq!(bench.pose(), [0.0, -30.0, 0.0]);
}

/// "mavros PR #1744: MOUNT_ORIENTATION pitch seen inverted with Gremsy" (gimbals 1.7).
#[test]
fn pitch_may_be_reported_the_wrong_way_round() {
    let mut bench = Bench::running(Generation::V1, |settings| settings.has_inverted_pitch = true);
    bench.accept(&packet::rotate_to(GIMBAL, angles(0.0, -30.0, 20.0)));
    bench.run_for(3000);
    assert_eq!(bench.pose(), [0.0, -30.0, 20.0]);
    let said = bench.last::<MOUNT_ORIENTATION_DATA>();
    assert_near(f64::from(said.pitch), 30.0, 0.1);
    assert_near(f64::from(said.yaw), 20.0, 0.1);
}

/// "Earth-yaw drift 0.5 °/min without autopilot attitude" (gimbals 5.1), counted from where it was switched on: "north is
/// not known" (1.7).
#[test]
fn without_an_autopilot_its_north_is_its_own_and_drifts() {
    let mut bench = Bench::running(Generation::V1, |_| ());
    let carried = PlatformMotion { heading: Angle::from_degrees(70.0), ..PlatformMotion::default() };
    bench.device.handle_disturbance(bench.now, carried);
    bench.accept(&packet::lock(GIMBAL));
    bench.run_for(1000);
    assert_near(f64::from(bench.last::<MOUNT_ORIENTATION_DATA>().yaw_absolute), 0.0, 0.1);
    bench.run_for(240_000);
    assert_near(bench.pose()[2], -2.0, 0.1);

    // Told the heading often enough it knows North.
    bench.heading = Some((70.0, 0.0));
    bench.run_for(5000);
    assert_near(f64::from(bench.last::<MOUNT_ORIENTATION_DATA>().yaw_absolute), 70.0 + bench.pose()[2], 0.1);
}
