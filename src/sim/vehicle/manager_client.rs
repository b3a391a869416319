//! A simulated PX4 as the client of an external gimbal manager (`MNT_MODE_OUT` 3).
//!
//! As read in its source: it takes the first manager whose 281 it hears for good, and asks it for nothing. What it has an
//! intent for (a mission item, a place) it demands fifty times a second with 287, whether or not it is in control, and counts on
//! the manager to ignore it in silence; control it takes when the intent begins and gives back when that ends.

use std::time::Duration;

use super::Vehicle;
use crate::geometry::{Angle, Position};
use crate::sim::command::Command;
use crate::timestamp::Timestamp;
use crate::wire::dialect::{
    COMMAND_ACK_DATA, COMMAND_LONG_DATA, GIMBAL_MANAGER_SET_PITCHYAW_DATA, GIMBAL_MANAGER_STATUS_DATA,
};
use crate::wire::ids::{CommandResult, GimbalFlags, command, message, mount_mode};
use crate::wire::{Frame, MavId};

/// Every cycle of its gimbal module.
const DEMAND_EVERY: Duration = Duration::from_millis(20);

/// A command without an answer is sent again after this, …
const REPEAT_AFTER: Duration = Duration::from_millis(500);
/// … so often.
const REPEATS: u8 = 3;

/// While 281 shows nobody in control it asks again this often.
const ASK_AGAIN_AFTER: Duration = Duration::from_secs(2);

/// An early version takes control back this often from whoever has it.
const INSIST_EVERY: Duration = Duration::from_secs(3);

/// Which of the versions that PX4 had of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ClientVersion {
    /// The one that was merged: gives control back by −3 and asks again only while nobody has it.
    Merged,
    /// An earlier one: gives it back by −2, and demands only while it has control.
    Yielding,
    /// The first: gives it back by −2, and takes it again and again from whoever has it.
    Insisting,
}

/// What it wants the gimbal to do.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Intent {
    /// Pitch to the horizon; yaw from the nose, or from North.
    Angles {
        pitch: Angle,
        yaw: Angle,
        from_north: bool,
    },
    Place(Position),
}

/// The client and what it knows of its manager.
#[derive(Debug)]
pub(super) struct ManagerClient {
    version: ClientVersion,
    /// The manager and the id of its gimbal.
    manager: Option<(MavId, u8)>,
    /// Who has control, as 281 says.
    primary: Option<MavId>,
    intent: Option<Intent>,
    /// The claim that is not answered yet, and how often it was sent.
    pending: Option<([f32; 4], u8)>,
    next_repeat: Option<Timestamp>,
    asked: Option<Timestamp>,
}

impl ManagerClient {
    pub fn new(version: ClientVersion) -> Self {
        Self { version, manager: None, primary: None, intent: None, pending: None, next_repeat: None, asked: None }
    }

    pub fn poll_timeout(&self) -> Option<Timestamp> {
        self.next_repeat
    }
}

impl Vehicle {
    /// The 281 of a manager, and the answers to its commands.
    pub(super) fn hear_for_client(&mut self, now: Timestamp, frame: &Frame<'_>) {
        let own = self.id();
        let Some(client) = &mut self.client else { return };
        let source = frame.source();
        if let Some(status) = frame.decode::<GIMBAL_MANAGER_STATUS_DATA>() {
            let manager = (source, status.gimbal_device_id);
            if source.system != own.system || source == own || client.manager.is_some_and(|known| known != manager) {
                return;
            }
            client.manager = Some(manager);
            let primary = MavId::new(status.primary_control_sysid, status.primary_control_compid);
            client.primary = Some(primary);
            if client.intent.is_some() {
                self.ask_again(now, primary);
            }
        } else if let Some(ack) = frame.decode::<COMMAND_ACK_DATA>()
            && ack.command == command::DO_GIMBAL_MANAGER_CONFIGURE
            && MavId::new(ack.target_system, ack.target_component) == own
        {
            (client.pending, client.next_repeat) = (None, None);
        }
    }

    fn ask_again(&mut self, now: Timestamp, primary: MavId) {
        let own = self.id();
        let Some(client) = &self.client else { return };
        let (is_wanted, every) = match client.version {
            ClientVersion::Merged | ClientVersion::Yielding => (primary == MavId::new(0, 0), ASK_AGAIN_AFTER),
            ClientVersion::Insisting => (primary != own, INSIST_EVERY),
        };
        if is_wanted && client.asked.is_none_or(|asked| now.since(asked) >= every) {
            self.claim(now, [f32::from(own.system), f32::from(own.component), -1.0, -1.0]);
        }
    }

    /// Its intents come from missions and from whoever asks the vehicle; `None` for what is none.
    pub(super) fn command_client(&mut self, now: Timestamp, asked: &Command) -> Option<CommandResult> {
        self.client.as_ref()?;
        let [p1, p2, p3, _, p5, p6, p7] = asked.params;
        let degrees = Angle::from_degrees;
        let intent = match asked.number {
            command::DO_MOUNT_CONTROL if p7 == f64::from(mount_mode::MAVLINK_TARGETING) => {
                Some(Intent::Angles { pitch: degrees(p1), yaw: degrees(p3), from_north: false })
            }
            command::DO_GIMBAL_MANAGER_PITCHYAW => {
                let from_north = p5 as u32 & u32::from(GimbalFlags::YAW_LOCK.bits()) != 0;
                Some(Intent::Angles { pitch: degrees(p1), yaw: degrees(p2), from_north })
            }
            // Always from mean sea level.
            command::DO_SET_ROI_LOCATION if asked.is_int => {
                Some(Intent::Place(Position { latitude_deg: p5 / 1e7, longitude_deg: p6 / 1e7, altitude_m: p7 }))
            }
            command::DO_SET_ROI_LOCATION => {
                Some(Intent::Place(Position { latitude_deg: p5, longitude_deg: p6, altitude_m: p7 }))
            }
            command::DO_SET_ROI_NONE => None,
            _ => return None,
        };
        self.intend(now, intent);
        Some(CommandResult::Accepted)
    }

    fn intend(&mut self, now: Timestamp, intent: Option<Intent>) {
        let own = self.id();
        let Some(client) = &mut self.client else { return };
        let before = std::mem::replace(&mut client.intent, intent);
        let version = client.version;
        match (before, intent) {
            (None, Some(_)) => {
                self.streams.set_interval(now, message::GIMBAL_MANAGER_SET_PITCHYAW, DEMAND_EVERY.as_micros() as f64);
                self.claim(now, [f32::from(own.system), f32::from(own.component), -1.0, -1.0]);
            }
            (Some(_), None) => {
                self.streams.set_interval(now, message::GIMBAL_MANAGER_SET_PITCHYAW, -1.0);
                let release = match version {
                    ClientVersion::Merged => -3.0,
                    ClientVersion::Yielding | ClientVersion::Insisting => -2.0,
                };
                self.claim(now, [release, release, -1.0, -1.0]);
            }
            (None, None) | (Some(_), Some(_)) => {}
        }
    }

    /// 1001, which is repeated until it is answered.
    fn claim(&mut self, now: Timestamp, claim: [f32; 4]) {
        let Some(client) = &mut self.client else { return };
        if client.manager.is_none() {
            return;
        }
        client.asked = Some(now);
        client.pending = Some((claim, 0));
        self.send_claim(now);
    }

    fn send_claim(&mut self, now: Timestamp) {
        let Some(client) = &mut self.client else { return };
        let (Some((manager, gimbal)), Some((claim, sent))) = (client.manager, client.pending) else { return };
        let [param1, param2, param3, param4] = claim;
        (client.pending, client.next_repeat) =
            if sent < REPEATS { (Some((claim, sent + 1)), Some(now + REPEAT_AFTER)) } else { (None, None) };
        self.line.outbox.send(&COMMAND_LONG_DATA {
            param1,
            param2,
            param3,
            param4,
            param5: 0.0,
            param6: 0.0,
            param7: f32::from(gimbal),
            command: command::DO_GIMBAL_MANAGER_CONFIGURE,
            target_system: manager.system,
            target_component: manager.component,
            confirmation: sent,
        });
    }

    pub(super) fn repeat_claim(&mut self, now: Timestamp) {
        if self.client.as_ref().is_some_and(|client| client.next_repeat.is_some_and(|at| at <= now)) {
            self.send_claim(now);
        }
    }

    /// 287: pitch to the horizon; yaw from the nose by no frame bit at all, from North by both.
    pub(super) fn demand_of_client(&mut self, now: Timestamp) -> bool {
        let (own, position) = (self.id(), self.motion(now).position);
        let Some(client) = &self.client else { return false };
        let (Some((manager, gimbal)), Some(intent)) = (client.manager, client.intent) else { return false };
        if client.version == ClientVersion::Yielding && client.primary != Some(own) {
            return false;
        }
        let from_north_flags = GimbalFlags::YAW_LOCK | GimbalFlags::YAW_IN_EARTH_FRAME;
        let (pitch, yaw, yaw_flags) = match intent {
            Intent::Angles { pitch, yaw, from_north: true } => (pitch, yaw, from_north_flags),
            Intent::Angles { pitch, yaw, from_north: false } => (pitch, yaw, GimbalFlags::empty()),
            Intent::Place(place) => match position.aim_at(place) {
                Some(aim) => (aim.elevation, aim.azimuth.unwrap_or(Angle::ZERO), from_north_flags),
                None => return false,
            },
        };
        self.line.outbox.send(&GIMBAL_MANAGER_SET_PITCHYAW_DATA {
            flags: u32::from((GimbalFlags::PITCH_LOCK | yaw_flags).bits()),
            pitch: pitch.radians() as f32,
            yaw: yaw.radians() as f32,
            pitch_rate: f32::NAN,
            yaw_rate: f32::NAN,
            target_system: manager.system,
            target_component: manager.component,
            gimbal_device_id: gimbal,
        });
        true
    }
}
