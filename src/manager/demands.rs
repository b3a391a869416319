//! What becomes of a demand: it passes the gate, and is what the gimbal is told, or is added to that.

use super::control::Voice;
use super::request::{Demand, DemandKind, Refusal};
use super::{GimbalManager, Surroundings, manual};
use crate::timestamp::Timestamp;
use crate::wire::MavId;

impl GimbalManager {
    pub(super) fn handle_demand(
        &mut self,
        now: Timestamp,
        sender: MavId,
        demand: &Demand,
        around: Surroundings<'_>,
    ) -> Result<(), Refusal> {
        let voice = self.gate(now, sender, around)?;
        let nudges =
            matches!(voice, Voice::Second { .. }) && demand.is_rates_only() && self.tracking.can_be_nudged_by(sender);
        if !nudges {
            voice.needs_whole()?;
        }
        // Who only adds to it stops what it adds, and not what the primary wants.
        if demand.is_stop() && !nudges && self.stop_unsteerable(now) {
            return Ok(());
        }
        // Nothing that was told turns while the gimbal does something by a function of its own.
        if demand.is_without_motion() && !nudges && !self.pauses.is_empty() {
            self.note_obeyed(now, sender);
            return Ok(());
        }
        let capabilities = match self.capabilities.filter(|_| nudges && demand.is_stop()) {
            Some(capabilities) => capabilities,
            None => *self.steerable()?,
        };
        let demand = match demand.kind {
            DemandKind::Manual => manual::scale(demand, &capabilities.limits, &self.settings),
            DemandKind::Streamed | DemandKind::Commanded => *demand,
        };
        let situation = self.situation(now, &capabilities, around);
        let timeouts = self.timeouts();
        if nudges {
            return self.tracking.nudge(now, sender, &demand, &situation, timeouts);
        }
        if self.tracking.demand(now, sender, &demand, &situation, timeouts)? {
            self.note_demand(now, sender);
        } else {
            self.note_obeyed(now, sender);
        }
        Ok(())
    }
}
