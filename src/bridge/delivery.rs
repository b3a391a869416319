//! What becomes of a received frame: noted, acted on, forwarded.

use std::time::Duration;

use super::conflicts::Conflict;
use super::settings::Role;
use super::{Bridge, LinkIndex, surroundings};
use crate::channel::{ChannelId, ChannelSet};
use crate::manager::request::read_request;
use crate::manager::settings::Firewall;
use crate::manager::{DeviceState, Sender, Surroundings};
use crate::timestamp::Timestamp;
use crate::wire::dialect::{
    GIMBAL_DEVICE_ATTITUDE_STATUS_DATA, GIMBAL_DEVICE_INFORMATION_DATA, GIMBAL_MANAGER_INFORMATION_DATA,
    GIMBAL_MANAGER_STATUS_DATA, HEARTBEAT_DATA, SYSTEM_TIME_DATA,
};
use crate::wire::ids::{command, component, mav_autopilot, mav_type, message};
use crate::wire::{Frame, MavId, Target};

/// A system whose autopilot was not heard for so long is not taken for a vehicle any more.
const VEHICLE_GONE: Duration = Duration::from_secs(10);

impl Bridge {
    /// One checked frame from `from`.
    pub(super) fn handle_frame(&mut self, now: Timestamp, from: ChannelId, frame: &Frame<'_>) {
        let source = frame.source();
        let Some((link, role)) = self.channels.link_of(from).map(|(link, state)| (link, state.settings.role)) else {
            return;
        };
        let ours = self.is_own_id(source);
        if ours {
            // R13: what we sent ourselves and came back is dropped; what another sends under our name is forwarded.
            if self.channels.was_sent(frame.bytes()) {
                self.count_dropped(link, "loop");
                return;
            }
            self.conflicts.note(now, Conflict::OwnIdInUse { id: source });
        } else if frame.is_known() {
            // R8, and R6: a message that is not known could not be checked, so nothing is learned from it.
            self.router.learn(now, from, source);
        }
        match frame.message_id() {
            message::HEARTBEAT => self.handle_heartbeat(now, role, frame),
            message::SYSTEM_TIME => {
                if let Some(time) = frame.decode::<SYSTEM_TIME_DATA>() {
                    self.router.note_boot_time(now, from, source, time.time_boot_ms);
                }
            }
            message::COMMAND_ACK if !ours => self.handle_command_ack(now, frame),
            _ => {}
        }
        for gimbal in self.roster.iter_mut() {
            gimbal.manager.handle_heard(now, source);
        }
        if self.autopilot == Some(source) {
            self.vehicle.handle_frame(now, frame);
            self.streams.handle_seen(now, frame.message_id());
        }
        if !ours {
            self.handle_device(now, from, link, role, frame);
        }
        self.handle_for_us(now, from, frame);
        self.forward(now, from, link, frame);
    }

    fn handle_heartbeat(&mut self, now: Timestamp, role: Role, frame: &Frame<'_>) {
        let source = frame.source();
        let Some(heartbeat) = frame.decode::<HEARTBEAT_DATA>() else { return };
        self.ranks.handle_heartbeat(now, source, heartbeat.mavtype);
        // "HEARTBEAT.autopilot other than INVALID" is an autopilot; but old gimbals send GENERIC there.
        let is_autopilot =
            heartbeat.autopilot != mav_autopilot::INVALID && !mav_type::NOT_A_VEHICLE.contains(&heartbeat.mavtype);
        if !is_autopilot || source.system == 0 {
            return;
        }
        let was_known = self.is_vehicle(now, source.system);
        let known = &mut self.vehicles[usize::from(source.system)];
        let component = known.map_or(source.component, |(component, _)| component);
        let better = source.component == component::AUTOPILOT1;
        *known = Some((if better { source.component } else { component }, now));
        if role == Role::Autopilot {
            self.identity.handle_autopilot(now, source.system);
        }
        self.settle_identity(now);
        let Some(system) = self.identity.system() else { return };
        if source.system != system {
            if role == Role::Autopilot && self.identity.is_fixed() {
                self.conflicts.note(now, Conflict::AutopilotElsewhere { autopilot: source, system });
            }
            if !was_known {
                // D5: what it had taken before it was known as another vehicle is void.
                let around = surroundings(&self.vehicle, self.autopilot, &self.ranks);
                for gimbal in self.roster.iter_mut() {
                    gimbal.manager.forget_system(now, source.system, around);
                }
            }
            return;
        }
        let better = source.component == component::AUTOPILOT1 && self.autopilot != Some(source);
        if self.autopilot.is_none() || better {
            self.take_autopilot(now, source);
        } else if !self.vehicle.alive(now) {
            self.streams.handle_autopilot_found(now);
        }
    }

    /// Frames of gimbals: to their driver, or the first sign of a new one.
    fn handle_device(&mut self, now: Timestamp, from: ChannelId, link: LinkIndex, role: Role, frame: &Frame<'_>) {
        let source = frame.source();
        if let Some(gimbal) = self.roster.of_device(source) {
            if gimbal.channel != Some(from) && gimbal.manager.state() == DeviceState::Lost {
                gimbal.channel = Some(from);
            }
            if gimbal.channel == Some(from) {
                gimbal.driver.handle_received(now, frame);
            } else if frame.message_id() == message::HEARTBEAT {
                self.conflicts.note(now, Conflict::DeviceElsewhere { device: source });
            }
            return;
        }
        let Some(system) = self.identity.system() else { return };
        let believed = role == Role::Gimbal || source.system == system;
        if !believed || self.autopilot == Some(source) || source.system == 0 || source.component == 0 {
            return;
        }
        let is_gimbal = match frame.message_id() {
            message::HEARTBEAT => {
                frame.decode::<HEARTBEAT_DATA>().is_some_and(|heartbeat| heartbeat.mavtype == mav_type::GIMBAL)
            }
            message::GIMBAL_DEVICE_INFORMATION => {
                frame.decode::<GIMBAL_DEVICE_INFORMATION_DATA>().is_some_and(|device| device.gimbal_device_id == 0)
            }
            message::GIMBAL_DEVICE_ATTITUDE_STATUS => {
                frame.decode::<GIMBAL_DEVICE_ATTITUDE_STATUS_DATA>().is_some_and(|device| device.gimbal_device_id == 0)
            }
            _ => false,
        };
        // The ids below 7 belong to gimbals without MAVLink, and 1 to autopilots.
        if !is_gimbal || source.component < 7 {
            return;
        }
        if source.system != system {
            self.conflicts.note(now, Conflict::ForeignSystem { device: source, system });
        }
        match self.roster.adopt(now, source, link, from) {
            Ok(gimbal) => gimbal.driver.handle_received(now, frame),
            Err(_) => self.conflicts.note(now, Conflict::NoManagerLeft { device: source }),
        }
    }

    /// Requests addressed to our managers.
    fn handle_for_us(&mut self, now: Timestamp, from: ChannelId, frame: &Frame<'_>) {
        let Some(system) = self.identity.system() else { return };
        if !matches!(
            frame.message_id(),
            message::COMMAND_LONG
                | message::COMMAND_INT
                | message::GIMBAL_MANAGER_SET_ATTITUDE
                | message::GIMBAL_MANAGER_SET_PITCHYAW
                | message::GIMBAL_MANAGER_SET_MANUAL_CONTROL
        ) {
            return;
        }
        let target = frame.target();
        let overheard = self.is_overheard(frame);
        let for_us = |component: u8| overheard || target.includes(MavId::new(system, component));
        if !self.roster.iter().any(|gimbal| for_us(gimbal.component)) || self.is_own_id(frame.source()) {
            return;
        }
        let Some(request) = read_request(frame) else { return };
        let sender = Sender { id: frame.source(), channel: from };
        let other_vehicle = self.is_other_vehicle(now, sender.id);
        let around = surroundings(&self.vehicle, self.autopilot, &self.ranks);
        let around = Surroundings { overheard, other_vehicle, ..around };
        for gimbal in self.roster.iter_mut().filter(|gimbal| for_us(gimbal.component)) {
            match &request {
                Ok(request) => gimbal.manager.handle_request(now, sender, request, around),
                Err(refusal) => gimbal.manager.count_refusal(sender.id, refusal.reason),
            }
        }
    }

    /// Whether we are to act on a command to the autopilot that passes through us (`snoop_autopilot`).
    fn is_overheard(&self, frame: &Frame<'_>) -> bool {
        const WORTH_HEARING: [u16; 7] = [
            command::DO_SET_ROI_LOCATION,
            command::DO_SET_ROI_NONE,
            command::DO_SET_ROI,
            command::DO_MOUNT_CONFIGURE,
            command::DO_MOUNT_CONTROL,
            command::DO_GIMBAL_MANAGER_PITCHYAW,
            command::DO_GIMBAL_MANAGER_CONFIGURE,
        ];
        let Target::Component(target) = frame.target() else { return false };
        self.settings.control.snoop_autopilot
            && self.autopilot == Some(target)
            && command_number(frame).is_some_and(|number| WORTH_HEARING.contains(&number))
    }

    fn forward(&mut self, now: Timestamp, from: ChannelId, link: LinkIndex, frame: &Frame<'_>) {
        let verdict = self.router.route(now, from, frame.source(), frame.target());
        let mut channels = verdict.channels;
        // R14: the state of our vehicle is for every gimbal, also for one that was not heard yet.
        if self.is_state_for_gimbals(frame) {
            let known = self.router.routes().component_channels(frame.source());
            channels = channels.union(self.channels.with_role(Role::Gimbal).without(from.into()).without(known));
        }
        channels = self.firewall(now, link, frame, channels);
        if matches!(frame.message_id(), message::RADIO_STATUS | message::RADIO) {
            // R17: an autopilot would throttle the wrong channel by it.
            let autopilots = channels.intersection(self.channels.with_role(Role::Autopilot));
            channels = self.drop_towards(channels, autopilots, "not_for_autopilot");
        }
        let gimbals = channels.intersection(self.channels.with_role(Role::Gimbal));
        if !gimbals.is_empty() {
            let barred = gimbals.without(self.passing_to_gimbals(now, frame, gimbals));
            channels = self.drop_towards(channels, barred, "not_for_gimbal");
        }
        channels = self.channels.limit_rate(now, channels, frame);
        self.channels.transmit(now, channels, frame, &mut self.outbox);
    }

    /// Takes `dropped` out of `channels` and counts it there.
    fn drop_towards(&mut self, channels: ChannelSet, dropped: ChannelSet, reason: &'static str) -> ChannelSet {
        for channel in dropped {
            self.count_dropped_towards(channel, reason);
        }
        channels.without(dropped)
    }

    /// Whether an autopilot of that system was heard lately.
    fn is_vehicle(&self, now: Timestamp, system: u8) -> bool {
        self.vehicles[usize::from(system)].is_some_and(|(_, heard)| now.since(heard) < VEHICLE_GONE)
    }

    /// D5: whether `id` is in a system that has an autopilot and is not ours.
    fn is_other_vehicle(&self, now: Timestamp, id: MavId) -> bool {
        Some(id.system) != self.identity.system() && self.is_vehicle(now, id.system)
    }

    fn is_state_for_gimbals(&self, frame: &Frame<'_>) -> bool {
        frame.message_id() == message::AUTOPILOT_STATE_FOR_GIMBAL_DEVICE
            && self.autopilot == Some(frame.source())
            && !matches!(frame.target(), Target::Component(_))
    }

    /// R18: which of `gimbals`, all of that role, get the frame: what is addressed to a component known there, and
    /// the little that a gimbal uses of what is said to all.
    fn passing_to_gimbals(&self, now: Timestamp, frame: &Frame<'_>, gimbals: ChannelSet) -> ChannelSet {
        // Until our system id is settled nothing passes: a gimbal takes the id of the first heartbeat it hears.
        if self.identity.system().is_none() {
            return ChannelSet::EMPTY;
        }
        if let Target::Component(target) = frame.target() {
            return gimbals.intersection(self.router.routes().component_channels(target));
        }
        match frame.message_id() {
            // The state of another vehicle would turn our camera.
            message::AUTOPILOT_STATE_FOR_GIMBAL_DEVICE if self.is_other_vehicle(now, frame.source()) => {
                ChannelSet::EMPTY
            }
            message::HEARTBEAT
            | message::SYSTEM_TIME
            | message::TIMESYNC
            | message::AUTOPILOT_STATE_FOR_GIMBAL_DEVICE
            | message::COMMAND_LONG
            | message::COMMAND_INT
            | message::COMMAND_ACK
            | message::COMMAND_CANCEL
            | message::PARAM_REQUEST_READ
            | message::PARAM_REQUEST_LIST
            | message::PARAM_SET
            | message::PARAM_EXT_REQUEST_READ
            | message::PARAM_EXT_REQUEST_LIST
            | message::PARAM_EXT_SET => gimbals,
            // The firewall keeps it away, or is told to let it pass.
            message::GIMBAL_DEVICE_SET_ATTITUDE => gimbals.intersection(self.channels_of_devices(frame.target())),
            _ => ChannelSet::EMPTY,
        }
    }

    /// Where the managed devices are that `target` includes.
    fn channels_of_devices(&self, target: Target) -> ChannelSet {
        let devices = self.roster.iter().filter_map(|gimbal| gimbal.manager.device());
        devices.filter(|device| target.includes(*device)).fold(ChannelSet::EMPTY, |channels, device| {
            channels.union(self.channels_of_device(device)).union(self.router.routes().component_channels(device))
        })
    }

    /// Keeps from managed devices what others send straight to them, and on its link what a device sends as a manager.
    fn firewall(&mut self, now: Timestamp, link: LinkIndex, frame: &Frame<'_>, mut channels: ChannelSet) -> ChannelSet {
        let source = frame.source();
        match frame.message_id() {
            message::GIMBAL_MANAGER_INFORMATION | message::GIMBAL_MANAGER_STATUS => {
                // R16: clients would see a second manager of the same gimbal.
                if self.roster.is_device(source) {
                    self.conflicts.note(now, Conflict::DeviceActsAsManager { device: source });
                    self.count_dropped(link, "device_manager_message");
                    return ChannelSet::EMPTY;
                }
                self.note_rival_manager(now, frame);
            }
            message::GIMBAL_DEVICE_SET_ATTITUDE => channels = self.keep_from_devices(now, frame, channels),
            message::COMMAND_LONG | message::COMMAND_INT if is_mount_command(frame) => {
                channels = self.keep_from_devices(now, frame, channels);
            }
            _ => {}
        }
        channels
    }

    /// R15: on our gimbals we are the only party that says where to look.
    fn keep_from_devices(&mut self, now: Timestamp, frame: &Frame<'_>, channels: ChannelSet) -> ChannelSet {
        let kept_away = self.settings.control.firewall == Firewall::On;
        let rival = frame.source();
        let autopilot = self.autopilot.filter(|known| *known == rival).and(self.vehicle.autopilot());
        let devices = self.roster.iter().filter_map(|gimbal| gimbal.manager.device());
        for device in devices.filter(|device| frame.target().includes(*device)) {
            self.conflicts.note(now, Conflict::RivalMaster { rival, device, autopilot, kept_away });
        }
        if !kept_away {
            return channels;
        }
        // On a gimbal's own link also before the device there is known to us.
        let guarded = self.channels_of_devices(frame.target()).union(self.channels.with_role(Role::Gimbal));
        let guarded = channels.intersection(guarded);
        self.drop_towards(channels, guarded, "firewall")
    }

    fn note_rival_manager(&mut self, now: Timestamp, frame: &Frame<'_>) {
        let rival = frame.source();
        if Some(rival.system) != self.identity.system() || self.is_own_id(rival) {
            return;
        }
        let device_id = match frame.message_id() {
            message::GIMBAL_MANAGER_INFORMATION => {
                frame.decode::<GIMBAL_MANAGER_INFORMATION_DATA>().map(|message| message.gimbal_device_id)
            }
            _ => frame.decode::<GIMBAL_MANAGER_STATUS_DATA>().map(|message| message.gimbal_device_id),
        };
        let is_autopilot = self.autopilot == Some(rival);
        let same_device =
            self.roster.iter().any(|gimbal| device_id.is_some() && gimbal.manager.device_id() == device_id);
        if is_autopilot || same_device {
            let autopilot = self.autopilot.filter(|_| is_autopilot).and(self.vehicle.autopilot());
            self.conflicts.note(now, Conflict::RivalManager { rival, autopilot });
        }
    }
}

/// The number of a `COMMAND_LONG` or `COMMAND_INT`; it stands at the same place in both.
pub(super) fn command_number(frame: &Frame<'_>) -> Option<u16> {
    match frame.message_id() {
        message::COMMAND_LONG | message::COMMAND_INT => {
            let byte = |at: usize| frame.payload().get(at).copied().unwrap_or(0);
            Some(u16::from_le_bytes([byte(28), byte(29)]))
        }
        _ => None,
    }
}

fn is_mount_command(frame: &Frame<'_>) -> bool {
    matches!(
        command_number(frame),
        Some(command::DO_MOUNT_CONFIGURE | command::DO_MOUNT_CONTROL | command::DO_MOUNT_CONTROL_QUAT)
    )
}
