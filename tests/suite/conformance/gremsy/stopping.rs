//! "A gimbal that turns after its operator is gone is our worst bug": what takes the place of a rotation, on a line or with
//! a gimbal that does not do it.

use std::cell::Cell;
use std::rc::Rc;

use gimbald::bridge::settings::Transport;
use gimbald::geometry::AngularRate;
use gimbald::gimbals::gremsy::packet;
use gimbald::gimbals::operation::{OperationError, Restart, YawMode};
use gimbald::manager::asked::NotDone;
use gimbald::wire::dialect::{
    COMMAND_ACK_DATA, CharArray, HEARTBEAT_DATA, MOUNT_ORIENTATION_DATA, MavMessage, MessageData,
    PARAM_REQUEST_LIST_DATA, PARAM_REQUEST_READ_DATA, PARAM_VALUE_DATA,
};
use gimbald::wire::{DatagramFrames, FrameBuffer};

use super::*;
use crate::support::interception::{Intercepted, Interceptor, Passage};
use crate::support::script::NAN;
use crate::support::world::GIMBAL;

/// What the gimbal does not hear.
#[derive(Clone, Debug, Default)]
struct Deaf {
    /// A command.
    command: Rc<Cell<Option<u16>>>,
    /// So many setpoints of either generation.
    setpoints: Rc<Cell<u32>>,
    /// Anything, nor is it heard.
    everything: Rc<Cell<bool>>,
    /// It is not heard.
    mute: Rc<Cell<bool>>,
    /// Where North is.
    north: Rc<Cell<bool>>,
}

impl Interceptor for Deaf {
    fn towards_peer(&mut self, bytes: &[u8]) -> Passage {
        if self.everything.get() {
            return Passage::Lost;
        }
        let id = u32::from_le_bytes([bytes[7], bytes[8], bytes[9], 0]);
        let number = (id == COMMAND_LONG_DATA::ID).then(|| u16::from_le_bytes([bytes[38], bytes[39]]));
        let is_setpoint = number == Some(command::DO_MOUNT_CONTROL) || id == GIMBAL_DEVICE_SET_ATTITUDE_DATA::ID;
        if is_setpoint && self.setpoints.get() > 0 {
            self.setpoints.set(self.setpoints.get() - 1);
            return Passage::Lost;
        }
        if number.is_some() && number == self.command.get() { Passage::Lost } else { Passage::Through }
    }

    fn towards_core(&mut self, bytes: &[u8]) -> Passage {
        if self.everything.get() || self.mute.get() {
            return Passage::Lost;
        }
        let mut frames = DatagramFrames::new(bytes);
        let frame = frames.next_frame().expect("a frame");
        match frame.decode::<MOUNT_ORIENTATION_DATA>() {
            Some(told) if self.north.get() => {
                let told = MavMessage::MOUNT_ORIENTATION(MOUNT_ORIENTATION_DATA { yaw_absolute: 0.0, ..told });
                let mut buffer = FrameBuffer::default();
                Passage::As(buffer.encode_any(frame.source(), frame.sequence(), &told).bytes().to_vec())
            }
            _ => Passage::Through,
        }
    }
}

/// One that turns to the right by 5 degrees per second since a demand of the ground's.
fn turning(generation: Generation) -> (World, Places, Deaf) {
    let (mut world, places) = without_gimbal(GremsySettings::default());
    world.install(places.autopilot, Vehicle::new(Timestamp::ZERO, VehicleSettings::default()));
    let deaf = Deaf::default();
    let device = Device::new(Timestamp::ZERO, device(generation));
    world.install(places.gimbal, Intercepted::new(device, deaf.clone()));
    run(&mut world, places, 20 * SECOND);
    assert_eq!(seen(&world).details.stage.as_deref(), Some("running"));
    demand(&mut world, places, [NAN, NAN, 0.0, 5.0, 44.0]);
    run(&mut world, places, 2 * SECOND);
    assert!(looks(&world).1 > 5.0, "{:?}", looks(&world));
    world.forget();
    (world, places, deaf)
}

/// The same for who has control by the gimbal's name.
fn turning_by_name(generation: Generation) -> (World, Places, Deaf) {
    let (mut world, places, deaf) = turning(generation);
    take_control(&mut world);
    run(&mut world, places, SECOND);
    let (pitch, yaw) = (AngularRate::ZERO, AngularRate::from_degrees_per_second(5.0));
    let asked = Asked::Turn { roll: None, pitch, yaw, yaw_frame: YawFrame::Vehicle };
    let id = world.ask_by_name("camera", &asked);
    assert_eq!(world.answers.last(), Some(&(id, Ok(()))));
    let before = looks(&world).1;
    run(&mut world, places, SECOND);
    assert!(looks(&world).1 > before + 2.0, "{before} {:?}", looks(&world));
    world.forget();
    (world, places, deaf)
}

/// The same about any axis, at so many degrees per second of roll, pitch and yaw, begun far from the end stop.
fn turning_about(generation: Generation, rates_dps: [f64; 3]) -> (World, Places, Deaf) {
    let (mut world, places, deaf) = turning_by_name(generation);
    let axis = |degrees: f64| AxisDemand { angle: Some(Angle::from_degrees(degrees)), rate: None };
    let away = |rate: f64, stop: f64| axis(if rate == 0.0 { 0.0 } else { -stop * rate.signum() });
    let [roll, pitch, _] = rates_dps;
    let (far_roll, far_pitch) = (away(roll, 35.0), away(pitch, 40.0));
    let point = Asked::Point { roll: far_roll, pitch: far_pitch, yaw: axis(0.0), yaw_frame: YawFrame::Vehicle };
    let [roll, pitch, yaw] = rates_dps.map(AngularRate::from_degrees_per_second);
    let turn = Asked::Turn { roll: Some(roll), pitch, yaw, yaw_frame: YawFrame::Vehicle };
    for (asked, wait) in [(point, 4 * SECOND), (turn, SECOND)] {
        let id = world.ask_by_name("camera", &asked);
        assert_eq!(world.answers.last(), Some(&(id, Ok(()))), "{asked:?}");
        run(&mut world, places, wait);
    }
    world.forget();
    (world, places, deaf)
}

/// Roll, pitch and yaw from the nose as the status shows them, degrees.
fn pose(world: &World) -> [f64; 3] {
    let (pitch, yaw) = looks(world);
    [seen(world).attitude.roll_deg.expect("a roll"), pitch, yaw]
}

/// By how far it looks elsewhere than before, about each axis: the shorter way round.
fn turned_since(before: [f64; 3], world: &World) -> [f64; 3] {
    let now = pose(world);
    [0, 1, 2].map(|axis| Angle::from_degrees(now[axis] - before[axis]).wrapped().degrees())
}

/// It turns about nothing.
#[track_caller]
fn assert_rests(world: &mut World, places: Places) {
    let before = pose(world);
    run(world, places, 3 * SECOND);
    let turned = turned_since(before, world);
    assert!(turned.iter().all(|turned| turned.abs() < 0.5), "it turns on: {turned:?} since {before:?}");
}

/// The replacement of a rotation takes a mode that the gimbal does not change to: it stands all the same.
#[test]
fn an_angle_in_another_mode_that_it_does_not_take_stops_it() {
    let (mut world, places, deaf) = turning(Generation::V1);
    deaf.command.set(Some(packet::lock(GIMBAL).command));
    demand(&mut world, places, [0.0, 90.0, NAN, NAN, 92.0]);
    run(&mut world, places, SECOND);
    assert_rests(&mut world, places);
    let zeros = told(&mut world, places, command::DO_MOUNT_CONTROL);
    assert!(!zeros.is_empty() && zeros.iter().all(|zero| *zero == packet::turn_at(GIMBAL, Default::default())));
}

/// The zeros that an operation begins with are lost: it is not done before one was heard.
#[test]
fn what_is_asked_by_name_waits_until_it_has_stopped() {
    for generation in [Generation::V1, Generation::V2] {
        for operation in [Operation::SetYawMode(YawMode::Follow), Operation::RadioControl] {
            let (mut world, places, deaf) = turning_by_name(generation);
            // That is a second, and another one in which it is watched.
            deaf.setpoints.set(10);
            assert_eq!(operate(&mut world, places, operation.clone()), Some(Ok(())), "{generation:?} {operation:?}");
            assert_rests(&mut world, places);
        }
    }
}

/// What is heard while nothing arrives does not mean that it has stopped: it tells that it turns, about whatever that is.
#[test]
fn one_that_tells_that_it_turns_has_not_stopped() {
    for operation in [Operation::SetYawMode(YawMode::Follow), Operation::RadioControl] {
        for rates in [[0.0, 0.0, 5.0], [0.0, -3.0, 0.0], [3.0, 0.0, 0.0]] {
            let (mut world, places, deaf) = turning_about(Generation::V2, rates);
            deaf.setpoints.set(40);
            let not_done = operate(&mut world, places, operation.clone());
            assert_eq!(
                not_done,
                Some(Err(NotDone::Operation(OperationError::StillTurning))),
                "{operation:?} {rates:?}"
            );
            run(&mut world, places, 4 * SECOND);
            assert_rests(&mut world, places);
        }
    }
}

/// One that hears none of them is not left alone.
#[test]
fn one_that_hears_no_stop_is_not_left_alone() {
    for operation in [Operation::SetYawMode(YawMode::Follow), Operation::RadioControl] {
        let (mut world, places, deaf) = turning_by_name(Generation::V1);
        deaf.setpoints.set(u32::MAX);
        let no_answer = Some(Err(NotDone::Operation(OperationError::NoAnswer)));
        assert_eq!(operate(&mut world, places, operation), no_answer);
        deaf.setpoints.set(0);
        // It goes back to where it was when it was to stop.
        run(&mut world, places, 4 * SECOND);
        assert_rests(&mut world, places);
    }
}

/// A line that is out towards the gimbal for longer than a stop is waited for, and something asked meanwhile that would take
/// the place of the zeros: it is not done, and the gimbal stands as soon as it hears again.
#[test]
#[rustfmt::skip]
fn one_that_hears_nothing_for_long_stands_when_it_hears_again() {
    for (operation,                              rates) in [
        (Operation::SetYawMode(YawMode::Follow), [0.0, 0.0, 5.0]),
        (Operation::SetYawMode(YawMode::Follow), [0.0, -2.5, 0.0]),
        (Operation::RadioControl,                [0.0, 0.0, 5.0]),
        (Operation::RadioControl,                [1.5, 0.0, 0.0]),
        (Operation::Mapping,                     [0.0, 0.0, 5.0]),
    ] {
        let (mut world, places, deaf) = turning_about(Generation::V2, rates);
        deaf.setpoints.set(u32::MAX);
        run(&mut world, places, 20 * SECOND);
        let not_done = operate(&mut world, places, operation.clone());
        assert_eq!(not_done, Some(Err(NotDone::Operation(OperationError::StillTurning))), "{operation:?} {rates:?}");
        let before = pose(&world);
        run(&mut world, places, SECOND);
        let turned = turned_since(before, &world);
        assert!(turned.iter().zip(rates).all(|(turned, rate)| (turned - rate).abs() < 0.5), "it turns on: {turned:?} {rates:?}");
        deaf.setpoints.set(0);
        run(&mut world, places, 6 * SECOND);
        assert_rests(&mut world, places);
    }
}

/// Nothing arrives at it, and then it is not heard either: what took the place of the rotation is said no more, so zeros are,
/// until it stands. Silence stops nothing.
#[test]
fn one_that_is_lost_while_it_turns_on_is_told_to_stop() {
    for (generation, replacement) in [
        (Generation::V1, [NAN, NAN, 0.0, 0.0, 44.0]),
        (Generation::V2, [NAN, NAN, 0.0, 0.0, 44.0]),
        (Generation::V2, [0.0, 0.0, NAN, NAN, 44.0]),
    ] {
        let (mut world, places, deaf) = turning(generation);
        let before = looks(&world).1;
        deaf.setpoints.set(u32::MAX);
        demand(&mut world, places, replacement);
        run(&mut world, places, 3 * SECOND);
        deaf.mute.set(true);
        run(&mut world, places, 8 * SECOND);
        assert_eq!(seen(&world).state, "lost");
        world.forget();
        run(&mut world, places, 5 * SECOND);
        let (commands, setpoints) = orders(&mut world, places);
        let rates = setpoints.iter().map(|zero| [zero.angular_velocity_y, zero.angular_velocity_z]);
        let all = commands.iter().map(|zero| [zero.param2, zero.param3]).chain(rates).collect::<Vec<_>>();
        assert_eq!(all, [[0.0; 2]; 5], "{generation:?} {replacement:?}: one a second");

        deaf.setpoints.set(0);
        run(&mut world, places, 10 * SECOND);
        deaf.mute.set(false);
        run(&mut world, places, SECOND / 2);
        let turned = looks(&world).1 - before;
        assert!((80.0..=88.0).contains(&turned), "{generation:?} {replacement:?}: by {turned} in 16 s and not in 26");
        assert_rests(&mut world, places);
    }
}

/// It turns as it was told before its line was out, whatever it was told since.
#[test]
fn one_that_goes_on_as_it_was_told_before_is_stopped_too() {
    let (mut world, places, deaf) = turning_by_name(Generation::V2);
    deaf.setpoints.set(u32::MAX);
    for (pitch, yaw) in [(0.0, -20.0), (3.0, 0.0)] {
        let rate = AngularRate::from_degrees_per_second;
        let asked = Asked::Turn { roll: None, pitch: rate(pitch), yaw: rate(yaw), yaw_frame: YawFrame::Vehicle };
        world.ask_by_name("camera", &asked);
        run(&mut world, places, SECOND / 4);
    }
    let not_done = operate(&mut world, places, Operation::SetYawMode(YawMode::Follow));
    assert_eq!(not_done, Some(Err(NotDone::Operation(OperationError::StillTurning))));
    assert_eq!(world.stored_turning, ["camera\t1/154\tgremsy"]);
    deaf.setpoints.set(0);
    run(&mut world, places, 4 * SECOND);
    assert_rests(&mut world, places);
    assert_eq!(world.stored_turning, [""; 0]);
}

/// "with 5 % loss, duplication": a second copy of an answer to the rate is none to the stop, which has not arrived.
#[test]
fn a_copy_of_an_answer_does_not_stop_it() {
    let operations =
        [Operation::SetYawMode(YawMode::Follow), Operation::RadioControl, Operation::Reset(ResetMode::Yaw)];
    for (operation, knows_north) in operations.into_iter().flat_map(|it| [(it.clone(), true), (it, false)]) {
        let (mut world, places, deaf) = turning_by_name(Generation::V1);
        deaf.north.set(!knows_north);
        deaf.setpoints.set(40);
        let ack = COMMAND_ACK_DATA {
            command: command::DO_MOUNT_CONTROL,
            result: 0,
            progress: 0,
            result_param2: 0,
            target_system: 1,
            target_component: 191,
        };
        world.ask_by_name("camera", &Asked::Operation(operation.clone()));
        for _ in 0..20 {
            world.send(places.gimbal, GIMBAL, &MavMessage::COMMAND_ACK(ack.clone()));
        }
        run(&mut world, places, 2 * SECOND);
        assert_eq!(world.stored_turning.len(), 1, "{operation:?}");
        run(&mut world, places, 8 * SECOND);
        assert_eq!(deaf.setpoints.get(), 0, "the stop was said until it was heard");
        assert_rests(&mut world, places);
        assert_eq!(world.stored_turning, [""; 0], "{operation:?}");
    }
}

/// A line that is out in both directions looks like a restart to who asked for one: the gimbal is stopped when it is back.
#[test]
fn one_that_only_seems_to_have_started_again_is_stopped() {
    for generation in [Generation::V1, Generation::V2] {
        for restart in [Restart::Reboot, Restart::Shutdown] {
            let (mut world, places, deaf) = turning_by_name(generation);
            let before = pose(&world);
            deaf.everything.set(true);
            let done = operate(&mut world, places, Operation::Restart(restart));
            assert_eq!(done, Some(Ok(())), "{generation:?} {restart:?}");
            assert_eq!(world.stored_turning, ["camera\t1/154\tgremsy"], "{generation:?} {restart:?}");
            deaf.everything.set(false);
            run(&mut world, places, 4 * SECOND);
            // For eight seconds at 5 degrees per second, and as fast as the vehicle besides where it turns about North.
            let turned = turned_since(before, &world)[2];
            assert!(turned > 35.0, "it has turned on: by {turned} since {before:?}");
            assert_rests(&mut world, places);
            assert_eq!(world.stored_turning, [""; 0], "{generation:?} {restart:?}");
        }
    }
}

/// Neutral, and the hand-over to its radio control, by a demand whose first zeros are lost.
#[test]
fn neutral_and_radio_control_come_after_the_stop() {
    for generation in [Generation::V1, Generation::V2] {
        for flags in [2.0, 300.0] {
            let (mut world, places, deaf) = turning(generation);
            if flags != 2.0 && generation == Generation::V2 {
                continue;
            }
            deaf.setpoints.set(3);
            demand(&mut world, places, [NAN, NAN, NAN, NAN, flags]);
            run(&mut world, places, 4 * SECOND);
            assert_rests(&mut world, places);
        }
    }
}

/// Gimbal statement 8: "an ACK … with target 2/191 is ignored." What the gimbal answers to another is no sign that it has
/// heard our stop.
#[test]
fn what_it_answers_to_another_does_not_tell_that_it_has_stopped() {
    let (mut world, places, deaf) = turning(Generation::V1);
    deaf.setpoints.set(u32::MAX);
    demand(&mut world, places, [NAN, NAN, 0.0, 0.0, 44.0]);
    for target in [(2, 191), (255, 190), (1, 192)] {
        for _ in 0..20 {
            let ack = COMMAND_ACK_DATA {
                command: command::DO_MOUNT_CONTROL,
                result: 0,
                progress: 0,
                result_param2: 0,
                target_system: target.0,
                target_component: target.1,
            };
            world.send(places.gimbal, GIMBAL, &MavMessage::COMMAND_ACK(ack));
        }
        run(&mut world, places, SECOND);
        assert_eq!(world.stored_turning, ["camera\t1/154\tgremsy"], "{target:?}");
    }
    deaf.setpoints.set(0);
    run(&mut world, places, 4 * SECOND);
    assert_eq!(world.stored_turning, [""; 0]);
}

/// One that hears neither a question for a parameter nor what moves it.
struct HardOfHearing(Deaf);

impl Interceptor for HardOfHearing {
    fn towards_peer(&mut self, bytes: &[u8]) -> Passage {
        let id = u32::from_le_bytes([bytes[7], bytes[8], bytes[9], 0]);
        let asks = [PARAM_REQUEST_READ_DATA::ID, PARAM_REQUEST_LIST_DATA::ID].contains(&id);
        if asks { Passage::Lost } else { self.0.towards_peer(bytes) }
    }
}

/// "Then one POWEROFF heartbeat": it is the last word and in time on a slow line too, however much else waits for that, such as
/// the parameters of a gimbal that an earlier run left turning, which are still asked for.
#[test]
fn at_the_end_the_goodbye_waits_for_no_question() {
    for generation in [Generation::V1, Generation::V2] {
        let gimbal = GimbalSettings { family: Family::Gremsy, ..GimbalSettings::found("camera".to_owned()) };
        let left_turning = vec!["camera\t1/154\tgremsy".to_owned()];
        let mut settings = Settings { gimbals: vec![gimbal], left_turning, ..three_links() };
        settings.links[1].transport = Transport::Serial { baud: 19_200 };
        let (mut world, places) = World::empty(settings.clone());
        world.kill();
        world.install(places.autopilot, Vehicle::new(Timestamp::ZERO, VehicleSettings::default()));
        let deaf = Deaf { setpoints: Rc::new(Cell::new(u32::MAX)), ..Deaf::default() };
        let device = Device::new(Timestamp::ZERO, device(generation));
        world.install(places.gimbal, Intercepted::new(device, HardOfHearing(deaf)));
        world.run_for(10 * SECOND);
        world.start(settings);
        let questions = |world: &mut World| from_manager::<PARAM_REQUEST_READ_DATA>(world, places).len();
        run(&mut world, places, 2 * SECOND);
        // One is told to somebody else; by that it is known which there are.
        let param_id = CharArray::from("STIFF_TILT");
        let value = PARAM_VALUE_DATA { param_value: 45.0, param_count: 80, param_index: 40, param_id, param_type: 4 };
        world.send(places.gimbal, GIMBAL, &MavMessage::PARAM_VALUE(value));
        while questions(&mut world) == 0 {
            run(&mut world, places, SECOND / 100);
            assert!(world.now < Timestamp::from_secs(20), "{generation:?}");
        }
        world.forget();
        let ended = world.now;

        world.input(Input::Shutdown);
        world.run_for(SECOND / 2);

        assert!(questions(&mut world) > 5, "{generation:?}: the line was full");
        let last = world.arrivals(places.gimbal).last().expect("the goodbye");
        assert_eq!(last.decode::<HEARTBEAT_DATA>().system_status, 7, "{generation:?}");
        assert!(last.at - ended < SECOND / 2, "{generation:?}: after {:?}", last.at - ended);
        assert!(world.bridge.is_finished());
    }
}
