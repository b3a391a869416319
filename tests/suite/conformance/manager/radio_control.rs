//! Gimbals with radio control inputs of their own.

use gimbald::wire::dialect::{GIMBAL_DEVICE_SET_ATTITUDE_DATA, GIMBAL_MANAGER_STATUS_DATA, MavMessage};
use gimbald::wire::ids::CapFlags;

use super::{COMPANION, FIELD, SECOND, assert_near, fly, only_setpoint, setpoints, with_gimbal, with_gimbal_that};
use crate::support::script::{
    ACCEPTED, DENIED, NAN, TEMPORARILY_REJECTED, device_status, pitch_yaw_deg, pitchyaw, roi_location,
    set_manual_control, set_pitchyaw, usual_capabilities,
};
use crate::support::world::{GCS, GIMBAL, Places, World, three_links};

const MIXED: u16 = 512;
const EXCLUSIVE: u16 = 256;

/// "Forward the bit only if caps has HAS_RC_INPUTS, else DENIED; while active 284 is not streamed and set-points get
/// TEMPORARILY_REJECTED." Whoever handed the gimbal over takes it back by a demand without the flag.
#[test]
fn a_54_a_client_hands_the_gimbal_to_its_radio_control_and_takes_it_back() {
    let (mut world, places) = with_inputs();
    report(&mut world, places, 0, 10.0);
    assert_eq!(world.result_of(places.ground, GCS, &pitchyaw(-20.0, 30.0, NAN, NAN, 44.0)), Some(ACCEPTED));
    world.forget();

    let hand_over = pitchyaw(NAN, NAN, NAN, NAN, 44.0 + 256.0);
    assert_eq!(world.result_of(places.ground, GCS, &hand_over), Some(ACCEPTED));
    let told = only_setpoint(&mut world, places);
    assert_eq!(told.flags, 44 | EXCLUSIVE);
    assert_eq!(world.snapshot().gimbals[0].setpoint, None, "it does not look where anybody told it to");
    let (pitch, yaw) = pitch_yaw_deg(told.q);
    assert_near(pitch, -20.0, 0.001);
    assert_near(yaw, 30.0, 0.001);
    // It is told so until it says that it has understood.
    run_with(&mut world, places, SECOND / 2, 0);
    assert_eq!(setpoints(&mut world, places).len(), 10);
    run_with(&mut world, places, SECOND, EXCLUSIVE);
    assert_eq!(setpoints(&mut world, places), []);
    assert_eq!(world.snapshot().gimbals[0].setpoint, None);
    let told: Vec<GIMBAL_MANAGER_STATUS_DATA> = world.take_messages(places.ground);
    assert!(told.iter().all(|status| status.flags == u32::from(44 | EXCLUSIVE)), "{told:?}");

    // It still says that radio control has it when the demand comes, and a moment longer.
    let take_back = pitchyaw(-10.0, 0.0, NAN, NAN, 44.0);
    assert_eq!(world.result_of(places.ground, GCS, &take_back), Some(ACCEPTED));
    assert_eq!(only_setpoint(&mut world, places).flags, 44);
    let setpoint = world.snapshot().gimbals[0].setpoint.clone().expect("it is told where to look");
    assert_eq!((setpoint.mode.as_str(), setpoint.source.as_deref()), ("angle", Some("255/190")));
    run_with(&mut world, places, SECOND / 2, EXCLUSIVE);
    run_with(&mut world, places, SECOND * 2, 0);
    let told = setpoints(&mut world, places);
    assert_eq!(told.len(), 50);
    assert!(told.iter().all(|(_, setpoint)| setpoint.flags == 44));
}

/// A place to look at takes it back as well.
#[test]
fn a_54_a_region_of_interest_takes_the_gimbal_back() {
    let (mut world, places) = with_inputs();
    report(&mut world, places, 0, 10.0);
    assert_eq!(world.result_of(places.ground, GCS, &pitchyaw(-20.0, 30.0, NAN, NAN, 300.0)), Some(ACCEPTED));
    run_with(&mut world, places, SECOND, EXCLUSIVE);
    fly(&mut world, places, FIELD, 0.0);
    world.forget();
    assert_eq!(world.result_of(places.ground, GCS, &roi_location(0, [47.5, 8.5], 400.0)), Some(ACCEPTED));
    assert_eq!(only_setpoint(&mut world, places).flags, 44);
}

/// When radio control has the gimbal without our doing, or does not let go of it, it is told nothing, and nothing that was asked
/// for before moves it afterwards.
#[test]
fn a_54_radio_control_that_has_the_gimbal_is_left_alone() {
    let (mut world, places) = with_inputs();
    report(&mut world, places, 0, 10.0);
    fly(&mut world, places, FIELD, 0.0);
    assert_eq!(world.result_of(places.ground, GCS, &pitchyaw(-20.0, 30.0, NAN, NAN, 44.0)), Some(ACCEPTED));
    world.forget();
    run_with(&mut world, places, SECOND, EXCLUSIVE);
    assert_eq!(setpoints(&mut world, places), []);
    for command in [pitchyaw(-10.0, 0.0, NAN, NAN, 44.0), roi_location(0, [47.5, 8.5], 400.0)] {
        fly(&mut world, places, FIELD, 0.0);
        assert_eq!(world.result_of(places.ground, GCS, &command), Some(TEMPORARILY_REJECTED));
    }
    world.send(places.ground, COMPANION, &set_pitchyaw(NAN, NAN, 0.1, 0.1, 44));
    assert_eq!(setpoints(&mut world, places), []);
    assert_eq!(world.snapshot().gimbals[0].rejected["1/192"]["radio_control_has_it"], 1);
    run_with(&mut world, places, SECOND, 0);
    assert_eq!(setpoints(&mut world, places), [], "the old angle is forgotten");
    assert_eq!(world.result_of(places.ground, GCS, &pitchyaw(-10.0, 0.0, NAN, NAN, 44.0)), Some(ACCEPTED));

    // Handed over and taken back, but it does not let go.
    let (mut world, places) = with_inputs();
    report(&mut world, places, 0, 10.0);
    for flags in [300.0, 44.0] {
        assert_eq!(world.result_of(places.ground, GCS, &pitchyaw(-20.0, 30.0, NAN, NAN, flags)), Some(ACCEPTED));
        run_with(&mut world, places, SECOND / 2, EXCLUSIVE);
    }
    assert!(!setpoints(&mut world, places).is_empty());
    run_with(&mut world, places, SECOND, EXCLUSIVE);
    world.forget();
    run_with(&mut world, places, SECOND, EXCLUSIVE);
    assert_eq!(setpoints(&mut world, places), []);
}

/// "A gimbal that keeps turning after its operator is gone": a device goes on with the rate that it was told last when its
/// radio control lets go of it, however long that had it. It is told to stop then, and as long as it takes; nothing before.
#[test]
fn a_rotation_that_radio_control_took_over_is_stopped_when_it_lets_go() {
    let (mut world, places) = with_inputs();
    report(&mut world, places, 0, 10.0);
    world.send(places.ground, GCS, &set_pitchyaw(NAN, NAN, 0.0, 0.2, 44));
    run_with(&mut world, places, SECOND, 0);
    assert!(setpoints(&mut world, places).iter().all(|(_, setpoint)| setpoint.angular_velocity_z == 0.2));

    run_with(&mut world, places, 5 * SECOND, EXCLUSIVE);
    assert_eq!(setpoints(&mut world, places), []);

    run_with(&mut world, places, 2 * SECOND, 0);
    let told = setpoints(&mut world, places);
    assert!(told.len() >= 20, "{told:?}");
    let rates = |setpoint: &GIMBAL_DEVICE_SET_ATTITUDE_DATA| {
        [setpoint.angular_velocity_x, setpoint.angular_velocity_y, setpoint.angular_velocity_z]
    };
    let (stops, held): (Vec<_>, Vec<_>) = told.iter().partition(|(_, setpoint)| setpoint.q[0].is_nan());
    assert!(!stops.is_empty() && stops.iter().all(|(_, setpoint)| rates(setpoint)[1..] == [0.0, 0.0]), "{stops:?}");
    assert!(stops.last().map(|told| told.0) < held.first().map(|told| told.0), "it is held where it came to rest");
    assert!(!held.is_empty());
}

/// D9: "axes it leaves out, and the start of every ramp, are the measured attitude": where the pilot has turned it, and not
/// where it looked before he had it. Zeros of a stick at rest do not take it from him.
#[test]
fn what_takes_it_back_begins_where_the_pilot_left_it() {
    // Pitch and yaw asked for, and what it is told of both then.
    for (message, expected) in [
        (pitchyaw(NAN, NAN, 0.0, 0.0, 44.0), None),
        (set_pitchyaw(NAN, NAN, 0.0, 0.0, 44), None),
        (set_manual_control(NAN, NAN, 0.0, 0.0), None),
        (pitchyaw(NAN, -40.0, NAN, NAN, 44.0), Some((0.0, -40.0))),
        (pitchyaw(-50.0, NAN, NAN, NAN, 44.0), Some((-50.0, 10.0))),
    ] {
        let (mut world, places) = with_inputs();
        report(&mut world, places, 0, 10.0);
        assert_eq!(world.result_of(places.ground, GCS, &pitchyaw(-20.0, 30.0, NAN, NAN, 44.0)), Some(ACCEPTED));
        let hand_over = pitchyaw(NAN, NAN, NAN, NAN, 44.0 + 256.0);
        assert_eq!(world.result_of(places.ground, GCS, &hand_over), Some(ACCEPTED));
        run_with(&mut world, places, SECOND, EXCLUSIVE);
        world.forget();

        world.send(places.ground, GCS, &message);

        let told = setpoints(&mut world, places);
        let looks = told.last().map(|(_, setpoint)| pitch_yaw_deg(setpoint.q));
        match (looks, expected) {
            (None, None) => {
                run_with(&mut world, places, SECOND, EXCLUSIVE);
                assert_eq!(setpoints(&mut world, places), [], "{message:?}");
            }
            (Some((pitch, yaw)), Some(wanted)) => {
                assert_near(pitch, wanted.0, 0.001);
                assert_near(yaw, wanted.1, 0.001);
            }
            other => panic!("{message:?}: {other:?}"),
        }
    }
}

/// `RC_MIXED` goes with each setpoint; what the gimbal makes of it is its business.
#[test]
fn a_54_radio_control_that_is_mixed_in_changes_nothing_else() {
    let (mut world, places) = with_inputs();
    report(&mut world, places, 0, 10.0);
    for (message, rates) in
        [(set_pitchyaw(-0.2, 0.1, NAN, NAN, 44 | 512), false), (set_pitchyaw(NAN, NAN, 0.1, 0.1, 44 | 512), true)]
    {
        world.send(places.ground, GCS, &message);
        run_with(&mut world, places, SECOND, MIXED);
        let told = setpoints(&mut world, places);
        assert!(told.len() >= 20);
        assert!(told.iter().all(|(_, setpoint)| setpoint.flags == 44 | MIXED && setpoint.q[0].is_nan() == rates));
    }
}

/// A gimbal without such inputs is not believed: some use that bit for something of their own.
#[test]
fn a_54_without_inputs_there_is_no_radio_control() {
    let (mut world, places) = with_gimbal();
    report(&mut world, places, EXCLUSIVE | MIXED, 10.0);
    assert_eq!(world.result_of(places.ground, GCS, &pitchyaw(-20.0, 30.0, NAN, NAN, 44.0)), Some(ACCEPTED));
    run_with(&mut world, places, SECOND, EXCLUSIVE);
    assert!(setpoints(&mut world, places).len() >= 20);
    for flags in [44.0 + 256.0, 44.0 + 512.0] {
        assert_eq!(world.result_of(places.ground, GCS, &pitchyaw(-20.0, 30.0, NAN, NAN, flags)), Some(DENIED));
    }
}

fn with_inputs() -> (World, Places) {
    with_gimbal_that(usual_capabilities() | CapFlags::HAS_RC_INPUTS, three_links())
}

fn report(world: &mut World, places: Places, flags: u16, yaw_deg: f64) {
    let status = device_status(world.now, 44 | flags, 0.0, yaw_deg);
    world.send(places.gimbal, GIMBAL, &MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(status));
}

/// Time passes while the gimbal says who has it.
fn run_with(world: &mut World, places: Places, duration: std::time::Duration, flags: u16) {
    let mut left = duration;
    while !left.is_zero() {
        report(world, places, flags, 10.0);
        let step = left.min(SECOND / 10);
        world.run_for(step);
        left -= step;
    }
}
