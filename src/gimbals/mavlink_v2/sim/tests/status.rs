//! What `GIMBAL_DEVICE_ATTITUDE_STATUS` says.

use super::*;

const ACCEPTS: GimbalFlags = GimbalFlags::ACCEPTS_YAW_IN_EARTH_FRAME;
const VEHICLE: GimbalFlags = GimbalFlags::YAW_IN_VEHICLE_FRAME;
const EARTH: GimbalFlags = GimbalFlags::YAW_IN_EARTH_FRAME;

/// "exactly one of bits 32 and 64 set", "delta_yaw is NaN while no autopilot heading is known".
#[test]
fn the_frame_is_earth_exactly_while_the_heading_is_known() {
    let mut bench = Bench::new(|settings| settings.plant.initial.yaw = Angle::from_degrees(20.0));
    let status = bench.status();
    assert_eq!(status.flags, LEVEL | VEHICLE);
    assert_near(status.yaw, 20.0, 0.001);
    assert!(status.delta_yaw.is_nan());

    for heading in [0.0, 90.0, 179.0, -179.0] {
        bench.heading = Some((heading, 0.0));
        bench.run_for(1000);
        let status = bench.status();
        assert_eq!(status.flags, LEVEL | EARTH | ACCEPTS);
        let expected = Angle::from_degrees(20.0 + heading).wrapped().degrees();
        assert_near(status.yaw, expected, 0.001);
        assert_near(status.delta_yaw, heading, 0.001);
    }

    bench.heading = None;
    bench.run_for(1100);
    let status = bench.status();
    assert_eq!(status.flags, LEVEL | VEHICLE);
    assert!(status.delta_yaw.is_nan());
}

#[test]
fn attitude_serves_as_heading_when_286_does_not_come() {
    let attitude = |yaw: f64| ATTITUDE_DATA {
        time_boot_ms: 0,
        roll: 0.0,
        pitch: 0.0,
        yaw: yaw.to_radians() as f32,
        rollspeed: 0.0,
        pitchspeed: 0.0,
        yawspeed: 0.0,
    };
    let mut bench = Bench::new(|_| {});
    bench.hear(MavId::new(1, 100), &attitude(50.0));
    assert!(bench.status().delta_yaw.is_nan(), "only the autopilot knows");
    bench.hear(AUTOPILOT, &attitude(50.0));
    assert_near(bench.status().delta_yaw, 50.0, 0.001);

    bench.run_for(10);
    bench.hear(AUTOPILOT, &state(60.0));
    bench.hear(AUTOPILOT, &attitude(70.0));
    assert_near(bench.status().delta_yaw, 60.0, 0.001);
}

#[test]
#[rustfmt::skip]
fn a_device_may_report_by_lock_or_without_frame_bits() {
    for (frame,                     setpoint,                  flags,                                yaw,   delta_yaw) in [
        (StatusFrame::FollowsLock,  angles(FOLLOW, 0.0, 20.0), LEVEL | VEHICLE | ACCEPTS,            20.0,  90.0),
        (StatusFrame::FollowsLock,  angles(LOCK, 0.0, 110.0),  LOCK | ACCEPTS,                       110.0, 90.0),
        (StatusFrame::Legacy,       angles(FOLLOW, 0.0, 20.0), LEVEL,                                20.0,  0.0),
        (StatusFrame::Legacy,       angles(LOCK, 0.0, 110.0),  LEVEL | GimbalFlags::YAW_LOCK,        110.0, 0.0),
    ] {
        let mut bench = Bench::new(|settings| settings.status_frame = frame);
        bench.heading = Some((90.0, 0.0));
        bench.run_for(500);
        bench.hear(MANAGER, &setpoint);
        bench.run_for(3000);

        let status = bench.status();
        assert_eq!(status.flags, flags, "{frame:?}");
        assert_near(status.yaw, yaw, 0.01);
        assert_near(status.delta_yaw, delta_yaw, 0.01);
    }
}

/// "285 has target 0/0", "gimbal_device_id: 0 when the source is a device component", "time_boot_ms increases".
#[test]
fn it_is_for_everybody_and_dated() {
    let mut bench = Bench::new(|_| {});
    bench.run_until(millis(2100));

    let statuses = bench.take::<GIMBAL_DEVICE_ATTITUDE_STATUS_DATA>();
    assert!(statuses.iter().all(|(at, status)| status.time_boot_ms == at.boot_ms()));
    let addressed = |status: &GIMBAL_DEVICE_ATTITUDE_STATUS_DATA| {
        (status.target_system, status.target_component, status.gimbal_device_id)
    };
    assert!(statuses.iter().all(|(_, status)| addressed(status) == (0, 0, 0)));
    assert_eq!(statuses.len(), 9);
}

/// "At pitch −90 exactly the quaternion is unit and yaw does not jump".
#[test]
fn straight_down_yaw_stays_put() {
    let mut bench = Bench::new(|settings| {
        settings.plant.initial.pitch = Angle::from_degrees(-90.0);
        settings.plant.initial.yaw = Angle::from_degrees(60.0);
        settings.plant.noise = Angle::from_degrees(0.02);
    });
    bench.run_until(Timestamp::from_secs(20));

    for (_, status) in bench.take::<GIMBAL_DEVICE_ATTITUDE_STATUS_DATA>() {
        let norm: f32 = status.q.iter().map(|element| element * element).sum();
        assert_near(f64::from(norm), 1.0, 1e-6);
        assert_near(Status::from(&status).yaw, 60.0, 0.2);
    }
}

#[test]
fn failures_of_the_hardware_are_passed_on() {
    let mut bench = Bench::new(|_| {});
    bench.device.set_failures(FailureFlags::MOTOR_ERROR | FailureFlags::COMMS_ERROR);

    let expected = FailureFlags::MOTOR_ERROR | FailureFlags::COMMS_ERROR | FailureFlags::NO_MANAGER;
    assert_eq!(bench.status().failures, expected);
}

/// The vehicle's true motion, where it is known, need not be what the autopilot says.
#[test]
fn a_carried_device_is_moved_by_the_vehicle_and_believes_the_autopilot() {
    let mut bench = Bench::new(|_| {});
    let truth = |heading: f64| PlatformMotion { heading: Angle::from_degrees(heading), ..PlatformMotion::default() };
    bench.device.handle_disturbance(bench.now, truth(0.0));
    bench.heading = Some((10.0, 0.0));
    bench.run_for(2500);
    bench.hear(MANAGER, &angles(LOCK, 0.0, 40.0));
    bench.run_for(2000);
    assert_near(bench.device.plant().pose().yaw.degrees(), 30.0, 0.01);

    bench.device.handle_disturbance(bench.now, truth(25.0));
    bench.run_for(2000);
    assert_near(bench.device.plant().pose().yaw.degrees(), 5.0, 0.01);
    assert_eq!(bench.status().flags, LOCK | ACCEPTS);
}
