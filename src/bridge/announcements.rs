//! What the pilot must know, as the words of `STATUSTEXT` (253) that every ground station shows.

use std::time::Duration;

use super::allowance::Allowance;
use crate::gimbals::settings::Takeover;
use crate::manager::DeviceState;
use crate::manager::control::{Change, How, Place};
use crate::manager::events::{Event, Names};
use crate::timestamp::Timestamp;
use crate::wire::MavId;
use crate::wire::ids::severity;

/// The same is said of one gimbal and sender at most so often.
const AGAIN_AFTER: Duration = Duration::from_secs(10);

/// All texts together: so many at once …
const BURST: u32 = 5;
/// … and one more after each of these.
const SPACING: Duration = Duration::from_millis(500);
/// So many of them are kept for what matters more than a refusal.
const NOT_FOR_REFUSALS: u32 = 3;

/// So many texts are remembered as said lately.
const MAX_SAID: usize = 64;

/// The length of the field; a longer text would come in pieces, which old ground stations do not put together.
const MAX_LEN: usize = 50;

/// Decides what is said, and how often.
#[derive(Debug)]
pub struct Announcements {
    said: Vec<(Key, Timestamp)>,
    allowance: Allowance,
    /// The manager components whose gimbals were last said to be lost or shut down.
    said_gone: Vec<u8>,
}

/// What is not said again within [`AGAIN_AFTER`]: about the gimbal of which manager component, what, and of whom.
type Key = (u8, Kind, Option<MavId>);

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Lost,
    ShutDown,
    Back,
    Borrowed,
    GivenBack,
    TakenOver,
    Refused,
    Misread(&'static str),
    AcquireWar,
    Fault(&'static str),
}

/// One text to be sent.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Announcement {
    pub severity: u8,
    pub text: String,
}

/// The gimbal of which something is said.
#[derive(Clone, Copy, Debug)]
pub struct Subject<'a> {
    pub manager: u8,
    pub name: &'a str,
    pub names: Names,
    /// It is gone because it was told to shut down.
    pub is_shut_down: bool,
    pub takeover: Takeover,
    pub autopilot: Option<MavId>,
}

impl Default for Announcements {
    fn default() -> Self {
        Self { said: Vec::new(), allowance: Allowance::new(BURST, SPACING), said_gone: Vec::new() }
    }
}

impl Announcements {
    /// What is said of `event`. That a gimbal is gone or back is said by [`handle_state`](Self::handle_state).
    pub fn handle_event(&mut self, now: Timestamp, subject: Subject<'_>, event: &Event) -> Option<Announcement> {
        if let Event::Fault { what } = *event {
            return self
                .may_say(now, (subject.manager, Kind::Fault(what), None), 0)
                .then(|| Announcement { severity: severity::WARNING, text: signed(subject.name, what) });
        }
        // Most events are not told, and of those that come by the stream only the first: that one is put into words.
        let (kind, who) = kind_of(subject, event)?;
        let (severity, kept) = match kind {
            Kind::Refused | Kind::Misread(_) => (severity::NOTICE, NOT_FOR_REFUSALS),
            Kind::AcquireWar => (severity::WARNING, 0),
            _ => (severity::NOTICE, 0),
        };
        self.may_say(now, (subject.manager, kind, Some(who)), kept)
            .then(|| Announcement { severity, text: signed(subject.name, &text_of(kind, who, subject.names, event)) })
    }

    /// Says that a gimbal is lost, shut down or back; called again and again, so that what could not be said at once is said later,
    /// if it still holds.
    pub fn handle_state(&mut self, now: Timestamp, subject: Subject<'_>, state: DeviceState) -> Option<Announcement> {
        let known = self.said_gone.iter().position(|manager| *manager == subject.manager);
        let (kind, severity, text) = match (state, known) {
            (DeviceState::Lost, None) if subject.is_shut_down => (Kind::ShutDown, severity::NOTICE, "gimbal shut down"),
            (DeviceState::Lost, None) => (Kind::Lost, severity::WARNING, "gimbal lost"),
            (DeviceState::Alive, Some(_)) => (Kind::Back, severity::NOTICE, "gimbal is back"),
            (DeviceState::Searching, Some(at)) => {
                // Another gimbal has taken the place of the one that was gone.
                self.said_gone.swap_remove(at);
                return None;
            }
            (DeviceState::Lost, Some(_)) | (DeviceState::Alive | DeviceState::Searching, None) => return None,
        };
        if !self.may_say(now, (subject.manager, kind, None), 0) {
            return None;
        }
        match known {
            Some(at) => drop(self.said_gone.swap_remove(at)),
            None => self.said_gone.push(subject.manager),
        }
        Some(Announcement { severity, text: signed(subject.name, text) })
    }

    fn may_say(&mut self, now: Timestamp, key: Key, kept: u32) -> bool {
        self.said.retain(|(_, at)| now.since(*at) < AGAIN_AFTER);
        let said = self.said.iter().any(|(said, _)| *said == key);
        if said || self.said.len() >= MAX_SAID || !self.allowance.take(now, kept) {
            return false;
        }
        self.said.push((key, now));
        true
    }
}

/// What kind of news an event is, and about whom; `None` where it is none for the pilot.
fn kind_of(subject: Subject<'_>, event: &Event) -> Option<(Kind, MavId)> {
    match *event {
        Event::Control(Change { place: Place::Primary, how, who, from: Some(_), to: Some(to) }) => match how {
            How::Borrowed => Some((Kind::Borrowed, who)),
            How::Restored => Some((Kind::GivenBack, to)),
            How::TakenOver => Some((Kind::TakenOver, to)),
            _ => None,
        },
        Event::Control(Change { place: Place::Primary, how: How::Restored, to: Some(to), .. }) => {
            Some((Kind::GivenBack, to))
        }
        Event::AcquireWar { holder, .. } => Some((Kind::AcquireWar, holder)),
        // Of the war itself it was told.
        Event::Refused { reason: "acquire_war", .. } => None,
        // An exclusive holder is not bothered with what others want.
        Event::Refused { holder: Some(_), .. } if subject.takeover == Takeover::Exclusive => None,
        // PX4 streams what it would have the gimbal do, and counts on being ignored while it has no control.
        Event::Refused { who, reason: "not_in_control", .. } if subject.autopilot == Some(who) => None,
        Event::Refused { who, holder: Some(_), .. } => Some((Kind::Refused, who)),
        Event::Refused { who, holder: None, reason } => misread(reason).map(|looks| (Kind::Misread(looks), who)),
        _ => None,
    }
}

fn text_of(kind: Kind, who: MavId, names: Names, event: &Event) -> String {
    let whom = event.from().map_or_else(String::new, |id| names.of(id));
    let (who, reason) = (names.of(who), event.reason().unwrap_or_default());
    match kind {
        Kind::Lost => "gimbal lost".to_owned(),
        Kind::ShutDown => "gimbal shut down".to_owned(),
        Kind::Back => "gimbal is back".to_owned(),
        Kind::Fault(what) => what.to_owned(),
        Kind::Borrowed => "autopilot borrowed control".to_owned(),
        Kind::GivenBack => format!("autopilot gave control back to {who}"),
        Kind::TakenOver => format!("{who} took control from {whom}"),
        Kind::AcquireWar => format!("acquire war, {who} keeps control"),
        Kind::Refused if reason == "holder_must_release" => format!("{who} asks {whom} for control"),
        Kind::Refused => format!("{who} refused, {whom} in control"),
        Kind::Misread(looks) => format!("{who}: {looks}"),
    }
}

/// What the numbers of a request look like that was refused for them; whoever sends them sees nothing else of it, since
/// old programs do not look at the answer, and messages have none.
fn misread(reason: &str) -> Option<&'static str> {
    match reason {
        "looks_like_centidegrees" => Some("refused, accept_centidegrees?"),
        "looks_like_a_place" => Some("refused, place without mode 4"),
        "place_in_the_first_parameters" => Some("refused, place in params 1-3"),
        _ => None,
    }
}

/// The gimbal's name before the text, cut where the whole would be too long.
fn signed(name: &str, text: &str) -> String {
    let room = MAX_LEN.saturating_sub(text.len() + 2);
    let name: String = name.chars().take(room).collect();
    format!("{name}: {text}")
}

#[cfg(test)]
mod tests {
    use super::*;

    const GCS: MavId = MavId::new(255, 190);
    const SCRIPT: MavId = MavId::new(245, 191);
    const AUTOPILOT: MavId = MavId::new(1, 1);

    /// "The same text kind per gimbal and sender at most once in 10 s."
    #[test]
    fn the_same_is_said_once_in_ten_seconds() {
        let mut announcements = Announcements::default();
        let mut said = Vec::new();
        for millis in (0..20_000).step_by(20) {
            for (manager, who) in [(191, SCRIPT), (191, MavId::new(1, 192)), (192, SCRIPT)] {
                let now = Timestamp::from_millis(millis);
                if announcements.handle_event(now, subject(manager, Takeover::Open), &refused(who)).is_some() {
                    said.push((millis, manager, who));
                }
            }
        }
        let third = (500, 192, SCRIPT); // three at once are for what matters more
        let expected = [(0, 191, SCRIPT), (0, 191, MavId::new(1, 192)), third];
        assert_eq!(said[..3], expected);
        assert_eq!(said[3..], [(10_000, 191, SCRIPT), (10_000, 191, MavId::new(1, 192)), (10_500, 192, SCRIPT)]);
    }

    /// "Overall at most a few per second"; what is held back of a gimbal that is lost is said when there is room.
    #[test]
    fn a_storm_of_events_is_no_storm_of_texts() {
        let mut announcements = Announcements::default();
        let mut said = 0;
        for sender in 0..200 {
            let event = refused(MavId::new(sender, 1));
            said +=
                u32::from(announcements.handle_event(Timestamp::ZERO, subject(191, Takeover::Open), &event).is_some());
        }
        assert_eq!(said, BURST - NOT_FOR_REFUSALS);
        let mut lost = |millis, manager| {
            let now = Timestamp::from_millis(millis);
            announcements.handle_state(now, subject(manager, Takeover::Open), DeviceState::Lost).is_some()
        };
        assert_eq!([lost(0, 191), lost(0, 192), lost(0, 193), lost(0, 194)], [true, true, true, false]);
        assert_eq!([lost(500, 191), lost(500, 194), lost(600, 194)], [false, true, false]);
    }

    /// A link that comes and goes: what is said last is how it is.
    #[test]
    fn a_gimbal_that_comes_and_goes_is_last_said_to_be_what_it_is() {
        let mut announcements = Announcements::default();
        let mut text = |secs, state| {
            let now = Timestamp::from_secs(secs);
            announcements.handle_state(now, subject(191, Takeover::Open), state).map(|announcement| announcement.text)
        };
        use DeviceState::{Alive, Lost, Searching};
        assert_eq!(text(0, Alive), None);
        assert_eq!(text(1, Lost).as_deref(), Some("camera: gimbal lost"));
        assert_eq!(text(2, Alive).as_deref(), Some("camera: gimbal is back"));
        assert_eq!(text(3, Lost), None, "said two seconds ago");
        assert_eq!(text(11, Lost).as_deref(), Some("camera: gimbal lost"));
        assert_eq!(text(12, Searching), None);
        assert_eq!(text(13, Alive), None, "another gimbal is not back");
    }

    /// `takeover = "exclusive"`: "DENIED, without bothering the holder".
    #[test]
    fn an_exclusive_holder_is_not_bothered() {
        let mut announcements = Announcements::default();
        let exclusive = subject(191, Takeover::Exclusive);
        assert_eq!(announcements.handle_event(Timestamp::ZERO, exclusive, &refused(SCRIPT)), None);
    }

    /// PX4 "relies on us to ignore it when it does not hold control. Ignoring must be silent"; a claim that it was denied is
    /// told.
    #[test]
    fn an_autopilot_that_streams_without_control_is_no_news() {
        let mut announcements = Announcements::default();
        let open = subject(191, Takeover::Open);
        assert_eq!(announcements.handle_event(Timestamp::ZERO, open, &refused(AUTOPILOT)), None);
        let claim = Event::Refused { who: AUTOPILOT, reason: "holder_ranks_no_lower", holder: Some(GCS) };
        let said = announcements.handle_event(Timestamp::ZERO, open, &claim).expect("it is said");
        assert_eq!(said.text, "camera: 1/1 refused, 255/190 in control");
    }

    /// "At most 50 characters each", whatever the gimbal's name.
    #[test]
    fn a_text_is_never_too_long() {
        let widest = MavId::new(255, 255);
        let change = |how| Change { place: Place::Primary, how, who: widest, from: Some(widest), to: Some(widest) };
        let events = [
            Event::Control(change(How::TakenOver)),
            Event::Control(change(How::Borrowed)),
            Event::Control(change(How::Restored)),
            Event::Refused { who: widest, reason: "holder_must_release", holder: Some(widest) },
            Event::Refused { who: widest, reason: "not_in_control", holder: Some(widest) },
            Event::Refused { who: widest, reason: "looks_like_centidegrees", holder: None },
            Event::Refused { who: widest, reason: "looks_like_a_place", holder: None },
            Event::Refused { who: widest, reason: "place_in_the_first_parameters", holder: None },
        ];
        for event in events {
            let subject =
                Subject { name: "a-gimbal-with-a-very-long-name-of-45-letters", ..subject(191, Takeover::Open) };
            let said = Announcements::default().handle_event(Timestamp::ZERO, subject, &event).expect("it is said");
            assert_eq!(said.text.len(), MAX_LEN, "{}", said.text);
            assert!(said.text.starts_with("a-gimbal"), "{}", said.text);
        }
    }

    fn subject(manager: u8, takeover: Takeover) -> Subject<'static> {
        let (names, autopilot) = (Names::default(), Some(AUTOPILOT));
        Subject { manager, name: "camera", names, is_shut_down: false, takeover, autopilot }
    }

    fn refused(who: MavId) -> Event {
        Event::Refused { who, reason: "not_in_control", holder: Some(GCS) }
    }
}
