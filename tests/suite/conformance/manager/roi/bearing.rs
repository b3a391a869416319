//! Where a place is from where the vehicle is: straight below, behind an end stop, far away.

use proptest::prelude::*;

use super::*;

/// "If hypot < 0.5 m keep the last yaw" (protocol notes 2.5): straight above a place any yaw is right, and the last one is
/// kept over ground also while the vehicle turns. Behind it the gimbal looks back, and pitch never passes straight down.
#[test]
fn overhead_the_last_yaw_is_kept() {
    let (mut world, places) = with_gimbal_that(endless_yaw(), three_links());
    look(&mut world, places, 0.0, 0.0);
    let from_the_south = |metres: f64| [FIELD[0] + metres / 111_190.0, FIELD[1], FIELD[2]];
    fly(&mut world, places, from_the_south(-40.0), 0.0);
    let place = roi_location(0, [FIELD[0], FIELD[1]], 438.0);
    assert_eq!(world.result_of(places.ground, GCS, &place), Some(ACCEPTED));
    world.forget();
    for step in -400_i32..=400 {
        let metres = f64::from(step) / 10.0;
        let heading = metres;
        world.run_for(SECOND / 20);
        look(&mut world, places, 0.0, 0.0);
        world.forget();
        fly(&mut world, places, from_the_south(metres), heading);
        world.run_for(SECOND / 20);
        let (_, setpoint) = setpoints(&mut world, places).pop().expect("it is told");
        let (pitch, yaw) = pitch_yaw_deg(setpoint.q);
        let over_ground = yaw + heading;
        // Half a metre short of it the yaw is the same as long before it; beyond that it is the other way round.
        let expected = if metres < 0.49 { 0.0 } else { 180.0 };
        if (metres - 0.5).abs() > 0.02 {
            let miss = (over_ground - expected + 540.0).rem_euclid(360.0) - 180.0;
            assert_near(miss, 0.0, 0.02);
        }
        assert!((-90.0..-50.0).contains(&(pitch - 1e-3)), "{pitch} at {metres} m");
        assert_near(pitch, (-(50.0_f64.atan2(metres.abs())).to_degrees()).max(LOWEST), 0.1);
    }
}

/// At the place itself there is no direction at all: the last one is kept, and without any nothing is told.
#[test]
fn at_the_place_itself_nothing_turns() {
    let (mut world, places) = with_gimbal();
    fly(&mut world, places, FIELD, 0.0);
    let here = roi_location(0, [FIELD[0], FIELD[1]], FIELD[2] as f32);
    assert_eq!(world.result_of(places.ground, GCS, &here), Some(ACCEPTED));
    run_flying(&mut world, places, SECOND, FIELD, 10.0);
    assert_eq!(setpoints(&mut world, places), []);
    assert_eq!(world.snapshot().gimbals[0].roi.as_ref().map(|roi| roi.altitude_amsl_m), Some(FIELD[2]));
    run_flying(&mut world, places, SECOND / 2, [FIELD[0] - 0.001, FIELD[1], FIELD[2]], 10.0);
    let towards = setpoints(&mut world, places).pop().expect("it is away").1;
    assert_near(pitch_yaw_deg(towards.q).1, -10.0, 0.01);
    run_flying(&mut world, places, SECOND / 2, FIELD, 10.0);
    let kept = setpoints(&mut world, places).pop().expect("it is told").1;
    assert_near(pitch_yaw_deg(kept.q).1, -10.0, 0.01);
}

/// A place behind the end stops is looked at from the nearer end. The camera does not swing round for the little by which
/// positions wobble, but it does when the other end is clearly nearer.
#[test]
fn behind_the_end_stops_the_camera_does_not_swing_to_and_fro() {
    let (mut world, places) = with_gimbal();
    look(&mut world, places, 0.0, 100.0);
    let south = roi_location(0, [FIELD[0] - 0.01, FIELD[1]], 488.0);
    fly(&mut world, places, FIELD, 10.0);
    assert_eq!(world.result_of(places.ground, GCS, &south), Some(ACCEPTED));
    world.forget();
    let side = 2.0_f64.to_degrees();
    // 180° minus the heading is where the place is from the nose.
    for (heading, yaw) in [
        (10.0, side),
        (1.0, side),
        (-1.0, side),
        (-3.0, side),
        (2.0, side),
        (-4.0, side),
        (-8.0, -side),
        (4.0, -side),
        (0.0, -side),
        (8.0, side),
        (70.0, 110.0),
    ] {
        run_flying(&mut world, places, SECOND / 10, FIELD, heading);
        let told = setpoints(&mut world, places).pop().expect("it is told").1;
        assert_near(pitch_yaw_deg(told.q).1, yaw, 0.01);
    }
}

/// The antimeridian is a line on maps only.
#[test]
fn a_place_beyond_the_antimeridian_is_near() {
    let (mut world, places) = with_gimbal();
    for (longitude, place, yaw) in [(179.9999, -179.9999, 90.0), (-179.9999, 179.9999, -90.0), (180.0, -179.9999, 90.0)]
    {
        fly(&mut world, places, [-17.0, longitude, 100.0], 0.0);
        look(&mut world, places, 0.0, 0.0);
        assert_eq!(world.result_of(places.ground, GCS, &roi_location(0, [-17.0, place], 100.0)), Some(ACCEPTED));
        assert_near(pitch_yaw_deg(only_setpoint(&mut world, places).q).1, yaw, 0.001);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// "pointing (ROI) against an independent WGS-84 reference fed the same quantised inputs, as the angle between
    /// direction vectors: under 0.02° from 20 m to 20 km, at any latitude and attitude".
    #[test]
    fn the_gimbal_looks_where_an_independent_reference_says(
        latitude in -89.9..89.9_f64, longitude in -180.0..180.0_f64, height in 30.0..3_000.0_f64,
        distance in 20.0..20_000.0_f64, azimuth in 0.0..360.0_f64, heading in -180.0..180.0_f64,
        tilt in -40.0..40.0_f64, accepts_north in any::<bool>(),
    ) {
        let (mut world, places) = with_gimbal_that(free_gimbal(), three_links());
        introduce_free(&mut world, places, if accepts_north { 44 | 128 } else { 44 });
        let at = [latitude, longitude, height];
        let place = moved(at, distance, azimuth);
        world.send(places.autopilot, AUTOPILOT, &px4_heartbeat());
        let q = tilted(heading, tilt);
        let mut state = crate::support::script::autopilot_state(world.now, MavId::new(0, 0), 0.0);
        state.q = q;
        world.send(places.autopilot, AUTOPILOT, &MavMessage::AUTOPILOT_STATE_FOR_GIMBAL_DEVICE(state));
        let position = global_position(world.now, at, 10.0);
        world.send(places.autopilot, AUTOPILOT, &position);

        let command = roi_location(0, [place[0], place[1]], place[2] as f32);
        prop_assert_eq!(world.result_of(places.ground, GCS, &command), Some(ACCEPTED));

        let setpoint = only_setpoint(&mut world, places);
        let quantised = |degrees: f64| (degrees * 1e7).round() / 1e7;
        let from = [quantised(at[0]), quantised(at[1]), (at[2] * 1e3).round() / 1e3];
        let expected = direction(from, [quantised(place[0]), quantised(place[1]), f64::from(place[2] as f32)]);
        // The heading as the quaternion on the wire has it.
        let sent = UnitQuaternion::from_quaternion(Quaternion::new(q[0], q[1], q[2], q[3]).cast::<f64>());
        let nose = sent * Vector3::x();
        let seen = sight(&setpoint, nose.y.atan2(nose.x).to_degrees());
        let error = seen.angle(&expected).to_degrees();
        prop_assert!(error < 0.02, "{error}°");
    }
}

fn free_gimbal() -> CapFlags {
    endless_yaw()
}

/// The gimbal has no end stops at all, and looks ahead.
fn introduce_free(world: &mut World, places: Places, flags: u16) {
    let mut information = device_information(world.now, free_gimbal());
    (information.pitch_min, information.pitch_max) = (NAN, NAN);
    world.send(places.gimbal, GIMBAL, &MavMessage::GIMBAL_DEVICE_INFORMATION(information));
    let status = device_status(world.now, flags, 0.0, 0.0);
    world.send(places.gimbal, GIMBAL, &MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(status));
    world.forget();
}

/// A place so many metres away on a plane that touches the ground, at a height of zero.
fn moved([latitude, longitude, _]: [f64; 3], distance: f64, azimuth: f64) -> [f64; 3] {
    let (east, north) = (distance * azimuth.to_radians().sin(), distance * azimuth.to_radians().cos());
    let (latitude, longitude, _) = map_3d::enu2geodetic(
        east,
        north,
        0.0,
        latitude.to_radians(),
        longitude.to_radians(),
        0.0,
        map_3d::Ellipsoid::WGS84,
    );
    [latitude.to_degrees(), (longitude.to_degrees() + 180.0).rem_euclid(360.0) - 180.0, 0.0]
}

/// A vehicle that looks to `heading_deg` and banks and climbs.
fn tilted(heading_deg: f64, tilt_deg: f64) -> [f32; 4] {
    let radians = f64::to_radians;
    let q = UnitQuaternion::from_euler_angles(radians(tilt_deg / 2.0), radians(tilt_deg), radians(heading_deg));
    [q.w as f32, q.i as f32, q.j as f32, q.k as f32]
}
