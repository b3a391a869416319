//! Whether a Gremsy that speaks v1 may be turning at a rate that it was told.
//!
//! It goes on at the last rate until another order reaches it, so a rotation has ended only when the gimbal has answered an
//! order that was sent after the rate. An answer does not say which order it is for; they come in the order of what they
//! answer, so those that may still be on their way are counted off first.

use std::collections::VecDeque;
use std::time::Duration;

use crate::timestamp::Timestamp;

/// What is not answered by then is not answered any more. On a full line answers come more than a second late.
const ANSWERED_WITHIN: Duration = Duration::from_secs(2);

#[derive(Debug, Default)]
pub struct Rotation {
    may_turn: bool,
    /// When those orders were sent that may still be answered: at most 25 a second.
    unanswered: VecDeque<Timestamp>,
    /// So many answers from now one belongs to an order that took the place of the rate.
    answers_left: Option<usize>,
}

impl Rotation {
    /// An order was sent, a rate or what takes its place.
    pub fn handle_sent(&mut self, now: Timestamp, turns: bool) {
        while self.unanswered.front().is_some_and(|sent| now.since(*sent) > ANSWERED_WITHIN) {
            self.unanswered.pop_front();
        }
        if turns {
            self.may_turn = true;
            self.answers_left = None;
        } else if self.may_turn {
            self.answers_left.get_or_insert(self.unanswered.len() + 1);
        }
        self.unanswered.push_back(now);
    }

    /// An order was answered. One that the gimbal refused has not stopped it.
    pub fn handle_answer(&mut self, is_accepted: bool) {
        self.unanswered.pop_front();
        match &mut self.answers_left {
            Some(1) if is_accepted => {
                *self = Self { unanswered: std::mem::take(&mut self.unanswered), ..Self::default() }
            }
            Some(left) if *left > 1 => *left -= 1,
            _ => {}
        }
    }

    /// It may turn as nobody knows whom told it.
    pub fn assume(&mut self) {
        self.may_turn = true;
    }

    pub fn may_turn(&self) -> bool {
        self.may_turn
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(millis: u64) -> Timestamp {
        Timestamp::from_millis(millis)
    }

    #[test]
    fn it_has_stopped_when_an_order_after_the_rate_was_answered() {
        let mut rotation = Rotation::default();
        rotation.handle_sent(at(0), false);
        assert!(!rotation.may_turn());
        rotation.handle_sent(at(100), true);
        rotation.handle_answer(true);
        rotation.handle_answer(true);
        assert!(rotation.may_turn(), "these are for the rate, and for what was before it");
        rotation.handle_sent(at(200), false);
        rotation.handle_answer(false);
        assert!(rotation.may_turn(), "it refused to stop");
        rotation.handle_sent(at(300), false);
        rotation.handle_answer(true);
        assert!(!rotation.may_turn());
    }

    #[test]
    fn an_answer_that_may_be_for_the_rate_does_not_count() {
        let mut rotation = Rotation::default();
        rotation.handle_sent(at(100), true);
        rotation.handle_sent(at(150), true);
        // This one is lost.
        rotation.handle_sent(at(160), false);
        rotation.handle_answer(true);
        rotation.handle_answer(true);
        assert!(rotation.may_turn());
        rotation.handle_sent(at(260), false);
        rotation.handle_answer(true);
        assert!(!rotation.may_turn());
        // What was never answered is not waited for.
        rotation.handle_sent(at(1_000), true);
        rotation.handle_sent(at(3_001), false);
        rotation.handle_answer(true);
        assert!(!rotation.may_turn());
    }

    #[test]
    fn late_answers_to_the_rate_are_none_to_a_stop_that_was_lost() {
        let late = 1_200;
        let mut rotation = Rotation::default();
        for millis in (0..5_000).step_by(100) {
            // Of the zeros, which begin at 3 s, those of the first second are lost.
            rotation.handle_sent(at(millis), millis < 3_000);
            let answered = millis.checked_sub(late).filter(|sent| !(3_000..4_000).contains(sent));
            if answered.is_some() {
                rotation.handle_answer(true);
            }
            assert!(rotation.may_turn() || millis >= 4_000 + late, "at {millis}");
        }
        for _ in 0..20 {
            rotation.handle_answer(true);
        }
        assert!(!rotation.may_turn());
    }
}
