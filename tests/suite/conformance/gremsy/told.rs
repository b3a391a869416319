//! What the events and the status tell of what was asked of it by name.

use gimbald::geometry::AxisLimits;
use gimbald::gimbals::operation::{
    Axis, EncoderUnit, MotorControl, Motors, OperationError, Restart, STARTING, Stream, StreamRate,
};
use gimbald::manager::asked::NotDone;

use super::*;

fn set(name: &str, value: f64) -> Operation {
    Operation::SetParameter { name: name.to_owned(), value }
}

/// Those about what was asked for, oldest first.
fn operated(world: &World) -> Vec<(String, Option<String>, String)> {
    let mut events = world.snapshot().events;
    events.reverse();
    let is_its = |what: &str| matches!(what, "operated" | "operation_failed");
    events.into_iter().filter(|event| is_its(&event.what)).map(|event| (event.what, event.reason, event.text)).collect()
}

fn event(what: &str, reason: &str, text: &str) -> (String, Option<String>, String) {
    (what.to_owned(), Some(reason.to_owned()), text.to_owned())
}

/// `operated` is what the gimbal was asked for: what is refused before it reaches the gimbal is none.
#[test]
fn what_does_not_reach_the_gimbal_is_no_event() {
    let (mut world, places) = running(Generation::V1);
    take_control(&mut world);
    let limits = AxisLimits::new(Angle::from_degrees(-300.0), Angle::from_degrees(30.0)).expect("in order");
    let gain = MotorControl { gain: Some(5.0), ..MotorControl::default() };
    for operation in
        [set("GYRO_LPF", 1.5), Operation::SetLimits { axis: Axis::Tilt, limits }, Operation::SetMotorControl(gain)]
    {
        let answer = operate(&mut world, places, operation.clone());
        assert!(
            matches!(answer, Some(Err(NotDone::Operation(OperationError::Invalid(_))))),
            "{operation:?} {answer:?}"
        );
    }
    assert_eq!(operated(&world), []);
    // While it starts again nothing reaches it but the restart itself.
    let reboot = Operation::Restart(Restart::Reboot);
    for operation in [reboot.clone(), reboot, Operation::Motors(Motors::On), set("GYRO_LPF", 6.0)] {
        let asked = Asked::Operation(operation);
        let id = world.ask_by_name("camera", &asked);
        run(&mut world, places, SECOND);
        assert!(world.answers.iter().any(|(answered, _)| *answered == id), "{asked:?}");
    }
    assert_eq!(operated(&world), [event("operated", "reboot", "http asked for reboot")]);
}

/// What reaches the gimbal and is not done is told twice: that it was asked for, and why it was not done.
#[test]
fn what_the_gimbal_does_not_do_is_told() {
    let (mut world, places) = running(Generation::V1);
    take_control(&mut world);
    operate(&mut world, places, set("NOPE", 1.0));
    operate(&mut world, places, set("MAV_TS_ENCNT", 5.0));
    let failed = |text| event("operation_failed", "set_parameter", text);
    let asked = |text| event("operated", "set_parameter", text);
    assert_eq!(
        operated(&world),
        [
            asked("http asked for parameter NOPE = 1"),
            failed("parameter NOPE = 1, which http asked for, was not done: the gimbal did not answer"),
            asked("http asked for parameter MAV_TS_ENCNT = 5 (it was 1)"),
            failed(
                "parameter MAV_TS_ENCNT = 5, which http asked for, was not done: the gimbal answered, but did not do it: \
                 MAV_TS_ENCNT is 1"
            ),
        ]
    );
}

/// "`gimbal_starting`: wait until it is ready": whatever is asked while it starts is answered with the same sentence.
#[test]
fn while_it_starts_there_is_one_sentence() {
    for generation in [Generation::V1, Generation::V2] {
        let (mut world, places) = running(generation);
        take_control(&mut world);
        assert_eq!(operate(&mut world, places, Operation::Restart(Restart::Reboot)), Some(Ok(())));
        for operation in [
            Operation::Motors(Motors::On),
            Operation::Mapping,
            Operation::RequestInformation,
            Operation::RefreshParameters,
            Operation::SetStreamRate { stream: Stream::RawImu, rate: StreamRate::Hertz(5) },
        ] {
            let asked = Asked::Operation(operation);
            let id = world.ask_by_name("camera", &asked);
            let expected = (id, Err(NotDone::Operation(OperationError::NotReady)));
            assert_eq!(world.answers.last(), Some(&expected), "{generation:?} {asked:?}");
        }
    }
    assert_eq!(OperationError::NotReady.to_string(), STARTING);
    assert_eq!(STARTING, "the gimbal is starting; wait until it is ready, some 15 s, and ask again");
}

/// A limit that is too far is named as it was given, however the gimbal counts it.
#[test]
fn a_limit_beyond_its_range_is_named_as_it_was_given() {
    for device in [device(Generation::V1), device(Generation::V2), with_firmware(Generation::V1, 7, 5, 6)] {
        let (mut world, places) = running_with(device, GremsySettings::default());
        take_control(&mut world);
        for (axis, min, max, text) in [
            (Axis::Tilt, -300.0, 30.0, "min_deg of the tilt axis is to be from -180 to 180, not -300"),
            (Axis::Tilt, -30.0, 300.0, "max_deg of the tilt axis is to be from -180 to 180, not 300"),
            (Axis::Roll, -30.0, 181.0, "max_deg of the roll axis is to be from -180 to 180, not 181"),
        ] {
            let limits = AxisLimits::new(Angle::from_degrees(min), Angle::from_degrees(max)).expect("in order");
            let answer = operate(&mut world, places, Operation::SetLimits { axis, limits });
            let expected = Err(NotDone::Operation(OperationError::Invalid(text.to_owned())));
            assert_eq!(answer, Some(expected));
        }
        assert_eq!(sets(&mut world, places), []);
    }
}

/// The joints are shown in the unit in which they were sent: when that changes, not before they were sent in the new one.
#[test]
fn encoders_are_never_shown_in_another_unit() {
    for generation in [Generation::V1, Generation::V2] {
        let (mut world, places) = running(generation);
        take_control(&mut world);
        point(&mut world, -30.0, 40.0);
        run(&mut world, places, 5 * SECOND);
        let before = seen(&world).details.encoders.expect("it is sent");
        for unit in [EncoderUnit::Angles, EncoderUnit::Counts] {
            let asked = Asked::Operation(Operation::SetEncoderUnit(unit));
            let id = world.ask_by_name("camera", &asked);
            let mut was_unknown = false;
            for _ in 0..400 {
                run(&mut world, places, Duration::from_millis(5));
                let encoders = seen(&world).details.encoders;
                was_unknown |= encoders.is_none();
                if let Some(encoders) = encoders {
                    let off = (encoders.pan_deg - before.pan_deg).abs();
                    assert!(off < 1.0, "{generation:?} {unit:?} {encoders:?} {before:?}");
                }
            }
            assert!(was_unknown && seen(&world).details.encoders.is_some(), "{generation:?} {unit:?}");
            assert_eq!(world.answers.last(), Some(&(id, Ok(()))));
        }
    }
}

/// A stream that was switched off is not measured any more, at once.
#[test]
fn a_stream_that_is_off_has_no_rate() {
    let (mut world, places) = running(Generation::V2);
    let rate = |rate| Operation::SetStreamRate { stream: Stream::Encoders, rate };
    assert!(seen(&world).details.streams["encoders"].measured_hz.is_some());
    let asked = Asked::Operation(rate(StreamRate::Off));
    let id = world.ask_by_name("camera", &asked);
    while !world.answers.contains(&(id, Ok(()))) {
        run(&mut world, places, Duration::from_millis(5));
    }
    let streams = seen(&world).details.streams;
    assert_eq!((streams["encoders"].wanted_hz, streams["encoders"].measured_hz), (Some(0.0), None));
    run(&mut world, places, 5 * SECOND);
    assert_eq!(seen(&world).details.streams["encoders"].measured_hz, None);
    // And is measured again when it comes again.
    assert_eq!(operate(&mut world, places, rate(StreamRate::Hertz(10))), Some(Ok(())));
    let measured = seen(&world).details.streams["encoders"].measured_hz.expect("it comes");
    assert!((measured - 10.0).abs() < 1.0, "{measured}");
    // As often as the gimbal does by itself is no number.
    assert_eq!(operate(&mut world, places, rate(StreamRate::Default)), Some(Ok(())));
    assert_eq!(seen(&world).details.streams["encoders"].wanted_hz, None);
}
