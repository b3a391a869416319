//! Whom the device obeys.

use super::*;

const RIVAL: MavId = MavId::new(1, 1);

fn goal(bench: &mut Bench) -> f64 {
    bench.run_for(2000);
    bench.status().pitch
}

/// "284 accepted only from the latched manager (first valid source …) – others ignored."
#[test]
fn only_the_first_source_is_obeyed() {
    let mut bench = Bench::new(|_| {});
    bench.stream(MANAGER, &angles(FOLLOW, -20.0, 0.0), 500);
    for _ in 0..40 {
        bench.hear(RIVAL, &angles(FOLLOW, 10.0, 0.0));
        bench.stream(MANAGER, &angles(FOLLOW, -20.0, 0.0), 50);
    }

    assert_near(bench.status().pitch, -20.0, 0.1);
    assert_eq!(bench.device.manager(bench.now), Some(MANAGER));
    assert_eq!(bench.device.refused(), RefusedSetpoints { not_manager: 40, ..RefusedSetpoints::default() });
}

/// "… or source of 281": an announcement for this very device wins over a mere setpoint.
#[test]
fn who_announces_itself_for_the_device_is_its_manager() {
    let mut bench = Bench::new(|_| {});
    bench.hear(RIVAL, &angles(FOLLOW, 10.0, 0.0));
    for other in [0, 1, 171] {
        bench.hear(MANAGER, &manager_status(other));
        assert_eq!(bench.device.manager(bench.now), Some(RIVAL), "status for device {other}");
    }
    bench.hear(MANAGER, &manager_status(154));
    assert_eq!(bench.device.manager(bench.now), Some(MANAGER));

    bench.hear(RIVAL, &manager_status(154));
    bench.hear(RIVAL, &angles(FOLLOW, 10.0, 0.0));
    assert_eq!(bench.device.manager(bench.now), Some(MANAGER));
    bench.hear(MANAGER, &angles(FOLLOW, -30.0, 0.0));
    assert_near(goal(&mut bench), -30.0, 0.1);
}

#[test]
fn a_storm32_manager_status_announces_as_well() {
    let mut bench = Bench::new(|_| {});
    let status = STORM32_GIMBAL_MANAGER_STATUS_DATA {
        gimbal_id: 154,
        supervisor: 0,
        device_flags: 0,
        manager_flags: 0,
        profile: 0,
    };
    bench.hear(MANAGER, &status);

    assert_eq!(bench.device.manager(bench.now), Some(MANAGER));
}

#[test]
fn setpoints_for_others_or_from_other_systems_have_no_effect() {
    for (source, system, component) in
        [(MANAGER, 1, 171), (MANAGER, 2, 154), (MavId::new(2, 191), 0, 0), (MavId::new(255, 190), 1, 154)]
    {
        let mut bench = Bench::new(|_| {});
        let mut setpoint = angles(FOLLOW, -20.0, 0.0);
        (setpoint.target_system, setpoint.target_component) = (system, component);
        bench.hear(source, &setpoint);

        assert_near(goal(&mut bench), 0.0, 0.01);
        assert_eq!(bench.device.manager(bench.now), None);
    }
}

/// PX4 addresses 284 to 1/0, MAVSDK's tester to 0/0.
#[test]
fn setpoints_for_everybody_are_for_it_too() {
    for (system, component) in [(1, 0), (0, 0)] {
        let mut bench = Bench::new(|_| {});
        let mut setpoint = angles(FOLLOW, -20.0, 0.0);
        (setpoint.target_system, setpoint.target_component) = (system, component);
        bench.hear(MANAGER, &setpoint);

        assert_near(goal(&mut bench), -20.0, 0.1);
    }
}

/// "NO_MANAGER 512 set when neither 281 nor 284 of its manager arrived for 2 s".
#[test]
fn no_manager_is_reported_two_seconds_after_its_last_word() {
    let mut bench = Bench::new(|_| {});
    assert!(bench.status().failures.contains(FailureFlags::NO_MANAGER));

    bench.hear(MANAGER, &manager_status(154));
    bench.run_for(1999);
    assert_eq!(bench.status().failures, FailureFlags::empty());
    bench.hear(MANAGER, &angles(FOLLOW, 0.0, 0.0));
    bench.run_for(1999);
    assert_eq!(bench.status().failures, FailureFlags::empty());
    bench.run_for(1);
    assert_eq!(bench.status().failures, FailureFlags::NO_MANAGER);

    bench.hear(RIVAL, &angles(FOLLOW, -20.0, 0.0));
    assert_eq!(bench.device.manager(bench.now), Some(RIVAL));
}

#[test]
fn malformed_setpoints_neither_move_nor_latch() {
    let mut half_nan = angles(FOLLOW, -20.0, 0.0);
    half_nan.q[2] = NAN;
    let mut zero = angles(FOLLOW, -20.0, 0.0);
    zero.q = [0.0; 4];
    let both = angles(FOLLOW | GimbalFlags::YAW_IN_EARTH_FRAME, -20.0, 0.0);
    let infinite = rates_only(FOLLOW, [0.0, f32::INFINITY, 0.0]);
    let mut bench = Bench::new(|_| {});
    for setpoint in [half_nan, zero, both, infinite] {
        bench.hear(MANAGER, &setpoint);
    }

    assert_eq!(bench.device.refused(), RefusedSetpoints { malformed: 4, ..RefusedSetpoints::default() });
    assert_eq!(bench.device.manager(bench.now), None);
    assert_near(goal(&mut bench), 0.0, 0.01);
}

#[test]
fn a_restart_forgets_the_manager_and_the_clock() {
    let mut bench = Bench::new(|_| {});
    bench.stream(MANAGER, &angles(FOLLOW, -20.0, 0.0), 2000);
    bench.device.handle_reboot(bench.now);
    bench.sent.clear();
    bench.run_for(300);

    let (_, status) = bench.take::<GIMBAL_DEVICE_ATTITUDE_STATUS_DATA>().pop().expect("it speaks again");
    assert_eq!(status.time_boot_ms, 250);
    assert_eq!(Status::from(&status).failures, FailureFlags::NO_MANAGER);
}

/// MAVSDK's tester looks for the type 0.1 to 0.3 s after its first setpoint, which is sooner than once a second.
#[test]
fn a_new_manager_gets_a_heartbeat_with_its_first_setpoint() {
    let mut bench = Bench::new(|_| {});
    bench.run_until(millis(10));

    for (source, later, expected) in
        [(MANAGER, 0, &["HEARTBEAT"][..]), (MANAGER, 0, &[]), (RIVAL, 0, &[]), (RIVAL, 2000, &["HEARTBEAT"])]
    {
        bench.run_for(later);
        bench.sent.clear();
        bench.hear(source, &angles(FOLLOW, -20.0, 0.0));
        assert_eq!(bench.names(), expected, "{source} after {later} ms");
    }
}
