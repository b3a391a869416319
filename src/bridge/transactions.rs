//! Our own commands: sent again until they are answered, one at a time for each target and number.
//!
//! "When we are the sender: 1 outstanding command per (target, command id); 3 tries 500 ms apart; accept an ACK whose
//! target is us, or 0/0" (protocol notes 2.1). A `COMMAND_ACK` names the command and nothing else of it, so the answers
//! to two commands of one number could not be told apart; the second waits until the first is done with.

use std::collections::VecDeque;
use std::time::Duration;

use crate::gimbals::CommandOutcome;
use crate::timestamp::Timestamp;
use crate::wire::dialect::{COMMAND_ACK_DATA, COMMAND_LONG_DATA};
use crate::wire::ids::CommandResult;
use crate::wire::{MavId, Target};

/// A command is sent so often in all …
pub const TRIES: u8 = 3;

/// … each time after so long without an answer.
pub const PATIENCE: Duration = Duration::from_millis(500);

/// Who says that it is at work is waited for so long, and not asked again.
const PATIENCE_WITH_PROGRESS: Duration = Duration::from_secs(5);

/// A command that was sent more often than it was answered may be answered once more; as long the next one waits, or
/// it would be taken for answered.
const LATE_ANSWERS_WITHIN: Duration = Duration::from_secs(1);

/// So many commands wait at most, those sent and not yet answered among them.
const CAPACITY: usize = 64;

/// Who asked for a command, and is told how it went.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Asker {
    /// What we want of the autopilot, for this message.
    Streams { message_id: u32 },
    /// The driver of the gimbal whose manager sends it.
    Driver,
    /// Whoever looks for another manager; what it wants to know comes as a message.
    RivalWatch,
    /// A manager that wants a message of the autopilot, and takes what comes.
    Message,
}

/// A command to one component.
#[derive(Clone, Debug, PartialEq)]
pub struct Order {
    pub asker: Asker,
    /// The manager that sends it, and that the answer is for.
    pub manager: u8,
    pub command: COMMAND_LONG_DATA,
}

impl Order {
    fn target(&self) -> MavId {
        MavId::new(self.command.target_system, self.command.target_component)
    }

    /// Whether the other one asks for the very same thing.
    fn repeats(&self, other: &Self) -> bool {
        let params = |command: &COMMAND_LONG_DATA| {
            let COMMAND_LONG_DATA { param1, param2, param3, param4, param5, param6, param7, .. } = command;
            [param1, param2, param3, param4, param5, param6, param7].map(|param| param.to_bits())
        };
        (self.asker, self.manager, params(&self.command)) == (other.asker, other.manager, params(&other.command))
    }
}

/// What is to be done.
#[derive(Clone, Debug, PartialEq)]
pub enum TransactionOutput {
    Send { manager: u8, command: COMMAND_LONG_DATA },
    Finished { order: Order, outcome: CommandOutcome },
}

/// The commands of one number to one component.
#[derive(Debug)]
struct Lane {
    target: MavId,
    number: u16,
    sent: Option<Sent>,
    waiting: VecDeque<Order>,
    /// Answers to the one before may come until then.
    closed_until: Option<Timestamp>,
}

/// A command that was not answered yet.
#[derive(Debug)]
struct Sent {
    order: Order,
    tries: u8,
    deadline: Timestamp,
    in_progress: bool,
}

/// All commands of ours that are on their way or wait for their turn.
#[derive(Debug, Default)]
pub struct Transactions {
    lanes: Vec<Lane>,
    outputs: VecDeque<TransactionOutput>,
}

impl Transactions {
    /// Sends a command as soon as nothing like it is on its way to its target. One that waits or is under way already
    /// is not sent a second time; whoever asked is told once.
    pub fn send(&mut self, now: Timestamp, order: Order) {
        let (target, number) = (order.target(), order.command.command);
        if self.lanes.iter().map(Lane::len).sum::<usize>() >= CAPACITY {
            tracing::debug!(%target, command = number, "too many commands under way");
            self.outputs.push_back(TransactionOutput::Finished { order, outcome: CommandOutcome::Unanswered });
            return;
        }
        let at = match self.lanes.iter().position(|lane| (lane.target, lane.number) == (target, number)) {
            Some(at) => at,
            None => {
                let waiting = VecDeque::new();
                self.lanes.push(Lane { target, number, sent: None, waiting, closed_until: None });
                self.lanes.len() - 1
            }
        };
        let lane = &mut self.lanes[at];
        let under_way = lane.sent.as_ref().map(|sent| &sent.order);
        if under_way.into_iter().chain(&lane.waiting).any(|known| known.repeats(&order)) {
            return;
        }
        lane.waiting.push_back(order);
        lane.send_next(now, &mut self.outputs);
    }

    /// Whether a command of that number to `target` would leave at once.
    pub fn is_free(&self, target: MavId, number: u16) -> bool {
        !self.lanes.iter().any(|lane| (lane.target, lane.number) == (target, number))
    }

    /// A `COMMAND_ACK` from `source` to `target`, whoever it is meant for; `system` is our system.
    pub fn handle_ack(&mut self, now: Timestamp, system: u8, source: MavId, target: Target, ack: &COMMAND_ACK_DATA) {
        let lane = self.lanes.iter_mut().find(|lane| (lane.target, lane.number) == (source, ack.command));
        let Some(lane) = lane else { return };
        let Some(sent) = &mut lane.sent else { return };
        if !target.includes(MavId::new(system, sent.order.manager)) {
            return;
        }
        if ack.result == CommandResult::InProgress as u8 {
            sent.in_progress = true;
            sent.deadline = now + PATIENCE_WITH_PROGRESS;
            return;
        }
        lane.finish(now, CommandOutcome::Answered(ack.result), &mut self.outputs);
        self.lanes.retain(Lane::is_in_use);
    }

    /// Forgets every command: the system that sent them is ours no more. Drivers, which wait for what became of theirs, are
    /// told that there was no answer; nobody else is told.
    pub fn clear(&mut self) {
        let is_of_driver = |order: &Order| order.asker == Asker::Driver;
        self.outputs
            .retain(|output| matches!(output, TransactionOutput::Finished { order, .. } if is_of_driver(order)));
        let lanes = self.lanes.drain(..);
        let orders = lanes.flat_map(|lane| lane.sent.map(|sent| sent.order).into_iter().chain(lane.waiting));
        let unanswered = |order| TransactionOutput::Finished { order, outcome: CommandOutcome::Unanswered };
        self.outputs.extend(orders.filter(is_of_driver).map(unanswered));
    }

    pub fn handle_timeout(&mut self, now: Timestamp) {
        for lane in &mut self.lanes {
            lane.handle_timeout(now, &mut self.outputs);
        }
        self.lanes.retain(Lane::is_in_use);
    }

    pub fn poll_output(&mut self) -> Option<TransactionOutput> {
        self.outputs.pop_front()
    }

    pub fn poll_timeout(&self) -> Option<Timestamp> {
        self.lanes.iter().filter_map(Lane::poll_timeout).min()
    }
}

impl Lane {
    fn len(&self) -> usize {
        self.waiting.len() + usize::from(self.sent.is_some())
    }

    fn is_in_use(&self) -> bool {
        self.len() > 0 || self.closed_until.is_some()
    }

    fn poll_timeout(&self) -> Option<Timestamp> {
        self.sent.as_ref().map(|sent| sent.deadline).or(self.closed_until)
    }

    fn handle_timeout(&mut self, now: Timestamp, outputs: &mut VecDeque<TransactionOutput>) {
        match &mut self.sent {
            Some(sent) if sent.deadline > now => {}
            Some(sent) if sent.tries < TRIES && !sent.in_progress => {
                let confirmation = sent.tries;
                sent.tries += 1;
                sent.deadline = now + PATIENCE;
                let command = COMMAND_LONG_DATA { confirmation, ..sent.order.command.clone() };
                outputs.push_back(TransactionOutput::Send { manager: sent.order.manager, command });
            }
            Some(_) => self.finish(now, CommandOutcome::Unanswered, outputs),
            None if self.closed_until.is_some_and(|until| until <= now) => {
                self.closed_until = None;
                self.send_next(now, outputs);
            }
            None => {}
        }
    }

    fn send_next(&mut self, now: Timestamp, outputs: &mut VecDeque<TransactionOutput>) {
        if self.sent.is_some() || self.closed_until.is_some() {
            return;
        }
        let Some(order) = self.waiting.pop_front() else { return };
        outputs.push_back(TransactionOutput::Send { manager: order.manager, command: order.command.clone() });
        self.sent = Some(Sent { order, tries: 1, deadline: now + PATIENCE, in_progress: false });
    }

    fn finish(&mut self, now: Timestamp, outcome: CommandOutcome, outputs: &mut VecDeque<TransactionOutput>) {
        let Some(Sent { order, tries, .. }) = self.sent.take() else { return };
        let (target, command) = (self.target, self.number);
        tracing::debug!(%target, command, param1 = order.command.param1, tries, ?outcome, "command of ours");
        let answers = u8::from(outcome != CommandOutcome::Unanswered);
        self.closed_until = (tries > answers).then(|| now + LATE_ANSWERS_WITHIN);
        outputs.push_back(TransactionOutput::Finished { order, outcome });
        self.send_next(now, outputs);
    }
}

#[cfg(test)]
mod tests {
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

        let unanswered = |order| TransactionOutput::Finished { order, outcome: CommandOutcome::Unanswered };
        assert_eq!(drain(&mut transactions), [unanswered(of_driver(285)), unanswered(of_driver(265))]);
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
}
