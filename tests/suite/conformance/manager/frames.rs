//! What yaw is measured from (protocol checklist 8.7).

use std::collections::BTreeMap;
use std::time::Duration;

use gimbald::bridge::snapshot::AttitudeSnapshot;
use gimbald::wire::MavId;
use gimbald::wire::dialect::{GIMBAL_DEVICE_ATTITUDE_STATUS_DATA, MavMessage};

use super::{SECOND, assert_near, look, only_setpoint, run_looking, setpoints, with_gimbal};
use crate::support::script::{
    ACCEPTED, NAN, TEMPORARILY_REJECTED, autopilot_state, device_status, pitch_yaw_deg, pitchyaw, px4_heartbeat,
    quaternion,
};
use crate::support::wire::{frame_v2, hex};
use crate::support::world::{AUTOPILOT, GCS, GIMBAL, Places, World};

/// What a 285 means, for each way in which gimbals say it. The autopilot's heading is 10°.
///
/// Protocol checklist 103: "When 285 has flags 44, q yaw 30° and delta_yaw 100° (extension present), HTTP reports
/// yaw_vehicle 30°, yaw_earth 130°."
/// Protocol checklist 104: "When 285 has flags 76 (R+P lock, EARTH) and delta_yaw 100°, q yaw 130° is reported as
/// yaw_earth 130°, yaw_vehicle 30°."
/// Protocol checklist 105: "When 285 has flags 28 (legacy, LOCK, no frame bit), yaw is earth; delta_yaw is ignored even
/// if non-zero."
/// Protocol checklist 106: "When 285 has flags 12 (legacy, no LOCK), yaw is vehicle".
/// Protocol checklist 108: "When delta_yaw is NaN, the autopilot's heading is used."
/// a gimbal that reports the vehicle frame while locked (60) is believed in that.
#[test]
#[rustfmt::skip]
fn items_103_to_108_yaw_is_shown_in_both_frames() {
    for (flags, yaw,   delta_yaw, in_vehicle, in_earth) in [
        (44,    30.0,  100.0,     30.0,       130.0),
        (76,    130.0, 100.0,     30.0,       130.0),
        (28,    130.0, 100.0,     120.0,      130.0),
        (12,    30.0,  100.0,     30.0,       40.0),
        (44,    30.0,  f32::NAN,  30.0,       40.0),
        (76,    30.0,  f32::NAN,  20.0,       30.0),
        (44,    170.0, 100.0,     170.0,      -90.0),
        (60,    30.0,  100.0,     30.0,       130.0),
        (60,    30.0,  f32::NAN,  30.0,       40.0),
    ] {
        let (mut world, places) = with_gimbal();
        turn_vehicle(&mut world, places, 10.0);
        let status = device_status(world.now, flags, 0.0, yaw);
        let status = GIMBAL_DEVICE_ATTITUDE_STATUS_DATA { delta_yaw: delta_yaw.to_radians(), ..status };

        world.send(places.gimbal, GIMBAL, &MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(status));

        let shown = attitude(&world);
        assert_near(shown.yaw_vehicle_deg.expect("known"), in_vehicle, 0.01);
        assert_near(shown.yaw_earth_deg.expect("known"), in_earth, 0.01);
    }
}

/// "GV-7 decodes so": the legacy form without extensions.
#[test]
fn item_106_the_golden_vector_of_a_legacy_gimbal_is_in_the_vehicle_frame() {
    let (mut world, places) = with_gimbal();
    turn_vehicle(&mut world, places, 10.0);
    let golden =
        hex("fd25000005019a1d0100881300000000803f0000000000000000000000000000c07f0000c07f0000c07f000000000cb75e");

    world.send_bytes(places.gimbal, &golden);

    let shown = attitude(&world);
    assert_near(shown.yaw_vehicle_deg.expect("known"), 0.0, 1e-6);
    assert_near(shown.yaw_earth_deg.expect("known"), 10.0, 0.01);
}

/// "When 285 is 40 bytes long with flags 44, delta_yaw is unknown and the autopilot's heading is used."
#[test]
fn item_107_a_heading_that_was_not_sent_is_not_north() {
    let (mut world, places) = with_gimbal();
    turn_vehicle(&mut world, places, 10.0);
    let mut payload = Vec::new();
    payload.extend_from_slice(&5_000_u32.to_le_bytes());
    for number in quaternion(0.0, 30.0).into_iter().chain([0.0; 3]) {
        payload.extend_from_slice(&number.to_le_bytes());
    }
    payload.extend_from_slice(&0_u32.to_le_bytes());
    payload.extend_from_slice(&44_u16.to_le_bytes());
    payload.extend_from_slice(&[0, 0]);
    assert_eq!(payload.len(), 40);
    for len in [37, 38, 40] {
        world.send_bytes(places.gimbal, &frame_v2(285, 137, 0, &payload[..len], None));
        assert_near(attitude(&world).yaw_earth_deg.expect("known"), 40.0, 0.01);
    }
}

/// "When 285 sets both 32 and 64, attitude is not updated, a counter rises." A-03: so it is with a quaternion that is none.
#[test]
fn item_114_an_attitude_in_two_frames_is_not_believed() {
    for (flags, q, reason) in [
        (32 | 64, quaternion(-20.0, 50.0), "both_yaw_frames"),
        (4 | 8 | 16 | 32 | 64, quaternion(-20.0, 50.0), "both_yaw_frames"),
        (44, [0.0; 4], "malformed_quaternion"),
        (44, [NAN; 4], "malformed_quaternion"),
        (44, [f32::INFINITY, 0.0, 0.0, 0.0], "malformed_quaternion"),
    ] {
        let (mut world, places) = with_gimbal();
        look(&mut world, places, -10.0, 5.0);
        for told in 1..=3 {
            let status = GIMBAL_DEVICE_ATTITUDE_STATUS_DATA { q, ..device_status(world.now, flags, 0.0, 0.0) };
            world.forget();
            let sent = world.send(places.gimbal, GIMBAL, &MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(status));

            let shown = attitude(&world);
            assert_near(shown.pitch_deg.expect("known"), -10.0, 0.01);
            assert_near(shown.yaw_vehicle_deg.expect("known"), 5.0, 0.01);
            let gimbal = &world.snapshot().gimbals[0];
            assert_eq!(gimbal.state, "alive");
            assert_eq!(gimbal.rejected["1/154"], BTreeMap::from([(reason.to_owned(), told)]));
            assert_eq!(world.take(places.ground)[0].bytes, sent, "it is the device's, and passes");
        }
    }
}

/// "warn when |heading − gimbal heading| drifts": a gimbal that takes another direction for the vehicle's is told
/// of, as long as it does, and nothing moves because of it.
#[test]
fn a_gimbal_with_a_heading_of_its_own_is_told_of() {
    let (mut world, places) = with_gimbal();
    assert_eq!(world.result_of(places.ground, GCS, &pitchyaw(-20.0, 10.0, NAN, NAN, 44.0)), Some(ACCEPTED));
    let told = |world: &World| world.snapshot().conflicts;
    for (of_gimbal, seconds, expected) in [
        (25.0, 15, None),
        (-30.0, 8, None),
        (-30.0, 4, Some("gimbal 1/154 takes the nose of the vehicle to be 40° further left than the autopilot does")),
        // Half a minute after the last time it is over.
        (10.0, 31, None),
        (100.0, 12, Some("gimbal 1/154 takes the nose of the vehicle to be 90° further right than the autopilot does")),
    ] {
        for _ in 0..seconds * 2 {
            turn_vehicle(&mut world, places, 10.0);
            let status = device_status(world.now, 44, -20.0, 10.0);
            let delta_yaw = f32::to_radians(of_gimbal);
            let status = GIMBAL_DEVICE_ATTITUDE_STATUS_DATA { delta_yaw, ..status };
            world.send(places.gimbal, GIMBAL, &MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(status));
            world.run_for(SECOND / 2);
        }
        let conflicts = told(&world);
        match expected {
            None => assert_eq!(conflicts, Vec::<String>::new(), "{of_gimbal}"),
            Some(text) => assert!(conflicts.len() == 1 && conflicts[0].starts_with(text), "{conflicts:?}"),
        }
    }
    for (_, setpoint) in setpoints(&mut world, places) {
        let (pitch, yaw) = pitch_yaw_deg(setpoint.q);
        assert_near(pitch, -20.0, 0.01);
        assert_near(yaw, 10.0, 0.01);
    }
}

/// D9: "axes it leaves out … are the measured attitude", of this moment: between two reports the vehicle turns, and a
/// gimbal that follows it keeps its angle to the nose, one that is locked its direction, in whichever frame it tells it.
#[test]
fn what_was_measured_before_the_vehicle_turned_is_where_the_gimbal_looks_now() {
    for (flags, yaw, from_nose) in [
        (4 | 8 | 32, 20.0, 20.0),
        (4 | 8 | 64, 30.0, 20.0),
        (4 | 8 | 16 | 32, 20.0, 10.0),
        (4 | 8 | 16 | 64, 30.0, 10.0),
    ] {
        let (mut world, places) = with_gimbal();
        turn_vehicle(&mut world, places, 10.0);
        let status = device_status(world.now, flags, 0.0, yaw);
        let status = GIMBAL_DEVICE_ATTITUDE_STATUS_DATA { delta_yaw: f32::to_radians(10.0), ..status };
        world.send(places.gimbal, GIMBAL, &MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(status));
        world.run_for(SECOND / 5);
        turn_vehicle(&mut world, places, 20.0);

        assert_eq!(world.result_of(places.ground, GCS, &pitchyaw(-20.0, NAN, NAN, NAN, 44.0)), Some(ACCEPTED));

        let (pitch, yaw) = pitch_yaw_deg(only_setpoint(&mut world, places).q);
        assert_near(pitch, -20.0, 0.01);
        assert_near(yaw, from_nose, 0.01);
    }
}

/// "When a client asks earth yaw 90° and the device reports bit 128, 284 has flags 92 and yaw 90°."
/// Protocol checklist 110: "When the device does not accept earth yaw and heading is 30°, the same request gives flags 44
/// and yaw 60°, and follows as the heading changes, updating within 100 ms."
#[test]
fn items_109_and_110_north_is_held_by_the_device_or_by_us() {
    for asked in [16.0, 28.0, 64.0, 92.0] {
        let (mut world, places) = with_gimbal();
        let status = device_status(world.now, 44 | 128, 0.0, 0.0);
        world.send(places.gimbal, GIMBAL, &MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(status));
        assert_eq!(world.result_of(places.ground, GCS, &pitchyaw(0.0, 90.0, NAN, NAN, asked)), Some(ACCEPTED));
        let setpoint = only_setpoint(&mut world, places);
        assert_eq!(setpoint.flags, 92, "asked {asked}");
        assert_near(pitch_yaw_deg(setpoint.q).1, 90.0, 0.001);

        let (mut world, places) = with_gimbal();
        turn_vehicle(&mut world, places, 30.0);
        assert_eq!(world.result_of(places.ground, GCS, &pitchyaw(0.0, 90.0, NAN, NAN, asked)), Some(ACCEPTED));
        let setpoint = only_setpoint(&mut world, places);
        assert_eq!(setpoint.flags, 44, "asked {asked}");
        assert_near(pitch_yaw_deg(setpoint.q).1, 60.0, 0.001);

        turn_vehicle(&mut world, places, 50.0);
        world.run_for(Duration::from_millis(100));
        let followed = setpoints(&mut world, places).pop().expect("it is streamed").1;
        assert_near(pitch_yaw_deg(followed.q).1, 40.0, 0.001);
    }
}

/// Protocol checklist 110 again, and A-06 ("delta_yaw if trusted, else ψ"): a gimbal that tells its own heading, which is
/// 15° more than the autopilot's, four times a second. In between the autopilot tells how the vehicle turns, and the
/// gimbal is kept on its direction all the same.
#[test]
fn item_110_a_gimbal_that_tells_its_heading_seldom_is_turned_back_in_between() {
    let (mut world, places) = with_gimbal();
    let heading_deg = |world: &World| 40.0 * (world.now.as_secs_f64() - 1.0);
    let look = |world: &mut World| {
        let delta_yaw = ((heading_deg(world) + 15.0).to_radians()) as f32;
        let status = device_status(world.now, 44, 0.0, 0.0);
        let status = GIMBAL_DEVICE_ATTITUDE_STATUS_DATA { delta_yaw, ..status };
        world.send(places.gimbal, GIMBAL, &MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(status));
    };
    world.run_for(SECOND - (world.now - gimbald::timestamp::Timestamp::ZERO));
    turn_vehicle(&mut world, places, 0.0);
    look(&mut world);
    assert_eq!(world.result_of(places.ground, GCS, &pitchyaw(0.0, 90.0, NAN, NAN, 92.0)), Some(ACCEPTED));
    world.forget();
    let mut told = 0;
    for step in 1..=100 {
        world.run_for(Duration::from_millis(20));
        let heading = heading_deg(&world);
        turn_vehicle(&mut world, places, heading);
        if step % 13 == 0 {
            look(&mut world);
        }
        for (_, setpoint) in setpoints(&mut world, places) {
            assert_eq!(setpoint.flags, 44);
            // By the heading told last, or by the one 20 ms before it.
            assert_near(pitch_yaw_deg(setpoint.q).1, 90.0 - 15.0 - heading + 0.4, 0.41);
            told += 1;
        }
    }
    assert!(told >= 40, "{told}");
}

/// A-06 once more: the gimbal's heading counts also where the autopilot's is not known, and the autopilot's when it comes
/// turns nothing before the two have been compared.
#[test]
fn item_110_the_heading_of_the_autopilot_alone_moves_no_camera() {
    let (mut world, places) = with_gimbal();
    let look = |world: &mut World| {
        let status = device_status(world.now, 44, 0.0, 0.0);
        let status = GIMBAL_DEVICE_ATTITUDE_STATUS_DATA { delta_yaw: 15_f32.to_radians(), ..status };
        world.send(places.gimbal, GIMBAL, &MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(status));
    };
    let next_yaw_deg = |world: &mut World| {
        world.forget();
        world.run_for(Duration::from_millis(50));
        let told = setpoints(world, places);
        pitch_yaw_deg(told.last().expect("it is streamed").1.q).1
    };
    look(&mut world);
    assert_eq!(world.result_of(places.ground, GCS, &pitchyaw(0.0, 90.0, NAN, NAN, 92.0)), Some(ACCEPTED));
    assert_near(next_yaw_deg(&mut world), 75.0, 0.001);
    turn_vehicle(&mut world, places, 0.0);
    assert_near(next_yaw_deg(&mut world), 75.0, 0.001);
    look(&mut world);
    turn_vehicle(&mut world, places, 10.0);
    assert_near(next_yaw_deg(&mut world), 65.0, 0.001);
}

/// "When heading is unknown or stale (> 1 s) and conversion is needed, 1000 → TEMPORARILY_REJECTED."
#[test]
fn item_111_without_a_heading_north_cannot_be_held() {
    let to_north = pitchyaw(0.0, 90.0, NAN, NAN, 92.0);
    let (mut world, places) = with_gimbal();
    assert_eq!(world.result_of(places.ground, GCS, &to_north), Some(TEMPORARILY_REJECTED), "unknown");
    assert_eq!(setpoints(&mut world, places), []);

    turn_vehicle(&mut world, places, 30.0);
    run_looking(&mut world, places, SECOND, 0.0, 0.0);
    assert_eq!(world.result_of(places.ground, GCS, &to_north), Some(ACCEPTED), "one second old");
    let (mut world, places) = with_gimbal();
    turn_vehicle(&mut world, places, 30.0);
    run_looking(&mut world, places, Duration::from_millis(1_001), 0.0, 0.0);
    assert_eq!(world.result_of(places.ground, GCS, &to_north), Some(TEMPORARILY_REJECTED), "stale");
    assert_eq!(setpoints(&mut world, places), []);
    // From the nose it needs none.
    assert_eq!(world.result_of(places.ground, GCS, &pitchyaw(0.0, 90.0, NAN, NAN, 44.0)), Some(ACCEPTED));
}

/// "When q is pitch −90°, yaw 60° the reported yaw is 60° ± 0.01°, not 26.6°."
#[test]
fn item_112_straight_down_the_yaw_is_still_right() {
    let (mut world, places) = with_gimbal();
    let status = device_status(world.now, 44, 0.0, 0.0);
    let q = [0.612_372_4, 0.353_553_4, -0.612_372_4, 0.353_553_4];
    let status = GIMBAL_DEVICE_ATTITUDE_STATUS_DATA { q, ..status };

    world.send(places.gimbal, GIMBAL, &MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(status));

    let shown = attitude(&world);
    assert_near(shown.yaw_vehicle_deg.expect("known"), 60.0, 0.01);
    assert_near(shown.pitch_deg.expect("known"), -90.0, 0.05);
}

/// The autopilot says that the vehicle looks to `heading_deg`.
pub fn turn_vehicle(world: &mut World, places: Places, heading_deg: f64) {
    world.send(places.autopilot, AUTOPILOT, &px4_heartbeat());
    let state = autopilot_state(world.now, MavId::new(0, 0), heading_deg);
    world.send(places.autopilot, AUTOPILOT, &MavMessage::AUTOPILOT_STATE_FOR_GIMBAL_DEVICE(state));
}

fn attitude(world: &World) -> AttitudeSnapshot {
    world.snapshot().gimbals[0].attitude.clone()
}
