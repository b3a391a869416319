//! What is wrong around us, and what the user can do about it.

use std::time::Duration;

use crate::timestamp::Timestamp;
use crate::vehicle::Autopilot;
use crate::wire::MavId;

/// A conflict not noticed again for so long is over.
const OVER_AFTER: Duration = Duration::from_secs(30);

const MAX_CONFLICTS: usize = 32;

/// Something that another party does and that stands in our way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Conflict {
    /// Somebody else manages gimbals.
    RivalManager { rival: MavId, autopilot: Option<Autopilot> },
    /// Somebody else steers a gimbal of ours directly.
    RivalMaster { rival: MavId, device: MavId, autopilot: Option<Autopilot>, kept_away: bool },
    /// A gimbal speaks the manager's messages for itself.
    DeviceActsAsManager { device: MavId },
    /// Somebody else sends as us.
    OwnIdInUse { id: MavId },
    /// More than one autopilot on autopilot links while the system id is to be found out.
    SeveralAutopilots,
    /// A component on another channel has the id of a gimbal of ours.
    DeviceElsewhere { device: MavId },
    /// The autopilot has another system id than the configuration names.
    AutopilotElsewhere { autopilot: MavId, system: u8 },
    /// A gimbal on another system id than the vehicle's.
    ForeignSystem { device: MavId, system: u8 },
    /// No manager component id is left.
    NoManagerLeft { device: MavId },
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
            _ => self == other,
        }
    }

    /// For the person looking: what is going on, and which setting changes it.
    pub fn describe(&self) -> String {
        match self {
            Self::RivalManager { rival, autopilot } => {
                format!("{rival} is a gimbal manager too; ground stations see two. {}", remedy(*autopilot))
            }
            Self::RivalMaster { rival, device, autopilot, kept_away } => {
                let outcome =
                    if *kept_away { "its setpoints are not delivered" } else { "its setpoints fight with ours" };
                format!("{rival} steers gimbal {device} directly; {outcome}. {}", remedy(*autopilot))
            }
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
            Self::DeviceElsewhere { device } => format!(
                "{device} is heard in two places; the gimbal is where it was heard first. If there are two gimbals, give \
                 one of them another component id; if not, something sends its frames back."
            ),
            Self::AutopilotElsewhere { autopilot, system } => format!(
                "the autopilot sends as {autopilot}, but [vehicle] system_id is {system}. Set it to \"auto\" or to {}.",
                autopilot.system
            ),
            Self::ForeignSystem { device, system } => format!(
                "gimbal {device} is not on the vehicle's system id {system}; ground stations will not show it with the \
                 vehicle. Set its system id to {system}."
            ),
            Self::NoManagerLeft { device } => format!(
                "gimbal {device} is not managed: the component ids 191 to 194 are taken. Give it a [[gimbal]] entry \
                 with component_id and manager_component_id."
            ),
        }
    }
}

fn remedy(autopilot: Option<Autopilot>) -> &'static str {
    match autopilot {
        Some(Autopilot::ArduPilot) => "On ArduPilot set MNT1_TYPE to 0 and restart it.",
        Some(Autopilot::Px4) => "On PX4 set MNT_MODE_IN to -1 (disabled), or MNT_MODE_OUT to 3 to make it a client.",
        Some(Autopilot::Other(_)) => "Switch its mount off.",
        None => "Switch that component's gimbal manager off.",
    }
}

/// The conflicts noticed lately.
#[derive(Debug, Default)]
pub struct Conflicts {
    noticed: Vec<(Conflict, Timestamp)>,
}

impl Conflicts {
    pub fn note(&mut self, now: Timestamp, conflict: Conflict) {
        if let Some((known, latest)) = self.noticed.iter_mut().find(|(known, _)| known.is_about_the_same(&conflict)) {
            // Who the other party is may become clear later, and then which of its settings to change.
            *known = conflict;
            *latest = now;
            return;
        }
        self.noticed.retain(|(_, latest)| now.since(*latest) < OVER_AFTER);
        if self.noticed.len() < MAX_CONFLICTS {
            tracing::warn!(conflict = conflict.describe(), "conflict");
            self.noticed.push((conflict, now));
        }
    }

    /// Those noticed within the last half minute.
    pub fn current(&self, now: Timestamp) -> impl Iterator<Item = &Conflict> {
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
        let steers = |autopilot| Conflict::RivalMaster { rival, device, autopilot, kept_away: true };
        let manages = Conflict::RivalManager { rival, autopilot: None };
        let mut conflicts = Conflicts::default();
        conflicts.note(Timestamp::ZERO, steers(None));
        conflicts.note(Timestamp::from_secs(1), manages);
        conflicts.note(Timestamp::from_secs(29), steers(Some(Autopilot::ArduPilot)));

        let at = |secs| conflicts.current(Timestamp::from_secs(secs)).copied().collect::<Vec<_>>();
        assert_eq!(at(30), [steers(Some(Autopilot::ArduPilot)), manages]);
        assert_eq!(at(31), [steers(Some(Autopilot::ArduPilot))]);
        assert_eq!(at(59), []);
    }
}
