//! Stopping a Gremsy that speaks v2, which answers no setpoint: zeros for a second in which it is heard, and does not tell
//! that it turns on. What it says may arrive while what it is told does not.

use std::time::Duration;

use crate::geometry::{Angle, Yaw};
use crate::gimbals::heard_time::HeardTime;
use crate::gimbals::setpoint::{Setpoint, Turning};
use crate::timestamp::Timestamp;

const EVERY: Duration = Duration::from_millis(100);
/// While it is not there, which it may be all the same.
const EVERY_UNHEARD: Duration = Duration::from_secs(1);
const LASTS: Duration = Duration::from_secs(1);

/// How it turns is taken from where it looked so long before …
const TURNS_WITHIN: Duration = Duration::from_millis(250);
/// … and it turns on when that is so much of what it was told, and not slower than it may creep at rest, degrees per second.
const TURNS_ON: f64 = 0.5;
const CREEPS_DPS: f64 = 1.0;
/// What turns for longer, although it is told to stop, does so for another reason, such as its vehicle.
const MAY_TURN_ON_FOR: Duration = Duration::from_secs(10);

/// A rotation that is being stopped.
#[derive(Clone, Copy, Debug)]
pub struct Stopping {
    turning: Turning,
    next: Timestamp,
    heard: HeardTime,
    begun: Timestamp,
    /// Where it looked, and when.
    looked: Option<(Timestamp, Angle, Yaw)>,
}

impl Stopping {
    /// The first zero is due at once.
    pub fn new(now: Timestamp, turning: Turning) -> Self {
        Self { turning, next: now, heard: HeardTime::new(now), begun: now, looked: None }
    }

    /// A zero was sent to a gimbal that is there or not.
    pub fn handle_sent(&mut self, now: Timestamp, is_there: bool) {
        self.next = now + if is_there { EVERY } else { EVERY_UNHEARD };
    }

    /// It said something.
    pub fn handle_heard(&mut self, now: Timestamp) {
        self.heard.handle_heard(now);
        self.next = self.next.min(now + EVERY);
    }

    /// It tells where it looks.
    pub fn handle_report(&mut self, now: Timestamp, pitch: Angle, yaw: Yaw) {
        let Some((at, pitch_before, yaw_before)) = self.looked.filter(|(_, _, before)| before.frame() == yaw.frame())
        else {
            self.looked = Some((now, pitch, yaw));
            return;
        };
        let passed = now.since(at);
        if passed < TURNS_WITHIN {
            return;
        }
        self.looked = Some((now, pitch, yaw));
        let turned = [pitch - pitch_before, (yaw.angle() - yaw_before.angle()).wrapped()];
        let turns_on = turned.into_iter().zip([self.turning.pitch, self.turning.yaw]).any(|(turned, told)| {
            let told = told.degrees_per_second();
            let rate = turned.degrees() / passed.as_secs_f64() * told.signum();
            told != 0.0 && rate >= CREEPS_DPS.max(told.abs() * TURNS_ON)
        });
        if turns_on && now.since(self.begun) < MAY_TURN_ON_FOR {
            self.heard = HeardTime::new(now);
        }
    }

    /// The zero that is due.
    pub fn handle_timeout(&mut self, now: Timestamp, is_there: bool) -> Option<Setpoint> {
        if now < self.next {
            return None;
        }
        self.handle_sent(now, is_there);
        Some(Setpoint::Turn(self.turning.stopped()))
    }

    pub fn is_over(&self) -> bool {
        self.heard.passed() >= LASTS
    }

    pub const fn poll_timeout(&self) -> Timestamp {
        self.next
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::AngularRate;

    /// When it is over, in milliseconds; reports come twenty times a second and every zero is sent.
    fn stopped_after(told_dps: f64, yaw_at: impl Fn(f64) -> f64) -> Option<u64> {
        let turning = Turning { yaw: AngularRate::from_degrees_per_second(told_dps), ..Turning::STOPPED };
        let mut stopping = Stopping::new(Timestamp::ZERO, turning);
        (50..=20_000).step_by(50).find(|millis| {
            let now = Timestamp::from_millis(*millis);
            stopping.handle_timeout(now, true);
            stopping.handle_heard(now);
            let yaw = Angle::from_degrees(yaw_at(*millis as f64 / 1000.0));
            stopping.handle_report(now, Angle::ZERO, Yaw::InVehicleFrame(yaw));
            stopping.is_over()
        })
    }

    /// D7: "a gimbal that keeps turning after its operator is gone": its own word that it turns weighs more than that the
    /// line is up in one direction.
    #[test]
    fn it_has_stopped_when_it_was_heard_for_a_second_and_did_not_turn_on() {
        assert_eq!(stopped_after(5.0, |_| 0.0), Some(1_000));
        // Three seconds in which no zero arrives.
        let turns_on = |seconds: f64| 5.0 * seconds.min(3.0);
        assert!(stopped_after(5.0, turns_on).is_some_and(|millis| (3_900..=4_200).contains(&millis)));
        assert!(stopped_after(-5.0, |seconds| -turns_on(seconds)).is_some_and(|millis| millis >= 3_900));
        assert_eq!(stopped_after(-5.0, turns_on), Some(1_000), "that is no rotation that it was told");
        assert_eq!(stopped_after(0.5, |seconds| 0.5 * seconds), Some(1_000), "it creeps");
    }

    /// Nothing waits for ever for one that is turned by something else.
    #[test]
    fn what_turns_on_for_long_is_not_waited_for() {
        assert!(stopped_after(5.0, |seconds| 5.0 * seconds).is_some_and(|millis| (10_700..=11_200).contains(&millis)));
    }
}
