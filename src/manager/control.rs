//! Who may steer a gimbal.
//!
//! Implements `MAV_CMD_DO_GIMBAL_MANAGER_CONFIGURE`. One component holds primary control, one may hold secondary
//! control; demands from anyone else are refused. What the autopilot takes from another is borrowed: that one gets it
//! back. Keeps no timers: when control lapses is decided in [`super::GimbalManager`], which tells how long each holder
//! has been silent.

mod damping;
mod takeover;

use std::time::Duration;

use super::rank::Ranks;
use super::request::{Claim, Configure, Refusal};
use crate::gimbals::settings::Takeover;
use crate::timestamp::Timestamp;
use crate::wire::MavId;
use damping::Damping;

/// The two places, and since when their holders are silent.
#[derive(Clone, Debug, Default)]
pub struct Control {
    primary: Option<Holder>,
    secondary: Option<Holder>,
    /// Who had primary control when the autopilot took it, and gets it back; only while the autopilot has it.
    lender: Option<Holder>,
    /// The autopilot that gave control back with −2 lately, and when (`px4_release_quirk`).
    quirk_release: Option<(MavId, Timestamp)>,
    damping: Damping,
}

/// Who has one of the places.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Holder {
    pub id: MavId,
    pub since: Timestamp,
    heard: Timestamp,
}

/// The rules that the configuration chooses, and who is who.
#[derive(Clone, Copy, Debug)]
pub struct Policy<'a> {
    pub open_when_unclaimed: bool,
    pub takeover: Takeover,
    /// (−2, −2) from the autopilot, when it holds control, releases it.
    pub px4_release_quirk: bool,
    /// Our system's, which may clear what others hold, and whose take-over is a borrow.
    pub autopilot: Option<MavId>,
    pub ranks: &'a Ranks,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    Primary,
    Secondary,
}

/// What somebody who passed the gate may demand.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Voice {
    /// Anything.
    Whole,
    /// Rates on top of what the primary demands; anything, if it is `whole` because the primary is silent.
    Second { whole: bool },
}

impl Voice {
    /// Fails where more is demanded than the voice allows.
    pub fn needs_whole(self) -> Result<(), Refusal> {
        match self {
            Self::Whole | Self::Second { whole: true } => Ok(()),
            Self::Second { whole: false } => Err(Refusal::denied("primary_is_active")),
        }
    }
}

/// A place that changed hands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Change {
    pub place: Place,
    pub how: How,
    /// Who brought it about; of a place that lapsed, who had it.
    pub who: MavId,
    pub from: Option<MavId>,
    pub to: Option<MavId>,
}

/// How a place changed hands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum How {
    /// It was free.
    Taken,
    /// Another had it and did not give it.
    TakenOver,
    /// The same by our autopilot, which is to give it back.
    Borrowed,
    /// The autopilot is done with it, or gone, and who had it before has it again.
    Restored,
    /// It was given to another by its holder, or while it was free.
    Delegated,
    Released,
    /// The autopilot took it from its holder for nobody.
    Cleared,
    /// Its holder was silent for the lease.
    Lapsed,
    /// Its holder has started again, and does not know of it.
    Restarted,
    /// The holder's system is another vehicle's, or not ours any more.
    SystemGone,
}

/// A repeat of a release by −2 within this time is not a new claim: the answer to the first was lost.
const QUIRK_MEMORY: Duration = Duration::from_secs(5);

/// The secondary holder may set angles when the primary was silent for so long.
pub const PRIMARY_SILENCE: Duration = Duration::from_secs(2);

/// Reasons of refusals that lie in who holds primary control.
pub const STANDS_IN_THE_WAY: [&str; 6] = [
    "not_in_control",
    "primary_is_active",
    "holder_must_release",
    "holder_ranks_no_lower",
    "exclusively_held",
    "acquire_war",
];

impl Control {
    pub fn primary(&self) -> Option<MavId> {
        self.primary.map(|holder| holder.id)
    }

    pub fn secondary(&self) -> Option<MavId> {
        self.secondary.map(|holder| holder.id)
    }

    /// Who has that place, and since when.
    pub fn holder(&self, place: Place) -> Option<Holder> {
        match place {
            Place::Primary => self.primary,
            Place::Secondary => self.secondary,
        }
    }

    /// From whom the autopilot has borrowed primary control.
    pub fn lender(&self) -> Option<MavId> {
        self.lender.map(|holder| holder.id)
    }

    /// Whether primary control was taken over so often lately that it stays where it is for a while.
    pub fn is_truce(&self, now: Timestamp) -> bool {
        self.damping.is_truce(now)
    }

    /// Applies a CONFIGURE, both places or none; which of them changed hands.
    pub fn configure(
        &mut self,
        now: Timestamp,
        sender: MavId,
        configure: Configure,
        policy: Policy<'_>,
    ) -> Result<Vec<Change>, Refusal> {
        let mut after = self.clone();
        let primary = after.read_quirk(now, sender, configure.primary, policy);
        let of_primary = after.settle(now, Place::Primary, sender, primary, policy)?;
        if after.primary() != Some(sender) {
            self.check_free_secondary(sender, configure.secondary, policy)?;
        }
        let changes = [of_primary, after.settle(now, Place::Secondary, sender, configure.secondary, policy)?];
        *self = after;
        Ok(changes.into_iter().flatten().collect())
    }

    /// What `sender` has to say about where the gimbal looks. `primary_silent` tells that the primary has said nothing
    /// lately.
    pub fn gate(&self, sender: MavId, primary_silent: bool, policy: Policy<'_>) -> Result<Voice, Refusal> {
        match (self.primary(), self.secondary()) {
            (Some(primary), _) if primary == sender => Ok(Voice::Whole),
            (Some(_), Some(secondary)) if secondary == sender => Ok(Voice::Second { whole: primary_silent }),
            (Some(_), _) => Err(Refusal::denied("not_in_control")),
            (None, Some(secondary)) if secondary == sender => Ok(Voice::Whole),
            (None, _) if policy.open_when_unclaimed => Ok(Voice::Whole),
            (None, _) => Err(Refusal::denied("nobody_in_control")),
        }
    }

    /// Something was heard from `id`.
    pub fn handle_heard(&mut self, now: Timestamp, id: MavId) {
        for holder in [&mut self.primary, &mut self.secondary, &mut self.lender].into_iter().flatten() {
            if holder.id == id {
                holder.heard = now;
            }
        }
    }

    /// When the next lease runs out.
    pub fn poll_timeout(&self, lease: Duration) -> Option<Timestamp> {
        [self.primary, self.secondary, self.lender].into_iter().flatten().map(|holder| holder.heard + lease).min()
    }

    /// Clears the places of holders silent for `lease`.
    pub fn handle_timeout(&mut self, now: Timestamp, lease: Duration) -> Vec<Change> {
        self.clear_where(now, How::Lapsed, |holder| now.since(holder.heard) >= lease)
    }

    /// Takes every place from one that has started again and does not know of it.
    pub fn handle_restarted(&mut self, now: Timestamp, id: MavId) -> Vec<Change> {
        self.clear_where(now, How::Restarted, |holder| holder.id == id)
    }

    /// Takes every place from components of `system`.
    pub fn forget_system(&mut self, now: Timestamp, system: u8) -> Vec<Change> {
        self.clear_where(now, How::SystemGone, |holder| holder.id.system == system)
    }

    /// What the autopilot means by (−2, −2) under `px4_release_quirk`.
    fn read_quirk(&mut self, now: Timestamp, sender: MavId, claim: Claim, policy: Policy<'_>) -> Claim {
        self.quirk_release = self.quirk_release.filter(|(_, at)| now.since(*at) < QUIRK_MEMORY);
        if claim != Claim::Take || !policy.px4_release_quirk || policy.autopilot != Some(sender) {
            return claim;
        }
        if self.primary() == Some(sender) {
            self.quirk_release = Some((sender, now));
            Claim::Release
        } else if self.quirk_release.is_some_and(|(id, _)| id == sender) {
            Claim::Keep
        } else {
            claim
        }
    }

    /// Fails where `sender` may not have the secondary place that nobody has, nor give it away.
    ///
    /// From there anything is demanded while the primary is silent: who may not take primary control from its holder
    /// would steer in its stead all the same. So that place is the holder's to give.
    fn check_free_secondary(&self, sender: MavId, claim: Claim, policy: Policy<'_>) -> Result<(), Refusal> {
        let is_claimed = matches!(claim, Claim::Take | Claim::Assign(_)) && self.secondary.is_none();
        let Some(holder) = self.primary().filter(|holder| is_claimed && *holder != sender) else { return Ok(()) };
        let rank = |id| policy.ranks.of(id, policy.autopilot);
        let attempt =
            takeover::Attempt { taker: rank(sender), holder: rank(holder), borrows: false, takes_back: false };
        takeover::check(policy.takeover, attempt)
    }

    /// Does with one place what `sender` claims, if it may.
    fn settle(
        &mut self,
        now: Timestamp,
        place: Place,
        sender: MavId,
        claim: Claim,
        policy: Policy<'_>,
    ) -> Result<Option<Change>, Refusal> {
        let held = self.holder(place);
        let from = held.map(|holder| holder.id);
        let is_autopilot = policy.autopilot == Some(sender);
        let lent = (place == Place::Primary).then_some(self.lender).flatten();
        let mut to = match claim {
            Claim::Keep => return Ok(None),
            Claim::Release if from != Some(sender) => {
                if lent.is_some_and(|lender| lender.id == sender) {
                    // It does not want back what it lent.
                    self.lender = None;
                }
                return Ok(None);
            }
            Claim::Release | Claim::Clear => None,
            Claim::Take => Some(sender),
            Claim::Assign(id) => Some(id),
        };
        if to.is_some_and(|id| id.system == 0 || id.component == 0) {
            // 281 could not name it.
            return Err(Refusal::denied("id_of_nobody"));
        }
        let borrows = place == Place::Primary && is_autopilot && to == Some(sender);
        let is_of_another = from.is_some_and(|holder| holder != sender && Some(holder) != to);
        if let Some(holder) = from.filter(|_| is_of_another) {
            if to.is_none() && !is_autopilot {
                return Err(Refusal::denied("not_in_control"));
            }
            let takes_back = to == Some(sender) && lent.is_some_and(|lender| lender.id == sender);
            let rank = |id| policy.ranks.of(id, policy.autopilot);
            let attempt = takeover::Attempt { taker: rank(sender), holder: rank(holder), borrows, takes_back };
            takeover::check(policy.takeover, attempt)?;
            if place == Place::Primary && to.is_some() {
                self.damping.check(now)?;
            }
        }
        let restored = lent.filter(|_| to.is_none());
        to = to.or(restored.map(|lender| lender.id));
        if to == from {
            // Naming a holder again does not make it heard, unless it names itself.
            if to == Some(sender) {
                self.handle_heard(now, sender);
            }
            return Ok(None);
        }
        let how = match to {
            None if is_of_another => How::Cleared,
            None => How::Released,
            Some(_) if restored.is_some() => How::Restored,
            Some(_) if is_of_another && borrows => How::Borrowed,
            Some(_) if is_of_another => How::TakenOver,
            Some(id) if id == sender => How::Taken,
            Some(_) => How::Delegated,
        };
        if place == Place::Primary {
            self.lender = held.filter(|_| how == How::Borrowed);
            if matches!(how, How::TakenOver | How::Borrowed) {
                self.damping.note(now);
            }
        }
        let heard = restored.map_or(now, |lender| lender.heard);
        *self.place_mut(place) = to.map(|id| Holder { id, since: now, heard });
        Ok(Some(Change { place, how, who: sender, from, to }))
    }

    /// Takes their places from those of whom `is_gone` is true; what the autopilot had borrowed goes back.
    fn clear_where(&mut self, now: Timestamp, how: How, is_gone: impl Fn(&Holder) -> bool) -> Vec<Change> {
        let mut changes = Vec::new();
        self.lender = self.lender.filter(|lender| !is_gone(lender));
        for place in [Place::Primary, Place::Secondary] {
            let Some(Holder { id, .. }) = self.holder(place).filter(&is_gone) else { continue };
            *self.place_mut(place) = None;
            changes.push(Change { place, how, who: id, from: Some(id), to: None });
            let lender = if place == Place::Primary { self.lender.take() } else { None };
            if let Some(lender) = lender {
                self.primary = Some(Holder { since: now, ..lender });
                changes.push(Change { place, how: How::Restored, who: id, from: None, to: Some(lender.id) });
            }
        }
        changes
    }

    fn place_mut(&mut self, place: Place) -> &mut Option<Holder> {
        match place {
            Place::Primary => &mut self.primary,
            Place::Secondary => &mut self.secondary,
        }
    }
}

#[cfg(test)]
mod tests;
