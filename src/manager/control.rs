//! Who may steer a gimbal.
//!
//! Implements `MAV_CMD_DO_GIMBAL_MANAGER_CONFIGURE`. One component holds primary control, one may hold secondary
//! control; demands from anyone else are refused. Keeps no timers: when control lapses is decided in
//! [`super::GimbalManager`], which tells how long each holder has been silent.

use std::time::Duration;

use super::request::{Claim, Configure, Refusal};
use crate::gimbals::settings::Takeover;
use crate::timestamp::Timestamp;
use crate::wire::MavId;

/// The two places, and since when their holders are silent.
#[derive(Clone, Debug, Default)]
pub struct Control {
    primary: Option<Holder>,
    secondary: Option<Holder>,
    /// The autopilot that gave control back with −2 lately, and when (`px4_release_quirk`).
    quirk_release: Option<(MavId, Timestamp)>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Holder {
    id: MavId,
    heard: Timestamp,
}

/// The rules that the configuration chooses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Policy {
    pub open_when_unclaimed: bool,
    pub takeover: Takeover,
    /// (−2, −2) from this component, when it holds control, releases it.
    pub release_quirk_of: Option<MavId>,
}

/// A repeat of a release by −2 within this time is not a new claim: the answer to the first was lost.
const QUIRK_MEMORY: Duration = Duration::from_secs(5);

/// The secondary holder may set angles when the primary was silent for so long.
pub const PRIMARY_SILENCE: Duration = Duration::from_secs(2);

impl Control {
    pub fn primary(&self) -> Option<MavId> {
        self.primary.map(|holder| holder.id)
    }

    pub fn secondary(&self) -> Option<MavId> {
        self.secondary.map(|holder| holder.id)
    }

    /// Applies a CONFIGURE; `own_autopilot` may clear what others hold.
    pub fn configure(
        &mut self,
        now: Timestamp,
        sender: MavId,
        configure: Configure,
        own_autopilot: Option<MavId>,
        policy: Policy,
    ) -> Result<(), Refusal> {
        let privileged = own_autopilot == Some(sender);
        let quirk = policy.release_quirk_of == Some(sender);
        let mut claim = configure.primary;
        let mut release = self.quirk_release.filter(|(_, at)| now.since(*at) < QUIRK_MEMORY);
        if claim == Claim::Take && quirk {
            if self.primary() == Some(sender) {
                claim = Claim::Release;
                release = Some((sender, now));
            } else if release.is_some_and(|(id, _)| id == sender) {
                claim = Claim::Keep;
            }
        }
        let primary = settle(self.primary, now, sender, claim, privileged, policy.takeover)?;
        let secondary = settle(self.secondary, now, sender, configure.secondary, privileged, policy.takeover)?;
        self.primary = primary;
        self.secondary = secondary;
        self.quirk_release = release;
        Ok(())
    }

    /// Whether `sender` may make a demand on the gimbal. `primary_silent` tells that the primary has made none lately.
    pub fn gate(&self, sender: MavId, primary_silent: bool, policy: Policy) -> Result<(), Refusal> {
        match (self.primary(), self.secondary()) {
            (Some(primary), _) if primary == sender => Ok(()),
            (Some(_), Some(secondary)) if secondary == sender => {
                if primary_silent {
                    Ok(())
                } else {
                    Err(Refusal::denied("primary_is_active"))
                }
            }
            (Some(_), _) => Err(Refusal::denied("not_in_control")),
            (None, Some(secondary)) if secondary == sender => Ok(()),
            (None, _) if policy.open_when_unclaimed => Ok(()),
            (None, _) => Err(Refusal::denied("nobody_in_control")),
        }
    }

    /// Something was heard from `id`.
    pub fn handle_heard(&mut self, now: Timestamp, id: MavId) {
        for holder in [&mut self.primary, &mut self.secondary].into_iter().flatten() {
            if holder.id == id {
                holder.heard = now;
            }
        }
    }

    /// When the next lease runs out.
    pub fn poll_timeout(&self, lease: Duration) -> Option<Timestamp> {
        [self.primary, self.secondary].into_iter().flatten().map(|holder| holder.heard + lease).min()
    }

    /// Clears the places of holders silent for `lease`; true when any was.
    pub fn handle_timeout(&mut self, now: Timestamp, lease: Duration) -> bool {
        let mut changed = false;
        for place in [&mut self.primary, &mut self.secondary] {
            if place.is_some_and(|holder| now.since(holder.heard) >= lease) {
                *place = None;
                changed = true;
            }
        }
        changed
    }

    /// Takes every place from components of `system`; true when any was.
    pub fn forget_system(&mut self, system: u8) -> bool {
        let mut changed = false;
        for place in [&mut self.primary, &mut self.secondary] {
            if place.is_some_and(|holder| holder.id.system == system) {
                *place = None;
                changed = true;
            }
        }
        changed
    }
}

fn settle(
    holder: Option<Holder>,
    now: Timestamp,
    sender: MavId,
    claim: Claim,
    privileged: bool,
    takeover: Takeover,
) -> Result<Option<Holder>, Refusal> {
    let held_by_sender = holder.is_some_and(|holder| holder.id == sender);
    let give = |id: MavId| {
        let held_by_other = holder.is_some_and(|holder| holder.id != sender && holder.id != id);
        if held_by_other && takeover == Takeover::Ask {
            return Err(Refusal::denied("holder_must_release"));
        }
        // Naming a holder again does not make it heard, unless it names itself.
        let heard = holder.filter(|holder| holder.id == id && id != sender).map_or(now, |holder| holder.heard);
        Ok(Some(Holder { id, heard }))
    };
    match claim {
        Claim::Keep => Ok(holder),
        Claim::Take => give(sender),
        Claim::Assign(id) => give(id),
        Claim::Release if held_by_sender => Ok(None),
        Claim::Release => Ok(holder),
        Claim::Clear if holder.is_none() || held_by_sender || privileged => Ok(None),
        Claim::Clear => Err(Refusal::denied("not_in_control")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GCS: MavId = MavId::new(255, 190);
    const COMPANION: MavId = MavId::new(1, 192);
    const AUTOPILOT: MavId = MavId::new(1, 1);

    /// `MAV_CMD_DO_GIMBAL_MANAGER_CONFIGURE`: "0: no one in control, -1: leave unchanged, -2: set itself in control,
    /// -3: remove control if currently in control".
    #[test]
    #[rustfmt::skip]
    fn configure_decides_who_holds_primary_control() {
        for (holder,          sender,    claim,                     expected) in [
            (None,            GCS,       Claim::Assign(GCS),        Ok(Some(GCS))),
            (Some(GCS),       COMPANION, Claim::Keep,               Ok(Some(GCS))),
            (None,            COMPANION, Claim::Take,               Ok(Some(COMPANION))),
            (Some(GCS),       COMPANION, Claim::Release,            Ok(Some(GCS))),
            (Some(GCS),       GCS,       Claim::Release,            Ok(None)),
            (Some(GCS),       COMPANION, Claim::Assign(COMPANION),  Ok(Some(COMPANION))),
            (Some(GCS),       GCS,       Claim::Assign(COMPANION),  Ok(Some(COMPANION))),
            (Some(GCS),       GCS,       Claim::Clear,              Ok(None)),
            (Some(GCS),       AUTOPILOT, Claim::Clear,              Ok(None)),
            (Some(GCS),       COMPANION, Claim::Clear,              Err("not_in_control")),
        ] {
            let mut control = held_by(holder);
            let configure = Configure { primary: claim, secondary: Claim::Keep };

            let result = control.configure(Timestamp::ZERO, sender, configure, Some(AUTOPILOT), OPEN);

            let outcome = result.map(|()| control.primary()).map_err(|refusal| refusal.reason);
            assert_eq!(outcome, expected, "{sender} sent {claim:?}, held by {holder:?}");
            if outcome.is_err() {
                assert_eq!(control.primary(), holder, "a refused request changes nothing");
            }
        }
    }

    /// D24, `takeover = "ask"`: "another's CONFIGURE is DENIED … until the holder releases".
    #[test]
    fn a_holder_who_must_be_asked_keeps_control_until_it_lets_go() {
        let ask = Policy { takeover: Takeover::Ask, ..OPEN };
        let take = Configure { primary: Claim::Take, secondary: Claim::Keep };
        let mut control = held_by(Some(GCS));

        let refused = control.configure(Timestamp::ZERO, COMPANION, take, None, ask);
        assert_eq!((refused, control.primary()), (Err(Refusal::denied("holder_must_release")), Some(GCS)));

        let release = Configure { primary: Claim::Release, secondary: Claim::Keep };
        assert_eq!(control.configure(Timestamp::ZERO, GCS, release, None, ask), Ok(()));
        assert_eq!(control.configure(Timestamp::ZERO, COMPANION, take, None, ask), Ok(()));
        assert_eq!(control.primary(), Some(COMPANION));
    }

    /// Protocol checklist 63: with the quirk on, (−2, −2) from the autopilot that holds control is a release, and its
    /// repeat half a second later is not a new claim.
    #[test]
    fn the_px4_quirk_makes_minus_two_a_release_once() {
        let quirk = Policy { release_quirk_of: Some(AUTOPILOT), ..OPEN };
        let take = Configure { primary: Claim::Take, secondary: Claim::Keep };
        let mut control = held_by(Some(AUTOPILOT));
        for (millis, expected) in [(0, None), (500, None), (6_000, Some(AUTOPILOT))] {
            let result = control.configure(Timestamp::from_millis(millis), AUTOPILOT, take, Some(AUTOPILOT), quirk);
            assert_eq!((result, control.primary()), (Ok(()), expected), "at {millis} ms");
        }
    }

    #[test]
    #[rustfmt::skip]
    fn the_gate_opens_to_who_is_in_control() {
        let closed = Policy { open_when_unclaimed: false, ..OPEN };
        for (primary,    sender,    policy, expected) in [
            (None,       GCS,       OPEN,   Ok(())),
            (None,       GCS,       closed, Err(Refusal::denied("nobody_in_control"))),
            (Some(GCS),  GCS,       closed, Ok(())),
            (Some(GCS),  COMPANION, OPEN,   Err(Refusal::denied("not_in_control"))),
        ] {
            assert_eq!(held_by(primary).gate(sender, false, policy), expected);
        }
    }

    /// D6: the slot of a holder not heard for the lease is cleared.
    #[test]
    fn a_silent_holder_loses_control() {
        let lease = Duration::from_secs(10);
        let mut control = held_by(Some(GCS));
        control.handle_heard(Timestamp::from_secs(5), GCS);
        assert_eq!(control.poll_timeout(lease), Some(Timestamp::from_secs(15)));
        assert!(!control.handle_timeout(Timestamp::from_micros(14_999_999), lease));
        assert!(control.handle_timeout(Timestamp::from_secs(15), lease));
        assert_eq!(control.primary(), None);
    }

    const OPEN: Policy = Policy { open_when_unclaimed: true, takeover: Takeover::Open, release_quirk_of: None };

    fn held_by(holder: Option<MavId>) -> Control {
        let primary = holder.map(|id| Holder { id, heard: Timestamp::ZERO });
        Control { primary, ..Control::default() }
    }
}
