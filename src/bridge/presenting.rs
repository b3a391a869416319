//! Who is presented to the autopilot as a gimbal device, and what is kept apart for that (D18, rule R22).
//!
//! On links of role autopilot the gimbal device S/154 is ours. ArduPilot drives it as it would drive a gimbal of its own;
//! what it demands passes the gate of the manager. The real gimbal is not seen there, and the autopilot's words as a
//! manager are not seen anywhere else. A gimbal that is at the autopilot's end of the line is not presented: there the
//! autopilot has it already.

use std::time::Duration;

use super::Bridge;
use super::conflicts::{Conflict, Outcome};
use super::heartbeat;
use super::presented_device::{PresentedDevice, component_of};
use super::roster::{Gimbal, Place};
use super::settings::Role;
use super::snapshot::PresentedSnapshot;
use super::{LinkIndex, picture, surroundings};
use crate::channel::{ChannelId, ChannelSet};
use crate::manager::messages;
use crate::manager::request::{Command, Refusal, Request, device_set_attitude, read_request};
use crate::timestamp::Timestamp;
use crate::wire::dialect::{GIMBAL_DEVICE_SET_ATTITUDE_DATA, MavMessage};
use crate::wire::ids::{CommandResult, command, component, mav_state, mav_type, message};
use crate::wire::{Frame, MavId, Target};

/// Which gimbal is the first is not decided by which beats first: gimbals that are there beat once a second.
const OTHERS_COME_WITHIN: Duration = Duration::from_secs(3);

/// The gimbals that are presented.
#[derive(Debug, Default)]
pub struct Presented {
    /// `[autopilot] present_device`.
    is_on: bool,
    devices: Vec<PresentedDevice>,
}

impl Presented {
    pub fn new(is_on: bool) -> Self {
        Self { is_on, devices: Vec::new() }
    }

    pub fn open_channel(&mut self, now: Timestamp, channel: ChannelId) {
        for device in &mut self.devices {
            device.open_channel(now, channel);
        }
    }

    pub fn close_channel(&mut self, channel: ChannelId) {
        for device in &mut self.devices {
            device.close_channel(channel);
        }
    }
}

impl Bridge {
    /// Presents gimbals that are new: those of the configuration from the start, or 191's where there are none; others when
    /// they are found, and those that come before them by the ids of the managers had time to be.
    pub(super) fn present_new(&mut self, now: Timestamp) {
        if !self.presented.is_on {
            return;
        }
        let is_there = |gimbal: &Gimbal| gimbal.configured || gimbal.adopted.is_some();
        // 191 answers also where it has no gimbal; ArduPilot looks for one that is there under the first id.
        let are_some = self.roster.iter().any(is_there);
        let wanted = |gimbal: &&Gimbal| if are_some { is_there(gimbal) } else { gimbal.beats() };
        let mut managers: Vec<u8> = self.roster.iter().filter(wanted).map(|gimbal| gimbal.component).collect();
        managers.sort_unstable();
        let all_came =
            self.roster.iter().any(|gimbal| gimbal.configured || gimbal.has_device_for(now, OTHERS_COME_WITHIN));
        for (manager, in_row) in managers.iter().zip(component::ONBOARD_COMPUTER..) {
            if self.presented.devices.iter().any(|device| device.manager == *manager) {
                continue;
            }
            if !all_came && *manager != in_row {
                break;
            }
            let without_gimbal = self.presented.devices.iter_mut().find(|device| !managers.contains(&device.manager));
            if let Some(device) = without_gimbal {
                device.manager = *manager;
                continue;
            }
            let taken: Vec<u8> = self.presented.devices.iter().map(|device| device.component).collect();
            let Some(component) = component_of(*manager, &managers, &taken) else { continue };
            let mut device = PresentedDevice::new(*manager, component);
            for channel in self.channels.with_role(Role::Autopilot) {
                device.open_channel(now, channel);
            }
            self.presented.devices.push(device);
        }
    }

    /// Once a second.
    pub(super) fn beat_as_presented(&mut self, now: Timestamp) {
        self.present_new(now);
        self.beat_for_each_presented(now, false);
    }

    /// The last heartbeats of devices that are going away.
    pub(super) fn say_goodbye_as_presented(&mut self, now: Timestamp) {
        self.beat_for_each_presented(now, true);
    }

    fn beat_for_each_presented(&mut self, now: Timestamp, is_last: bool) {
        for at in 0..self.presented.devices.len() {
            let (channels, component) = (self.channels_presented_on(at), self.presented.devices[at].component);
            let message = self.presented_heartbeat(at, is_last);
            self.send(now, channels, component, &message);
        }
    }

    fn presented_heartbeat(&mut self, at: usize, is_last: bool) -> MavMessage {
        let bootstrap = self.identity.is_bootstrap();
        let state = match self.roster.of_manager(self.presented.devices[at].manager) {
            Some(gimbal) if !is_last => heartbeat::state(gimbal, bootstrap),
            _ => mav_state::POWEROFF,
        };
        messages::heartbeat(mav_type::GIMBAL, state)
    }

    /// 285 where it is due.
    pub(super) fn tell_as_presented(&mut self, now: Timestamp) {
        for at in 0..self.presented.devices.len() {
            let due = self.presented.devices[at].take_due(now).intersection(self.channels_presented_on(at));
            if due.is_empty() {
                continue;
            }
            if let Some(message) = self.presented_attitude_status(now, at) {
                self.send(now, due, self.presented.devices[at].component, &message);
            }
        }
    }

    pub(super) fn presented_due(&self) -> Option<Timestamp> {
        let has_gimbal = |manager: u8| {
            self.roster.iter().any(|gimbal| gimbal.component == manager && gimbal.manager.device().is_some())
        };
        let devices = self.presented.devices.iter().filter(|device| has_gimbal(device.manager));
        devices.filter_map(PresentedDevice::poll_timeout).min().filter(|_| self.identity.system().is_some())
    }

    fn presented_attitude_status(&mut self, now: Timestamp, at: usize) -> Option<MavMessage> {
        let device = &mut self.presented.devices[at];
        let heading = self.vehicle.heading(now);
        let gimbal = self.roster.of_manager(device.manager)?;
        device.attitude_status(now, &gimbal.manager, heading)
    }

    /// The channels on which a device is presented: those of autopilots, but where the real one is.
    fn channels_presented_on(&self, at: usize) -> ChannelSet {
        let device = &self.presented.devices[at];
        let Some(system) = self.identity.system() else { return ChannelSet::EMPTY };
        let namesake = self.router.routes().component_channels(MavId::new(system, device.component));
        let gimbal = self.roster.iter().find(|gimbal| gimbal.component == device.manager);
        let own = gimbal.and_then(|gimbal| gimbal.channel).map_or(ChannelSet::EMPTY, ChannelSet::from);
        let autopilots = self.channels.with_role(Role::Autopilot);
        if !own.intersection(autopilots).is_empty() {
            return ChannelSet::EMPTY;
        }
        autopilots.without(namesake)
    }

    /// The channels on which the gimbal of that manager is presented.
    pub(super) fn channels_presenting(&self, manager: u8) -> ChannelSet {
        let at = self.presented.devices.iter().position(|device| device.manager == manager);
        at.map_or(ChannelSet::EMPTY, |at| self.channels_presented_on(at))
    }

    /// Whether that is the id of a device that we present.
    pub(super) fn is_presented(&self, id: MavId) -> bool {
        Some(id.system) == self.identity.system()
            && self.presented.devices.iter().any(|device| device.component == id.component)
    }

    /// Whether the autopilot sees a device of ours.
    pub(super) fn is_presenting(&self) -> bool {
        (0..self.presented.devices.len()).any(|at| !self.channels_presented_on(at).is_empty())
    }

    /// What comes from an autopilot's link for a presented device. True if it is for nobody else; 286 is for the real one.
    pub(super) fn handle_for_presented(&mut self, now: Timestamp, place: Place, role: Role, frame: &Frame<'_>) -> bool {
        if role != Role::Autopilot || self.presented.devices.is_empty() {
            return false;
        }
        let Some(system) = self.identity.system() else { return false };
        let target = frame.target();
        let is_directed = matches!(target, Target::Component(_));
        // Of what is said to everybody a device heeds its setpoints and commands.
        let heeds = [message::GIMBAL_DEVICE_SET_ATTITUDE, message::COMMAND_LONG, message::COMMAND_INT];
        if !is_directed && !heeds.contains(&frame.message_id()) {
            return false;
        }
        let mut is_taken = false;
        for at in 0..self.presented.devices.len() {
            let id = MavId::new(system, self.presented.devices[at].component);
            if !target.includes(id) || !self.channels_presented_on(at).contains(place.channel) {
                continue;
            }
            is_taken |= match frame.message_id() {
                message::AUTOPILOT_STATE_FOR_GIMBAL_DEVICE => false,
                message::GIMBAL_DEVICE_SET_ATTITUDE => {
                    self.handle_presented_setpoint(now, at, place, id, frame);
                    true
                }
                message::COMMAND_LONG | message::COMMAND_INT => {
                    if let Some(Ok(Request::Command(asked))) = read_request(frame) {
                        self.handle_presented_command(now, at, place.channel, frame.source(), &asked);
                    }
                    is_directed
                }
                // Of parameters it has none, and an empty list has no answer.
                _ => is_directed,
            };
        }
        is_taken
    }

    fn handle_presented_setpoint(&mut self, now: Timestamp, at: usize, place: Place, id: MavId, frame: &Frame<'_>) {
        let sender = frame.source();
        if self.autopilot.is_none() && sender == MavId::new(id.system, component::AUTOPILOT1) {
            // It goes on with what it did before we were started, and will be known by its heartbeat.
            return;
        }
        if self.autopilot != Some(sender) {
            let conflict =
                Conflict::RivalMaster { rival: sender, device: id, autopilot: None, outcome: Outcome::KeptAway };
            self.conflicts.note(now, conflict);
            self.count_dropped(place.link, "firewall");
            return;
        }
        let Some(setpoint) = frame.decode::<GIMBAL_DEVICE_SET_ATTITUDE_DATA>() else { return };
        let around = surroundings(&self.vehicle, self.autopilot, &self.ranks);
        if let Some(gimbal) = self.roster.of_manager(self.presented.devices[at].manager) {
            gimbal.manager.handle_autopilot_setpoint(now, sender, device_set_attitude(&setpoint), around);
        }
    }

    fn handle_presented_command(&mut self, now: Timestamp, at: usize, from: ChannelId, sender: MavId, asked: &Command) {
        let component = self.presented.devices[at].component;
        let (result, message) = match self.obey_as_presented(now, at, from, sender, asked) {
            // It was for everybody, and is somebody else's business.
            Err(refusal) if !asked.is_directed() && refusal.result != CommandResult::TemporarilyRejected => return,
            Err(refusal) => (refusal.result, None),
            Ok(message) => (CommandResult::Accepted, message),
        };
        let ack = messages::ack(sender, asked.number, result);
        for message in [Some(ack), message].into_iter().flatten() {
            self.answer(now, from.into(), component, &message);
        }
    }

    /// Does what a gimbal device does; what is to be said after the acknowledgement.
    fn obey_as_presented(
        &mut self,
        now: Timestamp,
        at: usize,
        from: ChannelId,
        sender: MavId,
        asked: &Command,
    ) -> Result<Option<MavMessage>, Refusal> {
        let is_autopilot = self.autopilot == Some(sender);
        let manager = self.presented.devices[at].manager;
        let not_yet = Refusal::later("no_gimbal_yet");
        match (asked.number, asked.message_id(1)) {
            (command::REQUEST_MESSAGE, Some(message::GIMBAL_DEVICE_INFORMATION)) => {
                let gimbal = self.roster.of_manager(manager).ok_or(not_yet)?;
                let information = self.presented.devices[at].information(now, &gimbal.manager);
                information.map(Some).ok_or(not_yet)
            }
            (command::REQUEST_MESSAGE, Some(message::GIMBAL_DEVICE_ATTITUDE_STATUS)) => {
                self.presented_attitude_status(now, at).map(Some).ok_or(not_yet)
            }
            (command::REQUEST_MESSAGE, Some(message::HEARTBEAT)) => Ok(Some(self.presented_heartbeat(at, false))),
            (command::SET_MESSAGE_INTERVAL, Some(message::GIMBAL_DEVICE_ATTITUDE_STATUS)) => {
                let micros = asked.param(2).unwrap_or(0.0);
                let set = self.presented.devices[at].set_interval(now, from, micros);
                set.map(|()| None).map_err(|_| Refusal::denied("invalid_interval"))
            }
            (command::GET_MESSAGE_INTERVAL, Some(id)) => {
                let interval = match id {
                    message::GIMBAL_DEVICE_ATTITUDE_STATUS => self.presented.devices[at].interval(from),
                    message::HEARTBEAT => messages::Interval::Every(heartbeat::INTERVAL),
                    _ => return Err(Refusal::denied("unknown_message")),
                };
                Ok(Some(messages::message_interval(id, interval)))
            }
            (command::REQUEST_MESSAGE | command::SET_MESSAGE_INTERVAL | command::GET_MESSAGE_INTERVAL, _) => {
                Err(Refusal::denied("unknown_message"))
            }
            (command::DO_SET_ROI_LOCATION | command::DO_SET_ROI_NONE, _) if is_autopilot && asked.is_directed() => {
                let around = surroundings(&self.vehicle, self.autopilot, &self.ranks);
                let gimbal = self.roster.of_manager(manager).ok_or(not_yet)?;
                gimbal.manager.handle_autopilot_command(now, sender, asked, around).map(|()| None)
            }
            (command::DO_MOUNT_CONTROL, _) if is_autopilot && asked.is_directed() => {
                let device = MavId::new(sender.system, self.presented.devices[at].component);
                self.conflicts.note(now, Conflict::MountCommandsToPresented { device });
                Err(unsupported())
            }
            (command::PREFLIGHT_REBOOT_SHUTDOWN, _) => Err(Refusal::denied("preflight_reboot_shutdown_denied")),
            _ => Err(unsupported()),
        }
    }

    /// R22: whether a frame is what the autopilot says as the manager of the device that we present to it.
    pub(super) fn is_of_hosted_manager(&mut self, link: LinkIndex, frame: &Frame<'_>) -> bool {
        let as_manager = matches!(
            frame.message_id(),
            message::GIMBAL_MANAGER_INFORMATION
                | message::GIMBAL_MANAGER_STATUS
                | message::GIMBAL_DEVICE_INFORMATION
                | message::GIMBAL_DEVICE_ATTITUDE_STATUS
        );
        let is_hosted = as_manager && self.autopilot == Some(frame.source()) && self.is_presenting();
        if is_hosted {
            self.count_dropped(link, "autopilots_gimbal");
        }
        is_hosted
    }

    /// R22: takes the channels out of `channels` that see the presented device in the stead of the sender.
    pub(super) fn keep_apart_from_presented(&mut self, frame: &Frame<'_>, channels: ChannelSet) -> ChannelSet {
        if self.presented.devices.is_empty() {
            return channels;
        }
        let source = frame.source();
        let autopilots = channels.intersection(self.channels.with_role(Role::Autopilot));
        if autopilots.is_empty() || source.component == component::AUTOPILOT1 {
            return channels;
        }
        let Some(system) = self.identity.system() else {
            // Nothing is presented yet; but what is seen there in the meantime would be taken for it.
            let is_namesake = self.presented.devices.iter().any(|device| device.component == source.component);
            let hidden = if is_namesake { autopilots } else { ChannelSet::EMPTY };
            return self.drop_towards(channels, hidden, "presented_instead");
        };
        let is_hidden = |device: &PresentedDevice| {
            let real = self.roster.iter().find(|gimbal| gimbal.component == device.manager);
            Some(source) == real.and_then(|gimbal| gimbal.adopted) || source == MavId::new(system, device.component)
        };
        let hidden = (0..self.presented.devices.len())
            .filter(|at| is_hidden(&self.presented.devices[*at]))
            .fold(ChannelSet::EMPTY, |hidden, at| hidden.union(self.channels_presented_on(at)));
        self.drop_towards(channels, autopilots.intersection(hidden), "presented_instead")
    }

    pub(super) fn presented_snapshot(&self, now: Timestamp, manager: u8) -> Option<PresentedSnapshot> {
        let at = self.presented.devices.iter().position(|device| device.manager == manager)?;
        let gimbal = self.roster.iter().find(|gimbal| gimbal.component == manager)?;
        let system = self.identity.system().filter(|_| !self.channels_presented_on(at).is_empty())?;
        let (stream, asked) = gimbal.manager.autopilot_stream(now);
        Some(PresentedSnapshot {
            device: MavId::new(system, self.presented.devices[at].component).to_string(),
            stream: stream.to_owned(),
            asked_age_ms: asked.map(|at| picture::millis(now.since(at))),
        })
    }
}

fn unsupported() -> Refusal {
    Refusal { result: CommandResult::Unsupported, reason: "unsupported_command" }
}
