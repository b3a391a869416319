//! Motors that are switched on and off by name, while it is told to look somewhere.

use gimbald::gimbals::operation::{Motors, OperationError};
use gimbald::manager::asked::NotDone;
use gimbald::manager::request::Refusal;
use gimbald::wire::dialect::COMMAND_ACK_DATA;

use super::*;
use crate::support::script::{ACCEPTED, of};

const FAULT: &str = "it was told to move while its motors are off. Switch them on";

/// Asks for motors, and lets so much time pass.
fn ask_for(world: &mut World, places: Places, motors: Motors, duration: Duration) -> OperationId {
    let asked = Asked::Operation(Operation::Motors(motors));
    let id = world.ask_by_name("camera", &asked);
    run(world, places, duration);
    id
}

fn answer_of(world: &World, id: OperationId) -> Option<Answer> {
    world.answers.iter().find(|(answered, _)| *answered == id).map(|(_, answer)| answer.clone())
}

/// "It was told to move while its motors are off. Switch them on": who does that is no other demand, and it goes where it
/// was told to look.
#[test]
fn the_remedy_for_motors_that_are_off_helps() {
    for generation in [Generation::V1, Generation::V2] {
        for after in [300, 310, 325, 340] {
            let (mut world, places) = running(generation);
            take_control(&mut world);
            assert_eq!(operate(&mut world, places, Operation::Motors(Motors::Off)), Some(Ok(())));
            point(&mut world, -30.0, 20.0);
            run(&mut world, places, Duration::from_millis(after));
            assert_eq!(seen(&world).details.faults, [FAULT], "{generation:?}");

            let id = ask_for(&mut world, places, Motors::On, 8 * SECOND);

            assert_eq!(answer_of(&world, id), Some(Ok(())), "{generation:?} {after}");
            assert_eq!(seen(&world).details.faults, [""; 0], "{generation:?}");
            assert_looks(&world, -30.0, 20.0);
        }
    }
}

/// The same by `USER_1` (31010), "answered IN_PROGRESS at once and with the result when the gimbal has done them".
#[test]
fn the_remedy_by_command_helps_as_well() {
    for generation in [Generation::V1, Generation::V2] {
        for after in [300, 310, 325, 340] {
            let (mut world, places) = running(generation);
            take_control(&mut world);
            assert_eq!(operate(&mut world, places, Operation::Motors(Motors::Off)), Some(Ok(())));
            world.ask_by_name("camera", &Asked::ReleaseControl);
            demand(&mut world, places, [-30.0, 20.0, f32::NAN, f32::NAN, 0.0]);
            run(&mut world, places, Duration::from_millis(after));
            world.take(places.ground);

            let on = command_long(MANAGER, command::USER_1, &[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]);
            world.send(places.ground, GCS, &on);
            run(&mut world, places, 8 * SECOND);

            let acks: Vec<COMMAND_ACK_DATA> = of(&world.take(places.ground));
            let results: Vec<u8> =
                acks.into_iter().filter(|ack| ack.command == command::USER_1).map(|ack| ack.result).collect();
            assert_eq!(results, [5, ACCEPTED], "{generation:?} {after}");
            assert_looks(&world, -30.0, 20.0);
        }
    }
}

/// A new demand while they start is obeyed when they run, and is no reason for not switching them on.
#[test]
fn a_demand_while_they_start_waits_for_them() {
    for generation in [Generation::V1, Generation::V2] {
        // Its flags are told twenty times a second.
        for before in [0, 10, 20, 30, 40] {
            let (mut world, places) = running(generation);
            take_control(&mut world);
            assert_eq!(operate(&mut world, places, Operation::Motors(Motors::Off)), Some(Ok(())));
            run(&mut world, places, Duration::from_millis(before));
            let id = ask_for(&mut world, places, Motors::On, Duration::ZERO);
            assert_eq!(answer_of(&world, id), None, "{generation:?} {before}");
            point(&mut world, -20.0, 10.0);
            run(&mut world, places, 8 * SECOND);
            assert_eq!(answer_of(&world, id), Some(Ok(())), "{generation:?} {before}");
            assert_looks(&world, -20.0, 10.0);
        }
    }
}

/// "Answered … with the result when the gimbal has done them": when its status shows it, in either generation.
#[test]
fn motors_are_answered_when_the_status_shows_it() {
    for generation in [Generation::V1, Generation::V2] {
        let (mut world, places) = running(generation);
        take_control(&mut world);
        for (motors, is_on) in [(Motors::Off, false), (Motors::On, true)] {
            let id = ask_for(&mut world, places, motors, Duration::ZERO);
            for _ in 0..600 {
                run(&mut world, places, Duration::from_millis(10));
                let shown = seen(&world).details.motors_on == Some(is_on);
                assert_eq!(answer_of(&world, id), shown.then_some(Ok(())), "{generation:?} {motors:?}");
            }
            assert_eq!(answer_of(&world, id), Some(Ok(())), "{generation:?} {motors:?}");
        }
    }
}

/// Nothing moves that nobody asked to move: motors that run are left alone.
#[test]
fn motors_that_run_are_not_switched_on_by_way_of_home() {
    let (mut world, places) = running(Generation::V2);
    take_control(&mut world);
    point(&mut world, -30.0, 20.0);
    run(&mut world, places, 5 * SECOND);
    world.forget();

    let id = ask_for(&mut world, places, Motors::On, 2 * SECOND);

    assert_eq!(answer_of(&world, id), Some(Ok(())));
    let (commands, setpoints) = orders(&mut world, places);
    assert_eq!(commands, []);
    let home = gimbald::wire::ids::GimbalFlags::NEUTRAL.bits();
    assert!(setpoints.iter().all(|setpoint| setpoint.flags & home == 0), "{setpoints:?}");
    assert_looks(&world, -30.0, 20.0);
}

/// "Dangerous ones (motors off, reboot) need an explicit word and the holder's right": a retract that switches the motors
/// off is one of them; where it only stows the camera it is not.
#[test]
fn a_retract_that_cuts_the_motors_needs_the_word_and_the_right() {
    let denied = |reason| Some(Err(NotDone::Refused { refusal: Refusal::denied(reason), holder: None }));
    for generation in [Generation::V1, Generation::V2] {
        let allowed = GremsySettings { retract_allowed: true, ..GremsySettings::default() };
        let (mut world, places) = running_with(device(generation), allowed);
        for (may_cut_motors, reason) in [(false, "unconfirmed"), (true, "only_for_the_holder")] {
            assert_eq!(ask(&mut world, places, &Asked::Retract { may_cut_motors }), denied(reason), "{generation:?}");
        }
        take_control(&mut world);
        let unconfirmed = Asked::Retract { may_cut_motors: false };
        assert_eq!(ask(&mut world, places, &unconfirmed), denied("unconfirmed"), "{generation:?}");
        assert_eq!(orders(&mut world, places), (vec![], vec![]), "{generation:?}: it was told nothing");
        assert_eq!(seen(&world).details.motors_on, Some(true), "{generation:?}");

        take_control(&mut world);
        assert_eq!(ask(&mut world, places, &Asked::Retract { may_cut_motors: true }), Some(Ok(())), "{generation:?}");
        assert_eq!(seen(&world).details.motors_on, Some(false), "{generation:?}");

        // Stowed, where nobody has control and everybody may steer.
        let stowed = GremsySettings { stow_pitch: Angle::from_degrees(-60.0), ..GremsySettings::default() };
        let (mut world, places) = running_with(device(generation), stowed);
        assert_eq!(ask(&mut world, places, &Asked::Retract { may_cut_motors: false }), Some(Ok(())), "{generation:?}");
        assert_eq!(seen(&world).details.motors_on, Some(true), "{generation:?}");
        assert_looks(&world, -60.0, 0.0);
    }
}

/// A gimbal that is told to stay retracted keeps its motors off, and whoever asks for them is told that they are.
#[test]
fn retract_keeps_them_off() {
    let (mut world, places) =
        running_with(device(Generation::V2), GremsySettings { retract_allowed: true, ..GremsySettings::default() });
    take_control(&mut world);
    world.ask_by_name("camera", &Asked::Retract { may_cut_motors: true });
    run(&mut world, places, 2 * SECOND);

    let id = ask_for(&mut world, places, Motors::On, 8 * SECOND);

    assert_eq!(seen(&world).details.motors_on, Some(false));
    let answer = answer_of(&world, id);
    assert!(matches!(answer, Some(Err(NotDone::Operation(OperationError::NoEffect(_))))), "{answer:?}");
}
