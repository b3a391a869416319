//! Whether the gimbal may be turning as it was told, and the word that stops it when there is nobody to decide more.
//!
//! A word may be lost. So what was told to turn counts as turning until it was told otherwise for a while in which it was
//! heard and did not tell that it turns on, and what an earlier run, a loss or another dialect left turning is told to stop before anything is known of it:
//! that takes no knowledge.

use std::time::Duration;

use super::elsewhere::Elsewhere;
use super::{DeviceState, GimbalManager, ManagerOutput};
use crate::channel::ChannelId;
use crate::gimbals::report::GimbalStatus;
use crate::gimbals::rest_watch::{Look, RestWatch};
use crate::gimbals::setpoint::{Setpoint, Turning};
use crate::gimbals::told_rates::ToldRates;
use crate::timestamp::Timestamp;
use crate::vehicle::Vehicle;

/// A gimbal that was left turning is told so often to stop while it cannot be steered.
pub const STOP_UNKNOWN_EVERY: Duration = Duration::from_millis(500);

/// What the gimbal was told to turn at.
#[derive(Clone, Debug)]
pub(super) struct Rotation {
    turning: Turning,
    /// All that it was told since it was last known to stand.
    told: ToldRates,
    /// Whether it has stopped, since it is told something else.
    stopped: Option<RestWatch>,
    /// Nobody has told it anything since it was left to itself.
    is_left: bool,
    elsewhere: Elsewhere,
}

impl GimbalManager {
    /// Whether the gimbal may be turning as it was told.
    pub fn may_be_turning(&self) -> bool {
        self.rotation.is_some()
    }

    /// An earlier run left the gimbal turning: it is told to stop when it is heard.
    pub fn stop_when_heard(&mut self) {
        let (turning, told) = (Turning::STOPPED, ToldRates::ANY);
        let elsewhere = self.rotation.take().map_or_else(Elsewhere::default, |before| before.elsewhere);
        self.rotation = Some(Rotation { turning, told, stopped: None, is_left: true, elsewhere });
    }

    /// It may be one that was told to turn under another id. Whoever steers it tells it something else anyway.
    pub fn stop_unless_steered(&mut self, now: Timestamp) {
        let is_steered = self.tracking.mode().is_some() || self.tracking.is_handed_over();
        if !is_steered && self.rotation.is_none() {
            self.stop_when_heard();
            self.stop_what_was_left_turning(now);
        }
    }

    /// The first sign of its device: more may never come.
    pub fn handle_sign(&mut self, now: Timestamp) {
        self.is_heard = true;
        self.stop_what_was_left_turning(now);
    }

    /// Its device said something there, whatever it was.
    pub fn handle_device_heard(&mut self, now: Timestamp, channel: ChannelId) {
        let is_paused = !self.pauses.is_empty();
        let Some(rotation) = self.rotation.as_mut() else { return };
        rotation.elsewhere.forget(channel);
        let Some(stopped) = &mut rotation.stopped else { return };
        stopped.handle_heard(now);
        if is_paused {
            stopped.begin_anew(now);
        } else if stopped.is_over(now) && rotation.elsewhere.were_told() {
            self.rotation = None;
        }
    }

    /// Its id is heard on another line of gimbals, where it may be by now; what it is to be told there, if that is due.
    pub fn handle_heard_elsewhere(&mut self, now: Timestamp, channel: ChannelId) -> Option<Turning> {
        let turns = self.tracking.unstopped().is_some();
        let rotation = self.rotation.as_mut()?;
        rotation.elsewhere.handle_heard(now, channel, turns).then(|| rotation.turning.stopped())
    }

    /// Its device tells where it looks, and so whether it turns on.
    pub(super) fn note_look(&mut self, now: Timestamp, status: &GimbalStatus, vehicle: &Vehicle) {
        let stopped = self.rotation.as_mut().and_then(|rotation| rotation.stopped.as_mut());
        if let Some(stopped) = stopped.filter(|_| !status.is_assumed) {
            let angles = status.attitude.angles();
            let (yaw, heading) = (status.attitude.yaw(), status.heading.or_else(|| vehicle.heading_by_now(now)));
            stopped.handle_report(now, Look { roll: angles.roll, pitch: angles.pitch, yaw, heading });
        }
    }

    /// Tells the gimbal to stop turning, whatever is known of it.
    pub fn stop_at_once(&mut self) {
        let turning = self.rotation.as_ref().map_or(Turning::STOPPED, |rotation| rotation.turning);
        self.outputs.push_back(ManagerOutput::Steer(Setpoint::Turn(turning.stopped())));
    }

    /// Nobody can be told what to do before it is known, but to stop.
    pub(super) fn stop_what_was_left_turning(&mut self, now: Timestamp) {
        let is_steerable = self.steerable().is_ok();
        // One that is turned for by us, to an angle, has nothing that could go on; and where it looks is not known.
        let would_move = self.capabilities.is_some_and(|capabilities| !capabilities.turns)
            && self.status.is_none_or(|(_, status)| status.is_assumed);
        let Some(rotation) = self.rotation.as_mut().filter(|rotation| rotation.is_left) else { return };
        if is_steerable && would_move {
            self.forget_rotation();
        } else if is_steerable {
            rotation.is_left = false;
            let turning = rotation.turning;
            self.tracking.halt(now, turning);
        } else if self.is_heard {
            self.stop_unknown = Some(now + STOP_UNKNOWN_EVERY);
            self.stop_at_once();
        }
    }

    /// It is not, or not any more, in the hands of its radio control, which took it while it turned.
    pub(super) fn stop_what_radio_control_left(&mut self, now: Timestamp) {
        if self.steerable().is_ok() {
            self.stop_what_was_left_turning(now);
        }
    }

    /// Somebody who may wants a gimbal to stop that is not known yet, starts again or calibrates; true where it can be told.
    pub(super) fn stop_unsteerable(&mut self, now: Timestamp) -> bool {
        let can_hear = self.is_heard && self.state != DeviceState::Lost && self.steerable().is_err();
        if can_hear {
            // Nor is gone on with what may wait for it.
            self.tracking.forget();
            match self.rotation {
                Some(_) => self.leave_turning(),
                None => self.stop_when_heard(),
            }
            self.stop_what_was_left_turning(now);
        }
        can_hear
    }

    /// It is known to stand.
    pub(super) fn forget_rotation(&mut self) {
        (self.rotation, self.stop_unknown) = (None, None);
    }

    /// It may go on turning as it was told, and is not told anything for the time being.
    pub(super) fn leave_turning(&mut self) {
        if let Some(rotation) = &mut self.rotation {
            (rotation.stopped, rotation.is_left) = (None, true);
        }
    }

    /// After each event: what the gimbal was told last.
    pub(super) fn note_rotation(&mut self, now: Timestamp) {
        match (self.tracking.unstopped(), &mut self.rotation) {
            (Some(turning), rotation) => {
                let before = rotation.take().map(|before| (before.told, before.elsewhere));
                let (mut told, elsewhere) = before.unwrap_or_default();
                told.add(turning);
                *rotation = Some(Rotation { turning, told, stopped: None, is_left: false, elsewhere });
            }
            (None, Some(Rotation { turning, told, stopped: stopped @ None, is_left: false, elsewhere })) => {
                *stopped = Some(RestWatch::new(now, turning.yaw_frame, *told, self.told_attitude));
                elsewhere.begin_anew(now);
            }
            (None, _) => {}
        }
    }

    /// An operation has taken the place of what the gimbal was told: a single word to stop went before it, and whatever
    /// is to follow that is the driver's.
    pub(super) fn note_operated(&mut self, now: Timestamp) {
        if let Some(stopped) = self.rotation.as_mut().and_then(|rotation| rotation.stopped.as_mut()) {
            stopped.begin_anew(now);
        }
    }

    pub(super) fn handle_rotation_timeout(&mut self, now: Timestamp) {
        if self.rotation_due().is_some_and(|due| due <= now) {
            self.stop_what_was_left_turning(now);
        }
    }

    pub(super) fn rotation_due(&self) -> Option<Timestamp> {
        let is_left = self.rotation.as_ref().is_some_and(|rotation| rotation.is_left);
        self.stop_unknown.filter(|_| is_left && self.is_heard)
    }
}
