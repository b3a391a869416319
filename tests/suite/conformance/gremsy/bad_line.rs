//! What a bad line may not spoil.

use std::cell::Cell;
use std::rc::Rc;
use std::time::Duration;

use gimbald::gimbals::gremsy::config::GremsySettings;
use gimbald::gimbals::gremsy::sim::{Device, Generation};
use gimbald::gimbals::operation::{Operation, OperationError, YawMode};
use gimbald::manager::asked::{Asked, NotDone};
use gimbald::sim::faults::{Faults, FaultyPeer};
use gimbald::sim::vehicle::{Vehicle, VehicleSettings};
use gimbald::timestamp::Timestamp;
use gimbald::wire::DatagramFrames;

use super::{SECOND, device, run, seen, take_control, without_gimbal};
use crate::support::interception::{Intercepted, Interceptor, Passage};

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

/// Loses what is asked for parameters (20, 21, 23) as long as it is told to.
struct WithoutQuestions(Rc<Cell<bool>>);

impl Interceptor for WithoutQuestions {
    fn towards_peer(&mut self, bytes: &[u8]) -> Passage {
        let frame = DatagramFrames::new(bytes).next_frame().expect("the core sends whole frames");
        if self.0.get() && (20..=23).contains(&frame.message_id()) { Passage::Lost } else { Passage::Through }
    }
}

/// "504: `no_answer` where none came this time" (`docs/interface.md`): a reading of which nothing came is not done, what was
/// known stays known, and the gimbal is steered on.
#[test]
fn a_reading_without_an_answer_is_not_done() {
    for generation in [Generation::V1, Generation::V2] {
        let (mut world, places) = without_gimbal(GremsySettings::default());
        world.install(places.autopilot, Vehicle::new(Timestamp::ZERO, VehicleSettings::default()));
        let is_lost = Rc::new(Cell::new(false));
        let gimbal = Device::new(Timestamp::ZERO, device(generation));
        world.install(places.gimbal, Intercepted::new(gimbal, WithoutQuestions(Rc::clone(&is_lost))));
        run(&mut world, places, 25 * SECOND);
        let known = seen(&world).details.parameters.clone();
        assert!(known.len() > 30, "{generation:?} {known:?}");
        for (lost, answer) in [(true, Err(NotDone::Operation(OperationError::NoAnswer))), (false, Ok(()))] {
            is_lost.set(lost);
            let asked = Asked::Operation(Operation::RefreshParameters);
            let id = world.ask_by_name("camera", &asked);
            run(&mut world, places, 20 * SECOND);
            let answers: Vec<_> = world.answers.iter().filter(|(answered, _)| *answered == id).collect();
            assert_eq!(answers, [&(id, answer)], "{generation:?}");
            assert_eq!(seen(&world).details.parameters, known, "{generation:?}");
            assert_eq!(seen(&world).details.stage.as_deref(), Some("running"), "{generation:?}");
        }
    }
}
