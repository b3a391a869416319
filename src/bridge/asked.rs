//! What is asked of gimbals by their names, and what is still to be answered.
//!
//! Each is answered exactly once: by the manager, by the gimbal's driver, or, where the gimbal is gone or the driver says
//! nothing for too long, from here.

use std::time::Duration;

use super::outbox::Outbox;
use super::roster::{Gimbal, Roster};
use super::{Bridge, surroundings};
use crate::gimbals::operation::{OperationError, OperationId};
use crate::manager::asked::{Answer, Asked, NotDone, Progress};
use crate::manager::{Commander, DeviceState};
use crate::timestamp::Timestamp;
use crate::wire::MavId;

/// So many are being done at once.
const MAX_UNDER_WAY: usize = 16;

/// What is not answered by then never is. All parameters read over a bad line take longest.
const DEADLINE: Duration = Duration::from_secs(20);

/// What drivers are doing.
#[derive(Debug, Default)]
pub struct UnderWay {
    entries: Vec<Entry>,
}

#[derive(Clone, Copy, Debug)]
struct Entry {
    id: OperationId,
    /// The manager of the gimbal.
    component: u8,
    until: Timestamp,
    asker: Asker,
}

/// Who is told what became of it.
#[derive(Clone, Copy, Debug)]
enum Asker {
    Outside,
    /// A command, which gets its last answer.
    Command(Commander),
}

impl UnderWay {
    pub fn poll_timeout(&self) -> Option<Timestamp> {
        self.entries.iter().map(|entry| entry.until).min()
    }

    /// The process is to end.
    pub fn end_all(&mut self, outbox: &mut Outbox) {
        for entry in self.entries.drain(..).filter(|entry| matches!(entry.asker, Asker::Outside)) {
            outbox.push_answer(entry.id, Err(NotDone::Ending));
        }
    }

    pub fn is_under_way(&self, component: u8, id: OperationId) -> bool {
        self.entries.iter().any(|entry| (entry.component, entry.id) == (component, id))
    }

    /// The ids of commands are their manager's own.
    fn take(&mut self, component: u8, id: OperationId) -> Option<Entry> {
        let at = self.entries.iter().position(|entry| (entry.component, entry.id) == (component, id))?;
        Some(self.entries.swap_remove(at))
    }
}

impl Bridge {
    pub(super) fn handle_asked(&mut self, now: Timestamp, id: OperationId, gimbal: &str, asked: &Asked) {
        match self.ask(now, id, gimbal, asked) {
            Ok(Progress::UnderWay) => {}
            Ok(Progress::Done) => self.outbox.push_answer(id, Ok(())),
            Err(not_done) => self.outbox.push_answer(id, Err(not_done)),
        }
    }

    fn ask(&mut self, now: Timestamp, id: OperationId, name: &str, asked: &Asked) -> Result<Progress, NotDone> {
        if self.shutting_down {
            return Err(NotDone::Ending);
        }
        let around = surroundings(&self.vehicle, self.autopilot, &self.ranks);
        let named = |gimbal: &&mut Gimbal| gimbal.is_shown() && gimbal.manager.settings().name == name;
        let gimbal = self.roster.iter_mut().find(named).ok_or(NotDone::UnknownGimbal)?;
        let system = self.identity.system().ok_or(NotDone::Starting)?;
        if matches!(asked, Asked::Operation(_)) && self.asked.entries.len() >= MAX_UNDER_WAY {
            return Err(NotDone::TooMuch);
        }
        let component = gimbal.component;
        let progress = gimbal.manager.handle_asked(now, MavId::new(system, component), id, asked, around)?;
        if progress == Progress::UnderWay {
            self.asked.entries.push(Entry { id, component, until: now + DEADLINE, asker: Asker::Outside });
        }
        Ok(progress)
    }

    /// The operation of `id` was asked for by a command.
    pub(super) fn handle_commanded(&mut self, now: Timestamp, component: u8, id: OperationId, commander: Commander) {
        let entry = Entry { id, component, until: now + DEADLINE, asker: Asker::Command(commander) };
        self.asked.entries.push(entry);
        if self.asked.entries.len() > MAX_UNDER_WAY {
            self.conclude(now, component, id, Err(NotDone::TooMuch));
        }
    }

    /// What became of one. What a driver says of one that was answered already is of no use to anybody.
    pub(super) fn conclude(&mut self, now: Timestamp, component: u8, id: OperationId, answer: Answer) {
        let Some(entry) = self.asked.take(component, id) else { return };
        let around = surroundings(&self.vehicle, self.autopilot, &self.ranks);
        if let Some(gimbal) = self.roster.of_manager(entry.component) {
            gimbal.manager.handle_operated(now, id, &answer, around);
            if let Asker::Command(commander) = entry.asker {
                gimbal.manager.handle_commanded(commander, &answer);
            }
        }
        if matches!(entry.asker, Asker::Outside) {
            self.outbox.push_answer(id, answer);
        }
    }

    /// Ends those of which the drivers have said nothing for too long.
    pub(super) fn give_up_asked(&mut self, now: Timestamp) {
        self.end_asked(now, &OperationError::NoAnswer, |_, entry| entry.until <= now);
    }

    /// What a gimbal that is gone, or whose place another has taken, does not do any more.
    pub(super) fn answer_for_lost_gimbals(&mut self, now: Timestamp) {
        self.end_asked(now, &OperationError::NotThere, |roster, entry| {
            let gimbal = roster.iter().find(|gimbal| gimbal.component == entry.component);
            gimbal.is_none_or(|gimbal| gimbal.manager.state() != DeviceState::Alive)
        });
    }

    fn end_asked(&mut self, now: Timestamp, error: &OperationError, is_over: impl Fn(&Roster, &Entry) -> bool) {
        while let Some(Entry { id, component, .. }) =
            self.asked.entries.iter().find(|entry| is_over(&self.roster, entry)).copied()
        {
            self.conclude(now, component, id, Err(NotDone::Operation(error.clone())));
        }
    }
}

#[cfg(test)]
mod tests;
