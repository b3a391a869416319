//! How the manager applies the rules of [`control`](super::control): the gate, changes of control and what follows from
//! them, and the counting of who was refused.

use super::control::{self, Change, PRIMARY_SILENCE, Place, Policy, Voice};
use super::events::Event;
use super::request::{Command, Configure, Refusal};
use super::{GimbalManager, Surroundings};
use crate::timestamp::Timestamp;
use crate::wire::MavId;

/// So many senders are told apart in the counters of refusals.
const MAX_COUNTED_SENDERS: usize = 64;

impl GimbalManager {
    /// A message meant for this manager was malformed.
    pub fn count_refusal(&mut self, sender: MavId, reason: &'static str) {
        let holder = self.control.primary().filter(|_| control::STANDS_IN_THE_WAY.contains(&reason));
        self.tell(Event::Refused { who: sender, reason, holder });
        if self.rejected.len() >= MAX_COUNTED_SENDERS && !self.rejected.contains_key(&sender) {
            return;
        }
        *self.rejected.entry(sender).or_default().entry(reason).or_default() += 1;
    }

    /// The autopilot's system id has changed: places held under the old one are void.
    pub fn forget_system(&mut self, now: Timestamp, system: u8, around: Surroundings<'_>) {
        let changes = self.control.forget_system(now, system);
        self.after_changes_of_control(now, &changes);
        if self.tracking.source().is_some_and(|source| source.system == system) {
            self.tracking.stop_rates(now);
        }
        self.carry_out(now, around);
    }

    /// The autopilot has started again, and knows nothing of what it asked for: what it had goes back, and its rates end.
    pub fn handle_autopilot_restarted(&mut self, now: Timestamp, autopilot: MavId, around: Surroundings<'_>) {
        let changes = self.control.handle_restarted(now, autopilot);
        self.after_changes_of_control(now, &changes);
        if self.tracking.source() == Some(autopilot) {
            self.tracking.stop_rates(now);
        }
        self.autopilot_client.handle_restarted();
        self.carry_out(now, around);
    }

    pub(super) fn policy<'a>(&self, around: Surroundings<'a>) -> Policy<'a> {
        Policy {
            open_when_unclaimed: self.rules.open_when_unclaimed,
            takeover: self.settings.takeover,
            px4_release_quirk: self.rules.px4_release_quirk,
            autopilot: around.autopilot,
            ranks: around.ranks,
        }
    }

    pub(super) fn gate(&self, now: Timestamp, sender: MavId, around: Surroundings<'_>) -> Result<Voice, Refusal> {
        if around.other_vehicle {
            return Err(Refusal::denied("other_vehicle"));
        }
        let silent = self.primary_demand.is_none_or(|at| now.since(at) > PRIMARY_SILENCE);
        self.control.gate(sender, silent, self.policy(around))
    }

    /// A demand of `sender` was obeyed.
    pub(super) fn note_demand(&mut self, now: Timestamp, sender: MavId) {
        self.source_heard = now;
        self.pauses.clear();
        self.note_obeyed(now, sender);
    }

    /// The same where it was something else than a demand, in whose place it comes.
    pub(super) fn note_obeyed(&mut self, now: Timestamp, sender: MavId) {
        self.autopilot_client.handle_obeyed(now, sender);
        if self.control.primary() == Some(sender) {
            self.primary_demand = Some(now);
        }
    }

    pub(super) fn do_gimbal_manager_configure(
        &mut self,
        now: Timestamp,
        sender: MavId,
        command: &Command,
        around: Surroundings<'_>,
    ) -> Result<(), Refusal> {
        if around.other_vehicle {
            return Err(Refusal::denied("other_vehicle"));
        }
        self.configure(now, sender, Configure::read(command)?, around)
    }

    /// Applies what `sender` claims, and tells of it.
    pub(super) fn configure(
        &mut self,
        now: Timestamp,
        sender: MavId,
        configure: Configure,
        around: Surroundings<'_>,
    ) -> Result<(), Refusal> {
        let policy = self.policy(around);
        let (before, was_truce) = (self.control.primary(), self.control.is_truce(now));
        let changes = self.control.configure(now, sender, configure, policy)?;
        self.after_changes_of_control(now, &changes);
        if let Some(holder) = self.control.primary().filter(|_| self.control.is_truce(now) && !was_truce) {
            self.tell(Event::AcquireWar { holder, other: before });
        }
        Ok(())
    }

    /// The places of holders that are silent for the lease are free.
    pub(super) fn end_leases(&mut self, now: Timestamp) {
        let changes = self.control.handle_timeout(now, self.rules.lease_timeout);
        self.after_changes_of_control(now, &changes);
    }

    /// Rates end with the control of who asked for them, and with every change of the primary; the angle stays. Each
    /// change is told at once.
    pub(super) fn after_changes_of_control(&mut self, now: Timestamp, changes: &[Change]) {
        if changes.is_empty() {
            return;
        }
        self.last_command = None;
        self.autopilot_client.handle_changes_of_control(now, changes);
        let holders = [self.control.primary(), self.control.secondary()];
        let source = self.tracking.source();
        let source_lost_its_place =
            source.is_some() && !holders.contains(&source) && changes.iter().any(|change| change.from == source);
        let primary_changed = changes.iter().any(|change| change.place == Place::Primary);
        if primary_changed {
            self.primary_demand = None;
        }
        if primary_changed || source_lost_its_place {
            self.tracking.stop_rates(now);
        }
        // Who becomes primary, and who is left, finds the camera where it was moved.
        if primary_changed {
            self.tracking.keep_nudge();
        }
        if self.tracking.nudged_by().is_some_and(|by| !holders.contains(&Some(by))) {
            self.tracking.end_nudge();
        }
        self.broadcast_status(now);
        for change in changes {
            self.tell(Event::Control(*change));
        }
    }
}
