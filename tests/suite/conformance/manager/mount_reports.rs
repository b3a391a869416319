//! Where the gimbal looks, for ground stations of gimbal protocol v1 (gimbal notes 2.6).

use gimbald::bridge::settings::Settings;
use gimbald::gimbals::settings::GimbalSettings;
use gimbald::wire::dialect::{
    GIMBAL_DEVICE_ATTITUDE_STATUS_DATA, MESSAGE_INTERVAL_DATA, MOUNT_ORIENTATION_DATA, MOUNT_STATUS_DATA, MavMessage,
};
use gimbald::wire::ids::CapFlags;

use super::frames::turn_vehicle;
use super::{FIELD, SECOND, assert_near, fly, look, run_looking, with_gimbal, with_gimbal_that};
use crate::support::script::{
    ACCEPTED, NAN, TEMPORARILY_REJECTED, command_long, device_status, of, pitchyaw, request_message, roi_location,
    set_interval, usual_capabilities,
};
use crate::support::world::{GCS, GIMBAL, MANAGER, Places, World, three_links};

const MOUNT_STATUS: u32 = 158;
const MOUNT_ORIENTATION: u32 = 265;

/// Gimbal statement 46: "MOUNT_STATUS and MOUNT_ORIENTATION emitted for old GCS equal −4500 cdeg / −45.0 deg for the same pose
/// and MAV sign." "MOUNT_STATUS (158) cdeg 4 Hz and MOUNT_ORIENTATION (265) 10 Hz when `v1_status = true`", to everybody but
/// gimbals.
#[test]
fn statement_46_old_ground_stations_are_told_where_the_gimbal_looks() {
    let (mut world, places) = with_v1_status(usual_capabilities());
    turn_vehicle(&mut world, places, 90.0);
    look(&mut world, places, -45.0, 30.0);
    world.forget();
    for _ in 0..20 {
        turn_vehicle(&mut world, places, 90.0);
        run_looking(&mut world, places, SECOND / 10, -45.0, 30.0);
    }
    for place in [places.ground, places.autopilot] {
        let heard = world.take(place);
        let ours: Vec<_> = heard.into_iter().filter(|arrival| arrival.source() == MANAGER).collect();
        let (statuses, orientations) = (of::<MOUNT_STATUS_DATA>(&ours), of::<MOUNT_ORIENTATION_DATA>(&ours));
        assert_eq!((statuses.len(), orientations.len()), (8, 20));
        for status in statuses {
            let MOUNT_STATUS_DATA { pointing_a, pointing_b, pointing_c, target_system, target_component, mount_mode } =
                status;
            assert_eq!([pointing_a, pointing_b, pointing_c], [-4_500, 0, 3_000], "pitch, roll, yaw");
            assert_eq!((target_system, target_component, mount_mode), (0, 0, 2));
        }
        for orientation in orientations {
            for (told, wanted) in [
                (orientation.roll, 0.0),
                (orientation.pitch, -45.0),
                (orientation.yaw, 30.0),
                (orientation.yaw_absolute, 120.0),
            ] {
                assert_near(told.into(), wanted, 1e-3);
            }
        }
    }
    let at_gimbal = world.take(places.gimbal);
    assert!(at_gimbal.iter().all(|arrival| ![MOUNT_STATUS, MOUNT_ORIENTATION].contains(&arrival.id())));
}

/// "Also on request by 511 and 512"; without the key nothing is told unasked, and 0 asks for that again.
#[test]
fn where_the_gimbal_looks_is_told_to_who_asks_in_the_way_of_v1() {
    let (mut world, places) = with_gimbal();
    run_looking(&mut world, places, SECOND, -45.0, 30.0);
    assert_eq!(told(&mut world, places), (0, 0));
    assert_eq!(world.result_of(places.ground, GCS, &request_message(MANAGER, MOUNT_STATUS)), Some(ACCEPTED));
    let heard = world.ask(places.ground, GCS, &request_message(MANAGER, MOUNT_STATUS));
    assert_eq!(of::<MOUNT_STATUS_DATA>(&heard).iter().map(|told| told.pointing_a).collect::<Vec<_>>(), [-4_500]);
    let heard = world.ask(places.ground, GCS, &request_message(MANAGER, MOUNT_ORIENTATION));
    let orientations: Vec<MOUNT_ORIENTATION_DATA> = of(&heard);
    assert_eq!(orientations.len(), 1);
    assert_near(orientations[0].pitch.into(), -45.0, 1e-3);
    assert!(orientations[0].yaw_absolute.is_nan(), "no heading is known");

    for (id, micros, expected) in [(MOUNT_ORIENTATION, 200_000.0, (0, 10)), (MOUNT_STATUS, 1e6, (2, 10))] {
        assert_eq!(world.result_of(places.ground, GCS, &set_interval(MANAGER, id, micros)), Some(ACCEPTED));
        world.forget();
        run_looking(&mut world, places, 2 * SECOND, -45.0, 30.0);
        assert_eq!(told(&mut world, places), expected);
        assert!(world.take(places.autopilot).iter().all(|arrival| arrival.id() != id), "only where it was asked");
        let heard = world.ask(places.ground, GCS, &command_long(MANAGER, 510, &[id as f32]));
        let intervals: Vec<MESSAGE_INTERVAL_DATA> = of(&heard);
        assert_eq!(intervals.iter().map(|told| told.interval_us as f32).collect::<Vec<_>>(), [micros]);
    }
    for id in [MOUNT_STATUS, MOUNT_ORIENTATION] {
        assert_eq!(world.result_of(places.ground, GCS, &set_interval(MANAGER, id, 0.0)), Some(ACCEPTED));
    }
    world.forget();
    run_looking(&mut world, places, SECOND, -45.0, 30.0);
    assert_eq!(told(&mut world, places), (0, 0));
}

/// Neither message can say that it is not true any more: of a gimbal that is silent nothing is told.
#[test]
fn of_a_gimbal_that_is_silent_nothing_is_told_in_the_way_of_v1() {
    let (mut world, places) = with_v1_status(usual_capabilities());
    run_looking(&mut world, places, SECOND, -45.0, 30.0);
    world.forget();
    world.run_for(2 * SECOND);
    let (statuses, orientations) = told(&mut world, places);
    assert!(statuses <= 5 && orientations <= 11, "for the second in which it is still taken for true");
    world.run_for(5 * SECOND);
    assert_eq!(told(&mut world, places), (0, 0));
    assert_eq!(
        world.result_of(places.ground, GCS, &request_message(MANAGER, MOUNT_STATUS)),
        Some(TEMPORARILY_REJECTED)
    );
}

/// A yaw from North cannot be told from the nose without a heading: 265 leaves it out, and 158 is not sent.
#[test]
fn a_yaw_that_is_not_known_from_the_nose_is_left_out() {
    let (mut world, places) = with_v1_status(usual_capabilities());
    let earth = GIMBAL_DEVICE_ATTITUDE_STATUS_DATA { flags: 92, ..device_status(world.now, 92, -45.0, 120.0) };
    world.send(places.gimbal, GIMBAL, &MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(earth));
    world.forget();
    world.run_for(SECOND / 2);
    let heard = world.take(places.ground);
    assert_eq!(of::<MOUNT_STATUS_DATA>(&heard), []);
    let orientations: Vec<MOUNT_ORIENTATION_DATA> = of(&heard);
    assert_eq!(orientations.len(), 5);
    assert!(orientations.iter().all(|told| told.yaw.is_nan() && (told.yaw_absolute - 120.0).abs() < 1e-3));
}

/// Protocol notes 3.6: "yaw_earth = yaw_vehicle + delta_yaw". A gimbal that tells its yaw from North and where the
/// nose points is told of from the nose, whether or not the autopilot tells a heading, and by its own where both do.
#[test]
fn the_heading_of_the_gimbal_itself_tells_its_yaw_from_the_nose() {
    for heading_deg in [None, Some(70.0)] {
        let (mut world, places) = with_v1_status(usual_capabilities());
        if let Some(heading_deg) = heading_deg {
            turn_vehicle(&mut world, places, heading_deg);
        }
        let status = device_status(world.now, 92, -45.0, 120.0);
        let delta_yaw = 90.0_f32.to_radians();
        let status = GIMBAL_DEVICE_ATTITUDE_STATUS_DATA { delta_yaw, delta_yaw_velocity: 0.0, ..status };
        world.send(places.gimbal, GIMBAL, &MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(status));
        world.forget();
        world.run_for(SECOND / 2);
        let heard = world.take(places.ground);
        let yaws: Vec<i32> = of::<MOUNT_STATUS_DATA>(&heard).iter().map(|told| told.pointing_c).collect();
        assert_eq!(yaws, [3_000, 3_000], "{heading_deg:?}");
        let orientations: Vec<MOUNT_ORIENTATION_DATA> = of(&heard);
        assert_eq!(orientations.len(), 5);
        for told in orientations {
            assert_near(told.yaw.into(), 30.0, 1e-3);
            assert_near(told.yaw_absolute.into(), 120.0, 1e-3);
        }
    }
}

/// A gimbal that has no radio control is under none, whatever its flags say.
#[test]
fn a_gimbal_without_radio_control_is_never_said_to_be_under_it() {
    let (mut world, places) = with_v1_status(usual_capabilities());
    let status = device_status(world.now, 256 | 44, 0.0, 0.0);
    world.send(places.gimbal, GIMBAL, &MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(status));
    world.forget();
    world.run_for(SECOND / 2);
    let told = of::<MOUNT_STATUS_DATA>(&world.take(places.ground));
    assert_eq!(told.iter().map(|told| told.mount_mode).collect::<Vec<_>>(), [2, 2]);
}

/// `mount_mode` says what the gimbal does.
#[test]
fn the_mode_of_a_mount_is_what_the_gimbal_does() {
    let (mut world, places) = with_v1_status(usual_capabilities() | CapFlags::HAS_RC_INPUTS);
    for (command, device_flags, mode) in [
        (pitchyaw(-20.0, 10.0, NAN, NAN, 44.0), 44, 2),
        (pitchyaw(NAN, NAN, 5.0, 0.0, 44.0), 44, 2),
        (pitchyaw(NAN, NAN, NAN, NAN, 1.0), 45, 0),
        (pitchyaw(NAN, NAN, NAN, NAN, 2.0), 46, 1),
        (roi_location(0, [47.5, 8.5], 400.0), 44, 4),
        (pitchyaw(NAN, NAN, NAN, NAN, 256.0), 256 | 44, 3),
    ] {
        fly(&mut world, places, FIELD, 0.0);
        look(&mut world, places, 0.0, 0.0);
        assert_eq!(world.result_of(places.ground, GCS, &command), Some(ACCEPTED), "{command:?}");
        let status = device_status(world.now, device_flags, 0.0, 0.0);
        world.send(places.gimbal, GIMBAL, &MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(status));
        world.forget();
        world.run_for(SECOND / 2);
        let modes: Vec<u8> =
            of::<MOUNT_STATUS_DATA>(&world.take(places.ground)).iter().map(|told| told.mount_mode).collect();
        assert_eq!(modes, [mode, mode]);
    }
}

fn with_v1_status(capabilities: CapFlags) -> (World, Places) {
    let gimbal = GimbalSettings { v1_status: true, ..GimbalSettings::found("camera".to_owned()) };
    with_gimbal_that(capabilities, Settings { gimbals: vec![gimbal], ..three_links() })
}

/// How many 158 and 265 of ours reached the ground station.
fn told(world: &mut World, places: Places) -> (usize, usize) {
    let heard = world.take(places.ground);
    (of::<MOUNT_STATUS_DATA>(&heard).len(), of::<MOUNT_ORIENTATION_DATA>(&heard).len())
}
