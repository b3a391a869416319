//! Which device is which gimbal's.
//!
//! A gimbal is one device at one place. Its place is taken by another only when it is lost, so two that claim the same
//! never alternate: the one that was there first stays. A device that was restarted under another id is the same one;
//! it is told from a second one by the silence under the first id.

use std::time::Duration;

use super::{Gimbal, Roster};
use crate::bridge::LinkIndex;
use crate::channel::ChannelId;
use crate::manager::DeviceState;
use crate::timestamp::Timestamp;
use crate::wire::MavId;

/// A device silent for so long is lost for good: another under its id may take its place, and its manager's component
/// id may serve another gimbal.
pub(super) const GONE_FOR_GOOD: Duration = Duration::from_secs(10);

/// A cable that is out is plugged in again by then.
const MAY_COME_BACK_WITHIN: Duration = Duration::from_secs(60);

/// Two devices under one id are remembered for so long.
const TWIN_REMEMBERED: Duration = Duration::from_secs(60);

/// So many devices wait at most until it is clear whether they are new or a known one under another id.
const MAX_WAITING: usize = 16;

/// So many components are remembered that manage a gimbal of their own.
const MAX_SELF_MANAGED: usize = 16;

/// Where a frame came in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Place {
    pub link: LinkIndex,
    pub channel: ChannelId,
}

/// What a frame under the id of a device means.
#[derive(Debug)]
pub enum Hearing<'a> {
    /// It is of the device of this gimbal; another spoke under its id on link `twin` since it was last heard.
    Device { gimbal: &'a mut Gimbal, twin: Option<LinkIndex> },
    /// Another one has the id of a device of ours.
    Elsewhere,
    /// It has the id of a device of ours, but its entry names another link.
    OffItsLink,
    /// No gimbal of ours has that device.
    Unknown,
}

/// Why a device is not managed, for the time being or at all.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NotAdopted {
    /// It is not clear yet whether it is new or one that we know under another component id, or whether one comes that has
    /// the ids that it would be given.
    Waits,
    /// No component id is left for the manager of another gimbal.
    NoManagerLeft,
}

/// A device that has another component id than before.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Renamed {
    pub former: MavId,
    pub device: MavId,
}

impl Gimbal {
    pub(super) fn is_lost(&self) -> bool {
        self.manager.state() == DeviceState::Lost
    }

    /// Whether its device is there, or was not long ago.
    pub fn may_come_back(&self, now: Timestamp) -> bool {
        self.adopted.is_some() && (!self.is_lost() || now.since(self.heard) < MAY_COME_BACK_WITHIN)
    }

    /// Whether nobody waits for its device to come back.
    pub(super) fn is_lost_for_good(&self, now: Timestamp) -> bool {
        self.is_lost() && now.since(self.heard) >= GONE_FOR_GOOD
    }

    /// Whether its device may be on that link.
    pub(in crate::bridge) fn may_be_on(&self, link: LinkIndex) -> bool {
        self.manager.settings().link.is_none_or(|wanted| wanted == link)
    }

    /// Whether nothing that a v2 device says of itself was heard, but its heartbeat.
    pub fn is_only_a_heartbeat(&self) -> bool {
        self.adopted.is_some() && !self.manager.is_known() && self.manager.status().is_none()
    }
}

impl Roster {
    /// What a frame of a managed device means that came in at `place`. Only a sign of life, which is looked for where it
    /// matters, lets it take the place of one that is lost.
    pub fn hear(
        &mut self,
        now: Timestamp,
        device: MavId,
        place: Place,
        is_sign_of_life: impl FnOnce() -> bool,
    ) -> Hearing<'_> {
        let Some(gimbal) = self.gimbals.iter_mut().find(|gimbal| gimbal.adopted == Some(device)) else {
            return Hearing::Unknown;
        };
        if gimbal.channel == Some(place.channel) {
            gimbal.heard = now;
            let twin = gimbal.elsewhere.take();
            if twin.is_some() {
                gimbal.has_twin = Some(now);
            }
            return Hearing::Device { gimbal, twin };
        }
        if !gimbal.may_be_on(place.link) {
            return Hearing::OffItsLink;
        }
        let twin_was_heard = gimbal.has_twin.is_some_and(|at| now.since(at) < TWIN_REMEMBERED);
        let is_free = if twin_was_heard { gimbal.is_lost_for_good(now) } else { gimbal.is_lost() };
        if !(is_free && is_sign_of_life()) {
            gimbal.elsewhere = Some(place.link);
            return Hearing::Elsewhere;
        }
        tracing::info!(%device, "gimbal moved");
        gimbal.channel = Some(place.channel);
        (gimbal.link, gimbal.heard) = (place.link, now);
        (gimbal.elsewhere, gimbal.has_twin) = (None, None);
        Hearing::Device { gimbal, twin: None }
    }

    /// The gimbal for a device that was heard for the first time, which is given to its driver; new ones are made as they
    /// are needed. `ours` is the system id of the vehicle.
    pub fn adopt(&mut self, now: Timestamp, device: MavId, place: Place, ours: u8) -> Result<&mut Gimbal, NotAdopted> {
        let at = match self.place_for(now, device, place, ours)? {
            Some(at) => at,
            None => self.make_place(now, device, ours)?,
        };
        self.waiting.retain(|(waiting, _)| *waiting != device);
        // It is another one, perhaps, unless it has only taken the vehicle's system id.
        let came_home = |known: MavId| known.component == device.component && device.system == ours;
        let is_another = self.gimbals[at].adopted.is_some_and(|known| !came_home(known));
        if is_another {
            self.await_if_turning(at);
        }
        let gimbal = &mut self.gimbals[at];
        let (may_be_turning, stops_as) = (gimbal.may_be_turning() && !is_another, gimbal.driver.stops_as());
        gimbal.driver.adopt(now, device);
        if may_be_turning {
            // What its driver knew of that is gone.
            gimbal.stop_when_heard(stops_as);
        }
        gimbal.adopted = Some(device);
        gimbal.channel = Some(place.channel);
        (gimbal.link, gimbal.adopted_at, gimbal.heard) = (place.link, now, now);
        (gimbal.elsewhere, gimbal.has_twin, gimbal.stopped_for) = (None, None, Vec::new());
        self.note_ids(at);
        self.stop_if_left_turning(at, device);
        Ok(&mut self.gimbals[at])
    }

    /// Whether `id` manages a gimbal of its own, which is none of ours.
    pub fn is_self_managed(&self, id: MavId) -> bool {
        self.self_managed.contains(&id)
    }

    /// `id` was taken for a gimbal because of its heartbeat, but what it says of a gimbal is about one of its own.
    pub fn note_self_managed(&mut self, now: Timestamp, id: MavId) {
        if self.is_self_managed(id) {
            return;
        }
        let Some(at) = self.gimbals.iter().position(|gimbal| gimbal.adopted == Some(id)) else { return };
        if self.gimbals[at].is_only_a_heartbeat() {
            tracing::info!(%id, "no gimbal, but the manager of one of its own");
            if self.self_managed.len() >= MAX_SELF_MANAGED {
                self.self_managed.remove(0);
            }
            self.self_managed.push(id);
            self.forget_ids(id);
            self.dismiss(now, at);
        }
    }

    /// Devices that were lost and speak under another component id now: their former place is given up, but for those
    /// with an entry that names the component, which are told of. What they were told to turn was stopped
    /// ([`stop_successors`](Self::stop_successors)).
    pub fn give_up_renamed(&mut self, now: Timestamp) -> Vec<Renamed> {
        let mut told = Vec::new();
        for at in 0..self.gimbals.len() {
            let former = &self.gimbals[at];
            let (Some(id), Some(uid)) = (former.adopted, former.manager.identity().uid) else { continue };
            let is_it = |gimbal: &&Gimbal| {
                gimbal.manager.state() == DeviceState::Alive
                    && gimbal.manager.identity().uid == Some(uid)
                    && gimbal.link == former.link
                    && gimbal.adopted_at > former.heard
            };
            let Some(device) = self.gimbals.iter().find(is_it).and_then(|gimbal| gimbal.adopted) else { continue };
            if !former.is_lost() {
                continue;
            }
            if former.configured {
                told.push(Renamed { former: id, device });
            } else {
                tracing::info!(former = %id, %device, "gimbal has another component id");
                self.dismiss(now, at);
            }
        }
        told
    }

    /// Takes a gimbal's device from it; its manager waits for the next one.
    fn dismiss(&mut self, now: Timestamp, at: usize) {
        let (open, rules) = (self.open, self.rules.clone());
        self.gimbals[at].start_over(&rules, open, now);
    }

    /// The gimbal that a device unknown so far belongs to.
    fn place_for(
        &mut self,
        now: Timestamp,
        device: MavId,
        place: Place,
        ours: u8,
    ) -> Result<Option<usize>, NotAdopted> {
        let fits = |gimbal: &Gimbal| {
            let free = gimbal.adopted.is_none_or(|known| {
                // A device that takes the vehicle's system id is the one we had.
                let came_home = gimbal.channel == Some(place.channel) && device.system == ours && known.system != ours;
                known.component == device.component && (came_home || gimbal.is_lost())
            });
            free && gimbal.may_be_on(place.link)
        };
        let is_named = |gimbal: &Gimbal| gimbal.manager.settings().component_id.is_some();
        let named = |gimbal: &Gimbal| gimbal.manager.settings().component_id == Some(device.component);
        let unnamed = |gimbal: &Gimbal| gimbal.configured && !is_named(gimbal);
        let position =
            |wanted: &dyn Fn(&Gimbal) -> bool| self.gimbals.iter().position(|gimbal| fits(gimbal) && wanted(gimbal));
        if let Some(at) = position(&named).or_else(|| position(&unnamed)) {
            return Ok(Some(at));
        }
        // It may be one that we know under another id, which is silent from now on. If that one goes on speaking, they
        // are two.
        let may_be_it = |gimbal: &Gimbal| {
            let same_line = unnamed(gimbal) && gimbal.channel == Some(place.channel);
            gimbal.adopted.is_some_and(|known| known.component == device.component || same_line)
        };
        if let Some(at) = self.gimbals.iter().position(|gimbal| may_be_it(gimbal) && gimbal.may_be_on(place.link)) {
            let since = self.waiting_since(now, device);
            let gimbal = &self.gimbals[at];
            if gimbal.is_lost() {
                return Ok(Some(at));
            }
            if gimbal.heard <= since {
                return Err(NotAdopted::Waits);
            }
        }
        let again = |gimbal: &Gimbal| {
            let is_it = |known: MavId| {
                known.component == device.component && (gimbal.is_lost() || !self.were_two(known, device))
            };
            !gimbal.configured && gimbal.adopted.is_some_and(is_it)
        };
        let waiting_manager = self.waiting_manager(device);
        let waits = |gimbal: &Gimbal| {
            !gimbal.configured && gimbal.adopted.is_none() && waiting_manager == Some(gimbal.component)
        };
        let position =
            |wanted: &dyn Fn(&Gimbal) -> bool| self.gimbals.iter().position(|gimbal| fits(gimbal) && wanted(gimbal));
        Ok(position(&again).or_else(|| position(&waits)))
    }

    /// When `device` was first heard.
    pub(super) fn waiting_since(&mut self, now: Timestamp, device: MavId) -> Timestamp {
        if let Some((_, since)) = self.waiting.iter().find(|(known, _)| *known == device) {
            return *since;
        }
        if self.waiting.len() >= MAX_WAITING {
            self.waiting.remove(0);
        }
        self.waiting.push((device, now));
        now
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bridge::settings::Settings;
    use crate::gimbals::setpoint::{Setpoint, Turning};
    use crate::gimbals::settings::{Family, GimbalSettings};

    /// One that its driver was still stopping when it took the vehicle's system id is stopped under that, whatever became of the
    /// rotation meanwhile; one that stands is left alone.
    #[test]
    fn one_that_turns_is_stopped_under_the_id_that_it_takes() {
        for turns in [true, false] {
            let gimbal = GimbalSettings { family: Family::Gremsy, ..GimbalSettings::found("camera".to_owned()) };
            let mut roster = Roster::new(&Settings { gimbals: vec![gimbal], ..Settings::default() });
            let place = Place { link: 0, channel: ChannelId::new(0).expect("below the bound") };
            let gimbal = roster.adopt(Timestamp::ZERO, MavId::new(42, 154), place, 1).expect("there is room");
            if turns {
                gimbal.driver.handle_setpoint(Timestamp::ZERO, Setpoint::Turn(Turning::STOPPED));
            }
            assert_eq!((gimbal.driver.may_be_turning(), gimbal.manager.may_be_turning()), (turns, false));

            let gimbal = roster.adopt(Timestamp::from_secs(1), MavId::new(1, 154), place, 1).expect("it is the same");

            assert_eq!((gimbal.adopted, gimbal.manager.may_be_turning()), (Some(MavId::new(1, 154)), turns));
        }
    }
}
