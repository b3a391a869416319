//! The commands of our own: where they go, and who is told how they went.

use super::Bridge;
use super::transactions::{Asker, TransactionOutput};
use crate::timestamp::Timestamp;
use crate::wire::dialect::{COMMAND_ACK_DATA, COMMAND_LONG_DATA, MavMessage};
use crate::wire::{Frame, MavId, Target};

impl Bridge {
    /// Somebody's answer to a command, maybe to one of ours.
    pub(super) fn handle_command_ack(&mut self, now: Timestamp, frame: &Frame<'_>) {
        if let Some(system) = self.identity.system()
            && let Some(ack) = frame.decode::<COMMAND_ACK_DATA>()
        {
            self.transactions.handle_ack(now, system, frame.source(), frame.target(), &ack);
        }
    }

    /// Sends what is to be sent of our commands, and hands their outcomes to whoever asked.
    pub(super) fn carry_out_own_commands(&mut self, now: Timestamp) {
        while let Some(output) = self.transactions.poll_output() {
            match output {
                TransactionOutput::Send { manager, command } => self.send_command(now, manager, command),
                TransactionOutput::Finished { order, outcome } => {
                    match order.asker {
                        Asker::Streams { message_id } => {
                            self.streams.handle_outcome(message_id, outcome);
                            self.look_after_streams(now);
                        }
                        Asker::RivalWatch | Asker::Message => {}
                        Asker::Driver => {
                            if let Some(gimbal) = self.roster.of_manager(order.manager) {
                                gimbal.driver.handle_command_outcome(now, &order.command, outcome);
                            }
                        }
                    }
                    self.carry_out_for_gimbals(now);
                }
            }
        }
    }

    /// Sends a command of ours to where its target is.
    fn send_command(&mut self, now: Timestamp, manager: u8, command: COMMAND_LONG_DATA) {
        let target = MavId::new(command.target_system, command.target_component);
        let channels = match self.roster.channel_of(target) {
            Some(channel) => channel.into(),
            None => self.router.route_own(now, Target::Component(target)),
        };
        self.send(now, channels, manager, &MavMessage::COMMAND_LONG(command));
    }
}
