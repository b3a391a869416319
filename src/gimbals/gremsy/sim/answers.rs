//! Acknowledgements, which come a little later than what they answer.

use std::time::Duration;

use crate::sim::command::Command;
use crate::sim::outbox::Outbox;
use crate::sim::random::Random;
use crate::timestamp::Timestamp;
use crate::wire::ids::CommandResult;

const LEAST: Duration = Duration::from_millis(5);
const SPREAD: Duration = Duration::from_millis(25);

/// More unanswered commands than a line of 115 200 baud brings within the time.
const CAPACITY: usize = 64;

#[derive(Clone, Debug, Default)]
pub struct Answers(Vec<(Timestamp, Command, CommandResult)>);

impl Answers {
    pub fn give(&mut self, now: Timestamp, random: &mut Random, command: Command, result: CommandResult) {
        if self.0.len() < CAPACITY {
            self.0.push((now + LEAST + SPREAD.mul_f64(random.unit()), command, result));
        }
    }

    pub fn send_due(&mut self, now: Timestamp, outbox: &mut Outbox) {
        let due = self.0.extract_if(.., |(at, ..)| *at <= now);
        for (_, command, result) in due {
            command.acknowledge(outbox, result);
        }
    }

    pub fn poll_timeout(&self) -> Option<Timestamp> {
        self.0.iter().map(|(at, ..)| *at).min()
    }
}
