//! What the autopilot tells gimbals (protocol checklist 8.10).

use std::time::Duration;

use gimbald::bridge::settings::{Settings, SystemId};
use gimbald::timestamp::Timestamp;
use gimbald::wire::MavId;
use gimbald::wire::dialect::{ATTITUDE_DATA, AUTOPILOT_STATE_FOR_GIMBAL_DEVICE_DATA, COMMAND_LONG_DATA, MavMessage};

use crate::support::script::{ack, autopilot_state, gimbal_heartbeat, px4_heartbeat};
use crate::support::world::{AUTOPILOT, Arrival, GIMBAL, MANAGER, Place, Places, World, three_links};

const SECOND: Duration = Duration::from_secs(1);
const STATE: u32 = 286;

/// "When 286 arrives on the AP link with target 0/0 or S/0, it appears on the gimbal link byte-identical within 5 ms."
#[test]
fn item_139_the_state_for_gimbals_reaches_the_gimbal_as_it_is() {
    for gimbal_is_known in [false, true] {
        let mut targets = vec![MavId::new(0, 0), MavId::new(1, 0)];
        if gimbal_is_known {
            targets.push(GIMBAL);
        }
        for target in targets {
            let (mut world, places) = World::empty(three_links());
            world.send(places.autopilot, AUTOPILOT, &px4_heartbeat());
            if gimbal_is_known {
                world.send(places.gimbal, GIMBAL, &gimbal_heartbeat());
            }
            world.forget();

            let state = autopilot_state(world.now, target, 45.0);
            let sent = world.send(places.autopilot, AUTOPILOT, &MavMessage::AUTOPILOT_STATE_FOR_GIMBAL_DEVICE(state));

            let heard: Vec<(Timestamp, Vec<u8>)> =
                world.take(places.gimbal).into_iter().map(|arrival| (arrival.at, arrival.bytes)).collect();
            assert_eq!(heard, [(world.now, sent)], "to {target}, gimbal known: {gimbal_is_known}");
            assert_eq!(world.take(places.autopilot), []);
        }
    }
}

/// "When no 286 is seen for 2 s and the device wants it, 511(286, ≤ 40000) is sent to S/1, at most every 5 s." A request
/// without an answer is sent three times, as every command of ours (132).
#[test]
fn item_140_a_missing_state_is_asked_for() {
    let (mut world, places) = World::empty(three_links());
    world.run_with(Duration::from_secs(30), &peers(places));

    let sent = state_requests(&mut world, places.autopilot);
    let asked: Vec<_> = sent.iter().filter(|(_, request)| request.confirmation == 0).collect();

    assert!(asked[0].0 >= Timestamp::from_secs(2) && asked[0].0 <= Timestamp::from_secs(3), "{asked:?}");
    assert!(asked.windows(2).all(|pair| pair[1].0 - pair[0].0 >= Duration::from_secs(5)), "{asked:?}");
    assert!(asked.len() >= 5, "it is asked for again: {asked:?}");
    let tries = |(at, request): &(Timestamp, COMMAND_LONG_DATA)| {
        [0, 1, 2].map(|confirmation| {
            let half_seconds = Duration::from_millis(500) * u32::from(confirmation);
            (*at + half_seconds, COMMAND_LONG_DATA { confirmation, ..request.clone() })
        })
    };
    assert_eq!(sent, asked.iter().flat_map(|request| tries(request)).collect::<Vec<_>>());
    for (_, request) in &sent {
        assert_eq!((request.target_system, request.target_component), (1, 1));
        assert!(request.param2 > 0.0 && request.param2 <= 40_000.0);
    }
    for elsewhere in [places.gimbal, places.ground] {
        assert_eq!(state_requests(&mut world, elsewhere), []);
    }
}

/// Protocol checklist 140 again, when the system id is found out first and the autopilot tells of everything but 286.
#[test]
fn item_140_a_missing_state_is_asked_for_once_the_system_id_is_settled() {
    let settings = Settings { system_id: SystemId::Auto, ..three_links() };
    let (mut world, places) = World::empty(settings);
    let attitude = ATTITUDE_DATA {
        time_boot_ms: 0,
        roll: 0.0,
        pitch: 0.0,
        yaw: 0.0,
        rollspeed: 0.0,
        pitchspeed: 0.0,
        yawspeed: 0.0,
    };
    let [autopilot, gimbal] = peers(places);
    let attitude = (SECOND / 10, places.autopilot, AUTOPILOT, MavMessage::ATTITUDE(attitude));

    world.run_with(Duration::from_secs(12), &[autopilot, gimbal, attitude]);

    let asked = state_requests(&mut world, places.autopilot);
    assert!(asked.first().is_some_and(|(at, _)| *at <= Timestamp::from_secs(7)), "{asked:?}");
}

/// Protocol checklist 140, the other way round: nothing is asked for while it comes, while no gimbal is there that could
/// want it, and after a refusal.
#[test]
fn item_140_a_state_that_comes_or_is_refused_or_not_wanted_is_not_asked_for() {
    let (mut world, places) = World::empty(three_links());
    let state = autopilot_state(Timestamp::ZERO, MavId::new(0, 0), 0.0);
    let state = (SECOND, places.autopilot, AUTOPILOT, MavMessage::AUTOPILOT_STATE_FOR_GIMBAL_DEVICE(state));
    let [autopilot, gimbal] = peers(places);
    world.run_with(Duration::from_secs(10), &[autopilot.clone(), gimbal.clone(), state]);
    assert_eq!(state_requests(&mut world, places.autopilot), [], "it comes");
    world.run_with(Duration::from_secs(4), &[autopilot.clone(), gimbal.clone()]);
    let asked = state_requests(&mut world, places.autopilot);
    assert_eq!(asked.iter().map(|(_, request)| request.confirmation).collect::<Vec<_>>(), [0, 1, 2], "it has stopped");

    let (mut world, places) = World::empty(three_links());
    world.run_with(Duration::from_secs(10), std::slice::from_ref(&autopilot));
    assert_eq!(state_requests(&mut world, places.autopilot), [], "nobody wants it");

    let (mut world, places) = World::empty(three_links());
    for _ in 0..300 {
        world.run_with(SECOND / 10, &[autopilot.clone(), gimbal.clone()]);
        let asked = world.take(places.autopilot);
        if asked.iter().any(is_state_request) {
            world.run_with(Duration::from_millis(20), &[]);
            world.send(places.autopilot, AUTOPILOT, &MavMessage::COMMAND_ACK(ack(MANAGER, 511, 2)));
            world.run_with(Duration::from_secs(30), &[autopilot, gimbal]);
            assert_eq!(state_requests(&mut world, places.autopilot), [], "it was refused");
            return;
        }
    }
    panic!("it was never asked for");
}

/// "When 286.angular_velocity_z is 0.0, HTTP reports unknown."
#[test]
fn item_141_a_yaw_rate_of_zero_is_unknown() {
    for (sent, shown) in [(0.25_f32, Some(0.25)), (0.0, None), (f32::NAN, None), (1e-5, Some(1e-5))] {
        let (mut world, places) = World::empty(three_links());
        world.send(places.autopilot, AUTOPILOT, &px4_heartbeat());
        let state = autopilot_state(world.now, MavId::new(0, 0), 0.0);
        let state = AUTOPILOT_STATE_FOR_GIMBAL_DEVICE_DATA { angular_velocity_z: sent, ..state };

        world.send(places.autopilot, AUTOPILOT, &MavMessage::AUTOPILOT_STATE_FOR_GIMBAL_DEVICE(state));

        let rate = world.snapshot().vehicle.yaw_rate_dps;
        assert_eq!(rate.is_some(), shown.is_some(), "{sent}");
        let same = rate.zip(shown).is_none_or(|(rate, shown): (f64, f64)| (rate.to_radians() - shown).abs() < 1e-8);
        assert!(same, "{rate:?} for {sent}");
    }
}

/// An autopilot and a gimbal that say that they are there, and no more.
fn peers(places: Places) -> [(Duration, Place, MavId, MavMessage); 2] {
    [(SECOND, places.autopilot, AUTOPILOT, px4_heartbeat()), (SECOND, places.gimbal, GIMBAL, gimbal_heartbeat())]
}

fn is_state_request(arrival: &Arrival) -> bool {
    arrival.id() == 76
        && arrival.source() == MANAGER
        && matches!(arrival.decode(), COMMAND_LONG_DATA { command: 511, param1, .. } if param1 == STATE as f32)
}

fn state_requests(world: &mut World, place: Place) -> Vec<(Timestamp, COMMAND_LONG_DATA)> {
    let heard = world.take(place);
    heard.iter().filter(|arrival| is_state_request(arrival)).map(|at| (at.at, at.decode())).collect()
}
