//! What the holder of secondary control may do while another holds primary control.
//!
//! A-20: "primary sets; secondary's rates/manual rates integrate into a bounded nudge offset (±20°, decays on primary's
//! next absolute set-point); secondary's absolute set-points only if primary silent > 2 s; same ids in both slots =
//! primary only."

use std::time::Duration;

use gimbald::timestamp::Timestamp;
use gimbald::wire::MavId;
use gimbald::wire::dialect::{GIMBAL_DEVICE_ATTITUDE_STATUS_DATA, GLOBAL_POSITION_INT_DATA, MavMessage};

use super::{COMPANION, SECOND, Setpoint, assert_near, only_setpoint, run_looking, setpoints, with_gimbal};
use crate::support::script::{
    ACCEPTED, DENIED, NAN, command_int, configure, device_status, ground_heartbeat, pitch_yaw_deg, pitchyaw,
    px4_heartbeat, set_attitude, set_manual_control, set_pitchyaw,
};
use crate::support::world::{AUTOPILOT, GCS, GIMBAL, MANAGER, Places, World};

const TABLET: MavId = MavId::new(254, 190);

/// "When the secondary sends a 287 with rates while the primary holds an angle, the output angle changes by at most the
/// nudge bound"; and by as much as the rates say, whichever message or command they come in.
#[test]
fn items_66_and_79_the_secondary_moves_the_camera_within_the_nudge_bound() {
    let rate = 5_f32; // degrees per second; full deflection of manual control is 30
    let by_attitude = set_attitude([NAN; 4], [NAN, -rate.to_radians(), rate.to_radians()], 44);
    for (name, says) in [
        ("287", set_pitchyaw(NAN, NAN, -rate.to_radians(), rate.to_radians(), 44)),
        ("282", by_attitude),
        ("288", set_manual_control(NAN, NAN, -rate / 30.0, rate / 30.0)),
        ("1000", pitchyaw(NAN, NAN, -rate, rate, 44.0)),
    ] {
        let (mut world, places) = shared();
        let began = world.now;
        let stream = [(SECOND / 5, places.autopilot, COMPANION, says)];
        run(&mut world, places, SECOND * 10, &stream);

        for (at, angles) in angles(&mut world, places) {
            let way = (rate as f64 * at.since(began).as_secs_f64()).min(20.0);
            assert_near(angles.0, -30.0 - way, 0.3);
            assert_near(angles.1, 10.0 + way, 0.3);
        }
        let setpoint = world.snapshot().gimbals[0].setpoint.clone().expect("there is one");
        assert_eq!((setpoint.source, setpoint.mode.as_str()), (Some(GCS.to_string()), "angle"), "{name}");
        assert_near(setpoint.nudge_pitch_deg, -20.0, 1e-9);
        assert_near(setpoint.nudge_yaw_deg, 20.0, 1e-9);
        assert!(world.snapshot().gimbals[0].rejected.is_empty(), "{name}");
    }
}

/// D7: "Rates expire per axis": those of a nudge by message two seconds after the last one, by command after ten; what
/// was reached stays.
#[test]
fn a_nudge_that_is_not_refreshed_stops() {
    let message = set_pitchyaw(NAN, NAN, 0.0, 4_f32.to_radians(), 44);
    for (says, lasts_s) in [(message, 2.0), (pitchyaw(NAN, NAN, NAN, 1.0, 44.0), 10.0)] {
        let (mut world, places) = shared();
        let began = world.now;
        world.send(places.autopilot, COMPANION, &says);
        let heartbeat = [(SECOND, places.autopilot, COMPANION, crate::support::world::heartbeat(18, 8))];
        run(&mut world, places, SECOND * 15, &heartbeat);
        let moved = angles(&mut world, places);
        let rate = if lasts_s < 5.0 { 4.0 } else { 1.0 };
        for (at, (pitch, yaw)) in moved {
            assert_near(pitch, -30.0, 0.001);
            assert_near(yaw, 10.0 + rate * at.since(began).as_secs_f64().min(lasts_s), 0.001);
        }
        let event = world.snapshot().events.first().cloned().expect("it is told");
        assert_eq!((event.what.as_str(), event.who), ("rates_ended", Some(COMPANION.to_string())));
    }
}

/// "Cleared (decays smoothly, no jump faster than 30°/s) at the primary's next absolute set-point", on the axes that it
/// names.
#[test]
fn the_primarys_next_setpoint_takes_a_nudge_back() {
    let (mut world, places) = nudged(-10.0, 12.0);
    let began = world.now;
    assert_eq!(world.result_of(places.ground, GCS, &pitchyaw(NAN, 20.0, NAN, NAN, 44.0)), Some(ACCEPTED));
    run(&mut world, places, SECOND * 2, &[]);
    for (at, (pitch, yaw)) in angles(&mut world, places) {
        let taken_back = 30.0 * at.since(began).as_secs_f64();
        assert_near(pitch, -40.0, 0.001);
        assert_near(yaw, 20.0 + (12.0 - taken_back).max(0.0), 0.001);
    }
    // And by looking at a place, or at nothing any more.
    world.send(places.autopilot, AUTOPILOT, &px4_heartbeat());
    world.send(places.autopilot, AUTOPILOT, &position());
    world.send(places.autopilot, AUTOPILOT, &heading_north(&world));
    let place = command_int(MANAGER, 195, [NAN; 4], 474_000_000, 85_456_000, 0.0);
    assert_eq!(world.result_of(places.ground, GCS, &place), Some(ACCEPTED));
    run(&mut world, places, SECOND * 2, &[]);
    let setpoint = world.snapshot().gimbals[0].setpoint.clone().expect("there is one");
    assert_eq!((setpoint.nudge_pitch_deg, setpoint.nudge_yaw_deg), (0.0, 0.0));
}

/// Also while the gimbal calibrates, when nobody steers it: the secondary stops what it adds, and not what the primary wants.
#[test]
fn a_secondary_that_stops_while_the_gimbal_calibrates_stops_only_itself() {
    let (mut world, places) = shared();
    assert_eq!(world.result_of(places.autopilot, COMPANION, &pitchyaw(NAN, NAN, 0.0, 1.0, 44.0)), Some(ACCEPTED));
    world.run_for(SECOND);
    let status = device_status(world.now, 44, -30.0, 11.0);
    let status = GIMBAL_DEVICE_ATTITUDE_STATUS_DATA { failure_flags: 256, ..status };
    world.send(places.gimbal, GIMBAL, &MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(status));

    assert_eq!(world.result_of(places.autopilot, COMPANION, &pitchyaw(NAN, NAN, 0.0, 1.0, 44.0)), Some(1));
    assert_eq!(world.result_of(places.autopilot, COMPANION, &pitchyaw(NAN, NAN, 0.0, 0.0, 44.0)), Some(ACCEPTED));
    world.run_for(SECOND);

    let setpoint = world.snapshot().gimbals[0].setpoint.clone().expect("there is one");
    assert_eq!((setpoint.source, setpoint.mode.as_str()), (Some(GCS.to_string()), "angle"));
    assert_near(setpoint.nudge_yaw_deg, 1.0, 0.06);
}

/// A rate of the primary is no absolute setpoint: it turns the camera on from where it looks, and nothing jumps.
#[test]
fn a_rate_of_the_primary_goes_on_from_the_nudge() {
    let (mut world, places) = nudged(-10.0, 12.0);
    world.send(places.ground, GCS, &set_pitchyaw(NAN, NAN, 0.0, 0.1, 44));
    let turning = only_setpoint(&mut world, places);
    assert_eq!((turning.angular_velocity_y, turning.angular_velocity_z), (0.0, 0.1));
    world.send(places.ground, GCS, &set_pitchyaw(NAN, NAN, 0.0, 0.0, 44));
    world.forget();
    run_looking(&mut world, places, SECOND, -40.0, 22.0);
    let (_, held) = setpoints(&mut world, places).pop().expect("it is held");
    let (pitch, yaw) = pitch_yaw_deg(held.q);
    assert_near(pitch, -40.0, 0.001);
    assert_near(yaw, 22.0, 0.001);
}

/// While the primary turns the camera by rates, those of the secondary are added; both end with zero rates.
#[test]
fn a_nudge_is_added_to_a_rotation() {
    let (mut world, places) = shared();
    world.send(places.ground, GCS, &set_pitchyaw(NAN, NAN, 0.0, 0.2, 44));
    world.forget();

    world.send(places.autopilot, COMPANION, &set_pitchyaw(NAN, NAN, 0.1, -0.05, 44));

    let both = only_setpoint(&mut world, places);
    assert_near(both.angular_velocity_y.into(), 0.1, 1e-6);
    assert_near(both.angular_velocity_z.into(), 0.15, 1e-6);
    run(&mut world, places, SECOND * 3, &[]);
    let told = setpoints(&mut world, places);
    assert!(told.iter().any(|(_, told)| (told.angular_velocity_y, told.angular_velocity_z) == (0.0, 0.0)));
    assert!(told.last().is_some_and(|(_, held)| held.angular_velocity_y.is_nan()), "and then the attitude is held");
}

/// "And when the secondary loses its place"; but who becomes primary finds the camera where it moved it (D9).
#[test]
fn a_nudge_ends_with_secondary_control() {
    let release = configure([-1.0, -1.0], [-3.0, -3.0]);
    let pass_on = configure([-1.0, -1.0], [254.0, 190.0]);
    for (says, stays) in [(release, false), (pass_on, false), (configure([-2.0, -2.0], [-3.0, -3.0]), true)] {
        let (mut world, places) = nudged(-10.0, 12.0);
        let began = world.now;
        assert_eq!(world.result_of(places.autopilot, COMPANION, &says), Some(ACCEPTED));
        run(&mut world, places, SECOND * 2, &[]);
        for (at, (pitch, yaw)) in angles(&mut world, places) {
            let taken_back = if stays { 0.0 } else { 30.0 * at.since(began).as_secs_f64() };
            assert_near(pitch, -30.0 - (10.0 - taken_back).max(0.0), 0.001);
            assert_near(yaw, 10.0 + (12.0 - taken_back).max(0.0), 0.001);
        }
    }
}

/// D6, of the secondary: its lease runs out, and the camera goes back where the primary has it.
#[test]
fn a_nudge_ends_with_the_lease_of_the_secondary() {
    let (mut world, places) = nudged(-10.0, 12.0);
    run(&mut world, places, SECOND * 12, &[]);
    let (_, (pitch, yaw)) = angles(&mut world, places).pop().expect("it is streamed");
    assert_near(pitch, -30.0, 0.001);
    assert_near(yaw, 10.0, 0.001);
    assert_eq!(world.snapshot().gimbals[0].secondary, None);
}

/// D9: on a change of primary control rates stop at once and the camera stays where it is.
#[test]
fn a_nudge_stands_still_when_primary_control_changes() {
    let (mut world, places) = nudged(-10.0, 12.0);
    world.send(places.autopilot, COMPANION, &set_pitchyaw(NAN, NAN, 0.0, 0.1, 44));
    run(&mut world, places, SECOND / 2, &[]);
    let (_, moved) = angles(&mut world, places).pop().expect("it is streamed");
    assert_eq!(world.result_of(places.ground, TABLET, &configure([-2.0, -2.0], [-1.0, -1.0])), Some(ACCEPTED));
    run(&mut world, places, SECOND, &[]);
    for (_, (pitch, yaw)) in angles(&mut world, places) {
        assert_near(pitch, moved.0, 0.001);
        assert_near(yaw, moved.1, 0.3);
    }
}

/// D9: without the primary nobody has it elsewhere: the camera stays where it was moved, also when the secondary goes too.
#[test]
fn a_nudge_stays_when_the_primary_goes() {
    let (mut world, places) = nudged(-10.0, 12.0);
    assert_eq!(world.result_of(places.ground, GCS, &configure([-3.0, -3.0], [-1.0, -1.0])), Some(ACCEPTED));
    run(&mut world, places, SECOND, &[]);
    let release = configure([-1.0, -1.0], [-3.0, -3.0]);
    assert_eq!(world.result_of(places.autopilot, COMPANION, &release), Some(ACCEPTED));
    run(&mut world, places, SECOND * 2, &[]);
    for (_, (pitch, yaw)) in angles(&mut world, places) {
        assert_near(pitch, -40.0, 0.001);
        assert_near(yaw, 22.0, 0.001);
    }
    let setpoint = world.snapshot().gimbals[0].setpoint.clone().expect("it is kept");
    assert_eq!((setpoint.nudge_pitch_deg, setpoint.nudge_yaw_deg), (0.0, 0.0));
}

/// A primary that streams its setpoints, as PX4 does, leaves room for a nudge as long as the secondary makes one.
#[test]
fn a_nudge_lasts_while_the_primary_streams() {
    let (mut world, places) = shared();
    let began = world.now;
    let primary =
        (SECOND / 50, places.ground, GCS, set_pitchyaw(-30_f32.to_radians(), 10_f32.to_radians(), NAN, NAN, 44));
    let secondary = (SECOND / 10, places.autopilot, COMPANION, set_pitchyaw(NAN, NAN, 0.0, 5_f32.to_radians(), 44));
    run(&mut world, places, SECOND * 3, &[primary.clone(), secondary]);
    for (at, (_, yaw)) in angles(&mut world, places) {
        assert_near(yaw, 10.0 + 5.0 * at.since(began).as_secs_f64(), 0.6);
    }
    world.send(places.autopilot, COMPANION, &set_pitchyaw(NAN, NAN, 0.0, 0.0, 44));
    run(&mut world, places, SECOND * 2, &[primary]);
    let told = angles(&mut world, places);
    let steps = told.windows(2).map(|pair| {
        let seconds = pair[1].0.since(pair[0].0).as_secs_f64();
        ((pair[1].1.1 - pair[0].1.1).abs(), seconds)
    });
    for (step, seconds) in steps {
        assert!(step <= 30.0 * seconds + 0.001, "{step}° in {seconds} s");
    }
    assert_near(told.last().expect("it is streamed").1.1, 10.0, 0.001);
}

/// "Secondary's absolute set-points only if primary silent > 2 s."
#[test]
fn item_66_absolute_setpoints_of_the_secondary_wait_for_the_primary_to_be_silent() {
    let (mut world, places) = shared();
    world.send(places.ground, GCS, &set_pitchyaw(-0.5, 0.2, NAN, NAN, 44));
    let absolute = [
        pitchyaw(-10.0, 0.0, NAN, NAN, 44.0),
        pitchyaw(-10.0, 0.0, 5.0, 5.0, 44.0),
        pitchyaw(NAN, NAN, NAN, NAN, 46.0),
        pitchyaw(NAN, 3.0, 5.0, NAN, 44.0),
    ];
    world.run_for(SECOND * 2);
    world.forget();
    for says in &absolute {
        assert_eq!(world.result_of(places.autopilot, COMPANION, says), Some(DENIED), "{says:?}");
    }
    assert_eq!(world.snapshot().gimbals[0].rejected["1/192"]["primary_is_active"], 4);
    run_looking(&mut world, places, SECOND / 10, 0.0, 0.0);
    for says in &absolute {
        assert_eq!(world.result_of(places.autopilot, COMPANION, says), Some(ACCEPTED), "{says:?}");
    }
}

/// At its end stop the camera is where it is; the other way it moves at once.
#[test]
fn nothing_is_saved_up_behind_an_end_stop() {
    let (mut world, places) = shared();
    // The gimbal looks down to −1.5 rad, which is −85.9°.
    assert_eq!(world.result_of(places.ground, GCS, &pitchyaw(-80.0, 0.0, NAN, NAN, 44.0)), Some(ACCEPTED));
    let down = [(SECOND / 2, places.autopilot, COMPANION, set_pitchyaw(NAN, NAN, -0.2, 0.0, 44))];
    run(&mut world, places, SECOND * 3, &down);
    let (_, (pitch, _)) = angles(&mut world, places).pop().expect("it is streamed");
    assert_near(pitch, -85.944, 0.001);
    world.send(places.autopilot, COMPANION, &set_pitchyaw(NAN, NAN, 0.2, 0.0, 44));
    run(&mut world, places, SECOND / 2, &[]);
    let (_, (pitch, _)) = angles(&mut world, places).pop().expect("it is streamed");
    assert_near(pitch, -85.944 + 0.1_f64.to_degrees(), 0.6);
}

/// A gimbal that looks at −30°, 10° for `GCS`, and `COMPANION` is secondary.
fn shared() -> (World, Places) {
    let (mut world, places) = with_gimbal();
    let both = configure([255.0, 190.0], [1.0, 192.0]);
    assert_eq!(world.result_of(places.ground, GCS, &both), Some(ACCEPTED));
    assert_eq!(world.result_of(places.ground, GCS, &pitchyaw(-30.0, 10.0, NAN, NAN, 44.0)), Some(ACCEPTED));
    run(&mut world, places, SECOND * 3, &[]);
    world.forget();
    (world, places)
}

/// The same, moved by the secondary by so many degrees.
fn nudged(pitch_deg: f32, yaw_deg: f32) -> (World, Places) {
    let (mut world, places) = shared();
    let says = set_pitchyaw(NAN, NAN, pitch_deg.to_radians(), yaw_deg.to_radians(), 44);
    world.send(places.autopilot, COMPANION, &says);
    run(&mut world, places, SECOND, &[]);
    world.send(places.autopilot, COMPANION, &set_pitchyaw(NAN, NAN, 0.0, 0.0, 44));
    let (_, (pitch, yaw)) = angles(&mut world, places).pop().expect("it is streamed");
    assert_near(pitch, f64::from(pitch_deg) - 30.0, 0.001);
    assert_near(yaw, f64::from(yaw_deg) + 10.0, 0.001);
    world.forget();
    (world, places)
}

type Stream = (Duration, crate::support::world::Place, MavId, MavMessage);

/// Time passes; the gimbal is well, and the ground station is there.
fn run(world: &mut World, places: Places, duration: Duration, streams: &[Stream]) {
    let status = device_status(world.now, 44, 0.0, 0.0);
    let status = GIMBAL_DEVICE_ATTITUDE_STATUS_DATA { time_boot_ms: u32::MAX, ..status };
    let mut repeated = vec![
        (SECOND / 10, places.gimbal, GIMBAL, MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(status)),
        (SECOND, places.ground, GCS, ground_heartbeat()),
    ];
    repeated.extend_from_slice(streams);
    world.run_with(duration, &repeated);
}

/// Where the gimbal was told to look and when, pitch and yaw in degrees.
fn angles(world: &mut World, places: Places) -> Vec<(Timestamp, (f64, f64))> {
    let angles = |setpoint: &Setpoint| pitch_yaw_deg(setpoint.q);
    setpoints(world, places).iter().map(|(at, setpoint)| (*at, angles(setpoint))).collect()
}

fn position() -> MavMessage {
    MavMessage::GLOBAL_POSITION_INT(GLOBAL_POSITION_INT_DATA {
        time_boot_ms: 0,
        lat: 473_977_420,
        lon: 85_455_940,
        alt: 488_000,
        relative_alt: 0,
        vx: 0,
        vy: 0,
        vz: 0,
        hdg: 0,
    })
}

fn heading_north(world: &World) -> MavMessage {
    let state = crate::support::script::autopilot_state(world.now, MavId::new(0, 0), 0.0);
    MavMessage::AUTOPILOT_STATE_FOR_GIMBAL_DEVICE(state)
}
