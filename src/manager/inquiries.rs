//! What clients ask to be told: `REQUEST_MESSAGE` (512), `SET_MESSAGE_INTERVAL` (511), `GET_MESSAGE_INTERVAL` (510).
//!
//! 283 and 285 are a v2 device's own, and whoever asks us for them is refused (D23: DENIED, since a client that reads
//! UNSUPPORTED asks 25 times); of a gimbal that is no v2 device they are ours.

use super::commands::Outcome;
use super::messages::{self, Interval};
use super::request::{Command, Refusal};
use super::{GimbalManager, ManagerOutput, Sender, Surroundings};
use crate::timestamp::Timestamp;
use crate::wire::dialect::MavMessage;
use crate::wire::ids::message;

/// Parameter 7 of 512, "target address for requested message": broadcast. Anything else is answered where it was asked.
const TO_EVERYBODY: f32 = 2.0;

impl GimbalManager {
    /// 280 before the gimbal is known is TEMPORARILY_REJECTED; nobody needs to be remembered, because every channel is told
    /// as soon as it is known.
    pub(super) fn request_message(
        &mut self,
        now: Timestamp,
        sender: Sender,
        command: &Command,
        around: Surroundings<'_>,
    ) -> Result<Outcome, Refusal> {
        let to_everybody = command.param(7) == Some(TO_EVERYBODY);
        let not_yet = Refusal::later("no_gimbal_yet");
        let message = match command.message_id(1) {
            Some(message::GIMBAL_MANAGER_INFORMATION) => self.information(now, around).ok_or(not_yet)?,
            Some(message::GIMBAL_MANAGER_STATUS) => self.status_message(now).ok_or(not_yet)?,
            Some(message::COMPONENT_INFORMATION_BASIC) => Box::new(messages::component_information_basic(now)),
            Some(message::MESSAGE_INTERVAL) => {
                let id = command.message_id(2).unwrap_or(u32::MAX);
                Box::new(self.message_interval(sender, id))
            }
            Some(message::GIMBAL_DEVICE_INFORMATION) if self.voice.is_some() => {
                self.device_information(now).ok_or(not_yet)?
            }
            Some(message::GIMBAL_DEVICE_ATTITUDE_STATUS) if self.voice.is_some() => {
                self.device_attitude_status(now, around).ok_or(not_yet)?
            }
            Some(id @ (message::MOUNT_STATUS | message::MOUNT_ORIENTATION)) => {
                let refusal = if self.device().is_none() { not_yet } else { Refusal::later("no_attitude") };
                self.mount_report(now, id, around).ok_or(refusal)?
            }
            Some(message::HEARTBEAT) if command.is_directed() => {
                let channels = (!to_everybody).then(|| sender.channel.into());
                self.outputs.push_back(ManagerOutput::Heartbeat { channels });
                return Ok(Outcome::Accepted);
            }
            id => return not_ours(command, id),
        };
        let is_of_device =
            matches!(*message, MavMessage::GIMBAL_DEVICE_INFORMATION(_) | MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(_));
        self.outputs.push_back(if to_everybody {
            ManagerOutput::Broadcast { channels: None, message }
        } else if is_of_device && !command.is_directed() {
            // Who asks everybody may have another device of this gimbal's where it is.
            ManagerOutput::Broadcast { channels: Some(sender.channel.into()), message }
        } else {
            ManagerOutput::Answer { channel: sender.channel, message }
        });
        Ok(Outcome::Accepted)
    }

    pub(super) fn set_message_interval(
        &mut self,
        now: Timestamp,
        sender: Sender,
        command: &Command,
    ) -> Result<Outcome, Refusal> {
        let micros = command.param(2).unwrap_or(0.0);
        let schedule = match (command.message_id(1), &mut self.voice) {
            (Some(message::GIMBAL_MANAGER_STATUS), _) => &mut self.status_schedule,
            (Some(message::GIMBAL_MANAGER_INFORMATION), _) => &mut self.information_schedule,
            (Some(message::GIMBAL_DEVICE_ATTITUDE_STATUS), Some(voice)) => &mut voice.schedule,
            (id, _) => match id.and_then(|id| self.mount_reports.schedule_mut(id)) {
                Some(schedule) => schedule,
                None => return not_ours(command, id),
            },
        };
        let set = schedule.set(now, sender.channel, micros);
        set.map_err(|_| Refusal::denied("invalid_interval"))?;
        Ok(Outcome::Accepted)
    }

    pub(super) fn get_message_interval(&mut self, sender: Sender, command: &Command) -> Outcome {
        let id = command.message_id(1).unwrap_or(u32::MAX);
        let interval = self.message_interval(sender, id);
        if !command.is_directed() && interval == messages::message_interval(id, Interval::NotAvailable) {
            return Outcome::Ignored;
        }
        self.outputs.push_back(ManagerOutput::Answer { channel: sender.channel, message: Box::new(interval) });
        Outcome::Accepted
    }

    fn message_interval(&self, sender: Sender, message_id: u32) -> MavMessage {
        let interval = match (message_id, &self.voice) {
            (message::HEARTBEAT, _) => Interval::Every(std::time::Duration::from_secs(1)),
            (message::GIMBAL_MANAGER_STATUS, _) => self.status_schedule.interval(sender.channel),
            (message::GIMBAL_MANAGER_INFORMATION, _) => self.information_schedule.interval(sender.channel),
            (message::GIMBAL_DEVICE_ATTITUDE_STATUS, Some(voice)) => voice.schedule.interval(sender.channel),
            (id, _) => {
                let schedule = self.mount_reports.schedule(id);
                schedule.map_or(Interval::NotAvailable, |schedule| schedule.interval(sender.channel))
            }
        };
        messages::message_interval(message_id, interval)
    }
}

/// A message that others may have: refused to whoever asked exactly us.
fn not_ours(command: &Command, message_id: Option<u32>) -> Result<Outcome, Refusal> {
    if !command.is_directed() {
        return Ok(Outcome::Ignored);
    }
    Err(Refusal::denied(match message_id {
        Some(message::GIMBAL_DEVICE_INFORMATION | message::GIMBAL_DEVICE_ATTITUDE_STATUS) => "message_of_the_device",
        Some(message::HEARTBEAT) => "heartbeat_is_fixed",
        _ => "unknown_message",
    }))
}
