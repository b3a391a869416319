use super::*;
use crate::wire::ids::command;

const AUTOPILOT: MavId = MavId::new(1, 1);
const ACCEPTED: CommandOutcome = CommandOutcome::Answered(0);

/// Protocol checklist 132: "When our own command gets no ACK, it is retried after 0.5 s with confirmation + 1, at most
/// 3 times."
#[test]
fn a_command_without_an_answer_is_sent_three_times_half_a_second_apart() {
    let mut transactions = Transactions::default();
    transactions.send(at(1_000), interval(286));

    assert_eq!(
        run_until(&mut transactions, at(60_000), at(1_000)),
        [
            (at(1_000), send(286, 0)),
            (at(1_500), send(286, 1)),
            (at(2_000), send(286, 2)),
            (at(2_500), finished(286, CommandOutcome::Unanswered)),
        ]
    );
    assert_eq!(transactions.poll_timeout(), None);
}

/// "accept an ACK whose target is us, or 0/0 …; match on source component, command id and target". Protocol
/// checklist 133: "When an ACK with target 0/0 arrives for our outstanding command, it is accepted." 134: "When an ACK
/// for somebody else arrives, it … does not complete our transaction."
#[test]
#[rustfmt::skip]
fn only_the_answer_of_the_one_asked_to_the_one_who_asked_counts() {
    for (source,           target,                              number, counts) in [
        (AUTOPILOT,        (1, 191),                            511,    true),
        (AUTOPILOT,        (1, 0),                              511,    true),
        (AUTOPILOT,        (0, 0),                              511,    true),
        (AUTOPILOT,        (255, 190),                          511,    false),
        (AUTOPILOT,        (1, 192),                            511,    false),
        (AUTOPILOT,        (2, 0),                              511,    false),
        (AUTOPILOT,        (1, 191),                            512,    false),
        (MavId::new(1, 2), (1, 191),                            511,    false),
        (MavId::new(2, 1), (1, 191),                            511,    false),
    ] {
        let mut transactions = Transactions::default();
        transactions.send(at(0), interval(286));
        drain(&mut transactions);

        acknowledge(&mut transactions, at(100), source, target, number, 0);

        let expected = if counts { vec![finished(286, ACCEPTED)] } else { vec![] };
        assert_eq!(drain(&mut transactions), expected, "{source} to {target:?}, command {number}");
    }
}

/// "1 outstanding command per (target, command id)": a second one of the same number waits; other numbers and targets
/// do not.
#[test]
fn commands_of_one_number_to_one_target_wait_for_each_other() {
    let mut transactions = Transactions::default();
    let to_gimbal = Order {
        command: COMMAND_LONG_DATA { target_component: 154, ..interval(285).command },
        asker: Asker::Driver,
        ..interval(285)
    };
    transactions.send(at(0), interval(286));
    transactions.send(at(0), interval(30));
    transactions.send(at(0), interval(33));
    transactions.send(at(0), to_gimbal.clone());
    assert!(!transactions.is_free(AUTOPILOT, 511) && transactions.is_free(AUTOPILOT, 512));

    let to_gimbal = TransactionOutput::Send { manager: 191, command: to_gimbal.command };
    assert_eq!(drain(&mut transactions), [send(286, 0), to_gimbal]);
    acknowledge(&mut transactions, at(10), AUTOPILOT, (1, 191), 511, 2);
    assert_eq!(drain(&mut transactions), [finished(286, CommandOutcome::Answered(2)), send(30, 0)]);
    acknowledge(&mut transactions, at(20), AUTOPILOT, (1, 191), 511, 0);
    assert_eq!(drain(&mut transactions), [finished(30, ACCEPTED), send(33, 0)]);
    acknowledge(&mut transactions, at(30), AUTOPILOT, (1, 191), 511, 0);
    assert_eq!(drain(&mut transactions), [finished(33, ACCEPTED)]);
    assert!(transactions.is_free(AUTOPILOT, 511));
}

/// The answer to the first try came after the second was sent: the answer to that one must not be taken for one to
/// the command behind.
#[test]
fn late_and_doubled_answers_complete_nothing_else() {
    let mut transactions = Transactions::default();
    transactions.send(at(0), interval(286));
    transactions.send(at(0), interval(30));
    assert_eq!(run_until(&mut transactions, at(600), at(0)), [(at(0), send(286, 0)), (at(500), send(286, 1))]);

    acknowledge(&mut transactions, at(600), AUTOPILOT, (1, 191), 511, 2);
    assert_eq!(drain(&mut transactions), [finished(286, CommandOutcome::Answered(2))]);
    for late in [610, 1_100, 1_590] {
        acknowledge(&mut transactions, at(late), AUTOPILOT, (1, 191), 511, 2);
        assert_eq!(drain(&mut transactions), []);
    }
    assert_eq!(run_until(&mut transactions, at(1_600), at(1_600)), [(at(1_600), send(30, 0))]);

    acknowledge(&mut transactions, at(1_700), AUTOPILOT, (1, 191), 511, 0);
    assert_eq!(drain(&mut transactions), [finished(30, ACCEPTED)]);
    acknowledge(&mut transactions, at(1_710), AUTOPILOT, (1, 191), 511, 0);
    assert_eq!(drain(&mut transactions), [], "nothing is outstanding");
}

/// "IN_PROGRESS … then a final ACK": who is at work is not asked again, and not waited for without end.
#[test]
fn who_is_at_work_is_waited_for() {
    let mut transactions = Transactions::default();
    transactions.send(at(0), interval(286));
    acknowledge(&mut transactions, at(100), AUTOPILOT, (1, 191), 511, 5);
    acknowledge(&mut transactions, at(4_100), AUTOPILOT, (1, 191), 511, 5);

    assert_eq!(
        run_until(&mut transactions, at(60_000), at(4_100)),
        [(at(4_100), send(286, 0)), (at(9_100), finished(286, CommandOutcome::Unanswered)),]
    );

    transactions.send(at(60_000), interval(286));
    acknowledge(&mut transactions, at(60_100), AUTOPILOT, (1, 191), 511, 5);
    acknowledge(&mut transactions, at(63_000), AUTOPILOT, (1, 191), 511, 0);
    assert_eq!(drain(&mut transactions), [send(286, 0), finished(286, ACCEPTED)]);
}

#[test]
fn the_same_command_is_under_way_only_once() {
    let mut transactions = Transactions::default();
    for _ in 0..3 {
        transactions.send(at(0), interval(286));
        transactions.send(at(0), interval(30));
    }

    assert_eq!(drain(&mut transactions), [send(286, 0)]);
    acknowledge(&mut transactions, at(10), AUTOPILOT, (1, 191), 511, 0);
    assert_eq!(drain(&mut transactions), [finished(286, ACCEPTED), send(30, 0)]);
    acknowledge(&mut transactions, at(20), AUTOPILOT, (1, 191), 511, 0);
    assert_eq!(drain(&mut transactions), [finished(30, ACCEPTED)]);
}

#[test]
fn what_waits_is_bounded_and_whoever_asked_is_told() {
    let mut transactions = Transactions::default();
    for id in 0..CAPACITY as u32 + 1 {
        transactions.send(at(0), interval(id));
    }
    let last = CAPACITY as u32;
    assert_eq!(drain(&mut transactions), [send(0, 0), finished(last, CommandOutcome::Unanswered)]);
}

/// What happens up to `end`, from `now` on.
fn run_until(
    transactions: &mut Transactions,
    end: Timestamp,
    mut now: Timestamp,
) -> Vec<(Timestamp, TransactionOutput)> {
    let mut seen = Vec::new();
    loop {
        seen.extend(drain(transactions).into_iter().map(|output| (now, output)));
        match transactions.poll_timeout().filter(|due| *due <= end) {
            Some(due) => now = due.max(now),
            None => return seen,
        }
        transactions.handle_timeout(now);
    }
}

/// When our system is another, what was asked under the former id is over: a driver that waits for an answer goes on.
#[test]
fn drivers_are_told_of_commands_that_are_forgotten() {
    let mut transactions = Transactions::default();
    let of_driver = |message_id| Order { asker: Asker::Driver, ..interval(message_id) };
    transactions.send(at(0), of_driver(285));
    transactions.send(at(0), of_driver(265));
    transactions.send(at(0), interval(286));
    assert_eq!(drain(&mut transactions), [send(285, 0)]);

    transactions.clear();

    let given_up = |order| TransactionOutput::Finished { order, outcome: CommandOutcome::GivenUp };
    assert_eq!(drain(&mut transactions), [given_up(of_driver(285)), given_up(of_driver(265))]);
    assert_eq!(transactions.poll_timeout(), None);
}

fn drain(transactions: &mut Transactions) -> Vec<TransactionOutput> {
    std::iter::from_fn(|| transactions.poll_output()).collect()
}

fn acknowledge(
    transactions: &mut Transactions,
    now: Timestamp,
    source: MavId,
    (target_system, target_component): (u8, u8),
    command: u16,
    result: u8,
) {
    let target = Target::new(target_system, target_component);
    let ack = COMMAND_ACK_DATA { command, result, progress: 0, result_param2: 0, target_system, target_component };
    transactions.handle_ack(now, 1, source, target, &ack);
}

fn interval(message_id: u32) -> Order {
    let command = COMMAND_LONG_DATA {
        param1: message_id as f32,
        param2: 40_000.0,
        param3: 0.0,
        param4: 0.0,
        param5: 0.0,
        param6: 0.0,
        param7: 0.0,
        command: command::SET_MESSAGE_INTERVAL,
        target_system: AUTOPILOT.system,
        target_component: AUTOPILOT.component,
        confirmation: 0,
    };
    Order { asker: Asker::Streams { message_id }, manager: 191, command }
}

fn send(message_id: u32, confirmation: u8) -> TransactionOutput {
    let command = COMMAND_LONG_DATA { confirmation, ..interval(message_id).command };
    TransactionOutput::Send { manager: 191, command }
}

fn finished(message_id: u32, outcome: CommandOutcome) -> TransactionOutput {
    TransactionOutput::Finished { order: interval(message_id), outcome }
}

fn at(millis: u64) -> Timestamp {
    Timestamp::from_millis(millis)
}
