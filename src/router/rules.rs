//! The numbered routing rules; `docs/routing.md` has each with its source.

use super::routes::Routes;
use crate::channel::{ChannelId, ChannelSet};
use crate::timestamp::Timestamp;
use crate::wire::{MavId, Target};

/// Learns routes and applies the rules to each frame.
#[derive(Debug, Default)]
pub struct Router {
    routes: Routes,
    open: ChannelSet,
    own_system: Option<u8>,
}

/// Where a frame goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Verdict {
    pub channels: ChannelSet,
    /// Channels that the target would allow but where the source itself is known.
    pub looped: ChannelSet,
}

impl Router {
    /// The system id that rule R5 speaks of; `None` until it is settled.
    pub fn set_own_system(&mut self, system: Option<u8>) {
        self.own_system = system;
    }

    pub fn open_channel(&mut self, channel: ChannelId) {
        self.open.insert(channel);
    }

    pub fn close_channel(&mut self, channel: ChannelId) {
        self.open.remove(channel);
        self.routes.forget_channel(channel);
    }

    /// Every open channel.
    pub fn open_channels(&self) -> ChannelSet {
        self.open
    }

    /// R8: a source is known where it was heard. Call for frames that were checked only.
    pub fn learn(&mut self, now: Timestamp, channel: ChannelId, source: MavId) {
        self.routes.learn(now, channel, source);
    }

    /// R10: `SYSTEM_TIME` with a smaller time since boot means a restarted system; its routes are forgotten, and the
    /// source is learned anew on `channel`.
    pub fn note_boot_time(&mut self, now: Timestamp, channel: ChannelId, source: MavId, boot_ms: u32) {
        if self.routes.note_boot_time(channel, source, boot_ms) {
            self.routes.forget_system(source.system);
            self.routes.learn(now, channel, source);
            self.routes.note_boot_time(channel, source, boot_ms);
        }
    }

    pub fn forget_system(&mut self, system: u8) {
        self.routes.forget_system(system);
    }

    pub fn routes(&self) -> &Routes {
        &self.routes
    }

    /// The channels for a frame that came from `from`.
    pub fn route(&mut self, now: Timestamp, from: ChannelId, source: MavId, target: Target) -> Verdict {
        self.routes.expire(now);
        let reachable = self.reachable(target);
        // R1: never back to where it came from.
        let onward = reachable.intersection(self.open).without(from.into());
        // R7: never to where its source is known, or it would go round in circles.
        let known = self.routes.component_channels(source);
        Verdict { channels: onward.without(known), looped: onward.intersection(known) }
    }

    /// The channels for a message of our own.
    pub fn route_own(&mut self, now: Timestamp, target: Target) -> ChannelSet {
        self.routes.expire(now);
        self.reachable(target).intersection(self.open)
    }

    /// The channels on which exactly `id` was heard.
    pub fn route_known(&mut self, now: Timestamp, id: MavId) -> ChannelSet {
        self.routes.expire(now);
        self.routes.component_channels(id).intersection(self.open)
    }

    fn reachable(&self, target: Target) -> ChannelSet {
        match target {
            // R2: no target, or target system 0, is for everybody. R6: so is a message that is not known.
            Target::Everyone => self.open,
            // R3: to where the system was heard, ours like any other.
            Target::System(system) => self.routes.system_channels(system),
            Target::Component(id) => {
                let exact = self.routes.component_channels(id);
                if exact.is_empty() && self.own_system != Some(id.system) {
                    // R5: in another system an unknown component is looked for where the system is.
                    self.routes.system_channels(id.system)
                } else {
                    // R4: to where exactly it was heard; in our system or nowhere.
                    exact
                }
            }
        }
    }
}
