//! What of others is kept from a gimbal that we manage, and from those who look at it.
//!
//! The one place where we do not deliver what the routing rules would: a gimbal has one master and one manager, and
//! clients see each gimbal once. Managers of other gimbals, an autopilot's own among them, pass: what they say may be
//! about a gimbal that only they have.

use super::Bridge;
use super::conflicts::{Conflict, Outcome};
use super::delivery::command_number;
use super::delivery::is_for_mounts;
use super::devices::is_of_device;
use super::roster::{Gimbal, Place};
use super::settings::Role;
use crate::channel::ChannelSet;
use crate::gimbals::settings::Family;
use crate::manager::settings::Firewall;
use crate::timestamp::Timestamp;
use crate::wire::dialect::{
    GIMBAL_DEVICE_ATTITUDE_STATUS_DATA, GIMBAL_MANAGER_INFORMATION_DATA, GIMBAL_MANAGER_STATUS_DATA,
};
use crate::wire::ids::{command, message};
use crate::wire::{Frame, Target};

impl Bridge {
    /// Keeps from managed devices what others send straight to them, and on its link what a device sends as a manager.
    pub(super) fn firewall(
        &mut self,
        now: Timestamp,
        place: Place,
        role: Role,
        frame: &Frame<'_>,
        channels: ChannelSet,
    ) -> ChannelSet {
        let source = frame.source();
        match frame.message_id() {
            message::GIMBAL_MANAGER_INFORMATION | message::GIMBAL_MANAGER_STATUS => {
                // R16: clients would see a second manager of the same gimbal. On a gimbal's own link also before the device
                // there is known to us, but for one that speaks of a gimbal without MAVLink behind it.
                let is_of_another = matches!(device_id_of_manager(frame), Some(1..=6));
                if self.roster.is_device(source) || role == Role::Gimbal && !is_of_another {
                    self.conflicts.note(now, Conflict::DeviceActsAsManager { device: source });
                    self.count_dropped(place.link, "device_manager_message");
                    return ChannelSet::EMPTY;
                }
                self.note_rival_manager(now, frame);
                if self.is_answer_to_our_watch(now, frame) {
                    self.count_dropped(place.link, "answer_to_us");
                    return ChannelSet::EMPTY;
                }
                channels
            }
            message::GIMBAL_DEVICE_INFORMATION | message::GIMBAL_DEVICE_ATTITUDE_STATUS => {
                self.note_rival_manager(now, frame);
                let is_twin = |id| self.roster.is_twin(id, place.channel);
                // R21: clients would take it for the gimbal that we manage.
                if self.settings.control.firewall == Firewall::On && is_of_device(frame, is_twin) {
                    self.count_dropped(place.link, "not_the_gimbal");
                    return ChannelSet::EMPTY;
                }
                channels
            }
            message::GIMBAL_DEVICE_SET_ATTITUDE => self.keep_from_devices(now, place, frame, channels),
            _ if is_for_mounts(frame) || self.is_of_a_vendor(frame) => {
                self.keep_from_devices(now, place, frame, channels)
            }
            // R15: it is for the managers, which have a gate; a gimbal that knows it as well has none.
            _ if self.settings.control.firewall == Firewall::On && is_for_every_manager(frame) => {
                let gimbals = channels.intersection(self.channels.with_role(Role::Gimbal));
                self.drop_towards(channels, gimbals, "firewall")
            }
            _ => channels,
        }
    }

    /// Whether a gimbal would take it for a command of its maker's own: motors, modes, a restart.
    fn is_of_a_vendor(&self, frame: &Frame<'_>) -> bool {
        let is_one = matches!(
            command_number(frame),
            Some(command::USER_1 | command::USER_2 | command::PREFLIGHT_REBOOT_SHUTDOWN)
        );
        let has_such = |gimbal: &Gimbal| gimbal.driver.family() == Family::Gremsy;
        let is_meant = |gimbal: &Gimbal| gimbal.manager.device().is_some_and(|device| frame.target().includes(device));
        is_one && self.roster.iter().any(|gimbal| has_such(gimbal) && is_meant(gimbal))
    }

    /// R15: on our gimbals we are the only party that says where to look.
    fn keep_from_devices(
        &mut self,
        now: Timestamp,
        place: Place,
        frame: &Frame<'_>,
        channels: ChannelSet,
    ) -> ChannelSet {
        let is_on = self.settings.control.firewall == Firewall::On;
        let rival = frame.source();
        let autopilot = self.autopilot.filter(|known| *known == rival).and(self.vehicle.autopilot());
        // The managers take for theirs what goes to no component in particular.
        let is_for_managers = is_for_mounts(frame) && !matches!(frame.target(), Target::Component(_));
        let devices = self.roster.iter().filter_map(|gimbal| Some((gimbal.manager.device()?, gimbal.channel)));
        for (device, channel) in devices.filter(|(device, _)| frame.target().includes(*device)) {
            let outcome = match is_on {
                _ if channel == Some(place.channel) => Outcome::BesideUs,
                true => Outcome::KeptAway,
                false => Outcome::Delivered,
            };
            if !is_for_managers || outcome != Outcome::KeptAway {
                self.conflicts.note(now, Conflict::RivalMaster { rival, device, autopilot, outcome });
            }
        }
        if !is_on {
            return channels;
        }
        // On a gimbal's own link also before the device there is known to us.
        let guarded = self.channels_of_devices(frame.target()).union(self.channels.with_role(Role::Gimbal));
        let guarded = channels.intersection(guarded);
        self.drop_towards(channels, guarded, "firewall")
    }

    /// Somebody of our vehicle speaks as the manager of a gimbal of ours, or as that of one that may be ours under
    /// another id: autopilots number the gimbals they drive.
    fn note_rival_manager(&mut self, now: Timestamp, frame: &Frame<'_>) {
        let rival = frame.source();
        if Some(rival.system) != self.identity.system() || self.is_own_id(rival) {
            return;
        }
        let is_autopilot = self.autopilot == Some(rival);
        let device_id = match frame.message_id() {
            // The attitude of a mount that the autopilot drives, or relays from the gimbal.
            message::GIMBAL_DEVICE_ATTITUDE_STATUS if is_autopilot => frame
                .decode::<GIMBAL_DEVICE_ATTITUDE_STATUS_DATA>()
                .map(|message| message.gimbal_device_id)
                .filter(|device_id| (1..=6).contains(device_id)),
            _ => device_id_of_manager(frame),
        };
        let Some(device_id) = device_id else { return };
        let same_device = self.roster.iter().any(|gimbal| gimbal.manager.device_id() == Some(device_id));
        if is_autopilot || same_device {
            let autopilot = self.autopilot.filter(|_| is_autopilot).and(self.vehicle.autopilot());
            self.conflicts.note(now, Conflict::RivalManager { rival, device_id, autopilot });
        }
    }
}

/// Whether it says to everybody where to look, or who says that.
fn is_for_every_manager(frame: &Frame<'_>) -> bool {
    let is_demand = matches!(
        command_number(frame),
        Some(
            command::DO_SET_ROI_LOCATION
                | command::DO_SET_ROI_WPNEXT_OFFSET
                | command::DO_SET_ROI_NONE
                | command::DO_SET_ROI_SYSID
                | command::DO_SET_ROI
                | command::DO_GIMBAL_MANAGER_PITCHYAW
                | command::DO_GIMBAL_MANAGER_CONFIGURE
        )
    );
    is_demand && !matches!(frame.target(), Target::Component(_))
}

/// Of which gimbal a manager speaks in 280 or 281.
fn device_id_of_manager(frame: &Frame<'_>) -> Option<u8> {
    match frame.message_id() {
        message::GIMBAL_MANAGER_INFORMATION => {
            frame.decode::<GIMBAL_MANAGER_INFORMATION_DATA>().map(|message| message.gimbal_device_id)
        }
        message::GIMBAL_MANAGER_STATUS => {
            frame.decode::<GIMBAL_MANAGER_STATUS_DATA>().map(|message| message.gimbal_device_id)
        }
        _ => None,
    }
}
