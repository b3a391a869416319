//! Whether a Gremsy is there, and how it is.

use std::time::Duration;

use super::faults::Fault;
use super::{GremsyDriver, Heard, LOST_AFTER, TICK, Timer, operations};
use crate::gimbals::driver::DriverOutput;
use crate::gimbals::gremsy::status::{Activity, SystemStatus};
use crate::gimbals::operation::OperationError;
use crate::gimbals::report::Report;
use crate::timers::TimerTable;
use crate::timestamp::Timestamp;
use crate::wire::dialect::HEARTBEAT_DATA;
use crate::wire::ids::mav_state;
use crate::wire::{Frame, MavId};

/// One that was told to start again is waited for this long: it is silent for ten seconds, and for two more.
const REBOOT_TAKES_AT_MOST: Duration = Duration::from_secs(20);
/// And what comes sooner after that is of before.
const REBOOT_TAKES_AT_LEAST: Duration = Duration::from_secs(1);

/// A gimbal should have become ready by then, or at least have told its status.
const READY_WITHIN: Duration = Duration::from_secs(20);
const STATUS_WITHIN: Duration = Duration::from_secs(10);

/// A time since boot that jumps back further means that the device was restarted.
const REBOOT_STEP_MS: u32 = 1_000;

impl GremsyDriver {
    /// It was started again, by whomever.
    pub(super) fn restart(&mut self, now: Timestamp, device: MavId) {
        self.mount.handle_restart();
        self.mode_change = None;
        self.is_retracted = false;
        self.is_handed_over = false;
        self.effect.forget();
        self.heard.boot_ms = None;
        if self.is_reported {
            self.outputs.push_back(DriverOutput::Report(Report::Restarted));
        }
        self.begin(now, device);
    }

    /// It has started again, and nothing of before turns it.
    pub(super) fn forget_rotation(&mut self) {
        self.mount.forget_rotation();
        (self.turning, self.stopping) = (None, None);
    }

    pub(super) fn handle_heard(&mut self, now: Timestamp, device: MavId) {
        self.heard.latest = now;
        self.timers.set(Timer::Lost, now + LOST_AFTER);
        if !self.is_alive {
            self.is_alive = true;
            self.begin(now, device);
            if self.search.decided().is_some() {
                self.report_alive(device);
            }
        } else if self.is_booting && self.reboot_announced.is_some_and(|at| now.since(at) > REBOOT_TAKES_AT_LEAST) {
            // Of that it was told already.
            self.begin(now, device);
            self.is_start_told = true;
        }
    }

    pub(super) fn report_alive(&mut self, device: MavId) {
        if !self.is_reported {
            self.is_reported = true;
            self.outputs.push_back(DriverOutput::Report(Report::Alive { device }));
        }
    }

    pub(super) fn lose(&mut self, now: Timestamp) {
        if let Some(announced) = self.reboot_announced
            && self.is_booting
            && now.since(announced) < REBOOT_TAKES_AT_MOST
        {
            self.timers.set(Timer::Lost, announced + REBOOT_TAKES_AT_MOST);
            return;
        }
        // One that is gone before it was known has been there all the same, and another may take its place.
        if let Some(device) = self.device {
            self.report_alive(device);
        }
        self.forget_conversation();
        self.outputs.push_back(DriverOutput::Report(Report::Lost));
    }

    pub(super) fn forget_conversation(&mut self) {
        self.is_alive = false;
        self.is_reported = false;
        self.is_booting = false;
        self.is_present = false;
        self.reboot_announced = None;
        self.mount.handle_lost();
        self.mode_change = None;
        self.is_retracted = false;
        self.is_handed_over = false;
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
        let was_running = self.is_present && !self.is_booting;
        self.heard.status = Some((now, status));
        // What it was told since it is heard again, to stop and stay, was told to one that hangs without motors.
        if status.activity.contains(Activity::STARTING_UP) && !std::mem::replace(&mut self.is_start_told, true) {
            self.outputs.push_back(DriverOutput::Report(Report::Restarted));
            self.mount.handle_lost();
        }
        if status.activity.contains(Activity::STARTING_UP) {
            self.forget_rotation();
        }
        if was_running && status.activity.contains(Activity::STARTING_UP) {
            self.restart(now, device);
            self.heard.status = Some((now, status));
        }
        if status.is_aligned() {
            self.aligned_since.get_or_insert(now);
            self.faults.clear(|fault| matches!(fault, Fault::NotAligned(_)));
        }
        self.faults.clear(|fault| *fault == Fault::NoStatus);
        for short in self.faults.handle_status(status) {
            self.warn(short);
        }
        if status.motors_on() {
            self.faults.clear(|fault| matches!(fault, Fault::MotorsOff | Fault::StaysRetracted));
            self.mount.handle_shown_mode(operations::shown_mode(status));
        }
        self.handle_shown(status);
    }

    pub(super) fn handle_boot_ms(&mut self, now: Timestamp, device: MavId, boot_ms: u32) {
        let before = self.heard.boot_ms.replace(boot_ms);
        let is_back = before.is_some_and(|before| before.wrapping_sub(boot_ms) > REBOOT_STEP_MS && boot_ms < before);
        if is_back && self.is_present {
            self.restart(now, device);
            self.heard.boot_ms = Some(boot_ms);
        }
    }

    pub(super) fn tick(&mut self, now: Timestamp, device: MavId) {
        self.timers.set(Timer::Tick, now + TICK);
        if self.is_booting {
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
            Some((_, status)) if waited >= READY_WITHIN && !status.is_aligned() => {
                self.raise(Fault::NotAligned(status.alignment));
            }
            _ => {}
        }
        if self.mount.is_unanswered(now) {
            self.raise(Fault::NoAnswers);
        }
    }
}
