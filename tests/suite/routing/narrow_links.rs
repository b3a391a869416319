//! `max_rate_hz`: what a narrow radio gets of each message, and what of our own must reach it all the same.

use gimbald::bridge::Input;
use gimbald::bridge::settings::LinkSettings;
use gimbald::wire::dialect::{
    GIMBAL_DEVICE_SET_ATTITUDE_DATA, GIMBAL_MANAGER_INFORMATION_DATA, GIMBAL_MANAGER_STATUS_DATA, HEARTBEAT_DATA,
};

use super::*;
use crate::support::script::{
    command_long, gimbal_heartbeat, of, pitchyaw, request_message, set_interval, take_control,
};
use crate::support::world::{Arrival, GCS, GIMBAL, Places, three_links};

const SECOND: Duration = Duration::from_secs(1);
const STATUS: u32 = 281;

/// `max_rate_hz = { 285 = 4 }`: "what a narrow radio can carry, by message id".
#[test]
fn max_rate_hz_limits_one_message_on_one_link() {
    let mut ground = link("ground", Role::Ground, Transport::Datagrams);
    ground.max_rates.insert(285, Duration::from_millis(250));
    let links = vec![
        link("autopilot", Role::Autopilot, Transport::Datagrams),
        link("gimbal", Role::Gimbal, Transport::Datagrams),
        ground,
        link("radio", Role::Ground, Transport::Datagrams),
    ];
    let mut rig = Rig::with(Settings { system_id: SystemId::Fixed(1), links, ..Settings::default() });
    let mut received = (0, 0, 0);
    for _ in 0..200 {
        let status = rig.deliver_amid_ours("gimbal", &addressed(GIMBAL, 285, (0, 0)));
        received.0 += usize::from(status.contains(&"ground"));
        received.1 += usize::from(status.contains(&"radio"));
        let other = rig.deliver_amid_ours("gimbal", &broadcast(GIMBAL, 265));
        received.2 += usize::from(other.contains(&"ground"));
        rig.run_for(Duration::from_millis(20));
    }
    assert_eq!(received, (16, 200, 200));
    assert_eq!(rig.dropped("ground", "max_rate"), 184);
}

/// Each UDP peer of a link is a channel of its own, and none takes another's share.
#[test]
fn max_rate_hz_counts_for_each_peer() {
    let (mut world, places) = narrow(&[(STATUS, SECOND)]);
    let second = world.open(2);
    world.run_for(10 * SECOND);
    for place in [places.ground, second] {
        let count = world.take(place).iter().filter(|arrival| arrival.id() == STATUS).count();
        assert_eq!(count, 10);
    }
}

/// A change of control is told once, and that may be too soon after a regular status; it is told when its turn comes,
/// however long the next regular one is off.
#[test]
fn the_last_word_of_ours_is_not_lost_to_max_rate_hz() {
    let (mut world, places) = narrow(&[(STATUS, 2 * SECOND)]);
    world.send(places.ground, GCS, &set_interval(MANAGER, STATUS, -1.0));
    world.run_for(5 * SECOND);
    world.forget();
    let dropped = |world: &World| world.snapshot().links[2].dropped["max_rate"];
    let (at, dropped_before) = (world.now, dropped(&world));

    world.send(places.ground, GCS, &take_control());
    let changed = [255.0, 190.0, 1.0, 195.0, 0.0, 0.0, 154.0];
    world.send(places.ground, GCS, &command_long(MANAGER, 1001, &changed));
    world.send(places.ground, GCS, &command_long(MANAGER, 1001, &[-1.0, -1.0, 1.0, 196.0, 0.0, 0.0, 154.0]));
    world.run_for(9 * SECOND);

    let told: Vec<Arrival> = world.take(places.ground).into_iter().filter(|arrival| arrival.id() == STATUS).collect();
    let said: Vec<(Duration, u8, u8)> = told
        .iter()
        .map(|arrival| (arrival.at - at, arrival.decode::<GIMBAL_MANAGER_STATUS_DATA>()))
        .map(|(after, told)| (after, told.primary_control_compid, told.secondary_control_compid))
        .collect();
    assert_eq!(said, [(Duration::ZERO, 190, 0), (2 * SECOND, 190, 196)]);
    assert_eq!(dropped(&world), dropped_before + 1, "one gave way to a newer one");
    // And it has a number of its own.
    assert_ne!(told[0].bytes[4], told[1].bytes[4]);
}

/// `REQUEST_MESSAGE` is answered within a second, or a client gives up (client checklist E7, E13), and every command
/// has its answer.
#[test]
fn what_was_asked_for_is_not_limited_in_rate() {
    let (mut world, places) = narrow(&[(280, 100 * SECOND), (COMMAND_ACK, 100 * SECOND)]);
    for _ in 0..18 {
        let answers = world.ask(places.ground, GCS, &request_message(MANAGER, 280));
        assert_eq!(answers.iter().map(Arrival::id).collect::<Vec<_>>(), [COMMAND_ACK, 280]);
        assert_eq!(of::<GIMBAL_MANAGER_INFORMATION_DATA>(&answers).len(), 1);
        world.run_for(SECOND / 2);
    }
}

/// "On change of owner, loss of lease, stop and SIGTERM zero is sent at once" (D7): how often a link gets a message is nothing that
/// may keep a gimbal from being stopped.
#[test]
fn what_steers_a_gimbal_is_not_limited_in_rate() {
    let mut settings = three_links();
    settings.links[1].max_rates.extend([(284, 100 * SECOND), (285, 100 * SECOND)]);
    let (mut world, places) = World::with_one_gimbal(settings);
    let told = |world: &mut World| -> Vec<f32> {
        let told: Vec<GIMBAL_DEVICE_SET_ATTITUDE_DATA> = world.take_messages(places.gimbal);
        told.iter().map(|told| told.angular_velocity_z).collect()
    };
    let rate = |rate: f32| pitchyaw(f32::NAN, f32::NAN, 0.0, rate, 44.0);
    assert_eq!(world.result_of(places.ground, GCS, &rate(10.0)), Some(0));
    world.run_for(SECOND);
    let turning = told(&mut world);
    assert!(turning.len() >= 20 && turning.iter().all(|rate| *rate > 0.1), "{turning:?}");

    assert_eq!(world.result_of(places.ground, GCS, &rate(0.0)), Some(0));
    assert_eq!(told(&mut world), [0.0], "at once");
    assert!(!world.snapshot().links[1].dropped.contains_key("max_rate"));
}

/// A goodbye is said at once.
#[test]
fn the_goodbye_is_not_limited_in_rate() {
    let (mut world, places) = narrow(&[(HEARTBEAT, 100 * SECOND)]);
    world.run_for(3 * SECOND);
    world.forget();

    world.input(Input::Shutdown);

    let beats: Vec<HEARTBEAT_DATA> = world.take_messages(places.ground);
    assert_eq!(beats.iter().map(|beat| beat.system_status).collect::<Vec<_>>(), [7]);
    assert!(world.bridge.is_finished());
}

/// What waits for its turn when our system id changes is not said under the former one.
#[test]
fn nothing_of_a_former_system_id_waits_for_its_turn() {
    let (mut world, places) =
        World::empty(Settings { system_id: SystemId::Auto, ..narrow_ground(&[(STATUS, 5 * SECOND)]) });
    let autopilot = |system| (SECOND, places.autopilot, MavId::new(system, 1), heartbeat(2, 12));
    let gimbal = (SECOND, places.gimbal, MavId::new(7, 154), gimbal_heartbeat());
    world.run_with(10 * SECOND, &[autopilot(7), gimbal.clone()]);
    world.run_with(12 * SECOND, &[autopilot(8), gimbal]);

    assert_eq!(world.snapshot().system_id, Some(8));
    let told: Vec<Arrival> = world.take(places.ground).into_iter().filter(|at| at.source().component == 191).collect();
    let systems: Vec<u8> = told.iter().map(|arrival| arrival.source().system).collect();
    assert!(systems.is_sorted() && systems.first() == Some(&7) && systems.last() == Some(&8), "{systems:?}");
}

fn narrow_ground(limits: &[(u32, Duration)]) -> Settings {
    let mut settings = three_links();
    let LinkSettings { max_rates, .. } = &mut settings.links[2];
    max_rates.extend(limits.iter().copied());
    settings
}

/// A world whose ground link gets each of these messages once in that time.
fn narrow(limits: &[(u32, Duration)]) -> (World, Places) {
    World::with_one_gimbal(narrow_ground(limits))
}
