use super::*;
use crate::wire::dialect::{MessageData, PARAM_REQUEST_LIST_DATA};
use crate::wire::{DatagramFrames, MavId, encode_to_vec};

const GCS: MavId = MavId::new(255, 190);

fn ask<M: MessageData>(server: &mut ParameterServer, now: Timestamp, request: &M) -> Vec<PARAM_VALUE_DATA> {
    let mut outbox = Outbox::new(MavId::new(1, 1));
    let bytes = encode_to_vec(GCS, 0, request);
    let frame = DatagramFrames::new(&bytes).next_frame().expect("one frame");
    assert!(server.handle_frame(now, &frame, &mut outbox));
    drain(&mut outbox)
}

fn drain(outbox: &mut Outbox) -> Vec<PARAM_VALUE_DATA> {
    std::iter::from_fn(|| outbox.poll())
        .map(|bytes| DatagramFrames::new(&bytes).next_frame().and_then(|frame| frame.decode()).expect("PARAM_VALUE"))
        .collect()
}

fn names(values: &[PARAM_VALUE_DATA]) -> Vec<&str> {
    values.iter().map(|value| value.param_id.to_str().expect("a name")).collect()
}

fn server() -> ParameterServer {
    let list = vec![("B", ParameterValue::Integer(7)), ("A", ParameterValue::Float(1.5))];
    ParameterServer::new(list, IntegerEncoding::Bytewise).with_hash()
}

#[test]
fn a_list_comes_in_order_and_spread_out() {
    let mut server = server();
    let request = PARAM_REQUEST_LIST_DATA { target_system: 1, target_component: 1 };

    let first = ask(&mut server, Timestamp::ZERO, &request);
    assert_eq!(names(&first), ["_HASH_CHECK", "A"]);
    assert_eq!((first[0].param_index, first[1].param_count, first[1].param_index), (65_535, 2, 0));

    assert_eq!(server.poll_timeout(), Some(Timestamp::from_millis(5)));
    let mut outbox = Outbox::new(MavId::new(1, 1));
    server.handle_timeout(Timestamp::from_millis(5), &mut outbox);
    let second = drain(&mut outbox);
    assert_eq!(names(&second), ["B"]);
    assert_eq!((second[0].param_value.to_bits(), second[0].param_type), (7, INT32));
    assert_eq!(server.poll_timeout(), None);
}

#[test]
fn a_value_is_set_and_echoed_and_an_unknown_one_is_not_answered() {
    let mut server = server();
    let set = |name: &str, value| PARAM_SET_DATA {
        target_system: 1,
        target_component: 1,
        param_id: CharArray::from(name),
        param_value: value,
        param_type: INT32,
    };

    let echo = ask(&mut server, Timestamp::ZERO, &set("B", f32::from_bits(9)));
    assert_eq!((names(&echo), echo[0].param_value.to_bits()), (vec!["B"], 9));
    assert_eq!(server.value("B"), Some(ParameterValue::Integer(9)));
    assert!(ask(&mut server, Timestamp::ZERO, &set("C", 0.0)).is_empty());
}

#[test]
fn reading_goes_by_index_or_by_name() {
    let mut server = server();
    let read = |name: &str, param_index| PARAM_REQUEST_READ_DATA {
        target_system: 1,
        target_component: 1,
        param_id: CharArray::from(name),
        param_index,
    };

    assert_eq!(names(&ask(&mut server, Timestamp::ZERO, &read("", 1))), ["B"]);
    assert_eq!(names(&ask(&mut server, Timestamp::ZERO, &read("A", -1))), ["A"]);
    assert_eq!(names(&ask(&mut server, Timestamp::ZERO, &read("_HASH_CHECK", -1))), ["_HASH_CHECK"]);
    assert!(ask(&mut server, Timestamp::ZERO, &read("", 2)).is_empty());
}

/// A gimbal whose parameters have places of their own: some are free, some are not to be written, and what was
/// written is told back late.
#[test]
fn places_may_be_free_and_writing_may_take_time() {
    let parameter =
        |name, index, value, writable| Parameter { name, index, value: ParameterValue::Short(value), writable };
    let list = vec![parameter("LAST", 7, -5, Writable::Within(-10..=10)), parameter("FIRST", 0, 1, Writable::Nothing)];
    let (least, spread) = (Duration::from_millis(20), Duration::from_millis(180));
    let mut server = ParameterServer::with_parameters(list, IntegerEncoding::CCast).with_flash(least, spread, 1);
    let set = |name: &str, param_value| PARAM_SET_DATA {
        target_system: 1,
        target_component: 1,
        param_id: CharArray::from(name),
        param_value,
        param_type: INT16,
    };

    for (name, written, expected) in [("LAST", 9.0, 9.0), ("LAST", 11.0, 9.0), ("FIRST", 2.0, 1.0)] {
        assert!(ask(&mut server, Timestamp::ZERO, &set(name, written)).is_empty());
        let at = server.poll_timeout().expect("an echo to come");
        assert!((Timestamp::from_millis(20)..=Timestamp::from_millis(200)).contains(&at), "{at:?}");
        let mut outbox = Outbox::new(MavId::new(1, 1));
        server.handle_timeout(at, &mut outbox);
        let echo = drain(&mut outbox);
        assert_eq!((names(&echo), echo[0].param_value, echo[0].param_type), (vec![name], expected, INT16));
        assert_eq!(echo[0].param_count, 8);
    }
    let read = |param_index| PARAM_REQUEST_READ_DATA {
        target_system: 1,
        target_component: 1,
        param_id: CharArray::from(""),
        param_index,
    };
    assert_eq!(names(&ask(&mut server, Timestamp::ZERO, &read(7))), ["LAST"]);
    assert!(ask(&mut server, Timestamp::ZERO, &read(1)).is_empty());
}
