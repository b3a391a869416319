//! Who was heard where.

use std::time::Duration;

use crate::channel::{ChannelId, ChannelSet};
use crate::timestamp::Timestamp;
use crate::wire::MavId;

/// R9: a route not heard on for so long is forgotten.
pub const ROUTE_EXPIRY: Duration = Duration::from_secs(60);

/// R9: when a component moves to another channel, its old one is kept for so long: redundant links alternate.
pub const MOVE_GRACE: Duration = Duration::from_secs(5);

/// R11: more components than any vehicle has; beyond it the longest-silent one is forgotten.
const MAX_COMPONENTS: usize = 512;

/// The components heard, each with the channels it was heard on.
#[derive(Debug)]
pub struct Routes {
    components: Vec<Component>,
    /// Position in `components` by system and component id.
    index: Vec<u16>,
    /// Every channel on which any component of the system is known.
    systems: Vec<ChannelSet>,
    /// No route expires before then.
    next_expiry: Timestamp,
}

#[derive(Clone, Debug)]
struct Component {
    id: MavId,
    channels: ChannelSet,
    heard: Vec<(ChannelId, Timestamp)>,
    /// The latest `SYSTEM_TIME.time_boot_ms` and where it was heard.
    boot_ms: Option<(ChannelId, u32)>,
}

const NOWHERE: u16 = u16::MAX;

impl Default for Routes {
    fn default() -> Self {
        Self {
            components: Vec::new(),
            index: vec![NOWHERE; 1 << 16],
            systems: vec![ChannelSet::EMPTY; 256],
            next_expiry: Timestamp::from_micros(u64::MAX),
        }
    }
}

impl Routes {
    /// Notes that `id` was heard on `channel`. Ids with a zero are no valid source and are not learned.
    pub fn learn(&mut self, now: Timestamp, channel: ChannelId, id: MavId) {
        if id.system == 0 || id.component == 0 {
            return;
        }
        let at = match self.position(id) {
            Some(at) => at,
            None => self.insert(now, id),
        };
        let component = &mut self.components[at];
        let mut moved = false;
        match component.heard.iter_mut().find(|(known, _)| *known == channel) {
            Some((_, heard)) => *heard = now,
            None => {
                component.heard.push((channel, now));
                component.channels.insert(channel);
                moved = true;
            }
        }
        if component.heard.len() > 1 {
            let before = component.heard.len();
            component.heard.retain(|(_, heard)| now.since(*heard) <= MOVE_GRACE);
            moved |= component.heard.len() != before;
        }
        if moved {
            self.refresh(id.system, at);
        }
        self.next_expiry = self.next_expiry.min(now + ROUTE_EXPIRY);
    }

    /// Where `id` is known; empty when it is not.
    pub fn component_channels(&self, id: MavId) -> ChannelSet {
        self.position(id).map_or(ChannelSet::EMPTY, |at| self.components[at].channels)
    }

    /// Where any component of `system` is known.
    pub fn system_channels(&self, system: u8) -> ChannelSet {
        self.systems[usize::from(system)]
    }

    /// The components known on `channel`, in the order they were first heard.
    pub fn components_on(&self, channel: ChannelId) -> impl Iterator<Item = MavId> + '_ {
        self.components
            .iter()
            .filter(move |component| component.channels.contains(channel))
            .map(|component| component.id)
    }

    /// When `id` was last heard anywhere.
    pub fn last_heard(&self, id: MavId) -> Option<Timestamp> {
        self.position(id).and_then(|at| self.components[at].heard.iter().map(|(_, heard)| *heard).max())
    }

    /// Notes the time since boot that `id` reports on `channel`. A smaller one than before means that it was
    /// restarted, and returns true: its system's routes are to be forgotten.
    ///
    /// Redundant links lag behind each other, so a time from another channel must be smaller by more than five seconds.
    pub fn note_boot_time(&mut self, channel: ChannelId, id: MavId, boot_ms: u32) -> bool {
        let Some(at) = self.position(id) else { return false };
        let latest = &mut self.components[at].boot_ms;
        let Some((heard_on, before)) = *latest else {
            *latest = Some((channel, boot_ms));
            return false;
        };
        let step_back = Duration::from_millis(u64::from(before.saturating_sub(boot_ms)));
        let lags_behind = channel != heard_on && !step_back.is_zero() && step_back <= MOVE_GRACE;
        if !lags_behind {
            *latest = Some((channel, boot_ms));
        }
        !step_back.is_zero() && !lags_behind
    }

    pub fn forget_system(&mut self, system: u8) {
        self.remove_where(|component| component.id.system == system);
    }

    pub fn forget_channel(&mut self, channel: ChannelId) {
        for component in &mut self.components {
            component.heard.retain(|(known, _)| *known != channel);
        }
        self.rebuild();
    }

    /// Forgets what was not heard for a minute.
    pub fn expire(&mut self, now: Timestamp) {
        if now < self.next_expiry {
            return;
        }
        for component in &mut self.components {
            component.heard.retain(|(_, heard)| now.since(*heard) < ROUTE_EXPIRY);
        }
        self.rebuild();
    }

    fn position(&self, id: MavId) -> Option<usize> {
        match self.index[slot(id)] {
            NOWHERE => None,
            at => Some(usize::from(at)),
        }
    }

    fn insert(&mut self, now: Timestamp, id: MavId) -> usize {
        if self.components.len() >= MAX_COMPONENTS {
            let oldest = self
                .components
                .iter()
                .min_by_key(|component| component.heard.iter().map(|(_, heard)| *heard).max().unwrap_or(now));
            if let Some(oldest) = oldest.map(|component| component.id) {
                self.remove_where(|component| component.id == oldest);
            }
        }
        let at = self.components.len();
        self.components.push(Component { id, channels: ChannelSet::EMPTY, heard: Vec::new(), boot_ms: None });
        self.index[slot(id)] = at as u16;
        at
    }

    fn refresh(&mut self, system: u8, at: usize) {
        let component = &mut self.components[at];
        component.channels = component.heard.iter().fold(ChannelSet::EMPTY, |mut set, (channel, _)| {
            set.insert(*channel);
            set
        });
        self.systems[usize::from(system)] = self
            .components
            .iter()
            .filter(|component| component.id.system == system)
            .fold(ChannelSet::EMPTY, |set, component| set.union(component.channels));
    }

    fn remove_where(&mut self, unwanted: impl Fn(&Component) -> bool) {
        for component in &mut self.components {
            if unwanted(component) {
                component.heard.clear();
            }
        }
        self.rebuild();
    }

    /// Drops components without a channel and recomputes what is derived.
    fn rebuild(&mut self) {
        for component in &self.components {
            self.index[slot(component.id)] = NOWHERE;
        }
        self.systems.fill(ChannelSet::EMPTY);
        self.components.retain(|component| !component.heard.is_empty());
        self.next_expiry = Timestamp::from_micros(u64::MAX);
        for (at, component) in self.components.iter_mut().enumerate() {
            self.index[slot(component.id)] = at as u16;
            component.channels = ChannelSet::EMPTY;
            for (channel, heard) in &component.heard {
                component.channels.insert(*channel);
                self.next_expiry = self.next_expiry.min(*heard + ROUTE_EXPIRY);
            }
            let system = &mut self.systems[usize::from(component.id.system)];
            *system = system.union(component.channels);
        }
    }
}

fn slot(id: MavId) -> usize {
    usize::from(id.system) << 8 | usize::from(id.component)
}

#[cfg(test)]
mod tests {
    use super::*;

    const AUTOPILOT: MavId = MavId::new(1, 1);

    /// "a route that is silent for 60 s" is forgotten (Protocol checklist 149).
    #[test]
    fn a_silent_route_is_forgotten() {
        let mut routes = Routes::default();
        routes.learn(Timestamp::ZERO, channel(3), AUTOPILOT);

        routes.expire(Timestamp::from_micros(59_999_999));
        assert_eq!(routes.component_channels(AUTOPILOT), channel(3).into());
        routes.expire(Timestamp::from_secs(60));

        assert_eq!(routes.component_channels(AUTOPILOT), ChannelSet::EMPTY);
        assert_eq!(routes.system_channels(1), ChannelSet::EMPTY);
    }

    #[test]
    fn a_component_that_moves_keeps_its_old_channel_for_a_while() {
        let mut routes = Routes::default();
        routes.learn(Timestamp::ZERO, channel(0), AUTOPILOT);
        routes.learn(Timestamp::from_secs(5), channel(1), AUTOPILOT);
        assert_eq!(routes.component_channels(AUTOPILOT).collect::<Vec<_>>(), [channel(0), channel(1)]);

        routes.learn(Timestamp::from_micros(5_000_001), channel(1), AUTOPILOT);

        assert_eq!(routes.component_channels(AUTOPILOT), channel(1).into());
        assert_eq!(routes.system_channels(1), channel(1).into());
    }

    /// "When a source system sends SYSTEM_TIME with smaller time_boot_ms, its routes are forgotten" (Protocol checklist
    /// 148), but two links of one autopilot that lag behind each other do not restart it.
    #[test]
    fn a_smaller_boot_time_is_a_restart_unless_a_slower_link_brings_it() {
        let mut routes = Routes::default();
        routes.learn(Timestamp::ZERO, channel(0), AUTOPILOT);
        routes.learn(Timestamp::ZERO, channel(1), AUTOPILOT);
        for (on, boot_ms, restarted) in [
            (0, 10_000, false),
            (1, 9_900, false),
            (0, 10_000, false),
            (1, 5_000, false),
            (1, 11_000, false),
            (1, 10_999, true),
            (0, 10_998, false),
            (0, 5_998, true),
        ] {
            assert_eq!(routes.note_boot_time(channel(on), AUTOPILOT, boot_ms), restarted, "{boot_ms} on {on}");
        }
    }

    #[test]
    fn sources_that_no_component_has_are_not_learned() {
        let mut routes = Routes::default();
        routes.learn(Timestamp::ZERO, channel(0), MavId::new(0, 1));
        routes.learn(Timestamp::ZERO, channel(0), MavId::new(1, 0));
        assert_eq!(routes.components_on(channel(0)).count(), 0);
    }

    #[test]
    fn a_flood_of_sources_displaces_the_longest_silent() {
        let mut routes = Routes::default();
        routes.learn(Timestamp::ZERO, channel(0), AUTOPILOT);
        for n in 0..600_u64 {
            let id = MavId::new(2 + (n / 250) as u8, 1 + (n % 250) as u8);
            routes.learn(Timestamp::from_millis(n), channel(1), id);
            routes.learn(Timestamp::from_millis(n), channel(0), AUTOPILOT);
        }
        assert_eq!(routes.component_channels(AUTOPILOT), channel(0).into());
        assert_eq!(routes.components_on(channel(1)).count(), MAX_COMPONENTS - 1);
    }

    fn channel(index: usize) -> ChannelId {
        ChannelId::new(index).expect("below the bound")
    }
}
