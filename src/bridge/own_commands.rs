//! What we ask of others: the commands of our own, and who is told how they went.

use super::Bridge;
use super::settings::Role;
use super::transactions::{Asker, Order, TransactionOutput};
use crate::gimbals::mavlink_v2::packet;
use crate::timestamp::Timestamp;
use crate::wire::dialect::{COMMAND_ACK_DATA, COMMAND_LONG_DATA, MavMessage};
use crate::wire::ids::{command, message};
use crate::wire::{Frame, MavId, Target};

impl Bridge {
    /// Which messages of the autopilot are wanted at present.
    pub(super) fn look_after_streams(&mut self, now: Timestamp) {
        match (self.autopilot.is_some() && self.vehicle.alive(now), self.streams.has_autopilot()) {
            (true, false) => self.streams.handle_autopilot_found(now),
            (false, true) => self.streams.handle_autopilot_lost(),
            _ => {}
        }
        let has_gimbal_of_ours = self.roster.iter().filter_map(|gimbal| gimbal.manager.device()).any(|device| {
            let channels = self.channels_of_device(device);
            !channels.is_empty() && channels.intersection(self.channels.with_role(Role::Autopilot)).is_empty()
        });
        self.streams.set_needed(message::AUTOPILOT_STATE_FOR_GIMBAL_DEVICE, has_gimbal_of_ours);
        self.streams.set_needed(message::GLOBAL_POSITION_INT, true);
        self.streams.set_needed(message::ATTITUDE, self.vehicle.heading(now).is_none());
    }

    pub(super) fn ask_autopilot(&mut self, now: Timestamp) {
        let Some(autopilot) = self.autopilot.filter(|_| self.may_ask_autopilot()) else { return };
        let Some((message_id, interval)) = self.streams.take_due(now) else { return };
        let command = packet::set_message_interval(autopilot, message_id, interval);
        let manager = self.roster.get_mut(0).component;
        self.transactions.send(now, Order { asker: Asker::Streams { message_id }, manager, command });
    }

    /// Whether there is an autopilot that has answered, or will not answer, what we asked of it before.
    pub(super) fn may_ask_autopilot(&self) -> bool {
        self.identity.system().is_some()
            && self.autopilot.is_some_and(|it| self.transactions.is_free(it, command::SET_MESSAGE_INTERVAL))
    }

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
                        Asker::Streams { message_id } => self.streams.handle_outcome(message_id, outcome),
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
