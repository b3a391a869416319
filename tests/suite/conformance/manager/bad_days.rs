//! What must not move the gimbal, and what must stop it: somebody vanishes, restarts, is unplugged, or pretends.

use crate::support::script::ground_heartbeat;
use gimbald::bridge::Input;
use gimbald::bridge::settings::{Settings, Transport};
use gimbald::manager::settings::ControlSettings;
use gimbald::timestamp::Timestamp;
use gimbald::wire::MavId;
use gimbald::wire::dialect::{COMMAND_LONG_DATA, HEARTBEAT_DATA, MavMessage};

use super::frames::turn_vehicle;
use super::{
    COMPANION, NO_ANGLES, SECOND, Setpoint, assert_near, look, run_looking, setpoints, with_gimbal, with_gimbal_that,
};
use crate::support::script::{
    ACCEPTED, DENIED, NAN, configure, device_information, device_status, gimbal_heartbeat, pitch_yaw_deg, pitchyaw,
    px4_heartbeat, set_pitchyaw, take_control, to, usual_capabilities,
};
use crate::support::world::{AUTOPILOT, Arrival, GCS, GIMBAL, World, three_links};

/// D7: "on … SIGTERM zero is sent at once", and nothing else is what the gimbal hears until the goodbye, also when its line
/// is slow and the client goes on.
#[test]
fn d7_at_the_end_no_demand_follows_the_zero() {
    let mut settings = three_links();
    settings.links[1].transport = Transport::Serial { baud: 19_200 };
    let (mut world, places) = with_gimbal_that(usual_capabilities(), settings);
    for _ in 0..40 {
        world.send(places.ground, GCS, &turn(0.5));
        world.run_for(SECOND / 50);
    }
    world.forget();

    world.input(Input::Shutdown);
    for _ in 0..24 {
        world.send(places.ground, GCS, &turn(0.5));
        world.run_for(SECOND / 50);
    }

    let heard = world.arrivals(places.gimbal);
    let goodbye: HEARTBEAT_DATA = heard.last().expect("the goodbye").decode();
    assert_eq!(goodbye.system_status, 7, "POWEROFF is the last word");
    let setpoints = setpoints(&mut world, places);
    // One was on its way.
    let after: Vec<_> =
        setpoints[1..].iter().map(|(_, told)| [told.angular_velocity_y, told.angular_velocity_z]).collect();
    assert!(after.len() >= 5 && after.iter().all(|rates| *rates == [0.0, 0.0]), "{after:?}");
    assert!(world.bridge.is_finished());
}

/// "Then one POWEROFF heartbeat": the process ends when a slow line has it too, behind the frame that is on the wire.
#[test]
fn item_179_the_end_waits_for_a_slow_line() {
    let mut settings = three_links();
    settings.links[1].transport = Transport::Serial { baud: 9_600 };
    let (mut world, places) = with_gimbal_that(usual_capabilities(), settings);
    world.run_for(SECOND);
    world.forget();
    world.send(places.ground, GCS, &to(GIMBAL, pitchyaw(0.0, 0.0, NAN, NAN, 44.0)));

    world.input(Input::Shutdown);

    let ids = |world: &World| -> Vec<u32> { world.arrivals(places.gimbal).iter().map(Arrival::id).collect() };
    assert_eq!((ids(&world), world.bridge.is_finished()), (vec![76], false));
    world.run_for(SECOND / 20);
    assert_eq!((ids(&world), world.bridge.is_finished()), (vec![76, 0], true));
}

/// Nobody is listened to at the end, so what was asked of others is not asked again: only zeros and goodbyes are heard.
#[test]
fn d7_at_the_end_nobody_is_asked_again() {
    let (mut world, places) = with_gimbal();
    let asked = |world: &mut World| world.take_messages::<COMMAND_LONG_DATA>(places.autopilot).len();
    world.send(places.autopilot, AUTOPILOT, &px4_heartbeat());
    world.forget();
    // It says nothing of its position, and is asked for that.
    while asked(&mut world) == 0 {
        world.send(places.ground, GCS, &turn(0.5));
        run_looking(&mut world, places, SECOND / 10, 0.0, 0.0);
        assert!(world.now < Timestamp::from_secs(10));
    }
    run_looking(&mut world, places, SECOND / 5, 0.0, 0.0);

    world.input(Input::Shutdown);
    world.run_for(2 * SECOND);

    assert_eq!(asked(&mut world), 0, "500 ms later it would be asked again");
    assert_eq!(setpoints(&mut world, places).last().map(|(_, told)| told.angular_velocity_z), Some(0.0));
    assert!(world.bridge.is_finished());
}

/// D7: what the gimbal cannot turn by itself we turn by its angles. At the end it is told no more, and stands where it was told
/// to look last; nothing is waited for.
#[test]
fn d7_at_the_end_what_is_turned_by_its_angles_is_told_no_more() {
    let (mut world, places) = with_gimbal();
    look(&mut world, places, 0.0, 0.0);
    turn_vehicle(&mut world, places, 90.0);
    // To the right over ground; this gimbal takes its yaw from the nose.
    world.send(places.ground, GCS, &set_pitchyaw(NAN, NAN, 0.0, 0.2, 92));
    run_looking(&mut world, places, SECOND, 0.0, 0.0);
    assert_eq!(world.snapshot().gimbals[0].setpoint.as_ref().map(|told| told.mode.as_str()), Some("angle"));
    world.forget();

    world.input(Input::Shutdown);

    assert!(world.bridge.is_finished());
    let heard = world.arrivals(places.gimbal);
    assert_eq!(heard.iter().map(Arrival::id).collect::<Vec<_>>(), [0], "the goodbye");
}

/// D7: a rotation does not outlive a restart of the gimbal, its cable, or a time in which it is not heard, also where the
/// gimbal itself goes on turning: it is told to stop, and then to stay where it looks (D9).
#[test]
fn d7_nothing_turns_on_after_a_restart_a_pulled_cable_or_a_silence() {
    #[derive(Clone, Copy, Debug, PartialEq)]
    enum Day {
        Restart,
        PulledCable,
        Silence,
    }
    for day in [Day::Restart, Day::PulledCable, Day::Silence] {
        let (mut world, places) = with_gimbal();
        look(&mut world, places, 0.0, 0.0);
        let rate = pitchyaw(NAN, NAN, 0.0, 20.0, 44.0);
        assert_eq!(world.result_of(places.ground, GCS, &rate), Some(ACCEPTED));
        run_looking(&mut world, places, SECOND, 0.0, 10.0);
        world.forget();

        match day {
            Day::Restart => {
                let status = device_status(gimbald::timestamp::Timestamp::ZERO, 44, 0.0, 10.0);
                world.send(places.gimbal, GIMBAL, &MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(status));
            }
            Day::PulledCable => {
                world.unplug(places.gimbal);
                assert_eq!(world.snapshot().gimbals[0].state, "lost", "at once");
                world.run_for(SECOND / 2);
                assert_eq!(setpoints(&mut world, places), []);
                world.plug_in(places.gimbal);
                world.send(places.gimbal, GIMBAL, &gimbal_heartbeat());
            }
            Day::Silence => {
                world.run_for(4 * SECOND);
                assert_eq!(world.snapshot().gimbals[0].state, "lost");
                let told = setpoints(&mut world, places);
                assert_eq!(rates(&told.last().expect("it may hear us").1), [0.0, 0.0], "and then nothing more");
                world.send(places.gimbal, GIMBAL, &gimbal_heartbeat());
            }
        }
        let back = world.now;
        run_looking(&mut world, places, SECOND, 0.0, 10.0);

        let told = setpoints(&mut world, places);
        let (first, stopped) = told.first().expect("it is told to stop");
        assert_eq!((*first, rates(stopped)), (back, [0.0, 0.0]), "{day:?}");
        let (_, kept) = told.iter().find(|(_, told)| !told.q[0].is_nan()).expect("and to stay");
        let (pitch, yaw) = pitch_yaw_deg(kept.q);
        assert_near(pitch, 0.0, 0.01);
        assert_near(yaw, 10.0, 0.01);
        let moves = told.iter().any(|(_, told)| rates(told).iter().any(|rate| !rate.is_nan() && *rate != 0.0));
        assert!(!moves, "{day:?}: {told:?}");
    }
}

/// D9: "no change of … link state moves the camera by itself": where it stood still it is told nothing when it is back.
#[test]
fn d9_a_gimbal_at_rest_is_told_nothing_when_it_is_back() {
    let (mut world, places) = with_gimbal();
    assert_eq!(world.result_of(places.ground, GCS, &pitchyaw(-20.0, 10.0, NAN, NAN, 44.0)), Some(ACCEPTED));
    run_looking(&mut world, places, SECOND, -20.0, 10.0);
    world.run_for(4 * SECOND);
    world.forget();

    world.send(places.gimbal, GIMBAL, &gimbal_heartbeat());
    run_looking(&mut world, places, SECOND, 0.0, 0.0);

    assert_eq!(setpoints(&mut world, places), []);
    assert_eq!(world.snapshot().gimbals[0].setpoint, None);
}

/// D6 and D7: a rate ends with the control of who asked for it, secondary or primary.
#[test]
fn d7_a_rate_of_the_secondary_ends_with_its_control() {
    let (mut world, places) = with_gimbal();
    let places_of = [(GCS, take_control()), (GCS, configure([-1.0, -1.0], [1.0, 192.0]))];
    for (sender, request) in places_of {
        assert_eq!(world.result_of(places.ground, sender, &request), Some(ACCEPTED));
    }
    run_looking(&mut world, places, 3 * SECOND, 0.0, 0.0);
    let rate = pitchyaw(NAN, NAN, 0.0, 20.0, 44.0);
    assert_eq!(world.result_of(places.autopilot, COMPANION, &rate), Some(ACCEPTED), "the primary was silent for 2 s");
    world.forget();

    let release = configure([-1.0, -1.0], [-3.0, -3.0]);
    assert_eq!(world.result_of(places.autopilot, COMPANION, &release), Some(ACCEPTED));

    let stopped = setpoints(&mut world, places);
    assert_eq!(stopped.iter().map(|(_, setpoint)| rates(setpoint)).collect::<Vec<_>>(), [[0.0, 0.0]]);
}

/// a rate stops "when its sender's heartbeat is lost", also where commands are allowed to turn for ever and nobody
/// holds control.
#[test]
fn a_rate_without_end_ends_when_its_sender_is_gone() {
    let control = ControlSettings { command_rate_timeout: std::time::Duration::ZERO, ..ControlSettings::default() };
    let (mut world, places) = with_gimbal_that(usual_capabilities(), Settings { control, ..three_links() });
    look(&mut world, places, 0.0, 0.0);
    let rate = pitchyaw(NAN, NAN, 0.0, 20.0, 44.0);
    assert_eq!(world.result_of(places.autopilot, COMPANION, &rate), Some(ACCEPTED));
    run_looking(&mut world, places, 9 * SECOND, 0.0, 0.0);
    assert!(setpoints(&mut world, places).iter().all(|(_, setpoint)| rates(setpoint)[1] > 0.3));

    run_looking(&mut world, places, 2 * SECOND, 0.0, 0.0);

    let last = setpoints(&mut world, places).pop().expect("it is held").1;
    assert!(rates(&last)[1].is_nan() || rates(&last)[1] == 0.0, "{last:?}");
}

/// D9: the gimbal does not tell the heading for a while, and the autopilot's is another: the camera stays where it is.
#[test]
fn d9_another_source_of_the_heading_moves_nothing() {
    let (mut world, places) = with_gimbal();
    world.send(places.autopilot, AUTOPILOT, &px4_heartbeat());
    let status = |world: &World, heading_deg: Option<f32>| {
        let mut status = device_status(world.now, 44, 0.0, 30.0);
        status.delta_yaw = heading_deg.map_or(f32::NAN, f32::to_radians);
        MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(status)
    };
    let state = |world: &World| {
        let state = crate::support::script::autopilot_state(world.now, MavId::new(0, 0), 90.0);
        MavMessage::AUTOPILOT_STATE_FOR_GIMBAL_DEVICE(state)
    };
    world.send(places.autopilot, AUTOPILOT, &state(&world));
    world.send(places.gimbal, GIMBAL, &status(&world, Some(30.0)));
    let lock = pitchyaw(0.0, 60.0, NAN, NAN, 92.0);
    assert_eq!(world.result_of(places.ground, GCS, &lock), Some(ACCEPTED));
    world.forget();

    for heading_deg in [Some(30.0), None, None, None, Some(30.0)] {
        world.send(places.autopilot, AUTOPILOT, &state(&world));
        world.send(places.gimbal, GIMBAL, &status(&world, heading_deg));
        world.run_for(SECOND / 5);
        for (_, setpoint) in setpoints(&mut world, places) {
            assert_near(pitch_yaw_deg(setpoint.q).1, 30.0, 0.01);
        }
    }
}

/// D9: "the start of every ramp [is] the measured attitude".
#[test]
fn d9_a_ramp_begins_where_the_gimbal_is() {
    let (mut world, places) = with_gimbal();
    look(&mut world, places, 0.0, -90.0);
    let far = pitchyaw(0.0, 90.0, NAN, NAN, 44.0);
    assert_eq!(world.result_of(places.ground, GCS, &far), Some(ACCEPTED));
    run_looking(&mut world, places, SECOND / 2, 0.0, -80.0);
    world.forget();

    let back = pitchyaw(0.0, 0.0, NAN, 5.0, 44.0);
    assert_eq!(world.result_of(places.ground, GCS, &back), Some(ACCEPTED));

    let first = &setpoints(&mut world, places)[0].1;
    assert_near(pitch_yaw_deg(first.q).1, -80.0, 0.01);
}

/// D1 and the autopilot's restart under another system id: the gimbal that follows it keeps its manager. Until the one we
/// had is lost, it may be a second one.
#[test]
fn d1_a_gimbal_with_a_new_system_id_keeps_its_manager() {
    let (mut world, places) = with_gimbal();
    let renamed = MavId::new(7, 154);
    let managed = |world: &World| {
        let gimbals = world.snapshot().gimbals;
        gimbals.iter().map(|gimbal| (gimbal.manager_component_id, gimbal.device.clone())).collect::<Vec<_>>()
    };
    world.send(places.gimbal, renamed, &gimbal_heartbeat());
    assert_eq!(managed(&world), [(191, Some("1/154".to_owned()))]);

    // Heard last 0.1 s before.
    let repeated = [(SECOND / 10, places.gimbal, renamed, gimbal_heartbeat())];
    world.run_with(29 * SECOND / 10, &repeated);
    assert_eq!(managed(&world), [(191, Some("1/154".to_owned()))]);
    world.run_with(SECOND / 5, &repeated);

    assert_eq!(managed(&world), [(191, Some("7/154".to_owned()))]);
}

/// Somebody elsewhere under the gimbal's id is not the gimbal: it is told nothing, and believed nothing.
#[test]
fn a_gimbal_is_where_it_was_heard_first() {
    let (mut world, places) = with_gimbal();
    look(&mut world, places, 0.0, 0.0);
    world.forget();

    world.send(places.ground, GIMBAL, &gimbal_heartbeat());
    let mut information = device_information(world.now, usual_capabilities());
    (information.pitch_min, information.pitch_max) = (-0.01, 0.01);
    world.send(places.ground, GIMBAL, &MavMessage::GIMBAL_DEVICE_INFORMATION(information));
    world.forget();
    assert_eq!(world.result_of(places.ground, GCS, &pitchyaw(-30.0, 0.0, NAN, NAN, 44.0)), Some(ACCEPTED));

    let setpoint: Setpoint = setpoints(&mut world, places)[0].1.clone();
    assert_near(pitch_yaw_deg(setpoint.q).0, -30.0, 0.01);
    // It may be that the gimbal has moved; when it is heard where it was, there are two.
    assert_eq!(world.snapshot().conflicts, [""; 0]);
    look(&mut world, places, 0.0, 0.0);
    assert!(world.snapshot().conflicts[0].contains("1/154 is heard in two places"), "{:?}", world.snapshot().conflicts);
}

/// D5: "Other vehicles' systems are routed, but never gate, latch or steer", also what they took before they were known
/// as such; and one stray heartbeat does not bar a ground station for ever.
#[test]
fn d5_another_vehicle_loses_what_it_took_and_bars_no_ground_station_when_it_is_gone() {
    let (mut world, places) = with_gimbal();
    let stranger = MavId::new(2, 192);
    let station = MavId::new(2, 190);
    let take = configure([-2.0, -2.0], [-1.0, -1.0]);
    assert_eq!(world.result_of(places.ground, stranger, &take), Some(ACCEPTED));

    world.send(places.ground, MavId::new(2, 1), &px4_heartbeat());
    assert_eq!(world.snapshot().gimbals[0].primary, None);
    world.send(places.ground, station, &ground_heartbeat());
    for sender in [stranger, station] {
        assert_eq!(world.result_of(places.ground, sender, &take), Some(DENIED), "{sender}");
    }

    run_looking(&mut world, places, 10 * SECOND, 0.0, 0.0);
    assert_eq!(world.result_of(places.ground, stranger, &take), Some(DENIED), "its vehicle may be out of earshot");
    assert_eq!(world.result_of(places.ground, station, &take), Some(ACCEPTED));
}

/// D5: "Other vehicles' systems are routed, but never gate, latch or steer", whether their autopilot beats where we hear it or
/// not; a ground station is none, whatever its ids.
#[test]
fn d5_a_silent_autopilot_of_another_system_is_another_vehicle() {
    let (mut world, places) = with_gimbal();
    look(&mut world, places, 0.0, 0.0);
    world.forget();
    let [other, old_station] = [MavId::new(2, 1), MavId::new(255, 1)];
    let take = configure([-2.0, -2.0], [-1.0, -1.0]);
    let angle = pitchyaw(-10.0, 10.0, NAN, NAN, 44.0);
    for demand in [&take, &angle] {
        assert_eq!(world.result_of(places.ground, other, demand), Some(DENIED));
    }
    world.send(places.ground, other, &set_pitchyaw(-0.2, 0.0, NAN, NAN, 44));
    world.run_for(SECOND);
    assert_eq!(world.snapshot().gimbals[0].rejected["2/1"]["other_vehicle"], 3);
    assert_eq!(setpoints(&mut world, places), []);

    world.send(places.ground, old_station, &ground_heartbeat());
    for sender in [old_station, GCS] {
        assert_eq!(world.result_of(places.ground, sender, &take), Some(ACCEPTED), "{sender}");
    }
}

/// Numbers that no gimbal can follow are refused before they are reckoned with.
#[test]
fn numbers_beyond_reason_are_refused() {
    let (mut world, places) = with_gimbal();
    look(&mut world, places, 0.0, 0.0);
    world.forget();
    for demand in [set_pitchyaw(0.0, -1e30, NAN, NAN, 44), set_pitchyaw(NAN, NAN, 0.0, 1e30, 44)] {
        world.send(places.ground, GCS, &demand);
    }
    assert_eq!(world.result_of(places.ground, GCS, &pitchyaw(NAN, NAN, 0.0, 3e38, 44.0)), Some(DENIED));
    world.run_for(SECOND);
    assert_eq!(setpoints(&mut world, places), []);
    let rejected = &world.snapshot().gimbals[0].rejected["255/190"];
    assert_eq!((rejected["angle_out_of_range"], rejected["rate_out_of_range"]), (1, 2));
}

fn turn(rate: f32) -> MavMessage {
    let [pitch, yaw] = NO_ANGLES;
    set_pitchyaw(pitch, yaw, 0.0, rate, 44)
}

fn rates(setpoint: &Setpoint) -> [f32; 2] {
    [setpoint.angular_velocity_y, setpoint.angular_velocity_z]
}
