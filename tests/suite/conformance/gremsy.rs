//! Gremsy gimbals of both generations, behind the whole core: the numbered statements of the gimbal notes.
//!
//! The gimbal is a simulated one: silent until it hears a heartbeat, busy for four seconds, slow to answer, and turning on
//! at a rate that nobody repeats.

mod bad_line;
mod faults;
mod motors;
mod operations;
mod restarting;
mod shutting_down;
mod start_up;
mod steering;
mod stopping;
mod told;
mod vendor_commands;

use std::time::Duration;

use gimbald::bridge::Input;
use gimbald::bridge::settings::Settings;
use gimbald::bridge::snapshot::GimbalSnapshot;
use gimbald::geometry::{Angle, AngularRate, YawFrame};
use gimbald::gimbals::gremsy::config::GremsySettings;
use gimbald::gimbals::gremsy::driver;
use gimbald::gimbals::gremsy::sim::{Device, DeviceSettings, Generation};
use gimbald::gimbals::gremsy::version::FirmwareVersion;
use gimbald::gimbals::operation::{Operation, OperationId, ResetMode};
use gimbald::gimbals::settings::{Family, GimbalSettings};
use gimbald::manager::asked::{Answer, Asked};
use gimbald::manager::request::AxisDemand;
use gimbald::sim::plant::PlantSettings;
use gimbald::sim::vehicle::{Vehicle, VehicleSettings};
use gimbald::timestamp::Timestamp;
use gimbald::wire::MavId;
use gimbald::wire::dialect::{COMMAND_LONG_DATA, GIMBAL_DEVICE_SET_ATTITUDE_DATA, PARAM_SET_DATA};
use gimbald::wire::ids::command;

use crate::support::script::{command_long, ground_heartbeat};
use crate::support::world::{GCS, MANAGER, Places, World, three_links};

const V1: driver::Generation = driver::Generation::V1;
const V2: driver::Generation = driver::Generation::V2;
const SECOND: Duration = Duration::from_secs(1);

/// A quiet plant, so that angles can be compared.
fn device(generation: Generation) -> DeviceSettings {
    let settings = DeviceSettings::of(generation);
    DeviceSettings { plant: PlantSettings { noise: Angle::ZERO, ..settings.plant.clone() }, ..settings }
}

fn with_firmware(generation: Generation, x: u8, y: u8, z: u8) -> DeviceSettings {
    DeviceSettings { firmware: FirmwareVersion::official(x, y, z), ..device(generation) }
}

/// The core with a Gremsy in its configuration, and nobody there.
fn without_gimbal(gremsy: GremsySettings) -> (World, Places) {
    let gimbal = GimbalSettings { family: Family::Gremsy, gremsy, ..GimbalSettings::found("camera".to_owned()) };
    World::empty(Settings { gimbals: vec![gimbal], ..three_links() })
}

/// With a flying vehicle and the gimbal, both just switched on.
fn switched_on(device: DeviceSettings, gremsy: GremsySettings) -> (World, Places) {
    let (mut world, places) = without_gimbal(gremsy);
    world.install(places.autopilot, Vehicle::new(Timestamp::ZERO, VehicleSettings::default()));
    world.install(places.gimbal, Device::new(Timestamp::ZERO, device));
    (world, places)
}

/// The same, when the gimbal can be steered; what arrived on the way is forgotten.
fn running_with(device: DeviceSettings, gremsy: GremsySettings) -> (World, Places) {
    let (mut world, places) = switched_on(device, gremsy);
    let is_running = |world: &World| seen(world).details.stage.as_deref() == Some("running");
    for _ in 0..20 {
        if !is_running(&world) {
            run(&mut world, places, SECOND);
        }
    }
    assert!(is_running(&world), "{:?}", seen(&world));
    // It has come to rest.
    run(&mut world, places, 2 * SECOND);
    world.forget();
    (world, places)
}

fn running(generation: Generation) -> (World, Places) {
    running_with(device(generation), GremsySettings::default())
}

/// With a ground station that beats.
fn run(world: &mut World, places: Places, duration: Duration) {
    world.run_with(duration, &[(SECOND, places.ground, GCS, ground_heartbeat())]);
}

fn seen(world: &World) -> GimbalSnapshot {
    world.snapshot().gimbals[0].clone()
}

/// Commands that the gimbal got from the manager, of one number.
fn told(world: &mut World, places: Places, number: u16) -> Vec<COMMAND_LONG_DATA> {
    let all: Vec<COMMAND_LONG_DATA> = from_manager(world, places);
    all.into_iter().filter(|command| command.command == number).collect()
}

fn from_manager<M: gimbald::wire::dialect::MessageData>(world: &mut World, places: Places) -> Vec<M> {
    let arrivals = world.arrivals(places.gimbal).iter();
    arrivals
        .filter(|arrival| arrival.id() == M::ID && arrival.source() == MANAGER)
        .map(|arrival| arrival.decode())
        .collect()
}

/// Everything that moves the gimbal or switches something.
fn orders(world: &mut World, places: Places) -> (Vec<COMMAND_LONG_DATA>, Vec<GIMBAL_DEVICE_SET_ATTITUDE_DATA>) {
    let commands: Vec<COMMAND_LONG_DATA> = from_manager(world, places);
    let moves = |command: &COMMAND_LONG_DATA| {
        !matches!(command.command, command::REQUEST_MESSAGE | command::SET_MESSAGE_INTERVAL)
    };
    (commands.into_iter().filter(moves).collect(), from_manager(world, places))
}

fn sets(world: &mut World, places: Places) -> Vec<(String, f32)> {
    let sets: Vec<PARAM_SET_DATA> = from_manager(world, places);
    sets.iter().map(|set| (set.param_id.to_str().expect("a name").to_owned(), set.param_value)).collect()
}

/// An operation, and what became of it within so many seconds.
fn operate(world: &mut World, places: Places, operation: Operation) -> Option<Answer> {
    ask(world, places, &Asked::Operation(operation))
}

fn ask(world: &mut World, places: Places, asked: &Asked) -> Option<Answer> {
    let id = world.ask_by_name("camera", asked);
    run(world, places, 8 * SECOND);
    world.answers.iter().find(|(answered, _)| *answered == id).map(|(_, answer)| answer.clone())
}

/// Primary control, in the name of those who ask by the gimbal's name.
fn take_control(world: &mut World) {
    let id = world.ask_by_name("camera", &Asked::TakeControl);
    assert_eq!(world.answers.last(), Some(&(id, Ok(()))));
}

/// Angles from the nose, asked for by the gimbal's name.
fn point(world: &mut World, pitch: f64, yaw: f64) {
    let axis = |degrees| AxisDemand { angle: Some(Angle::from_degrees(degrees)), rate: None };
    let roll = AxisDemand::default();
    let asked = Asked::Point { roll, pitch: axis(pitch), yaw: axis(yaw), yaw_frame: YawFrame::Vehicle };
    let id = world.ask_by_name("camera", &asked);
    assert!(world.answers.contains(&(id, Ok(()))), "{:?}", world.answers.last());
}

/// Pitch and yaw from the nose as the status shows them, degrees.
fn looks(world: &World) -> (f64, f64) {
    let attitude = seen(world).attitude;
    (attitude.pitch_deg.expect("a pitch"), attitude.yaw_vehicle_deg.expect("a yaw"))
}

fn assert_looks(world: &World, pitch: f64, yaw: f64) {
    let (is_pitch, is_yaw) = looks(world);
    let off = (is_pitch - pitch).abs().max((is_yaw - yaw).abs());
    assert!(off < 1.0, "{is_pitch:.1} {is_yaw:.1} instead of {pitch} {yaw}");
}

/// `DO_GIMBAL_MANAGER_PITCHYAW` in degrees, from the ground.
fn demand(world: &mut World, places: Places, params: [f32; 5]) {
    let [pitch, yaw, pitch_rate, yaw_rate, flags] = params;
    let message = command_long(
        MANAGER,
        command::DO_GIMBAL_MANAGER_PITCHYAW,
        &[pitch, yaw, pitch_rate, yaw_rate, flags, 0.0, 0.0],
    );
    assert_eq!(world.result_of(places.ground, GCS, &message), Some(0), "{params:?}");
}
