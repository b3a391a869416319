//! What ground stations of gimbal protocol v1 are told of where the gimbal looks: `MOUNT_STATUS` (158) and
//! `MOUNT_ORIENTATION` (265).
//!
//! Both have MAVLink's signs: rolling right, pitching up and yawing right are positive. Neither can say that it is not
//! true any more, so nothing is told of a gimbal that is lost, or whose attitude is old.

use std::time::Duration;

use super::intervals::Schedule;
use super::messages::Interval;
use super::{ATTITUDE_STALE, GimbalManager, ManagerOutput, Surroundings};
use crate::channel::ChannelId;
use crate::geometry::{Angle, YawFrame};
use crate::timestamp::Timestamp;
use crate::wire::dialect::{MOUNT_ORIENTATION_DATA, MOUNT_STATUS_DATA, MavMessage};
use crate::wire::ids::{CapFlags, GimbalFlags, message, mount_mode};

/// "MOUNT_STATUS (158) cdeg 4 Hz and MOUNT_ORIENTATION (265) 10 Hz."
const STATUS_INTERVAL: Duration = Duration::from_millis(250);
const ORIENTATION_INTERVAL: Duration = Duration::from_millis(100);

/// How often each channel is told.
#[derive(Debug)]
pub(super) struct MountReports {
    status: Schedule,
    orientation: Schedule,
}

impl MountReports {
    /// `streamed`: unasked (`v1_status`).
    pub fn new(streamed: bool) -> Self {
        let every = |interval| Schedule::new(if streamed { Interval::Every(interval) } else { Interval::Off });
        Self { status: every(STATUS_INTERVAL), orientation: every(ORIENTATION_INTERVAL) }
    }

    pub fn open(&mut self, now: Timestamp, channel: ChannelId) {
        self.status.open(now, channel);
        self.orientation.open(now, channel);
    }

    pub fn close(&mut self, channel: ChannelId) {
        self.status.close(channel);
        self.orientation.close(channel);
    }

    pub fn poll_timeout(&self) -> Option<Timestamp> {
        [self.status.poll_timeout(), self.orientation.poll_timeout()].into_iter().flatten().min()
    }

    /// The schedule of a message, if it is one of these.
    pub fn schedule(&self, message_id: u32) -> Option<&Schedule> {
        match message_id {
            message::MOUNT_STATUS => Some(&self.status),
            message::MOUNT_ORIENTATION => Some(&self.orientation),
            _ => None,
        }
    }

    pub fn schedule_mut(&mut self, message_id: u32) -> Option<&mut Schedule> {
        match message_id {
            message::MOUNT_STATUS => Some(&mut self.status),
            message::MOUNT_ORIENTATION => Some(&mut self.orientation),
            _ => None,
        }
    }
}

/// Where the gimbal looks at this moment, as far as it is known.
struct Looks {
    roll: Angle,
    pitch: Angle,
    yaw_from_nose: Option<Angle>,
    yaw_from_north: Option<Angle>,
}

impl GimbalManager {
    /// Tells those whose turn it is.
    pub(super) fn tell_mount_reports(&mut self, now: Timestamp, around: Surroundings<'_>) {
        for message_id in [message::MOUNT_STATUS, message::MOUNT_ORIENTATION] {
            let Some(schedule) = self.mount_reports.schedule_mut(message_id) else { continue };
            let due = schedule.take_due(now);
            if !due.is_empty()
                && let Some(message) = self.mount_report(now, message_id, around)
            {
                self.outputs.push_back(ManagerOutput::Broadcast { channels: Some(due), message });
            }
        }
    }

    /// 158 or 265; `None` while there is nothing true to say.
    pub(super) fn mount_report(
        &self,
        now: Timestamp,
        message_id: u32,
        around: Surroundings<'_>,
    ) -> Option<Box<MavMessage>> {
        let looks = self.looks(now, around)?;
        let message = match message_id {
            message::MOUNT_STATUS => self.mount_status(&looks)?,
            message::MOUNT_ORIENTATION => mount_orientation(now, &looks),
            _ => return None,
        };
        Some(Box::new(message))
    }

    fn looks(&self, now: Timestamp, around: Surroundings<'_>) -> Option<Looks> {
        let (at, status) = self.status?;
        if now.since(at) > ATTITUDE_STALE {
            return None;
        }
        let heading = status.heading.or(around.vehicle.heading(now));
        let angles = status.attitude.angles();
        let yaw = |frame| status.attitude.yaw().in_frame(frame, heading).map(|yaw| yaw.angle().wrapped());
        Some(Looks {
            roll: angles.roll,
            pitch: angles.pitch,
            yaw_from_nose: yaw(YawFrame::Vehicle),
            yaw_from_north: yaw(YawFrame::Earth),
        })
    }

    /// `MOUNT_STATUS` in hundredths of a degree; it has no way to leave yaw out.
    fn mount_status(&self, looks: &Looks) -> Option<MavMessage> {
        let hundredths = |angle: Angle| (angle.degrees() * 100.0).round() as i32;
        Some(MavMessage::MOUNT_STATUS(MOUNT_STATUS_DATA {
            pointing_a: hundredths(looks.pitch),
            pointing_b: hundredths(looks.roll),
            pointing_c: hundredths(looks.yaw_from_nose?),
            target_system: 0,
            target_component: 0,
            mount_mode: self.mount_mode(),
        }))
    }

    /// `MAV_MOUNT_MODE` of what the gimbal does.
    fn mount_mode(&self) -> u8 {
        let has_inputs = self.capabilities.is_some_and(|able| able.flags.contains(CapFlags::HAS_RC_INPUTS));
        let by_radio = self.status.is_some_and(|(_, status)| status.flags.contains(GimbalFlags::RC_EXCLUSIVE));
        match self.tracking.mode() {
            _ if has_inputs && by_radio => mount_mode::RC_TARGETING,
            Some("retract") => mount_mode::RETRACT,
            Some("neutral") => mount_mode::NEUTRAL,
            Some("roi") => mount_mode::GPS_POINT,
            _ => mount_mode::MAVLINK_TARGETING,
        }
    }
}

/// `MOUNT_ORIENTATION` in degrees; NaN is "invalid".
fn mount_orientation(now: Timestamp, looks: &Looks) -> MavMessage {
    let degrees = |angle: Option<Angle>| angle.map_or(f32::NAN, |angle| angle.degrees() as f32);
    MavMessage::MOUNT_ORIENTATION(MOUNT_ORIENTATION_DATA {
        time_boot_ms: now.boot_ms(),
        roll: looks.roll.degrees() as f32,
        pitch: looks.pitch.degrees() as f32,
        yaw: degrees(looks.yaw_from_nose),
        yaw_absolute: degrees(looks.yaw_from_north),
    })
}
