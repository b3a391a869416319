//! The autopilot as a client that never configures: it drives the gimbal device that we present to it (D18).
//!
//! Its setpoints (`GIMBAL_DEVICE_SET_ATTITUDE`) pass the same gate as everybody's. Since it streams them for ever, it is
//! obeyed only when what they demand [changes](stream): then it steers a gimbal that nobody holds, and borrows control
//! from whoever holds it. When it has asked for nothing new for [`GIVE_BACK_AFTER`], control goes back; the camera stays
//! where it is, and a rotation ends.

mod stream;

use std::time::Duration;

use super::control::{Change, Place, Voice};
use super::request::{Claim, Command, Configure, Demand, Refusal};
use super::{GimbalManager, Surroundings};
use crate::timestamp::Timestamp;
use crate::wire::MavId;
use crate::wire::ids::{CommandResult, command};
use stream::{DemandStream, Heard};

/// What the autopilot borrowed it gives back when its demand has been the same for so long.
pub const GIVE_BACK_AFTER: Duration = Duration::from_secs(5);

/// A rate that goes on is asked for again this often; the stream itself comes more often.
const REFRESH_EVERY: Duration = Duration::from_millis(250);

/// What the manager knows of that client.
#[derive(Debug, Default)]
pub(super) struct AutopilotClient {
    id: Option<MavId>,
    stream: DemandStream,
    /// It has control because its stream changed.
    is_borrower: bool,
    /// What it asked for could not be done yet, and was counted.
    is_waiting: bool,
    /// When it was last obeyed.
    obeyed: Timestamp,
    /// The place that it last named by command.
    place: Option<Command>,
}

impl AutopilotClient {
    /// When it gives back what it borrowed.
    pub(super) fn poll_timeout(&self) -> Option<Timestamp> {
        self.stream.changed().filter(|_| self.is_borrower).map(|at| at + GIVE_BACK_AFTER)
    }

    /// `who` was obeyed.
    pub(super) fn handle_obeyed(&mut self, now: Timestamp, who: MavId) {
        if self.id.is_some_and(|id| id != who) {
            self.stream.overrule(now);
        }
    }

    /// It has started again.
    pub(super) fn handle_restarted(&mut self) {
        *self = Self::default();
    }

    pub(super) fn handle_changes_of_control(&mut self, now: Timestamp, changes: &[Change]) {
        for change in changes.iter().filter(|change| change.place == Place::Primary) {
            self.is_borrower &= change.to == self.id;
            if Some(change.who) != self.id && change.to != self.id {
                self.stream.overrule(now);
            }
        }
    }

    /// A word for people: what its stream does.
    fn state(&self, now: Timestamp) -> &'static str {
        match self.stream.changed() {
            _ if !self.stream.is_alive(now) => "silent",
            _ if self.stream.is_overruled() => "overruled",
            Some(at) if now.since(at) < GIVE_BACK_AFTER => "asks",
            _ => "steady",
        }
    }
}

impl GimbalManager {
    /// The autopilot's next setpoint for the device that we present to it; `None` where it demands nothing.
    pub fn handle_autopilot_setpoint(
        &mut self,
        now: Timestamp,
        autopilot: MavId,
        demand: Result<Option<Demand>, Refusal>,
        around: Surroundings<'_>,
    ) {
        self.end_leases(now);
        self.autopilot_client.id = Some(autopilot);
        match demand {
            Ok(demand) => {
                let heard = self.autopilot_client.stream.hear(now, demand);
                if let Some(demand) = demand {
                    self.follow_autopilot(now, autopilot, &demand, heard, around);
                }
            }
            Err(refusal) => self.count_refusal(autopilot, refusal.reason),
        }
        self.carry_out(now, around);
    }

    fn follow_autopilot(
        &mut self,
        now: Timestamp,
        autopilot: MavId,
        demand: &Demand,
        heard: Heard,
        around: Surroundings<'_>,
    ) {
        let asks = self.autopilot_client.stream.changed().is_some_and(|at| now.since(at) < GIVE_BACK_AFTER);
        match heard {
            Heard::First => self.autopilot_client.is_waiting = false,
            Heard::Changes => {
                self.autopilot_client.place = None;
                self.obey_autopilot(now, autopilot, demand, around);
            }
            Heard::Steady { .. } if self.autopilot_client.is_waiting && asks => {
                self.obey_autopilot(now, autopilot, demand, around);
            }
            Heard::Steady { crept } => {
                self.autopilot_client.is_waiting = false;
                let is_obeyed = self.tracking.source() == Some(autopilot) && self.autopilot_client.place.is_none();
                let goes_on = if demand.turns() { self.is_rate_to_go_on(now, crept) } else { crept };
                if is_obeyed && goes_on && self.gate(now, autopilot, around) == Ok(Voice::Whole) {
                    self.obey_autopilot(now, autopilot, demand, around);
                }
            }
            Heard::Overruled => self.count_refusal(autopilot, "overruled"),
        }
    }

    /// Whether a rate that the stream repeats is to be asked for again, unchanged or `crept`. It lasts as long as one that
    /// was set by a command: who set it may be gone, and ArduPilot repeats it all the same, be it not exactly the same
    /// each time.
    fn is_rate_to_go_on(&self, now: Timestamp, crept: bool) -> bool {
        let client = &self.autopilot_client;
        let longest = self.rules.command_rate_timeout;
        let is_fresh = client.stream.changed().is_some_and(|at| now.since(at) < longest);
        (crept || now.since(client.obeyed) >= REFRESH_EVERY) && (longest.is_zero() || is_fresh)
    }

    fn obey_autopilot(&mut self, now: Timestamp, autopilot: MavId, demand: &Demand, around: Surroundings<'_>) {
        // Control is not borrowed for what cannot be done.
        let done = self.check_demand(now, demand, around).and_then(|()| {
            self.take_for_autopilot(now, autopilot, around).inspect_err(|_| {
                self.autopilot_client.stream.overrule(now);
            })?;
            self.handle_demand(now, autopilot, demand, around)
        });
        let client = &mut self.autopilot_client;
        match done {
            Ok(()) => {
                client.is_waiting = false;
                client.obeyed = now;
            }
            // What is denied now is denied until something else is asked for.
            Err(refusal) => {
                let was_waiting = client.is_waiting;
                client.is_waiting = refusal.result != CommandResult::Denied;
                if !was_waiting {
                    self.count_refusal(autopilot, refusal.reason);
                }
            }
        }
    }

    /// Whether a demand could be carried out if the gate let it pass.
    fn check_demand(&self, now: Timestamp, demand: &Demand, around: Surroundings<'_>) -> Result<(), Refusal> {
        let capabilities = self.steerable()?;
        self.tracking.check_demand(now, demand, &self.situation(now, capabilities, around), self.timeouts())
    }

    /// Takes control for a new demand where the gate would refuse it.
    fn take_for_autopilot(
        &mut self,
        now: Timestamp,
        autopilot: MavId,
        around: Surroundings<'_>,
    ) -> Result<(), Refusal> {
        if self.gate(now, autopilot, around) == Ok(Voice::Whole) {
            return Ok(());
        }
        let take = Configure { primary: Claim::Assign(autopilot), secondary: Claim::Keep };
        self.configure(now, autopilot, take, around)?;
        self.autopilot_client.is_borrower = true;
        Ok(())
    }

    /// `DO_SET_ROI_LOCATION` (195) and `DO_SET_ROI_NONE` (197) to the device that we present to the autopilot. A place that
    /// it names again asks for nothing new.
    pub fn handle_autopilot_command(
        &mut self,
        now: Timestamp,
        autopilot: MavId,
        asked: &Command,
        around: Surroundings<'_>,
    ) -> Result<(), Refusal> {
        self.end_leases(now);
        self.autopilot_client.id = Some(autopilot);
        let done = self.obey_autopilot_command(now, autopilot, asked, around);
        if let Err(refusal) = done {
            self.count_refusal(autopilot, refusal.reason);
        }
        self.carry_out(now, around);
        done
    }

    fn obey_autopilot_command(
        &mut self,
        now: Timestamp,
        autopilot: MavId,
        asked: &Command,
        around: Surroundings<'_>,
    ) -> Result<(), Refusal> {
        if asked.number == command::DO_SET_ROI_NONE {
            self.autopilot_client.place = None;
            self.gate(now, autopilot, around)?.needs_whole()?;
            return self.do_set_roi_none(now, autopilot);
        }
        if self.autopilot_client.place.is_some_and(|place| asked.names_the_place_of(&place)) {
            let is_obeyed = self.tracking.source() == Some(autopilot) && self.tracking.roi().is_some();
            return if is_obeyed { Ok(()) } else { Err(Refusal::denied("overruled")) };
        }
        // Control is not borrowed for what cannot be done.
        self.check_roi_location(now, asked, around)?;
        self.take_for_autopilot(now, autopilot, around)?;
        self.autopilot_client.stream.note_command(now);
        self.do_set_roi_location(now, autopilot, asked, around)?;
        self.autopilot_client.place = Some(*asked);
        self.autopilot_client.obeyed = now;
        Ok(())
    }

    /// What was borrowed for a demand goes back when that is steady.
    pub(super) fn give_back_for_autopilot(&mut self, now: Timestamp, around: Surroundings<'_>) {
        let Some(autopilot) = self.autopilot_client.id else { return };
        if self.autopilot_client.poll_timeout().is_none_or(|at| at > now) {
            return;
        }
        self.autopilot_client.is_borrower = false;
        let release = Configure { primary: Claim::Release, secondary: Claim::Keep };
        if let Err(refusal) = self.configure(now, autopilot, release, around) {
            // Nobody is ever denied to give up its own.
            self.count_refusal(autopilot, refusal.reason);
        }
    }

    /// What the autopilot's stream does (`silent`, `steady`, `asks`, `overruled`), and when it last asked for something.
    pub fn autopilot_stream(&self, now: Timestamp) -> (&'static str, Option<Timestamp>) {
        (self.autopilot_client.state(now), self.autopilot_client.stream.changed())
    }
}
