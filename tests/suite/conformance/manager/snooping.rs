//! Commands to the autopilot that pass through us (`snoop_autopilot`): what they ask of a gimbal is done, never answered,
//! and goes on to the autopilot as it came.

use gimbald::bridge::settings::Settings;
use gimbald::manager::settings::ControlSettings;
use gimbald::wire::MavId;
use gimbald::wire::dialect::MavMessage;

use super::frames::turn_vehicle;
use super::{
    COMPANION, FIELD, SECOND, Setpoint, assert_near, fly, is_nan, look, only_setpoint, setpoints, with_gimbal,
    with_gimbal_that,
};
use crate::support::script::{
    NAN, ardupilot_heartbeat, command_int, command_long, configure, device_status, in_frame, mount_configure,
    mount_control, pitch_yaw_deg, pitchyaw, px4_heartbeat, roi_location, take_control, to, usual_capabilities,
};
use crate::support::world::{AUTOPILOT, GCS, GIMBAL, MANAGER, Places, World, heartbeat, three_links};

/// QGroundControl's "ROI at location" and its end, as it sends them to each autopilot.
/// Client checklist E118: "195 addressed to component 1: no ACK from M. With the 'listen in' option on: obeyed, still no
/// ACK." Client checklist E26: "Any command addressed to another component: no answer, no effect, with default
/// configuration."
#[test]
fn client_items_e26_and_e118_a_place_for_the_autopilot_is_looked_at() {
    let place =
        |frame, altitude| in_frame(frame, command_int(AUTOPILOT, 195, [NAN; 4], 473_987_420, 85_465_940, altitude));
    for (autopilot, command, amsl) in [
        // ArduPilot: relative to home, 0 on a click on the map.
        (ardupilot_heartbeat(), place(3, 0.0), 400.0),
        // PX4: above the sea, from a terrain query.
        (px4_heartbeat(), place(0, 388.0), 388.0),
        // Without COMMAND_INT.
        (px4_heartbeat(), command_long(AUTOPILOT, 195, &[NAN, NAN, NAN, NAN, 47.4, 8.5, 388.0]), 388.0),
        (ardupilot_heartbeat(), command_long(AUTOPILOT, 201, &[3.0, 0.0, 0.0, 0.0, 47.4, 8.5, 10.0]), 410.0),
    ] {
        for snooping in [true, false] {
            let (mut world, places) = flying(snooping);
            world.send(places.autopilot, AUTOPILOT, &autopilot);
            passes_unanswered(&mut world, places, &command);
            let roi = world.snapshot().gimbals[0].roi.as_ref().map(|roi| roi.altitude_amsl_m);
            assert_eq!(roi, snooping.then_some(amsl), "{command:?}");
            assert_eq!(setpoints(&mut world, places).len(), usize::from(snooping));

            let cancel = in_frame(0, command_int(AUTOPILOT, 197, [NAN; 4], i32::MAX, i32::MIN, NAN));
            passes_unanswered(&mut world, places, &cancel);
            assert_eq!(world.snapshot().gimbals[0].roi, None);
            assert_eq!(setpoints(&mut world, places).len(), usize::from(snooping));
        }
    }
    // DO_SET_ROI with MAV_ROI_NONE, and what it may be besides.
    let (mut world, places) = flying(true);
    passes_unanswered(&mut world, places, &place(0, 388.0));
    for (kind, ends) in [(1.0, false), (2.0, false), (4.0, false), (9.0, false), (NAN, false), (0.0, true)] {
        world.forget();
        passes_unanswered(&mut world, places, &command_long(AUTOPILOT, 201, &[kind, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0]));
        assert_eq!(world.snapshot().gimbals[0].roi.is_none(), ends, "{kind}");
    }
    assert_eq!(world.snapshot().gimbals[0].rejected.len(), 0, "what is somebody else's business is not refused");
}

/// QGroundControl 4.4.0 says everything to component 1, and names our device: acquire, angles with rates of 0, neutral, lock
/// by NaN in everything.
#[test]
fn everything_that_old_ground_stations_say_to_the_autopilot_is_done() {
    let (mut world, places) = flying(true);
    look(&mut world, places, 0.0, 15.0);
    let own = configure([255.0, 190.0], [-1.0, -1.0]);
    passes_unanswered(&mut world, places, &to(AUTOPILOT, own));
    assert_eq!(world.snapshot().gimbals[0].primary.as_deref(), Some("255/190"));

    let said = |pitch, yaw, rate, flags| to(AUTOPILOT, pitchyaw(pitch, yaw, rate, rate, flags));
    passes_unanswered(&mut world, places, &said(-30.0, 10.0, 0.0, 12.0));
    let (pitch, yaw) = pitch_yaw_deg(only_setpoint(&mut world, places).q);
    assert_near(pitch, -30.0, 0.001);
    assert_near(yaw, 10.0, 0.001);

    // Lock and follow: the picture stays.
    for flags in [16.0, 0.0] {
        passes_unanswered(&mut world, places, &said(NAN, NAN, NAN, flags));
        let (pitch, yaw) = pitch_yaw_deg(only_setpoint(&mut world, places).q);
        assert_near(pitch, -30.0, 0.001);
        assert_near(yaw, 10.0, 0.001);
    }
    passes_unanswered(&mut world, places, &said(NAN, NAN, NAN, 2.0));
    let neutral: Setpoint = only_setpoint(&mut world, places);
    assert!(neutral.flags & 2 != 0 && is_nan(&neutral.q));

    let release = configure([-3.0, -3.0], [-1.0, -1.0]);
    passes_unanswered(&mut world, places, &to(AUTOPILOT, release));
    assert_eq!(world.snapshot().gimbals[0].primary, None);
}

/// The mount commands of v1 (MAVProxy's `gimbal` module, MAVSDK 1.4 without a manager).
#[test]
fn mount_commands_to_the_autopilot_are_done() {
    let (mut world, places) = flying(true);
    for (command, flags) in [
        (command_long(AUTOPILOT, 205, &[-20.0, 0.0, 10.0, 0.0, 0.0, 0.0, 2.0]), 44),
        (command_long(AUTOPILOT, 204, &[1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0]), 2 | 44),
        (command_int(AUTOPILOT, 205, [NAN; 4], 0, 0, 0.0), 1 | 44),
        (command_long(AUTOPILOT, 220, &[1.0, 0.0, 0.0, 0.0]), 44),
        (mount_configure(AUTOPILOT, 1), 2 | 44),
        (mount_configure(AUTOPILOT, 0), 1 | 44),
    ] {
        passes_unanswered(&mut world, places, &command);
        assert_eq!(only_setpoint(&mut world, places).flags, flags, "{command:?}");
    }
    // The messages that are older than the commands.
    passes_unanswered(&mut world, places, &mount_configure(AUTOPILOT, 2));
    assert_eq!(setpoints(&mut world, places), [], "to configure moves nothing");
    passes_unanswered(&mut world, places, &mount_control(AUTOPILOT, [-2_000, 0, 1_000]));
    let (pitch, yaw) = pitch_yaw_deg(only_setpoint(&mut world, places).q);
    assert_near(pitch, -20.0, 0.001);
    assert_near(yaw, 10.0, 0.001);
    // Without the option they are the autopilot's alone.
    let (mut world, places) = flying(false);
    passes_unanswered(&mut world, places, &mount_control(AUTOPILOT, [-2_000, 0, 1_000]));
    passes_unanswered(&mut world, places, &mount_configure(AUTOPILOT, 1));
    assert_eq!(setpoints(&mut world, places), []);
}

/// The same gate as ever: what somebody else says while the gimbal is held moves nothing, and is counted.
#[test]
fn what_is_overheard_passes_the_gate() {
    let (mut world, places) = flying(true);
    world.send(places.ground, COMPANION, &take_control());
    world.forget();
    for command in
        [to(AUTOPILOT, roi_location(0, [47.5, 8.5], 400.0)), to(AUTOPILOT, pitchyaw(-9.0, 0.0, NAN, NAN, 44.0))]
    {
        passes_unanswered(&mut world, places, &in_all_gimbals(command));
    }
    assert_eq!(setpoints(&mut world, places), []);
    assert_eq!(world.snapshot().gimbals[0].rejected["255/190"]["not_in_control"], 2);
}

/// Not for us: a gimbal of the autopilot's own, by id or by none in the commands that have ids for it; commands to another
/// vehicle; requests for messages and whatever else is said to the autopilot.
#[test]
fn what_is_not_meant_for_our_gimbal_is_not_done() {
    let (mut world, places) = flying(true);
    let stranger = MavId::new(2, 1);
    world.send(places.autopilot, stranger, &px4_heartbeat());
    world.forget();
    let angles = |id: f32| command_long(AUTOPILOT, 1000, &[-30.0, 0.0, NAN, NAN, 44.0, NAN, id]);
    let take = |id: f32| command_long(AUTOPILOT, 1001, &[-2.0, -2.0, -1.0, -1.0, NAN, NAN, id]);
    for command in [
        angles(1.0),
        angles(0.0),
        angles(NAN),
        angles(171.0),
        angles(0.5),
        take(1.0),
        take(0.0),
        command_long(AUTOPILOT, 195, &[1.0, NAN, NAN, NAN, 47.4, 8.5, 400.0]),
        to(stranger, roi_location(0, [47.5, 8.5], 400.0)),
        to(stranger, pitchyaw(-9.0, 0.0, NAN, NAN, 44.0)),
        command_long(AUTOPILOT, 512, &[280.0]),
        command_long(AUTOPILOT, 198, &[1.0]),
        command_long(AUTOPILOT, 196, &[]),
        command_long(AUTOPILOT, 400, &[1.0]),
    ] {
        passes_unanswered(&mut world, places, &command);
        assert_eq!(setpoints(&mut world, places), [], "{command:?}");
    }
    let gimbal = &world.snapshot().gimbals[0];
    assert_eq!((gimbal.roi.clone(), gimbal.primary.clone(), gimbal.rejected.len()), (None, None, 0));
}

/// Only what passes through us: not what the autopilot says itself, nor what comes from where the autopilot is, nor what
/// another vehicle says.
#[test]
fn what_does_not_pass_through_us_is_not_done() {
    let place = to(AUTOPILOT, in_all_gimbals(roi_location(0, [47.5, 8.5], 400.0)));
    let beside = MavId::new(1, 100);
    let (mut world, places) = flying(true);
    for sender in [AUTOPILOT, beside, GCS] {
        world.forget();
        world.send(places.autopilot, sender, &place);
        assert_eq!(world.snapshot().gimbals[0].roi, None, "{sender} beside the autopilot");
        assert_eq!(setpoints(&mut world, places), []);
    }
    // The autopilot's name elsewhere is not the autopilot.
    let (mut world, places) = flying(true);
    world.send(places.ground, AUTOPILOT, &place);
    assert_eq!(world.snapshot().gimbals[0].roi, None);
    // Another vehicle has no say.
    let stranger = MavId::new(2, 1);
    world.send(places.ground, stranger, &px4_heartbeat());
    world.send(places.ground, stranger, &place);
    assert_eq!(world.snapshot().gimbals[0].roi, None);
    // Nor has anybody while there is no autopilot.
    let control = ControlSettings { snoop_autopilot: true, ..ControlSettings::default() };
    let (mut world, places) = with_gimbal_that(usual_capabilities(), Settings { control, ..three_links() });
    world.send(places.ground, GCS, &to(AUTOPILOT, pitchyaw(-9.0, 0.0, NAN, NAN, 44.0)));
    assert_eq!(setpoints(&mut world, places), []);
}

/// What is said to us is answered as ever, and a component that only looks like an autopilot is none.
#[test]
fn what_is_said_to_us_is_answered_as_ever() {
    let (mut world, places) = flying(true);
    let command = pitchyaw(-9.0, 0.0, NAN, NAN, 44.0);
    assert_eq!(world.result_of(places.ground, GCS, &command), Some(crate::support::script::ACCEPTED));
    let camera = MavId::new(1, 100);
    world.send(places.autopilot, camera, &heartbeat(30, 8));
    world.forget();
    world.send(places.ground, GCS, &to(camera, roi_location(0, [47.5, 8.5], 400.0)));
    assert_eq!(world.snapshot().gimbals[0].roi, None);
}

/// What everybody is told of changes: `GIMBAL_MANAGER_STATUS` and `STATUSTEXT`.
const NEWS: [u32; 2] = [281, 253];

/// Says it to the autopilot, which gets it byte for byte; nobody hears an answer of ours, only news.
fn passes_unanswered(world: &mut World, places: Places, command: &MavMessage) {
    world.forget();
    let sent = world.send(places.ground, GCS, command);
    let heard = world.arrivals(places.autopilot);
    let forwarded: Vec<&[u8]> =
        heard.iter().filter(|arrival| arrival.source() == GCS).map(|arrival| &arrival.bytes[..]).collect();
    assert_eq!(forwarded, [&sent[..]], "{command:?}");
    for place in [places.ground, places.autopilot] {
        let ours = world.take(place).into_iter().filter(|arrival| arrival.source() == MANAGER);
        let ours: Vec<u32> = ours.map(|arrival| arrival.id()).collect();
        assert!(ours.iter().all(|id| NEWS.contains(id)), "{command:?} was answered: {ours:?}");
    }
    assert!(world.arrivals(places.gimbal).iter().all(|arrival| arrival.id() != 75 && arrival.id() != 76));
}

/// The gimbal takes yaw from North, so that nothing turns on a heading.
fn flying(snoop_autopilot: bool) -> (World, Places) {
    let control = ControlSettings { snoop_autopilot, ..ControlSettings::default() };
    let (mut world, places) = with_gimbal_that(usual_capabilities(), Settings { control, ..three_links() });
    fly(&mut world, places, FIELD, 0.0);
    let status = device_status(world.now, 44, 0.0, 0.0);
    world.send(places.gimbal, GIMBAL, &MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(status));
    world.run_for(SECOND / 10);
    world.forget();
    (world, places)
}

/// Without an id, as QGroundControl sends it, where it is a region of interest.
fn in_all_gimbals(command: MavMessage) -> MavMessage {
    match command {
        MavMessage::COMMAND_INT(mut command) => {
            command.param1 = NAN;
            MavMessage::COMMAND_INT(command)
        }
        other => other,
    }
}

/// The option is off unless somebody sets it.
#[test]
fn nothing_is_overheard_unless_configured() {
    let (mut world, places) = with_gimbal();
    turn_vehicle(&mut world, places, 0.0);
    world.send(places.ground, GCS, &to(AUTOPILOT, pitchyaw(-9.0, 0.0, NAN, NAN, 44.0)));
    assert_eq!(setpoints(&mut world, places), []);
}
