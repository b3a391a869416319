//! What a bad line may not spoil.

use std::time::Duration;

use gimbald::gimbals::gremsy::config::GremsySettings;
use gimbald::gimbals::gremsy::sim::{Device, Generation};
use gimbald::gimbals::operation::{Operation, YawMode};
use gimbald::manager::asked::Asked;
use gimbald::sim::faults::{Faults, FaultyPeer};
use gimbald::sim::vehicle::{Vehicle, VehicleSettings};
use gimbald::timestamp::Timestamp;

use super::{SECOND, device, run, seen, take_control, without_gimbal};

/// Gimbal statement 96: "With 5 % loss, 5 % duplication and 50 ms jitter all mode switches succeed within 3 s."
#[test]
fn statement_96_modes_change_within_three_seconds_on_a_bad_line() {
    for generation in [Generation::V1, Generation::V2] {
        for seed in 1..6 {
            let faults: Faults = "drop=0.05,duplicate=0.05,jitter=50ms".parse().expect("faults");
            let (mut world, places) = without_gimbal(GremsySettings::default());
            world.install(places.autopilot, Vehicle::new(Timestamp::ZERO, VehicleSettings::default()));
            let gimbal = Device::new(Timestamp::ZERO, device(generation));
            world.install(places.gimbal, FaultyPeer::new(gimbal, Faults { seed, ..faults }));
            run(&mut world, places, 25 * SECOND);
            assert_eq!(seen(&world).details.stage.as_deref(), Some("running"), "{generation:?} {seed}");
            take_control(&mut world);

            for turn in 0..4 {
                let (mode, name) = [(YawMode::Lock, "lock"), (YawMode::Follow, "follow")][turn % 2];
                let asked = Asked::Operation(Operation::SetYawMode(mode));
                let id = world.ask_by_name("camera", &asked);
                run(&mut world, places, 3 * SECOND);

                let answer = world.answers.iter().find(|(answered, _)| *answered == id);
                assert_eq!(answer, Some(&(id, Ok(()))), "{generation:?} {seed} {name}");
                // It says so once a second in SYS_STATUS, which may be lost.
                run(&mut world, places, Duration::from_millis(2500));
                assert_eq!(seen(&world).details.mode.as_deref(), Some(name), "{generation:?} {seed}");
            }
        }
    }
}
