//! Gimbals of which nothing is known but what they tell: "PARAM_REQUEST_LIST once; re-request missing indices (`param_count`
//! known after first value)" (gimbals 2.4).

use super::*;

const ID_8: OperationId = OperationId(8);

const INT32: u8 = 6;
const REAL32: u8 = 9;

fn line(list: Vec<(&'static str, ParameterValue)>, encoding: IntegerEncoding) -> Line {
    let mut line = Line::with(Parameters::of_any_gimbal(), ParameterServer::new(list, encoding));
    line.parameters.listen(GIMBAL);
    line
}

/// Two integers and a float.
fn mixed(encoding: IntegerEncoding) -> Line {
    let list = vec![
        ("COUNT", ParameterValue::Integer(154)),
        ("LEAST", ParameterValue::Short(-30)),
        ("RATE", ParameterValue::Float(1.5)),
    ];
    line(list, encoding)
}

/// Floats `P000`, `P001` … with the values 0, 1 …
fn many(count: usize) -> Line {
    let name = |number: usize| -> &'static str { format!("P{number:03}").leak() };
    line((0..count).map(|at| (name(at), ParameterValue::Float(at as f32))).collect(), IntegerEncoding::Bytewise)
}

fn none() -> Line {
    line(Vec::new(), IntegerEncoding::Bytewise)
}

fn told(name: &str, param_value: f32, (param_index, param_count): (u16, u16)) -> Vec<u8> {
    let param_id = CharArray::from(name);
    encode_to_vec(GIMBAL, 0, &PARAM_VALUE_DATA { param_value, param_count, param_index, param_id, param_type: REAL32 })
}

fn done(at: u64, id: OperationId, result: Result<(), OperationError>) -> (u64, ParameterOutput) {
    (at, ParameterOutput::Done { id, result })
}

/// What became of the requests, without the time.
fn results(line: &Line) -> Vec<(OperationId, Result<(), OperationError>)> {
    let result = |(_, output): &(u64, ParameterOutput)| match output {
        ParameterOutput::Done { id, result } => Some((*id, result.clone())),
        _ => None,
    };
    line.done.iter().filter_map(result).collect()
}

/// Nothing is sent that nobody asked for; what the gimbal tells others is known, and what somebody else tells is not.
#[test]
fn what_it_tells_others_is_known() {
    let mut line = mixed(IntegerEncoding::Bytewise);
    line.run_for(5_000);
    line.tell_gimbal(&encode_to_vec(
        GCS,
        0,
        &PARAM_REQUEST_READ_DATA {
            param_index: -1,
            target_system: 1,
            target_component: 154,
            param_id: CharArray::from("COUNT"),
        },
    ));
    let told = told("RATE", 9.0, (2, 3));
    let frame = DatagramFrames::new(&told).next_frame().expect("a frame");
    let value: PARAM_VALUE_DATA = frame.decode().expect("a value");
    for stranger in [MavId::new(1, 1), MavId::new(2, 154), GCS] {
        line.hear(&encode_to_vec(stranger, 0, &value));
    }
    line.run_for(5_000);
    assert_eq!(line.parameters.values().collect::<Vec<_>>(), [("COUNT", 154.0)]);
    assert_eq!((&line.sent[..], &line.done[..], line.parameters.poll_timeout()), (&[][..], &[][..], None));
}

/// All of them, in both encodings of integers, from one list; and whoever asked is told a second after the last.
#[test]
fn a_refresh_reads_all_of_them() {
    for encoding in [IntegerEncoding::Bytewise, IntegerEncoding::CCast] {
        let mut line = mixed(encoding);
        line.parameters.refresh_for(line.now, ID);
        line.run_for(5_000);

        assert!(matches!(&line.sent[..], [(0, MavMessage::PARAM_REQUEST_LIST(_))]), "{:?}", line.sent);
        assert_eq!(line.done, [(1_010, ParameterOutput::Settled), done(1_010, ID, Ok(()))]);
        let expected = [("COUNT", 154.0), ("LEAST", -30.0), ("RATE", 1.5)];
        assert_eq!(line.parameters.values().collect::<Vec<_>>(), expected, "{encoding:?}");
    }
}

/// "Re-request missing indices […]; 100 ms pacing": those that were lost, by index alone, and each until it has come.
#[test]
fn what_is_missing_is_read_by_its_index() {
    let mut line = many(5);
    line.lost = |number, message| number < 2 && !is_list(message);
    line.parameters.refresh_for(line.now, ID);
    line.settle();
    // Of the list only the first two have come.
    line.run_for(5);
    line.gimbal.forget_questions();
    line.run_for(10_000);

    let read = |at, place| (at, String::new(), place);
    assert_eq!(line.reads(), [read(1_005, 2), read(1_105, 3), read(1_205, 4), read(1_705, 2)]);
    assert_eq!(line.parameters.values().count(), 5);
    assert_eq!(results(&line), [(ID, Ok(()))]);
}

/// "Re-request missing indices": of each list that is asked for, although they are known from the one before; but not those
/// that somebody else was told meanwhile.
#[test]
fn what_is_missing_of_the_next_list_is_read_too() {
    let mut line = many(5);
    line.parameters.refresh_for(line.now, ID);
    line.run_for(3_000);
    assert_eq!((line.parameters.values().count(), line.reads()), (5, vec![]));
    line.parameters.refresh_for(line.now, ID_8);
    line.settle();
    // Of this one only the first two have come.
    line.run_for(5);
    line.gimbal.forget_questions();
    line.run_for(1_050);
    line.hear(&told("P003", 3.0, (3, 5)));
    line.run_for(5_000);

    assert_eq!(line.reads(), [(4_005, String::new(), 2), (4_105, String::new(), 4)]);
    assert_eq!(results(&line), [(ID, Ok(())), (ID_8, Ok(()))]);
}

/// With 20 % lost either way all of them come, whatever is lost, and each is set, but where all five tries were lost, which is
/// one in 160.
#[test]
fn a_fifth_may_be_lost() {
    let (mut unread, mut unset) = (0, 0);
    for seed in 1..=40 {
        let mut line = many(30);
        line.loss = Some((0.2, Random::new(seed)));
        line.parameters.refresh_for(line.now, ID);
        line.run_for(16_000);
        assert_eq!(results(&line), [(ID, Ok(()))], "{seed}");
        unread += 30 - line.parameters.values().count();

        line.parameters.set(line.now, ID_8, &[("P003", 70.0)]);
        line.run_for(3_000);
        if results(&line)[1..] == [(ID_8, Ok(()))] {
            assert_eq!(line.gimbal.value("P003"), Some(ParameterValue::Float(70.0)), "{seed}");
        } else {
            assert_eq!(results(&line)[1..], [(ID_8, Err(OperationError::NoAnswer))], "{seed}");
            unset += 1;
        }
    }
    assert!(unread <= 4 && unset <= 1, "{unread} of 1200 unread, {unset} of 40 unset");
}

/// Bits go back as bits and values as values, in the gimbal's own type.
#[test]
fn a_value_is_set_in_the_gimbals_own_way() {
    for (encoding, raw) in [(IntegerEncoding::Bytewise, f32::from_bits(171)), (IntegerEncoding::CCast, 171.0)] {
        let mut line = mixed(encoding);
        line.parameters.refresh_for(line.now, ID);
        line.run_for(2_000);
        line.sent.clear();
        line.parameters.set(line.now, ID_8, &[("COUNT", 171.0)]);
        line.run_for(2_000);

        assert_eq!(line.sets(), [(2_000, raw, INT32)], "{encoding:?}");
        assert_eq!(line.sent.len(), 1, "nothing else is sent");
        assert_eq!(line.gimbal.value("COUNT"), Some(ParameterValue::Integer(171)), "{encoding:?}");
        assert_eq!(results(&line)[1..], [(ID_8, Ok(()))]);
    }
}

/// A value travels in single precision: one that has none there is set when the nearest comes back.
#[test]
fn a_fraction_is_set_as_near_as_it_travels() {
    let mut line = mixed(IntegerEncoding::Bytewise);
    line.parameters.refresh_for(line.now, ID);
    line.run_for(2_000);
    line.sent.clear();
    line.parameters.set(line.now, ID_8, &[("RATE", 0.1)]);
    line.run_for(5_000);

    assert_eq!(line.sets(), [(2_000, 0.1, REAL32)]);
    assert_eq!(results(&line)[1..], [(ID_8, Ok(()))]);
}

/// One of which the type is not known is not guessed: all are read first, and it is set then.
#[test]
fn an_unknown_one_is_read_before_it_is_set() {
    let mut line = mixed(IntegerEncoding::CCast);
    line.parameters.set(line.now, ID, &[("COUNT", 171.0)]);
    line.run_for(5_000);

    assert!(
        matches!(
            &line.sent[..],
            [(0, MavMessage::PARAM_REQUEST_LIST(_)), (1_010, MavMessage::PARAM_SET(set))]
                if (set.param_value, set.param_type) == (171.0, INT32)
        ),
        "{:?}",
        line.sent
    );
    assert_eq!(line.done, [(1_010, ParameterOutput::Settled), done(1_010, ID, Ok(()))]);
}

/// One that the list does not show may be there all the same, and is asked for by its name; then its type decides.
#[test]
fn one_that_the_list_does_not_show_is_asked_for_by_its_name() {
    let mut line = mixed(IntegerEncoding::CCast);
    line.lost = |_, message| is_list(message);
    line.parameters.set(line.now, ID, &[("COUNT", 171.0)]);
    line.parameters.set(line.now, ID_8, &[("LEAST", 0.5)]);
    line.run_for(6_000);

    let (by_name, set) = (line.reads(), line.sets());
    assert_eq!(by_name, [(3_000, "COUNT".to_owned(), -1), (3_000, "LEAST".to_owned(), -1)]);
    assert_eq!(set, [(3_000, 171.0, INT32)]);
    let problem = "0.5 is no whole number from -32768 to 32767".to_owned();
    assert_eq!(results(&line), [(ID, Ok(())), (ID_8, Err(OperationError::Invalid(problem)))]);
}

/// One that has come is not set where its type cannot hold the value, and not where the gimbal has none of that name.
#[test]
fn what_cannot_be_set_is_not_sent() {
    let mut line = mixed(IntegerEncoding::Bytewise);
    line.parameters.set(line.now, ID, &[("LEAST", 40_000.0)]);
    line.parameters.set(line.now, ID_8, &[("NO_SUCH_NAME", 1.0)]);
    line.run_for(6_000);

    assert_eq!(line.sets(), []);
    let problem = "40000 is no whole number from -32768 to 32767".to_owned();
    let expected = [(ID, Err(OperationError::Invalid(problem))), (ID_8, Err(OperationError::NoAnswer))];
    assert_eq!(results(&line), expected);
    let asked: Vec<_> = (0..5).map(|at| (1_010 + at * 300, "NO_SUCH_NAME".to_owned(), -1)).collect();
    assert_eq!(line.reads(), asked);
}

/// "Give up silently (v1 gimbals often have no params)": whoever asked is told, in bounded time, and nobody else.
#[test]
fn a_gimbal_may_have_none() {
    let mut line = none();
    line.parameters.refresh_for(line.now, ID);
    line.run_for(10_000);
    assert_eq!(line.sent.len(), 3, "{:?}", line.sent);
    assert_eq!(line.done, [(3_000, ParameterOutput::Settled), done(3_000, ID, Err(OperationError::NoParameters))]);

    let mut line = none();
    line.parameters.set(line.now, ID, &[("COUNT", 1.0)]);
    line.run_for(10_000);
    assert_eq!((line.reads().len(), line.sets()), (5, vec![]));
    assert_eq!(line.done[1..], [done(4_500, ID, Err(OperationError::NoParameters))]);
}

/// One that told some and does not answer any more has some all the same.
#[test]
fn a_gimbal_that_answers_no_more_is_not_one_without() {
    let mut line = none();
    line.hear(&told("RATE", 1.5, (0, 1)));
    line.parameters.refresh_for(line.now, ID);
    line.run_for(10_000);
    assert_eq!(results(&line), [(ID, Err(OperationError::NoAnswer))]);
    assert_eq!(line.parameters.value("RATE"), Some(1.5));
}

/// A count that changes, names without a NUL, with none, twice, without a value: nothing of it stops the reading, and a
/// list of which most never comes ends in time.
#[test]
fn a_strange_list_is_read_as_far_as_it_goes() {
    let mut line = none();
    line.parameters.refresh_for(line.now, ID);
    for bytes in [
        told("RC_REVERSE_AXISX", 1.0, (0, 2)),
        told("", 2.0, (1, 300)),
        told("TWICE", 3.0, (2, 1)),
        told("TWICE", 4.0, (2, 0)),
        told("TWICE", 5.0, (3, u16::MAX)),
        told("NO_VALUE", f32::NAN, (u16::MAX, 2)),
    ] {
        line.hear(&bytes);
    }
    line.run_for(20_000);

    assert_eq!(line.parameters.values().collect::<Vec<_>>(), [("RC_REVERSE_AXISX", 1.0), ("TWICE", 5.0)]);
    let read: Vec<i16> = line.reads().iter().map(|(_, _, place)| *place).collect();
    assert!(read.len() < 140 && read.iter().all(|place| (4..512).contains(place)), "{read:?}");
    let text = "508 of its 512 parameters did not come in time; ask again, and check the line to it".to_owned();
    let last = line.done.last().cloned();
    assert_eq!(last, Some(done(14_000, ID, Err(OperationError::NoEffect(text)))));
}

/// Whoever floods the line with values of its own making fills nothing, and keeps nobody waiting.
#[test]
fn a_flood_fills_no_memory_and_holds_nothing_up() {
    let mut line = mixed(IntegerEncoding::Bytewise);
    line.parameters.refresh_for(line.now, ID);
    for number in 0..4_000_u16 {
        line.run_for(5);
        line.hear(&told(&format!("N{number}"), 1.0, (number, 4_000)));
    }
    assert_eq!(line.parameters.values().count(), MAX_NAMES);
    let ended = line.done.iter().find(|(_, output)| matches!(output, ParameterOutput::Done { .. }));
    assert!(ended.is_some_and(|(at, _)| *at <= 16_200), "{:?}", line.done);
}

/// A gimbal that was restarted or lost may have other ones, or be another: nothing is known of it, and what was asked for is
/// not done. One that was restarted is there.
#[test]
fn nothing_is_known_of_a_gimbal_that_was_away() {
    for (is_restarted, error) in [(false, OperationError::NotThere), (true, OperationError::NotReady)] {
        let mut line = mixed(IntegerEncoding::CCast);
        line.parameters.set(line.now, ID, &[("COUNT", 171.0)]);
        line.parameters.refresh_for(line.now, ID_8);
        line.run_for(100);
        if is_restarted {
            line.parameters.handle_restart();
        } else {
            line.parameters.forget();
        }
        line.parameters.listen(GIMBAL);
        line.run_for(10_000);

        assert_eq!(results(&line), [(ID, Err(error.clone())), (ID_8, Err(error))]);
        assert_eq!((line.sets(), line.parameters.values().count()), (vec![], 0));
        assert_eq!(line.gimbal.value("COUNT"), Some(ParameterValue::Integer(154)));
    }
}
