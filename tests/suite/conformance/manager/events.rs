//! What people are told: the events of the status, and the texts on a ground station's screen.
//!
//! "Every change and refusal an event with its reason, counted per sender …; STATUSTEXT to the pilot for what he must know
//! (gimbal lost or back, control borrowed, refused), rate-limited."

use std::time::Duration;

use gimbald::bridge::settings::{Settings, SystemId};
use gimbald::bridge::snapshot::EventSnapshot;
use gimbald::gimbals::settings::{GimbalSettings, Takeover};
use gimbald::manager::settings::ControlSettings;
use gimbald::wire::MavId;
use gimbald::wire::dialect::{GIMBAL_DEVICE_ATTITUDE_STATUS_DATA, MavMessage, STATUSTEXT_DATA};

use super::control_takeover::under;
use super::{COMPANION, SECOND, look, run_looking, with_gimbal, with_gimbal_that};
use crate::support::script::{
    ACCEPTED, DENIED, NAN, command_int, configure, device_information, device_status, gimbal_heartbeat,
    ground_heartbeat, pitchyaw, px4_heartbeat, set_pitchyaw, take_control, usual_capabilities,
};
use crate::support::world::{AUTOPILOT, Arrival, GCS, GIMBAL, MANAGER, World, three_links};

const TABLET: MavId = MavId::new(254, 190);
const WARNING: u8 = 4;
const NOTICE: u8 = 5;

/// "Every change of control (taken, released, lapsed, borrowed, restored, delegated, cleared, system gone) … is an event
/// with time, gimbal, who, what."
#[test]
#[rustfmt::skip]
fn every_change_of_control_is_an_event() {
    let (mut world, places) = under(Takeover::Open);
    let release = [-3.0, -3.0];
    let keep = [-1.0, -1.0];
    for (who,      primary,         secondary,       what,         place,       from,            to) in [
        (GCS,      [-2.0, -2.0],    keep,            "taken",      "primary",   None,            Some(GCS)),
        (COMPANION, keep,           [-2.0, -2.0],    "taken",      "secondary", None,            Some(COMPANION)),
        (TABLET,   [-2.0, -2.0],    keep,            "taken_over", "primary",   Some(GCS),       Some(TABLET)),
        (AUTOPILOT, [1.0, 1.0],     keep,            "borrowed",   "primary",   Some(TABLET),    Some(AUTOPILOT)),
        (AUTOPILOT, release,        keep,            "restored",   "primary",   Some(AUTOPILOT), Some(TABLET)),
        (TABLET,   [255.0, 190.0],  keep,            "delegated",  "primary",   Some(TABLET),    Some(GCS)),
        (GCS,      release,         keep,            "released",   "primary",   Some(GCS),       None),
        (AUTOPILOT, keep,           [0.0, 0.0],      "cleared",    "secondary", Some(COMPANION), None),
    ] {
        world.run_for(SECOND / 10);
        let from_where = if who.system == 1 { places.autopilot } else { places.ground };
        assert_eq!(world.result_of(from_where, who, &configure(primary, secondary)), Some(ACCEPTED));

        let name = |id: Option<MavId>| id.map(|id| id.to_string());
        let told = latest(&world);
        assert_eq!((told.what.as_str(), told.place.as_deref()), (what, Some(place)), "{}", told.text);
        assert_eq!((told.who, told.from, told.to, told.reason), (Some(who.to_string()), name(from), name(to), None));
        assert_eq!((told.gimbal.as_str(), told.age_ms, told.count), ("camera", 0, 1));
        assert_eq!(told.at_s, world.snapshot().uptime_s);
    }
}

/// The same of control that lapses, and of the control of another vehicle's component.
#[test]
fn control_that_is_lost_is_an_event() {
    let (mut world, places) = with_gimbal();
    assert_eq!(world.result_of(places.ground, GCS, &configure([-2.0, -2.0], [-1.0, -1.0])), Some(ACCEPTED));
    let taken = world.snapshot();
    world.run_for(SECOND * 4);
    let held = &world.snapshot().gimbals[0];
    assert_eq!((held.primary_age_ms, held.secondary_age_ms), (Some(4_000), None), "since when");
    world.run_for(SECOND * 6);
    let told = latest_of(&world, "lapsed");
    assert_eq!((told.who, told.from, told.to), (Some(GCS.to_string()), Some(GCS.to_string()), None));
    assert_eq!(told.at_s - taken.uptime_s, 10.0);

    let other = MavId::new(9, 192);
    assert_eq!(world.result_of(places.ground, other, &take_control()), Some(ACCEPTED));
    world.send(places.ground, MavId::new(9, 1), &px4_heartbeat());
    let told = latest(&world);
    assert_eq!((told.what.as_str(), told.who), ("system_gone", Some(other.to_string())));
}

/// "Every refusal is an event …; repeated refusals of the same sender and reason are coalesced with a count", and "a
/// steady non-owner stream (50 Hz 287) must not cause text storms": one text in ten seconds, to everybody but the gimbal.
#[test]
fn a_stream_that_is_refused_is_one_event_and_one_text_in_ten_seconds() {
    let (mut world, places) = with_gimbal();
    assert_eq!(world.result_of(places.ground, GCS, &take_control()), Some(ACCEPTED));
    let stream = set_pitchyaw(-0.5, 0.0, NAN, NAN, 44);
    let status = device_status(world.now, 44, 0.0, 0.0);
    let repeated = [
        (Duration::from_millis(20), places.autopilot, COMPANION, stream),
        (SECOND / 10, places.gimbal, GIMBAL, MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(status)),
        (SECOND, places.ground, GCS, ground_heartbeat()),
    ];
    world.forget();
    let began = world.now;

    world.run_with(Duration::from_secs(25), &repeated);

    for place in [places.ground, places.autopilot] {
        let heard = world.take(place);
        let texts: Vec<(Duration, u8, String)> =
            texts(&heard).into_iter().map(|(at, severity, text)| (at.since(began), severity, text)).collect();
        let text = "gimbal-154: 1/192 refused, 255/190 in control";
        let expected = [0, 10, 20].map(|secs| (Duration::from_secs(secs), NOTICE, text.to_owned()));
        assert_eq!(texts, expected);
    }
    assert_eq!(texts(&world.take(places.gimbal)), []);
    let told = latest(&world);
    assert_eq!((told.what.as_str(), told.reason.as_deref()), ("refused", Some("not_in_control")));
    assert_eq!((told.who, told.from, told.count), (Some(COMPANION.to_string()), Some(GCS.to_string()), 1_250));
    assert_eq!(
        (told.first_at_s, told.at_s),
        (began.as_secs_f64(), (began + Duration::from_millis(24_980)).as_secs_f64())
    );
    let refusals = world.snapshot().events.into_iter().filter(|event| event.what == "refused").count();
    assert_eq!(refusals, 1);
    assert_eq!(world.snapshot().gimbals[0].rejected["1/192"]["not_in_control"], 1_250, "the counters stay");
}

/// D24: "another's CONFIGURE is DENIED and shown to both": a text on every screen and an event that names both.
#[test]
fn who_is_asked_for_control_and_who_asks_are_told() {
    let (mut world, places) = under(Takeover::Ask);
    assert_eq!(world.result_of(places.ground, GCS, &take_control()), Some(ACCEPTED));
    world.forget();
    world.send(places.autopilot, COMPANION, &take_control());
    let text = (world.now, NOTICE, "camera: 1/192 asks 255/190 for control".to_owned());
    assert_eq!(texts(&world.take(places.ground)), std::slice::from_ref(&text));
    assert_eq!(texts(&world.take(places.autopilot)), [text]);
    let told = latest(&world);
    assert_eq!((told.who, told.from), (Some(COMPANION.to_string()), Some(GCS.to_string())));
    assert_eq!(told.reason.as_deref(), Some("holder_must_release"));
}

/// `takeover = "exclusive"`: "DENIED, without bothering the holder"; the event is there for who looks.
#[test]
fn an_exclusive_holder_is_told_nothing() {
    let (mut world, places) = under(Takeover::Exclusive);
    assert_eq!(world.result_of(places.ground, GCS, &take_control()), Some(ACCEPTED));
    assert_eq!(world.result_of(places.autopilot, COMPANION, &take_control()), Some(DENIED));
    assert_eq!(texts(&world.take(places.ground)), []);
    assert_eq!(latest(&world).reason.as_deref(), Some("exclusively_held"));
}

/// "Control borrowed / given back", "take-over by another".
#[test]
fn the_pilot_is_told_who_took_control() {
    let (mut world, places) = under(Takeover::Open);
    assert_eq!(world.result_of(places.ground, GCS, &take_control()), Some(ACCEPTED));
    assert_eq!(texts(&world.take(places.ground)), [], "who takes what is free disturbs nobody");
    for (from, who, says, text) in [
        (places.ground, TABLET, take_control(), "camera: 254/190 took control from 255/190"),
        (places.autopilot, AUTOPILOT, take_control(), "camera: autopilot borrowed control"),
        (
            places.autopilot,
            AUTOPILOT,
            configure([-3.0, -3.0], [-1.0, -1.0]),
            "camera: autopilot gave control back to 254/190",
        ),
    ] {
        world.run_for(SECOND);
        world.forget();
        world.send(from, who, &says);
        for place in [places.ground, places.autopilot] {
            assert_eq!(texts(&world.take(place)), [(world.now, NOTICE, text.to_owned())]);
        }
        assert_eq!(texts(&world.take(places.gimbal)), []);
    }
}

/// "Gimbal lost or back", and "gimbal found/lost/restarted/back" as events.
#[test]
fn the_pilot_is_told_that_the_gimbal_is_lost_and_back() {
    let (mut world, places) = with_gimbal();
    assert_eq!(latest(&world).what, "gimbal_found");
    let lost = world.now + SECOND * 29 / 10; // heard a tenth of a second ago
    world.run_for(SECOND * 5);
    let text = "gimbal-154: gimbal lost".to_owned();
    assert_eq!(texts(&world.take(places.ground)), [(lost, WARNING, text)]);
    assert_eq!(latest(&world).what, "gimbal_lost");

    world.send(places.gimbal, GIMBAL, &gimbal_heartbeat());
    let text = "gimbal-154: gimbal is back".to_owned();
    assert_eq!(texts(&world.take(places.ground)), [(world.now, NOTICE, text)]);
    assert_eq!(latest(&world).what, "gimbal_back");

    look(&mut world, places, 0.0, 0.0);
    let status = GIMBAL_DEVICE_ATTITUDE_STATUS_DATA { time_boot_ms: 10, ..device_status(world.now, 44, 0.0, 0.0) };
    world.send(places.gimbal, GIMBAL, &MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(status));
    assert_eq!(latest(&world).what, "gimbal_restarted");
}

/// A gimbal whose link flaps is said to be lost and back at most once in ten seconds each, and how it is in the end.
#[test]
fn a_gimbal_that_comes_and_goes_does_not_flood_the_pilot() {
    let (mut world, places) = with_gimbal();
    for _ in 0..8 {
        world.run_for(SECOND / 2);
        world.unplug(places.gimbal);
        world.run_for(SECOND / 2);
        world.plug_in(places.gimbal);
        world.send(places.gimbal, GIMBAL, &gimbal_heartbeat());
    }
    world.run_for(SECOND / 2);
    world.unplug(places.gimbal);
    world.run_for(SECOND * 15);
    let said: Vec<String> = texts(&world.take(places.ground)).into_iter().map(|(_, _, text)| text).collect();
    assert_eq!(said.len(), 3, "{said:?}");
    assert_eq!(said.last().map(String::as_str), Some("gimbal-154: gimbal lost"));
}

/// "Rates ended by time-out or lease, ROI started/ended."
#[test]
fn what_ends_by_itself_is_an_event() {
    let control = ControlSettings { command_rate_timeout: Duration::ZERO, ..ControlSettings::default() };
    let (mut world, places) = with_gimbal_that(usual_capabilities(), Settings { control, ..three_links() });
    world.send(places.ground, GCS, &set_pitchyaw(NAN, NAN, 0.1, 0.0, 44));
    run_looking(&mut world, places, SECOND * 3, 0.0, 0.0);
    let told = latest(&world);
    assert_eq!((told.what.as_str(), told.reason.as_deref()), ("rates_ended", Some("timed_out")));
    assert_eq!(told.who, Some(GCS.to_string()));

    assert_eq!(world.result_of(places.autopilot, COMPANION, &pitchyaw(NAN, NAN, 5.0, 0.0, 44.0)), Some(ACCEPTED));
    run_looking(&mut world, places, SECOND * 11, 0.0, 0.0);
    let told = latest(&world);
    assert_eq!((told.what.as_str(), told.reason.as_deref()), ("rates_ended", Some("sender_silent")));
    assert_eq!(told.who, Some(COMPANION.to_string()));

    let position = gimbald::wire::dialect::GLOBAL_POSITION_INT_DATA {
        time_boot_ms: 0,
        lat: 473_977_420,
        lon: 85_455_940,
        alt: 488_000,
        relative_alt: 0,
        vx: 0,
        vy: 0,
        vz: 0,
        hdg: 9_000,
    };
    world.send(places.autopilot, AUTOPILOT, &px4_heartbeat());
    world.send(places.autopilot, AUTOPILOT, &MavMessage::GLOBAL_POSITION_INT(position));
    let roi = command_int(MANAGER, 195, [NAN; 4], 473_977_500, 85_456_000, 0.0);
    assert_eq!(world.result_of(places.ground, GCS, &roi), Some(ACCEPTED));
    let told = latest(&world);
    assert_eq!((told.what.as_str(), told.who), ("roi_started", Some(GCS.to_string())));
    world.send(places.autopilot, COMPANION, &set_pitchyaw(0.0, 0.0, NAN, NAN, 44));
    let told = latest(&world);
    assert_eq!((told.what.as_str(), told.who), ("roi_ended", Some(COMPANION.to_string())));
}

/// "Bounded ring": however many are refused and however often, the latest 64 events are kept, and refusals never push out
/// all that happened to control.
#[test]
fn the_events_are_bounded() {
    let (mut world, places) = with_gimbal();
    assert_eq!(world.result_of(places.ground, GCS, &take_control()), Some(ACCEPTED));
    for sender in 0..200_u8 {
        let sender = MavId::new(20 + sender, 7);
        world.send(places.ground, sender, &set_pitchyaw(-0.5, 0.0, NAN, NAN, 44));
        world.send(places.ground, sender, &set_pitchyaw(9.0, 0.0, NAN, NAN, 44));
    }
    let whats = |world: &World| world.snapshot().events.into_iter().map(|event| event.what).collect::<Vec<_>>();
    assert_eq!(whats(&world).iter().filter(|what| *what == "refused").count(), 24);
    assert!(whats(&world).contains(&"taken".to_owned()));
    for _ in 0..100 {
        world.send(places.ground, GCS, &configure([-3.0, -3.0], [-1.0, -1.0]));
        world.send(places.ground, GCS, &take_control());
    }
    assert_eq!(whats(&world).len(), 64);
    let ids: Vec<u64> = world.snapshot().events.iter().map(|event| event.id).collect();
    assert!(ids.windows(2).all(|pair| pair[0] > pair[1]), "the latest first: {ids:?}");
}

/// "Never sent before the system id is settled": what happens until then is told to nobody.
#[test]
fn nothing_is_said_before_the_system_id_is_settled() {
    let gimbals = vec![GimbalSettings::found("camera".to_owned())];
    let (mut world, places) = World::empty(Settings { system_id: SystemId::Auto, gimbals, ..three_links() });
    world.send(places.gimbal, GIMBAL, &gimbal_heartbeat());
    let information = device_information(world.now, usual_capabilities());
    world.send(places.gimbal, GIMBAL, &MavMessage::GIMBAL_DEVICE_INFORMATION(information));
    world.send(places.ground, GCS, &take_control());
    world.send(places.ground, TABLET, &set_pitchyaw(0.0, 0.0, NAN, NAN, 44));
    world.run_for(Duration::from_millis(9_900));
    for place in [places.autopilot, places.gimbal, places.ground] {
        let of_ours: Vec<Arrival> = world.take(place).into_iter().filter(|at| at.source() == MANAGER).collect();
        assert_eq!(of_ours, []);
    }
    assert_eq!(world.snapshot().events, []);
}

/// The texts of our manager among what arrived: when, how severe, what. Each must fit one message.
fn texts(arrivals: &[Arrival]) -> Vec<(gimbald::timestamp::Timestamp, u8, String)> {
    let texts = arrivals.iter().filter(|arrival| arrival.id() == 253);
    texts
        .map(|arrival| {
            assert_eq!(arrival.source(), MANAGER);
            let text: STATUSTEXT_DATA = arrival.decode();
            assert_eq!((text.id, text.chunk_seq), (0, 0));
            (arrival.at, text.severity, text.text.to_str().expect("plain text").to_owned())
        })
        .collect()
}

fn latest(world: &World) -> EventSnapshot {
    world.snapshot().events.first().expect("something happened").clone()
}

fn latest_of(world: &World, what: &str) -> EventSnapshot {
    world.snapshot().events.into_iter().find(|event| event.what == what).expect("it happened")
}
