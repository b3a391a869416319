//! Which frames are a gimbal's, and to which of ours they belong.
//!
//! A v2 device is a component of its own: its messages have `gimbal_device_id` 0, or its own component id. Ids 1 to 6 are gimbals without MAVLink
//! behind the component that speaks, and what it says of them is not about a device of ours.

use super::Bridge;
use super::conflicts::Conflict;
use super::roster::{Hearing, NotAdopted, Place, Renamed};
use super::settings::{FALLBACK_SYSTEM_ID, Role};
use crate::gimbals::mavlink_v2::packet::WhichGimbal;
use crate::timestamp::Timestamp;
use crate::wire::dialect::{GIMBAL_DEVICE_ATTITUDE_STATUS_DATA, GIMBAL_DEVICE_INFORMATION_DATA, HEARTBEAT_DATA};
use crate::wire::ids::{mav_type, message};
use crate::wire::{Frame, MavId};

/// The ids below belong to gimbals without MAVLink, and 1 to autopilots.
const LEAST_COMPONENT: u8 = 7;

/// What a frame says about the kind of its sender.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Sign {
    /// The heartbeat of a gimbal.
    Heartbeat,
    /// A message of a v2 device about itself.
    Device,
    /// A message about a gimbal without MAVLink behind its sender.
    OwnGimbal,
    None,
}

impl Bridge {
    /// Frames of gimbals: to their driver, or the first sign of a new one.
    pub(super) fn handle_device(&mut self, now: Timestamp, place: Place, role: Role, frame: &Frame<'_>) {
        let source = frame.source();
        let Some(system) = self.identity.system() else { return };
        let is_believed = self.is_believed(role, source.system);
        let sign = || sign_of(frame);
        let hearing = if self.roster.is_device(source) {
            let is_sign_of_life = || is_believed && matches!(sign(), Sign::Heartbeat | Sign::Device);
            self.roster.hear(now, source, place, is_sign_of_life)
        } else {
            Hearing::Unknown
        };
        let is_heartbeat = frame.message_id() == message::HEARTBEAT;
        let is_elsewhere = matches!(hearing, Hearing::OffItsLink | Hearing::Elsewhere);
        match hearing {
            Hearing::Device { gimbal, twin } => {
                gimbal.manager.handle_device_heard(now, place.channel);
                if !is_answer_to_another(frame, MavId::new(system, gimbal.component)) {
                    gimbal.driver.handle_vehicle_heading(self.vehicle.heading_by_now(now));
                    gimbal.driver.handle_received(now, frame);
                }
                let may_be_self_managed = gimbal.is_only_a_heartbeat();
                if let Some(other_on) = twin {
                    let conflict = Conflict::DeviceElsewhere { device: source, managed_on: place.link, other_on };
                    self.conflicts.note(now, conflict);
                }
                if is_heartbeat && source.system != system {
                    self.conflicts.note(now, Conflict::ForeignSystem { device: source, system, is_managed: true });
                }
                if may_be_self_managed && sign() == Sign::OwnGimbal {
                    self.roster.note_self_managed(now, source);
                }
            }
            Hearing::OffItsLink if is_heartbeat => {
                self.conflicts.note(now, Conflict::DeviceOffItsLink { device: source, other_on: place.link });
            }
            Hearing::OffItsLink | Hearing::Elsewhere => {}
            Hearing::Unknown => {
                let may_be_one = source.component >= LEAST_COMPONENT && self.autopilot != Some(source);
                if source.system == 0 || !may_be_one {
                    return;
                }
                let is_gimbal = match sign() {
                    Sign::Heartbeat => !self.roster.is_self_managed(source),
                    Sign::Device => true,
                    Sign::OwnGimbal | Sign::None => false,
                };
                if is_gimbal {
                    self.handle_new_device(now, place, role, frame, system);
                }
            }
        }
        if is_elsewhere && role == Role::Gimbal {
            self.stop_elsewhere(now, place, source);
        }
    }

    /// Whoever is heard there under the id of a gimbal that may be turning may be that gimbal. Only we tell it what to do on a
    /// line of gimbals.
    fn stop_elsewhere(&mut self, now: Timestamp, place: Place, device: MavId) {
        let Some(gimbal) = self.roster.iter_mut().find(|gimbal| gimbal.adopted == Some(device)) else { return };
        let Some(turning) = gimbal.manager.handle_heard_elsewhere(now, place.channel) else { return };
        let component = gimbal.component;
        for word in gimbal.driver.words_that_stop(turning) {
            self.send(now, place.channel.into(), component, &word);
        }
    }

    /// The first sign of a gimbal that none of our managers has.
    fn handle_new_device(&mut self, now: Timestamp, place: Place, role: Role, frame: &Frame<'_>, system: u8) {
        let source = frame.source();
        if !self.is_believed(role, source.system) {
            // Where ground stations are it is another vehicle's; elsewhere only if that vehicle is there.
            if role != Role::Ground && source.system != system && !self.is_vehicle(now, source.system) {
                self.conflicts.note(now, Conflict::ForeignSystem { device: source, system, is_managed: false });
            }
            return;
        }
        if source.system != system {
            self.conflicts.note(now, Conflict::ForeignSystem { device: source, system, is_managed: true });
        }
        match self.roster.adopt(now, source, place, system) {
            Ok(gimbal) => {
                gimbal.driver.handle_received(now, frame);
                gimbal.manager.handle_sign(now);
                if source.system == system {
                    self.conflicts.end_foreign_system(source.component);
                }
                self.present_new(now);
            }
            Err(NotAdopted::Waits) => {}
            Err(NotAdopted::NoManagerLeft) => self.conflicts.note(now, Conflict::NoManagerLeft { device: source }),
        }
    }

    /// Whether two gimbals on one line have the same id.
    pub(super) fn look_for_twins(&mut self, now: Timestamp) {
        for gimbal in self.roster.iter().filter(|gimbal| gimbal.manager.seems_to_be_two(now)) {
            if let Some(device) = gimbal.manager.device() {
                self.conflicts.note(now, Conflict::DeviceTwice { device });
            }
        }
    }

    /// Whether gimbals and autopilot agree where the nose points.
    pub(super) fn compare_headings(&mut self, now: Timestamp) {
        for gimbal in self.roster.iter() {
            if let (Some(device), Some(apart)) = (gimbal.manager.device(), gimbal.manager.heading_apart(now)) {
                let degrees = apart.degrees().round() as i16;
                self.conflicts.note(now, Conflict::HeadingsApart { device, degrees });
            }
        }
    }

    /// Once a second: whether a device that was lost has another component id now.
    pub(super) fn look_for_renamed(&mut self, now: Timestamp) {
        self.roster.stop_successors(now);
        for Renamed { former, device } in self.roster.give_up_renamed(now) {
            self.conflicts.note(now, Conflict::DeviceRenamed { former, device });
        }
    }

    /// Whether what components of `system` say on a link of that role may be about our vehicle.
    ///
    /// Behind a ground link other vehicles fly. While we run on the fallback id, because no autopilot was heard on its
    /// link, one of them may have that very id.
    pub(super) fn is_believed(&self, role: Role, system: u8) -> bool {
        let is_ours = Some(system) == self.identity.system();
        let may_be_foreign = role == Role::Ground && self.identity.is_bootstrap() && self.has_autopilot_link();
        role == Role::Gimbal || is_ours && !may_be_foreign
    }

    /// Whether another vehicle has the id that we use without an autopilot.
    pub(super) fn is_fallback_taken(&self, now: Timestamp) -> bool {
        let known = self.vehicles[usize::from(FALLBACK_SYSTEM_ID)];
        let is_another = known.is_some_and(|known| known.is_on_ground_only) && self.has_autopilot_link();
        is_another && self.is_vehicle(now, FALLBACK_SYSTEM_ID)
    }

    fn has_autopilot_link(&self) -> bool {
        self.channels.links().iter().any(|link| link.settings.role == Role::Autopilot)
    }
}

fn sign_of(frame: &Frame<'_>) -> Sign {
    let device_id = match frame.message_id() {
        message::HEARTBEAT => {
            let is_gimbal = frame.decode::<HEARTBEAT_DATA>().is_some_and(|beat| beat.mavtype == mav_type::GIMBAL);
            return if is_gimbal { Sign::Heartbeat } else { Sign::None };
        }
        message::GIMBAL_DEVICE_INFORMATION => {
            frame.decode::<GIMBAL_DEVICE_INFORMATION_DATA>().map(|message| message.gimbal_device_id)
        }
        message::GIMBAL_DEVICE_ATTITUDE_STATUS => {
            frame.decode::<GIMBAL_DEVICE_ATTITUDE_STATUS_DATA>().map(|message| message.gimbal_device_id)
        }
        _ => None,
    };
    match device_id.map(|device_id| WhichGimbal::read(device_id, frame.source())) {
        Some(WhichGimbal::Sender) => Sign::Device,
        Some(WhichGimbal::BehindSender) => Sign::OwnGimbal,
        // Ids above 6 are not allowed in these messages (protocol notes 1.7): ignored.
        Some(WhichGimbal::Nobody(_)) | None => Sign::None,
    }
}

/// Whether it is what a gimbal answers to a command of somebody else than `manager`.
fn is_answer_to_another(frame: &Frame<'_>, manager: MavId) -> bool {
    frame.message_id() == message::COMMAND_ACK && !frame.target().includes(manager)
}

/// Whether a frame is what a v2 device says of itself, which clients take for the device of that id.
pub(super) fn is_of_device(frame: &Frame<'_>, is_managed: impl Fn(MavId) -> bool) -> bool {
    is_managed(frame.source()) && sign_of(frame) == Sign::Device
}
