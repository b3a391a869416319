//! A known gimbal that starts again: nothing that is asked meanwhile is done when it is ready, nor is what was asked before.
//!
//! TEMPORARILY_REJECTED is for what "would work later without any change by the user: … device calibrating/booting" (the
//! Gimbal Protocol's results, section 2.7 of the notes); "nothing moves it when it comes back until somebody asks".

use gimbald::bridge::settings::SystemId;
use gimbald::gimbals::operation::{OperationError, Restart, YawMode};
use gimbald::manager::asked::NotDone;
use gimbald::manager::request::Refusal;
use gimbald::wire::dialect::COMMAND_ACK_DATA;
use gimbald::wire::ids::CommandResult;
use gimbald::wire::{DatagramFrames, encode_to_vec};

use super::*;
use crate::support::interception::{Intercepted, Interceptor, Passage};
use crate::support::script::{
    ACCEPTED, DENIED, FAILED, NAN, TEMPORARILY_REJECTED, command_int, set_attitude, set_manual_control, set_pitchyaw,
};
use crate::support::world::GIMBAL;

const HALF: Duration = Duration::from_millis(500);

/// What the gimbal makes of a command to start again.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Obedience {
    /// It does, and its answer is lost.
    AnswerLost,
    /// It does the third, and no answer arrives.
    HearsTheLast,
    Refuses,
    /// It says that it does, and goes on.
    Pretends,
}

#[derive(Debug)]
struct Stubborn {
    obedience: Obedience,
    heard: u8,
}

impl Interceptor for Stubborn {
    fn towards_peer(&mut self, bytes: &[u8]) -> Passage {
        let mut frames = DatagramFrames::new(bytes);
        let command = frames.next_frame().and_then(|frame| frame.decode::<COMMAND_LONG_DATA>());
        if command.is_none_or(|command| command.command != command::PREFLIGHT_REBOOT_SHUTDOWN) {
            return Passage::Through;
        }
        self.heard += 1;
        let result = match self.obedience {
            Obedience::HearsTheLast if self.heard < 3 => return Passage::Lost,
            Obedience::AnswerLost | Obedience::HearsTheLast => return Passage::Through,
            Obedience::Refuses => DENIED,
            Obedience::Pretends => ACCEPTED,
        };
        let ack = COMMAND_ACK_DATA {
            command: command::PREFLIGHT_REBOOT_SHUTDOWN,
            result,
            progress: 255,
            result_param2: 0,
            target_system: MANAGER.system,
            target_component: MANAGER.component,
        };
        Passage::Answered(encode_to_vec(GIMBAL, 0, &ack))
    }

    fn towards_core(&mut self, bytes: &[u8]) -> Passage {
        let ack = DatagramFrames::new(bytes).next_frame().and_then(|frame| frame.decode::<COMMAND_ACK_DATA>());
        let is_lost = ack.is_some_and(|ack| ack.command == command::PREFLIGHT_REBOOT_SHUTDOWN);
        if is_lost { Passage::Lost } else { Passage::Through }
    }
}

fn stubborn(generation: Generation, obedience: Obedience) -> (World, Places) {
    let (mut world, places) = without_gimbal(GremsySettings::default());
    world.install(places.autopilot, Vehicle::new(Timestamp::ZERO, VehicleSettings::default()));
    let device = Device::new(Timestamp::ZERO, device(generation));
    world.install(places.gimbal, Intercepted::new(device, Stubborn { obedience, heard: 0 }));
    run(&mut world, places, 20 * SECOND);
    assert_eq!(stage(&world), "running");
    take_control(&mut world);
    (world, places)
}

fn stage(world: &World) -> String {
    seen(world).details.stage.expect("a stage")
}

/// Events of the gimbal itself, the oldest first.
fn events(world: &World) -> Vec<String> {
    let snapshot = world.snapshot();
    let of_gimbal = |what: &str| what.starts_with("gimbal_") || what == "operated";
    snapshot.events.iter().rev().map(|event| event.what.clone()).filter(|what| of_gimbal(what)).collect()
}

fn restart(world: &mut World, restart: Restart) -> OperationId {
    let asked = Asked::Operation(Operation::Restart(restart));
    world.ask_by_name("camera", &asked)
}

fn roi() -> gimbald::wire::dialect::MavMessage {
    command_int(MANAGER, command::DO_SET_ROI_LOCATION, [0.0; 4], 474_000_000, 85_000_000, 500.0)
}

/// What every way to move it is answered, asked in the name of who has control.
fn assert_refused(world: &mut World) {
    let later = Refusal { result: CommandResult::TemporarilyRejected, reason: "gimbal_starting" };
    let axis = |degrees| AxisDemand { angle: Some(Angle::from_degrees(degrees)), rate: None };
    for asked in [
        Asked::Point { roll: AxisDemand::default(), pitch: axis(-20.0), yaw: axis(10.0), yaw_frame: YawFrame::Vehicle },
        Asked::Lock,
        Asked::Follow,
        Asked::Neutral,
        Asked::Retract { may_cut_motors: false },
        Asked::EndRoi,
        Asked::LookAt {
            latitude_deg: 47.4,
            longitude_deg: 8.5,
            altitude_m: 500.0,
            datum: gimbald::manager::roi::Datum::MeanSeaLevel,
        },
    ] {
        let id = world.ask_by_name("camera", &asked);
        let refused = Err(NotDone::Refused { refusal: later, holder: None });
        assert_eq!(world.answers.last(), Some(&(id, refused)), "{asked:?} at {}", world.now);
    }
}

/// The same from the ground, where nobody has control.
fn assert_refused_to_the_ground(world: &mut World, places: Places, result: u8) {
    let mount = |params: [f32; 7]| command_long(MANAGER, command::DO_MOUNT_CONTROL, &params);
    for message in [
        command_long(MANAGER, command::DO_GIMBAL_MANAGER_PITCHYAW, &[-20.0, 10.0, NAN, NAN, 0.0, 0.0, 0.0]),
        command_long(MANAGER, command::DO_GIMBAL_MANAGER_PITCHYAW, &[NAN, NAN, 0.0, 10.0, 0.0, 0.0, 0.0]),
        command_long(MANAGER, command::DO_GIMBAL_MANAGER_PITCHYAW, &[NAN, NAN, NAN, NAN, 2.0, 0.0, 0.0]),
        mount([-20.0, 0.0, 10.0, 0.0, 0.0, 0.0, 2.0]),
        mount([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]),
        command_long(MANAGER, command::DO_MOUNT_CONFIGURE, &[1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0]),
        roi(),
        command_long(MANAGER, command::DO_SET_ROI_NONE, &[0.0; 7]),
    ] {
        assert_eq!(world.result_of(places.ground, GCS, &message), Some(result), "{message:?} at {}", world.now);
    }
    let counted =
        |world: &World| seen(world).rejected.get("255/190").map_or(0, |reasons| reasons.values().sum::<u64>());
    let before = counted(world);
    let q = [1.0, 0.0, 0.0, 0.0];
    for message in
        [set_pitchyaw(0.2, 0.2, NAN, NAN, 0), set_attitude(q, [NAN; 3], 12), set_manual_control(NAN, NAN, 0.5, 0.0)]
    {
        assert_eq!(world.ask(places.ground, GCS, &message), [], "{message:?}");
    }
    assert_eq!(counted(world), before + 3);
}

/// Until it is ready: asked again and again, refused, and never told anything; and when it is ready it stands and is obeyed.
fn assert_refused_until_ready(world: &mut World, places: Places, mut refuse: impl FnMut(&mut World)) -> Duration {
    let since = world.now;
    while stage(world) != "running" {
        refuse(world);
        world.forget();
        run(world, places, HALF);
        assert_eq!(orders(world, places), (vec![], vec![]), "at {}", world.now);
        assert!(world.now - since < 25 * SECOND, "{:?}", seen(world));
    }
    let took = world.now - since;
    world.forget();
    run(world, places, 5 * SECOND);
    assert_eq!(orders(world, places), (vec![], vec![]));
    assert_eq!((seen(world).setpoint, seen(world).roi), (None, None));
    assert_looks(world, 0.0, 0.0);
    took
}

/// Gimbal statement 32: "Reboot command followed by 10 s silence does not trigger a permanent loss; driver re-runs start-up".
/// A restart that we asked for, in the middle of a place or a rotation of whoever has control.
#[test]
fn while_it_starts_again_every_demand_is_refused_and_nothing_goes_on_afterwards() {
    for generation in [Generation::V1, Generation::V2] {
        for turns in [false, true] {
            let (mut world, places) = running(generation);
            take_control(&mut world);
            let (pitch, yaw) = (AngularRate::ZERO, AngularRate::from_degrees_per_second(5.0));
            let asked = match turns {
                true => Asked::Turn { roll: None, pitch, yaw, yaw_frame: YawFrame::Vehicle },
                false => Asked::LookAt {
                    latitude_deg: 47.4,
                    longitude_deg: 8.5,
                    altitude_m: 500.0,
                    datum: gimbald::manager::roi::Datum::MeanSeaLevel,
                },
            };
            let id = world.ask_by_name("camera", &asked);
            assert_eq!(world.answers.last(), Some(&(id, Ok(()))));
            run(&mut world, places, SECOND);

            let id = restart(&mut world, Restart::Reboot);
            // From that moment on, also before it has answered.
            assert_refused(&mut world);
            run(&mut world, places, 3 * SECOND);
            assert!(world.answers.contains(&(id, Ok(()))), "{generation:?}");
            let took = assert_refused_until_ready(&mut world, places, assert_refused);
            assert!(took > 10 * SECOND && took < 17 * SECOND, "{generation:?} {took:?}");
            let events = events(&world);
            assert_eq!(events, ["gimbal_found", "operated", "gimbal_restarted", "gimbal_ready"], "{generation:?}");

            point(&mut world, -20.0, 10.0);
            run(&mut world, places, 3 * SECOND);
            assert_looks(&world, -20.0, 10.0);
        }
    }
}

/// What happened is told when it happens: asked for, started again, ready.
#[test]
fn a_restart_is_told_when_it_happens() {
    for generation in [Generation::V1, Generation::V2] {
        let (mut world, places) = running(generation);
        take_control(&mut world);
        let asked_at = world.now;
        restart(&mut world, Restart::Reboot);
        run(&mut world, places, 25 * SECOND);
        let snapshot = world.snapshot();
        let at = |what: &str| {
            let events: Vec<f64> =
                snapshot.events.iter().filter(|event| event.what == what).map(|event| event.at_s).collect();
            assert_eq!(events.len(), 1, "{generation:?} {what} {events:?}");
            events[0] - asked_at.as_micros() as f64 / 1e6
        };
        assert!(at("operated") < 0.1, "{generation:?} {}", at("operated"));
        // Ten seconds without power, two deaf and mute, and then it is heard.
        assert!((11.0..14.0).contains(&at("gimbal_restarted")), "{generation:?} {}", at("gimbal_restarted"));
        assert!((15.0..18.0).contains(&at("gimbal_ready")), "{generation:?} {}", at("gimbal_ready"));
    }
}

/// To stop, to give up control and to look are possible all the time.
#[test]
fn while_it_starts_again_it_can_be_stopped_let_go_and_looked_at() {
    for generation in [Generation::V1, Generation::V2] {
        let (mut world, places) = running(generation);
        demand(&mut world, places, [NAN, NAN, 0.0, 5.0, 0.0]);
        run(&mut world, places, SECOND);
        take_control(&mut world);
        restart(&mut world, Restart::Reboot);
        for _ in 0..16 {
            let id = world.ask_by_name("camera", &Asked::Stop);
            assert_eq!(world.answers.last(), Some(&(id, Ok(()))), "{generation:?} at {}", world.now);
            run(&mut world, places, SECOND);
        }
        run(&mut world, places, 10 * SECOND);
        assert_eq!(stage(&world), "running");
        // What was told to one without motors does not hold it there.
        assert_looks(&world, 0.0, 0.0);
        assert!(events(&world).contains(&"gimbal_restarted".to_owned()));
        assert_eq!(seen(&world).details.faults, Vec::<String>::new(), "{generation:?}");

        take_control(&mut world);
        restart(&mut world, Restart::Reboot);
        run(&mut world, places, SECOND);
        let id = world.ask_by_name("camera", &Asked::ReleaseControl);
        assert_eq!(world.answers.last(), Some(&(id, Ok(()))));
        assert_eq!(seen(&world).primary, None);
        let stop = command_long(MANAGER, command::DO_GIMBAL_MANAGER_PITCHYAW, &[NAN, NAN, 0.0, 0.0, 0.0, 0.0, 0.0]);
        assert_eq!(world.result_of(places.ground, GCS, &stop), Some(ACCEPTED));
        assert_eq!(stage(&world), "restarting");
    }
}

/// Gimbal statement 32, where nobody here asked for the restart: over a short cut of its power, and with ten seconds of
/// silence, for which it counts as lost.
#[test]
fn a_restart_that_nobody_asked_for_is_none_that_anything_waits_for() {
    for generation in [Generation::V1, Generation::V2] {
        for is_long in [false, true] {
            let (mut world, places) = running(generation);
            assert_eq!(world.result_of(places.ground, GCS, &roi()), Some(ACCEPTED));
            run(&mut world, places, SECOND);
            if is_long {
                // Somebody beside us on its line.
                let reboot =
                    COMMAND_LONG_DATA { target_component: 154, ..gimbald::gimbals::gremsy::packet::reboot(GIMBAL) };
                let bytes = encode_to_vec(MavId::new(1, 100), 0, &reboot);
                world.tell_peer(places.gimbal, &bytes);
                run(&mut world, places, 6 * SECOND);
                assert_eq!(seen(&world).state, "lost");
                assert_refused_to_the_ground(&mut world, places, FAILED);
            } else {
                world.reboot(places.gimbal);
            }
            while seen(&world).state == "lost" || stage(&world) == "running" {
                run(&mut world, places, Duration::from_millis(100));
            }
            let took = assert_refused_until_ready(&mut world, places, |world| {
                assert_refused_to_the_ground(world, places, TEMPORARILY_REJECTED);
            });
            assert!(took > 3 * SECOND && took < 8 * SECOND, "{generation:?} {took:?}");
            let told = events(&world);
            let expected: &[&str] = match is_long {
                true => &["gimbal_found", "gimbal_lost", "gimbal_back", "gimbal_restarted", "gimbal_ready"],
                false => &["gimbal_found", "gimbal_restarted", "gimbal_ready"],
            };
            assert_eq!(told, expected, "{generation:?}");
            demand(&mut world, places, [-20.0, 10.0, NAN, NAN, 0.0]);
            run(&mut world, places, 3 * SECOND);
            assert_looks(&world, -20.0, 10.0);
        }
    }
}

/// The same for one whose family was found out.
#[test]
fn with_the_family_found_out_it_is_the_same() {
    for generation in [Generation::V1, Generation::V2] {
        let (mut world, places) = World::empty(Settings { system_id: SystemId::Fixed(1), ..three_links() });
        world.install(places.autopilot, Vehicle::new(Timestamp::ZERO, VehicleSettings::default()));
        world.install(places.gimbal, Device::new(Timestamp::ZERO, device(generation)));
        run(&mut world, places, 20 * SECOND);
        assert_eq!((seen(&world).family.as_str(), stage(&world).as_str()), ("gremsy", "running"));
        demand(&mut world, places, [NAN, NAN, 0.0, 5.0, 0.0]);
        run(&mut world, places, SECOND);
        world.reboot(places.gimbal);
        while stage(&world) == "running" {
            run(&mut world, places, Duration::from_millis(100));
        }
        assert_refused_until_ready(&mut world, places, |world| {
            assert_refused_to_the_ground(world, places, TEMPORARILY_REJECTED);
        });
        demand(&mut world, places, [-20.0, 10.0, NAN, NAN, 0.0]);
        run(&mut world, places, 3 * SECOND);
        assert_looks(&world, -20.0, 10.0);
    }
}

/// Gimbal statement 32, where it starts again and its answer is lost, or two of three commands are: its silence tells.
#[test]
fn a_lost_answer_makes_no_difference() {
    for generation in [Generation::V1, Generation::V2] {
        for obedience in [Obedience::AnswerLost, Obedience::HearsTheLast] {
            let (mut world, places) = stubborn(generation, obedience);
            let id = restart(&mut world, Restart::Reboot);
            assert_refused(&mut world);
            run(&mut world, places, 2 * SECOND);
            assert!(world.answers.contains(&(id, Ok(()))), "{generation:?} {obedience:?} {:?}", world.answers);
            assert_eq!(stage(&world), "restarting");
            assert_refused_until_ready(&mut world, places, assert_refused);
            let events = events(&world);
            assert_eq!(events, ["gimbal_found", "operated", "gimbal_restarted", "gimbal_ready"], "{generation:?}");
        }
    }
}

/// Gimbal statement 32, where it does not start again: one that refuses is steered on at once, and one that only says that
/// it does within seconds. Nobody is locked out, and nothing is told that did not happen.
#[test]
fn a_gimbal_that_does_not_start_again_is_steered_on() {
    for generation in [Generation::V1, Generation::V2] {
        for (obedience, answer, within) in [
            (Obedience::Refuses, Err(NotDone::Operation(OperationError::Denied)), SECOND / 2),
            (Obedience::Pretends, Ok(()), 5 * SECOND),
        ] {
            let (mut world, places) = stubborn(generation, obedience);
            let id = restart(&mut world, Restart::Reboot);
            run(&mut world, places, within);
            assert!(world.answers.contains(&(id, answer)), "{generation:?} {obedience:?} {:?}", world.answers);
            point(&mut world, -20.0, 10.0);
            run(&mut world, places, 3 * SECOND);
            assert_looks(&world, -20.0, 10.0);
            assert_eq!(events(&world), ["gimbal_found", "operated"], "{generation:?} {obedience:?}");
        }
    }
}

/// What else moves it is refused as well, and is not kept for later.
#[test]
fn operations_that_move_it_wait_for_no_restart() {
    for generation in [Generation::V1, Generation::V2] {
        let (mut world, places) = running(generation);
        take_control(&mut world);
        restart(&mut world, Restart::Reboot);
        run(&mut world, places, SECOND);
        let reset = Operation::Reset(ResetMode::PitchDownUpAndYaw);
        let moving = [reset, Operation::SetYawMode(YawMode::Lock), Operation::Mapping, Operation::RadioControl];
        while stage(&world) != "running" {
            for operation in &moving {
                let asked = Asked::Operation(operation.clone());
                let id = world.ask_by_name("camera", &asked);
                let not_ready = Err(NotDone::Operation(OperationError::NotReady));
                assert_eq!(world.answers.last(), Some(&(id, not_ready)), "{generation:?} {operation:?}");
            }
            run(&mut world, places, SECOND);
        }
        world.forget();
        run(&mut world, places, 5 * SECOND);
        assert_eq!(orders(&mut world, places), (vec![], vec![]), "{generation:?}");
        assert_looks(&world, 0.0, 0.0);
    }
}
