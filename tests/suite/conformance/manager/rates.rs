//! Rotations, and what stops them (client checklist E5).

use std::time::Duration;

use gimbald::bridge::settings::Settings;
use gimbald::gimbals::settings::{DeviceYawFrame, GimbalSettings};
use gimbald::timestamp::Timestamp;
use gimbald::wire::MavId;
use gimbald::wire::dialect::{GIMBAL_DEVICE_ATTITUDE_STATUS_DATA, GIMBAL_DEVICE_INFORMATION_DATA, MavMessage};

use super::frames::turn_vehicle;
use super::{
    COMPANION, SECOND, Setpoint, assert_near, is_nan, look, only_setpoint, run_looking, setpoints, with_gimbal,
    with_gimbal_that,
};
use crate::support::script::{
    ACCEPTED, NAN, command_int, command_long, device_information, device_status, of, pitch_yaw_deg, pitchyaw,
    set_attitude, set_manual_control, set_pitchyaw, usual_capabilities,
};
use crate::support::world::{GCS, GIMBAL, MANAGER, World, three_links};

/// Client checklist E97: "COMMAND_INT 1000, x = 12, y = 0, z = 1, p3 = −10: pitch turns at −10 °/s; x is read as raw flags, not
/// as a scaled coordinate." Client checklist E98: "The same with p1/p2 NaN and p3 = p4 = 0: stops, ACCEPTED."
#[test]
fn client_items_e97_and_e98_a_rate_by_command_int() {
    let (mut world, places) = with_gimbal();
    let command = |pitch, yaw| command_int(MANAGER, 1000, [NAN, NAN, pitch, yaw], 12, 0, 154.0);
    assert_eq!(world.result_of(places.ground, GCS, &command(-10.0, 0.0)), Some(ACCEPTED));
    let turning = only_setpoint(&mut world, places);
    assert!(is_nan(&turning.q) && turning.flags == 44, "{turning:?}");
    assert_near(turning.angular_velocity_y.into(), (-10.0_f64).to_radians(), 1e-6);
    assert_eq!(turning.angular_velocity_z, 0.0);

    assert_eq!(world.result_of(places.ground, GCS, &command(0.0, 0.0)), Some(ACCEPTED));
    let stopped = only_setpoint(&mut world, places);
    assert_eq!((stopped.angular_velocity_y, stopped.angular_velocity_z), (0.0, 0.0));
}

/// Rates as real clients repeat them turn without a pause, and every form of zero stops them at once.
///
/// Client checklist E99: "COMMAND_LONG 1000: NaN, NaN, 0, 20, 12, 0, 1 repeated at 500 ms: smooth turning, no stutter at the
/// repeats." Client checklist E100: "282: q NaN, ωx NaN, ωy 0.2, ωz 0, flags 44 (and 60) at 500 ms: turns smoothly." Client
/// checklist E101: "282 at 1 Hz, flags 0, id 0, q NaN, ωx 0: turns without pauses: dead-man for streams ≥ 1.5 s." Client
/// checklist E103: "One zero rate stops within 200 ms." Client checklist E104: "ωx NaN and others finite is a valid set."
#[test]
fn client_items_e99_to_e101_e103_and_e104_repeated_rates_turn_without_pauses() {
    let by_282 = |rates, flags| set_attitude([NAN; 4], rates, flags);
    let (twenty, ten) = (20.0_f32.to_radians(), 10.0_f32.to_radians());
    for (message, zero, every, rates) in [
        (pitchyaw(NAN, NAN, 0.0, 20.0, 12.0), pitchyaw(NAN, NAN, 0.0, 0.0, 12.0), SECOND / 2, [0.0, twenty]),
        (by_282([NAN, 0.2, 0.0], 44), by_282([NAN, 0.0, 0.0], 44), SECOND / 2, [0.2, 0.0]),
        (by_282([NAN, 0.2, 0.1], 60), by_282([NAN, 0.0, 0.0], 60), SECOND / 2, [0.2, 0.1]),
        // The rates of the buttons follow the message as a command.
        (by_282([NAN, 0.2, 0.1], 44), pitchyaw(NAN, NAN, 0.0, 0.0, 12.0), SECOND / 2, [0.2, 0.1]),
        (by_282([0.0, 0.0, ten], 0), by_282([0.0, 0.0, 0.0], 0), SECOND, [0.0, ten]),
        (set_pitchyaw(NAN, NAN, 0.1, NAN, 12), set_pitchyaw(NAN, NAN, 0.0, NAN, 12), SECOND / 10, [0.1, 0.0]),
    ] {
        let (mut world, places) = with_gimbal();
        // The gimbal takes yaw from North, so that it turns by itself whatever the frame.
        let status = MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(GIMBAL_DEVICE_ATTITUDE_STATUS_DATA {
            time_boot_ms: u32::MAX,
            delta_yaw: 0.5,
            ..device_status(world.now, 44 | 128, 0.0, 0.0)
        });
        world.send(places.gimbal, GIMBAL, &status);
        let repeated =
            [(every, places.ground, GCS, message.clone()), (SECOND / 10, places.gimbal, GIMBAL, status.clone())];
        world.run_with(4 * SECOND, &repeated);

        let turning = setpoints(&mut world, places);
        assert!(turning.len() >= 80, "{message:?}");
        assert!(turning.iter().all(|(_, setpoint)| is_nan(&setpoint.q) && turns(setpoint) == rates), "{message:?}");
        assert!(turning.windows(2).all(|pair| pair[1].0 - pair[0].0 <= SECOND / 20), "{message:?}");

        world.send(places.ground, GCS, &zero);
        let stopped = setpoints(&mut world, places);
        assert_eq!(stopped.iter().map(|(_, setpoint)| turns(setpoint)).collect::<Vec<_>>(), [[0.0, 0.0]], "{zero:?}");
        world.run_with(SECOND, &[(SECOND / 10, places.gimbal, GIMBAL, status)]);
        let (_, held) = setpoints(&mut world, places).pop().expect("it is held");
        assert!(!is_nan(&held.q), "then the attitude is held");
    }
}

/// Client checklist E102: "Stream ends without a zero: rates stop within the dead-man time (≤ 3 s) and 285 shows standstill."
/// Client checklist E105: "Pitch rate at the limit: stays on the limit, no reversal, and the opposite rate leaves it at once."
#[test]
fn client_items_e102_and_e105_the_gimbal_stands_still_and_leaves_its_limit() {
    let (mut world, places) = World::with_one_gimbal(three_links());
    let rate = |pitch| set_pitchyaw(NAN, NAN, pitch, 0.0, 12);
    let pitch = |world: &World| world.snapshot().gimbals[0].attitude.pitch_deg.expect("known");
    world.run_with(6 * SECOND, &[(SECOND / 2, places.ground, GCS, rate(0.4))]);
    let top = pitch(&world);
    for _ in 0..10 {
        world.send(places.ground, GCS, &rate(0.4));
        world.run_for(SECOND / 10);
        assert_near(pitch(&world), top, 0.2);
    }
    world.send(places.ground, GCS, &rate(-0.4));
    world.run_for(SECOND / 2);
    assert!(pitch(&world) < top - 5.0, "{} from {top}", pitch(&world));

    world.run_for(3 * SECOND);
    world.forget();
    world.run_for(SECOND);
    let shown: Vec<GIMBAL_DEVICE_ATTITUDE_STATUS_DATA> = of(&world.take(places.ground));
    assert!(shown.len() >= 8);
    assert!(shown.iter().all(|status| status.angular_velocity_y.abs() < 0.01), "{shown:?}");
}

/// Client checklist E106: "Rate on one axis does not disturb the other's target." It stands where it is, by a rate of zero:
/// "treat a rate command as replacing both axes". Client checklist E107: "Angle command after a rate ends the rate on the axes
/// named", and on the other.
#[test]
fn client_items_e106_and_e107_a_rate_is_for_both_axes() {
    let (mut world, places) = with_gimbal();
    look(&mut world, places, -10.0, 30.0);
    world.send(places.ground, GCS, &set_pitchyaw(NAN, 0.5, NAN, NAN, 44));
    world.forget();
    world.send(places.ground, GCS, &set_pitchyaw(NAN, NAN, 0.1, NAN, 44));
    assert_eq!(turns(&only_setpoint(&mut world, places)), [0.1, 0.0]);

    for (angle, pitch, yaw) in [
        (set_pitchyaw(-0.2, NAN, NAN, NAN, 44), (-0.2_f64).to_degrees(), 30.0),
        (set_pitchyaw(NAN, 0.4, NAN, NAN, 44), -10.0, 0.4_f64.to_degrees()),
    ] {
        let (mut world, places) = with_gimbal();
        look(&mut world, places, -10.0, 30.0);
        world.send(places.ground, GCS, &set_pitchyaw(NAN, NAN, 0.1, 0.2, 44));
        world.forget();
        world.send(places.ground, GCS, &angle);
        run_looking(&mut world, places, SECOND, -10.0, 30.0);
        for (_, setpoint) in setpoints(&mut world, places) {
            let (seen_pitch, seen_yaw) = pitch_yaw_deg(setpoint.q);
            assert_near(seen_pitch, pitch, 0.001);
            assert_near(seen_yaw, yaw, 0.001);
        }
    }
}

/// Client checklist E108: "Rate while locked (bit 16) is about north: turning the vehicle does not add to it." A-02: flags 60
/// say it from the nose, and mean the same. On a gimbal that turns about its base we turn the angles.
#[test]
fn client_item_e108_a_rate_while_locked_is_about_north() {
    for flags in [28, 60, 92] {
        let (mut world, places) = with_gimbal();
        turn_vehicle(&mut world, places, 10.0);
        look(&mut world, places, 0.0, 20.0);
        world.send(places.ground, GCS, &set_pitchyaw(NAN, NAN, 0.0, 5.0_f32.to_radians(), flags));
        let started = world.now;
        for tick in 1..=40 {
            turn_vehicle(&mut world, places, 10.0 + f64::from(tick));
            run_looking(&mut world, places, SECOND / 20, 0.0, 20.0);
            let heading = 10.0 + f64::from(tick);
            for (at, setpoint) in setpoints(&mut world, places) {
                assert_eq!(setpoint.flags, 44);
                let over_ground = pitch_yaw_deg(setpoint.q).1 + heading;
                // The vehicle's own rotation shows for at most one tick.
                assert_near(over_ground, 30.0 + 5.0 * (at - started).as_secs_f64(), 1.01);
            }
        }
        assert!(world.now - started >= 2 * SECOND - SECOND / 10);
    }
}

/// A-66: "a set-point whose rates are all 0 and angles NaN is 'hold', not 'rate mode'", and a neutral command is not "beaten by
/// a late zero-rate message": zero rates stop what moves and end nothing else, whoever sends them and whenever.
#[test]
fn zero_rates_end_no_angle_no_neutral_and_no_retract() {
    let zeros = [
        set_attitude([NAN; 4], [0.0, 0.0, 0.0], 44),
        set_attitude([NAN; 4], [NAN, 0.0, 0.0], 12),
        set_pitchyaw(NAN, NAN, 0.0, 0.0, 44),
        set_pitchyaw(NAN, NAN, 0.0, NAN, 0),
        set_manual_control(NAN, NAN, 0.0, 0.0),
        pitchyaw(NAN, NAN, 0.0, 0.0, 12.0),
    ];
    for aim in
        [pitchyaw(NAN, NAN, NAN, NAN, 1.0), pitchyaw(NAN, NAN, NAN, NAN, 2.0), pitchyaw(-30.0, 45.0, NAN, NAN, 44.0)]
    {
        for zero in &zeros {
            let (mut world, places) = with_gimbal();
            look(&mut world, places, -5.0, 5.0);
            assert_eq!(world.result_of(places.ground, GCS, &aim), Some(ACCEPTED));
            let told = only_setpoint(&mut world, places);
            for sender in [GCS, COMPANION, GCS] {
                world.send(places.ground, sender, zero);
                run_looking(&mut world, places, SECOND, -5.0, 5.0);
                for (_, setpoint) in setpoints(&mut world, places) {
                    let same = setpoint.q.map(f32::to_bits) == told.q.map(f32::to_bits);
                    assert!(same && setpoint.flags == told.flags, "{zero:?} after {aim:?}: {setpoint:?}");
                }
            }
        }
    }
}

/// A zero among the angles stops what is on its way at a rate, where it is.
#[test]
fn zero_rates_stop_an_angle_that_is_approached() {
    let (mut world, places) = with_gimbal();
    look(&mut world, places, 0.0, 0.0);
    assert_eq!(world.result_of(places.ground, GCS, &pitchyaw(-40.0, 0.0, 10.0, NAN, 44.0)), Some(ACCEPTED));
    run_looking(&mut world, places, 2 * SECOND, 0.0, 0.0);
    world.forget();
    world.send(places.ground, GCS, &set_pitchyaw(NAN, NAN, 0.0, 0.0, 44));
    run_looking(&mut world, places, SECOND, 0.0, 0.0);
    for (_, setpoint) in setpoints(&mut world, places) {
        assert_near(pitch_yaw_deg(setpoint.q).0, -20.0, 0.51);
    }
}

/// A stream of zeros from a stick at rest holds the attitude, not a rate of zero, with which a gimbal drifts.
#[test]
fn a_stream_of_zero_rates_becomes_a_hold() {
    let (mut world, places) = with_gimbal();
    let zero = set_pitchyaw(NAN, NAN, 0.0, 0.0, 44);
    world.send(places.ground, GCS, &set_pitchyaw(NAN, NAN, 0.0, 0.3, 44));
    let status =
        GIMBAL_DEVICE_ATTITUDE_STATUS_DATA { time_boot_ms: u32::MAX, ..device_status(world.now, 44, -10.0, 20.0) };
    let repeated = [
        (SECOND / 20, places.ground, GCS, zero),
        (SECOND / 10, places.gimbal, GIMBAL, MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(status)),
    ];
    world.run_with(SECOND, &repeated);
    world.forget();
    world.run_with(2 * SECOND, &repeated);
    let held = setpoints(&mut world, places);
    assert!(held.len() >= 40);
    for (_, setpoint) in held {
        let (pitch, yaw) = pitch_yaw_deg(setpoint.q);
        assert_near(pitch, -10.0, 0.001);
        assert_near(yaw, 20.0, 0.001);
    }
}

/// To stop takes no heading: a rotation about North that the gimbal itself carries out ends although the heading is not known
/// any more.
#[test]
fn a_rotation_about_north_can_be_stopped_without_a_heading() {
    for flags in [28, 60, 92] {
        let (mut world, places) = with_gimbal();
        turn_vehicle(&mut world, places, 0.0);
        look(&mut world, places, 0.0, 0.0);
        world.send(places.ground, GCS, &set_pitchyaw(NAN, NAN, 0.0, 0.2, flags));
        run_looking(&mut world, places, Duration::from_millis(1_500), 0.0, 10.0);
        world.forget();

        world.send(places.ground, GCS, &set_pitchyaw(NAN, NAN, 0.0, 0.0, flags));
        assert_eq!(turns(&only_setpoint(&mut world, places)), [0.0, 0.0], "flags {flags}");
        // And it does not begin again when the heading is back.
        turn_vehicle(&mut world, places, 0.0);
        run_looking(&mut world, places, SECOND / 2, 0.0, 10.0);
        let (_, held) = setpoints(&mut world, places).pop().expect("it is held");
        assert_near(pitch_yaw_deg(held.q).1, 10.0, 0.001);
    }
}

/// Protocol checklist 113: "When yaw crosses ±180° between two set-points and INFINITE_YAW is set, the set-point path is the
/// short one." With end stops it is the one on which there is none, also while North is held.
#[test]
#[rustfmt::skip]
fn item_113_the_way_round_is_the_short_one_or_the_one_without_an_end_stop() {
    for (endless, from,   to,     flags, by) in [
        (true,    170.0_f32, -170.0, 44.0,  20.0),
        (true,    -170.0, 170.0,  44.0,  -20.0),
        (true,    10.0,   -160.0, 44.0,  -170.0),
        (true,    170.0,  -170.0, 92.0,  20.0),
        (false,   110.0,  -110.0, 44.0,  -220.0),
        (false,   -110.0, 110.0,  44.0,  220.0),
        (false,   110.0,  -110.0, 92.0,  -220.0),
    ] {
        let mut capabilities = crate::support::script::usual_capabilities();
        capabilities.set(gimbald::wire::ids::CapFlags::SUPPORTS_INFINITE_YAW, endless);
        let (mut world, places) = super::with_gimbal_that(capabilities, three_links());
        turn_vehicle(&mut world, places, 0.0);
        look(&mut world, places, 0.0, from.into());
        assert_eq!(world.result_of(places.ground, GCS, &pitchyaw(0.0, to, NAN, 40.0, flags)), Some(ACCEPTED));
        let from_deg = f64::from(from);
        let mut yaw = from_deg;
        for _ in 0..70 {
            turn_vehicle(&mut world, places, 0.0);
            run_looking(&mut world, places, SECOND / 10, 0.0, from.into());
            for (_, setpoint) in setpoints(&mut world, places) {
                // The rate makes steps of at most 2°.
                let step = (pitch_yaw_deg(setpoint.q).1 - yaw + 540.0).rem_euclid(360.0) - 180.0;
                assert!(step.abs() < 2.01 && step * by >= -1e-3, "{from} to {to}: {step}");
                yaw += step;
            }
        }
        assert_near(yaw - from_deg, by, 0.01);
    }
}

/// Without a heading it is the short way, on a gimbal that takes its yaw from North.
#[test]
fn item_113_without_a_heading_the_way_round_is_the_short_one() {
    let (mut world, places) = with_gimbal();
    let status = |world: &World| {
        let status = device_status(world.now, 44 | 64 | 128, 0.0, 170.0);
        MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(GIMBAL_DEVICE_ATTITUDE_STATUS_DATA { flags: 92 | 128, ..status })
    };
    world.send(places.gimbal, GIMBAL, &status(&world));
    assert_eq!(world.result_of(places.ground, GCS, &pitchyaw(0.0, -170.0, NAN, 40.0, 92.0)), Some(ACCEPTED));
    let mut yaw = 170.0;
    for _ in 0..10 {
        world.send(places.gimbal, GIMBAL, &status(&world));
        world.run_for(SECOND / 10);
        for (_, setpoint) in setpoints(&mut world, places) {
            let step = (pitch_yaw_deg(setpoint.q).1 - yaw + 540.0).rem_euclid(360.0) - 180.0;
            assert!((-1e-3..2.01).contains(&step), "{step}");
            yaw += step;
        }
    }
    assert_near(yaw, 190.0, 0.01);
}

/// Client checklist E101, by the letter of MAVProxy's `gimbal rate`, to the device id 0 and without flags, and stopped by its
/// next angle, a mount command.
#[test]
fn client_item_e101_an_angle_ends_a_stream_of_rates() {
    let (mut world, places) = with_gimbal();
    look(&mut world, places, 0.0, 0.0);
    world.send(places.ground, GCS, &set_attitude([NAN; 4], [0.0, 0.1, 0.1], 0));
    world.forget();
    let angle = command_long(MavId::new(1, 191), 205, &[-20.0, 0.0, 10.0, 0.0, 0.0, 0.0, 2.0]);
    assert_eq!(world.result_of(places.ground, GCS, &angle), Some(ACCEPTED));
    let (pitch, yaw) = pitch_yaw_deg(only_setpoint(&mut world, places).q);
    assert_near(pitch, -20.0, 0.001);
    assert_near(yaw, 10.0, 0.001);
}

/// Pitch and yaw rate.
fn turns(setpoint: &Setpoint) -> [f32; 2] {
    [setpoint.angular_velocity_y, setpoint.angular_velocity_z]
}

/// "To stop takes no heading": a device that took a rate about North, and says no more that it takes yaw from there, is told its
/// zeros in the frame that it takes.
#[test]
fn a_rotation_about_north_is_stopped_in_the_frame_that_the_device_takes_then() {
    let (mut world, places) = with_gimbal();
    let says = |world: &mut World, flags: u16, duration: Duration| {
        let end = world.now + duration;
        while world.now < end {
            let status = device_status(world.now, flags, 0.0, 10.0);
            world.send(places.gimbal, GIMBAL, &MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(status));
            world.run_for(SECOND / 10);
        }
    };
    says(&mut world, 12 | 64 | 16 | 128, SECOND / 2);
    world.send(places.ground, GCS, &set_pitchyaw(NAN, NAN, 0.0, 0.1, 92));
    says(&mut world, 12 | 64 | 16 | 128, SECOND / 2);
    let told = setpoints(&mut world, places);
    assert!(
        !told.is_empty() && told.iter().all(|(_, told)| (told.flags, told.angular_velocity_z) == (92, 0.1)),
        "{told:?}"
    );

    // It has lost its heading, and nobody else tells one.
    says(&mut world, 44, 4 * SECOND);
    let told = setpoints(&mut world, places);
    assert!(told.len() >= 60, "{}", told.len());
    assert!(told.iter().all(|(_, told)| told.flags == 44), "{told:?}");
    assert!(
        told.iter().all(|(_, told)| !told.q[0].is_nan() || told.angular_velocity_z == 0.0),
        "it is told to turn in no other frame than it was asked for: {told:?}"
    );
}

/// "A gimbal never keeps turning after its operator is gone": where yaw is told from North only, and where North is not known, the
/// zeros that end what it may have been told before it started again are said all the same, for as long.
#[test]
fn to_stop_takes_no_heading_where_the_device_is_told_yaw_from_north() {
    let entry =
        GimbalSettings { device_yaw_frame: DeviceYawFrame::Earth, ..GimbalSettings::found("camera".to_owned()) };
    let settings = Settings { gimbals: vec![entry], ..three_links() };
    let (mut world, places) = with_gimbal_that(usual_capabilities(), settings);
    let says = |world: &mut World, boot_ms: u64, duration: Duration| {
        for step in 0..(duration.as_millis() as u64 / 100) {
            let status = device_status(Timestamp::from_millis(boot_ms + 100 * step), 44, 0.0, 10.0);
            world.send(places.gimbal, GIMBAL, &MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(status));
            world.run_for(SECOND / 10);
        }
    };
    says(&mut world, 90_000, SECOND / 2);
    world.send(places.ground, GCS, &set_pitchyaw(NAN, NAN, 0.0, 0.1, 92));
    says(&mut world, 91_000, SECOND / 2);
    let told = setpoints(&mut world, places);
    assert!(!told.is_empty() && told.iter().all(|(_, told)| turns(told) == [0.0, 0.1]), "{told:?}");

    says(&mut world, 1_000, 3 * SECOND);
    let told = setpoints(&mut world, places);
    assert!(told.len() >= 55, "20 times a second: {}", told.len());
    assert!(told.iter().all(|(_, told)| (told.flags, turns(told)) == (92, [0.0, 0.0])), "{told:?}");
}

/// 283: "Minimum hardware pitch angle. NAN if unknown": a gimbal that is turned by its angles turns no further than straight down
/// and straight up then, for beyond it would be told to look behind, upside down.
#[test]
fn a_pitch_rate_ends_straight_down_and_up_where_no_end_stop_is_known() {
    for (rate, end) in [(-60.0_f32, -90.0_f64), (60.0, 90.0)] {
        let (mut world, places) = with_gimbal();
        let unknown = GIMBAL_DEVICE_INFORMATION_DATA {
            pitch_min: NAN,
            pitch_max: NAN,
            ..device_information(world.now, usual_capabilities())
        };
        world.send(places.gimbal, GIMBAL, &MavMessage::GIMBAL_DEVICE_INFORMATION(unknown));
        let mut pitch = 0.0;
        for _ in 0..40 {
            turn_vehicle(&mut world, places, 0.0);
            look(&mut world, places, pitch, 0.0);
            world.send(places.ground, GCS, &set_pitchyaw(NAN, NAN, rate.to_radians(), 0.0, 92));
            world.run_for(SECOND / 10);
            for (_, told) in setpoints(&mut world, places) {
                pitch = 2.0 * f64::from(told.q[2]).atan2(told.q[0].into()).to_degrees();
                assert!(pitch.abs() < 90.01 && [told.q[1], told.q[3]].iter().all(|q| q.abs() < 1e-3), "{told:?}");
            }
        }
        assert_near(pitch, end, 0.01);
    }
}
