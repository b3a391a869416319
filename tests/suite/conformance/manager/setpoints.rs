//! From demands to what the gimbal is told (protocol checklist 8.6).

use std::time::Duration;

use gimbald::wire::MavId;
use gimbald::wire::dialect::MavMessage;
use gimbald::wire::ids::CapFlags;

use super::{
    NO_ANGLES, SECOND, Setpoint, assert_near, is_nan, look, only_setpoint, run_looking, setpoints, with_gimbal,
    with_gimbal_that,
};
use crate::support::script::{
    ACCEPTED, DENIED, NAN, device_information, gimbal_heartbeat, pitch_yaw_deg, pitchyaw, quaternion, set_attitude,
    set_manual_control, set_pitchyaw, usual_capabilities,
};
use crate::support::wire::hex;
use crate::support::world::{GCS, Places, World, three_links};

/// "When the primary sends 287 pitch −0.5 yaw NaN flags 44 id 0 (GV-9), a 284 to S/154 is sent on the gimbal link now,
/// and only there, with pitch −0.5 and the previous yaw."
#[test]
fn item_80_a_pitch_alone_leaves_the_yaw_as_it_was() {
    let golden = hex("fd16000007ffbe1f01002c000000000000bf0000c07f0000c07f0000c07f01bf2272");
    // Without a setpoint before, the yaw is where the gimbal looks (D9).
    for (asked_before, yaw) in [(None, 25.0), (Some(40.0_f32), 40.0)] {
        let (mut world, places) = with_gimbal();
        look(&mut world, places, -5.0, 25.0);
        if let Some(yaw) = asked_before {
            assert_eq!(world.result_of(places.ground, GCS, &pitchyaw(0.0, yaw, NAN, NAN, 44.0)), Some(ACCEPTED));
        }
        world.forget();

        world.send_bytes(places.ground, &golden);

        let setpoint = only_setpoint(&mut world, places);
        let (pitch, kept) = pitch_yaw_deg(setpoint.q);
        assert_near(pitch, (-0.5_f64).to_degrees(), 0.001);
        assert_near(kept, yaw, 0.001);
        assert_eq!(setpoint.flags, 44);
        assert!(is_nan(&rates(&setpoint)));
    }
}

/// "When command 1000 (−30, 45, NaN, NaN, 44, –, 154) is accepted, the following 284s converge to q for pitch −30°, yaw
/// 45°, roll 0, flags 44, rates NaN."
/// Protocol checklist 82: "When a set-point is active, 284 is streamed at 20 Hz ± 10 %."
#[test]
fn items_81_and_82_a_commanded_angle_is_streamed() {
    let (mut world, places) = with_gimbal();
    assert_eq!(world.result_of(places.ground, GCS, &pitchyaw(-30.0, 45.0, NAN, NAN, 44.0)), Some(ACCEPTED));
    let started = world.now;

    run_looking(&mut world, places, Duration::from_secs(5), -30.0, 45.0);

    let streamed = setpoints(&mut world, places);
    assert_eq!(streamed[0].0, started, "the first at once");
    assert!(streamed.windows(2).all(|pair| pair[1].0 - pair[0].0 == Duration::from_millis(50)));
    assert_eq!(streamed.len(), 101);
    for (_, setpoint) in streamed {
        let angles = quaternion(-30.0, 45.0);
        let same = setpoint.q.iter().zip(angles).all(|(one, other)| (one - other).abs() < 1e-6);
        assert!(same && setpoint.flags == 44 && is_nan(&rates(&setpoint)), "{setpoint:?}");
    }
}

/// "When no set-point was ever accepted, no 284 is sent."
#[test]
fn item_83_nothing_is_sent_before_somebody_asks() {
    let (mut world, places) = with_gimbal();
    run_looking(&mut world, places, Duration::from_secs(20), 10.0, 10.0);
    assert_eq!(setpoints(&mut world, places), []);
}

/// "When any 284 is sent, target is exactly the device's learned (sysid, compid), exactly one of bits 32/64 is set, and
/// LOCK ⇔ EARTH." Whatever flags are asked for.
#[test]
fn item_84_every_setpoint_names_its_frame() {
    for asked in 0..512_u32 {
        let (mut world, places) = with_heading(30.0);
        world.send(places.ground, GCS, &set_pitchyaw(-0.1, 0.2, NAN, NAN, asked));
        world.run_for(SECOND / 10);
        for (_, setpoint) in setpoints(&mut world, places) {
            let frames = setpoint.flags & (32 | 64);
            assert!(frames == 32 || frames == 64, "{asked} became {}", setpoint.flags);
            assert_eq!(setpoint.flags & 16 != 0, frames == 64, "{asked} became {}", setpoint.flags);
        }
    }
}

/// "When 282 has q all NaN and ω_y = 0.25, the 284 has q NaN×4, ω_y 0.25, ω_z 0 (compare GV-6)."
#[test]
fn item_85_a_rate_alone_turns_the_gimbal() {
    let (mut world, places) = with_gimbal();

    world.send(places.ground, GCS, &set_attitude([NAN; 4], [NAN, 0.25, NAN], 44));

    let setpoint = only_setpoint(&mut world, places);
    assert!(is_nan(&setpoint.q) && setpoint.angular_velocity_x.is_nan());
    assert_eq!((setpoint.angular_velocity_y, setpoint.angular_velocity_z, setpoint.flags), (0.25, 0.0, 44));
}

/// "When a rate stream by 287 stops, zero rates are sent 2.0 ± 0.2 s after the last message, then angle hold."
#[test]
fn item_86_a_rate_that_is_not_refreshed_stops() {
    let (mut world, places) = with_gimbal();
    for _ in 0..5 {
        world.send(places.ground, GCS, &set_pitchyaw(NAN, NAN, 0.1, -0.2, 44));
        run_looking(&mut world, places, SECOND / 5, -10.0, 20.0);
    }
    world.send(places.ground, GCS, &set_pitchyaw(NAN, NAN, 0.1, -0.2, 44));
    let last = world.now;
    world.forget();

    run_looking(&mut world, places, Duration::from_secs(4), -15.0, 25.0);

    let streamed = setpoints(&mut world, places);
    let turning = streamed.iter().take_while(|(_, setpoint)| rates(setpoint)[1..] == [0.1, -0.2]).count();
    let (stopped_at, stopped) = &streamed[turning];
    let after = *stopped_at - last;
    assert!(after >= Duration::from_millis(1_800) && after <= Duration::from_millis(2_200), "{after:?}");
    assert_eq!(rates(stopped)[1..], [0.0, 0.0]);
    let held = streamed[turning..].iter().skip_while(|(_, setpoint)| is_nan(&setpoint.q));
    let held: Vec<_> = held.collect();
    assert!(held.len() > 20, "then the attitude is held");
    for (_, setpoint) in held {
        let (pitch, yaw) = pitch_yaw_deg(setpoint.q);
        assert_near(pitch, -15.0, 0.01);
        assert_near(yaw, 25.0, 0.01);
        assert!(is_nan(&rates(setpoint)));
    }
}

/// "When 1000 with angle 20° and rate 5 deg/s is accepted from 0°, the set-point reaches 20° after 4 ± 0.3 s."
/// Protocol checklist 88: "When 1000 has angle 20° and rate 0, the set-point still goes to 20°."
#[test]
fn items_87_and_88_an_angle_with_a_rate_is_approached_at_that_rate() {
    for (rate, seconds) in [(5.0, 4.0), (-5.0, 4.0), (0.0, 0.0), (NAN, 0.0)] {
        let (mut world, places) = with_gimbal();
        let command = pitchyaw(20.0, 0.0, rate, NAN, 44.0);
        assert_eq!(world.result_of(places.ground, GCS, &command), Some(ACCEPTED));
        let started = world.now;

        run_looking(&mut world, places, Duration::from_secs(6), 0.0, 0.0);

        let streamed = setpoints(&mut world, places);
        let pitches: Vec<f64> = streamed.iter().map(|(_, setpoint)| pitch_yaw_deg(setpoint.q).0).collect();
        let reached = pitches.iter().position(|pitch| (pitch - 20.0).abs() < 0.01).expect("it gets there");
        assert_near((streamed[reached].0 - started).as_secs_f64(), seconds, 0.3);
        let steps = pitches.windows(2).map(|pair| pair[1] - pair[0]);
        assert!(steps.clone().all(|step| (-1e-3..=0.251).contains(&step)), "it never jumps: {pitches:?}");
        let first = if seconds == 0.0 { 20.0 } else { 0.0 };
        assert_near(pitches[0], first, 0.01);
    }
}

/// "When 1000 has pitch 45, yaw NaN, the yaw set-point keeps its former value, not 0."
#[test]
fn item_89_an_axis_without_a_demand_keeps_its_setpoint() {
    let (mut world, places) = with_gimbal();
    assert_eq!(world.result_of(places.ground, GCS, &pitchyaw(0.0, 70.0, NAN, NAN, 44.0)), Some(ACCEPTED));
    world.forget();

    assert_eq!(world.result_of(places.ground, GCS, &pitchyaw(15.0, NAN, NAN, NAN, 44.0)), Some(ACCEPTED));

    let (pitch, yaw) = pitch_yaw_deg(only_setpoint(&mut world, places).q);
    assert_near(pitch, 15.0, 0.001);
    assert_near(yaw, 70.0, 0.001);
}

/// "When 1000 has all NaN and flags 2 (NEUTRAL) and HAS_NEUTRAL, 284 with bit 2 is sent; without HAS_NEUTRAL a 0/0 angle
/// set-point is emulated."
#[test]
fn item_90_neutral_is_the_devices_own_or_straight_ahead() {
    for has_neutral in [true, false] {
        let mut capabilities = usual_capabilities();
        capabilities.set(CapFlags::HAS_NEUTRAL, has_neutral);
        let (mut world, places) = with_gimbal_that(capabilities, three_links());
        look(&mut world, places, -50.0, 50.0);

        assert_eq!(world.result_of(places.ground, GCS, &pitchyaw(NAN, NAN, NAN, NAN, 2.0)), Some(ACCEPTED));

        let setpoint = only_setpoint(&mut world, places);
        if has_neutral {
            assert!(setpoint.flags == 2 | 44 && is_nan(&setpoint.q), "{setpoint:?}");
        } else {
            assert_eq!((setpoint.flags, setpoint.q), (44, [1.0, 0.0, 0.0, 0.0]));
        }
    }
}

/// "When flags has RETRACT and caps lack HAS_RETRACT, ACK is DENIED and no 284 changes."
/// Protocol checklist 92: "When flags has RETRACT and NEUTRAL, only RETRACT is acted on."
#[test]
fn items_91_and_92_retract_needs_a_gimbal_that_can() {
    for (has_retract, result) in [(true, ACCEPTED), (false, DENIED)] {
        let mut capabilities = usual_capabilities();
        capabilities.set(CapFlags::HAS_RETRACT, has_retract);
        for flags in [1.0, 3.0] {
            let (mut world, places) = with_gimbal_that(capabilities, three_links());
            assert_eq!(world.result_of(places.ground, GCS, &pitchyaw(NAN, NAN, NAN, NAN, flags)), Some(result));
            if has_retract {
                let setpoint = only_setpoint(&mut world, places);
                assert_eq!(setpoint.flags & 3, 1, "RETRACT, and not NEUTRAL");
            } else {
                assert_eq!(setpoints(&mut world, places), []);
                assert_eq!(world.snapshot().gimbals[0].setpoint, None);
            }
        }
    }
}

/// "When flags has both 32 and 64, command → DENIED, message → dropped."
/// Protocol checklist 96: "When flags bit 256 is set and HAS_RC_INPUTS is missing, command → DENIED."
#[test]
fn items_93_and_96_flags_that_cannot_be_met_are_refused() {
    for (flags, reason) in [(96, "both_yaw_frames"), (44 | 64, "both_yaw_frames"), (44 | 256, "no_rc_inputs")] {
        let (mut world, places) = with_gimbal();
        let flags_param = flags as f32;
        assert_eq!(world.result_of(places.ground, GCS, &pitchyaw(-5.0, 0.0, NAN, NAN, flags_param)), Some(DENIED));
        for message in [set_pitchyaw(-0.1, 0.0, NAN, NAN, flags), set_attitude(quaternion(-5.0, 0.0), [NAN; 3], flags)]
        {
            assert_eq!(world.ask(places.ground, GCS, &message), []);
        }
        assert_eq!(setpoints(&mut world, places), [], "{flags}");
        assert_eq!(world.snapshot().gimbals[0].rejected["255/190"][reason], 3);
    }
}

/// "When flags = 0 arrives and the device lacks *_FOLLOW for roll/pitch, the 284 has bits 4 and 8 set."
/// Protocol checklist 95: "When flags bit 128 is set by a client, it is not propagated in 284."
#[test]
#[rustfmt::skip]
fn items_94_and_95_the_flags_of_a_setpoint_are_what_the_gimbal_can_do() {
    let follows = usual_capabilities() | CapFlags::HAS_ROLL_FOLLOW | CapFlags::HAS_PITCH_FOLLOW;
    for (capabilities,         asked, told) in [
        (usual_capabilities(), 0,         44),
        (usual_capabilities(), 44,        44),
        (usual_capabilities(), 12 | 128,  44),
        (usual_capabilities(), 44 | 128,  44),
        (follows,              0,         32),
        (follows,              4,         36),
        (follows,              8 | 128,   40),
    ] {
        let (mut world, places) = with_gimbal_that(capabilities, three_links());
        world.send(places.ground, GCS, &set_pitchyaw(-0.1, 0.0, NAN, NAN, asked));
        assert_eq!(only_setpoint(&mut world, places).flags, told, "asked {asked}");
    }
}

/// "When q contains Inf, a mix of NaN and numbers, all zeros, or norm² outside 0.9..1.1, the message is dropped and
/// counted."
#[test]
fn item_97_a_quaternion_that_is_none_is_dropped() {
    let (mut world, places) = with_gimbal();
    let malformed = [
        [f32::INFINITY, 0.0, 0.0, 0.0],
        [1.0, 0.0, f32::NEG_INFINITY, 0.0],
        [NAN, 0.0, 0.0, 1.0],
        [NAN, NAN, NAN, 0.0],
        [0.0; 4],
        [0.94, 0.0, 0.0, 0.0],
        [0.0, 0.0, 0.0, 1.06],
    ];
    for q in malformed {
        assert_eq!(world.ask(places.ground, GCS, &set_attitude(q, [NAN; 3], 44)), [], "{q:?}");
        assert_eq!(setpoints(&mut world, places), [], "{q:?}");
    }
    let rejected = &world.snapshot().gimbals[0].rejected;
    assert_eq!(rejected["255/190"]["malformed_quaternion"], malformed.len() as u64);
    for q in [[0.96, 0.0, 0.0, 0.0], [-1.0, 0.0, 0.0, 0.0], [1.04, 0.0, 0.0, 0.0]] {
        world.forget();
        world.send(places.ground, GCS, &set_attitude(q, [NAN; 3], 44));
        assert_eq!(only_setpoint(&mut world, places).q, [1.0, 0.0, 0.0, 0.0], "{q:?}");
    }
}

/// "When the requested pitch is beyond the device limit, the 284 is clamped to the limit and the command is ACCEPTED."
/// Protocol checklist 99: "When |pitch| > 180 or |yaw| > 360 in 1000, ACK is DENIED; yaw 270 is treated as −90."
#[test]
#[rustfmt::skip]
fn items_98_and_99_angles_beyond_reach_are_clamped_and_impossible_ones_refused() {
    // The device's limits are −1.5…0.5 rad in pitch and ±2 rad in yaw.
    let (top, bottom, side) = (0.5_f64.to_degrees(), (-1.5_f64).to_degrees(), 2.0_f64.to_degrees());
    for (pitch, yaw,   expected) in [
        (80.0,   0.0,    Some((top, 0.0))),
        (-100.0, 0.0,    Some((bottom, 0.0))),
        (0.0,    150.0,  Some((0.0, side))),
        (0.0,    -150.0, Some((0.0, -side))),
        (0.0,    270.0,  Some((0.0, -90.0))),
        (0.0,    -270.0, Some((0.0, 90.0))),
        (0.0,    360.0,  Some((0.0, 0.0))),
        (180.5,  0.0,    None),
        (-181.0, 0.0,    None),
        (0.0,    361.0,  None),
        (0.0,    -361.0, None),
        (f32::INFINITY, 0.0, None),
    ] {
        let (mut world, places) = with_gimbal();
        let result = world.result_of(places.ground, GCS, &pitchyaw(pitch, yaw, NAN, NAN, 44.0));
        assert_eq!(result, Some(if expected.is_some() { ACCEPTED } else { DENIED }), "{pitch}, {yaw}");
        let told: Vec<(f64, f64)> =
            setpoints(&mut world, places).iter().map(|(_, setpoint)| pitch_yaw_deg(setpoint.q)).collect();
        assert_eq!(told.len(), usize::from(expected.is_some()));
        if let (Some((pitch, yaw)), Some((wanted_pitch, wanted_yaw))) = (told.first(), expected) {
            assert_near(*pitch, wanted_pitch, 0.001);
            assert_near(*yaw, wanted_yaw, 0.001);
        }
    }
}

/// "When 288 has pitch_rate 0.5 and `manual_rate_pitch` is 30 deg/s, 284 has ω_y = 0.2618 rad/s."
/// Protocol checklist 101: "When 288 has yaw −2.0, it is clamped to −1."
#[test]
fn items_100_and_101_manual_control_is_scaled_to_the_gimbal() {
    let (mut world, places) = with_gimbal();
    world.send(places.ground, GCS, &set_manual_control(NAN, NAN, 0.5, NAN));
    let setpoint = only_setpoint(&mut world, places);
    assert_near(setpoint.angular_velocity_y.into(), 0.2618, 1e-4);
    assert!(is_nan(&setpoint.q));
    let [none, _] = NO_ANGLES;
    for (stick, reach) in [(-2.0, -2.0_f64), (-1.0, -2.0), (0.5, 1.0), (7.0, 2.0)] {
        world.forget();
        world.send(places.ground, GCS, &set_manual_control(0.0, stick, none, none));
        assert_near(pitch_yaw_deg(only_setpoint(&mut world, places).q).1, reach.to_degrees(), 0.001);
    }
}

/// "When set-points for id 154 arrive, device 171 is not moved."
#[test]
fn item_102_only_the_gimbal_that_is_meant_moves() {
    let (mut world, places) = with_gimbal();
    let second = MavId::new(1, 171);
    world.send(places.gimbal, second, &gimbal_heartbeat());
    let information = device_information(world.now, usual_capabilities());
    world.send(places.gimbal, second, &MavMessage::GIMBAL_DEVICE_INFORMATION(information));
    for (place, gimbal) in [(191, 154), (0, 154)] {
        world.forget();
        let mut message = set_pitchyaw(-0.3, 0.0, NAN, NAN, 44);
        if let MavMessage::GIMBAL_MANAGER_SET_PITCHYAW(message) = &mut message {
            message.target_component = place;
            message.gimbal_device_id = gimbal;
        }
        world.send(places.ground, GCS, &message);
        assert_eq!(setpoints(&mut world, places).len(), 1, "each is for 154");
    }
}

/// A gimbal that does not take yaw from North, on a vehicle that looks to `heading_deg`.
fn with_heading(heading_deg: f64) -> (World, Places) {
    let (mut world, places) = with_gimbal();
    super::frames::turn_vehicle(&mut world, places, heading_deg);
    world.forget();
    (world, places)
}

fn rates(setpoint: &Setpoint) -> [f32; 3] {
    [setpoint.angular_velocity_x, setpoint.angular_velocity_y, setpoint.angular_velocity_z]
}
