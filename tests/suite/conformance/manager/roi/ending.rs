//! What ends a region of interest, and what becomes of it when the vehicle is not heard.

use super::*;

/// "When 197 arrives, ROI stops; if the primary streams 287, its set-point applies, else NEUTRAL."
/// Protocol checklist 123: "When 195 with (0,0,0) arrives it acts like 197."
/// Client checklist E117: "197 as COMMAND_INT and COMMAND_LONG, p1 = id, 0 or NaN, x/y = 0, INT32_MIN or INT32_MAX:
/// ACCEPTED, tracking ends."
#[test]
fn items_122_and_123_a_region_of_interest_ends_in_neutral() {
    let nan_as_integer = 0x7ff8_0000;
    let ends = [
        command_long(MANAGER, 197, &[154.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]),
        command_long(MANAGER, 197, &[]),
        command_long(MANAGER, 197, &[0.0, NAN, NAN, NAN, 47.0, f32::INFINITY, 300.0]),
        in_frame(0, command_int(MANAGER, 197, [NAN; 4], 0, 0, NAN)),
        in_frame(0, command_int(MANAGER, 197, [154.0, NAN, NAN, NAN], i32::MIN, i32::MIN, NAN)),
        in_frame(10, command_int(MANAGER, 197, [0.0; 4], i32::MAX, i32::MAX, 0.0)),
        command_int(MANAGER, 197, [0.0; 4], nan_as_integer, nan_as_integer, f32::INFINITY),
        roi_location(0, [0.0, 0.0], 0.0),
        roi_location(3, [0.0, 0.0], -0.0),
        command_long(MANAGER, 195, &[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]),
    ];
    for end in ends {
        for has_neutral in [true, false] {
            let (mut world, places) = looking_at(BELOW, has_neutral);
            assert_eq!(world.result_of(places.ground, GCS, &end), Some(ACCEPTED), "{end:?}");
            let setpoint = only_setpoint(&mut world, places);
            if has_neutral {
                assert!(setpoint.flags == 2 | 44 && is_nan(&setpoint.q), "{setpoint:?}");
            } else {
                assert_eq!((setpoint.flags, setpoint.q), (44, [1.0, 0.0, 0.0, 0.0]));
            }
            assert_eq!(world.snapshot().gimbals[0].roi, None);
        }
    }
    // The primary has gone on streaming, which ended the region of interest before.
    let (mut world, places) = looking_at(BELOW, true);
    world.send(places.ground, GCS, &set_pitchyaw(-0.2, 0.3, NAN, NAN, 44));
    world.forget();
    assert_eq!(world.result_of(places.ground, GCS, &command_long(MANAGER, 197, &[])), Some(ACCEPTED));
    assert_eq!(setpoints(&mut world, places), []);
    world.run_for(SECOND / 10);
    let (_, setpoint) = setpoints(&mut world, places).pop().expect("it is streamed");
    let (pitch, yaw) = pitch_yaw_deg(setpoint.q);
    assert_near(pitch, (-0.2_f64).to_degrees(), 0.001);
    assert_near(yaw, 0.3_f64.to_degrees(), 0.001);
}

/// "When 201 with MAV_ROI 0 arrives it acts like 197; with 3 like 195." To us and to everybody in our system.
/// Protocol notes 2.6: "201: map MAV_ROI 0→197, 3→195, 4→198, 1→196, 2→UNSUPPORTED."
#[test]
fn item_126_the_command_of_old_ground_stations_is_taken_as_its_successors() {
    let [latitude, longitude] = BELOW.map(|degrees| degrees as f32);
    let integers = BELOW.map(|degrees| (degrees * 1e7).round() as i32);
    for target in [MANAGER, MavId::new(1, 0)] {
        let location = command_int(target, 201, [3.0, 0.0, 0.0, 0.0], integers[0], integers[1], 388.0);
        for look in [
            command_long(target, 201, &[3.0, 0.0, 0.0, 0.0, latitude, longitude, 388.0]),
            in_frame(0, location.clone()),
            in_frame(5, location),
        ] {
            let (mut world, places) = with_gimbal();
            fly(&mut world, places, FIELD, 0.0);
            assert_eq!(world.result_of(places.ground, GCS, &look), Some(ACCEPTED), "{look:?}");
            let (pitch, yaw) = pitch_yaw_deg(only_setpoint(&mut world, places).q);
            assert_near(pitch, -36.653, 0.05);
            assert_near(yaw, 34.176, 0.05);
            world.forget();
            let none = command_long(target, 201, &[0.0; 7]);
            assert_eq!(world.result_of(places.ground, GCS, &none), Some(ACCEPTED));
            let setpoint = only_setpoint(&mut world, places);
            assert!(setpoint.flags == 2 | 44 && is_nan(&setpoint.q), "{setpoint:?}");
        }
        // The rest is refused to who asked exactly us, and moves nothing.
        let (mut world, places) = with_gimbal();
        fly(&mut world, places, FIELD, 0.0);
        world.forget();
        for kind in [1.0, 2.0, 4.0, 5.0, NAN] {
            let other = command_long(target, 201, &[kind, 1.0, 0.0, 0.0, latitude, longitude, 388.0]);
            let answer = if target == MANAGER { Some(UNSUPPORTED) } else { None };
            assert_eq!(world.result_of(places.ground, GCS, &other), answer, "{target} {kind}");
        }
        assert_eq!(setpoints(&mut world, places), []);
        assert_eq!(world.snapshot().gimbals[0].primary, None);
        let rejected = world.snapshot().gimbals[0].rejected.get("255/190").cloned().unwrap_or_default();
        let counted = if target == MANAGER { Some(&5) } else { None };
        assert_eq!(rejected.get("do_set_roi_unsupported"), counted, "{rejected:?}");
    }
}

/// "When 287 from the primary arrives during ROI, ROI is cancelled." So do the others, and zero rates, which are how some
/// clients say stop.
/// Client checklist E119: "An accepted 1000 or 282 of the owner ends ROI."
#[test]
fn item_124_a_demand_ends_the_region_of_interest() {
    for demand in [
        set_pitchyaw(-0.2, 0.3, NAN, NAN, 44),
        set_pitchyaw(NAN, NAN, 0.1, 0.1, 44),
        set_pitchyaw(NAN, NAN, 0.0, 0.0, 44),
        set_attitude(quaternion(-10.0, 20.0), [NAN; 3], 44),
        set_attitude([NAN; 4], [NAN, 0.0, 0.0], 60),
        set_manual_control(NAN, NAN, 0.5, NAN),
        pitchyaw(-10.0, NAN, NAN, NAN, 44.0),
        pitchyaw(NAN, NAN, NAN, NAN, 2.0),
    ] {
        let (mut world, places) = looking_at(BELOW, true);
        world.send(places.ground, COMPANION, &demand);
        assert!(world.snapshot().gimbals[0].roi.is_some(), "somebody else's is refused");
        world.send(places.ground, GCS, &demand);
        assert_eq!(world.snapshot().gimbals[0].roi, None, "{demand:?}");
    }
}

/// "When 195 is addressed to S/154, it is forwarded to the device and not executed by us."
#[test]
fn item_127_a_place_for_the_device_is_the_devices_business() {
    let (mut world, places) = with_gimbal();
    fly(&mut world, places, FIELD, 0.0);
    world.forget();
    let sent = world.send(places.ground, GCS, &crate::support::script::to(GIMBAL, roi_location(0, BELOW, 388.0)));
    let heard: Vec<Vec<u8>> = world.take(places.gimbal).into_iter().map(|arrival| arrival.bytes).collect();
    assert_eq!(heard, [sent]);
    assert_eq!(world.take(places.ground), []);
    assert_eq!(world.snapshot().gimbals[0].roi, None);
}

/// "When the AP link is silent for 5 s, ROI and earth-frame conversion report stale, the gimbal keeps its last
/// vehicle-frame set-point."
#[test]
fn item_178_when_the_vehicle_falls_silent_the_gimbal_keeps_its_last_direction() {
    let to_north = pitchyaw(-10.0, 90.0, NAN, NAN, 92.0);
    for command in [roi_location(0, BELOW, 388.0), to_north] {
        let (mut world, places) = with_gimbal();
        fly(&mut world, places, FIELD, 30.0);
        assert_eq!(world.result_of(places.ground, GCS, &command), Some(ACCEPTED));
        let last = only_setpoint(&mut world, places);
        let is_stale = |world: &World| world.snapshot().gimbals[0].setpoint.clone().expect("a setpoint").stale;

        run_looking(&mut world, places, SECOND, 0.0, 0.0);
        assert!(!is_stale(&world), "a heading is good for a second");
        run_looking(&mut world, places, 9 * SECOND, 0.0, 0.0);
        assert!(is_stale(&world));
        let held = setpoints(&mut world, places);
        assert_eq!(held.len(), 200, "it is told so");
        assert!(held.iter().all(|(_, setpoint)| setpoint.q == last.q && setpoint.flags == 44));

        fly(&mut world, places, FIELD, 50.0);
        world.run_for(SECOND / 20);
        assert!(!is_stale(&world), "and follows again");
        let (_, setpoint) = setpoints(&mut world, places).pop().expect("it is told");
        let turned = pitch_yaw_deg(last.q).1 - pitch_yaw_deg(setpoint.q).1;
        assert_near(turned, 20.0, 0.001);
    }
}

/// Without a position, but with a heading, the direction over ground is kept: the camera does not turn with the vehicle.
#[test]
fn item_178_when_only_the_position_is_missing_the_direction_over_ground_is_kept() {
    let (mut world, places) = looking_at(BELOW, true);
    for tick in 1..=100 {
        turn_vehicle(&mut world, places, f64::from(tick));
        run_looking(&mut world, places, SECOND / 10, 0.0, 0.0);
    }
    assert!(world.snapshot().gimbals[0].setpoint.clone().expect("a setpoint").stale);
    let (_, setpoint) = setpoints(&mut world, places).pop().expect("it is told");
    assert_near(pitch_yaw_deg(setpoint.q).0, -36.653, 0.001);
    assert_near(pitch_yaw_deg(setpoint.q).1, 34.176 - 100.0, 0.001);
}
