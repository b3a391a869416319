//! Who has the gimbal: the one who demands, or the gimbal's own radio control (`RC_EXCLUSIVE`, A-54).
//!
//! A client hands the gimbal over by a demand with that flag, and anybody who passes the gate takes it back by one without.
//! When radio control has it without our doing, demands are refused and nothing is sent.

use std::time::Duration;

use super::situation::Situation;
use super::{Aim, Point, Tracking};
use crate::gimbals::setpoint::RadioControl;
use crate::manager::request::Refusal;
use crate::timestamp::Timestamp;

/// So long after radio control was asked to let go of the gimbal, the gimbal may still say that it has it.
const LETTING_GO: Duration = Duration::from_secs(1);

impl Tracking {
    /// Whether the gimbal is in the hands of its radio control, apart from the time in which that lets go.
    pub(super) fn is_radio_controlled(&self, now: Timestamp, situation: &Situation<'_>) -> bool {
        let letting_go = self.let_go.is_some_and(|at| now.since(at) < LETTING_GO);
        situation.radio_control_has_it() && !letting_go
    }

    /// Whether it is, or is to be, in the hands of its radio control because a client asked for that.
    pub fn is_handed_over(&self) -> bool {
        hands_over(&self.aim) || self.left_to_radio_control
    }

    /// The gimbal was left to its radio control, until somebody demands something.
    pub fn leave_to_radio_control(&mut self) {
        self.forget();
        self.left_to_radio_control = true;
    }

    /// Whether `aim` may be taken up; with one that takes the gimbal back, radio control begins to let go of it.
    pub(super) fn change_hands(&mut self, now: Timestamp, aim: &Aim, situation: &Situation<'_>) -> Result<(), Refusal> {
        if hands_over(aim) {
            return Ok(());
        }
        if self.is_handed_over() {
            self.let_go = Some(now);
        } else if self.is_radio_controlled(now, situation) {
            return Err(Refusal::later("radio_control_has_it"));
        }
        Ok(())
    }
}

fn hands_over(aim: &Aim) -> bool {
    matches!(aim, Aim::Point(Point { radio_control: RadioControl::Exclusive, .. }))
}
