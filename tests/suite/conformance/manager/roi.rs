//! Regions of interest (protocol checklist 8.8).

use std::time::Duration;

use gimbald::bridge::settings::Settings;
use gimbald::manager::settings::{AltitudeReference, ControlSettings};
use gimbald::wire::MavId;
use gimbald::wire::dialect::{ATTITUDE_DATA, GIMBAL_DEVICE_ATTITUDE_STATUS_DATA, MavMessage};
use gimbald::wire::ids::CapFlags;
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use proptest::prelude::*;

use super::frames::turn_vehicle;
use super::{
    COMPANION, FIELD, SECOND, Setpoint, assert_near, fly, is_nan, look, only_setpoint, run_flying, run_looking,
    setpoints, with_gimbal, with_gimbal_that,
};
use crate::support::script::{
    ACCEPTED, DENIED, FAILED, NAN, TEMPORARILY_REJECTED, UNSUPPORTED, UNSUPPORTED_MAV_FRAME, ardupilot_heartbeat,
    command_int, command_long, device_information, device_status, gimbal_heartbeat, global_position, in_frame,
    pitch_yaw_deg, pitchyaw, px4_heartbeat, quaternion, roi_location, set_attitude, set_manual_control, set_pitchyaw,
    take_control, usual_capabilities,
};
use crate::support::wire::hex;
use crate::support::world::{AUTOPILOT, GCS, GIMBAL, MANAGER, Places, World, three_links};

/// A hundred metres to the North-East of [`FIELD`] and a hundred metres below it.
const BELOW: [f64; 2] = [47.398_742, 8.546_594];

/// "When COMMAND_INT 195 frame 0 (GV-13 style) arrives from the primary and position is known, ACK ACCEPTED, and the 284s
/// point at the location per the formula within 0.1°." On WGS-84, as D16 has it: yaw 34.176°, pitch −36.653°.
#[test]
fn item_115_the_gimbal_looks_at_the_place() {
    for (frame, accepts_north, heading, yaw) in
        [(0, true, 0.0, 34.176), (5, true, 200.0, 34.176), (0, false, 30.0, 4.176), (5, false, -50.0, 84.176)]
    {
        let (mut world, places) = with_gimbal();
        let status = device_status(world.now, if accepts_north { 44 | 128 } else { 44 }, 0.0, 0.0);
        world.send(places.gimbal, GIMBAL, &MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(status));
        fly(&mut world, places, FIELD, heading);
        assert_eq!(world.result_of(places.ground, GCS, &take_control()), Some(ACCEPTED));

        assert_eq!(world.result_of(places.ground, GCS, &roi_location(frame, BELOW, 388.0)), Some(ACCEPTED));

        let setpoint = only_setpoint(&mut world, places);
        assert_eq!(setpoint.flags, if accepts_north { 92 } else { 44 });
        let seen = pitch_yaw_deg(setpoint.q);
        assert_near(seen.0, -36.653, 0.001);
        assert_near(seen.1, yaw, 0.001);
        assert!(is_nan(&[setpoint.angular_velocity_x, setpoint.angular_velocity_y, setpoint.angular_velocity_z]));
        let shown = world.snapshot().gimbals[0].clone();
        assert_eq!(shown.roi.map(|roi| roi.altitude_amsl_m), Some(388.0));
        assert_eq!(shown.setpoint.map(|setpoint| (setpoint.mode, setpoint.stale)), Some(("roi".to_owned(), false)));
    }
}

/// The same, to the letter of GV-13, and the other vectors of the protocol notes 2.5.
#[test]
fn item_115_the_golden_vector_is_a_place() {
    let golden = hex("fd2000000bffbe4b000000001a430000000000000000000000004c52401c44f417050000f443c30001bf084a");
    for (north, east, up, pitch, yaw) in [
        (0.001, 0.001, -100.0, -36.653_f64, 34.176),
        (0.001, 0.0, 0.0, 0.0, 0.0),
        (-0.0005, 0.0, 0.0, 0.0, 180.0),
        (0.0, 0.0, -88.0, -90.0, 20.0),
    ] {
        let (mut world, places) = with_gimbal_that(endless_yaw(), three_links());
        look(&mut world, places, 0.0, 20.0);
        // The place of the vector is where the vehicle is in the notes, so the vehicle is moved the other way.
        fly(&mut world, places, [FIELD[0] - north, FIELD[1] - east, FIELD[2] - up], 0.0);
        world.forget();

        world.send_bytes(places.ground, &golden);

        let (seen_pitch, seen_yaw) = pitch_yaw_deg(only_setpoint(&mut world, places).q);
        assert_near(seen_pitch, pitch.max(LOWEST), 0.002);
        // A degree of longitude is longer a hundred metres further South.
        assert_near((seen_yaw - yaw).abs(), 0.0, 0.002);
    }
}

/// "When the frame is 6 (relative), altitude = z + (alt − relative_alt) of GLOBAL_POSITION_INT."
/// Protocol checklist 117: "When the frame is 10 or 1, ACK is 9." And so for each other frame that is not a height above
/// the sea or above home.
/// Client checklist E109: "With frames 0 and 5: AMSL. Frame 6 = 3." Client checklist E111: "Frames 10/11: accepted with a
/// documented approximation, or DENIED: never read as AMSL in silence."
#[test]
fn items_116_and_117_the_frame_says_what_the_altitude_counts_from() {
    let (mut world, places) = with_gimbal();
    for frame in 0..=255 {
        fly(&mut world, places, FIELD, 0.0);
        look(&mut world, places, 0.0, 0.0);
        let result = world.result_of(places.ground, GCS, &roi_location(frame, BELOW, 10.0));
        let amsl = world.snapshot().gimbals[0].roi.as_ref().map(|roi| roi.altitude_amsl_m);
        match frame {
            0 | 5 => assert_eq!((result, amsl), (Some(ACCEPTED), Some(10.0)), "frame {frame}"),
            3 | 6 => assert_eq!((result, amsl), (Some(ACCEPTED), Some(410.0)), "frame {frame}"),
            _ => assert_eq!((result, amsl), (Some(UNSUPPORTED_MAV_FRAME), None), "frame {frame}"),
        }
        end_roi(&mut world, places);
    }
}

/// "When 195 arrives as COMMAND_LONG and the autopilot is ArduPilot (3), altitude is relative; with PX4 (12) AMSL."
/// `altitude_reference` decides where it is set.
/// Client checklist E112: "COMMAND_LONG 195 with degrees in p5/p6, AMSL in p7, unused 0: ACCEPTED."
#[test]
fn item_118_without_a_frame_the_altitude_is_as_the_autopilot_has_it() {
    for (heartbeat, reference, amsl) in [
        (ardupilot_heartbeat(), AltitudeReference::Auto, 450.0),
        (px4_heartbeat(), AltitudeReference::Auto, 50.0),
        (ardupilot_heartbeat(), AltitudeReference::Amsl, 50.0),
        (px4_heartbeat(), AltitudeReference::Relative, 450.0),
    ] {
        let control = ControlSettings { roi_altitude: reference, ..ControlSettings::default() };
        let (mut world, places) = with_gimbal_that(usual_capabilities(), Settings { control, ..three_links() });
        fly(&mut world, places, FIELD, 0.0);
        world.send(places.autopilot, AUTOPILOT, &heartbeat);
        let command = command_long(MANAGER, 195, &[154.0, 0.0, 0.0, 0.0, 47.4, 8.55, 50.0]);
        assert_eq!(world.result_of(places.ground, GCS, &command), Some(ACCEPTED));
        let place = world.snapshot().gimbals[0].roi.clone().expect("a place");
        assert_near(place.latitude_deg, 47.4, 1e-5);
        assert_near(place.longitude_deg, 8.55, 1e-5);
        assert_near(place.altitude_amsl_m, amsl, 1e-6);
    }
}

/// "When no position was received for 5 s, ACK is TEMPORARILY_REJECTED."
/// Client checklist E114: "No vehicle position: TEMPORARILY_REJECTED, within 100 ms, and no motion."
#[test]
fn item_119_without_a_position_there_is_nothing_to_look_at() {
    let (mut world, places) = with_gimbal();
    turn_vehicle(&mut world, places, 0.0);
    for command in [roi_location(0, BELOW, 388.0), roi_location(3, BELOW, 388.0)] {
        assert_eq!(world.result_of(places.ground, GCS, &command), Some(TEMPORARILY_REJECTED), "none yet");
    }
    for (age_ms, result) in [(5_000, ACCEPTED), (5_001, TEMPORARILY_REJECTED)] {
        let (mut world, places) = with_gimbal();
        fly(&mut world, places, FIELD, 0.0);
        run_looking(&mut world, places, Duration::from_millis(age_ms), 0.0, 0.0);
        turn_vehicle(&mut world, places, 0.0);
        assert_eq!(world.result_of(places.ground, GCS, &roi_location(0, BELOW, 388.0)), Some(result), "{age_ms} ms");
        assert_eq!(setpoints(&mut world, places).len(), usize::from(result == ACCEPTED));
    }
    // Where the gimbal needs its yaw from the nose, it takes a heading, which is good for a second.
    let (mut world, places) = with_gimbal();
    fly(&mut world, places, FIELD, 0.0);
    run_looking(&mut world, places, Duration::from_millis(1_001), 0.0, 0.0);
    let refused = world.result_of(places.ground, GCS, &roi_location(0, BELOW, 388.0));
    assert_eq!(refused, Some(TEMPORARILY_REJECTED), "no heading");
    assert_eq!(setpoints(&mut world, places), []);
}

/// "When lat is 95° or lon 200°, or x/y is INT32_MAX, ACK is DENIED." Nor is a NaN a place, however it comes.
/// Client checklist E115: "Latitude beyond ±90° or NaN z: DENIED."
#[test]
fn item_120_a_place_that_is_none_is_denied() {
    let (mut world, places) = with_gimbal();
    fly(&mut world, places, FIELD, 0.0);
    look(&mut world, places, 0.0, 0.0);
    world.forget();
    let by_int = |x, y, z| in_frame(0, command_int(MANAGER, 195, [154.0, NAN, NAN, NAN], x, y, z));
    let by_long = |latitude, longitude, z| command_long(MANAGER, 195, &[154.0, NAN, NAN, NAN, latitude, longitude, z]);
    let (x, y) = (473_977_420, 85_455_940);
    let nan_as_integer = 0x7ff8_0000;
    let refused = [
        by_int(950_000_000, y, 400.0),
        by_int(-900_000_001, y, 400.0),
        by_int(x, 2_000_000_000, 400.0),
        by_int(x, -1_800_000_001, 400.0),
        by_int(i32::MAX, y, 400.0),
        by_int(x, i32::MAX, 400.0),
        by_int(i32::MIN, y, 400.0),
        by_int(x, i32::MIN, 400.0),
        by_int(nan_as_integer, nan_as_integer, 400.0),
        by_int(x, y, NAN),
        by_int(x, y, f32::INFINITY),
        by_int(x, y, 1e30),
        by_long(95.0, 8.5, 400.0),
        by_long(47.4, 200.0, 400.0),
        by_long(NAN, 8.5, 400.0),
        by_long(47.4, NAN, 400.0),
        by_long(47.4, 8.5, NAN),
        by_long(f32::NEG_INFINITY, 8.5, 400.0),
        by_long(i32::MAX as f32, i32::MAX as f32, 400.0),
        by_long(473_977_420.0, 85_455_940.0, 400.0),
    ];
    for command in &refused {
        assert_eq!(world.result_of(places.ground, GCS, command), Some(DENIED), "{command:?}");
        assert_eq!(setpoints(&mut world, places), []);
    }
    let rejected = &world.snapshot().gimbals[0].rejected["255/190"];
    assert_eq!(rejected.values().sum::<u64>(), refused.len() as u64, "{rejected:?}");
    assert_eq!(rejected["nan_as_integer"], 1);
    for (x, y) in [(900_000_000, 1_800_000_000), (-900_000_000, -1_800_000_000), (0, 1)] {
        assert_eq!(world.result_of(places.ground, GCS, &by_int(x, y, 400.0)), Some(ACCEPTED), "{x} {y}");
    }
}

/// "When the vehicle moves or turns during ROI, the set-point is recomputed at ≥ 10 Hz." And in the moment in which it is
/// heard, unless the gimbal has just been told something.
/// Client checklist E116: "After 195, moving the vehicle moves the gimbal to keep the point, ±2°."
#[test]
fn item_121_the_gimbal_follows_as_the_vehicle_moves_and_turns() {
    let (mut world, places) = with_gimbal_that(endless_yaw(), three_links());
    look(&mut world, places, 0.0, 0.0);
    fly(&mut world, places, FIELD, 0.0);
    assert_eq!(world.result_of(places.ground, GCS, &roi_location(0, BELOW, 388.0)), Some(ACCEPTED));
    world.forget();
    let mut last = world.now;
    for tick in 1..=200 {
        world.run_for(SECOND / 50);
        look(&mut world, places, 0.0, 0.0);
        // 10 m/s to the East, turning by 60°/s.
        let at = [FIELD[0], FIELD[1] + f64::from(tick) * 0.2 / 75_353.0, FIELD[2]];
        let heading = f64::from(tick) * 1.2;
        fly(&mut world, places, at, heading);
        let expected = direction(at, [BELOW[0], BELOW[1], 388.0]);
        for (when, setpoint) in setpoints(&mut world, places) {
            assert!(when - last <= Duration::from_millis(50), "{:?} without a setpoint", when - last);
            last = when;
            if when == world.now {
                let seen = sight(&setpoint, heading);
                assert!(seen.angle(&expected).to_degrees() < 0.02, "{}°", seen.angle(&expected).to_degrees());
            }
        }
        assert!(world.now - last <= Duration::from_millis(40), "the latest attitude is at most two ticks old");
    }
    // What comes when nothing was told for a while is followed at once.
    run_looking(&mut world, places, Duration::from_millis(45), 0.0, 0.0);
    world.forget();
    fly(&mut world, places, FIELD, 90.0);
    assert_eq!(setpoints(&mut world, places).len(), 1, "at once, and only once");
}

/// Only news of the heading makes a setpoint at once: an attitude that is trusted less, or the same again, does not use up the
/// moment of the one that counts. Where the gimbal tells the heading itself, its word counts.
#[test]
fn item_121_what_tells_the_heading_is_what_is_followed() {
    let (mut world, places) = with_gimbal_that(endless_yaw(), three_links());
    look(&mut world, places, 0.0, 0.0);
    fly(&mut world, places, FIELD, 0.0);
    assert_eq!(world.result_of(places.ground, GCS, &roi_location(0, BELOW, 388.0)), Some(ACCEPTED));
    world.forget();
    let attitude = |yaw: f32| {
        MavMessage::ATTITUDE(ATTITUDE_DATA {
            time_boot_ms: 0,
            roll: 0.0,
            pitch: 0.0,
            yaw,
            rollspeed: 0.0,
            pitchspeed: 0.0,
            yawspeed: 0.0,
        })
    };
    world.run_for(Duration::from_millis(45));
    world.send(places.autopilot, AUTOPILOT, &attitude(1.0));
    turn_vehicle(&mut world, places, 0.0);
    assert_eq!(setpoints(&mut world, places), []);
    turn_vehicle(&mut world, places, 3.0);
    assert_eq!(setpoints(&mut world, places).len(), 1);
    for heading in [10.0_f32, 20.0] {
        world.run_for(Duration::from_millis(45));
        world.forget();
        let status = GIMBAL_DEVICE_ATTITUDE_STATUS_DATA {
            delta_yaw: heading.to_radians(),
            ..device_status(world.now, 44, 0.0, 0.0)
        };
        world.send(places.gimbal, GIMBAL, &MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(status));
        let told = only_setpoint(&mut world, places);
        assert_near(pitch_yaw_deg(told.q).1, 34.176 - f64::from(heading), 0.001);
        turn_vehicle(&mut world, places, 50.0);
        assert_eq!(setpoints(&mut world, places), []);
    }
}

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

/// Client checklist E110: "(MAVSDK 1.4) Same with p1 = NaN: all gimbals (or the only one)." A-64: an id is honoured.
#[test]
fn client_item_e110_a_place_is_for_the_gimbal_that_is_named() {
    let second = MavId::new(1, 171);
    let (mut world, places) = with_gimbal();
    world.send(places.gimbal, second, &gimbal_heartbeat());
    let information = device_information(world.now, usual_capabilities());
    world.send(places.gimbal, second, &MavMessage::GIMBAL_DEVICE_INFORMATION(information));
    let status = device_status(world.now, 44, 0.0, 0.0);
    world.send(places.gimbal, second, &MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(status));
    let (x, y) = (473_987_420, 85_465_940);
    for (component, id, told) in [
        (191, 154.0, Some([true, false])),
        (191, 0.0, Some([true, false])),
        (191, NAN, Some([true, false])),
        (192, NAN, Some([false, true])),
        (0, NAN, Some([true, true])),
        (0, 171.0, Some([false, true])),
        (191, 171.0, None),
        (191, 1.0, None),
        (191, 154.5, None),
        (0, 99.0, Some([false, false])),
    ] {
        fly(&mut world, places, FIELD, 0.0);
        world.forget();
        let command = in_frame(0, command_int(MavId::new(1, component), 195, [id, NAN, NAN, NAN], x, y, 388.0));
        let answers = world.ask(places.ground, GCS, &command);
        let acks = answers.iter().filter(|answer| answer.id() == 77);
        let acks: Vec<(u8, u8)> = acks
            .map(|answer| {
                (answer.source().component, answer.decode::<gimbald::wire::dialect::COMMAND_ACK_DATA>().result)
            })
            .collect();
        let looks: Vec<bool> = world.snapshot().gimbals.iter().map(|gimbal| gimbal.roi.is_some()).collect();
        match told {
            Some(told) => {
                assert_eq!(looks, told, "{component} {id}");
                let expected: Vec<(u8, u8)> = [191, 192]
                    .into_iter()
                    .zip(told)
                    .filter_map(|(manager, told)| told.then_some((manager, ACCEPTED)))
                    .collect();
                assert_eq!(acks, expected, "{component} {id}");
            }
            None => assert_eq!((looks, acks), (vec![false, false], vec![(component, DENIED)]), "{component} {id}"),
        }
        for manager in [191, 192] {
            world.send(places.ground, GCS, &command_long(MavId::new(1, manager), 197, &[]));
        }
    }
}

/// Client checklist E113: "COMMAND_INT 195 frame 0, same content resent twice at 1 s: harmless."
#[test]
fn client_item_e113_the_same_place_again_is_harmless() {
    let (mut world, places) = looking_at(BELOW, true);
    let mut told = Vec::new();
    for _ in 0..3 {
        assert_eq!(world.result_of(places.ground, GCS, &roi_location(0, BELOW, 388.0)), Some(ACCEPTED));
        run_flying(&mut world, places, SECOND, FIELD, 0.0);
        told.extend(setpoints(&mut world, places));
    }
    assert!(told.len() >= 60);
    assert!(told.iter().all(|(_, setpoint)| setpoint.q == told[0].1.q));
}

/// A-23 and D5: a region of interest passes the gate of all demands. A lost gimbal looks at nothing.
#[test]
fn a_region_of_interest_passes_the_gate() {
    let (mut world, places) = looking_at(BELOW, true);
    for command in [roi_location(0, [47.5, 8.5], 100.0), command_long(MANAGER, 197, &[])] {
        assert_eq!(world.result_of(places.autopilot, COMPANION, &command), Some(DENIED));
    }
    assert_eq!(world.snapshot().gimbals[0].rejected["1/192"]["not_in_control"], 2);
    assert_eq!(world.snapshot().gimbals[0].roi.as_ref().map(|roi| roi.altitude_amsl_m), Some(388.0));
    world.run_for(4 * SECOND);
    assert_eq!(world.result_of(places.ground, GCS, &roi_location(0, BELOW, 388.0)), Some(FAILED));
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

/// What the limits of the scripted gimbal leave of straight down.
const LOWEST: f64 = -85.943_669_269_623_48;

/// A gimbal whose yaw turns without end; its pitch ends at −1.5 rad.
fn endless_yaw() -> CapFlags {
    usual_capabilities() | CapFlags::SUPPORTS_INFINITE_YAW
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

/// A ground station in control looks at a place from [`FIELD`], heading North.
fn looking_at(place: [f64; 2], has_neutral: bool) -> (World, Places) {
    let mut capabilities = usual_capabilities();
    capabilities.set(CapFlags::HAS_NEUTRAL, has_neutral);
    let (mut world, places) = with_gimbal_that(capabilities, three_links());
    look(&mut world, places, 0.0, 0.0);
    fly(&mut world, places, FIELD, 0.0);
    assert_eq!(world.result_of(places.ground, GCS, &take_control()), Some(ACCEPTED));
    assert_eq!(world.result_of(places.ground, GCS, &roi_location(0, place, 388.0)), Some(ACCEPTED));
    world.forget();
    (world, places)
}

fn end_roi(world: &mut World, places: Places) {
    assert_eq!(world.result_of(places.ground, GCS, &command_long(MANAGER, 197, &[])), Some(ACCEPTED));
    world.forget();
}

/// The line of sight that a setpoint asks for, in North, East, Down, on a vehicle that looks to `heading_deg`.
fn sight(setpoint: &Setpoint, heading_deg: f64) -> Vector3<f64> {
    let [w, x, y, z] = setpoint.q.map(f64::from);
    let camera = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
    let heading = if setpoint.flags & 64 != 0 { 0.0 } else { heading_deg.to_radians() };
    UnitQuaternion::from_axis_angle(&Vector3::z_axis(), heading) * camera * Vector3::x()
}

/// The direction from one place to another, by a library of somebody else.
fn direction(from: [f64; 3], to: [f64; 3]) -> Vector3<f64> {
    let [latitude, longitude, altitude] = from;
    let (east, north, up) = map_3d::geodetic2enu(
        to[0].to_radians(),
        to[1].to_radians(),
        to[2],
        latitude.to_radians(),
        longitude.to_radians(),
        altitude,
        map_3d::Ellipsoid::WGS84,
    );
    Vector3::new(north, east, -up)
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
