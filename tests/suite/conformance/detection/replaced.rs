//! Another gimbal takes the place of one that was lost.

use gimbald::gimbals::settings::Family;

use super::*;

const KINDS: [&str; 4] = ["mavlink_v1", "mavlink_v2", "gremsy v1", "gremsy v2"];

fn install(world: &mut World, places: Places, kind: &str) {
    let now = world.now;
    let gremsy = |generation| gremsy::Device::new(now, gremsy::DeviceSettings::of(generation));
    match kind {
        "mavlink_v1" => world.install(places.gimbal, Device::new(now, DeviceSettings::default())),
        "mavlink_v2" => world.install(places.gimbal, v2::Device::new(now, v2::DeviceSettings::default())),
        "gremsy v1" => world.install(places.gimbal, gremsy(gremsy::Generation::V1)),
        _ => world.install(places.gimbal, gremsy(gremsy::Generation::V2)),
    }
}

/// What a gimbal said of itself speaks for none that comes in its place: another family at the same port, under the same
/// id, is found out as in the beginning, but that a Gremsy has 20 s to say that it is one still.
#[test]
fn another_family_in_the_place_of_one_that_was_lost_is_found_out() {
    for before in KINDS {
        for after in KINDS {
            let (mut world, places) = World::empty(three_links());
            world.install(places.autopilot, Vehicle::new(Timestamp::ZERO, VehicleSettings::default()));
            install(&mut world, places, before);
            run(&mut world, places, 25 * SECOND);
            assert!(before.starts_with(&family(&world)), "{before}");
            world.remove(places.gimbal);
            run(&mut world, places, 15 * SECOND);
            assert_eq!(world.snapshot().gimbals[0].state, "lost", "{before}");

            install(&mut world, places, after);
            run(&mut world, places, 30 * SECOND);
            // And for good.
            for _ in 0..20 {
                assert!(after.starts_with(&family(&world)), "{before} to {after}: {}", family(&world));
                assert_eq!(world.snapshot().gimbals[0].state, "alive", "{before} to {after}");
                run(&mut world, places, SECOND);
            }
        }
    }
}

/// The same where a v1 gimbal is there before the first was called lost.
#[test]
fn a_v1_gimbal_that_takes_the_place_of_a_v2_device_at_once_is_found_out() {
    for feedback in [Feedback::Orientation, Feedback::Status] {
        let (mut world, places) = World::empty(three_links());
        world.install(places.autopilot, Vehicle::new(Timestamp::ZERO, VehicleSettings::default()));
        install(&mut world, places, "mavlink_v2");
        run(&mut world, places, 25 * SECOND);
        world.remove(places.gimbal);
        run(&mut world, places, SECOND);
        let settings = DeviceSettings { feedback, ..DeviceSettings::default() };
        let device = Device::new(world.now, settings);
        world.install(places.gimbal, device);
        run(&mut world, places, 20 * SECOND);
        for _ in 0..20 {
            assert_eq!(family(&world), "mavlink_v1", "{feedback:?}");
            assert_eq!(world.snapshot().gimbals[0].state, "alive", "{feedback:?}");
            run(&mut world, places, SECOND);
        }
    }
}

/// D2: "a v2 device: its own component id … Any other gimbal: 1..6", which is kept for it: "whoever learned an id goes by it for
/// good", also when a v2 device was there meanwhile.
#[test]
fn one_that_comes_back_after_a_v2_device_has_the_id_that_it_had() {
    for kind in ["mavlink_v1", "gremsy v1"] {
        let (mut world, places) = World::empty(three_links());
        world.install(places.autopilot, Vehicle::new(Timestamp::ZERO, VehicleSettings::default()));
        for kind in [kind, "mavlink_v2", kind] {
            install(&mut world, places, kind);
            run(&mut world, places, 25 * SECOND);
            assert_eq!(world.snapshot().gimbals[0].device_id, device_id(kind), "{kind}");
            world.remove(places.gimbal);
            run(&mut world, places, 25 * SECOND);
        }
    }
}

/// One that comes in the place of a lost Gremsy is steered in the generation that it speaks itself.
#[test]
fn another_generation_in_the_place_of_a_lost_gremsy_is_found_out() {
    for (before, after) in [("gremsy v1", "gremsy v2"), ("gremsy v2", "gremsy v1")] {
        for family in [Family::Auto, Family::Gremsy] {
            let camera = GimbalSettings { family, ..GimbalSettings::found("camera".to_owned()) };
            let (mut world, places) = World::empty(Settings { gimbals: vec![camera], ..three_links() });
            world.install(places.autopilot, Vehicle::new(Timestamp::ZERO, VehicleSettings::default()));
            for (kind, device_id) in [(before, device_id(before)), (after, device_id(after))] {
                world.remove(places.gimbal);
                run(&mut world, places, 15 * SECOND);
                install(&mut world, places, kind);
                run(&mut world, places, 30 * SECOND);
                let command = command_long(MANAGER, 1000, &[-30.0, 20.0, NAN, NAN, 44.0, 0.0, 0.0]);
                assert_eq!(
                    world.result_of(places.ground, GCS, &command),
                    Some(ACCEPTED),
                    "{before} to {after}: {kind}"
                );
                run(&mut world, places, 8 * SECOND);
                let gimbal = world.snapshot().gimbals.remove(0);
                let angles =
                    [gimbal.attitude.pitch_deg, gimbal.attitude.yaw_vehicle_deg].map(|angle| angle.map(f64::round));
                assert_eq!(
                    (gimbal.device_id, angles),
                    (device_id, [Some(-30.0), Some(20.0)]),
                    "{before} to {after}: {kind}"
                );
                assert_eq!(gimbal.details.faults, [""; 0], "{before} to {after}: {kind}");
            }
        }
    }
}

fn device_id(kind: &str) -> Option<u8> {
    Some(if kind.ends_with("v2") { GIMBAL.component } else { 1 })
}
