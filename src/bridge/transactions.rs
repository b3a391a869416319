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
    /// told that it is given up; nobody else is told.
    pub fn clear(&mut self) {
        let is_of_driver = |order: &Order| order.asker == Asker::Driver;
        self.outputs
            .retain(|output| matches!(output, TransactionOutput::Finished { order, .. } if is_of_driver(order)));
        let lanes = self.lanes.drain(..);
        let orders = lanes.flat_map(|lane| lane.sent.map(|sent| sent.order).into_iter().chain(lane.waiting));
        let given_up = |order| TransactionOutput::Finished { order, outcome: CommandOutcome::GivenUp };
        self.outputs.extend(orders.filter(is_of_driver).map(given_up));
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
mod tests;
