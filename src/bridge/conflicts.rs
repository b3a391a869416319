//! What is wrong around us, and what the user can do about it.

use std::time::Duration;

use super::LinkIndex;
use super::settings::FALLBACK_SYSTEM_ID;
use crate::timestamp::Timestamp;
use crate::vehicle::Autopilot;
use crate::wire::MavId;
use crate::wire::ids::component;

/// A conflict not noticed again for so long is over.
const OVER_AFTER: Duration = Duration::from_secs(30);

const MAX_CONFLICTS: usize = 32;

/// Something that another party does and that stands in our way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Conflict {
    /// Somebody else manages gimbals; `device_id` is the one it speaks of.
    RivalManager { rival: MavId, device_id: u8, autopilot: Option<Autopilot> },
    /// Somebody else steers a gimbal of ours directly.
    RivalMaster { rival: MavId, device: MavId, autopilot: Option<Autopilot>, outcome: Outcome },
    /// The autopilot drives the device that we present to it by mount commands, which is not how it is meant.
    MountCommandsToPresented { device: MavId },
    /// A gimbal speaks the manager's messages for itself.
    DeviceActsAsManager { device: MavId },
    /// Somebody else sends as us.
    OwnIdInUse { id: MavId },
    /// More than one autopilot on autopilot links while the system id is to be found out.
    SeveralAutopilots,
    /// Without an autopilot we would use an id that another vehicle has; `waits` tells that we don't yet.
    FallbackTaken { waits: bool },
    /// A component on another channel has the id of a gimbal of ours.
    DeviceElsewhere { device: MavId, managed_on: LinkIndex, other_on: LinkIndex },
    /// Two on one line have the id of a gimbal of ours.
    DeviceTwice { device: MavId },
    /// The gimbal of an entry was heard on another link than the entry names.
    DeviceOffItsLink { device: MavId, other_on: LinkIndex },
    /// The gimbal of an entry that names its component has another component id now.
    DeviceRenamed { former: MavId, device: MavId },
    /// A ground station's id is alive on two channels.
    StationTwice { station: MavId, links: [LinkIndex; 2] },
    /// The autopilot has another system id than the configuration names.
    AutopilotElsewhere { autopilot: MavId, system: u8 },
    /// The id of our autopilot is also heard where ground stations are.
    AutopilotTwice { autopilot: MavId, other_on: LinkIndex },
    /// A gimbal on another system id than the vehicle's; it is managed where its link is one of gimbals.
    ForeignSystem { device: MavId, system: u8, is_managed: bool },
    /// On a serial link bytes come, and no frame.
    NotMavlink { link: LinkIndex, baud: u32 },
    /// On a serial link to a gimbal that is missed nothing ever came.
    SilentLine { link: LinkIndex, baud: u32 },
    /// A gimbal takes the vehicle's heading for another than the autopilot does, by so much to the right.
    HeadingsApart { device: MavId, degrees: i16 },
    /// No manager component id is left.
    NoManagerLeft { device: MavId },
}

/// What becomes of the setpoints that somebody else sends to a gimbal of ours.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    KeptAway,
    /// They pass us, as configured.
    Delivered,
    /// Rival and gimbal are at the same end of the line, where we cannot come between them.
    BesideUs,
}

impl Conflict {
    /// Whether both tell of the same parties, who may be better known by one of them.
    fn is_about_the_same(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::RivalManager { rival, .. }, Self::RivalManager { rival: other, .. }) => rival == other,
            (
                Self::RivalMaster { rival, device, .. },
                Self::RivalMaster { rival: other_rival, device: other_device, .. },
            ) => (rival, device) == (other_rival, other_device),
            (Self::DeviceElsewhere { device, .. }, Self::DeviceElsewhere { device: other, .. }) => device == other,
            (Self::StationTwice { station, .. }, Self::StationTwice { station: other, .. }) => station == other,
            (Self::ForeignSystem { device, .. }, Self::ForeignSystem { device: other, .. }) => device == other,
            (Self::FallbackTaken { .. }, Self::FallbackTaken { .. }) => true,
            (Self::HeadingsApart { device, .. }, Self::HeadingsApart { device: other, .. }) => device == other,
            _ => self == other,
        }
    }

    /// For the person looking: what is going on, and which setting changes it. `links` are the names of the links.
    pub fn describe(&self, links: &[String]) -> String {
        let name = |link: LinkIndex| links.get(link).map_or("?", String::as_str);
        match self {
            Self::RivalManager { rival, device_id, autopilot } => format!(
                "{rival} is a gimbal manager too; ground stations see two. {}",
                remedy(*autopilot, mount_of(*device_id))
            ),
            Self::RivalMaster { rival, device, autopilot, outcome } => {
                let (outcome, may_be_hosted) = match outcome {
                    Outcome::KeptAway => ("its setpoints are not delivered", true),
                    Outcome::Delivered => ("its setpoints fight with ours", true),
                    Outcome::BesideUs => ("its setpoints reach it without passing here, and fight with ours", false),
                };
                let mount = mount_of(device.component);
                let instead = match autopilot {
                    Some(Autopilot::ArduPilot) if may_be_hosted => {
                        format!(" Or let it steer through us: MNT{mount}_TYPE 6 and [autopilot] present_device = true.")
                    }
                    // A ground station or a script may mean well.
                    None if may_be_hosted => {
                        " If it is a client of ours, let it speak to the gimbal's manager, or to component 0."
                            .to_owned()
                    }
                    _ => String::new(),
                };
                let remedy = remedy(*autopilot, mount);
                format!("{rival} steers gimbal {device} directly; {outcome}. {remedy}{instead}")
            }
            Self::MountCommandsToPresented { device } => format!(
                "the autopilot drives {device}, which we present to it, by mount commands. On ArduPilot set MNT{}_TYPE \
                 to 6 and restart it.",
                mount_of(device.component)
            ),
            Self::DeviceActsAsManager { device } => format!(
                "gimbal {device} acts as its own manager; its messages 280 and 281 are kept on its link. Set it to \
                 gimbal device mode."
            ),
            Self::OwnIdInUse { id } => format!(
                "another component sends as {id}, which is ours. Give it another component id, or set \
                 manager_component_id of the gimbal (mavros: component_id)."
            ),
            Self::SeveralAutopilots => "several autopilots were heard on autopilot links. Set [vehicle] system_id to \
                                        the one this gimbal belongs to."
                .to_owned(),
            Self::FallbackTaken { waits } => format!(
                "no autopilot was heard on its link, and another vehicle has system id {FALLBACK_SYSTEM_ID}, which {}. \
                 Connect the autopilot, or set [vehicle] system_id.",
                if *waits { "we would use without one" } else { "we use without one" }
            ),
            Self::DeviceElsewhere { device, managed_on, other_on } if managed_on == other_on => format!(
                "{device} is heard in two places, both on link {}; the gimbal is the one that was heard first, and the \
                 other is not believed. If there are two gimbals, give one of them another component id; if not, \
                 something sends its frames back.",
                name(*managed_on)
            ),
            Self::DeviceElsewhere { device, managed_on, other_on } => format!(
                "{device} is heard in two places; the gimbal is the one on link {}, and what comes on link {} is not \
                 believed. If there are two gimbals, give one of them another component id; if not, something sends \
                 its frames back.",
                name(*managed_on),
                name(*other_on)
            ),
            Self::DeviceTwice { device } => format!(
                "two gimbals on one line seem to have the id {device}: the time since its start jumps to and fro. Neither \
                 can be steered. Take one of them off the line, and give it another component id."
            ),
            Self::DeviceOffItsLink { device, other_on } => format!(
                "{device} is heard on link {}, but the gimbal of that id has a [[gimbal]] entry that names another link. If \
                 these are two gimbals, give one of them another component id, on whatever link it is; if not, correct the \
                 entry.",
                name(*other_on)
            ),
            Self::NotMavlink { link, baud } => format!(
                "what comes on link {} is no MAVLink. Is {baud} its baud rate? With gimbald stopped, 'gimbald scan' finds \
                 it out.",
                name(*link)
            ),
            Self::SilentLine { link, baud } => format!(
                "nothing ever came on link {}. Is the gimbal switched on and its wiring right (a Gremsy's is COM2, or COM4), and \
                 is {baud} its baud rate? With gimbald stopped, 'gimbald scan' finds it out.",
                name(*link)
            ),
            Self::DeviceRenamed { former, device } => format!(
                "gimbal {former} speaks as {device} now, but its [[gimbal]] entry has component_id = {}. Correct the \
                 one or the other.",
                former.component
            ),
            Self::StationTwice { station, links: [one, other] } if one == other => format!(
                "ground station {station} is heard in two places, both on link {}. If it is one station with two \
                 connections, all is well; if there are two, they share control: give one of them another system id.",
                name(*one)
            ),
            Self::StationTwice { station, links: [one, other] } => format!(
                "ground station {station} is heard in two places, on link {} and on link {}. If it is one station \
                 with two connections, all is well; if there are two, they share control: give one of them another \
                 system id.",
                name(*one),
                name(*other)
            ),
            Self::AutopilotElsewhere { autopilot, system } => format!(
                "the autopilot sends as {autopilot}, but [vehicle] system_id is {system}. Set it to \"auto\" or to {}.",
                autopilot.system
            ),
            Self::AutopilotTwice { autopilot, other_on } => format!(
                "{autopilot}, which is our autopilot, is also heard on link {}, where it is not believed. If another \
                 vehicle flies there, give one of them another system id; if not, something sends its frames back.",
                name(*other_on)
            ),
            Self::ForeignSystem { device, system, is_managed: true } => format!(
                "gimbal {device} is not on the vehicle's system id {system}; ground stations will not show it with the \
                 vehicle. Set its system id to {system}, or restart it."
            ),
            Self::ForeignSystem { device, system, is_managed: false } => format!(
                "gimbal {device} is not managed: it is not on the vehicle's system id {system}, and not on a link of \
                 role gimbal. Set its system id to {system}, or restart it."
            ),
            Self::HeadingsApart { device, degrees } => format!(
                "gimbal {device} takes the nose of the vehicle to be {}° further {} than the autopilot does. Switch it on \
                 while it looks straight ahead, or calibrate its compass.",
                degrees.unsigned_abs(),
                if *degrees < 0 { "left" } else { "right" }
            ),
            Self::NoManagerLeft { device } => format!(
                "gimbal {device} is not managed: the component ids 191 to 194 are taken. Give it a [[gimbal]] entry \
                 with component_id and manager_component_id."
            ),
        }
    }
}

/// The number that ArduPilot gives the mount of a device: the id in its own messages, or the place of a v2 device's
/// component id.
fn mount_of(device_id: u8) -> u8 {
    match device_id {
        1..=6 => device_id,
        component::GIMBAL2..=component::GIMBAL6 => device_id - component::GIMBAL2 + 2,
        _ => 1,
    }
}

fn remedy(autopilot: Option<Autopilot>, mount: u8) -> String {
    match autopilot {
        Some(Autopilot::ArduPilot) => format!("On ArduPilot set MNT{mount}_TYPE to 0 and restart it."),
        Some(Autopilot::Px4) => {
            "On PX4 set MNT_MODE_IN to -1 (disabled), or MNT_MODE_OUT to 3 to make it a client.".to_owned()
        }
        Some(Autopilot::Other(_)) => "Switch its mount off.".to_owned(),
        None => "Switch that component's gimbal manager off.".to_owned(),
    }
}

/// The conflicts noticed lately.
#[derive(Debug)]
pub struct Conflicts {
    noticed: Vec<(Conflict, Timestamp)>,
    /// The names of the links.
    links: Vec<String>,
}

impl Conflicts {
    pub fn new(links: Vec<String>) -> Self {
        Self { noticed: Vec::new(), links }
    }

    pub fn note(&mut self, now: Timestamp, conflict: Conflict) {
        if let Some((known, latest)) = self.noticed.iter_mut().find(|(known, _)| known.is_about_the_same(&conflict)) {
            // Who the other party is may become clear later, and then which of its settings to change.
            *known = conflict;
            *latest = now;
            return;
        }
        self.noticed.retain(|(_, latest)| now.since(*latest) < OVER_AFTER);
        if self.noticed.len() < MAX_CONFLICTS {
            tracing::warn!(conflict = conflict.describe(&self.links), "conflict");
            self.noticed.push((conflict, now));
        }
    }

    /// It is not so any more.
    pub fn end(&mut self, conflict: Conflict) {
        self.noticed.retain(|(known, _)| *known != conflict);
    }

    /// A gimbal with that component id has taken the vehicle's system id.
    pub fn end_foreign_system(&mut self, component: u8) {
        let is_over =
            |known: &Conflict| matches!(known, Conflict::ForeignSystem { device, .. } if device.component == component);
        self.noticed.retain(|(known, _)| !is_over(known));
    }

    /// Those noticed within the last half minute, for the person looking.
    pub fn descriptions(&self, now: Timestamp) -> impl Iterator<Item = String> {
        self.current(now).map(|conflict| conflict.describe(&self.links))
    }

    fn current(&self, now: Timestamp) -> impl Iterator<Item = &Conflict> {
        self.noticed.iter().filter(move |(_, latest)| now.since(*latest) < OVER_AFTER).map(|(conflict, _)| conflict)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A rival is told of once, with the setting to change as soon as it is known whose it is.
    #[test]
    fn a_rival_is_told_of_once() {
        let (rival, device) = (MavId::new(1, 1), MavId::new(1, 154));
        let steers = |autopilot| Conflict::RivalMaster { rival, device, autopilot, outcome: Outcome::KeptAway };
        let manages = Conflict::RivalManager { rival, device_id: 1, autopilot: None };
        let mut conflicts = Conflicts::new(Vec::new());
        conflicts.note(Timestamp::ZERO, steers(None));
        conflicts.note(Timestamp::from_secs(1), manages);
        conflicts.note(Timestamp::from_secs(29), steers(Some(Autopilot::ArduPilot)));

        let at = |secs| conflicts.current(Timestamp::from_secs(secs)).copied().collect::<Vec<_>>();
        assert_eq!(at(30), [steers(Some(Autopilot::ArduPilot)), manages]);
        assert_eq!(at(31), [steers(Some(Autopilot::ArduPilot))]);
        assert_eq!(at(59), []);
    }

    /// ArduPilot's first mount drives 154, the second 171, and so on; its own messages number them.
    #[test]
    fn the_setting_names_the_mount() {
        for (device_id, mount) in [(154, 1), (171, 2), (175, 6), (1, 1), (2, 2), (0, 1), (100, 1)] {
            let rival = MavId::new(1, 1);
            let conflict = Conflict::RivalManager { rival, device_id, autopilot: Some(Autopilot::ArduPilot) };
            let described = conflict.describe(&[]);
            assert!(described.contains(&format!("MNT{mount}_TYPE")), "{device_id}: {described}");
        }
    }
}
