//! What changes when it is settled which system we belong to, and which component its autopilot is.

use super::identity::Ties;
use super::settings::Role;
use super::{Bridge, surroundings};
use crate::timestamp::Timestamp;
use crate::vehicle::Vehicle;
use crate::wire::MavId;

impl Bridge {
    /// Takes the system id that the heartbeats of autopilots amount to.
    pub(super) fn settle_identity(&mut self, now: Timestamp) {
        let before = self.identity.system();
        let ties = Ties {
            is_held: self.roster.iter().any(|gimbal| gimbal.manager.is_held()),
            is_turning: self.roster.iter().any(|gimbal| gimbal.may_be_turning() && gimbal.may_come_back(now)),
            fallback_is_taken: self.is_fallback_taken(now),
        };
        let was_bootstrap = self.identity.is_bootstrap();
        let is_changed = self.identity.update(now, ties);
        let system = self.identity.system();
        if !is_changed {
            // The fallback id turned out to be right.
            if let Some(system) = system.filter(|_| was_bootstrap && !self.identity.is_bootstrap()) {
                self.outbox.push_system_id(system);
            }
            return;
        }
        tracing::info!(system_id = system, fallback = self.identity.is_bootstrap(), "system id");
        self.router.set_own_system(system);
        self.channels.forget_held();
        self.ranks.set_own_system(system);
        if let Some(before) = before {
            self.router.forget_system(before);
            // It was our vehicle, under the id that it had then, and not another.
            let known = &mut self.vehicles[usize::from(before)];
            *known = known.filter(|known| known.is_on_ground_only);
            let around = surroundings(&self.vehicle, self.autopilot, &self.ranks);
            for gimbal in self.roster.iter_mut() {
                gimbal.manager.forget_system(now, before, around);
            }
        }
        self.autopilot = None;
        self.autopilot_heard = None;
        self.vehicle = Vehicle::new();
        self.transactions.clear();
        self.state_for_gimbals.stop();
        if let Some(system) = system
            && let Some(known) = self.vehicles[usize::from(system)]
            && (!known.is_on_ground_only || self.is_believed(Role::Ground, system))
        {
            self.take_autopilot(now, MavId::new(system, known.component));
        }
        if let Some(system) = system
            && !self.identity.is_bootstrap()
        {
            self.outbox.push_system_id(system);
        }
        // Our first frame under a new id is a heartbeat, everywhere, and before the frame that settled it goes on: a
        // gimbal takes the system id of the first heartbeat it hears.
        self.handle_heartbeat_timer(now);
    }

    pub(super) fn take_autopilot(&mut self, now: Timestamp, autopilot: MavId) {
        tracing::info!(%autopilot, "autopilot found");
        if self.autopilot != Some(autopilot) {
            self.state_for_gimbals.stop();
        }
        self.autopilot = Some(autopilot);
        self.streams.handle_autopilot_found(now);
    }
}
