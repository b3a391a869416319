//! Regions of interest (protocol checklist 8.8).

mod bearing;
mod ending;

use std::time::Duration;

use gimbald::bridge::settings::Settings;
use gimbald::manager::settings::{AltitudeReference, ControlSettings};
use gimbald::wire::MavId;
use gimbald::wire::dialect::{ATTITUDE_DATA, GIMBAL_DEVICE_ATTITUDE_STATUS_DATA, MavMessage};
use gimbald::wire::ids::CapFlags;
use nalgebra::{Quaternion, UnitQuaternion, Vector3};

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

/// What the limits of the scripted gimbal leave of straight down.
const LOWEST: f64 = -85.943_669_269_623_48;

/// A gimbal whose yaw turns without end; its pitch ends at −1.5 rad.
fn endless_yaw() -> CapFlags {
    usual_capabilities() | CapFlags::SUPPORTS_INFINITE_YAW
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

/// "A gimbal never keeps turning after its operator is gone": a place that gives no direction, as the vehicle is there itself,
/// ends a rotation like any other demand, and what is told meanwhile is no rotation.
#[test]
fn a_place_without_a_direction_ends_a_rotation() {
    for height in [0.0, 0.3] {
        let (mut world, places) = with_gimbal();
        fly(&mut world, places, FIELD, 0.0);
        world.send(places.ground, GCS, &set_pitchyaw(NAN, NAN, 0.0, 0.1, 44));
        run_flying(&mut world, places, SECOND / 2, FIELD, 0.0);
        assert!(setpoints(&mut world, places).iter().all(|(_, setpoint)| setpoint.angular_velocity_z == 0.1));

        let here = roi_location(0, [FIELD[0], FIELD[1]], FIELD[2] as f32 + height);
        assert_eq!(world.result_of(places.ground, GCS, &here), Some(ACCEPTED));
        run_flying(&mut world, places, 3 * SECOND, FIELD, 0.0);

        let told = setpoints(&mut world, places);
        assert!(told.len() >= 50, "{}", told.len());
        assert!(
            told.iter().all(|(_, setpoint)| [setpoint.angular_velocity_y, setpoint.angular_velocity_z] == [0.0, 0.0]),
            "{told:?}"
        );
        assert_eq!(world.snapshot().gimbals[0].setpoint.as_ref().map(|it| it.mode.as_str()), Some("roi"));
    }
}
