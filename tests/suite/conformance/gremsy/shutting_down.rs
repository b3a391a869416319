//! A gimbal that is told to shut down: its silence is what was asked for, and nobody is alarmed.

use gimbald::bridge::settings::SystemId;
use gimbald::bridge::snapshot::EventSnapshot;
use gimbald::gimbals::operation::Restart;
use gimbald::manager::asked::NotDone;
use gimbald::manager::request::Refusal;
use gimbald::wire::dialect::{HEARTBEAT_DATA, MessageData, STATUSTEXT_DATA};
use gimbald::wire::ids::{CommandResult, severity};

use super::*;

/// With the family in the configuration, and found out.
fn gremsies() -> impl Iterator<Item = (World, Places)> {
    [Generation::V1, Generation::V2].into_iter().flat_map(|generation| {
        let configured = running(generation);
        let (mut world, places) = World::empty(Settings {
            gimbals: vec![GimbalSettings::found("camera".to_owned())],
            system_id: SystemId::Fixed(1),
            ..three_links()
        });
        world.install(places.autopilot, Vehicle::new(Timestamp::ZERO, VehicleSettings::default()));
        world.install(places.gimbal, Device::new(Timestamp::ZERO, device(generation)));
        run(&mut world, places, 22 * SECOND);
        world.forget();
        [configured, (world, places)]
    })
}

fn shut_down(world: &mut World, places: Places) {
    take_control(world);
    let id = world.ask_by_name("camera", &Asked::Operation(Operation::Restart(Restart::Shutdown)));
    run(world, places, SECOND);
    assert!(world.answers.contains(&(id, Ok(()))), "{:?}", world.answers);
}

fn state_and_stage(world: &World) -> (String, String) {
    let seen = seen(world);
    (seen.state, seen.details.stage.expect("a stage"))
}

fn is(state: &str, stage: &str) -> (String, String) {
    (state.to_owned(), stage.to_owned())
}

/// Events since the gimbal was found, the oldest first, but for those of control.
fn events(world: &World) -> Vec<EventSnapshot> {
    let mut events = world.snapshot().events;
    events.retain(|event| !["gimbal_found", "taken", "lapsed", "refused"].contains(&event.what.as_str()));
    events.reverse();
    events
}

fn names(events: &[EventSnapshot]) -> Vec<&str> {
    events.iter().map(|event| event.what.as_str()).collect()
}

/// What stands on the ground station's screen since this was last asked.
fn texts(world: &mut World, places: Places) -> Vec<(u8, String)> {
    let arrivals = world.take(places.ground);
    let texts = arrivals.iter().filter(|arrival| arrival.id() == STATUSTEXT_DATA::ID);
    texts
        .map(|arrival| {
            let text: STATUSTEXT_DATA = arrival.decode();
            (text.severity, text.text.to_str().expect("plain text").to_owned())
        })
        .collect()
}

/// "Remember that it was told to shut down", so that status and events say so, no loss alarms the pilot, and "switched on
/// again it is found again as usual".
#[test]
fn a_gimbal_that_is_shut_down_is_not_lost() {
    for (mut world, places) in gremsies() {
        shut_down(&mut world, places);
        assert_eq!(state_and_stage(&world), is("alive", "shut_down"));
        run(&mut world, places, 5 * SECOND);
        assert_eq!(state_and_stage(&world), is("lost", "shut_down"));
        assert_eq!(seen(&world).condition(), "shut down");
        let told = events(&world);
        assert_eq!(names(&told), ["operated", "gimbal_shut_down"]);
        assert_eq!(told[1].text, "gimbal shut down, as it was asked to; it is back when it is switched on");
        assert_eq!(told[1].who.as_deref(), Some("1/154"));
        assert_eq!(texts(&mut world, places), [(severity::NOTICE, "camera: gimbal shut down".to_owned())]);

        // It stays so, and whoever asks is told why not.
        run(&mut world, places, 120 * SECOND);
        assert_eq!(state_and_stage(&world), is("lost", "shut_down"));
        let arrivals = world.arrivals(places.ground);
        let beats = arrivals.iter().filter(|arrival| arrival.id() == HEARTBEAT_DATA::ID && arrival.source() == MANAGER);
        let states: Vec<u8> = beats.map(|arrival| arrival.decode::<HEARTBEAT_DATA>().system_status).collect();
        assert!(states.len() >= 118 && states.iter().all(|state| *state == 3), "STANDBY: {states:?}");
        assert_eq!(texts(&mut world, places), []);
        let refusal = Refusal { result: CommandResult::Failed, reason: "gimbal_shut_down" };
        let refused = Some(Err(NotDone::Refused { refusal, holder: None }));
        assert_eq!(ask(&mut world, places, &Asked::Neutral), refused);
        assert_eq!(names(&events(&world)), ["operated", "gimbal_shut_down"]);
        world.forget();

        // Switched on, it starts as ever and is told nothing until somebody asks.
        world.reboot(places.gimbal);
        run(&mut world, places, 25 * SECOND);
        assert_eq!(state_and_stage(&world), is("alive", "running"));
        let told = events(&world);
        assert_eq!(names(&told), ["operated", "gimbal_shut_down", "gimbal_back", "gimbal_restarted", "gimbal_ready"]);
        assert_eq!(texts(&mut world, places), [(severity::NOTICE, "camera: gimbal is back".to_owned())]);
        assert_eq!(orders(&mut world, places), (vec![], vec![]));
        point(&mut world, -20.0, 10.0);
        run(&mut world, places, 4 * SECOND);
        assert_looks(&world, -20.0, 10.0);

        // What was asked for once excuses no loss later.
        world.remove(places.gimbal);
        run(&mut world, places, 6 * SECOND);
        assert_eq!(state_and_stage(&world), is("lost", "searching"));
        assert_eq!(seen(&world).condition(), "lost");
        assert_eq!(events(&world).last().map(|event| event.what.clone()).as_deref(), Some("gimbal_lost"));
        let texts = texts(&mut world, places);
        assert_eq!(texts.last(), Some(&(severity::WARNING, "camera: gimbal lost".to_owned())));
    }
}

/// A serial adapter that goes with its gimbal: the port that closes is no alarm either.
#[test]
fn its_port_may_go_with_it() {
    for (mut world, places) in gremsies() {
        shut_down(&mut world, places);
        world.unplug(places.gimbal);
        run(&mut world, places, SECOND);
        assert_eq!(state_and_stage(&world), is("lost", "shut_down"));
        assert_eq!(names(&events(&world)), ["operated", "gimbal_shut_down"]);
        assert_eq!(texts(&mut world, places), [(severity::NOTICE, "camera: gimbal shut down".to_owned())]);
    }
}
