//! What setpoints do.

use super::*;

/// "q finite ω NaN = angle".
#[test]
fn angles_are_gone_to_and_kept() {
    let mut bench = Bench::new(|_| {});
    bench.hear(MANAGER, &angles(FOLLOW, -45.0, 60.0));
    bench.run_for(10_000);

    let status = bench.status();
    assert_near(status.pitch, -45.0, 0.01);
    assert_near(status.yaw, 60.0, 0.01);
    assert_near(status.roll, 0.0, 0.01);
}

/// "q NaN and ω finite = rate (held, expires 1.0 s by default; `hold_forever` variant)".
#[test]
fn a_rate_expires_unless_it_is_repeated() {
    for (expiry, repeats, expected) in [
        (Some(Duration::from_secs(1)), 0, 10.0),
        (Some(Duration::from_secs(1)), 40, 29.5),
        (Some(Duration::from_millis(200)), 0, 2.0),
        (None, 0, 50.0),
    ] {
        let mut bench = Bench::new(|settings| settings.rate_expiry = expiry);
        let setpoint = rates_only(FOLLOW, [NAN, 0.0, 10.0]);
        bench.hear(MANAGER, &setpoint);
        bench.stream(MANAGER, &setpoint, repeats * 50);
        bench.run_until(millis(5000));

        assert_near(bench.device.plant().pose().yaw.degrees(), expected, 0.6);
        assert_near(bench.status().pitch, 0.0, 0.01);
    }
}

#[test]
fn a_rate_of_one_axis_leaves_the_others_where_they_are() {
    let mut bench = Bench::new(|_| {});
    bench.hear(MANAGER, &angles(FOLLOW, -30.0, 40.0));
    bench.run_for(3000);
    bench.stream(MANAGER, &rates_only(FOLLOW, [NAN, 10.0, NAN]), 1000);

    let status = bench.status();
    assert_near(status.pitch, -20.0, 1.0);
    assert_near(status.yaw, 40.0, 0.01);
}

/// "both finite = angle with |ω| as speed".
#[test]
fn a_rate_beside_an_angle_is_its_speed() {
    let mut bench = Bench::new(|_| {});
    bench.stream(MANAGER, &angles_at(FOLLOW, -20.0, 0.0, [0.0, 10.0, 0.0]), 1000);
    assert_near(bench.device.plant().pose().pitch.degrees(), -10.0, 0.5);

    bench.stream(MANAGER, &angles_at(FOLLOW, -20.0, 0.0, [0.0, 10.0, 0.0]), 2000);
    assert_near(bench.status().pitch, -20.0, 0.1);
}

/// "both NaN = flags only".
#[test]
fn flags_alone_change_what_yaw_is_held_against() {
    let mut bench = Bench::new(|_| {});
    bench.heading = Some((0.0, 0.0));
    bench.hear(MANAGER, &angles(FOLLOW, -10.0, 30.0));
    bench.run_for(3000);
    bench.hear(MANAGER, &rates_only(LOCK, [NAN; 3]));
    bench.heading = Some((0.0, 20.0));
    bench.run_for(2000);
    bench.heading = Some((40.0, 0.0));
    bench.run_for(2000);

    let status = bench.status();
    assert_eq!(status.flags, LOCK | GimbalFlags::ACCEPTS_YAW_IN_EARTH_FRAME);
    assert_near(status.yaw, 30.0, 0.5);
    assert_near(bench.device.plant().pose().yaw.degrees(), -10.0, 0.5);
}

/// Frame bits say what the numbers mean, YAW_LOCK says how the gimbal behaves (Protocol notes 3.5).
#[test]
#[rustfmt::skip]
fn frame_and_lock_decide_where_yaw_goes_when_the_vehicle_turns() {
    const VEHICLE: GimbalFlags = GimbalFlags::YAW_IN_VEHICLE_FRAME;
    const EARTH: GimbalFlags = GimbalFlags::YAW_IN_EARTH_FRAME;
    const YAW_LOCK: GimbalFlags = GimbalFlags::YAW_LOCK;
    for (flags,               sent,  vehicle_yaw, locked) in [
        (VEHICLE,             30.0,  30.0,        false),
        (VEHICLE | YAW_LOCK,  30.0,  30.0 - 60.0, true),
        (EARTH,               120.0, 30.0 - 60.0, true),
        (EARTH | YAW_LOCK,    120.0, 30.0 - 60.0, true),
        (YAW_LOCK,            120.0, 30.0 - 60.0, true),
        (GimbalFlags::empty(), 30.0, 30.0,        false),
    ] {
        let mut bench = Bench::new(|_| {});
        bench.heading = Some((90.0, 0.0));
        bench.run_for(500);
        bench.hear(MANAGER, &angles(LEVEL | flags, 0.0, sent));
        bench.run_for(2000);
        assert_near(bench.device.plant().pose().yaw.degrees(), 30.0, 0.1);

        bench.heading = Some((90.0, 30.0));
        bench.run_for(2000);
        bench.heading = Some((150.0, 0.0));
        bench.run_for(2000);

        assert_near(bench.device.plant().pose().yaw.degrees(), vehicle_yaw, 0.5);
        assert_eq!(bench.status().flags.contains(YAW_LOCK), locked, "{flags:?}");
    }
}

/// While it holds North, a turning vehicle does not drag the camera along.
#[test]
fn a_lock_holds_during_the_turn() {
    let mut bench = Bench::new(|_| {});
    bench.heading = Some((0.0, 10.0));
    bench.run_for(500);
    bench.hear(MANAGER, &angles(LOCK, 0.0, 90.0));
    bench.run_for(3000);
    bench.take::<GIMBAL_DEVICE_ATTITUDE_STATUS_DATA>();
    bench.run_for(20_000);

    let statuses = bench.take::<GIMBAL_DEVICE_ATTITUDE_STATUS_DATA>();
    assert_eq!(statuses.len(), 200);
    for (_, status) in &statuses {
        let status = Status::from(status);
        assert_near(status.yaw, 90.0, 0.5);
        assert_near(status.yaw_rate, 0.0, 0.2);
    }
}

#[test]
#[rustfmt::skip]
fn strictness_decides_which_frame_flags_are_taken() {
    use Strictness::{Legacy, Strict, VehicleOnly};
    let none = LEVEL;
    let lock = LEVEL | GimbalFlags::YAW_LOCK;
    for (strictness,  flags,  taken) in [
        (Legacy,      none,   true),
        (Legacy,      lock,   true),
        (Legacy,      FOLLOW, true),
        (Legacy,      LOCK,   true),
        (Strict,      none,   false),
        (Strict,      lock,   false),
        (Strict,      FOLLOW, true),
        (Strict,      LOCK,   true),
        (VehicleOnly, none,   true),
        (VehicleOnly, lock,   false),
        (VehicleOnly, FOLLOW, true),
        (VehicleOnly, LOCK,   false),
    ] {
        let mut bench = Bench::new(|settings| settings.strictness = strictness);
        bench.heading = Some((0.0, 0.0));
        bench.run_for(500);
        bench.hear(MANAGER, &angles(flags, -20.0, 0.0));
        bench.run_for(2000);

        let expected = RefusedSetpoints { frame: u32::from(!taken), ..RefusedSetpoints::default() };
        assert_eq!(bench.device.refused(), expected, "{strictness:?} {flags:?}");
        assert_near(bench.status().pitch, if taken { -20.0 } else { 0.0 }, 0.1);
    }
}

#[test]
fn without_a_heading_an_earth_angle_is_refused_and_an_earth_rate_is_not() {
    let mut bench = Bench::new(|_| {});
    bench.hear(MANAGER, &angles(LOCK, -20.0, 30.0));
    assert_eq!(bench.device.refused(), RefusedSetpoints { no_heading: 1, ..RefusedSetpoints::default() });

    bench.stream(MANAGER, &rates_only(LOCK, [NAN, NAN, 10.0]), 1000);
    assert_near(bench.device.plant().pose().yaw.degrees(), 10.0, 0.6);
    assert_near(bench.status().pitch, 0.0, 0.01);
}

/// "RETRACT → stow (pitch 0, yaw 0, roll 0, motors kept) or motors off …; NEUTRAL → 0/0/0".
#[test]
fn retract_and_neutral_go_to_zero_and_end_with_the_next_angle() {
    for flag in [GimbalFlags::RETRACT, GimbalFlags::NEUTRAL] {
        let mut bench = Bench::new(|_| {});
        bench.hear(MANAGER, &angles(FOLLOW, -45.0, 60.0));
        bench.run_for(3000);
        bench.hear(MANAGER, &angles(FOLLOW | flag, -10.0, 10.0));
        bench.run_for(3000);
        let status = bench.status();
        assert!(status.flags.contains(flag));
        assert_near(status.pitch, 0.0, 0.01);
        assert_near(status.yaw, 0.0, 0.01);

        bench.hear(MANAGER, &angles(FOLLOW, -45.0, 60.0));
        bench.run_for(3000);
        let status = bench.status();
        assert!(!status.flags.contains(flag));
        assert_near(status.pitch, -45.0, 0.01);
    }
}

/// "… or motors off in `gremsy` variant; after RETRACT the `gremsy_latched` variant ignores everything until reboot".
#[test]
fn motors_off_lets_the_camera_sink() {
    for (retract, pitch_after) in [(Retract::MotorsOff, -45.0), (Retract::MotorsOffUntilReboot, -25.0)] {
        let mut bench = Bench::new(|settings| settings.retract = retract);
        bench.hear(MANAGER, &rates_only(FOLLOW | GimbalFlags::RETRACT, [NAN; 3]));
        bench.run_for(6000);
        assert_near(bench.status().pitch, -25.0, 0.01);
        assert!(bench.status().flags.contains(GimbalFlags::RETRACT));

        bench.hear(MANAGER, &angles(FOLLOW, -45.0, 0.0));
        bench.run_for(3000);
        assert_near(bench.status().pitch, pitch_after, 0.01);

        bench.device.handle_reboot(bench.now);
        bench.hear(MANAGER, &angles(FOLLOW, -45.0, 0.0));
        bench.run_for(3000);
        assert_near(bench.status().pitch, -45.0, 0.01);
    }
}

#[test]
fn limits_hold_and_are_reported() {
    let axis = |min, max| AxisLimits::new(Angle::from_degrees(min), Angle::from_degrees(max));
    let limits = Limits { roll: axis(-45.0, 45.0), pitch: axis(-90.0, 30.0), yaw: axis(-160.0, 160.0) };
    let mut bench = Bench::new(|settings| settings.plant.limits = limits);
    bench.hear(MANAGER, &angles(FOLLOW, 50.0, 170.0));
    bench.stream(MANAGER, &angles(FOLLOW, 50.0, 170.0), 4000);

    let status = bench.status();
    assert_near(status.pitch, 30.0, 0.01);
    assert_near(status.yaw, 160.0, 0.01);
    assert_eq!(status.failures, FailureFlags::AT_PITCH_LIMIT | FailureFlags::AT_YAW_LIMIT);

    bench.stream(MANAGER, &angles(FOLLOW, 20.0, 150.0), 1000);
    assert_eq!(bench.status().failures, FailureFlags::empty());
}
