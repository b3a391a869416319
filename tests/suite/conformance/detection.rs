//! `family = "auto"`: what a gimbal speaks is found out by listening, and nothing of that moves it.

mod replaced;
mod weighing;

use std::cell::Cell;
use std::rc::Rc;
use std::time::Duration;

use gimbald::bridge::settings::Settings;
use gimbald::geometry::Angle;
use gimbald::gimbals::detection::{V1_BY_ITS_ATTITUDE_AFTER, V1_BY_ITS_SILENCE_AFTER};
use gimbald::gimbals::gremsy::sim as gremsy;
use gimbald::gimbals::gremsy::version::FirmwareVersion;
use gimbald::gimbals::mavlink_v1::sim::{Device, DeviceSettings, Feedback};
use gimbald::gimbals::mavlink_v2::sim as v2;
use gimbald::gimbals::settings::GimbalSettings;
use gimbald::sim::plant::PlantSettings;
use gimbald::sim::vehicle::{Vehicle, VehicleSettings};
use gimbald::timestamp::Timestamp;
use gimbald::wire::dialect::{
    COMMAND_LONG_DATA, GIMBAL_DEVICE_ATTITUDE_STATUS_DATA, GIMBAL_DEVICE_INFORMATION_DATA,
    GIMBAL_DEVICE_SET_ATTITUDE_DATA, GIMBAL_MANAGER_INFORMATION_DATA, GIMBAL_MANAGER_STATUS_DATA, MavMessage,
    PARAM_REQUEST_READ_DATA, PARAM_VALUE_DATA,
};
use gimbald::wire::{DatagramFrames, MavId};

use crate::support::hub::Watched;
use crate::support::interception::{Intercepted, Interceptor, Passage};
use crate::support::script::{
    ACCEPTED, NAN, TEMPORARILY_REJECTED, command_long, device_information, gimbal_heartbeat, ground_heartbeat, of,
    pitch_yaw_deg, usual_capabilities,
};
use crate::support::world::{Arrival, GCS, GIMBAL, Places, World, three_links};

const MANAGER: MavId = MavId::new(1, 191);
const SECOND: Duration = Duration::from_secs(1);

/// A flying vehicle and a v1 gimbal of which the configuration says nothing.
fn with_v1_gimbal(reports: Feedback) -> (World, Places) {
    let (mut world, places) = World::empty(three_links());
    world.install(places.autopilot, Vehicle::new(Timestamp::ZERO, VehicleSettings::default()));
    let plant = PlantSettings { noise: Angle::ZERO, ..DeviceSettings::default().plant };
    world.install(
        places.gimbal,
        Device::new(Timestamp::ZERO, DeviceSettings { feedback: reports, plant, ..DeviceSettings::default() }),
    );
    (world, places)
}

fn run(world: &mut World, places: Places, duration: Duration) {
    world.run_with(duration, &[(SECOND, places.ground, GCS, ground_heartbeat())]);
}

fn from_manager(arrivals: Vec<Arrival>) -> Vec<Arrival> {
    arrivals.into_iter().filter(|arrival| arrival.source() == MANAGER).collect()
}

fn family(world: &World) -> String {
    world.snapshot().gimbals[0].family.clone()
}

/// The mount commands that reached the gimbal.
fn mount_commands(world: &mut World, places: Places) -> Vec<COMMAND_LONG_DATA> {
    let commands: Vec<COMMAND_LONG_DATA> = of(&world.take(places.gimbal));
    commands.into_iter().filter(|command| matches!(command.command, 204 | 205)).collect()
}

/// "A v1 gimbal behind gimbald looks like a v2 gimbal to every client", also one that no entry describes: it is told from
/// a v2 device by what it says of its attitude.
#[test]
fn a_gimbal_that_tells_its_attitude_by_v1_is_a_v1_gimbal() {
    let (mut world, places) = with_v1_gimbal(Feedback::Orientation);
    run(&mut world, places, V1_BY_ITS_ATTITUDE_AFTER);
    assert_eq!(family(&world), "mavlink_v2", "as every gimbal is at first");
    assert!(of::<GIMBAL_MANAGER_INFORMATION_DATA>(&world.take(places.ground)).is_empty());

    run(&mut world, places, 5 * SECOND);

    assert_eq!(family(&world), "mavlink_v1");
    assert_eq!(mount_commands(&mut world, places), [], "nobody has asked for anything");
    let heard = from_manager(world.take(places.ground));
    assert_eq!(of::<GIMBAL_DEVICE_INFORMATION_DATA>(&heard).len(), 1);
    let information: Vec<GIMBAL_MANAGER_INFORMATION_DATA> = of(&heard);
    assert_eq!(information.iter().map(|message| message.gimbal_device_id).collect::<Vec<_>>(), [1]);
    let statuses: Vec<GIMBAL_DEVICE_ATTITUDE_STATUS_DATA> = of(&heard);
    assert!(statuses.len() >= 20, "{} in some seconds", statuses.len());
    assert!(statuses.iter().all(|status| status.gimbal_device_id == 1));

    world.send(places.ground, GCS, &command_long(MANAGER, 1000, &[-30.0, 20.0, NAN, NAN, 44.0, 0.0, 1.0]));
    run(&mut world, places, 4 * SECOND);
    let statuses: Vec<GIMBAL_DEVICE_ATTITUDE_STATUS_DATA> = of(&from_manager(world.take(places.ground)));
    let (pitch, yaw) = pitch_yaw_deg(statuses.last().expect("285 is streamed").q);
    assert!((pitch + 30.0).abs() < 0.5 && (yaw - 20.0).abs() < 0.5, "{pitch} {yaw}");
}

/// "our ids must be stable: PX4 latches (sysid, compid, device id) for good" (notes on peers 2.2): which of two entries
/// without a family is found first says nothing of their ids, nor does one that is described by none.
#[test]
fn ids_do_not_depend_on_who_is_found_first() {
    let entry = |name: &str, component_id| GimbalSettings {
        component_id: Some(component_id),
        ..GimbalSettings::found(name.to_owned())
    };
    let device = |component| {
        Device::new(
            Timestamp::ZERO,
            DeviceSettings { component_id: component, feedback: Feedback::Orientation, ..DeviceSettings::default() },
        )
    };
    for order in [[171, 172, 173], [173, 172, 171], [172, 173, 171]] {
        let settings = Settings { gimbals: vec![entry("a", 171), entry("b", 172)], ..three_links() };
        let (mut world, places) = World::empty(settings);
        world.install(places.autopilot, Vehicle::new(Timestamp::ZERO, VehicleSettings::default()));
        for component in order {
            world.install(places.gimbal, device(component));
            run(&mut world, places, 12 * SECOND);
            world.remove(places.gimbal);
        }
        let ids: Vec<(String, Option<u8>)> =
            world.snapshot().gimbals.into_iter().map(|gimbal| (gimbal.name, gimbal.device_id)).collect();
        let expected = [("a", Some(1)), ("b", Some(2)), ("gimbal-173", Some(3))];
        assert_eq!(ids, expected.map(|(name, id)| (name.to_owned(), id)), "{order:?}");
    }
}

/// A v1 gimbal need not report anything ("Optionally report MOUNT_STATUS and/or MOUNT_ORIENTATION").
#[test]
fn a_gimbal_that_only_beats_is_a_v1_gimbal_in_the_end() {
    let (mut world, places) = with_v1_gimbal(Feedback::Nothing);
    run(&mut world, places, V1_BY_ITS_SILENCE_AFTER);
    assert_eq!(family(&world), "mavlink_v2");

    run(&mut world, places, 5 * SECOND);

    assert_eq!(family(&world), "mavlink_v1");
    let information: Vec<GIMBAL_DEVICE_INFORMATION_DATA> = of(&from_manager(world.take(places.ground)));
    let names: Vec<&str> = information.iter().map(|message| message.custom_name.to_str().expect("text")).collect();
    assert_eq!(names, ["", "open loop"]);
    assert_eq!(mount_commands(&mut world, places), []);
}

/// Protocol checklist 26: "the request repeats … forever": a v2 device that answers late is one.
#[test]
fn a_device_that_answers_after_all_is_a_v2_device() {
    let (mut world, places) = World::empty(three_links());
    world.install(places.autopilot, Vehicle::new(Timestamp::ZERO, VehicleSettings::default()));
    world.run_with(30 * SECOND, &[(SECOND, places.gimbal, GIMBAL, gimbal_heartbeat())]);
    assert_eq!((family(&world).as_str(), world.snapshot().gimbals[0].device_id), ("mavlink_v1", Some(1)));
    world.forget();

    let information = MavMessage::GIMBAL_DEVICE_INFORMATION(device_information(world.now, usual_capabilities()));
    world.send(places.gimbal, GIMBAL, &information);

    let snapshot = world.snapshot().gimbals.remove(0);
    assert_eq!(
        (snapshot.family.as_str(), snapshot.device_id, snapshot.state.as_str()),
        ("mavlink_v2", Some(154), "alive")
    );
    let announced: Vec<GIMBAL_MANAGER_INFORMATION_DATA> = of(&from_manager(world.arrivals(places.ground).to_vec()));
    assert_eq!(announced.iter().map(|message| message.gimbal_device_id).collect::<Vec<_>>(), [154]);
    world.run_with(10 * SECOND, &[(SECOND, places.gimbal, GIMBAL, gimbal_heartbeat())]);
    let heard = from_manager(world.take(places.ground));
    assert!(of::<GIMBAL_DEVICE_ATTITUDE_STATUS_DATA>(&heard).is_empty(), "it speaks for itself");
    assert_eq!(family(&world), "mavlink_v2", "for good");
    let found = world.snapshot().events.iter().filter(|event| event.what == "gimbal_found").count();
    assert_eq!(found, 1, "it was there all the time");
}

/// A v1 gimbal that was lost and is heard again is taken for one at once.
#[test]
fn what_was_found_out_is_kept_when_the_gimbal_comes_back() {
    let (mut world, places) = with_v1_gimbal(Feedback::Orientation);
    run(&mut world, places, 10 * SECOND);
    world.unplug(places.gimbal);
    run(&mut world, places, 3 * SECOND);
    assert_eq!(world.snapshot().gimbals[0].state, "lost");

    world.plug_in(places.gimbal);
    run(&mut world, places, 2 * SECOND);

    assert_eq!((family(&world).as_str(), world.snapshot().gimbals[0].state.as_str()), ("mavlink_v1", "alive"));
}

/// A Gremsy of the v1 generation, asked for parameters because it says nothing of v2; its firmware may be so old that it
/// does not answer 283.
#[test]
fn a_gremsy_of_the_first_generation_is_known_by_its_parameters() {
    for (firmware, generation) in [((7, 7, 3), "v1"), ((7, 5, 6), "v1")] {
        let (x, y, z) = firmware;
        let settings = gremsy::DeviceSettings {
            firmware: FirmwareVersion::official(x, y, z),
            ..gremsy::DeviceSettings::of(gremsy::Generation::V1)
        };
        let (mut world, places) = World::empty(three_links());
        world.install(places.autopilot, Vehicle::new(Timestamp::ZERO, VehicleSettings::default()));
        world.install(places.gimbal, gremsy::Device::new(Timestamp::ZERO, settings));

        run(&mut world, places, 40 * SECOND);

        let gimbal = world.snapshot().gimbals.remove(0);
        assert_eq!((gimbal.family.as_str(), gimbal.details.generation.as_deref()), ("gremsy", Some(generation)));
        assert_eq!((gimbal.state.as_str(), gimbal.device_id), ("alive", Some(1)), "{firmware:?}");
        assert_eq!(mount_commands(&mut world, places), [], "nobody has asked for anything");
    }
}

/// D2: "a v2 device: its own component id in 280/281 … Any other gimbal: 1..6": which it is decides on the id, and before
/// that is known no 281 tells one, as no 280 does.
#[test]
fn no_status_tells_an_id_that_the_gimbal_turns_out_not_to_have() {
    for (kind, id) in [("v1", 1), ("silent v1", 1), ("gremsy v1", 1), ("gremsy v2", 154), ("v2", 154)] {
        let (mut world, places) = match kind {
            "v1" => with_v1_gimbal(Feedback::Orientation),
            "silent v1" => with_v1_gimbal(Feedback::Nothing),
            _ => {
                let (mut world, places) = World::empty(three_links());
                world.install(places.autopilot, Vehicle::new(Timestamp::ZERO, VehicleSettings::default()));
                let of = gremsy::DeviceSettings::of;
                match kind {
                    "gremsy v1" => {
                        let settings = of(gremsy::Generation::V1);
                        world.install(places.gimbal, gremsy::Device::new(Timestamp::ZERO, settings));
                    }
                    "gremsy v2" => {
                        let settings = of(gremsy::Generation::V2);
                        world.install(places.gimbal, gremsy::Device::new(Timestamp::ZERO, settings));
                    }
                    _ => world.install(places.gimbal, v2::Device::new(Timestamp::ZERO, Default::default())),
                }
                (world, places)
            }
        };
        run(&mut world, places, 40 * SECOND);
        let statuses: Vec<GIMBAL_MANAGER_STATUS_DATA> = of(&from_manager(world.take(places.ground)));
        let ids: Vec<u8> = statuses.iter().map(|status| status.gimbal_device_id).collect();
        assert!(ids.len() > 75 && ids.iter().all(|told| *told == id), "{kind} {ids:?}");
    }
}

/// A Gremsy that does not answer any more what it was known by.
#[derive(Debug)]
struct Forgetful {
    is_mute: Rc<Cell<bool>>,
}

impl Interceptor for Forgetful {
    fn towards_core(&mut self, bytes: &[u8]) -> Passage {
        let id = DatagramFrames::new(bytes).next_frame().expect("a frame").message_id();
        if self.is_mute.get() && matches!(id, 22 | 283) { Passage::Lost } else { Passage::Through }
    }
}

/// "A gimbal that turns after its operator is gone is our worst bug": one that hears only what an earlier run found out that it
/// speaks is stopped in these words at its first sign, also when that run was killed and the next one is before it has
/// found out the same.
#[test]
fn a_gremsy_that_was_left_turning_is_stopped_before_it_is_known_again() {
    let gremsy::DeviceSettings { plant, .. } = gremsy::DeviceSettings::of(gremsy::Generation::V1);
    let settings = gremsy::DeviceSettings {
        firmware: FirmwareVersion::official(7, 5, 6),
        plant: PlantSettings { noise: Angle::ZERO, ..plant },
        ..gremsy::DeviceSettings::of(gremsy::Generation::V1)
    };
    let (mut world, places) = World::empty(three_links());
    world.install(places.autopilot, Vehicle::new(Timestamp::ZERO, VehicleSettings::default()));
    let is_mute = Rc::new(Cell::new(false));
    let device = Watched::new(gremsy::Device::new(Timestamp::ZERO, settings));
    let yaw = || device.look().plant().pose().yaw.degrees();
    world.install(places.gimbal, Intercepted::new(device.clone(), Forgetful { is_mute: is_mute.clone() }));
    run(&mut world, places, 30 * SECOND);
    assert_eq!(turn(&mut world, places, 5.0), Some(ACCEPTED));
    run(&mut world, places, SECOND);
    assert_eq!(world.stored_turning, ["gimbal-154\t1/154\tgremsy"]);

    is_mute.set(true);
    for life in 0..2 {
        world.kill();
        world.run_for(SECOND / 2);
        let before = yaw();
        let left_turning = world.stored_turning.clone();
        assert_eq!(left_turning, ["gimbal-154\t1/154\tgremsy"], "{life}");
        world.start(Settings { left_turning, ..three_links() });
        run(&mut world, places, SECOND * 13 / 10);
        // It beats once a second.
        let stopped = yaw();
        assert!((stopped - before).abs() < 6.0, "{life}: {before} {stopped}");
        run(&mut world, places, SECOND);
        assert!((yaw() - stopped).abs() < 0.1, "{life}: it turns on");
        assert_eq!(family(&world), "mavlink_v2", "nothing else is known of it");
    }
    run(&mut world, places, 10 * SECOND);
    assert_eq!(world.stored_turning, Vec::<String>::new());
}

/// To a plain v1 gimbal zeros are angles: it is not told them.
#[test]
fn a_gimbal_that_is_not_known_to_be_a_gremsy_is_told_no_zeros_of_v1() {
    let (mut world, places) = with_v1_gimbal(Feedback::Orientation);
    world.kill();
    world.start(Settings { left_turning: vec!["gimbal-154".to_owned()], ..three_links() });
    run(&mut world, places, V1_BY_ITS_ATTITUDE_AFTER);
    let heard = world.take(places.gimbal);
    assert!(of::<GIMBAL_DEVICE_SET_ATTITUDE_DATA>(&heard).len() > 5);
    assert!(of::<COMMAND_LONG_DATA>(&heard).iter().all(|command| command.command != 205));
}

/// One of the v2 generation says who made it, and speaks for itself.
#[test]
fn a_gremsy_of_the_second_generation_is_known_by_its_name() {
    let (mut world, places) = World::empty(three_links());
    world.install(places.autopilot, Vehicle::new(Timestamp::ZERO, VehicleSettings::default()));
    let settings = gremsy::DeviceSettings::of(gremsy::Generation::V2);
    world.install(places.gimbal, gremsy::Device::new(Timestamp::ZERO, settings));

    run(&mut world, places, 30 * SECOND);

    let gimbal = world.snapshot().gimbals.remove(0);
    assert_eq!((gimbal.family.as_str(), gimbal.details.generation.as_deref()), ("gremsy", Some("v2")));
    assert_eq!((gimbal.state.as_str(), gimbal.device_id), ("alive", Some(154)));
    let heard = from_manager(world.take(places.ground));
    assert!(of::<GIMBAL_DEVICE_ATTITUDE_STATUS_DATA>(&heard).is_empty(), "it speaks for itself");
}

/// A parameter may have any name: one of a v2 device that somebody else made is none of a Gremsy, and the device is driven
/// on as it was.
#[test]
fn a_parameters_name_does_not_make_a_gremsy_of_a_v2_device() {
    let (mut world, places) = World::with_one_gimbal(three_links());
    for name in ["PITCH_P", "STIFF_TILT"] {
        world.send(places.gimbal, GIMBAL, &parameter(name));
        assert_eq!(family(&world), "mavlink_v2", "{name}");
    }
    assert_eq!(turn(&mut world, places, 10.0), Some(ACCEPTED));
}

/// All its answers may have been lost while it was judged: one that is taken for a v1 gimbal is asked on for what only a
/// Gremsy has.
#[test]
fn what_is_taken_for_a_v1_gimbal_is_a_gremsy_when_its_parameters_come() {
    let (mut world, places) = with_v1_gimbal(Feedback::Orientation);
    run(&mut world, places, 30 * SECOND);
    assert_eq!(family(&world), "mavlink_v1");
    world.forget();
    run(&mut world, places, 30 * SECOND);
    let asked: Vec<PARAM_REQUEST_READ_DATA> = world.take_messages(places.gimbal);
    let names: Vec<&str> = asked.iter().map(|asked| asked.param_id.to_str().expect("a name")).collect();
    assert_eq!(names, ["STIFF_TILT", "PITCH_P"].repeat(3));

    world.send(places.gimbal, GIMBAL, &parameter("PITCH_P"));

    assert_eq!(family(&world), "gremsy");
}

/// A gimbal that turns when it turns out to speak otherwise is stopped in the words that it was turned with, and nobody is
/// told that it does what it is not known to understand.
#[test]
fn a_change_of_family_stops_what_turns_first() {
    let (mut world, places) = World::empty(three_links());
    world.install(places.autopilot, Vehicle::new(Timestamp::ZERO, VehicleSettings::default()));
    let beat = (SECOND, places.gimbal, GIMBAL, gimbal_heartbeat());
    world.run_with(2 * SECOND, std::slice::from_ref(&beat));
    let information = device_information(world.now, usual_capabilities());
    world.send(places.gimbal, GIMBAL, &MavMessage::GIMBAL_DEVICE_INFORMATION(information.clone()));
    assert_eq!(turn(&mut world, places, 10.0), Some(ACCEPTED));
    world.forget();

    let gremsy = GIMBAL_DEVICE_INFORMATION_DATA { vendor_name: "Gremsy".into(), ..information };
    world.send(places.gimbal, GIMBAL, &MavMessage::GIMBAL_DEVICE_INFORMATION(gremsy));

    assert_eq!(family(&world), "gremsy");
    let told: Vec<GIMBAL_DEVICE_SET_ATTITUDE_DATA> = world.take_messages(places.gimbal);
    let rates: Vec<_> = told.iter().map(|told| [told.angular_velocity_y, told.angular_velocity_z]).collect();
    assert_eq!(rates, [[0.0, 0.0]]);
    assert_eq!(turn(&mut world, places, 10.0), Some(TEMPORARILY_REJECTED));
    assert_eq!(world.stored_turning, ["gimbal-154\t1/154\tgremsy"], "until it is known to have stopped");
}

/// One that was taken for a Gremsy by a parameter, and says that somebody else made it, is none.
#[test]
fn who_made_it_outweighs_a_parameter() {
    let (mut world, places) = World::empty(three_links());
    world.run_with(2 * SECOND, &[(SECOND, places.gimbal, GIMBAL, gimbal_heartbeat())]);
    world.send(places.gimbal, GIMBAL, &parameter("PITCH_P"));
    assert_eq!(family(&world), "gremsy");
    let information = MavMessage::GIMBAL_DEVICE_INFORMATION(device_information(world.now, usual_capabilities()));
    world.send(places.gimbal, GIMBAL, &information);
    assert_eq!((family(&world).as_str(), world.snapshot().gimbals[0].state.as_str()), ("mavlink_v2", "alive"));
    world.send(places.gimbal, GIMBAL, &parameter("PITCH_P"));
    assert_eq!(family(&world), "mavlink_v2");
}

fn parameter(name: &str) -> MavMessage {
    MavMessage::PARAM_VALUE(PARAM_VALUE_DATA {
        param_value: 20.0,
        param_count: 10,
        param_index: 0,
        param_id: name.into(),
        param_type: 6,
    })
}

/// A rotation in degrees per second from the nose, asked for by the ground station.
fn turn(world: &mut World, places: Places, rate: f32) -> Option<u8> {
    let command = command_long(MANAGER, 1000, &[NAN, NAN, 0.0, rate, 44.0, 0.0, 0.0]);
    world.result_of(places.ground, GCS, &command)
}
