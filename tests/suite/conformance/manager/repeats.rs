//! Commands that come again because an answer was lost: answered alike, and carried out once.

use std::time::Duration;

use gimbald::wire::MavId;
use gimbald::wire::dialect::{COMMAND_ACK_DATA, MavMessage};
use proptest::prelude::*;

use super::frames::turn_vehicle;
use super::{COMPANION, FIELD, SECOND, assert_near, fly, look, run_looking, setpoints, told_control, with_gimbal};
use crate::support::script::{
    ACCEPTED, DENIED, NAN, TEMPORARILY_REJECTED, ack, again, command_int, command_long, configure, in_frame, of,
    pitch_yaw_deg, pitchyaw, request_message, set_interval, set_pitchyaw, take_control,
};
use crate::support::world::{GCS, MANAGER, Places, World};

/// "When the identical CONFIGURE is received again with confirmation 1, the same ACK is sent again and no second change
/// event occurs." Also when the first has given control away.
#[test]
fn item_72_a_repeated_configure_changes_nothing_again() {
    for (request, holder) in [
        (take_control(), GCS),
        (configure([12.0, 34.0], [-1.0, -1.0]), MavId::new(12, 34)),
        (configure([-2.0, -2.0], [-2.0, -2.0]), GCS),
    ] {
        let (mut world, places) = with_gimbal();
        for confirmation in 0..4 {
            let answers = world.ask(places.ground, GCS, &again(confirmation, request.clone()));
            assert_eq!(of::<COMMAND_ACK_DATA>(&answers), [ack(GCS, 1001, ACCEPTED)]);
            let told = told_control(&answers).map(|(primary, _)| primary);
            assert_eq!(told, (confirmation == 0).then_some(holder), "281 tells of the change, and of nothing else");
            world.run_for(SECOND / 10);
        }
    }
}

/// A repeat of an angle in the vehicle's frame that is to be held over ground is not converted with another heading.
/// Client checklist E89: "Same command with confirmation 1 (a repeat) is executed once more harmlessly and is ACKed." Here
/// it is not even executed.
#[test]
fn client_item_e89_a_repeat_is_accepted_and_not_carried_out_again() {
    // Flags 60: from the nose, and locked.
    let locked = pitchyaw(-10.0, 40.0, NAN, NAN, 60.0);
    for (confirmation, after_ms, yaw) in [(1, 500, 20.0), (3, 1_000, 20.0), (1, 1_001, 40.0), (0, 500, 40.0)] {
        let (mut world, places) = with_gimbal();
        look(&mut world, places, 0.0, 0.0);
        turn_vehicle(&mut world, places, 0.0);
        assert_eq!(world.result_of(places.ground, GCS, &locked), Some(ACCEPTED));
        run_looking(&mut world, places, Duration::from_millis(after_ms), 0.0, 0.0);
        turn_vehicle(&mut world, places, 20.0);

        let result = world.result_of(places.ground, GCS, &again(confirmation, locked.clone()));
        assert_eq!(result, Some(ACCEPTED), "{confirmation} after {after_ms} ms");

        world.run_for(SECOND / 10);
        let (_, setpoint) = setpoints(&mut world, places).pop().expect("it is streamed");
        assert_near(pitch_yaw_deg(setpoint.q).1, yaw, 0.001);
    }
}

/// QGroundControl repeats a rate every 500 ms while a key is held, with confirmation 0: each is carried out, so that the
/// rotation goes on. A repeat for want of an answer does not prolong it.
///
/// Client checklist E102: "Stream ends without a zero: rates stop within the dead-man time (≤ 3 s)." What is said again is a
/// stream, also when it is said by commands. A `COMMAND_INT`, by which MAVSDK says a rate once, and again for want of an
/// answer, counts no confirmations, so there a repeat is none.
#[test]
fn client_item_e102_a_rate_that_is_meant_again_is_a_stream_and_a_repeat_for_want_of_an_answer_is_none() {
    let long = |confirmation| again(confirmation, pitchyaw(NAN, NAN, 0.0, 20.0, 12.0));
    let int = |_| command_int(MANAGER, 1000, [NAN, NAN, 0.0, 20.0], 12, 0, 154.0);
    let commands: [&dyn Fn(u8) -> MavMessage; 2] = [&long, &int];
    // Which command, how many times and how far apart, and what turns how long after the last one. A rate that is said once
    // lasts 10 s, a streamed one 2 s.
    for (form, confirmation, times, apart_ms, after_ms, turns) in [
        (0, 0, 10, 500, 1_800, true),
        (0, 0, 10, 500, 2_300, false),
        (0, 0, 2, 500, 1_800, true),
        (0, 0, 2, 500, 2_300, false),
        (0, 0, 2, 2_000, 2_300, false),
        // Too far apart for a stream.
        (0, 0, 2, 2_100, 9_800, true),
        (0, 0, 2, 2_100, 10_300, false),
        // For want of an answer, which is not carried out.
        (0, 1, 2, 500, 9_300, true),
        (0, 1, 2, 500, 9_800, false),
        (1, 0, 4, 500, 9_800, true),
        (1, 0, 4, 500, 10_300, false),
    ] {
        let (mut world, places) = with_gimbal();
        for at in 0..times {
            if at > 0 {
                run_looking(&mut world, places, Duration::from_millis(apart_ms), 0.0, 0.0);
            }
            let rate = commands[form](if at == 0 { 0 } else { confirmation });
            assert_eq!(world.result_of(places.ground, GCS, &rate), Some(ACCEPTED));
        }
        run_looking(&mut world, places, Duration::from_millis(after_ms), 0.0, 0.0);
        let said = format!("form {form}, confirmation {confirmation}, {times} times every {apart_ms} ms");
        assert_eq!(turning(&mut world, places), turns, "{said}, {after_ms} ms after the last one");
    }
}

/// Only the same rate again is a stream: who says another asks for that one, once.
#[test]
fn another_rate_is_no_stream() {
    for (sender, second) in [
        (GCS, pitchyaw(NAN, NAN, 0.0, 21.0, 12.0)),
        (GCS, pitchyaw(NAN, NAN, 0.0, 20.0, 44.0)),
        (COMPANION, pitchyaw(NAN, NAN, 0.0, 20.0, 12.0)),
    ] {
        let (mut world, places) = with_gimbal();
        assert_eq!(world.result_of(places.ground, GCS, &pitchyaw(NAN, NAN, 0.0, 20.0, 12.0)), Some(ACCEPTED));
        run_looking(&mut world, places, SECOND / 2, 0.0, 0.0);
        assert_eq!(world.result_of(places.ground, sender, &second), Some(ACCEPTED));
        run_looking(&mut world, places, Duration::from_millis(9_800), 0.0, 0.0);
        assert!(turning(&mut world, places), "{sender} {second:?}");
    }
}

/// What was accepted in between makes a repeat a command like others, whoever said it.
#[test]
fn after_something_else_a_repeat_is_carried_out() {
    let first = pitchyaw(-10.0, 40.0, NAN, NAN, 44.0);
    let between: [(MavId, MavMessage, bool); 6] = [
        (COMPANION, pitchyaw(-20.0, -40.0, NAN, NAN, 44.0), true),
        (GCS, set_pitchyaw(-0.5, -0.5, NAN, NAN, 44), true),
        (GCS, configure([-2.0, -2.0], [-1.0, -1.0]), true),
        // Neither of these changes anything that matters to it.
        (GCS, request_message(MANAGER, 280), false),
        (GCS, set_interval(MANAGER, 281, 100_000.0), false),
        (COMPANION, pitchyaw(-20.0, -40.0, NAN, NAN, 96.0), false),
    ];
    for (sender, message, carried_out) in between {
        let (mut world, places) = with_gimbal();
        look(&mut world, places, 0.0, 0.0);
        assert_eq!(world.result_of(places.ground, GCS, &first), Some(ACCEPTED));
        world.send(places.ground, sender, &message);
        world.forget();
        assert_eq!(world.result_of(places.ground, GCS, &again(1, first.clone())), Some(ACCEPTED));
        // What is carried out is told the gimbal at once.
        assert_eq!(setpoints(&mut world, places).len(), usize::from(carried_out), "{message:?}");
    }
}

/// Only the same is a repeat: another sender, parameter or form is another command.
#[test]
fn what_is_not_the_same_is_no_repeat() {
    let command = |pitch: f32| pitchyaw(pitch, 40.0, NAN, NAN, 44.0);
    let by_int = command_int(MANAGER, 1000, [-10.0, 40.0, NAN, NAN], 44, 0, 154.0);
    for (sender, second, carried_out) in [
        (GCS, again(1, command(-10.0)), false),
        (GCS, again(1, command(-10.000_001)), true),
        (COMPANION, again(1, command(-10.0)), true),
        (GCS, by_int, true),
        (GCS, again(1, crate::support::script::to(MavId::new(1, 0), command(-10.0))), true),
    ] {
        let (mut world, places) = with_gimbal();
        assert_eq!(world.result_of(places.ground, GCS, &command(-10.0)), Some(ACCEPTED));
        world.forget();
        assert_eq!(world.result_of(places.ground, sender, &second), Some(ACCEPTED));
        assert_eq!(setpoints(&mut world, places).len(), usize::from(carried_out), "{sender} {second:?}");
    }
    // A COMMAND_INT has no counter, so it is carried out each time.
    let (mut world, places) = with_gimbal();
    let by_int = command_int(MANAGER, 1000, [-10.0, 40.0, NAN, NAN], 44, 0, 154.0);
    for _ in 0..3 {
        world.forget();
        assert_eq!(world.result_of(places.ground, GCS, &by_int), Some(ACCEPTED));
        assert_eq!(setpoints(&mut world, places).len(), 1);
    }
}

/// "When the same COMMAND_LONG arrives three times, three identical ACKs are sent." What was refused is looked at again: what
/// was missing may have come.
#[test]
fn item_131_a_refusal_is_not_remembered() {
    let (mut world, places) = with_gimbal();
    let to_north = pitchyaw(0.0, 90.0, NAN, NAN, 92.0);
    assert_eq!(world.result_of(places.ground, GCS, &to_north), Some(TEMPORARILY_REJECTED));
    turn_vehicle(&mut world, places, 0.0);
    assert_eq!(world.result_of(places.ground, GCS, &again(1, to_north)), Some(ACCEPTED));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    /// "Property: … the same command repeated within a second, with nothing changed between, gets the same ACK": by its
    /// sender again as it is, or counted, in either form, whatever it asks.
    #[test]
    fn the_same_command_gets_the_same_answer(
        command in any_command(), confirmation in 0_u8..3, wait_ms in 0_u64..1_000, held in 0_usize..3,
        heading in prop::option::of(0.0..360.0_f64), flying in any::<bool>(),
    ) {
        let (mut world, places) = with_gimbal();
        let known = |world: &mut World| {
            match (flying, heading) {
                (true, heading) => fly(world, places, FIELD, heading.unwrap_or(0.0)),
                (false, Some(heading)) => turn_vehicle(world, places, heading),
                (false, None) => {}
            }
            look(world, places, -10.0, 20.0);
        };
        known(&mut world);
        let holder = [None, Some(GCS), Some(COMPANION)][held];
        if let Some(holder) = holder {
            prop_assert_eq!(world.result_of(places.ground, holder, &take_control()), Some(ACCEPTED));
        }
        let acks = |world: &mut World, command: &MavMessage| of::<COMMAND_ACK_DATA>(&world.ask(places.ground, GCS, command));
        let first = acks(&mut world, &command);
        world.run_for(Duration::from_millis(wait_ms));
        known(&mut world);

        let repeat = match &command {
            MavMessage::COMMAND_LONG(_) => again(confirmation, command.clone()),
            _ => command.clone(),
        };
        prop_assert_eq!(acks(&mut world, &repeat), first);
    }
}

fn any_command() -> BoxedStrategy<MavMessage> {
    let number =
        prop::sample::select(vec![195_u16, 196, 197, 198, 201, 204, 205, 220, 510, 511, 512, 1000, 1001, 2000]);
    let target = prop::sample::select(vec![MANAGER, MavId::new(1, 0), MavId::new(0, 0)]);
    let value = || {
        prop_oneof![
            4 => prop::sample::select(vec![NAN, 0.0, 1.0, 2.0, 3.0, 4.0, -1.0, -2.0, -3.0, 44.0, 60.0, 92.0, 154.0, 255.0, 190.0, 280.0, 281.0]),
            2 => -100.0_f32..100.0,
            1 => any::<f32>(),
        ]
    };
    let integer = prop_oneof![Just(0), Just(44), Just(60), Just(i32::MAX), Just(474_000_000), any::<i32>()];
    let params = prop::array::uniform7(value());
    (number, target, params, (integer.clone(), integer), prop::option::of(0_u8..12))
        .prop_map(|(number, target, params, (x, y), frame)| match frame {
            None => command_long(target, number, &params),
            Some(frame) => {
                let [one, two, three, four, _, _, seven] = params;
                in_frame(frame, command_int(target, number, [one, two, three, four], x, y, seven))
            }
        })
        .boxed()
}

fn turning(world: &mut World, places: Places) -> bool {
    let (_, setpoint) = setpoints(world, places).pop().expect("it is told");
    setpoint.angular_velocity_z > 0.1
}

/// A repeat of what somebody else was refused is refused.
#[test]
fn a_repeat_of_a_stranger_passes_the_gate_like_anything() {
    let (mut world, places) = with_gimbal();
    assert_eq!(world.result_of(places.ground, GCS, &take_control()), Some(ACCEPTED));
    let command = pitchyaw(-10.0, 0.0, NAN, NAN, 44.0);
    assert_eq!(world.result_of(places.ground, GCS, &command), Some(ACCEPTED));
    assert_eq!(world.result_of(places.autopilot, COMPANION, &again(1, command)), Some(DENIED));
}
