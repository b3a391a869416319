//! What becomes of a received frame: noted, acted on, forwarded.

use std::time::Duration;

use super::conflicts::Conflict;
use super::roster::{Gimbal, Place};
use super::settings::Role;
use super::{Bridge, KnownVehicle, LinkIndex, surroundings};
use crate::channel::{ChannelId, ChannelSet};
use crate::manager::request::read_request;
use crate::manager::{Sender, Surroundings};
use crate::timestamp::Timestamp;
use crate::wire::dialect::{HEARTBEAT_DATA, REQUEST_DATA_STREAM_DATA, SYSTEM_TIME_DATA};
use crate::wire::ids::{command, component, mav_autopilot, mav_type, message};
use crate::wire::{Frame, MavId, Target};

/// A vehicle whose autopilot was not heard for so long is not there any more.
const VEHICLE_GONE: Duration = Duration::from_secs(10);

/// An autopilot silent on its own link for so long is believed on others.
const AUTOPILOT_GONE: Duration = Duration::from_secs(5);

impl Bridge {
    /// One checked frame from `from`.
    pub(super) fn handle_frame(&mut self, now: Timestamp, from: ChannelId, frame: &Frame<'_>) {
        let source = frame.source();
        let Some((link, role)) = self.channels.link_of(from).map(|(link, state)| (link, state.settings.role)) else {
            return;
        };
        let ours = self.is_own_id(source);
        // R13: what we sent ourselves and came back is dropped; what another sends under our name is forwarded.
        // A gimbal may say the same as the device that we present under its id, and is where none of our frames come back from.
        let is_at_home = role == Role::Gimbal || self.roster.channel_of(source) == Some(from);
        let may_come_back = ours || self.is_presented(source) && !is_at_home;
        if may_come_back && self.channels.was_sent(frame.bytes()) {
            self.count_dropped(link, "loop");
            return;
        }
        if ours {
            self.conflicts.note(now, Conflict::OwnIdInUse { id: source });
        } else if frame.is_known() {
            // R8, and R6: a message that is not known could not be checked, so nothing is learned from it.
            self.router.learn(now, from, source);
        }
        match frame.message_id() {
            message::HEARTBEAT => self.handle_heartbeat(now, Place { link, channel: from }, role, frame),
            message::SYSTEM_TIME => {
                if let Some(time) = frame.decode::<SYSTEM_TIME_DATA>() {
                    self.router.note_boot_time(now, from, source, time.time_boot_ms);
                }
            }
            message::COMMAND_ACK if !ours => self.handle_command_ack(now, frame),
            message::REQUEST_DATA_STREAM if role == Role::Gimbal => {
                // It goes on to the autopilot besides, as it came.
                if let Some(request) = frame.decode::<REQUEST_DATA_STREAM_DATA>()
                    && self.autopilot.is_none_or(|autopilot| frame.target().includes(autopilot))
                {
                    self.gimbal_streams.handle_request(now, from, &request);
                    self.look_after_streams(now);
                }
            }
            // Another component of the vehicle may tell gimbals in the autopilot's stead.
            message::AUTOPILOT_STATE_FOR_GIMBAL_DEVICE
                if !ours
                    && role != Role::Ground
                    && self.autopilot != Some(source)
                    && Some(source.system) == self.identity.system() =>
            {
                self.state_for_gimbals.handle_told_by_others(now);
            }
            _ => {}
        }
        // Under our own ids stands who asks over HTTP, whom nobody else keeps in control; nor does another the autopilot.
        if !ours && !self.is_namesake(now, role, source) {
            for gimbal in self.roster.iter_mut() {
                gimbal.manager.handle_heard(now, source);
            }
        }
        if self.autopilot == Some(source) {
            self.handle_autopilot(now, link, role, frame);
        }
        if !ours {
            self.handle_device(now, Place { link, channel: from }, role, frame);
        }
        self.handle_for_us(now, from, role, frame);
        if self.handle_for_presented(now, Place { link, channel: from }, role, frame)
            || self.is_of_hosted_manager(link, frame)
        {
            return;
        }
        self.forward(now, Place { link, channel: from }, role, frame);
    }

    /// What our autopilot says, where it is to be believed.
    fn handle_autopilot(&mut self, now: Timestamp, link: LinkIndex, role: Role, frame: &Frame<'_>) {
        if role != Role::Ground {
            self.autopilot_heard = Some(now);
        } else if !self.is_believed_autopilot(now, role, frame.source()) {
            // Another vehicle of the same id, whose attitude would turn our camera.
            if frame.message_id() == message::HEARTBEAT {
                self.conflicts.note(now, Conflict::AutopilotTwice { autopilot: frame.source(), other_on: link });
            }
            return;
        }
        self.take_vehicle_frame(now, frame);
        self.show_vehicle(now, frame.message_id());
    }

    /// Whether `source` has the id of our autopilot, and is another vehicle's.
    pub(super) fn is_namesake(&self, now: Timestamp, role: Role, source: MavId) -> bool {
        self.autopilot == Some(source) && !self.is_believed_autopilot(now, role, source)
    }

    /// Whether `source` is our autopilot, and not another vehicle's of the same id.
    fn is_believed_autopilot(&self, now: Timestamp, role: Role, source: MavId) -> bool {
        let speaks_elsewhere = self.autopilot_heard.is_some_and(|at| now.since(at) < AUTOPILOT_GONE);
        self.autopilot == Some(source) && (role != Role::Ground || !speaks_elsewhere)
    }

    /// The managers are shown what one message of the autopilot changed.
    fn show_vehicle(&mut self, now: Timestamp, message_id: u32) {
        let around = surroundings(&self.vehicle, self.autopilot, &self.ranks);
        for gimbal in self.roster.iter_mut() {
            match message_id {
                message::ATTITUDE | message::ATTITUDE_QUATERNION | message::AUTOPILOT_STATE_FOR_GIMBAL_DEVICE => {
                    gimbal.manager.handle_turned(now, around);
                }
                message::GLOBAL_POSITION_INT => gimbal.manager.handle_vehicle(now, around),
                _ => {}
            }
        }
    }

    fn handle_heartbeat(&mut self, now: Timestamp, place: Place, role: Role, frame: &Frame<'_>) {
        let source = frame.source();
        let Some(heartbeat) = frame.decode::<HEARTBEAT_DATA>() else { return };
        self.ranks.handle_heartbeat(source, heartbeat.mavtype);
        if heartbeat.mavtype == mav_type::GCS {
            self.note_station(now, place, frame);
        }
        // "HEARTBEAT.autopilot other than INVALID" is an autopilot; but old gimbals send GENERIC there.
        let is_autopilot =
            heartbeat.autopilot != mav_autopilot::INVALID && !mav_type::NOT_A_VEHICLE.contains(&heartbeat.mavtype);
        if !is_autopilot || source.system == 0 {
            return;
        }
        let was_known = self.vehicles[usize::from(source.system)].is_some();
        let known = &mut self.vehicles[usize::from(source.system)];
        let is_first = source.component == component::AUTOPILOT1;
        *known = Some(KnownVehicle {
            component: known.filter(|_| !is_first).map_or(source.component, |known| known.component),
            heard: now,
            is_on_ground_only: role == Role::Ground && known.is_none_or(|known| known.is_on_ground_only),
        });
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
        if !self.is_believed(role, system) {
            return;
        }
        let better = is_first && self.autopilot != Some(source);
        if self.autopilot.is_none() || better {
            self.take_autopilot(now, source);
        } else if !self.vehicle.alive(now) {
            self.streams.handle_autopilot_found(now);
        }
    }

    fn note_station(&mut self, now: Timestamp, place: Place, frame: &Frame<'_>) {
        let station = frame.source();
        let other = self.stations.handle_heartbeat(now, station, place.channel, frame.sequence());
        let Some(other) = other else { return };
        if let Some((other_link, _)) = self.channels.link_of(other) {
            self.conflicts.note(now, Conflict::StationTwice { station, links: [place.link, other_link] });
        }
    }

    /// Requests addressed to our managers.
    fn handle_for_us(&mut self, now: Timestamp, from: ChannelId, role: Role, frame: &Frame<'_>) {
        let Some(system) = self.identity.system() else { return };
        if !matches!(
            frame.message_id(),
            message::COMMAND_LONG
                | message::COMMAND_INT
                | message::GIMBAL_MANAGER_SET_ATTITUDE
                | message::GIMBAL_MANAGER_SET_PITCHYAW
                | message::GIMBAL_MANAGER_SET_MANUAL_CONTROL
                | message::MOUNT_CONFIGURE
                | message::MOUNT_CONTROL
        ) {
            return;
        }
        let target = frame.target();
        let overheard = self.is_overheard(now, from, frame);
        let for_us = |component: u8| overheard || target.includes(MavId::new(system, component));
        if !self.roster.iter().any(|gimbal| for_us(gimbal.component)) || self.is_own_id(frame.source()) {
            return;
        }
        // A gimbal that speaks to mounts speaks to others of its kind.
        if is_for_mounts(frame) && self.roster.is_device(frame.source()) {
            return;
        }
        let Some(request) = read_request(frame) else { return };
        let sender = Sender { id: frame.source(), channel: from };
        let other_vehicle = self.is_other_vehicle(now, role, sender.id);
        let around = surroundings(&self.vehicle, self.autopilot, &self.ranks);
        let around = Surroundings { overheard, other_vehicle, ..around };
        // Who has no gimbal yet says so to who asks it, and to everybody only while nobody here has one.
        let exactly_one = matches!(target, Target::Component(_)) && !overheard;
        let some_have = self.roster.iter().any(|gimbal| gimbal.manager.device().is_some());
        let has_a_say = |gimbal: &Gimbal| exactly_one || !some_have || gimbal.manager.device().is_some();
        for gimbal in self.roster.iter_mut().filter(|gimbal| for_us(gimbal.component) && has_a_say(gimbal)) {
            match &request {
                Ok(request) => gimbal.manager.handle_request(now, sender, request, around),
                Err(refusal) => gimbal.manager.count_refusal(sender.id, refusal.reason),
            }
        }
    }

    /// Whether we are to act on a command to the autopilot that passes through us (`snoop_autopilot`). One that we do not
    /// forward to it is none of our business, as is all that is said where it is itself.
    fn is_overheard(&mut self, now: Timestamp, from: ChannelId, frame: &Frame<'_>) -> bool {
        const WORTH_HEARING: [u16; 5] = [
            command::DO_SET_ROI_LOCATION,
            command::DO_SET_ROI_NONE,
            command::DO_SET_ROI,
            command::DO_GIMBAL_MANAGER_PITCHYAW,
            command::DO_GIMBAL_MANAGER_CONFIGURE,
        ];
        let Target::Component(target) = frame.target() else { return false };
        self.settings.control.snoop_autopilot
            && self.autopilot == Some(target)
            // It is obeyed by the autopilot, whose demand then comes to the device that we present to it.
            && !self.is_presenting()
            && (is_for_mounts(frame) || command_number(frame).is_some_and(|number| WORTH_HEARING.contains(&number)))
            && !self.router.route(now, from, frame.source(), frame.target()).channels.is_empty()
    }

    fn forward(&mut self, now: Timestamp, Place { link, channel: from }: Place, role: Role, frame: &Frame<'_>) {
        let verdict = self.router.route(now, from, frame.source(), frame.target());
        let mut channels = verdict.channels;
        // R14: the state of our vehicle is for every gimbal, also for one that was not heard yet.
        if self.is_state_for_gimbals(frame) {
            let known = self.router.routes().component_channels(frame.source());
            channels = channels.union(self.channels.with_role(Role::Gimbal).without(from.into()).without(known));
        }
        channels = self.keep_apart_from_presented(frame, channels);
        channels = self.firewall(now, Place { link, channel: from }, role, frame, channels);
        if matches!(frame.message_id(), message::RADIO_STATUS | message::RADIO) {
            // R17: an autopilot would throttle the wrong channel by it.
            let autopilots = channels.intersection(self.channels.with_role(Role::Autopilot));
            channels = self.drop_towards(channels, autopilots, "not_for_autopilot");
        }
        let gimbals = channels.intersection(self.channels.with_role(Role::Gimbal));
        if !gimbals.is_empty() {
            let barred = gimbals.without(self.passing_to_gimbals(now, role, frame, gimbals));
            channels = self.drop_towards(channels, barred, "not_for_gimbal");
        }
        channels = self.channels.limit_rate(now, channels, frame);
        self.channels.transmit(now, channels, frame, &mut self.outbox);
    }

    /// Takes `dropped` out of `channels` and counts it there.
    pub(super) fn drop_towards(
        &mut self,
        channels: ChannelSet,
        dropped: ChannelSet,
        reason: &'static str,
    ) -> ChannelSet {
        for channel in dropped {
            self.count_dropped_towards(channel, reason);
        }
        channels.without(dropped)
    }

    /// Whether an autopilot of that system was heard lately.
    pub(super) fn is_vehicle(&self, now: Timestamp, system: u8) -> bool {
        self.vehicles[usize::from(system)].is_some_and(|known| now.since(known.heard) < VEHICLE_GONE)
    }

    /// D5: whether `id`, on a link of that role, is in a system that has an autopilot and is not ours, or is one that has
    /// our autopilot's id.
    ///
    /// Once its autopilot was heard it has one for good, however rarely we hear it; and who has an autopilot's component id
    /// is one, with or without a heartbeat. Only who calls itself a ground station is believed when no autopilot is heard.
    fn is_other_vehicle(&self, now: Timestamp, role: Role, id: MavId) -> bool {
        let was_one = id.component == component::AUTOPILOT1 || self.vehicles[usize::from(id.system)].is_some();
        let is_in_ours = Some(id.system) == self.identity.system() && self.is_believed(role, id.system);
        let is_in_other =
            !is_in_ours && (self.is_vehicle(now, id.system) || was_one && !self.ranks.is_ground_station(id));
        is_in_other || self.is_namesake(now, role, id)
    }

    fn is_state_for_gimbals(&self, frame: &Frame<'_>) -> bool {
        frame.message_id() == message::AUTOPILOT_STATE_FOR_GIMBAL_DEVICE
            && self.autopilot == Some(frame.source())
            && match frame.target() {
                Target::Component(target) => self.is_presented(target),
                Target::System(_) | Target::Everyone => true,
            }
    }

    /// R18: which of `gimbals`, all of that role, get the frame: what is addressed to a component known there, and
    /// the little that a gimbal uses of what is said to all.
    fn passing_to_gimbals(&mut self, now: Timestamp, role: Role, frame: &Frame<'_>, gimbals: ChannelSet) -> ChannelSet {
        // Until our system id is settled nothing passes: a gimbal takes the id of the first heartbeat it hears.
        if self.identity.system().is_none() {
            return ChannelSet::EMPTY;
        }
        // What an autopilot of the id of ours says to its own gimbal, which may have the id of ours too, is not for ours.
        if self.is_namesake(now, role, frame.source()) {
            return ChannelSet::EMPTY;
        }
        if let Target::Component(target) = frame.target() {
            return gimbals.intersection(self.router.routes().component_channels(target));
        }
        // A gimbal that has just been switched on would take another vehicle's system id for its own, the state of
        // another vehicle would turn our camera, and its commands are not for us.
        if self.is_other_vehicle(now, role, frame.source()) {
            return ChannelSet::EMPTY;
        }
        match frame.message_id() {
            // The first heartbeat that a gimbal hears when it starts again is not to be a ground station's.
            message::HEARTBEAT if Some(frame.source().system) != self.identity.system() => {
                gimbals.without(self.roster.channels_of_lost())
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
            message::ATTITUDE | message::GLOBAL_POSITION_INT
                if self.is_believed_autopilot(now, role, frame.source()) =>
            {
                self.gimbal_streams.admit(now, frame.message_id(), gimbals)
            }
            // The firewall keeps it away, or is told to let it pass.
            message::GIMBAL_DEVICE_SET_ATTITUDE => gimbals.intersection(self.channels_of_devices(frame.target())),
            _ => ChannelSet::EMPTY,
        }
    }

    /// Where the managed devices are that `target` includes.
    pub(super) fn channels_of_devices(&self, target: Target) -> ChannelSet {
        let devices = self.roster.iter().filter_map(|gimbal| gimbal.manager.device());
        devices.filter(|device| target.includes(*device)).fold(ChannelSet::EMPTY, |channels, device| {
            channels.union(self.channels_of_device(device)).union(self.router.routes().component_channels(device))
        })
    }
}

/// Whether it is a command or message of gimbal protocol v1 to a mount.
pub(super) fn is_for_mounts(frame: &Frame<'_>) -> bool {
    let by_message = matches!(frame.message_id(), message::MOUNT_CONFIGURE | message::MOUNT_CONTROL);
    let commands = [command::DO_MOUNT_CONFIGURE, command::DO_MOUNT_CONTROL, command::DO_MOUNT_CONTROL_QUAT];
    by_message || command_number(frame).is_some_and(|number| commands.contains(&number))
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
