//! The heartbeats of our managers, and what is looked after with each.

use std::time::Duration;

use super::conflicts::Conflict;
use super::roster::Gimbal;
use super::settings::{FALLBACK_SYSTEM_ID, Role, SystemId};
use super::{Bridge, Timer};
use crate::channel::{ChannelId, ChannelSet};
use crate::manager::{DeviceState, messages};
use crate::timestamp::Timestamp;
use crate::wire::dialect::MavMessage;
use crate::wire::ids::{component, mav_state, mav_type};

pub const INTERVAL: Duration = Duration::from_secs(1);

impl Bridge {
    pub(super) fn handle_heartbeat_timer(&mut self, now: Timestamp) {
        let due = now + INTERVAL;
        self.timers.set(Timer::Heartbeat, due);
        if self.identity.is_waiting() || self.identity.is_bootstrap() && self.is_fallback_taken(now) {
            self.conflicts.note(now, Conflict::FallbackTaken { waits: self.identity.is_waiting() });
        }
        self.look_for_noise(now);
        if self.identity.system().is_none() {
            self.beat_on_bootstrap_links(now);
            return;
        }
        self.beat(now, self.channels.open_set());
        self.beat_as_presented(now);
        self.handle_vehicle(now);
        if self.identity.has_several(now) && self.settings.system_id == SystemId::Auto {
            self.conflicts.note(now, Conflict::SeveralAutopilots);
        }
        self.look_for_twins(now);
        self.compare_headings(now);
        self.look_for_renamed(now);
        self.remind_devices(now);
        self.watch_for_rivals(now);
        self.look_after_streams(now);
        for at in 0..self.roster.len() {
            self.announce_state(now, at);
        }
    }

    /// A device that misses its manager hears of it at least once a second.
    fn remind_devices(&mut self, now: Timestamp) {
        for at in 0..self.roster.len() {
            let gimbal = self.roster.get_mut(at);
            let Some(channel) = gimbal.channel else { continue };
            if let Some(message) = gimbal.manager.reminder(now, channel) {
                let component = gimbal.component;
                self.answer(now, channel.into(), component, &message);
            }
        }
    }

    /// A heartbeat of each manager on `channels`.
    pub(super) fn beat(&mut self, now: Timestamp, channels: ChannelSet) {
        let bootstrap = self.identity.is_bootstrap();
        for at in 0..self.roster.len() {
            let gimbal = self.roster.get_mut(at);
            if gimbal.beats() {
                let (component, message) = (gimbal.component, heartbeat(gimbal, bootstrap));
                self.send(now, channels, component, &message);
            }
        }
    }

    /// An autopilot that listens must hear somebody before it speaks; it is told the fallback id.
    fn beat_on_bootstrap_links(&mut self, now: Timestamp) {
        let speaks_first =
            |channel: &ChannelId| self.channels.link_of(*channel).is_some_and(|(_, link)| link.settings.speaks_first);
        let channels: Vec<ChannelId> = self.channels.with_role(Role::Autopilot).filter(speaks_first).collect();
        let message = messages::heartbeat(mav_type::ONBOARD_CONTROLLER, mav_state::BOOT);
        for channel in channels {
            self.send_as(now, FALLBACK_SYSTEM_ID, channel.into(), component::ONBOARD_COMPUTER, &message);
        }
    }
}

/// `HEARTBEAT` of one manager; its state is that of its gimbal.
pub fn heartbeat(gimbal: &Gimbal, bootstrap: bool) -> MavMessage {
    messages::heartbeat(gimbal.mav_type(), state(gimbal, bootstrap))
}

/// `MAV_STATE` of who speaks for a gimbal.
pub fn state(gimbal: &Gimbal, bootstrap: bool) -> u8 {
    match gimbal.manager.state() {
        _ if bootstrap => mav_state::BOOT,
        DeviceState::Searching => mav_state::STANDBY,
        DeviceState::Alive if gimbal.manager.has_hard_failure() => mav_state::CRITICAL,
        DeviceState::Alive => mav_state::ACTIVE,
        // That there is none is what was asked for.
        DeviceState::Lost if gimbal.manager.is_shut_down() => mav_state::STANDBY,
        DeviceState::Lost => mav_state::CRITICAL,
    }
}

/// The last one of a manager that is going away.
pub fn goodbye(gimbal: &Gimbal) -> MavMessage {
    messages::heartbeat(gimbal.mav_type(), mav_state::POWEROFF)
}
