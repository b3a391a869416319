//! Whether the autopilot has a gimbal manager of its own, where it would not show.
//!
//! What an autopilot says to a gimbal on a link of ours we see. A gimbal behind the autopilot it may steer past us, and
//! ArduPilot says nothing of its mounts unasked: so we ask, as any client would.

use std::time::Duration;

use super::Bridge;
use super::transactions::{Asker, Order};
use crate::gimbals::mavlink_v2::packet;
use crate::timestamp::Timestamp;
use crate::wire::Frame;
use crate::wire::ids::{command, message};

/// Often enough that what is shown of a rival does not end meanwhile.
const ASK_EVERY: Duration = Duration::from_secs(20);

/// "After an ACCEPTED ACK the message must come within 1 s" (client notes A3).
const ANSWER_WITHIN: Duration = Duration::from_secs(1);

/// When the autopilot was asked, and whether it has answered.
#[derive(Debug, Default)]
pub struct RivalWatch {
    asked: Option<Timestamp>,
    is_answered: bool,
}

impl RivalWatch {
    fn is_due(&self, now: Timestamp) -> bool {
        self.asked.is_none_or(|asked| now.since(asked) >= ASK_EVERY)
    }

    fn note_asked(&mut self, now: Timestamp) {
        (self.asked, self.is_answered) = (Some(now), false);
    }

    /// Whether a 280 of the autopilot is the answer to our question; the next one is somebody else's.
    fn take_answer(&mut self, now: Timestamp) -> bool {
        let is_ours = !self.is_answered && self.asked.is_some_and(|asked| now.since(asked) <= ANSWER_WITHIN);
        self.is_answered |= is_ours;
        is_ours
    }
}

impl Bridge {
    /// Once a second: asks an autopilot for 280 that has a gimbal of ours at its end of the line.
    pub(super) fn watch_for_rivals(&mut self, now: Timestamp) {
        let Some(autopilot) = self.autopilot.filter(|_| self.vehicle.alive(now)) else { return };
        let at_its_end = self.router.routes().component_channels(autopilot);
        let has_one =
            self.roster.iter().any(|gimbal| gimbal.channel.is_some_and(|channel| at_its_end.contains(channel)));
        if !has_one || !self.watch.is_due(now) || !self.transactions.is_free(autopilot, command::REQUEST_MESSAGE) {
            return;
        }
        self.watch.note_asked(now);
        let manager = self.roster.get_mut(0).component;
        let command = packet::request_of(autopilot, message::GIMBAL_MANAGER_INFORMATION);
        self.transactions.send(now, Order { asker: Asker::RivalWatch, manager, command });
        self.carry_out_own_commands(now);
    }

    /// Whether a frame is the autopilot's answer to us, which clients did not ask for.
    pub(super) fn is_answer_to_our_watch(&mut self, now: Timestamp, frame: &Frame<'_>) -> bool {
        frame.message_id() == message::GIMBAL_MANAGER_INFORMATION
            && self.autopilot == Some(frame.source())
            && self.watch.take_answer(now)
    }
}
