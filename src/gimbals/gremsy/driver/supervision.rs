//! Whether a Gremsy is there, and how it is.

use std::time::Duration;

use super::faults::Fault;
use super::generation::Search;
use super::{Generation, GremsyDriver, HandOver, Heard, LOST_AFTER, TICK, Timer, operations};
use crate::gimbals::driver::{DriverOutput, GimbalDriver};
use crate::gimbals::gremsy::status::{Activity, SystemStatus};
use crate::gimbals::operation::OperationError;
use crate::gimbals::report::{Readiness, Report};
use crate::gimbals::told_rates::ToldRates;
use crate::timers::TimerTable;
use crate::timestamp::Timestamp;
use crate::wire::dialect::HEARTBEAT_DATA;
use crate::wire::ids::mav_state;
use crate::wire::{Frame, MavId};

/// One that was told to start again is waited for this long: it is silent for ten seconds, and for two more.
const REBOOT_TAKES_AT_MOST: Duration = Duration::from_secs(20);
/// And what comes sooner after that is of before.
const REBOOT_TAKES_AT_LEAST: Duration = Duration::from_secs(1);
/// One that was silent for so long after it was told to start again has done so; others were never off.
const REBOOT_IS_SILENT_FOR: Duration = Duration::from_secs(3);

/// A gimbal that is there says something more often, its heartbeat and its status if nothing else.
const HEARD_EVERY: Duration = Duration::from_millis(1500);

/// A gimbal should have become ready by then, or at least have told its status.
const READY_WITHIN: Duration = Duration::from_secs(20);
const STATUS_WITHIN: Duration = Duration::from_secs(10);

/// It was told to start again, or to switch itself off, and did.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Off {
    since: Timestamp,
    /// It starts again.
    pub comes_back: bool,
}

impl GremsyDriver {
    /// It was started again, by whomever.
    pub(super) fn restart(&mut self, now: Timestamp, device: MavId) {
        self.mount.handle_restart();
        self.hand_over = HandOver::No;
        self.effect.forget();
        self.heard.clock.forget();
        self.begin(now, device);
        if self.is_reported {
            self.outputs.push_back(DriverOutput::Report(Report::Restarted));
        }
    }

    /// It does what it was told, and nothing that it was told before holds; but for a rotation: a line that is out looks the
    /// same, and so it is over when the gimbal is stopped or tells that it starts.
    pub(super) fn switch_off(&mut self, now: Timestamp, comes_back: bool) {
        self.off = Some(Off { since: now, comes_back });
        self.hand_over = HandOver::No;
        self.mount.handle_lost();
        self.end_moves();
        self.stop_v2(now);
        self.effect.forget();
    }

    /// Whether it can be steered, and if not, what it is waited for.
    pub(super) fn readiness(&self) -> Readiness {
        match self.off {
            None if self.is_present && self.operations.restarts() => Readiness::AskedToRestart,
            None if self.is_present => Readiness::Ready,
            _ => Readiness::Starting,
        }
    }

    pub(super) fn report_readiness(&mut self) {
        let readiness = self.readiness();
        if self.readiness.replace(readiness) != Some(readiness) {
            self.outputs.push_back(DriverOutput::Report(Report::Readiness(readiness)));
        }
    }

    /// It has started again, and nothing of before turns it.
    pub(super) fn forget_rotation(&mut self) {
        self.mount.forget_rotation();
        (self.turning, self.turning_in_v1, self.stopping) = (None, None, None);
        self.told_rates = ToldRates::default();
    }

    pub(super) fn handle_heard(&mut self, now: Timestamp, device: MavId) {
        let silent = now.since(std::mem::replace(&mut self.heard.latest, now));
        if let Some(stopping) = &mut self.stopping {
            stopping.handle_heard(now);
        }
        self.timers.set(Timer::Lost, now + LOST_AFTER);
        if !self.is_alive {
            self.is_alive = true;
            let was_known = self.search.decided().is_some();
            // Another may have taken its place, with other firmware; one that is to be stopped is told so as it was told to turn.
            if !self.may_be_turning() {
                self.search = Search::new(self.settings.generation, now);
            }
            self.begin(now, device);
            if was_known {
                self.report_alive(device);
            }
        } else if self.off.is_some_and(|off| now.since(off.since) > REBOOT_TAKES_AT_LEAST) {
            if silent >= REBOOT_IS_SILENT_FOR {
                self.restart(now, device);
                self.is_start_told = true;
            } else {
                self.begin(now, device);
            }
        }
    }

    pub(super) fn report_alive(&mut self, device: MavId) {
        if !self.is_reported {
            self.is_reported = true;
            self.outputs.push_back(DriverOutput::Report(Report::Alive { device }));
        }
    }

    pub(super) fn lose(&mut self, now: Timestamp) {
        if let Some(Off { since, comes_back: true }) = self.off
            && now.since(since) < REBOOT_TAKES_AT_MOST
        {
            self.timers.set(Timer::Lost, since + REBOOT_TAKES_AT_MOST);
            return;
        }
        // One that is gone before it was known has been there all the same, and another may take its place.
        if let Some(device) = self.device {
            self.report_alive(device);
        }
        self.forget_conversation();
        self.report_gone();
    }

    /// It was told to switch itself off, does that, and was not heard since.
    pub(super) fn is_shut_down(&self) -> bool {
        self.is_gone_as_told || self.off.is_some_and(|off| !off.comes_back)
    }

    pub(super) fn report_gone(&mut self) {
        let report = if self.is_gone_as_told { Report::ShutDown } else { Report::Lost };
        self.outputs.push_back(DriverOutput::Report(report));
    }

    pub(super) fn forget_conversation(&mut self) {
        self.is_alive = false;
        self.is_reported = false;
        self.is_gone_as_told = self.is_shut_down();
        self.off = None;
        self.is_present = false;
        self.mount.handle_lost();
        self.end_moves();
        self.hand_over = HandOver::No;
        self.effect.forget();
        self.heard = Heard::default();
        for id in self.operations.clear() {
            self.operated(id, Err(OperationError::NotThere));
        }
        self.parameters.forget();
        self.drain_parameters();
        self.timers = TimerTable::default();
    }

    pub(super) fn handle_heartbeat(&mut self, now: Timestamp, frame: &Frame<'_>) {
        let Some(heartbeat) = frame.decode::<HEARTBEAT_DATA>() else { return };
        self.heard.heartbeat = Some(now);
        // Many never set it, so only what says otherwise counts.
        self.is_active =
            !matches!(heartbeat.system_status, mav_state::BOOT | mav_state::CALIBRATING | mav_state::POWEROFF);
    }

    pub(super) fn handle_status(&mut self, now: Timestamp, device: MavId, status: SystemStatus) {
        let was_running = self.is_present && self.off.is_none();
        self.heard.status = Some((now, status));
        // What it was told since it is heard again, to stop and stay, was told to one that hangs without motors.
        if status.activity.contains(Activity::STARTING_UP) && !std::mem::replace(&mut self.is_start_told, true) {
            self.outputs.push_back(DriverOutput::Report(Report::Restarted));
            self.mount.handle_lost();
        }
        if was_running && status.activity.contains(Activity::STARTING_UP) {
            self.restart(now, device);
            self.is_start_told = true;
            self.heard.status = Some((now, status));
        }
        if status.activity.contains(Activity::STARTING_UP) {
            self.forget_rotation();
            self.outputs.push_back(DriverOutput::Report(Report::Stands));
        }
        if status.is_aligned() {
            self.aligned_since.get_or_insert(now);
            self.faults.clear(|fault| matches!(fault, Fault::NotAligned(_)));
        }
        self.faults.clear(|fault| *fault == Fault::NoStatus);
        let is_running = was_running && !status.activity.contains(Activity::STARTING_UP);
        for short in self.faults.handle_status(status, is_running) {
            self.warn(short);
        }
        if status.motors_on() {
            self.faults.clear(|fault| matches!(fault, Fault::MotorsOff | Fault::StaysRetracted));
            self.mount.handle_shown_mode(operations::shown_mode(status));
        }
        self.handle_shown(status);
    }

    pub(super) fn handle_boot_ms(&mut self, now: Timestamp, device: MavId, boot_ms: u32) {
        if self.heard.clock.handle_time(boot_ms) && self.is_present {
            self.restart(now, device);
            self.heard.clock.handle_time(boot_ms);
        }
    }

    pub(super) fn tick(&mut self, now: Timestamp, device: MavId) {
        self.timers.set(Timer::Tick, now + TICK);
        if self.off.is_some() {
            return;
        }
        if self.search.decided().is_some() && self.streams.is_silent(now) {
            for command in self.streams.set(now, device) {
                self.outputs.push_back(DriverOutput::Command(Box::new(command)));
            }
        }
        let waited = now.since(self.begun);
        match self.heard.status {
            None if waited >= STATUS_WITHIN => self.raise(Fault::NoStatus),
            Some((_, status)) if waited >= READY_WITHIN && !self.is_present && !status.is_aligned() => {
                self.raise(Fault::NotAligned(status.alignment));
            }
            _ => {}
        }
        let is_v2 = self.settings.generation == Some(Generation::V2);
        if is_v2 && waited >= READY_WITHIN && self.heard.device_status.is_none() {
            self.raise(Fault::NoAttitude);
        }
        if self.mount.is_unanswered(now) {
            self.raise_unanswered(now);
        }
    }

    /// It answers nothing; one that says nothing at all is not there.
    pub(super) fn raise_unanswered(&mut self, now: Timestamp) {
        if now.since(self.heard.latest) < HEARD_EVERY {
            self.raise(Fault::NoAnswers);
        }
    }
}
