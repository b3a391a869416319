//! Stopping a Gremsy that speaks v2, which answers no setpoint: zeros until it has stopped. One that speaks v1 acknowledges
//! its zeros, which are sent elsewhere; a copy of an older answer looks the same, so it is watched here as well.

use std::time::Duration;

use crate::gimbals::rest_watch::{Look, RestWatch};
use crate::gimbals::setpoint::{Setpoint, Turning};
use crate::gimbals::told_rates::ToldRates;
use crate::timestamp::Timestamp;

const EVERY: Duration = Duration::from_millis(100);
/// While it is not there, which it may be all the same.
const EVERY_UNHEARD: Duration = Duration::from_secs(1);
/// What else it is told counts for so long, unless it is told again: it is repeated several times as often.
const REPLACED_FOR: Duration = Duration::from_secs(1);

/// A rotation that is being stopped.
#[derive(Clone, Copy, Debug)]
pub struct Stopping {
    turning: Turning,
    watch: RestWatch,
    /// Up to here it is told something else than zeros, which stops it as well.
    replaced_until: Timestamp,
    /// It answers as well, and its zeros are sent elsewhere.
    answers: bool,
    next: Timestamp,
}

impl Stopping {
    /// The first zero is due at once; `told_look` is when it last told where it looks.
    pub fn new(now: Timestamp, turning: Turning, told: ToldRates, told_look: Option<Timestamp>) -> Self {
        let watch = RestWatch::new(now, turning.yaw_frame, told, told_look);
        Self { turning, watch, replaced_until: now, answers: false, next: now }
    }

    /// One that was told to turn by somebody else.
    pub fn of_unknown(now: Timestamp) -> Self {
        Self::new(now, Turning::STOPPED, ToldRates::ANY, None)
    }

    /// One that answers what it is told, and is told to stop elsewhere.
    pub fn watching(now: Timestamp, turning: Turning, told: ToldRates, told_look: Option<Timestamp>) -> Self {
        let stopping = Self::new(now, turning, told, told_look);
        Self { watch: stopping.watch.of_one_that_answers(), answers: true, ..stopping }
    }

    /// Something else is told it in the place of its rotation. When that is not repeated, by whoever and for whatever reason,
    /// zeros go on.
    pub fn replace(&mut self, now: Timestamp) {
        self.replaced_until = now + REPLACED_FOR;
    }

    /// Nothing is told it any more but zeros.
    pub fn go_on(&mut self, now: Timestamp) {
        if self.replaced_until > now {
            (self.replaced_until, self.next) = (now, now);
        }
    }

    /// A zero was sent to a gimbal that is there or not.
    pub fn handle_sent(&mut self, now: Timestamp, is_there: bool) {
        self.next = now + if is_there { EVERY } else { EVERY_UNHEARD };
    }

    /// It said something.
    pub fn handle_heard(&mut self, now: Timestamp) {
        self.watch.handle_heard(now);
        self.next = self.next.min(now + EVERY);
    }

    /// It tells where it looks; true where it tells that it turns on.
    pub fn handle_report(&mut self, now: Timestamp, look: Look) -> bool {
        self.watch.handle_report(now, look)
    }

    /// The zero that is due.
    pub fn handle_timeout(&mut self, now: Timestamp, is_there: bool) -> Option<Setpoint> {
        if self.poll_timeout().is_none_or(|due| now < due) {
            return None;
        }
        self.handle_sent(now, is_there);
        Some(Setpoint::Turn(self.turning.stopped()))
    }

    /// It was heard for long enough, and looked at where it tells where it looks.
    pub fn is_over(&self, now: Timestamp) -> bool {
        self.watch.is_over(now)
    }

    pub fn poll_timeout(&self) -> Option<Timestamp> {
        Some(self.next.max(self.replaced_until)).filter(|_| !self.answers)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What it was told in the place of its rotation is said no more, by whoever and for whatever reason.
    #[test]
    fn zeros_go_on_when_nothing_takes_their_place_any_more() {
        let (now, told) = (Timestamp::ZERO, ToldRates::default());
        let mut stopping = Stopping::new(now, Turning::STOPPED, told, Some(now));
        let mut zeros = Vec::new();
        for millis in (0..6_000).step_by(50) {
            let now = Timestamp::from_millis(millis);
            if (1_000..2_000).contains(&millis) {
                stopping.handle_heard(now);
                stopping.replace(now);
            }
            if stopping.poll_timeout().is_some_and(|due| due <= now) {
                zeros.extend(stopping.handle_timeout(now, false).map(|_| millis));
            }
        }
        assert_eq!(zeros, [0, 2_950, 3_950, 4_950, 5_950]);
    }
}
