//! The generation that speaks the Gimbal Protocol v2, in the vendor's way.

use super::*;
use crate::geometry::{VehicleFrame, YawFrame};
use crate::gimbals::gremsy::modes::{self, ControlMode};
use crate::gimbals::gremsy::parameters::RcType;
use crate::wire::dialect::GIMBAL_DEVICE_SET_ATTITUDE_DATA;
use crate::wire::ids::GimbalFlags;

const OTHER: MavId = MavId::new(1, 100);
const VEHICLE: u16 = 0x2c;
const EARTH: u16 = 0x5c;

fn point(flags: u16, pitch: f64, yaw: f64) -> GIMBAL_DEVICE_SET_ATTITUDE_DATA {
    GIMBAL_DEVICE_SET_ATTITUDE_DATA {
        q: Attitude::<VehicleFrame>::from_gimbal_angles(angles(0.0, pitch, yaw)).to_wxyz(),
        angular_velocity_x: f32::NAN,
        angular_velocity_y: f32::NAN,
        angular_velocity_z: f32::NAN,
        flags,
        target_system: 1,
        target_component: 154,
    }
}

fn turn(flags: u16, pitch: f64, yaw: f64) -> GIMBAL_DEVICE_SET_ATTITUDE_DATA {
    GIMBAL_DEVICE_SET_ATTITUDE_DATA {
        q: [f32::NAN; 4],
        angular_velocity_x: 0.0,
        angular_velocity_y: pitch.to_radians() as f32,
        angular_velocity_z: yaw.to_radians() as f32,
        flags,
        target_system: 1,
        target_component: 154,
    }
}

fn firmware(z: u8) -> impl FnOnce(&mut DeviceSettings) {
    move |settings| settings.firmware = FirmwareVersion::official(7, 8, z)
}

/// Flags without the one for a missing manager, yaw of the quaternion and `delta_yaw` in degrees.
fn status(bench: &Bench) -> (u16, f64, f64) {
    let status = bench.last::<GIMBAL_DEVICE_ATTITUDE_STATUS_DATA>();
    let attitude = Attitude::<EarthFrame>::from_wxyz(status.q).expect("a quaternion").expect("no NaN");
    (status.flags, attitude.gimbal_angles().yaw.degrees(), f64::from(status.delta_yaw).to_degrees())
}

/// "285 broadcast 4 Hz until first 284, then 10 Hz (or by 511) targeted to the manager; 284 accepted only from the latched
/// manager (first valid source …) – others ignored" (gimbals 5.4).
#[test]
fn it_obeys_one_manager_and_tells_it_more() {
    let mut bench = Bench::running(Generation::V2, |settings| settings.status_target = StatusTarget::Manager);
    let from = bench.now;
    bench.run_for(2000);
    assert_eq!(bench.count::<GIMBAL_DEVICE_ATTITUDE_STATUS_DATA>(from), 8);
    let said = bench.last::<GIMBAL_DEVICE_ATTITUDE_STATUS_DATA>();
    assert_eq!((said.target_system, said.target_component, said.failure_flags), (0, 0, 512));

    bench.hear(MANAGER, &point(VEHICLE, -20.0, 10.0));
    bench.hear(OTHER, &point(VEHICLE, 20.0, -90.0));
    bench.hear(MavId::new(2, 191), &point(VEHICLE, 20.0, -90.0));
    let from = bench.now;
    bench.run_for(1900);
    assert_eq!(bench.count::<GIMBAL_DEVICE_ATTITUDE_STATUS_DATA>(from), 19);
    let said = bench.last::<GIMBAL_DEVICE_ATTITUDE_STATUS_DATA>();
    assert_eq!((said.target_system, said.target_component, said.failure_flags), (1, 191, 0));
    assert_eq!(bench.pose(), [0.0, -20.0, 10.0]);
    assert_eq!(bench.device.manager(bench.now), Some(MANAGER));
    assert_eq!(bench.device.ignored(), Ignored { not_manager: 1, ..Ignored::default() });

    // "NO_MANAGER 512 set when neither 281 … nor 284 of its manager arrived for 2 s".
    bench.run_for(300);
    assert_eq!(bench.last::<GIMBAL_DEVICE_ATTITUDE_STATUS_DATA>().failure_flags, 512);
}

/// A rate is held without a dead-man's switch (`hold_forever`, gimbals 5.4), at most as fast as `RC_SPD_…`.
#[test]
fn a_rate_holds_until_something_else_is_asked() {
    let mut bench = Bench::running(Generation::V2, |_| ());
    bench.hear(MANAGER, &turn(VEHICLE, 0.0, 10.0));
    bench.run_for(15_000);
    assert_near(bench.pose()[2], 150.0, 1.0);
    bench.hear(MANAGER, &turn(VEHICLE, 0.0, -90.0));
    bench.run_for(2000);
    assert_near(bench.pose()[2], 92.0, 3.0);
    bench.hear(MANAGER, &turn(VEHICLE, 0.0, 0.0));
    bench.run_for(3000);
    let still = bench.pose();
    bench.run_for(5000);
    assert_eq!(bench.pose(), still);
}

/// "RETRACT … motors off in `gremsy` variant; NEUTRAL → 0/0/0" (gimbals 5.4), and switches them on (1.5).
#[test]
fn retract_switches_the_motors_off_and_neutral_on() {
    let mut bench = Bench::running(Generation::V2, |_| ());
    bench.hear(MANAGER, &point(VEHICLE, -20.0, 40.0));
    bench.run_for(2000);
    bench.hear(MANAGER, &modes::set_mode(GIMBAL, ControlMode::Off, None));
    bench.run_for(200);
    assert!(!bench.device.plant().motors_on());
    let flags = GimbalFlags::from_bits_retain(status(&bench).0);
    assert_eq!(ControlMode::from_status(flags), ControlMode::Off);
    bench.hear(MANAGER, &point(VEHICLE, -20.0, 0.0));
    bench.run_for(2800);
    assert_near(bench.pose()[1], -25.0, 0.2);
    assert_eq!(bench.operation(), OperationState::OFF);
    assert_eq!(bench.device.ignored(), Ignored { motors_off: 1, ..Ignored::default() });

    bench.hear(MANAGER, &modes::set_mode(GIMBAL, ControlMode::Reset, None));
    bench.run_for(200);
    assert_eq!(ControlMode::from_status(GimbalFlags::from_bits_retain(status(&bench).0)), ControlMode::Reset);
    assert!(!bench.device.plant().motors_on());
    bench.run_for(6000);
    assert_eq!(bench.pose(), [0.0, 0.0, 0.0]);
    assert_eq!(bench.operation(), OperationState::ON | OperationState::FOLLOW);
}

/// "after RETRACT the `gremsy_latched` variant ignores everything until reboot" (gimbals 5.4).
#[test]
fn some_firmware_takes_its_motors_back_only_after_a_restart() {
    let mut bench = Bench::running(Generation::V2, |settings| settings.is_latched_by_retract = true);
    bench.hear(MANAGER, &modes::set_mode(GIMBAL, ControlMode::Off, None));
    bench.hear(MANAGER, &modes::set_mode(GIMBAL, ControlMode::Reset, None));
    bench.hear(MANAGER, &point(VEHICLE, -20.0, 0.0));
    bench.run_for(5000);
    assert!(!bench.device.plant().motors_on());
    assert_eq!(bench.device.ignored(), Ignored { latched: 2, ..Ignored::default() });

    bench.accept(&packet::reboot(GIMBAL));
    bench.run_for(13_000);
    bench.hear(MANAGER, &heartbeat(mav_type::ONBOARD_CONTROLLER));
    bench.run_for(6000);
    bench.hear(MANAGER, &point(VEHICLE, -20.0, 0.0));
    bench.run_for(2000);
    assert_eq!(bench.pose(), [0.0, -20.0, 0.0]);
}

/// "Gremsy v2 variant: 7.8.6 profile (no YAW_IN bits, delta_yaw absent/0) and 7.8.9 profile (bits set, delta_yaw filled)"
/// (gimbals 5.4); 7.8.7 "always gives YAW_IN_VEHICLE_FRAME, regardless of if follow/lock".
#[test]
#[rustfmt::skip]
fn profiles_differ_in_the_frame_of_yaw() {
    // The vehicle's nose is at 70°, and the camera 20° right of it. Up to 7.8.7, North is 35° off.
    for (z,  flags,   expected_flags, yaw,   delta_yaw) in [
        (6,  0x0c,    0x000c,         20.0,  0.0),
        (6,  0x1c,    0x001c,         125.0, 0.0),
        (7,  VEHICLE, 0x00ac,         20.0,  105.0),
        (7,  0x1c,    0x00bc,         20.0,  105.0),
        (9,  VEHICLE, 0x00ac,         20.0,  70.0),
        (9,  EARTH,   0x00dc,         90.0,  70.0),
    ] {
        let mut bench = Bench::running(Generation::V2, firmware(z));
        bench.heading = Some((70.0, 0.0));
        bench.run_for(3000);
        bench.hear(MANAGER, &point(VEHICLE, 0.0, 20.0));
        bench.run_for(3000);
        bench.hear(MANAGER, &turn(flags, 0.0, 0.0));
        bench.run_for(500);

        let (found, found_yaw, found_delta) = status(&bench);
        assert_eq!(found, expected_flags, "7.8.{z} {flags:#x}");
        assert_near(found_yaw, yaw, 0.3);
        assert_near(found_delta, delta_yaw, 0.3);
        assert_near(bench.pose()[2], 20.0, 0.3);
    }
}

/// "delta_yaw comes from 286 (q) or ATTITUDE; without any → NaN and vehicle-frame only" (gimbals 5.4).
#[test]
fn without_a_heading_it_speaks_of_the_vehicle_only() {
    let mut bench = Bench::running(Generation::V2, |_| ());
    bench.hear(MANAGER, &turn(0x1c, 0.0, 0.0));
    bench.run_for(500);
    let (flags, yaw, delta_yaw) = status(&bench);
    assert_eq!(flags, 0x003c);
    assert_near(yaw, 0.0, 0.1);
    assert!(delta_yaw.is_nan());
}

/// Known fault of 7.8.0 to 7.8.7: "report a wrong earth-relative yaw" (gimbals 1.7); what counts from the vehicle is right.
#[test]
fn firmware_with_a_wrong_earth_yaw_goes_astray_from_north_only() {
    for (z, astray) in [(7, -35.0), (8, 0.0)] {
        let mut bench = Bench::running(Generation::V2, firmware(z));
        bench.heading = Some((70.0, 0.0));
        bench.run_for(3000);
        bench.hear(MANAGER, &point(EARTH, 0.0, 90.0));
        bench.run_for(3000);
        assert_near(bench.pose()[2], 20.0 + astray, 0.5);
        bench.hear(MANAGER, &point(VEHICLE, 0.0, 20.0));
        bench.run_for(3000);
        assert_near(bench.pose()[2], 20.0, 0.3);
    }
}

/// "set_gimbal_mapping_sync … flag 0x4000" (gimbals 1.5), sent until the status shows it; "get_gimbal_mode: 0x4000→MAPPING".
#[test]
fn mapping_looks_down_and_says_so() {
    let mut bench = Bench::running(Generation::V2, |_| ());
    bench.hear(MANAGER, &point(VEHICLE, 0.0, 20.0));
    bench.run_for(2000);
    for _ in 0..5 {
        bench.hear(MANAGER, &modes::set_mode(GIMBAL, ControlMode::Mapping, Some(YawFrame::Vehicle)));
        bench.run_for(100);
    }
    assert_eq!(ControlMode::from_status(GimbalFlags::from_bits_retain(status(&bench).0)), ControlMode::Mapping);
    bench.run_for(4000);
    assert_eq!(bench.pose(), [0.0, -90.0, 20.0]);
    bench.hear(MANAGER, &point(VEHICLE, 0.0, 20.0));
    bench.run_for(200);
    assert_eq!(ControlMode::from_status(GimbalFlags::from_bits_retain(status(&bench).0)), ControlMode::Follow);
}

/// Setpoints without effect: another RC type, both YAW_IN bits.
#[test]
fn what_has_no_effect_is_counted() {
    let mut bench = Bench::running(Generation::V2, |settings| settings.rc_type = RcType::from_code(14));
    bench.hear(MANAGER, &point(VEHICLE, -20.0, 0.0));
    bench.hear(MANAGER, &point(VEHICLE | EARTH, -20.0, 0.0));
    bench.run_for(2000);
    assert_eq!(bench.pose(), [0.0, 0.0, 0.0]);
    assert_eq!(bench.device.ignored(), Ignored { rc_type: 1, malformed: 1, ..Ignored::default() });
}

/// Commands of the first generation are not mixed with setpoints of the second.
#[test]
fn commands_of_the_first_generation_are_unsupported() {
    let mut bench = Bench::running(Generation::V2, |_| ());
    for command in
        [packet::rotate_to(GIMBAL, angles(0.0, -20.0, 0.0)), packet::set_motors(GIMBAL, false), packet::lock(GIMBAL)]
    {
        assert_eq!(bench.ask(&command).map(|(_, result)| result), Some(3), "{command:?}");
    }
    bench.accept(&packet::set_message_rate(
        GIMBAL,
        message::GIMBAL_DEVICE_ATTITUDE_STATUS,
        packet::MessageRate::Hertz(50),
    ));
    let from = bench.now;
    bench.run_for(1000);
    assert_eq!(bench.count::<GIMBAL_DEVICE_ATTITUDE_STATUS_DATA>(from), 50);

    let mut old = Bench::running(Generation::V1, |_| ());
    old.hear(MANAGER, &point(VEHICLE, -20.0, 0.0));
    old.run_for(2000);
    assert_eq!(old.pose(), [0.0, 0.0, 0.0]);
}

/// Failures come from the fault injector.
#[test]
fn failures_are_reported() {
    let mut bench = Bench::running(Generation::V2, |_| ());
    bench.device.set_failures(FailureFlags::ENCODER_ERROR);
    bench.run_for(1100);
    assert_eq!(bench.last::<GIMBAL_DEVICE_ATTITUDE_STATUS_DATA>().failure_flags, 512 | 8);
    assert_eq!(bench.operation(), OperationState::ERROR);
}
