//! The end of the process: what turns is stopped, then goodbye is said.
//!
//! A word may be lost, and after us nobody repeats it: a gimbal that may be turning is told to stop for as long as the
//! process may take for its end (`daemon/shutdown.rs`), whether it answers or not. What we turn by its angles stands when
//! nothing more is told. Nobody is listened to any more, so nothing is asked again.

use std::time::Duration;

use super::{Bridge, heartbeat};
use crate::timestamp::Timestamp;

/// What may be turning is told to stop so often …
const STOP_EVERY: Duration = Duration::from_millis(80);
/// … and the last time after so long; what waits for a slow line still leaves.
const LAST_STOP_AFTER: Duration = Duration::from_millis(400);

/// What is still to be done when the end was asked for.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stopping {
    /// By place in the roster, who may be turning.
    turning: u64,
    next: Timestamp,
    last: Timestamp,
}

impl Bridge {
    pub(super) fn shut_down(&mut self, now: Timestamp) {
        if self.shutting_down {
            return;
        }
        self.channels.keep_control();
        self.channels.lift_limits();
        let mut turning = 0;
        for (at, gimbal) in self.roster.iter().enumerate() {
            if at < 64 && gimbal.may_be_turning() {
                turning |= 1 << at;
            }
        }
        self.asked.end_all(&mut self.outbox);
        self.shutting_down = true;
        if turning == 0 || self.identity.system().is_none() {
            self.say_goodbye(now);
        } else {
            self.stopping = Some(Stopping { turning, next: now, last: now + LAST_STOP_AFTER });
            self.stop_turning(now);
        }
    }

    /// What is due at the end: nothing is listened to, and nobody is told anything new.
    pub(super) fn handle_ending(&mut self, now: Timestamp) {
        if let Some(Stopping { turning, .. }) = self.stopping {
            for (at, gimbal) in self.roster.iter_mut().enumerate() {
                if is_in(turning, at) {
                    gimbal.driver.handle_timeout(now);
                }
            }
            self.stop_turning(now);
        }
        self.channels.pump_all(now, &mut self.outbox);
    }

    pub(super) fn ending_due(&self) -> Option<Timestamp> {
        let stopping = self.stopping.iter().flat_map(|stopping| {
            let drivers = self.roster.iter().enumerate().filter(|(at, _)| is_in(stopping.turning, *at));
            let drivers = drivers.filter_map(|(_, gimbal)| gimbal.driver.poll_timeout());
            drivers.chain([stopping.next])
        });
        stopping.chain(self.channels.poll_output_timeout()).min()
    }

    /// Whether everything due before the end has been given out.
    pub fn is_finished(&self) -> bool {
        self.shutting_down && self.stopping.is_none() && self.channels.is_drained()
    }

    fn stop_turning(&mut self, now: Timestamp) {
        let Some(stopping) = &mut self.stopping else { return };
        let (turning, is_due, is_last) = (stopping.turning, stopping.next <= now, stopping.last <= now);
        if is_due {
            stopping.next = now + STOP_EVERY;
            for (at, gimbal) in self.roster.iter_mut().enumerate() {
                if is_in(turning, at) {
                    gimbal.manager.stop_at_once();
                }
            }
        }
        self.carry_out(now);
        if is_due && is_last {
            self.stopping = None;
            self.say_goodbye(now);
        }
    }

    /// The goodbye is the last word.
    fn say_goodbye(&mut self, now: Timestamp) {
        self.channels.keep_control();
        if self.identity.system().is_none() {
            return;
        }
        for at in 0..self.roster.len() {
            let gimbal = self.roster.get_mut(at);
            if gimbal.beats() {
                let (component, goodbye) = (gimbal.component, heartbeat::goodbye(gimbal));
                self.send(now, self.channels.open_set(), component, &goodbye);
            }
        }
        self.say_goodbye_as_presented(now);
    }
}

const fn is_in(set: u64, at: usize) -> bool {
    at < 64 && set & 1 << at != 0
}
