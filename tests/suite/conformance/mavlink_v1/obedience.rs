//! "Verify effect, not only ACK" (gimbals 1.10): a gimbal that is told where to look and does not move is named, and no other.

use gimbald::geometry::{Angle, AngularRate, AxisLimits, GimbalAngles, Limits};
use gimbald::gimbals::mavlink_v1::config::V1RadioControl;
use gimbald::gimbals::mavlink_v1::sim::{Device, DeviceSettings, Feedback};
use gimbald::sim::plant::PlantSettings;
use gimbald::sim::vehicle::{Vehicle, VehicleSettings};
use gimbald::timestamp::Timestamp;
use gimbald::wire::dialect::STATUSTEXT_DATA;

use super::*;
use crate::support::wire::frame_v1;

/// A flying vehicle and a gimbal, which may be told where to look.
fn flying(device: DeviceSettings, v1: V1Settings) -> (World, Places) {
    let settings = Settings { gimbals: vec![GimbalSettings { v1, ..v1_gimbal() }], ..three_links() };
    let (mut world, places) = World::empty(settings);
    world.install(places.autopilot, Vehicle::new(Timestamp::ZERO, VehicleSettings::default()));
    world.install(places.gimbal, Device::new(Timestamp::ZERO, device));
    run(&mut world, places, 6);
    (world, places)
}

fn run(world: &mut World, places: Places, seconds: u32) {
    world.run_with(seconds * SECOND, &[(SECOND, places.ground, GCS, ground_heartbeat())]);
}

/// What the pilot read, what whoever looks reads, and how often it stands in the events.
fn told_of_it(world: &World, places: Places) -> (Vec<String>, Vec<String>, usize) {
    let texts: Vec<STATUSTEXT_DATA> = of(world.arrivals(places.ground));
    let texts = texts.iter().map(|text| text.text.to_str().expect("text").to_owned()).collect();
    let snapshot = world.snapshot();
    let events = snapshot.events.iter().filter(|event| event.what == "fault").count();
    (texts, snapshot.gimbals[0].details.faults.clone(), events)
}

fn point(world: &mut World, places: Places, [pitch, yaw]: [f32; 2]) {
    look(world, places, [pitch, yaw], 44.0);
}

fn between(pitch: [f64; 2], yaw: [f64; 2]) -> DeviceSettings {
    let axis = |[least, most]: [f64; 2]| AxisLimits::new(Angle::from_degrees(least), Angle::from_degrees(most));
    let limits = Limits { roll: axis([0.0, 0.0]), pitch: axis(pitch), yaw: axis(yaw) };
    let device = DeviceSettings::default();
    DeviceSettings { plant: PlantSettings { limits, ..device.plant.clone() }, ..device }
}

#[test]
fn a_gimbal_that_is_told_angles_and_does_not_move_is_named_once() {
    for feedback in [Feedback::Orientation, Feedback::Status] {
        let stuck = DeviceSettings { feedback, ..between([0.0, 0.0], [0.0, 0.0]) };
        let (mut world, places) = flying(stuck, V1Settings::default());
        assert_eq!(told_of_it(&world, places), (vec![], vec![], 0), "it was told nothing");
        point(&mut world, places, [-30.0, 0.0]);
        world.forget();
        for _ in 0..3 {
            run(&mut world, places, 12);
            point(&mut world, places, [-40.0, 20.0]);
        }
        let (texts, faults, events) = told_of_it(&world, places);
        // `look` forgets what arrived before it.
        assert_eq!((texts, events), (vec![], 1), "{feedback:?}");
        assert!(
            faults.len() == 1 && faults[0].starts_with("it is told where to look and does not move. Check"),
            "{faults:?}"
        );
    }
    let (mut world, places) = flying(between([0.0, 0.0], [0.0, 0.0]), V1Settings::default());
    point(&mut world, places, [-30.0, 0.0]);
    run(&mut world, places, 60);
    assert_eq!(told_of_it(&world, places).0, ["camera: is told angles but does not move"]);
}

#[test]
fn a_gimbal_that_obeys_as_far_as_it_can_is_not() {
    let usual = || between([-90.0, 45.0], [-180.0, 180.0]);
    let slow = |device: DeviceSettings, rate: f64| {
        let plant = device.plant.clone().with_max_rate(AngularRate::from_degrees_per_second(rate));
        DeviceSettings { plant, ..device }
    };
    let from = |device: DeviceSettings, pitch: f64, yaw: f64| {
        let degrees = Angle::from_degrees;
        let initial = GimbalAngles { roll: Angle::ZERO, pitch: degrees(pitch), yaw: degrees(yaw) };
        DeviceSettings { plant: PlantSettings { initial, ..device.plant.clone() }, ..device }
    };
    for (name, device) in [
        ("it works", usual()),
        ("it is slow", slow(usual(), 0.5)),
        ("its end stops are near", between([-20.0, 10.0], [-30.0, 30.0])),
        ("it has no yaw", between([-90.0, 30.0], [0.0, 0.0])),
        ("it begins at its end stops", from(between([-45.0, 45.0], [-90.0, 90.0]), -45.0, 90.0)),
        ("it says nothing", DeviceSettings { feedback: Feedback::Nothing, ..between([0.0, 0.0], [0.0, 0.0]) }),
    ] {
        let (mut world, places) = flying(device, V1Settings::default());
        for angles in [[-80.0, 120.0], [-85.0, 150.0], [40.0, -150.0], [45.0, -150.0], [-90.0, 0.0], [0.0, 0.0]] {
            point(&mut world, places, angles);
            run(&mut world, places, 20);
            assert_eq!(told_of_it(&world, places), (vec![], vec![], 0), "{name} at {angles:?}");
        }
    }
}

/// Its radio control has it: because we gave it, or as it says itself.
#[test]
fn a_gimbal_that_follows_its_radio_control_is_not() {
    let v1 = V1Settings { radio_control: V1RadioControl::Mode, ..V1Settings::default() };
    let (mut world, places) = flying(between([0.0, 0.0], [0.0, 0.0]), v1);
    point(&mut world, places, [-30.0, 0.0]);
    run(&mut world, places, 5);
    look(&mut world, places, [NAN, NAN], 256.0 + 44.0);
    run(&mut world, places, 30);
    assert_eq!(told_of_it(&world, places), (vec![], vec![], 0));

    let (mut world, places) = with_gimbal(v1_gimbal());
    for mount_mode in [3, 2] {
        point(&mut world, places, [-30.0, 0.0]);
        for _ in 0..60 {
            world.send(places.gimbal, GIMBAL, &heartbeat(26, 0));
            world.send(places.ground, GCS, &ground_heartbeat());
            let status = gimbald::wire::dialect::MOUNT_STATUS_DATA {
                pointing_a: 0,
                pointing_b: 0,
                pointing_c: 0,
                target_system: 0,
                target_component: 0,
                mount_mode,
            };
            world.send(places.gimbal, GIMBAL, &MavMessage::MOUNT_STATUS(status));
            world.run_for(SECOND / 4);
        }
        let (texts, faults, events) = told_of_it(&world, places);
        let expected = usize::from(mount_mode != 3);
        assert_eq!((texts.len(), faults.len(), events), (expected, expected, expected), "{texts:?}");
    }
}

/// Its motors are switched on: it is a fault no more, and none that is told a second time.
#[test]
fn a_gimbal_that_moves_after_all_has_no_fault() {
    let (mut world, places) = with_gimbal(v1_gimbal());
    point(&mut world, places, [-30.0, 0.0]);
    let mut events = Vec::new();
    for step in 0_u8..120 {
        let pitch = -3.0 * f32::from(step.saturating_sub(50).min(10));
        world.send(places.gimbal, GIMBAL, &heartbeat(26, 0));
        world.send(places.ground, GCS, &ground_heartbeat());
        report(&mut world, places, pitch, 0.0);
        world.run_for(SECOND / 4);
        events.push((told_of_it(&world, places).1.len(), told_of_it(&world, places).2));
    }
    assert_eq!((events[20], events[45], events[58], events[119]), ((0, 0), (1, 1), (0, 1), (0, 1)));
}

/// Client checklist E132: "Everything we send is MAVLink 2": one that sends MAVLink 1 only may hear none of it, which is said
/// first as long as it has not sent MAVLink 2.
#[test]
fn client_item_e132_of_a_gimbal_that_sends_mavlink_1_only_that_is_said_first() {
    let version_2_too = "it is told where to look and does not move. Check that its motors are on";
    let version_1_only = "it sends MAVLink 1 frames only and may not understand MAVLink 2; it is told where to look in that and \
        does not move. Set it to MAVLink 2, and the autopilot's ports on the way to it (SERIALn_PROTOCOL = 2), or give it \
        firmware that speaks it; if it does not move then, check that its motors are on";
    for (sends_version_2, expected) in [(false, version_1_only), (true, version_2_too)] {
        let settings = Settings { gimbals: vec![v1_gimbal()], ..three_links() };
        let (mut world, places) = World::empty(settings);
        let mut faults = Vec::new();
        for step in 0..60 {
            // HEARTBEAT of a gimbal and MOUNT_STATUS of one that looks ahead.
            world.send_bytes(places.gimbal, &frame_v1(0, 50, 0, &[0, 0, 0, 0, 26, 8, 0, 4, 3]));
            world.send_bytes(places.gimbal, &frame_v1(158, 134, 1, &[0; 14]));
            world.send(places.ground, GCS, &ground_heartbeat());
            if step == 8 {
                point(&mut world, places, [-30.0, 0.0]);
            }
            if step == 20 && sends_version_2 {
                world.send(places.gimbal, GIMBAL, &gimbal_heartbeat());
            }
            world.run_for(SECOND / 4);
            faults = told_of_it(&world, places).1;
        }
        assert!(faults.len() == 1 && faults[0].starts_with(expected), "{faults:?}");
    }
}
