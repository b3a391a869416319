//! Angles as real clients send them (client checklist E4).

use gimbald::wire::MavId;
use gimbald::wire::dialect::{GIMBAL_DEVICE_ATTITUDE_STATUS_DATA, MavMessage};
use gimbald::wire::ids::CapFlags;

use super::frames::turn_vehicle;
use super::{SECOND, assert_near, is_nan, look, only_setpoint, run_looking, setpoints, with_gimbal, with_gimbal_that};
use crate::support::script::{
    ACCEPTED, DENIED, NAN, command_int, command_long, device_information, device_status, gimbal_heartbeat,
    pitch_yaw_deg, pitchyaw, set_attitude, set_pitchyaw, usual_capabilities,
};
use crate::support::world::{GCS, GIMBAL, MANAGER, Places, World, three_links};

/// What each form of an angle means on a vehicle that heads to 30°, on a gimbal that takes its yaw from the nose: pitch and
/// yaw that it is told.
///
/// Client checklist E75: "1000: −90, 0, NaN, NaN, 44, 0, 1: pitch −90, vehicle yaw 0."
/// Client checklist E77: "1000 with flags 28 (no frame bit): yaw from north. With 12: from the vehicle. With 0 (MAVProxy,
/// MissionPlanner): from the vehicle. With 16: from north."
/// Client checklist E78: "1000 with p5 NaN: handled as flags 0 or as 'keep', documented; ACCEPTED." It is flags 0.
/// Client checklist E79: "1000: −30, 10, 0, 0, 12, 0, 1: moves to the angle at full speed; zero is not a limit of zero."
/// Client checklist E84: "Yaw 190 and −170 mean the same in the earth frame."
/// Client checklist E87: "p6 = 0 and p6 = NaN make no difference."
/// Client checklist E90: "282 with q of pitch −10, yaw 10, ω NaN, flags 12: moves. With flags 28: yaw from north."
/// Client checklist E93: "287 in radians with NaN rates moves; flags 8|16|64 as earth frame."
/// Client checklist E94: "287 with zero rates and finite angles: as number 79."
#[test]
#[rustfmt::skip]
fn client_items_e75_e77_to_e79_e84_e87_e90_e93_and_e94_angles_in_every_form() {
    let by_1000 = |pitch, yaw, rate, flags| pitchyaw(pitch, yaw, rate, rate, flags);
    let by_282 = |pitch, yaw, flags| set_attitude(crate::support::script::quaternion(pitch, yaw), [NAN; 3], flags);
    let by_287 = |pitch: f32, yaw: f32, rate, flags| {
        set_pitchyaw(pitch.to_radians(), yaw.to_radians(), rate, rate, flags)
    };
    for (message,                               pitch,  yaw) in [
        (by_1000(-90.0, 0.0, NAN, 44.0),        -90.0,  0.0),
        (by_1000(-20.0, 170.0, NAN, 92.0),      -20.0,  140.0),
        (by_1000(-20.0, 45.0, NAN, 28.0),       -20.0,  15.0),
        (by_1000(-20.0, 45.0, NAN, 16.0),       -20.0,  15.0),
        (by_1000(-20.0, 45.0, NAN, 64.0),       -20.0,  15.0),
        (by_1000(-20.0, 45.0, NAN, 12.0),       -20.0,  45.0),
        (by_1000(-20.0, 45.0, NAN, 0.0),        -20.0,  45.0),
        (by_1000(-20.0, 45.0, NAN, NAN),        -20.0,  45.0),
        (by_1000(-20.0, 45.0, NAN, 60.0),       -20.0,  45.0),
        (by_1000(-30.0, 10.0, 0.0, 12.0),       -30.0,  10.0),
        (by_1000(-20.0, 190.0, NAN, 28.0),      -20.0,  160.0),
        (by_1000(-20.0, -170.0, NAN, 28.0),     -20.0,  160.0),
        (by_1000(-20.0, 45.0, NAN, 4_294_901_772.0), -20.0, 45.0),
        (command_long(MANAGER, 1000, &[-20.0, 45.0, NAN, NAN, 44.0, NAN, 154.0]), -20.0, 45.0),
        (command_long(MANAGER, 1000, &[-20.0, 45.0, NAN, NAN, 44.0, 0.0, 0.0]), -20.0, 45.0),
        (command_long(MANAGER, 1000, &[-20.0, 45.0, NAN, NAN, 44.0, 7.0, NAN]), -20.0, 45.0),
        (command_int(MANAGER, 1000, [-20.0, 45.0, NAN, NAN], 28, 0, 154.0), -20.0, 15.0),
        (command_int(MANAGER, 1000, [-20.0, 45.0, 0.0, 0.0], 12, 0, NAN), -20.0, 45.0),
        (command_int(MANAGER, 1000, [-20.0, 45.0, NAN, NAN], i32::MAX, 5, 0.0), -20.0, 45.0),
        (by_282(-10.0, 10.0, 12),               -10.0,  10.0),
        (by_282(-10.0, 10.0, 28),               -10.0,  -20.0),
        (by_282(-10.0, 10.0, 0xffff_0000 | 44), -10.0,  10.0),
        (by_287(-10.0, 10.0, NAN, 12),          -10.0,  10.0),
        (by_287(-10.0, 10.0, NAN, 8 | 16 | 64), -10.0,  -20.0),
        (by_287(-10.0, 10.0, 0.0, 12),          -10.0,  10.0),
    ] {
        let (mut world, places) = free_gimbal();
        turn_vehicle(&mut world, places, 30.0);
        world.forget();
        world.send(places.ground, GCS, &message);
        let setpoint = only_setpoint(&mut world, places);
        assert_eq!(setpoint.flags, 44, "{message:?}");
        let seen = pitch_yaw_deg(setpoint.q);
        assert_near(seen.0, pitch, 0.001);
        assert_near((seen.1 - yaw + 540.0).rem_euclid(360.0) - 180.0, 0.0, 0.001);
        assert!(is_nan(&[setpoint.angular_velocity_y, setpoint.angular_velocity_z]));
    }
}

/// Client checklist E76: "1000: −20, 170, NaN, NaN, 92, 0, 1 with heading 90: earth yaw 170 (vehicle yaw 80) as far as limits
/// allow." Client checklist E83: "1000 beyond limits: clamped and ACCEPTED; never wrapped to the other side."
#[test]
#[rustfmt::skip]
fn client_items_e76_and_e83_an_angle_out_of_reach_is_approached() {
    let (top, bottom, side) = (0.5_f64.to_degrees(), (-1.5_f64).to_degrees(), 2.0_f64.to_degrees());
    for (heading, pitch,  yaw,    flags, expected) in [
        (90.0,    -20.0,  170.0,  92.0,  (-20.0, 80.0)),
        (0.0,     -20.0,  170.0,  92.0,  (-20.0, side)),
        (-60.0,   -20.0,  100.0,  92.0,  (-20.0, side)),
        (0.0,     -20.0,  116.0,  44.0,  (-20.0, side)),
        (0.0,     -20.0,  -179.0, 44.0,  (-20.0, -side)),
        (0.0,     -20.0,  179.0,  44.0,  (-20.0, side)),
        (0.0,     90.0,   0.0,    44.0,  (top, 0.0)),
        (0.0,     -90.0,  0.0,    44.0,  (bottom, 0.0)),
        (0.0,     -180.0, 0.0,    44.0,  (bottom, 0.0)),
        (0.0,     179.0,  0.0,    44.0,  (top, 0.0)),
    ] {
        let (mut world, places) = with_gimbal();
        turn_vehicle(&mut world, places, heading);
        look(&mut world, places, 0.0, 0.0);
        assert_eq!(world.result_of(places.ground, GCS, &pitchyaw(pitch, yaw, NAN, NAN, flags)), Some(ACCEPTED));
        let seen = pitch_yaw_deg(only_setpoint(&mut world, places).q);
        assert_near(seen.0, expected.0, 0.001);
        assert_near(seen.1, expected.1, 0.001);
    }
}

/// Client checklist E80: "1000: all NaN with 16, then with 0: lock state changes, gimbal stays where it is." A-12: "lock change
/// re-expresses the present direction in the new frame without moving", also from an angle that is out of reach, and from a
/// gimbal that nobody has told anything.
#[test]
fn client_item_e80_a_change_of_lock_moves_nothing() {
    for (before, yaw) in [
        (Some(pitchyaw(-20.0, 40.0, NAN, NAN, 44.0)), 40.0),
        (Some(pitchyaw(-20.0, 70.0, NAN, NAN, 92.0)), 40.0),
        (Some(pitchyaw(-20.0, 150.0, NAN, NAN, 44.0)), 2.0_f64.to_degrees()),
        (None, 25.0),
    ] {
        let (mut world, places) = with_gimbal();
        turn_vehicle(&mut world, places, 30.0);
        look(&mut world, places, -20.0, 25.0);
        if let Some(before) = &before {
            assert_eq!(world.result_of(places.ground, GCS, before), Some(ACCEPTED));
        }
        world.forget();
        // Lock, then the vehicle turns to the right and the camera stays; unlock, and it turns with it.
        let toggle = |flags| pitchyaw(NAN, NAN, NAN, NAN, flags);
        assert_eq!(world.result_of(places.ground, GCS, &toggle(16.0)), Some(ACCEPTED));
        assert_eq!(looks(&mut world, places), (-20.0, round(yaw)), "locked");
        turn_vehicle(&mut world, places, 50.0);
        run_looking(&mut world, places, SECOND / 10, -20.0, 25.0);
        assert_eq!(looks(&mut world, places), (-20.0, round(yaw - 20.0)), "held to North");
        assert_eq!(world.result_of(places.ground, GCS, &toggle(0.0)), Some(ACCEPTED));
        assert_eq!(looks(&mut world, places), (-20.0, round(yaw - 20.0)), "unlocked");
        turn_vehicle(&mut world, places, 80.0);
        run_looking(&mut world, places, SECOND / 10, -20.0, 25.0);
        assert_eq!(looks(&mut world, places), (-20.0, round(yaw - 20.0)), "follows the nose");
    }
}

/// A-12 once more: unlocked behind the end stop, the camera keeps the direction in which it looks, not the one it was told to.
#[test]
fn client_item_e80_what_is_kept_is_what_the_picture_shows() {
    let side = 2.0_f64.to_degrees();
    let (mut world, places) = with_gimbal();
    turn_vehicle(&mut world, places, 30.0);
    look(&mut world, places, -20.0, 100.0);
    for (command, yaw) in [
        (pitchyaw(-20.0, 179.0, NAN, NAN, 92.0), side),
        (pitchyaw(NAN, NAN, NAN, NAN, 0.0), side),
        (pitchyaw(NAN, NAN, NAN, NAN, 16.0), side),
    ] {
        assert_eq!(world.result_of(places.ground, GCS, &command), Some(ACCEPTED));
        assert_eq!(looks(&mut world, places), (-20.0, round(yaw)), "{command:?}");
    }
    turn_vehicle(&mut world, places, 50.0);
    run_looking(&mut world, places, SECOND / 10, -20.0, side);
    assert_eq!(looks(&mut world, places), (-20.0, round(side - 20.0)));
}

/// An axis left out stays where it is although the vehicle has turned since the gimbal told it: over ground where the gimbal is
/// locked, from the nose otherwise, in whichever frame it tells its yaw.
#[test]
#[rustfmt::skip]
fn an_axis_left_out_stays_where_it_is_while_the_vehicle_turns() {
    // The gimbal looks 25° to the right of the nose when the heading is 30°; then the vehicle turns to 40°.
    for (status_flags, told,  asked, yaw) in [
        (44,           25.0,  44.0,  25.0),
        (44,           25.0,  92.0,  25.0),
        (76,           55.0,  44.0,  25.0),
        (76,           55.0,  92.0,  25.0),
        (92,           55.0,  44.0,  15.0),
        (92,           55.0,  92.0,  15.0),
        (60,           25.0,  44.0,  15.0),
    ] {
        let (mut world, places) = with_gimbal();
        turn_vehicle(&mut world, places, 30.0);
        let status = GIMBAL_DEVICE_ATTITUDE_STATUS_DATA {
            delta_yaw: 30.0_f32.to_radians(),
            ..device_status(world.now, status_flags, -5.0, told)
        };
        world.send(places.gimbal, GIMBAL, &MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(status));
        world.run_for(SECOND / 10);
        turn_vehicle(&mut world, places, 40.0);
        world.forget();

        let pitch_alone = pitchyaw(-30.0, NAN, NAN, NAN, asked);
        assert_eq!(world.result_of(places.ground, GCS, &pitch_alone), Some(ACCEPTED));

        let seen = pitch_yaw_deg(only_setpoint(&mut world, places).q);
        assert_near(seen.0, -30.0, 0.001);
        assert_near(seen.1, yaw, 0.001);
    }
}

/// Client checklist E81: "1000 with flags 1 retracts; with flags 0 and angles goes back to work; flags 2 goes to neutral, angles
/// ignored." Client checklist E82: "1000 with one axis NaN leaves this axis alone."
#[test]
fn client_items_e81_and_e82_retract_neutral_and_an_axis_left_out() {
    let (mut world, places) = with_gimbal();
    look(&mut world, places, -5.0, 15.0);
    for (command, flags, angles) in [
        (pitchyaw(-20.0, 30.0, NAN, NAN, 1.0), 1 | 44, None),
        (pitchyaw(-20.0, 30.0, NAN, NAN, 0.0), 44, Some((-20.0, 30.0))),
        (pitchyaw(-20.0, 30.0, NAN, NAN, 2.0), 2 | 44, None),
        (pitchyaw(NAN, -30.0, NAN, NAN, 44.0), 44, Some((-5.0, -30.0))),
        (pitchyaw(-60.0, NAN, NAN, NAN, 44.0), 44, Some((-60.0, -30.0))),
        (pitchyaw(NAN, NAN, NAN, NAN, 44.0), 44, Some((-60.0, -30.0))),
    ] {
        assert_eq!(world.result_of(places.ground, GCS, &command), Some(ACCEPTED));
        let setpoint = only_setpoint(&mut world, places);
        assert_eq!(setpoint.flags, flags, "{command:?}");
        match angles {
            None => assert!(is_nan(&setpoint.q)),
            Some((pitch, yaw)) => {
                let seen = pitch_yaw_deg(setpoint.q);
                assert_near(seen.0, pitch, 0.001);
                assert_near(seen.1, yaw, 0.001);
            }
        }
    }
}

/// Client checklist E85: "Flags 32+64 together: DENIED". What no flags are is DENIED too; what stands above the flags that the
/// definitions have is ignored.
#[test]
fn client_item_e85_flags_that_are_none_are_denied() {
    let nan_as_integer = 0x7ff8_0000;
    let (mut world, places) = with_gimbal();
    for command in [
        pitchyaw(-5.0, 0.0, NAN, NAN, 96.0),
        pitchyaw(-5.0, 0.0, NAN, NAN, -1.0),
        pitchyaw(-5.0, 0.0, NAN, NAN, 44.5),
        pitchyaw(-5.0, 0.0, NAN, NAN, 1e20),
        pitchyaw(-5.0, 0.0, NAN, NAN, f32::INFINITY),
        command_int(MANAGER, 1000, [-5.0, 0.0, NAN, NAN], 96, 0, 154.0),
        command_int(MANAGER, 1000, [-5.0, 0.0, NAN, NAN], -1, 0, 154.0),
        command_int(MANAGER, 1000, [-5.0, 0.0, NAN, NAN], i32::MIN, 0, 154.0),
        command_int(MANAGER, 1000, [-5.0, 0.0, NAN, NAN], nan_as_integer, nan_as_integer, 154.0),
        command_int(MANAGER, 1000, [f32::INFINITY, 0.0, NAN, NAN], 44, 0, 154.0),
    ] {
        assert_eq!(world.result_of(places.ground, GCS, &command), Some(DENIED), "{command:?}");
        assert_eq!(setpoints(&mut world, places), []);
    }
    let high_bits = command_int(MANAGER, 1000, [-5.0, 0.0, NAN, NAN], 0x7fff_0000 | 44, 0, 154.0);
    assert_eq!(world.result_of(places.ground, GCS, &high_bits), Some(ACCEPTED));
    assert_eq!(only_setpoint(&mut world, places).flags, 44);
}

/// Client checklist E88: "1000 ten times a second for 10 s: 100 ACKs, each < 100 ms after its command." And as many setpoints.
#[test]
fn client_item_e88_a_dragged_camera_has_an_answer_for_each_step() {
    let (mut world, places) = with_gimbal();
    for step in 0..100 {
        look(&mut world, places, 0.0, 0.0);
        let command = pitchyaw(-(step as f32) / 2.0, 0.0, NAN, NAN, 44.0);
        assert_eq!(world.result_of(places.ground, GCS, &command), Some(ACCEPTED), "in the same moment");
        assert_near(pitch_yaw_deg(only_setpoint(&mut world, places).q).0, -f64::from(step) / 2.0, 0.001);
        world.run_for(SECOND / 10);
    }
}

/// Client checklist E91: "282 with roll 10 in q: roll followed if there is a roll axis, else ignored while pitch and yaw are
/// followed." A-55: "287/1000 imply roll 0". Client checklist E92: "282 with unnormalised q (norm 0.9–1.1): normalised."
#[test]
fn client_items_e91_and_e92_roll_is_for_gimbals_that_have_it() {
    use gimbald::geometry::{Angle, Attitude, GimbalAngles, VehicleFrame};
    let degrees = Angle::from_degrees;
    let angles = GimbalAngles { roll: degrees(10.0), pitch: degrees(-20.0), yaw: degrees(30.0) };
    let rolled = Attitude::<VehicleFrame>::from_gimbal_angles(angles).to_wxyz();
    for (has_roll, roll) in [(true, 10.0), (false, 0.0)] {
        let mut capabilities = usual_capabilities();
        capabilities.set(CapFlags::HAS_ROLL_AXIS, has_roll);
        for scale in [1.0_f32, 0.96, 1.04] {
            let (mut world, places) = with_gimbal_that(capabilities, three_links());
            world.send(places.ground, GCS, &set_attitude(rolled.map(|element| element * scale), [NAN; 3], 44));
            let told = only_setpoint(&mut world, places).q;
            assert_near(told.iter().map(|element| f64::from(element * element)).sum(), 1.0, 1e-6);
            let told: Attitude<VehicleFrame> = Attitude::from_wxyz(told).expect("well formed").expect("a number");
            let told = told.gimbal_angles();
            assert_near(told.roll.degrees(), roll, 0.001);
            assert_near(told.pitch.degrees(), -20.0, 0.001);
            assert_near(told.yaw.degrees(), 30.0, 0.001);
            world.send(places.ground, GCS, &set_pitchyaw(-0.2, NAN, NAN, NAN, 44));
            let level = setpoints(&mut world, places).pop().expect("it is told").1.q.map(f64::from);
            assert_near((2.0 * (level[2] * level[3] + level[0] * level[1])).asin(), 0.0, 1e-6);
        }
    }
}

/// Client checklist E95: "282/287 with device id 0: to all gimbals of M; with an unknown id: ignored." It is counted for who
/// addressed exactly us.
#[test]
fn client_item_e95_a_message_is_for_the_gimbal_that_it_names() {
    let (mut world, places) = with_gimbal();
    let second = MavId::new(1, 171);
    world.send(places.gimbal, second, &gimbal_heartbeat());
    let information = device_information(world.now, usual_capabilities());
    world.send(places.gimbal, second, &MavMessage::GIMBAL_DEVICE_INFORMATION(information));
    for (component, id, told) in [
        (191, 0, vec![191]),
        (191, 154, vec![191]),
        (191, 171, vec![]),
        (191, 1, vec![]),
        (0, 0, vec![191, 192]),
        (0, 171, vec![192]),
        (0, 99, vec![]),
        (192, 0, vec![192]),
    ] {
        for message in [set_pitchyaw(-0.3, 0.0, NAN, NAN, 44), set_attitude([NAN; 4], [NAN, 0.1, 0.0], 44)] {
            let message = match message {
                MavMessage::GIMBAL_MANAGER_SET_PITCHYAW(mut message) => {
                    (message.target_component, message.gimbal_device_id) = (component, id);
                    MavMessage::GIMBAL_MANAGER_SET_PITCHYAW(message)
                }
                MavMessage::GIMBAL_MANAGER_SET_ATTITUDE(mut message) => {
                    (message.target_component, message.gimbal_device_id) = (component, id);
                    MavMessage::GIMBAL_MANAGER_SET_ATTITUDE(message)
                }
                other => other,
            };
            for device in [GIMBAL, second] {
                let status = device_status(world.now, 44, 0.0, 0.0);
                world.send(places.gimbal, device, &MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(status));
            }
            world.forget();
            world.send(places.ground, GCS, &message);
            let heard = world.take(places.gimbal).into_iter().filter(|arrival| arrival.id() == 284);
            let from: Vec<u8> = heard.map(|arrival| arrival.source().component).collect();
            assert_eq!(from, told, "to {component} for {id}");
        }
    }
    let rejected: Vec<_> = world.snapshot().gimbals.iter().map(|gimbal| gimbal.rejected.clone()).collect();
    assert_eq!(rejected[0]["255/190"]["unknown_gimbal"], 4);
    assert!(rejected[1].is_empty());
}

/// A gimbal without end stops.
fn free_gimbal() -> (World, Places) {
    let capabilities = usual_capabilities() | CapFlags::SUPPORTS_INFINITE_YAW;
    let (mut world, places) = with_gimbal_that(capabilities, three_links());
    let mut information = device_information(world.now, capabilities);
    (information.pitch_min, information.pitch_max) = (NAN, NAN);
    world.send(places.gimbal, GIMBAL, &MavMessage::GIMBAL_DEVICE_INFORMATION(information));
    look(&mut world, places, 0.0, 0.0);
    world.forget();
    (world, places)
}

/// Pitch and yaw of the latest setpoint, rounded.
fn looks(world: &mut World, places: Places) -> (f64, f64) {
    let (_, setpoint) = setpoints(world, places).pop().expect("it is told");
    assert_eq!(setpoint.flags, 44);
    let (pitch, yaw) = pitch_yaw_deg(setpoint.q);
    (round(pitch), round(yaw))
}

fn round(degrees: f64) -> f64 {
    (degrees * 100.0).round() / 100.0
}
