//! Clients that take control from one another for ever (peers.md F10).
//!
//! "After more than 5 take-overs of primary within 10 s, further take-overs are DENIED for 10 s with reason
//! `acquire_war`, the present holder stays; bounded logging; one event, one text."

use std::time::Duration;

use gimbald::bridge::snapshot::EventSnapshot;
use gimbald::gimbals::settings::Takeover;
use gimbald::timestamp::Timestamp;
use gimbald::wire::MavId;
use gimbald::wire::dialect::{COMMAND_ACK_DATA, GIMBAL_MANAGER_STATUS_DATA, MavMessage, STATUSTEXT_DATA};

use super::control_takeover::under;
use super::{SECOND, Setpoint};
use crate::support::script::{
    ACCEPTED, DENIED, NAN, configure, device_status, ground_heartbeat, of, px4_heartbeat, set_pitchyaw, take_control,
};
use crate::support::world::{AUTOPILOT, GCS, GIMBAL, Places, World};

const TABLET: MavId = MavId::new(254, 190);
const WARNING: u8 = 4;

/// Two ground stations that take control from each other ten times a second.
#[test]
fn the_sixth_take_over_in_ten_seconds_is_the_last_for_ten() {
    let (mut world, places) = under(Takeover::Open);
    assert_eq!(world.result_of(places.ground, GCS, &take_control()), Some(ACCEPTED));
    let mut takes = [TABLET, GCS].into_iter().cycle();
    let mut results = Vec::new();
    for _ in 0..10 {
        world.run_for(SECOND / 10);
        let taker = takes.next().expect("it goes round and round");
        results.push((taker, world.result_of(places.ground, taker, &take_control())));
    }
    // The sixth take-over gave it to GCS, which keeps it and may ask for it again.
    let expected = [
        (TABLET, Some(ACCEPTED)),
        (GCS, Some(ACCEPTED)),
        (TABLET, Some(ACCEPTED)),
        (GCS, Some(ACCEPTED)),
        (TABLET, Some(ACCEPTED)),
        (GCS, Some(ACCEPTED)),
        (TABLET, Some(DENIED)),
        (GCS, Some(ACCEPTED)),
        (TABLET, Some(DENIED)),
        (GCS, Some(ACCEPTED)),
    ];
    assert_eq!(results, expected);
    let (third, pilot) = (MavId::new(245, 191), world.snapshot().gimbals[0].primary.clone());
    assert_eq!(pilot, Some(GCS.to_string()));
    assert_eq!(world.result_of(places.ground, third, &take_control()), Some(DENIED), "a third one neither");
    let over = configure([-3.0, -3.0], [-1.0, -1.0]);
    assert_eq!(world.result_of(places.ground, GCS, &over), Some(ACCEPTED), "it may release");
    assert_eq!(world.result_of(places.ground, TABLET, &take_control()), Some(ACCEPTED), "and what is free is free");
}

/// The truce ends after ten seconds: "further take-overs are DENIED for 10 s".
#[test]
fn after_ten_seconds_control_may_be_taken_again() {
    let (mut world, places) = under(Takeover::Open);
    let began = fight(&mut world, places);
    let keep_alive = [(SECOND, places.ground, GCS, ground_heartbeat())];
    world.run_with(began + Duration::from_micros(9_999_999) - world.now, &keep_alive);
    assert_eq!(world.result_of(places.ground, TABLET, &take_control()), Some(DENIED));
    world.run_for(Duration::from_micros(1));
    assert_eq!(world.result_of(places.ground, TABLET, &take_control()), Some(ACCEPTED));
}

/// One event of the war and one of the refusals, whose counters go on; and one text.
#[test]
fn a_war_is_told_once() {
    let (mut world, places) = under(Takeover::Open);
    world.forget();
    fight(&mut world, places);
    for _ in 0..20 {
        world.run_for(SECOND / 10);
        world.send(places.ground, TABLET, &take_control());
        world.send(places.ground, GCS, &ground_heartbeat());
    }

    let events = |what: &str| -> Vec<EventSnapshot> {
        world.snapshot().events.into_iter().filter(|event| event.what == what).collect()
    };
    let war = events("acquire_war");
    assert_eq!(war.len(), 1);
    let (gcs, tablet) = (Some(GCS.to_string()), Some(TABLET.to_string()));
    assert_eq!((&war[0].who, &war[0].from, &war[0].to), (&gcs, &tablet, &gcs));
    let refused = events("refused");
    assert_eq!(refused.len(), 1);
    assert_eq!((&refused[0].who, &refused[0].from, refused[0].count), (&tablet, &gcs, 20));
    assert_eq!(world.snapshot().gimbals[0].rejected["254/190"]["acquire_war"], 20);
    let texts: Vec<STATUSTEXT_DATA> = of(&world.take(places.ground));
    let texts: Vec<(u8, &str)> =
        texts.iter().map(|text| (text.severity, text.text.to_str().expect("plain text"))).collect();
    assert_eq!(texts[texts.len() - 1], (WARNING, "camera: acquire war, 255/190 keeps control"));
    // And one for each of the two, who took control from the other.
    assert_eq!(texts.len(), 3, "{texts:?}");
}

/// "A PX4 client that re-acquires for ever must be survivable": it takes control twice a second with its own ids for as
/// long as a ground station takes it back, and control changes hands at most six times in any ten seconds. Every command
/// is answered; nothing jumps.
#[test]
fn an_autopilot_that_takes_control_for_ever_is_survived() {
    for policy in [Takeover::Open, Takeover::Ask, Takeover::Priority, Takeover::Exclusive] {
        let (mut world, places) = under(policy);
        assert_eq!(world.result_of(places.ground, GCS, &take_control()), Some(ACCEPTED));
        world.send(places.ground, GCS, &set_pitchyaw(-0.2, 0.3, NAN, NAN, 44));
        world.forget();
        let acquire = configure([1.0, 1.0], [-1.0, -1.0]);
        let status = device_status(world.now, 44, -0.2_f64.to_degrees(), 0.3_f64.to_degrees());
        let repeated = [
            (SECOND / 2, places.autopilot, AUTOPILOT, acquire),
            (SECOND / 4, places.ground, GCS, take_control()),
            (SECOND, places.autopilot, AUTOPILOT, px4_heartbeat()),
            (SECOND, places.ground, GCS, ground_heartbeat()),
            (SECOND / 10, places.gimbal, GIMBAL, MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(status)),
        ];

        world.run_with(Duration::from_secs(120), &repeated);

        let heard = world.take(places.ground);
        let told: Vec<(Timestamp, GIMBAL_MANAGER_STATUS_DATA)> =
            heard.iter().filter(|at| at.id() == 281).map(|at| (at.at, at.decode())).collect();
        let holder = |told: &GIMBAL_MANAGER_STATUS_DATA| (told.primary_control_sysid, told.primary_control_compid);
        let changes: Vec<Timestamp> =
            told.windows(2).filter(|pair| holder(&pair[0].1) != holder(&pair[1].1)).map(|pair| pair[1].0).collect();
        let densest = changes.windows(7).map(|seven| seven[6].since(seven[0])).min();
        assert!(densest.is_none_or(|seven| seven > Duration::from_secs(10)), "{policy:?}: {changes:?}");
        let protected = matches!(policy, Takeover::Priority | Takeover::Exclusive);
        assert_eq!(changes.is_empty(), protected, "{policy:?}");
        let acks: Vec<COMMAND_ACK_DATA> = of(&world.take(places.autopilot));
        assert_eq!(acks.iter().filter(|ack| ack.command == 1001).count(), 240, "{policy:?}: each is answered");
        let setpoints: Vec<Setpoint> = of(&world.take(places.gimbal));
        assert!(setpoints.len() > 2_000 && setpoints.windows(2).all(|pair| pair[0].q == pair[1].q), "{policy:?}");
        let texts = of::<STATUSTEXT_DATA>(&heard).len();
        assert!(texts <= 60, "{policy:?}: {texts} texts in two minutes");
    }
}

/// Two ground stations take control from each other until it stays with `GCS`; when.
fn fight(world: &mut World, places: Places) -> Timestamp {
    assert_eq!(world.result_of(places.ground, GCS, &take_control()), Some(ACCEPTED));
    for taker in [TABLET, GCS, TABLET, GCS, TABLET, GCS] {
        world.run_for(SECOND / 10);
        world.send(places.ground, taker, &take_control());
    }
    world.now
}
