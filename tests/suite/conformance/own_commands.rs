//! The commands that we send ourselves (protocol checklist 132 to 134; "When we are the sender").

use std::time::Duration;

use gimbald::timestamp::Timestamp;
use gimbald::wire::MavId;
use gimbald::wire::dialect::{COMMAND_LONG_DATA, MavMessage};

use crate::support::script::{
    ack, autopilot_state, device_information, device_status, gimbal_heartbeat, px4_heartbeat, set_interval,
    usual_capabilities,
};
use crate::support::world::{AUTOPILOT, Arrival, GCS, GIMBAL, MANAGER, Place, Places, World, three_links};

const SECOND: Duration = Duration::from_secs(1);

/// "When our own command gets no ACK, it is retried after 0.5 s with confirmation + 1, at most 3 times."
///
/// A gimbal that never answers is asked three times for faster attitudes, and again when it has been slow for another
/// 5 s, three times in all.
#[test]
fn item_132_a_command_without_an_answer_is_sent_again() {
    let (mut world, places) = with_slow_gimbal();
    world.run_with(30 * SECOND, &slow_status(places));

    let sent = requests(&world.take(places.gimbal));

    let mut expected = Vec::new();
    for start in [5_000, 10_000, 15_000] {
        for (confirmation, later) in [(0, 0), (1, 500), (2, 1_000)] {
            expected.push((Timestamp::from_millis(start + later), request(confirmation)));
        }
    }
    assert_eq!(sent, expected);
    for elsewhere in [places.autopilot, places.ground] {
        assert_eq!(requests(&world.take(elsewhere)), [], "it is sent to where the gimbal is");
    }
}

/// "When an ACK with target 0/0 arrives for our outstanding command, it is accepted." So is one to our whole system; what
/// the answer says does not matter.
#[test]
fn item_133_an_answer_to_everybody_is_accepted() {
    for to in [MavId::new(0, 0), MavId::new(1, 0), MANAGER] {
        for result in [0, 1, 2, 3, 4, 10, 200] {
            let (mut world, places) = with_slow_gimbal();
            world.run_with(Duration::from_millis(5_100), &slow_status(places));
            assert_eq!(requests(&world.take(places.gimbal)).len(), 1);

            world.send(places.gimbal, GIMBAL, &MavMessage::COMMAND_ACK(ack(to, 511, result)));

            world.run_with(20 * SECOND, &slow_status(places));
            assert_eq!(requests(&world.take(places.gimbal)), [], "answered {result} to {to}");
        }
    }
}

/// "When an ACK for somebody else arrives, it is forwarded and does not complete our transaction." Nor does one from
/// somebody else, or for another command.
#[test]
#[rustfmt::skip]
fn item_134_an_answer_for_somebody_else_is_forwarded_and_completes_nothing() {
    for (what,                  source,    to,                    command) in [
        ("for somebody else",   GIMBAL,    GCS,                   511),
        ("for another manager", GIMBAL,    MavId::new(1, 192),    511),
        ("to another system",   GIMBAL,    MavId::new(2, 0),      511),
        ("another command",     GIMBAL,    MANAGER,               512),
        ("from somebody else",  AUTOPILOT, MANAGER,               511),
        ("its neighbour",       MavId::new(1, 171), MANAGER,      511),
    ] {
        let (mut world, places) = with_slow_gimbal();
        world.send(places.ground, GCS, &crate::support::script::ground_heartbeat());
        world.run_with(Duration::from_millis(5_100), &slow_status(places));
        world.forget();
        let place = if source == AUTOPILOT { places.autopilot } else { places.gimbal };

        let answer = world.send(place, source, &MavMessage::COMMAND_ACK(ack(to, command, 0)));

        let forwarded = world.take(places.ground).iter().filter(|arrival| arrival.bytes == answer).count();
        assert_eq!(forwarded, usize::from(to == GCS), "{what}");
        world.run_with(2 * SECOND, &slow_status(places));
        let confirmations: Vec<u8> =
            requests(&world.take(places.gimbal)).into_iter().map(|(_, request)| request.confirmation).collect();
        assert_eq!(confirmations, [1, 2], "{what}");
    }
}

/// "1 outstanding command per (target, command id)": which message an answer is about can always be told, also when the
/// autopilot is slow to answer and answers every copy.
#[test]
fn requests_to_the_autopilot_follow_each_other() {
    let (mut world, places) = World::empty(three_links());
    let mut answers: Vec<(Timestamp, u8)> = Vec::new();
    let mut asked: Vec<(Timestamp, u32, u8)> = Vec::new();
    // It refuses 286 and nothing else, 700 ms after it was asked: it has then been asked twice.
    for _ in 0..1_200 {
        world.run_with(Duration::from_millis(10), &[]);
        if world.now.as_micros() % 1_000_000 == 0 {
            world.send(places.autopilot, AUTOPILOT, &px4_heartbeat());
            world.send(places.gimbal, GIMBAL, &gimbal_heartbeat());
        }
        for arrival in
            world.take(places.autopilot).iter().filter(|arrival| arrival.source() == MANAGER && arrival.id() == 76)
        {
            let request: COMMAND_LONG_DATA = arrival.decode();
            asked.push((arrival.at, request.param1 as u32, request.confirmation));
            answers.push((world.now + Duration::from_millis(700), if request.param1 == 286.0 { 2 } else { 0 }));
        }
        while let Some(at) = answers.iter().position(|(at, _)| *at <= world.now) {
            let (_, result) = answers.remove(at);
            world.send(places.autopilot, AUTOPILOT, &MavMessage::COMMAND_ACK(ack(MANAGER, 511, result)));
        }
    }

    let of_state: Vec<_> = asked.iter().filter(|(_, id, _)| *id == 286).collect();
    assert_eq!(of_state.len(), 2, "it is refused, and not asked for again: {asked:?}");
    let others = asked.iter().filter(|(_, id, confirmation)| *id != 286 && *confirmation == 0).count();
    assert!(others >= 3, "the others were not, and are: {asked:?}");
    let mut last: Option<(Timestamp, u32)> = None;
    for (at, id, _) in &asked {
        if let Some((before, other)) = last
            && other != *id
        {
            assert!(*at - before >= Duration::from_millis(1_200), "both copies are answered before: {asked:?}");
        }
        last = Some((*at, *id));
    }
}

/// A gimbal whose attitude comes once a second; an autopilot that sends all we want.
fn with_slow_gimbal() -> (World, Places) {
    let (mut world, places) = World::empty(three_links());
    world.send(places.autopilot, AUTOPILOT, &px4_heartbeat());
    world.send(places.gimbal, GIMBAL, &gimbal_heartbeat());
    let information = device_information(world.now, usual_capabilities());
    world.send(places.gimbal, GIMBAL, &MavMessage::GIMBAL_DEVICE_INFORMATION(information));
    world.forget();
    (world, places)
}

fn slow_status(places: Places) -> [(Duration, Place, MavId, MavMessage); 2] {
    let status = device_status(Timestamp::ZERO, 44, 0.0, 0.0);
    let state = autopilot_state(Timestamp::ZERO, MavId::new(0, 0), 0.0);
    [
        (SECOND, places.gimbal, GIMBAL, MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(status)),
        (SECOND / 2, places.autopilot, AUTOPILOT, MavMessage::AUTOPILOT_STATE_FOR_GIMBAL_DEVICE(state)),
    ]
}

/// `SET_MESSAGE_INTERVAL` as the slow gimbal gets it.
fn request(confirmation: u8) -> COMMAND_LONG_DATA {
    let MavMessage::COMMAND_LONG(request) = set_interval(GIMBAL, 285, 100_000.0) else { unreachable!() };
    COMMAND_LONG_DATA { confirmation, ..request }
}

fn requests(arrivals: &[Arrival]) -> Vec<(Timestamp, COMMAND_LONG_DATA)> {
    let commands = arrivals.iter().filter(|arrival| arrival.source() == MANAGER && arrival.id() == 76);
    let commands = commands.map(|arrival| (arrival.at, arrival.decode::<COMMAND_LONG_DATA>()));
    commands.filter(|(_, command)| command.command == 511 && command.param1 == 285.0).collect()
}
