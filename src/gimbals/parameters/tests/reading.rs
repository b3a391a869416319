//! Reading: the list, what is missing of it one by one, and how whoever asked is told.

use super::*;

/// "collect PARAM_VALUE; when no PARAM_VALUE for 1 s" (gimbals 1.2): the list, a second of silence, and another before it
/// is settled.
#[test]
fn a_whole_list_is_settled_a_second_after_its_last_value() {
    let mut line = Line::new(&NAMES);

    line.parameters.refresh(line.now, GIMBAL);
    line.run_for(5_000);

    assert_eq!(line.sent.len(), 1, "{:?}", line.sent);
    assert_eq!(line.done, [(1_010, ParameterOutput::Settled)]);
    assert_eq!(line.parameters.values().collect::<Vec<_>>(), [("ALPHA", 10.0), ("BETA", 11.0), ("GAMMA", 12.0)]);
}

/// Gimbal statement 12: "A parameter missing after 5 reads is marked non-existent and does not block readiness." Requests
/// go by the name (index −1).
#[test]
fn statement_12_what_does_not_come_is_read_five_times() {
    let mut line = Line::new(&["BETA"]);

    line.parameters.refresh(line.now, GIMBAL);
    line.run_for(20_000);

    let round = |at: u64| [(at, "ALPHA".to_owned(), -1), (at + 10, "GAMMA".to_owned(), -1)];
    let named: Vec<_> = [1_000, 1_510].into_iter().flat_map(round).collect();
    assert_eq!(line.reads()[..4], named);
    assert_eq!(line.reads().len(), 10);
    assert!(line.parameters.is_missing("ALPHA") && line.parameters.is_missing("GAMMA"));
    assert!(!line.parameters.is_missing("BETA"));
    // The last rounds went by the index, which was answered with another name.
    assert_eq!(line.done, [(4_040, ParameterOutput::Settled)]);
}

/// "send `param_index = −1` with the name; fall back to index mode if nothing answers" (gimbals 1.6).
#[test]
fn where_names_are_not_answered_the_index_is_tried() {
    let mut line = Line::new(&NAMES);
    line.lost = |_, message| match message {
        MavMessage::PARAM_REQUEST_READ(read) => read.param_index < 0,
        message => is_list(message),
    };

    line.parameters.refresh(line.now, GIMBAL);
    line.run_for(20_000);

    let last: Vec<i16> = line.reads()[6..].iter().map(|(_, _, index)| *index).collect();
    assert_eq!(last, [0, 1, 2]);
    assert_eq!(line.parameters.value("GAMMA"), Some(12.0));
    assert!(line.parameters.is_settled());
}

/// The same, to a gimbal that does answer to names: its index is left alone however often one is read that it does not have.
#[test]
fn where_names_are_answered_no_index_is_tried() {
    let mut line = Line::new(&["BETA"]);
    line.lost = |_, message| is_list(message);

    line.parameters.refresh(line.now, GIMBAL);
    line.run_for(20_000);

    let names: Vec<(String, i16)> = line.reads().into_iter().map(|(_, name, index)| (name, index)).collect();
    let read = |name: &&str| ((*name).to_owned(), -1);
    let expected: Vec<_> = NAMES.iter().chain(["ALPHA", "GAMMA"].iter().cycle().take(8)).map(read).collect();
    assert_eq!(names, expected);
    assert_eq!(line.parameters.values().collect::<Vec<_>>(), [("BETA", 11.0)]);
    assert!(line.parameters.is_settled());
}

/// "A parameter missing after 5 reads is marked non-existent" until all are asked for again: whoever asks for them may have
/// mended what was wrong.
#[test]
fn what_did_not_come_is_read_again_when_all_are_asked_for_again() {
    let mut line = Line::settled(&["BETA"]);

    line.parameters.refresh_for(line.now, ID);
    line.run_for(1_500);

    assert!(!line.parameters.is_missing("ALPHA"), "it may come");
    line.gimbal = ParameterServer::new(vec![("ALPHA", ParameterValue::Integer(7))], IntegerEncoding::CCast);
    line.run_for(5_000);
    let read = |at: u64, name: &str| (at, name.to_owned(), -1);
    assert_eq!(line.reads()[..3], [read(21_000, "ALPHA"), read(21_010, "GAMMA"), read(21_510, "ALPHA")]);
    assert_eq!(line.parameters.value("ALPHA"), Some(7.0));
    assert!(line.parameters.is_missing("GAMMA") && !line.parameters.is_missing("ALPHA"));
}

/// A list that is lost is asked for again, and single values that are lost are read.
#[test]
fn what_is_lost_of_the_list_is_read() {
    let mut line = Line::new(&NAMES);
    line.lost = |number, message| number == 0 && is_list(message);

    line.parameters.refresh(line.now, GIMBAL);
    line.run_for(20_000);

    assert!(line.sent.iter().filter(|(_, message)| is_list(message)).count() == 2, "{:?}", line.sent);
    assert_eq!(line.done, [(2_010, ParameterOutput::Settled)]);
}

/// A gimbal without parameters is found out in bounded time.
#[test]
fn a_gimbal_without_parameters_settles_too() {
    let mut line = Line::new(&[]);

    line.parameters.refresh(line.now, GIMBAL);
    line.run_for(20_000);

    assert_eq!(line.done.len(), 1);
    assert!(line.done[0].0 < 6_000, "{:?}", line.done);
    assert_eq!(line.parameters.values().count(), 0);
}

/// Somebody else has the gimbal tell its values without end.
#[test]
fn what_others_ask_for_does_not_keep_it_from_settling() {
    let mut line = Line::new(&["BETA", "GAMMA"]);
    let name = CharArray::from("BETA");
    let value = PARAM_VALUE_DATA { param_value: 11.0, param_count: 2, param_index: 0, param_id: name, param_type: 4 };
    let bytes = encode_to_vec(GIMBAL, 0, &value);

    line.parameters.refresh(line.now, GIMBAL);
    for _ in 0..6_000 {
        line.run_for(5);
        let frame = DatagramFrames::new(&bytes).next_frame().expect("a frame");
        line.parameters.handle_received(line.now, &frame);
    }

    let settled = line.done.first().map(|(at, _)| *at);
    assert!(settled.is_some_and(|at| at < 26_000), "{:?}", line.done);
    assert!(line.parameters.is_missing("ALPHA"));
}

/// "A ground station that reads or sets parameters at the same time is not disturbed": what it asks for goes first, one after
/// the other for no longer than 100 ms, and what it is told is not read again.
#[test]
fn what_others_ask_for_delays_what_is_read() {
    let told = |line: &mut Line, name: &str| {
        let param_id = CharArray::from(name);
        let value = PARAM_VALUE_DATA { param_value: 12.0, param_count: 2, param_index: 1, param_id, param_type: 4 };
        line.hear(&encode_to_vec(GIMBAL, 0, &value));
    };
    let read = |at: u64, name: &str| (at, name.to_owned(), -1);
    // ALPHA and GAMMA are missing, and asked for 10 ms apart.
    for (others_at, gamma_at) in [(vec![], 1_010), (vec![1_005], 1_015), ((1_001..1_200).collect(), 1_110)] {
        let mut line = Line::new(&["BETA"]);
        line.parameters.refresh(line.now, GIMBAL);
        for at in others_at {
            line.run_for(at - line.now.as_micros() / 1_000);
            told(&mut line, "BETA");
        }
        line.run_for(1_400 - line.now.as_micros() / 1_000);
        assert_eq!(line.reads(), [read(1_000, "ALPHA"), read(gamma_at, "GAMMA")]);
    }

    let mut line = Line::new(&["BETA"]);
    line.parameters.refresh(line.now, GIMBAL);
    line.run_for(1_005);
    told(&mut line, "GAMMA");
    line.run_for(1_000);
    assert_eq!(line.reads(), [read(1_000, "ALPHA"), read(1_515, "ALPHA")]);
}

#[test]
fn a_refresh_is_answered_when_everything_was_read() {
    let mut line = Line::settled(&NAMES);

    line.parameters.refresh_for(line.now, ID);
    line.parameters.refresh_for(line.now, OperationId(8));
    line.run_for(5_000);

    assert_eq!(line.sent.iter().filter(|(_, message)| is_list(message)).count(), 1);
    let done = |id| (21_010, ParameterOutput::Done { id, result: Ok(()) });
    assert_eq!(line.done, [(21_010, ParameterOutput::Settled), done(ID), done(OperationId(8))]);
}

/// "The daemon can read, cache and set a gimbal's parameters itself, with retry": what is known of before counts for nothing
/// when they are read again, since it may have been changed with the maker's own program.
#[test]
fn a_refresh_reads_what_is_known_once_more() {
    let mut line = Line::settled(&NAMES);
    line.change_unheard("BETA", 99.0);
    line.lost = |_, message| is_list(message);

    line.parameters.refresh_for(line.now, ID);
    line.run_for(10_000);

    let read = |at: u64, name: &str| (at, name.to_owned(), -1);
    assert_eq!(line.reads(), [read(23_000, "ALPHA"), read(23_010, "BETA"), read(23_020, "GAMMA")]);
    assert_eq!(line.done.last(), Some(&(24_020, ParameterOutput::Done { id: ID, result: Ok(()) })));
    assert_eq!(line.parameters.values().collect::<Vec<_>>(), [("ALPHA", 10.0), ("BETA", 99.0), ("GAMMA", 12.0)]);
}

/// What it told beyond its maker's names is read again by its name, too.
#[test]
fn a_refresh_reads_what_no_table_has() {
    let mut line = Line::settled(&NAMES);
    line.lost = |_, message| is_list(message);
    let value = PARAM_VALUE_DATA {
        param_value: 5.0,
        param_count: 4,
        param_index: 3,
        param_id: CharArray::from("DELTA"),
        param_type: 4,
    };
    line.hear(&encode_to_vec(GIMBAL, 0, &value));

    line.parameters.refresh_for(line.now, ID);
    line.run_for(20_000);

    let of_delta: Vec<i16> =
        line.reads().into_iter().filter(|(_, name, _)| name == "DELTA").map(|(_, _, index)| index).collect();
    assert_eq!(of_delta, [-1; 5]);
    let result = Err(OperationError::NoEffect(
        "1 of its 4 parameters did not come in time; ask again, and check the line to it".to_owned(),
    ));
    assert_eq!(line.done.last().map(|(_, done)| done), Some(&ParameterOutput::Done { id: ID, result }));
}

/// Who asks for a reading of which nothing comes is told so, and what was known stays known.
#[test]
fn a_refresh_without_an_answer_is_not_done() {
    for (names, error) in [(&NAMES[..], OperationError::NoAnswer), (&[], OperationError::NoParameters)] {
        let mut line = Line::settled(names);
        let known: Vec<(String, f64)> = line.parameters.by_name().into_iter().collect();
        line.lost = |_, _| true;

        line.parameters.refresh_for(line.now, ID);
        line.run_for(20_000);

        let results: Vec<_> = line.done.drain(..).map(|(_, done)| done).collect();
        assert_eq!(results, [ParameterOutput::Settled, ParameterOutput::Done { id: ID, result: Err(error) }]);
        assert_eq!(line.parameters.by_name().into_iter().collect::<Vec<_>>(), known);
    }
}

/// A twentieth of all that is said is lost either way: what was changed meanwhile is known all the same.
#[test]
fn a_refresh_on_a_bad_line_is_whole() {
    for seed in 1..=50 {
        let mut line = Line::settled(&NAMES);
        for (at, name) in NAMES.iter().enumerate() {
            line.change_unheard(name, 20.0 + at as f32);
        }
        line.loss = Some((0.05, Random::new(seed)));

        line.parameters.refresh_for(line.now, ID);
        line.run_for(20_000);

        assert_eq!(line.done.last().map(|(_, done)| done), Some(&ParameterOutput::Done { id: ID, result: Ok(()) }));
        let values: Vec<f64> = line.parameters.values().map(|(_, value)| value).collect();
        assert_eq!(values, [20.0, 21.0, 22.0], "{seed}");
    }
}

/// Every queue has a bound: who asks for one more reading than are waited for is told so at once, and the others have theirs.
#[test]
fn so_many_wait_for_a_refresh_and_no_more() {
    let mut line = Line::settled(&NAMES);
    for id in 0..9 {
        line.parameters.refresh_for(line.now, OperationId(id));
    }
    line.settle();
    let busy = ParameterOutput::Done { id: OperationId(8), result: Err(OperationError::Busy) };
    assert_eq!(line.done, [(20_000, busy)]);
    line.done.clear();
    line.run_for(5_000);
    let done = |id| (21_010, ParameterOutput::Done { id: OperationId(id), result: Ok(()) });
    assert_eq!(line.done[1..], (0..8).map(done).collect::<Vec<_>>());
}
