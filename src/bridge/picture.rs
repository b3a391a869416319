//! The state of the core as the window shows it.

use std::collections::BTreeMap;
use std::time::Duration;

use super::Bridge;
use super::channels::Link;
use super::roster::Gimbal;
use super::snapshot::{
    AttitudeSnapshot, GimbalSnapshot, LinkSnapshot, PeerSnapshot, RoiSnapshot, SetpointSnapshot, Snapshot,
    VehicleSnapshot,
};
use crate::channel::ChannelId;
use crate::geometry::{AngularRate, YawFrame};
use crate::gimbals::setpoint::Setpoint;
use crate::manager::control::Place;
use crate::manager::events::Names;
use crate::manager::tracking::Tracking;
use crate::timestamp::Timestamp;
use crate::wire::MavId;
use crate::wire::ids::{FailureFlags, GimbalFlags};

impl Bridge {
    /// What there is to see at `now`.
    pub fn snapshot(&self, now: Timestamp) -> Snapshot {
        Snapshot {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            uptime_s: now.since(self.started).as_secs_f64(),
            system_id: self.identity.system(),
            links: (0..self.channels.links().len()).map(|link| self.link_snapshot(now, link)).collect(),
            vehicle: self.vehicle_snapshot(now),
            gimbals: self
                .roster
                .iter()
                .filter(|gimbal| gimbal.is_shown())
                .map(|gimbal| self.gimbal_snapshot(now, gimbal))
                .collect(),
            events: self.events.snapshot(now, self.started),
            conflicts: self.conflicts.descriptions(now).collect(),
        }
    }

    fn link_snapshot(&self, now: Timestamp, index: usize) -> LinkSnapshot {
        let link: &Link = &self.channels.links()[index];
        let mut wire = link.wire;
        let mut dropped: BTreeMap<String, u64> =
            link.dropped.iter().map(|(reason, count)| ((*reason).to_owned(), *count)).collect();
        let mut peers = Vec::new();
        let channels = self.channels.open_set().filter_map(|id| self.channels.channel(id).map(|state| (id, state)));
        for (id, channel) in channels.filter(|(_, channel)| channel.link == index) {
            if let Some(decoder) = &channel.decoder {
                wire.add(decoder.counters());
            }
            if let Some(queue) = &channel.queue {
                for (reason, count) in queue.dropped() {
                    *dropped.entry((*reason).to_owned()).or_default() += count;
                }
            }
            peers.push(PeerSnapshot {
                address: channel.address.clone(),
                components: self.components_on(id),
                age_ms: channel.last_heard.map(|heard| millis(now.since(heard))),
            });
        }
        LinkSnapshot {
            name: link.settings.name.clone(),
            role: link.settings.role.name().to_owned(),
            endpoint: link.settings.endpoint.clone(),
            state: if link.up { "up" } else { "down" }.to_owned(),
            reason: link.reason.clone().filter(|_| !link.up),
            rx_frames: link.rx_frames,
            tx_frames: link.tx_frames,
            rx_bytes: link.rx_bytes,
            tx_bytes: link.tx_bytes,
            crc_errors: wire.crc_errors,
            resync_bytes: wire.resync_bytes,
            dropped_frames: dropped.values().sum(),
            dropped,
            peers,
        }
    }

    fn components_on(&self, channel: ChannelId) -> Vec<String> {
        let mut components: Vec<MavId> = self.router.routes().components_on(channel).collect();
        components.sort_unstable();
        components.iter().map(MavId::to_string).collect()
    }

    fn vehicle_snapshot(&self, now: Timestamp) -> VehicleSnapshot {
        let vehicle = &self.vehicle;
        let angles = vehicle.attitude(now).map(|attitude| attitude.aircraft_angles());
        let position = vehicle.position(now);
        VehicleSnapshot {
            system_id: self.autopilot.map(|autopilot| autopilot.system),
            autopilot: vehicle.autopilot().map(|autopilot| autopilot.name().into_owned()),
            alive: vehicle.alive(now),
            roll_deg: angles.map(|angles| angles.roll.degrees()),
            pitch_deg: angles.map(|angles| angles.pitch.degrees()),
            heading_deg: vehicle.heading(now).map(|heading| heading.degrees().rem_euclid(360.0)),
            attitude_age_ms: vehicle.attitude_age(now).map(millis),
            latitude_deg: position.map(|position| position.latitude_deg),
            longitude_deg: position.map(|position| position.longitude_deg),
            altitude_amsl_m: position.map(|position| position.altitude_m),
            position_age_ms: vehicle.position_age(now).map(millis),
            yaw_rate_dps: vehicle.yaw_rate(now).map(AngularRate::degrees_per_second),
            state_for_gimbal: self.state_for_gimbals.source(now).map(|source| source.name().to_owned()),
            stale: vehicle.stale(now).map(str::to_owned).collect(),
        }
    }

    fn gimbal_snapshot(&self, now: Timestamp, gimbal: &Gimbal) -> GimbalSnapshot {
        let manager = &gimbal.manager;
        let names = self.names(gimbal.component);
        let identity = manager.identity();
        let text = |text: &String| Some(text.clone()).filter(|text| !text.is_empty());
        let held_for = |place| manager.control().holder(place).map(|holder| millis(now.since(holder.since)));
        let failures = manager.status().map_or(FailureFlags::empty(), |(_, status)| status.failures);
        GimbalSnapshot {
            name: manager.settings().name.clone(),
            configured: gimbal.configured,
            family: gimbal.family().name().to_owned(),
            manager_component_id: gimbal.component,
            device_id: manager.device_id(),
            device: manager.device().map(|device| device.to_string()),
            state: manager.state().name().to_owned(),
            vendor: text(&identity.vendor),
            model: text(&identity.model),
            firmware: identity.firmware.map(|[major, minor, patch, development]| match development {
                0 => format!("{major}.{minor}.{patch}"),
                development => format!("{major}.{minor}.{patch}-{development}"),
            }),
            attitude: self.attitude_snapshot(now, gimbal),
            setpoint: setpoint_snapshot(manager.tracking(), names),
            primary: manager.control().primary().map(|id| names.of(id)),
            secondary: manager.control().secondary().map(|id| names.of(id)),
            primary_age_ms: held_for(Place::Primary),
            secondary_age_ms: held_for(Place::Secondary),
            lender: manager.control().lender().map(|id| names.of(id)),
            takeover: manager.settings().takeover.name().to_owned(),
            roi: manager.tracking().roi().map(|place| RoiSnapshot {
                latitude_deg: place.latitude_deg,
                longitude_deg: place.longitude_deg,
                altitude_amsl_m: place.altitude_m,
            }),
            flags: gimbal_flag_names(manager.flags()),
            failure_flags: failure_flag_names(failures),
            presented: self.presented_snapshot(now, gimbal.component),
            details: gimbal.driver.details(now),
            rejected: manager
                .rejected()
                .iter()
                .map(|(sender, reasons)| {
                    let reasons = reasons.iter().map(|(reason, count)| ((*reason).to_owned(), *count)).collect();
                    (names.of(*sender), reasons)
                })
                .collect(),
        }
    }

    fn attitude_snapshot(&self, now: Timestamp, gimbal: &Gimbal) -> AttitudeSnapshot {
        let Some((at, status)) = gimbal.manager.status() else {
            // Of a lost gimbal nothing is known but since when.
            let age_ms = gimbal.manager.told_attitude_at().map(|at| millis(now.since(at)));
            return AttitudeSnapshot { age_ms, ..AttitudeSnapshot::default() };
        };
        let angles = status.attitude.angles();
        let yaw = status.attitude.yaw();
        let heading = status.heading.or(self.vehicle.heading(now));
        let in_frame = |frame: YawFrame| yaw.in_frame(frame, heading).map(|yaw| yaw.angle().wrapped().degrees());
        AttitudeSnapshot {
            roll_deg: Some(angles.roll.degrees()),
            pitch_deg: Some(angles.pitch.degrees()),
            yaw_vehicle_deg: in_frame(YawFrame::Vehicle),
            yaw_earth_deg: in_frame(YawFrame::Earth),
            assumed: status.is_assumed,
            age_ms: Some(millis(now.since(at))),
        }
    }
}

/// `None` also while the gimbal is left to its radio control, whichever way it was: nobody here tells it where to look.
fn setpoint_snapshot(tracking: &Tracking, names: Names) -> Option<SetpointSnapshot> {
    if tracking.is_handed_over() {
        return None;
    }
    let mode = tracking.mode()?.to_owned();
    let source = tracking.source().map(|source| names.of(source));
    let (pitch, yaw) = tracking.nudged();
    let bare = SetpointSnapshot {
        mode,
        source,
        stale: tracking.is_stale(),
        nudge_pitch_deg: pitch.degrees(),
        nudge_yaw_deg: yaw.degrees(),
        ..SetpointSnapshot::default()
    };
    let frame_name = |frame: YawFrame| match frame {
        YawFrame::Vehicle => "vehicle".to_owned(),
        YawFrame::Earth => "earth".to_owned(),
    };
    Some(match tracking.last() {
        Some(Setpoint::Point(pointing)) => SetpointSnapshot {
            roll_deg: Some(pointing.roll.degrees()),
            pitch_deg: Some(pointing.pitch.degrees()),
            yaw_deg: Some(pointing.yaw.angle().degrees()),
            yaw_frame: Some(frame_name(pointing.yaw.frame())),
            ..bare
        },
        Some(Setpoint::Turn(turning)) => SetpointSnapshot {
            roll_rate_dps: turning.roll.map(AngularRate::degrees_per_second),
            pitch_rate_dps: Some(turning.pitch.degrees_per_second()),
            yaw_rate_dps: Some(turning.yaw.degrees_per_second()),
            yaw_frame: Some(frame_name(turning.yaw_frame)),
            ..bare
        },
        Some(Setpoint::Retract | Setpoint::Neutral) | None => bare,
    })
}

fn gimbal_flag_names(flags: GimbalFlags) -> Vec<String> {
    flags.iter_names().map(|(name, _)| name.to_lowercase()).collect()
}

fn failure_flag_names(flags: FailureFlags) -> Vec<String> {
    flags.iter_names().map(|(name, _)| name.to_lowercase()).collect()
}

pub(super) fn millis(duration: Duration) -> u64 {
    duration.as_millis().try_into().unwrap_or(u64::MAX)
}
