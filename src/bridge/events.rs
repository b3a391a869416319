//! What happened lately, for whoever looks, and for the journal.

use std::collections::VecDeque;
use std::time::Duration;

use super::Bridge;
use super::allowance::Allowance;
use super::announcements::{Announcement, Subject};
use super::roster::Gimbal;
use super::settings::Role;
use super::snapshot::EventSnapshot;
use crate::gimbals::operation::Operation;
use crate::manager::control::Place;
use crate::manager::events::{Event, Names};
use crate::manager::messages;
use crate::timestamp::Timestamp;
use crate::wire::MavId;

/// So many events are remembered …
const REMEMBERED: usize = 64;

/// … and of these so many refusals: however many are refused, the changes of control stay to be seen.
const REMEMBERED_REFUSALS: usize = 24;

/// The journal of an operator gets so many events at once, and one more after each of these, however often two clients
/// take control from one another.
const JOURNAL_BURST: u32 = 20;
const JOURNAL_SPACING: Duration = Duration::from_secs(1);

/// The latest events of all gimbals, oldest first.
#[derive(Debug)]
pub struct Events {
    entries: VecDeque<Entry>,
    next_id: u64,
    journal: Allowance,
}

#[derive(Debug)]
struct Entry {
    id: u64,
    gimbal: String,
    names: Names,
    event: Event,
    first: Timestamp,
    latest: Timestamp,
    count: u64,
}

impl Default for Events {
    fn default() -> Self {
        Self { entries: VecDeque::new(), next_id: 0, journal: Allowance::new(JOURNAL_BURST, JOURNAL_SPACING) }
    }
}

impl Events {
    /// Something happened around `gimbal`. The same request refused again and again is one event with a count.
    pub fn note(&mut self, now: Timestamp, gimbal: &str, names: Names, event: Event) {
        if is_repetitive(&event) {
            let again = self.entries.iter().position(|entry| entry.is_repeated_by(gimbal, &event));
            if let Some(mut entry) = again.and_then(|at| self.entries.remove(at)) {
                entry.event = event;
                entry.latest = now;
                entry.count += 1;
                entry.log(false);
                self.entries.push_back(entry);
                return;
            }
        }
        self.make_room(&event);
        let entry =
            Entry { id: self.next_id, gimbal: gimbal.to_owned(), names, event, first: now, latest: now, count: 1 };
        entry.log(self.journal.take(now, 0));
        self.next_id += 1;
        self.entries.push_back(entry);
    }

    /// The latest first.
    pub fn snapshot(&self, now: Timestamp, started: Timestamp) -> Vec<EventSnapshot> {
        self.entries.iter().rev().map(|entry| entry.snapshot(now, started)).collect()
    }

    fn make_room(&mut self, event: &Event) {
        let is_refusal = |entry: &Entry| is_repetitive(&entry.event);
        let refusals = self.entries.iter().filter(|entry| is_refusal(entry)).count();
        let too_many = is_repetitive(event) && refusals >= REMEMBERED_REFUSALS;
        if too_many {
            let oldest = self.entries.iter().position(is_refusal);
            oldest.and_then(|at| self.entries.remove(at));
        } else if self.entries.len() >= REMEMBERED {
            self.entries.pop_front();
        }
    }
}

impl Bridge {
    /// What components are called where it is about the gimbal of that manager.
    pub(super) fn names(&self, component: u8) -> Names {
        Names { own: self.identity.system().map(|system| MavId::new(system, component)) }
    }

    /// An event is remembered, and said where the pilot must know it.
    pub(super) fn handle_event(&mut self, now: Timestamp, at: usize, mut event: Event) {
        if let Event::Operated { operation: Operation::SetParameter { name, .. }, before, .. } = &mut event {
            // The driver was given it, and the gimbal has not answered.
            *before = self.roster.get_mut(at).driver.details(now).parameters.get(name).copied();
        }
        let component = self.roster.get_mut(at).component;
        let names = self.names(component);
        let subject = subject(self.roster.get_mut(at), names, self.autopilot);
        let announcement = self.announcements.handle_event(now, subject, &event);
        self.events.note(now, subject.name, names, event);
        self.announce(now, component, announcement);
        self.announce_state(now, at);
    }

    /// Says that a gimbal is lost, shut down or back, if it is and there is room for it.
    pub(super) fn announce_state(&mut self, now: Timestamp, at: usize) {
        let component = self.roster.get_mut(at).component;
        let names = self.names(component);
        let gimbal = self.roster.get_mut(at);
        let (state, subject) = (gimbal.manager.state(), subject(gimbal, names, self.autopilot));
        let announcement = self.announcements.handle_state(now, subject, state);
        self.announce(now, component, announcement);
    }

    /// To everybody but gimbals, which have no use for it.
    fn announce(&mut self, now: Timestamp, component: u8, announcement: Option<Announcement>) {
        let Some(Announcement { severity, text }) = announcement else { return };
        let channels = self.channels.open_set().without(self.channels.with_role(Role::Gimbal));
        self.send(now, channels, component, &messages::status_text(severity, &text));
    }
}

/// Whether it comes by the stream: what is asked again and again is refused, or doubtful, each time.
fn is_repetitive(event: &Event) -> bool {
    matches!(event, Event::Refused { .. } | Event::Doubtful { .. })
}

/// The gimbal as texts about it name it.
fn subject(gimbal: &Gimbal, names: Names, autopilot: Option<MavId>) -> Subject<'_> {
    let settings = gimbal.manager.settings();
    Subject {
        manager: gimbal.component,
        name: &settings.name,
        names,
        is_shut_down: gimbal.manager.is_shut_down(),
        takeover: settings.takeover,
        autopilot,
    }
}

impl Entry {
    fn is_repeated_by(&self, gimbal: &str, event: &Event) -> bool {
        let same = |one: &Event, other: &Event| {
            is_repetitive(one)
                && is_repetitive(other)
                && (one.name(), one.who(), one.reason()) == (other.name(), other.who(), other.reason())
        };
        self.gimbal == gimbal && same(&self.event, event)
    }

    /// INFO for an operator's journal, as long as there is room (`told`); DEBUG for refusals, which come by the stream: the
    /// first, the second, the fourth …
    fn log(&self, told: bool) {
        let Self { gimbal, names, event, count, .. } = self;
        if is_repetitive(event) && !count.is_power_of_two() {
            return;
        }
        let (what, text) = (event.name(), event.describe(*names));
        match event {
            event if is_repetitive(event) => tracing::debug!(gimbal, what, text, count, "event"),
            Event::Lost { .. } | Event::AcquireWar { .. } if told => tracing::warn!(gimbal, what, text, "event"),
            _ if told => tracing::info!(gimbal, what, text, "event"),
            _ => tracing::debug!(gimbal, what, text, "event"),
        }
    }

    fn snapshot(&self, now: Timestamp, started: Timestamp) -> EventSnapshot {
        let place = self.event.place().map(|place| match place {
            Place::Primary => "primary",
            Place::Secondary => "secondary",
        });
        EventSnapshot {
            id: self.id,
            at_s: self.latest.since(started).as_secs_f64(),
            age_ms: super::picture::millis(now.since(self.latest)),
            first_at_s: self.first.since(started).as_secs_f64(),
            count: self.count,
            gimbal: self.gimbal.clone(),
            what: self.event.name().to_owned(),
            place: place.map(str::to_owned),
            who: self.event.who().map(|id| self.names.of(id)),
            from: self.event.from().map(|id| self.names.of(id)),
            to: self.event.to().map(|id| self.names.of(id)),
            reason: self.event.reason().map(str::to_owned),
            text: self.event.describe(self.names),
        }
    }
}
