//! Does what drivers and managers want done: frames of our own, orders to a gimbal, answers.

use super::roster::{GimbalOutput, LeftTurning};
use super::settings::Role;
use super::transactions::{Asker, Order};
use super::{Bridge, heartbeat, surroundings};
use crate::channel::ChannelSet;
use crate::gimbals::DriverOutput;
use crate::gimbals::report::Report;
use crate::gimbals::settings::Family;
use crate::manager::ManagerOutput;
use crate::manager::asked::NotDone;
use crate::timestamp::Timestamp;
use crate::wire::MavId;
use crate::wire::dialect::MavMessage;

/// Which gimbals may be turning, as it is kept outside.
#[derive(Debug, Default)]
pub(super) struct NotedTurning {
    /// By place in the roster, with their devices, and whose words stop them.
    gimbals: Vec<(usize, Option<MavId>, Option<Family>)>,
    /// The revision of those that are waited for.
    awaited: u32,
}

impl Bridge {
    /// Does what the gimbals' drivers and managers want done, and what is to be done about our own commands.
    pub(super) fn carry_out(&mut self, now: Timestamp) {
        if self.identity.system().is_none() {
            return;
        }
        self.carry_out_for_gimbals(now);
        self.answer_for_lost_gimbals(now);
        self.carry_out_own_commands(now);
        self.note_turning();
        self.note_gimbal_ids();
    }

    /// Whoever is killed while a gimbal turns finds out at the next start that it is to be stopped, and so are those that are
    /// waited for since the last one.
    fn note_turning(&mut self) {
        let turning = self.roster.iter().enumerate().filter(|(_, gimbal)| gimbal.may_be_turning());
        let awaited = self.roster.awaited();
        let noted = turning.clone().map(|(at, gimbal)| (at, gimbal.adopted, gimbal.driver.stops_as()));
        if self.turning.awaited == awaited.revision() && self.turning.gimbals.iter().copied().eq(noted.clone()) {
            return;
        }
        let gimbals = noted.collect();
        // Where there are more than the next start takes, those that turn now come last and are taken.
        let lines = awaited.iter().cloned().chain(turning.map(|(_, gimbal)| LeftTurning::of(gimbal)));
        let lines: String = lines.map(|left| format!("{left}\n")).collect();
        self.turning = NotedTurning { gimbals, awaited: awaited.revision() };
        self.outbox.push_turning(lines);
    }

    /// The next start gives every gimbal the ids that it has.
    fn note_gimbal_ids(&mut self) {
        let kept = self.roster.kept_ids();
        if self.kept_ids != kept.revision() {
            self.kept_ids = kept.revision();
            let lines = kept.iter().map(|ids| format!("{ids}\n")).collect();
            self.outbox.push_gimbal_ids(lines);
        }
    }

    pub(super) fn carry_out_for_gimbals(&mut self, now: Timestamp) {
        for at in 0..self.roster.len() {
            while let Some(output) = self.roster.get_mut(at).poll_output() {
                let component = self.roster.get_mut(at).component;
                match output {
                    GimbalOutput::Driver(DriverOutput::Message(message)) => {
                        // Also before the manager is told that it is there.
                        let device = self.roster.get_mut(at).adopted;
                        let channels = device.map_or(ChannelSet::EMPTY, |device| self.channels_of_device(device));
                        self.send(now, channels, component, &message);
                    }
                    GimbalOutput::Driver(DriverOutput::Command(command)) => {
                        let order = Order { asker: Asker::Driver, manager: component, command: *command };
                        self.transactions.send(now, order);
                    }
                    GimbalOutput::Driver(DriverOutput::Report(report)) => {
                        if report == Report::SpeaksForItself(false) {
                            self.roster.keep_number(at);
                        }
                        let around = surroundings(&self.vehicle, self.autopilot, &self.ranks);
                        self.roster.get_mut(at).manager.handle_report(now, report, around);
                    }
                    GimbalOutput::Driver(DriverOutput::Operated { id, result }) => {
                        let answer = result.map_err(NotDone::Operation);
                        self.conclude(now, component, id, answer);
                    }
                    GimbalOutput::Manager(output) => self.carry_out_for_manager(now, at, component, output),
                }
            }
        }
    }

    pub(super) fn carry_out_for_manager(&mut self, now: Timestamp, at: usize, component: u8, output: ManagerOutput) {
        match output {
            ManagerOutput::Reply { to, channel, message } => {
                // Who cannot be learned, such as a component 0, is where it spoke; and what another vehicle's autopilot is
                // answered is not for ours, which has the same id.
                let known = self.router.route_known(now, to);
                let is_namesake = self.channels.role(channel).is_some_and(|role| self.is_namesake(now, role, to));
                let channels = if known.is_empty() || is_namesake { channel.into() } else { known };
                self.answer(now, channels, component, &message);
            }
            ManagerOutput::Answer { channel, message } => self.answer(now, channel.into(), component, &message),
            ManagerOutput::Broadcast { channels, message } => {
                let mut channels = channels.unwrap_or(self.channels.open_set());
                if !matches!(*message, MavMessage::GIMBAL_MANAGER_STATUS(_)) {
                    // A gimbal has no use for what a manager tells its clients.
                    channels = channels.without(self.channels.with_role(Role::Gimbal));
                }
                if matches!(
                    *message,
                    MavMessage::GIMBAL_DEVICE_INFORMATION(_) | MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(_)
                ) {
                    // The autopilot sees the presented device, and would not tell the two apart.
                    channels = channels.without(self.channels_presenting(component));
                }
                self.send(now, channels, component, &message);
            }
            ManagerOutput::Heartbeat { channels } => {
                let message = heartbeat::heartbeat(self.roster.get_mut(at), self.identity.is_bootstrap());
                self.answer(now, channels.unwrap_or(self.channels.open_set()), component, &message);
            }
            ManagerOutput::Steer(setpoint) => self.roster.get_mut(at).driver.handle_setpoint(now, setpoint),
            ManagerOutput::Commanded { id, commander } => self.handle_commanded(now, component, id, commander),
            // One that was refused because too much is being done is not done.
            ManagerOutput::Operate { id, .. } if !self.asked.is_under_way(component, id) => {}
            ManagerOutput::Operate { id, operation } => {
                self.roster.get_mut(at).driver.handle_operation(now, id, operation)
            }
            ManagerOutput::Given { id } => self.roster.get_mut(at).manager.handle_given(id),
            ManagerOutput::AskAutopilot { message_id } => self.ask_autopilot_for(now, component, message_id),
            ManagerOutput::Event(event) => self.handle_event(now, at, event),
        }
    }

    pub(super) fn channels_of_device(&self, device: MavId) -> ChannelSet {
        self.roster.channel_of(device).map_or(ChannelSet::EMPTY, ChannelSet::from)
    }

    /// Sends a message of our own, numbered for each channel.
    pub(super) fn send(&mut self, now: Timestamp, channels: ChannelSet, component: u8, message: &MavMessage) {
        if let Some(system) = self.identity.system() {
            self.send_as(now, system, channels, component, message);
        }
    }

    /// Sends what was asked for, numbered for each channel.
    pub(super) fn answer(&mut self, now: Timestamp, channels: ChannelSet, component: u8, message: &MavMessage) {
        if let Some(system) = self.identity.system() {
            let frame = self.buffer.encode_any(MavId::new(system, component), 0, message);
            self.channels.transmit_answer(now, channels, &frame, &mut self.outbox);
        }
    }

    pub(super) fn send_as(
        &mut self,
        now: Timestamp,
        system: u8,
        channels: ChannelSet,
        component: u8,
        message: &MavMessage,
    ) {
        // The number is given where the frame leaves.
        let frame = self.buffer.encode_any(MavId::new(system, component), 0, message);
        self.channels.transmit_own(now, channels, &frame, &mut self.outbox);
    }
}
