//! What we ask of the autopilot, and what gimbals are told in its stead.

use std::time::Duration;

use super::settings::{Role, Transport};
use super::state_for_gimbals::{LONGEST, SHORTEST, Source};
use super::streams::{Ask, Need};
use super::transactions::{Asker, Order};
use super::{Bridge, surroundings};
use crate::channel::{ChannelId, ChannelSet};
use crate::gimbals::mavlink_v2::packet;
use crate::manager::DeviceState;
use crate::timestamp::Timestamp;
use crate::vehicle::Autopilot;
use crate::wire::dialect::{MavMessage, REQUEST_DATA_STREAM_DATA, TIMESYNC_DATA};
use crate::wire::ids::{command, message};
use crate::wire::{Frame, MavId, Target};

/// Intervals at which messages of the autopilot are asked for; the first is 50 times a second, if a third of the line can carry it,
/// for a gimbal whose measuring leans on it.
const STATE_EVERY: Duration = Duration::from_millis(40);
const HEADING_EVERY: Duration = Duration::from_millis(100);
const POSITION_EVERY: Duration = Duration::from_millis(200);
/// The same while gimbals are told by us, if the line can carry it.
const VELOCITY_EVERY: Duration = Duration::from_millis(100);
const YAW_TARGET_EVERY: Duration = Duration::from_millis(100);
const SLOW_EVERY: Duration = Duration::from_secs(1);

/// Bytes on the wire of the messages that come often: header, payload, checksum.
const ATTITUDE_QUATERNION_LEN: u32 = 12 + 32;
const LOCAL_POSITION_NED_LEN: u32 = 12 + 28;
const ATTITUDE_TARGET_LEN: u32 = 12 + 37;
const STATE_LEN: u32 = 12 + 57;

/// A gimbal that hears the autopilot through us only.
struct GimbalToTell {
    channel: ChannelId,
    device: MavId,
    manager: u8,
    /// It wants that often.
    leans_on_attitude: bool,
}

impl Bridge {
    /// Which messages of the autopilot are wanted at present.
    pub(super) fn look_after_streams(&mut self, now: Timestamp) {
        match (self.autopilot.is_some() && self.vehicle.alive(now), self.streams.has_autopilot()) {
            (true, false) => self.streams.handle_autopilot_found(now),
            (false, true) => self.streams.handle_autopilot_lost(),
            _ => {}
        }
        self.look_after_state_for_gimbals(now);
        let leaning = self.gimbals_to_tell().map(|gimbal| gimbal.leans_on_attitude).max();
        let state = match leaning {
            None => Need::None,
            Some(false) => Need::Some(STATE_EVERY),
            Some(true) => Need::AtLeast(interval_for(self.autopilot_baud(), STATE_LEN, 3, SHORTEST).min(STATE_EVERY)),
        };
        let heading = if self.vehicle.heading(now).is_none() { Need::Some(HEADING_EVERY) } else { Need::None };
        for (message_id, need) in [
            (message::AUTOPILOT_STATE_FOR_GIMBAL_DEVICE, state),
            (message::GLOBAL_POSITION_INT, Need::Some(POSITION_EVERY)),
            (message::ATTITUDE_QUATERNION, Need::None),
            (message::ATTITUDE, heading),
            (message::LOCAL_POSITION_NED, Need::None),
            (message::EXTENDED_SYS_STATE, Need::None),
            (message::ESTIMATOR_STATUS, Need::None),
            (message::EKF_STATUS_REPORT, Need::None),
            (message::ATTITUDE_TARGET, Need::None),
        ] {
            self.streams.set_need(message_id, need);
        }
        if self.state_for_gimbals.is_ours() {
            self.need_what_state_is_made_of(now);
        }
        // What a gimbal asked the autopilot for by a message that it may not know.
        for message_id in [message::ATTITUDE, message::GLOBAL_POSITION_INT] {
            if let Some(interval) = self.gimbal_streams.wanted(message_id) {
                self.streams.raise_need(message_id, interval);
            }
        }
    }

    /// An attitude as often as gimbals are to be told, as far as the line to the autopilot can carry it, and the rest
    /// of the state more slowly. An attitude takes an eighth of a serial line at most, the others half a one each.
    fn need_what_state_is_made_of(&mut self, now: Timestamp) {
        let baud = self.autopilot_baud();
        let attitude = interval_for(baud, ATTITUDE_QUATERNION_LEN, 8, SHORTEST);
        let comes = |message_id| self.streams.comes_every(now, message_id, attitude.max(LONGEST));
        let comes = comes(message::ATTITUDE_QUATERNION) || comes(message::ATTITUDE);
        if !comes || self.vehicle.heading(now).is_none() {
            // The quaternion has more digits, and stations have less use for it.
            let need = Need::AtLeast(attitude);
            let needs = match self.streams.will_not_come(now, message::ATTITUDE_QUATERNION) {
                false => [need, Need::None],
                true => [Need::None, need],
            };
            self.streams.set_need(message::ATTITUDE_QUATERNION, needs[0]);
            self.streams.set_need(message::ATTITUDE, needs[1]);
        }
        let velocity = interval_for(baud, LOCAL_POSITION_NED_LEN, 16, VELOCITY_EVERY);
        let yaw_target = interval_for(baud, ATTITUDE_TARGET_LEN, 16, YAW_TARGET_EVERY);
        let estimator = match self.vehicle.autopilot() {
            Some(Autopilot::ArduPilot) => message::EKF_STATUS_REPORT,
            _ => message::ESTIMATOR_STATUS,
        };
        self.streams.set_need(message::LOCAL_POSITION_NED, Need::Some(velocity));
        self.streams.set_need(message::ATTITUDE_TARGET, Need::Some(yaw_target));
        self.streams.set_need(message::EXTENDED_SYS_STATE, Need::Some(SLOW_EVERY));
        self.streams.set_need(estimator, Need::Some(SLOW_EVERY));
    }

    pub(super) fn ask_autopilot(&mut self, now: Timestamp) {
        let Some(autopilot) = self.autopilot.filter(|_| self.may_ask_autopilot()) else { return };
        let Some(ask) = self.streams.take_due(now) else { return };
        let manager = self.roster.get_mut(0).component;
        match ask {
            Ask::MessageInterval { message_id, interval } => {
                let command = packet::set_message_interval(autopilot, message_id, interval);
                self.transactions.send(now, Order { asker: Asker::Streams { message_id }, manager, command });
            }
            Ask::DataStream { group, rate_hz } => {
                let request = MavMessage::REQUEST_DATA_STREAM(REQUEST_DATA_STREAM_DATA {
                    req_message_rate: rate_hz,
                    target_system: autopilot.system,
                    target_component: autopilot.component,
                    req_stream_id: group,
                    start_stop: 1,
                });
                let channels = self.router.route_own(now, Target::Component(autopilot));
                self.send(now, channels, manager, &request);
            }
        }
    }

    /// Asks once for a message, in the name of a manager that needs it.
    pub(super) fn ask_autopilot_for(&mut self, now: Timestamp, manager: u8, message_id: u32) {
        if let Some(autopilot) = self.autopilot {
            let command = packet::request_of(autopilot, message_id);
            self.transactions.send(now, Order { asker: Asker::Message, manager, command });
        }
    }

    /// Whether there is an autopilot that has answered, or will not answer, what we asked of it before.
    pub(super) fn may_ask_autopilot(&self) -> bool {
        self.identity.system().is_some()
            && self.autopilot.is_some_and(|it| self.transactions.is_free(it, command::SET_MESSAGE_INTERVAL))
    }

    /// What the vehicle's autopilot says, when it is to be believed.
    pub(super) fn take_vehicle_frame(&mut self, now: Timestamp, frame: &Frame<'_>) {
        let restarts = self.vehicle.restarts();
        self.vehicle.handle_frame(now, frame);
        if self.vehicle.restarts() != restarts {
            tracing::info!("autopilot restarted");
            self.streams.handle_autopilot_found(now);
            let around = surroundings(&self.vehicle, self.autopilot, &self.ranks);
            for gimbal in self.roster.iter_mut() {
                gimbal.manager.handle_autopilot_restarted(now, frame.source(), around);
            }
        }
        self.streams.handle_seen(now, frame.message_id());
        match frame.message_id() {
            message::ATTITUDE | message::ATTITUDE_QUATERNION => {
                self.state_for_gimbals.handle_attitude(now);
                self.tell_gimbals_state(now);
            }
            message::AUTOPILOT_STATE_FOR_GIMBAL_DEVICE => self.state_for_gimbals.handle_told_by_others(now),
            _ => {}
        }
    }

    /// D21: whether we tell gimbals the state of the vehicle, and where those are that we tell.
    fn look_after_state_for_gimbals(&mut self, now: Timestamp) {
        let missing = self.streams.will_not_come(now, message::AUTOPILOT_STATE_FOR_GIMBAL_DEVICE);
        let told_by_others = self.state_for_gimbals.source(now) == Some(Source::Autopilot);
        if self.settings.control.synthesize_286 && missing && !told_by_others {
            self.state_for_gimbals.start();
        }
        if !self.state_for_gimbals.is_ours() {
            return;
        }
        let mut channels = ChannelSet::EMPTY;
        self.gimbals_to_tell().for_each(|gimbal| channels.insert(gimbal.channel));
        let shortest = |channel| interval_for(self.baud(channel), STATE_LEN, 4, SHORTEST).min(LONGEST);
        let lines: Vec<(ChannelId, Duration)> = channels.map(|channel| (channel, shortest(channel))).collect();
        self.state_for_gimbals.set_lines(now, &lines);
    }

    /// Tells the state on every channel where it is due.
    pub(super) fn tell_gimbals_state(&mut self, now: Timestamp) {
        while let Some(channel) = self.state_for_gimbals.take_due(now) {
            // One message for all that are there, as ArduPilot addresses it, from the manager of the first.
            let Some(first) = self.gimbals_to_tell().find(|gimbal| gimbal.channel == channel) else { continue };
            let Some(mut state) = self.vehicle.state_for_gimbals(now, Target::System(first.device.system)) else {
                self.state_for_gimbals.pause();
                return;
            };
            state.time_boot_us = self.state_for_gimbals.next_time_us(state.time_boot_us, self.vehicle.restarts());
            self.send(now, channel.into(), first.manager, &MavMessage::AUTOPILOT_STATE_FOR_GIMBAL_DEVICE(state));
        }
    }

    fn gimbals_to_tell(&self) -> impl Iterator<Item = GimbalToTell> {
        let of_autopilot = self.channels.with_role(Role::Autopilot);
        let alive = self.roster.iter().filter(|gimbal| gimbal.manager.state() == DeviceState::Alive);
        let there = alive.filter_map(|gimbal| {
            let (channel, device) = (gimbal.channel?, gimbal.manager.device()?);
            let leans_on_attitude = gimbal.driver.leans_on_attitude();
            Some(GimbalToTell { channel, device, manager: gimbal.component, leans_on_attitude })
        });
        there.filter(move |gimbal| !of_autopilot.contains(gimbal.channel))
    }

    /// When the way from the autopilot is measured next: while its state is told by us, delays included.
    pub(super) fn timesync_due(&self) -> Option<Timestamp> {
        (self.state_for_gimbals.is_telling() && self.autopilot.is_some()).then(|| self.vehicle.timesync_due())
    }

    pub(super) fn measure_round_trip(&mut self, now: Timestamp) {
        let Some(autopilot) = self.autopilot.filter(|_| self.timesync_due().is_some_and(|due| due <= now)) else {
            return;
        };
        let request = TIMESYNC_DATA {
            target_system: autopilot.system,
            target_component: autopilot.component,
            ..self.vehicle.timesync_request(now)
        };
        let channels = self.router.route_own(now, Target::Component(autopilot));
        let manager = self.roster.get_mut(0).component;
        self.send(now, channels, manager, &MavMessage::TIMESYNC(request));
    }

    /// Bits per second of the slowest serial line to the autopilot.
    fn autopilot_baud(&self) -> Option<u32> {
        let channels = self.router.routes().component_channels(self.autopilot?);
        channels.filter_map(|channel| self.baud(channel)).min()
    }

    /// Bits per second, where the channel is a serial line.
    fn baud(&self, channel: ChannelId) -> Option<u32> {
        match self.channels.link_of(channel)?.1.settings.transport {
            Transport::Serial { baud } => Some(baud),
            Transport::Datagrams | Transport::Stream => None,
        }
    }
}

/// `wanted`, or longer where messages of `len` bytes would otherwise take more than one part in `share` of a serial
/// line.
fn interval_for(baud: Option<u32>, len: u32, share: u32, wanted: Duration) -> Duration {
    let Some(baud) = baud else { return wanted };
    // Ten bits to the byte.
    wanted.max(Duration::from_secs_f64(f64::from(len * 10 * share) / f64::from(baud.max(1))))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_message_takes_no_more_than_its_share_of_a_line() {
        let interval_ms = |baud, len, share| interval_for(baud, len, share, SHORTEST).as_secs_f64() * 1e3;
        assert_eq!(interval_ms(None, ATTITUDE_QUATERNION_LEN, 8), 20.0);
        assert_eq!(interval_ms(Some(921_600), ATTITUDE_QUATERNION_LEN, 8), 20.0);
        assert!((interval_ms(Some(115_200), ATTITUDE_QUATERNION_LEN, 8) - 30.5).abs() < 0.1);
        assert!((interval_ms(Some(57_600), ATTITUDE_QUATERNION_LEN, 8) - 61.1).abs() < 0.1);
        assert!((interval_ms(Some(115_200), STATE_LEN, 4) - 23.9).abs() < 0.1);
    }
}
