//! Which system id is ours.
//!
//! All components of a vehicle share the vehicle's system id (MAVLink developer guide, Component ids): a companion
//! takes over the autopilot's. Only links of role `autopilot` are believed; behind a ground link other vehicles fly.

use std::time::Duration;

use super::settings::{FALLBACK_SYSTEM_ID, SystemId};
use crate::timestamp::Timestamp;

/// After the first autopilot heartbeat others get so long to be heard.
pub const WINDOW: Duration = Duration::from_secs(3);

/// Without any autopilot the fallback id is used after so long.
pub const PATIENCE: Duration = Duration::from_secs(10);

/// An autopilot not heard for so long is gone.
const AUTOPILOT_LOST: Duration = Duration::from_secs(5);

/// While a client is in control, the autopilot that gave us our id must be gone for so long before another's is taken:
/// it was restarted under another one, and nobody will see the vehicle under the former any more.
const GONE_FOR_GOOD: Duration = Duration::from_secs(30);

/// A gimbal that was told to stop for so long under an id without autopilot does not listen to it, or hears nothing.
const TOLD_IN_VAIN: Duration = Duration::from_secs(60);

/// What stands against another system id.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Ties {
    /// A client is in control, and nothing may change under it.
    pub is_held: bool,
    /// A gimbal that is there, or may come back soon, may be turning, and may hear that it is to stop under the id alone that told it to turn.
    pub is_turning: bool,
    /// Another vehicle has the fallback id.
    pub fallback_is_taken: bool,
}

/// Decides the system id from the heartbeats of autopilots.
#[derive(Debug)]
pub struct Identity {
    started: Timestamp,
    /// Nobody was heard in time, and the fallback id is another vehicle's.
    is_waiting: bool,
    fixed: bool,
    system: Option<u8>,
    /// The id is the fallback, used because nobody was heard.
    bootstrap: bool,
    /// Autopilot systems with the times of their first and latest heartbeat.
    autopilots: Vec<(u8, Timestamp, Timestamp)>,
}

impl Identity {
    /// `stored`: of an earlier run. `assumed`: to begin under where nothing is stored, until an autopilot is heard.
    pub fn new(now: Timestamp, wanted: SystemId, stored: Option<u8>, assumed: Option<u8>) -> Self {
        let [stored, assumed] = [stored, assumed].map(|id| id.filter(|system| *system != 0));
        let (fixed, system, bootstrap) = match wanted {
            SystemId::Fixed(system) => (true, Some(system), false),
            SystemId::Auto => (false, stored.or(assumed), stored.is_none() && assumed.is_some()),
        };
        Self { started: now, is_waiting: false, fixed, system, bootstrap, autopilots: Vec::new() }
    }

    /// Our system id, `None` until it is settled.
    pub fn system(&self) -> Option<u8> {
        self.system
    }

    /// Whether the configuration names the id.
    pub fn is_fixed(&self) -> bool {
        self.fixed
    }

    /// Whether we run on the fallback id.
    pub fn is_bootstrap(&self) -> bool {
        self.bootstrap
    }

    /// Whether more than one autopilot speaks, which is a conflict under `system_id = "auto"`. One that was restarted
    /// under another id is not two.
    pub fn has_several(&self, now: Timestamp) -> bool {
        let alive = || self.autopilots.iter().filter(|(_, _, latest)| now.since(*latest) < AUTOPILOT_LOST);
        alive().any(|(id, first, latest)| {
            alive()
                .any(|(other, other_first, other_latest)| id != other && latest > other_first && other_latest > first)
        })
    }

    /// The autopilot systems heard lately.
    fn alive(&self, now: Timestamp) -> impl Iterator<Item = u8> + '_ {
        self.autopilots.iter().filter(move |(_, _, latest)| now.since(*latest) < AUTOPILOT_LOST).map(|(id, ..)| *id)
    }

    /// Whether the autopilot that gave us our id does not come back.
    fn is_orphaned(&self, now: Timestamp) -> bool {
        !self.bootstrap && self.is_silent_for(now, GONE_FOR_GOOD)
    }

    /// Whether no autopilot with our id was heard for so long.
    fn is_silent_for(&self, now: Timestamp, duration: Duration) -> bool {
        let heard =
            |ours| self.autopilots.iter().find(|(id, ..)| *id == ours).map_or(self.started, |(.., latest)| *latest);
        self.system.is_some_and(|ours| now.since(heard(ours)) >= duration)
    }

    /// An autopilot of `system` beat on an autopilot link.
    pub fn handle_autopilot(&mut self, now: Timestamp, system: u8) {
        if system == 0 {
            return;
        }
        match self.autopilots.iter_mut().find(|(id, ..)| *id == system) {
            Some((_, first, latest)) => {
                if now.since(*latest) >= AUTOPILOT_LOST {
                    *first = now;
                }
                *latest = now;
            }
            None => {
                if self.autopilots.len() >= 16 {
                    self.autopilots.retain(|(_, _, latest)| now.since(*latest) < AUTOPILOT_LOST);
                }
                if self.autopilots.len() < 16 {
                    self.autopilots.push((system, now, now));
                }
            }
        }
    }

    /// When the id may settle or change.
    pub fn poll_timeout(&self) -> Option<Timestamp> {
        if self.fixed {
            return None;
        }
        let window = self.autopilots.iter().map(|(_, first, _)| *first + WINDOW);
        match self.system {
            None => window.chain((!self.is_waiting).then_some(self.started + PATIENCE)).min(),
            Some(_) => None,
        }
    }

    /// Whether there is no id yet because the fallback is another vehicle's.
    pub fn is_waiting(&self) -> bool {
        self.is_waiting && self.system.is_none()
    }

    /// Settles or changes the id if it is time; true when it did.
    pub fn update(&mut self, now: Timestamp, ties: Ties) -> bool {
        if self.fixed {
            return false;
        }
        let before = self.system;
        let alive: Vec<u8> = self.alive(now).collect();
        let only = if let [system] = alive[..] { Some(system) } else { None };
        let watched =
            self.autopilots.iter().map(|(_, first, _)| *first).min().is_some_and(|at| now.since(at) >= WINDOW);
        match self.system {
            None if watched && !alive.is_empty() => self.settle(only.unwrap_or(FALLBACK_SYSTEM_ID), false),
            None if now.since(self.started) >= PATIENCE => {
                self.is_waiting = ties.fallback_is_taken;
                if !self.is_waiting {
                    self.settle(FALLBACK_SYSTEM_ID, true);
                }
            }
            Some(ours)
                if (!ties.is_turning || self.is_silent_for(now, TOLD_IN_VAIN))
                    && (!ties.is_held || self.is_orphaned(now)) =>
            {
                // Another id only when its autopilot alone has been heard for the whole window.
                let other = self.autopilots.iter().find(|(id, first, latest)| {
                    Some(*id) == only && now.since(*first) >= WINDOW && now.since(*latest) < AUTOPILOT_LOST
                });
                match other.map(|(id, ..)| *id) {
                    Some(id) if id == ours => self.bootstrap = false,
                    Some(id) => self.settle(id, false),
                    None => {}
                }
            }
            _ => {}
        }
        self.system != before
    }

    fn settle(&mut self, system: u8, bootstrap: bool) {
        self.system = Some(system);
        self.bootstrap = bootstrap;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FREE: Ties = Ties { is_held: false, is_turning: false, fallback_is_taken: false };
    const HELD: Ties = Ties { is_held: true, ..FREE };

    /// Protocol checklist 15: "exactly one autopilot system (say 7) beats for 3 s": its id is ours.
    #[test]
    fn the_only_autopilot_gives_its_id_after_the_window() {
        let mut identity = auto();
        for second in 1..=3 {
            identity.handle_autopilot(secs(second), 7);
            assert!(!identity.update(secs(second), FREE));
        }
        identity.handle_autopilot(secs(4), 7);
        assert_eq!(identity.poll_timeout(), Some(secs(4)));
        assert!(identity.update(secs(4), FREE));
        assert_eq!((identity.system(), identity.is_bootstrap()), (Some(7), false));
    }

    /// Protocol checklist 16: "two autopilot systems beat within the 3 s window": neither is taken.
    #[test]
    fn of_two_autopilots_none_is_taken() {
        let mut identity = auto();
        identity.handle_autopilot(secs(1), 7);
        identity.handle_autopilot(secs(2), 8);
        assert!(identity.update(secs(4), FREE));
        assert_eq!(identity.system(), Some(FALLBACK_SYSTEM_ID));
    }

    /// Protocol checklist 14, and "adopt a different id later only while no client is in control".
    #[test]
    fn the_fallback_gives_way_to_a_late_autopilot_unless_somebody_steers() {
        let mut identity = auto();
        assert!(!identity.update(Timestamp::from_millis(9_999), FREE));
        assert!(identity.update(secs(10), FREE));
        assert_eq!((identity.system(), identity.is_bootstrap()), (Some(1), true));
        for second in 20..=23 {
            identity.handle_autopilot(secs(second), 7);
        }
        assert!(!identity.update(secs(23), HELD));
        assert!(identity.update(secs(23), FREE));
        assert_eq!((identity.system(), identity.is_bootstrap()), (Some(7), false));
    }

    /// Protocol notes 4.4: "An autopilot that changes its id (reboot with a new parameter) → re-latch", also under a client
    /// that is in control, who would hold the gimbal of a vehicle that is not there any more.
    #[test]
    fn an_autopilot_that_is_gone_for_good_does_not_bind_whoever_is_in_control() {
        let mut identity = auto();
        for second in 0..=5 {
            identity.handle_autopilot(secs(second), 7);
            identity.update(secs(second), FREE);
        }
        for second in 6..=34 {
            identity.handle_autopilot(secs(second), 8);
            assert!(!identity.update(secs(second), HELD), "after {second} s");
            assert!(!identity.has_several(secs(second)), "it is one that was restarted");
        }
        identity.handle_autopilot(secs(35), 8);
        assert!(!identity.update(secs(35), Ties { is_turning: true, ..HELD }));
        assert!(identity.update(secs(35), HELD));
        assert_eq!(identity.system(), Some(8));
    }

    /// "Our system id stays while one may be turning, which may listen to that id alone", for as long as that can help: nobody
    /// sees the managers of a vehicle that has another id.
    #[test]
    fn a_gimbal_that_does_not_hear_that_it_is_to_stop_binds_for_a_minute() {
        let mut identity = auto();
        for second in 0..=5 {
            identity.handle_autopilot(secs(second), 7);
            identity.update(secs(second), FREE);
        }
        let turning = Ties { is_turning: true, ..FREE };
        for second in 6..=64 {
            identity.handle_autopilot(secs(second), 8);
            assert!(!identity.update(secs(second), turning), "after {second} s");
        }
        identity.handle_autopilot(secs(65), 8);
        assert!(identity.update(secs(65), turning));
        assert_eq!(identity.system(), Some(8));
    }

    /// What an earlier run's gimbal listens to is begun under, and proves nothing.
    #[test]
    fn an_assumed_id_is_used_at_once_and_gives_way_to_an_autopilot() {
        let mut identity = Identity::new(Timestamp::ZERO, SystemId::Auto, None, Some(7));
        assert_eq!((identity.system(), identity.is_bootstrap()), (Some(7), true));
        for second in 1..=4 {
            identity.handle_autopilot(secs(second), 8);
            assert!(!identity.update(secs(second), Ties { is_turning: true, ..FREE }));
        }
        assert!(identity.update(secs(4), FREE));
        assert_eq!((identity.system(), identity.is_bootstrap()), (Some(8), false));
        let stored = Identity::new(Timestamp::ZERO, SystemId::Auto, Some(9), Some(7));
        assert_eq!((stored.system(), stored.is_bootstrap()), (Some(9), false));
    }

    /// An id that is another vehicle's would make us a part of it.
    #[test]
    fn the_fallback_is_not_taken_from_another_vehicle() {
        let mut identity = auto();
        let taken = Ties { fallback_is_taken: true, ..FREE };
        assert!(!identity.update(secs(10), taken));
        assert_eq!((identity.system(), identity.is_waiting(), identity.poll_timeout()), (None, true, None));
        // It has gone.
        assert!(identity.update(secs(30), FREE));
        assert_eq!((identity.system(), identity.is_waiting()), (Some(FALLBACK_SYSTEM_ID), false));
    }

    /// D19: a stored id is used at once; the window only confirms it.
    #[test]
    fn a_stored_id_is_used_at_once() {
        let mut identity = Identity::new(Timestamp::ZERO, SystemId::Auto, Some(7), None);
        assert_eq!(identity.system(), Some(7));
        identity.handle_autopilot(secs(1), 7);
        assert!(!identity.update(secs(4), FREE));
        assert_eq!(identity.system(), Some(7));
    }

    #[test]
    fn a_fixed_id_never_changes() {
        let mut identity = Identity::new(Timestamp::ZERO, SystemId::Fixed(42), Some(7), None);
        identity.handle_autopilot(secs(1), 7);
        assert!(!identity.update(secs(20), FREE));
        assert_eq!((identity.system(), identity.poll_timeout()), (Some(42), None));
    }

    fn auto() -> Identity {
        Identity::new(Timestamp::ZERO, SystemId::Auto, None, None)
    }

    fn secs(secs: u64) -> Timestamp {
        Timestamp::from_secs(secs)
    }
}
