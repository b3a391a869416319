//! Parameters of gimbals of which only the protocol is known: "The daemon can read, cache and set a gimbal's parameters itself,
//! with retry", as it is asked for over HTTP and on the command line, of the simulated gimbals of both versions of the gimbal
//! protocol, in simulated time. Those of a Gremsy are in `gremsy/`.

use std::collections::BTreeMap;
use std::time::Duration;

use gimbald::actions::Action;
use gimbald::bridge::settings::Settings;
use gimbald::gimbals::gremsy::sim as gremsy;
use gimbald::gimbals::gremsy::version::FirmwareVersion;
use gimbald::gimbals::mavlink_v1::sim as v1;
use gimbald::gimbals::mavlink_v2::sim as v2;
use gimbald::gimbals::operation::{OperationError, OperationId};
use gimbald::gimbals::settings::{Family, GimbalSettings};
use gimbald::manager::asked::{Answer, NotDone};
use gimbald::sim::faults::{Faults, FaultyPeer};
use gimbald::sim::peer::Peer;
use gimbald::sim::vehicle::{Vehicle, VehicleSettings};
use gimbald::timestamp::Timestamp;
use gimbald::wire::dialect::{
    CharArray, MavMessage, PARAM_REQUEST_LIST_DATA, PARAM_REQUEST_READ_DATA, PARAM_SET_DATA, PARAM_VALUE_DATA,
};
use gimbald::wire::{DatagramFrames, MavId};

use crate::support::interception::{Intercepted, Interceptor, Passage};
use crate::support::script::{device_information, ground_heartbeat, usual_capabilities};
use crate::support::world::{AUTOPILOT, GCS, GIMBAL, MANAGER, Places, World, three_links};

const SECOND: Duration = Duration::from_secs(1);
const BOTH: [Family; 2] = [Family::MavlinkV1, Family::MavlinkV2];

/// `PARAM_REQUEST_READ`, `PARAM_REQUEST_LIST`, `PARAM_VALUE`, `PARAM_SET`.
const PROTOCOL: std::ops::RangeInclusive<u32> = 20..=23;

fn v1_gimbal() -> v1::Device {
    v1::Device::new(Timestamp::ZERO, v1::DeviceSettings::default())
}

fn v2_gimbal() -> v2::Device {
    v2::Device::new(Timestamp::ZERO, v2::DeviceSettings::default())
}

fn with_gimbal(family: Family) -> (World, Places) {
    match family {
        Family::MavlinkV1 => with(family, v1_gimbal()),
        _ => with(family, v2_gimbal()),
    }
}

/// What the simulated gimbal has.
fn expected(family: Family) -> BTreeMap<String, f64> {
    let limits = [("SIM_TILT_MAX", most_tilt(family)), ("SIM_TILT_MIN", -90.0)];
    let of_a_device = [("SIM_COMP_ID", 154.0), ("SIM_RATE_MAX", 100.0)];
    let others = of_a_device.into_iter().filter(|_| family == Family::MavlinkV2);
    limits.into_iter().chain(others).map(|(name, value)| (name.to_owned(), value)).collect()
}

const fn most_tilt(family: Family) -> f64 {
    if matches!(family, Family::MavlinkV1) { 45.0 } else { 30.0 }
}

/// A flying vehicle and that gimbal, which is known; `configured` is the family of its entry.
fn with(configured: Family, gimbal: impl Peer + 'static) -> (World, Places) {
    let camera = GimbalSettings { family: configured, ..GimbalSettings::found("camera".to_owned()) };
    let (mut world, places) = World::empty(Settings { gimbals: vec![camera], ..three_links() });
    world.install(places.autopilot, Vehicle::new(Timestamp::ZERO, VehicleSettings::default()));
    world.install(places.gimbal, gimbal);
    run(&mut world, places, 4 * SECOND);
    assert_eq!(world.snapshot().gimbals[0].state, "alive");
    (world, places)
}

/// With a ground station that beats.
fn run(world: &mut World, places: Places, duration: Duration) {
    world.run_with(duration, &[(SECOND, places.ground, GCS, ground_heartbeat())]);
}

/// Asks for something as it would come over HTTP; what becomes of it is among the world's answers.
fn ask(world: &mut World, command: &str, in_path: Option<&str>, body: &str) -> OperationId {
    let action = Action::of_command(command).expect(command);
    let asked = action.read(in_path, body.as_bytes()).unwrap_or_else(|wrong| panic!("{command} {body}: {wrong}"));
    world.ask_by_name("camera", &asked)
}

/// The same, and its one answer.
fn answer(world: &mut World, places: Places, command: &str, in_path: Option<&str>, body: &str) -> Answer {
    world.answers.clear();
    let id = ask(world, command, in_path, body);
    let end = world.now + 20 * SECOND;
    while world.answers.is_empty() && world.now < end {
        run(world, places, SECOND / 10);
    }
    let [(answered, answer)] = &world.answers[..] else { panic!("{command}: {:?}", world.answers) };
    assert_eq!(*answered, id);
    answer.clone()
}

fn refresh(world: &mut World, places: Places) -> Answer {
    answer(world, places, "refresh-parameters", None, "")
}

fn set(world: &mut World, places: Places, name: &str, value: f64) -> Answer {
    answer(world, places, "set-parameter", Some(name), &format!(r#"{{"value": {value}}}"#))
}

fn failed(error: OperationError) -> Answer {
    Err(NotDone::Operation(error))
}

fn known(world: &World) -> BTreeMap<String, f64> {
    world.snapshot().gimbals[0].details.parameters.clone()
}

/// What of the parameter protocol reached the gimbal from the manager, by message; it must have come from nobody else.
fn told(world: &mut World, places: Places) -> Vec<MavMessage> {
    let arrivals = world.take(places.gimbal);
    let of_protocol = arrivals.iter().filter(|arrival| PROTOCOL.contains(&arrival.id()));
    of_protocol
        .map(|arrival| {
            assert_eq!(arrival.source(), MANAGER);
            match arrival.id() {
                20 => MavMessage::PARAM_REQUEST_READ(arrival.decode()),
                21 => MavMessage::PARAM_REQUEST_LIST(arrival.decode()),
                22 => MavMessage::PARAM_VALUE(arrival.decode()),
                _ => MavMessage::PARAM_SET(arrival.decode()),
            }
        })
        .collect()
}

fn list() -> MavMessage {
    MavMessage::PARAM_REQUEST_LIST(PARAM_REQUEST_LIST_DATA { target_system: 1, target_component: 154 })
}

fn read(name: &str) -> MavMessage {
    MavMessage::PARAM_REQUEST_READ(PARAM_REQUEST_READ_DATA {
        param_index: -1,
        target_system: 1,
        target_component: 154,
        param_id: CharArray::from(name),
    })
}

/// A float, as all are but `SIM_COMP_ID`.
fn to_set(name: &str, param_value: f32) -> MavMessage {
    MavMessage::PARAM_SET(PARAM_SET_DATA {
        param_value,
        target_system: 1,
        target_component: 154,
        param_id: CharArray::from(name),
        param_type: 9,
    })
}

/// A gimbal of which nothing of the parameter protocol comes through.
struct WithoutParameters;

impl Interceptor for WithoutParameters {
    fn towards_peer(&mut self, bytes: &[u8]) -> Passage {
        let frame = DatagramFrames::new(bytes).next_frame().expect("the core sends whole frames");
        if PROTOCOL.contains(&frame.message_id()) { Passage::Lost } else { Passage::Through }
    }
}

/// Nothing is read that nobody asked for; then all of it comes by one list, and is told wherever it is looked for.
#[test]
fn all_are_read_when_somebody_asks() {
    for family in BOTH {
        let (mut world, places) = with_gimbal(family);
        run(&mut world, places, 30 * SECOND);
        assert_eq!((told(&mut world, places), known(&world)), (vec![], BTreeMap::new()), "{family:?}");

        assert_eq!(refresh(&mut world, places), Ok(()), "{family:?}");
        assert_eq!(known(&world), expected(family));
        run(&mut world, places, 30 * SECOND);
        assert_eq!(told(&mut world, places), [list()], "{family:?}");
    }
}

/// "With retry": a fifth of all that is said is lost either way, and all of them are read and one is set.
#[test]
fn a_fifth_of_what_is_said_may_be_lost() {
    for family in BOTH {
        for seed in 1..=12 {
            let faults: Faults = "drop=0.2".parse().expect("faults");
            let faults = Faults { seed, ..faults };
            let (mut world, places) = match family {
                Family::MavlinkV1 => with(family, FaultyPeer::new(v1_gimbal(), faults)),
                _ => with(family, FaultyPeer::new(v2_gimbal(), faults)),
            };
            assert_eq!(refresh(&mut world, places), Ok(()), "{family:?} {seed}");
            assert_eq!(known(&world), expected(family), "{family:?} {seed}");
            assert_eq!(set(&mut world, places, "SIM_TILT_MAX", 10.0), Ok(()), "{family:?} {seed}");
            assert_eq!(known(&world)["SIM_TILT_MAX"], 10.0, "{family:?} {seed}");
        }
    }
}

/// A value is set, told back, and who asked for it is told with what it was before.
#[test]
fn a_value_is_set_and_told_back() {
    for family in BOTH {
        let (mut world, places) = with_gimbal(family);
        assert_eq!(refresh(&mut world, places), Ok(()), "{family:?}");
        world.forget();
        assert_eq!(set(&mut world, places, "SIM_TILT_MAX", 10.5), Ok(()), "{family:?}");

        assert_eq!(told(&mut world, places), [to_set("SIM_TILT_MAX", 10.5)], "{family:?}");
        assert_eq!(known(&world)["SIM_TILT_MAX"], 10.5, "{family:?}");
        let text = format!("http asked for parameter SIM_TILT_MAX = 10.5 (it was {})", most_tilt(family));
        assert_eq!(world.snapshot().events[0].text, text);
    }
}

/// Integers go as the gimbal sends them, here as their bits, and within their type.
#[test]
fn an_integer_is_set_as_one() {
    let (mut world, places) = with_gimbal(Family::MavlinkV2);
    assert_eq!(set(&mut world, places, "SIM_COMP_ID", 171.0), Ok(()));
    let [MavMessage::PARAM_REQUEST_LIST(_), MavMessage::PARAM_SET(sent)] = &told(&mut world, places)[..] else {
        panic!("all are read and one is set");
    };
    assert_eq!((sent.param_value.to_bits(), sent.param_type), (171, 6));
    assert_eq!(known(&world)["SIM_COMP_ID"], 171.0);
    let invalid = "0.5 is no whole number from -2147483648 to 2147483647".to_owned();
    assert_eq!(set(&mut world, places, "SIM_COMP_ID", 0.5), failed(OperationError::Invalid(invalid)));
    assert_eq!(told(&mut world, places), []);
}

/// A name that the gimbal does not have is asked for, and not set: its type would be a guess.
#[test]
fn a_name_that_is_not_there_is_not_set() {
    for family in BOTH {
        let (mut world, places) = with_gimbal(family);
        assert_eq!(set(&mut world, places, "NO_SUCH_NAME", 5.0), failed(OperationError::NoAnswer), "{family:?}");
        let expected_told: Vec<_> = std::iter::once(list()).chain((0..5).map(|_| read("NO_SUCH_NAME"))).collect();
        assert_eq!(told(&mut world, places), expected_told, "{family:?}");
        // "no parameter … was read from the gimbal" is said where others were.
        assert_eq!(known(&world), expected(family), "{family:?}");
    }
}

/// "Give up silently (v1 gimbals often have no params)": but for who asked.
#[test]
fn a_gimbal_without_parameters_says_so() {
    for family in BOTH {
        let (mut world, places) = match family {
            Family::MavlinkV1 => with(family, Intercepted::new(v1_gimbal(), WithoutParameters)),
            _ => with(family, Intercepted::new(v2_gimbal(), WithoutParameters)),
        };
        let before = world.now;
        assert_eq!(refresh(&mut world, places), failed(OperationError::NoParameters), "{family:?}");
        assert_eq!(set(&mut world, places, "SIM_TILT_MAX", 5.0), failed(OperationError::NoParameters), "{family:?}");
        assert!(world.now.since(before) < 6 * SECOND, "{family:?}");
        let asked: Vec<_> = (0..3).map(|_| list()).chain((0..5).map(|_| read("SIM_TILT_MAX"))).collect();
        assert_eq!((told(&mut world, places), known(&world)), (asked, BTreeMap::new()), "{family:?}");
    }
}

/// "PARAM_VALUE from foreign components arrives on the same link: filter on (sysid, compid)." What the gimbal tells a ground
/// station is known, and nothing is sent for it.
#[test]
fn what_it_tells_others_is_known_and_what_others_tell_is_not() {
    for family in BOTH {
        let (mut world, places) = with_gimbal(family);
        let foreign = PARAM_VALUE_DATA {
            param_value: 7.0,
            param_count: 2,
            param_index: 0,
            param_id: CharArray::from("SIM_TILT_MAX"),
            param_type: 9,
        };
        for (place, source) in [
            (places.gimbal, MavId::new(1, 100)),
            (places.gimbal, MavId::new(2, 154)),
            (places.autopilot, AUTOPILOT),
            (places.ground, GCS),
        ] {
            world.send(place, source, &MavMessage::PARAM_VALUE(foreign.clone()));
        }
        run(&mut world, places, SECOND);
        assert_eq!(known(&world), BTreeMap::new(), "{family:?}");

        world.send(places.ground, GCS, &read("SIM_TILT_MAX"));
        run(&mut world, places, SECOND);
        assert_eq!(known(&world), [("SIM_TILT_MAX".to_owned(), most_tilt(family))].into(), "{family:?}");
        world.send(places.ground, GCS, &to_set("SIM_TILT_MAX", 20.0));
        run(&mut world, places, SECOND);
        assert_eq!(known(&world), [("SIM_TILT_MAX".to_owned(), 20.0)].into(), "{family:?}");

        let arrivals = world.take(places.gimbal);
        let ours = arrivals.iter().filter(|arrival| arrival.source() == MANAGER && PROTOCOL.contains(&arrival.id()));
        assert_eq!(ours.count(), 0, "{family:?}");
        let seen: Vec<PARAM_VALUE_DATA> = crate::support::script::of(&world.take(places.ground));
        let from_gimbal = seen.iter().filter(|value| [most_tilt(family), 20.0].contains(&f64::from(value.param_value)));
        assert_eq!(from_gimbal.count(), 2, "{family:?}: each is told once");
    }
}

/// A gimbal that was restarted or lost may be another: its parameters are not known any more, and who waits for them is told.
#[test]
fn nothing_is_known_of_a_gimbal_that_was_away() {
    for family in BOTH {
        let (mut world, places) = with_gimbal(family);
        assert_eq!(refresh(&mut world, places), Ok(()), "{family:?}");
        assert_eq!(known(&world), expected(family));
        world.reboot(places.gimbal);
        run(&mut world, places, 5 * SECOND);
        assert_eq!(known(&world), BTreeMap::new(), "{family:?}");

        assert_eq!(refresh(&mut world, places), Ok(()), "{family:?}");
        assert_eq!(known(&world), expected(family));
        world.remove(places.gimbal);
        // It is lost in 800 ms, and its answer would be waited for longer.
        let lost_after = if family == Family::MavlinkV1 { 5 * SECOND } else { 3 * SECOND };
        run(&mut world, places, lost_after - 4 * SECOND / 5);
        world.answers.clear();
        let id = ask(&mut world, "set-parameter", Some("SIM_TILT_MAX"), r#"{"value": 1}"#);
        run(&mut world, places, SECOND);
        assert_eq!(world.answers, [(id, failed(OperationError::NotThere))], "{family:?}");
        assert_eq!(known(&world), BTreeMap::new(), "{family:?}");
        assert_eq!(refresh(&mut world, places), failed(OperationError::NotThere), "{family:?}");
    }
}

/// What is asked for while it is found out what the gimbal speaks is done all the same, and what was read stays known.
#[test]
fn parameters_outlast_the_search_for_the_family() {
    let (mut world, places) = with(Family::Auto, v1_gimbal());
    let family = |world: &World| world.snapshot().gimbals[0].family.clone();
    // It is taken for one of v1 five seconds after it was heard.
    run(&mut world, places, SECOND);
    assert_eq!(family(&world), "mavlink_v2");
    assert_eq!(set(&mut world, places, "SIM_TILT_MAX", 30.0), Ok(()));
    assert_eq!(family(&world), "mavlink_v1");
    assert_eq!(known(&world)["SIM_TILT_MAX"], 30.0);
    assert_eq!(known(&world).len(), 2);

    assert_eq!(set(&mut world, places, "SIM_TILT_MAX", 20.0), Ok(()));
    assert_eq!(refresh(&mut world, places), Ok(()));
    assert_eq!(known(&world)["SIM_TILT_MAX"], 20.0);
}

/// "Each is answered by exactly one": at once, when a gimbal turns out to be a Gremsy, which is read when it has started, and
/// when another one is found in a Gremsy's place.
#[test]
fn who_waits_is_told_when_the_gimbal_is_another() {
    // It does not say who made it.
    let firmware = FirmwareVersion::official(7, 5, 6);
    let settings = gremsy::DeviceSettings { firmware, ..gremsy::DeviceSettings::of(gremsy::Generation::V1) };
    let camera = GimbalSettings::found("camera".to_owned());
    let (mut world, places) = World::empty(Settings { gimbals: vec![camera], ..three_links() });
    world.install(places.autopilot, Vehicle::new(Timestamp::ZERO, VehicleSettings::default()));
    world.install(places.gimbal, gremsy::Device::new(Timestamp::ZERO, settings));
    for _ in 0..100 {
        if world.snapshot().gimbals[0].state != "alive" {
            run(&mut world, places, SECOND / 10);
        }
    }
    assert_eq!(world.snapshot().gimbals[0].family, "mavlink_v2", "as every gimbal is at first");
    let id = ask(&mut world, "refresh-parameters", None, "");
    run(&mut world, places, 5 * SECOND);
    assert_eq!(world.snapshot().gimbals[0].family, "gremsy", "by the names of its parameters");
    assert_eq!(world.answers, [(id, failed(OperationError::NotReady))]);

    run(&mut world, places, 25 * SECOND);
    assert!(known(&world).len() > 30);
    world.answers.clear();
    let id = ask(&mut world, "refresh-parameters", None, "");
    let other = device_information(world.now, usual_capabilities());
    world.send(places.gimbal, GIMBAL, &MavMessage::GIMBAL_DEVICE_INFORMATION(other));
    assert_eq!(world.snapshot().gimbals[0].family, "mavlink_v2", "somebody else made it");
    assert_eq!(world.answers, [(id, failed(OperationError::NotThere))]);
}
