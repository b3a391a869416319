//! Whether a gimbal that was told to stop has stopped, where it does not answer that: it was heard for a second, and does not
//! tell that it turns on. What it says may arrive while what it is told does not.

use std::time::Duration;

use super::heard_time::HeardTime;
use super::told_rates::ToldRates;
use crate::geometry::{Angle, Yaw, YawFrame};
use crate::timestamp::Timestamp;

const LASTS: Duration = Duration::from_secs(1);

/// One that told where it looks not longer ago tells it again, and two looks so far apart are not compared: meanwhile it may
/// have turned round.
pub const LOOKS_AGAIN_WITHIN: Duration = Duration::from_secs(3);

/// One that rests does so from the nose or over ground, but for this.
const RESTS_DPS: f64 = 0.5;
/// What seems to turn for longer, although it is told to stop, may do so for another reason, such as its vehicle.
const MAY_TURN_ON_FOR: Duration = Duration::from_secs(10);

/// Its own rotation is told from its vehicle's by what both come to in so long: the heading may come twice a second only.
const JUDGED_OVER: Duration = Duration::from_secs(8);

/// Where it looks.
#[derive(Clone, Copy, Debug)]
pub struct Look {
    pub roll: Angle,
    pub pitch: Angle,
    pub yaw: Yaw,
    /// The vehicle's heading, where it is known.
    pub heading: Option<Angle>,
}

impl Look {
    fn yaw_in(self, frame: YawFrame) -> Option<Angle> {
        match (self.yaw, self.heading) {
            (yaw, _) if yaw.frame() == frame => Some(yaw.angle()),
            (Yaw::InVehicleFrame(yaw), heading) => heading.map(|heading| yaw + heading),
            (Yaw::InEarthFrame(yaw), heading) => heading.map(|heading| yaw - heading),
        }
    }
}

/// How far it has turned since a moment, degrees; yaw is `None` in a frame that was not known all the time.
#[derive(Clone, Copy, Debug)]
struct Turned {
    since: Timestamp,
    rolled: f64,
    pitched: f64,
    from_nose: Option<f64>,
    over_ground: Option<f64>,
}

impl Turned {
    const fn new(since: Timestamp) -> Self {
        Self { since, rolled: 0.0, pitched: 0.0, from_nose: Some(0.0), over_ground: Some(0.0) }
    }

    fn add(&mut self, [rolled, pitched]: [f64; 2], from_nose: Option<f64>, over_ground: Option<f64>) {
        self.rolled += rolled;
        self.pitched += pitched;
        let sum = |before: Option<f64>, more: Option<f64>| Some(before? + more?);
        self.from_nose = sum(self.from_nose, from_nose);
        self.over_ground = sum(self.over_ground, over_ground);
    }
}

/// One that was told to stop, and is watched.
#[derive(Clone, Copy, Debug)]
pub struct RestWatch {
    /// What its yaw was told to turn from.
    yaw_frame: YawFrame,
    told: ToldRates,
    /// It answers as well, so only what is certain counts.
    answers: bool,
    heard: HeardTime,
    /// For how long it was heard since it began.
    heard_at_all: HeardTime,
    /// Where it looked, and when.
    looked: Option<(Timestamp, Look)>,
    /// When it told where it looks, before this began as well.
    told_look: Option<Timestamp>,
    /// When two looks did not tell that it turns on, since they last did.
    seemed_to_rest: Option<Timestamp>,
    turned: Turned,
    /// It went on and on when that was last judged, and yaw from the nose and over ground: one that rests does so in one of them,
    /// and one that sways comes back.
    turns_by_itself: bool,
}

impl RestWatch {
    /// From `now` on it is told to stop, or something else; `told_look` is when it last told where it looks.
    pub const fn new(now: Timestamp, yaw_frame: YawFrame, told: ToldRates, told_look: Option<Timestamp>) -> Self {
        Self {
            yaw_frame,
            told,
            answers: false,
            heard: HeardTime::new(now),
            heard_at_all: HeardTime::new(now),
            looked: None,
            told_look,
            seemed_to_rest: None,
            turned: Turned::new(now),
            turns_by_itself: false,
        }
    }

    /// Of one that answers what it is told.
    pub const fn of_one_that_answers(self) -> Self {
        Self { answers: true, ..self }
    }

    /// What it was told until now does not count.
    pub const fn begin_anew(&mut self, now: Timestamp) {
        self.heard = HeardTime::new(now);
    }

    /// It said something.
    pub fn handle_heard(&mut self, now: Timestamp) {
        self.heard.handle_heard(now);
        self.heard_at_all.handle_heard(now);
    }

    /// It tells where it looks; true where it tells that it turns on.
    pub fn handle_report(&mut self, now: Timestamp, look: Look) -> bool {
        self.told_look = Some(now);
        let is_like = |(at, before): &(Timestamp, Look)| {
            before.yaw.frame() == look.yaw.frame() && now.since(*at) <= LOOKS_AGAIN_WITHIN
        };
        let Some((at, before)) = self.looked.filter(is_like) else {
            self.looked = Some((now, look));
            self.turned = Turned::new(now);
            return false;
        };
        let passed = now.since(at);
        if passed < self.told.looks_apart() {
            return false;
        }
        self.looked = Some((now, look));
        if self.turned.over_ground.is_none() && before.heading.is_some() {
            // It is judged by both frames, and one of them was not known at first.
            self.turned = Turned::new(at);
        }
        let turned = |frame| Some((look.yaw_in(frame)? - before.yaw_in(frame)?).wrapped().degrees());
        let (from_nose, over_ground) = (turned(YawFrame::Vehicle), turned(YawFrame::Earth));
        let pitched = (look.pitch - before.pitch).degrees();
        let rolled = (look.roll - before.roll).wrapped().degrees();
        self.turned.add([rolled, pitched], from_nose, over_ground);
        self.judge(now);
        let yawed = match self.yaw_frame {
            YawFrame::Vehicle => from_nose.or(over_ground),
            YawFrame::Earth => over_ground.or(from_nose),
        };
        let may_yaw = yawed.is_some_and(|yawed| self.told.yaw.is_as_told(yawed, passed));
        let in_both =
            || [from_nose, over_ground].into_iter().all(|yawed| yawed.is_some_and(|yawed| moves(yawed, passed)));
        let seems_to = self.told.pitch.is_as_told(pitched, passed)
            || self.told.roll.is_as_told(rolled, passed)
            || may_yaw && (!self.answers || in_both());
        let turns_on = seems_to && self.may_turn_on();
        if turns_on {
            self.heard = HeardTime::new(now);
        }
        self.seemed_to_rest = Some(now).filter(|_| !turns_on);
        turns_on
    }

    fn may_turn_on(&self) -> bool {
        self.turns_by_itself || self.heard_at_all.passed() < MAY_TURN_ON_FOR
    }

    fn judge(&mut self, now: Timestamp) {
        let passed = now.since(self.turned.since);
        if passed >= JUDGED_OVER {
            let turned = std::mem::replace(&mut self.turned, Turned::new(now));
            let yaws = |yawed: Option<f64>| yawed.is_some_and(|yawed| self.told.yaw.is_as_told(yawed, passed));
            self.turns_by_itself = self.told.pitch.is_as_told(turned.pitched, passed)
                || self.told.roll.is_as_told(turned.rolled, passed)
                || yaws(turned.from_nose) && yaws(turned.over_ground);
        }
    }

    /// It was heard for long enough, and looked at where it tells where it looks.
    pub fn is_over(&self, now: Timestamp) -> bool {
        let is_fresh = |at: Option<Timestamp>| at.is_some_and(|at| now.since(at) <= LOOKS_AGAIN_WITHIN);
        let is_looked_at = is_fresh(self.seemed_to_rest) || !is_fresh(self.told_look) || !self.may_turn_on();
        self.heard.passed() >= LASTS && is_looked_at
    }
}

/// Whether what turned by so many degrees in a time moves.
fn moves(turned: f64, passed: Duration) -> bool {
    turned.abs() / passed.as_secs_f64() >= RESTS_DPS
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::AngularRate;
    use crate::gimbals::setpoint::Turning;

    fn begin(turning: Turning) -> RestWatch {
        let mut told = ToldRates::default();
        told.add(turning);
        RestWatch::new(Timestamp::ZERO, turning.yaw_frame, told, Some(Timestamp::ZERO))
    }

    /// When it is over, in milliseconds; reports come twenty times a second.
    fn stopped_after(told_dps: f64, yaw_at: impl Fn(f64) -> f64) -> Option<u64> {
        let turning = Turning { yaw: AngularRate::from_degrees_per_second(told_dps), ..Turning::STOPPED };
        let mut watch = begin(turning);
        (50..=20_000).step_by(50).find(|millis| {
            let now = Timestamp::from_millis(*millis);
            watch.handle_heard(now);
            let yaw = Angle::from_degrees(yaw_at(*millis as f64 / 1000.0));
            watch.handle_report(
                now,
                Look { roll: Angle::ZERO, pitch: Angle::ZERO, yaw: Yaw::InVehicleFrame(yaw), heading: None },
            );
            watch.is_over(now)
        })
    }

    /// When one is over that was told to turn to the right by 5 degrees per second and does so for as long as is given, and
    /// whose vehicle turns.
    fn stopped_over_ground(reports: YawFrame, vehicle_dps: f64, turns_for: f64) -> Option<u64> {
        let turning = Turning { yaw: AngularRate::from_degrees_per_second(5.0), ..Turning::STOPPED };
        let mut watch = begin(turning);
        (50..=60_000).step_by(50).find(|millis| {
            let (now, seconds) = (Timestamp::from_millis(*millis), *millis as f64 / 1000.0);
            watch.handle_heard(now);
            // It comes twice a second.
            let heading = Angle::from_degrees(vehicle_dps * (seconds * 2.0).floor() / 2.0).wrapped();
            // Once stopped, it keeps its direction over ground.
            let turned = 5.0 * seconds.min(turns_for);
            let yaw = match reports {
                YawFrame::Earth => Yaw::InEarthFrame(Angle::from_degrees(turned).wrapped()),
                YawFrame::Vehicle => Yaw::InVehicleFrame(Angle::from_degrees(turned - vehicle_dps * seconds).wrapped()),
            };
            watch.handle_report(now, Look { roll: Angle::ZERO, pitch: Angle::ZERO, yaw, heading: Some(heading) });
            watch.is_over(now)
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
        // Slower than it was told: that is all it can.
        assert!(stopped_after(60.0, |seconds| 4.0 * seconds.min(3.0)).is_some_and(|millis| millis >= 3_900));
        let slowly = |seconds: f64| 1.2 * seconds.min(4.0);
        assert!(stopped_after(1.2, slowly).is_some_and(|millis| (4_000..=5_200).contains(&millis)));
        assert_eq!(stopped_after(0.5, |seconds| 0.5 * seconds), Some(1_000), "it creeps");
        let gust = |seconds: f64| 0.3 * (seconds * std::f64::consts::PI).sin();
        assert_eq!(stopped_after(0.3, gust), Some(1_000));
    }

    /// When one is over that was told to turn by 2 degrees per second and does so for as long as is given, which says something
    /// all the time, and so often where it looks.
    fn stopped_by_looks(every_ms: u64, turns_for: f64) -> Option<u64> {
        let turning = Turning { yaw: AngularRate::from_degrees_per_second(2.0), ..Turning::STOPPED };
        let mut watch = begin(turning);
        (50..=60_000).step_by(50).find(|millis| {
            let now = Timestamp::from_millis(*millis);
            watch.handle_heard(now);
            if millis.is_multiple_of(every_ms) {
                let yaw = Yaw::InVehicleFrame(Angle::from_degrees(2.0 * (*millis as f64 / 1000.0).min(turns_for)));
                watch.handle_report(now, Look { roll: Angle::ZERO, pitch: Angle::ZERO, yaw, heading: None });
            }
            watch.is_over(now)
        })
    }

    /// Somebody may have asked for fewer reports of where it looks: it has not stopped before two of them say so.
    #[test]
    #[rustfmt::skip]
    fn it_has_not_stopped_before_it_was_looked_at() {
        for (every_ms, turns_for, over) in [
            (200,      0.0,       1_000),
            (500,      0.0,       1_500),
            (1_000,    0.0,       2_000),
            (2_000,    0.0,       4_000),
            (200,      3.1,       4_400),
            (500,      3.1,       4_500),
            (1_000,    3.1,       4_000),
            (2_000,    3.1,       6_000),
            (1_000,    8.0,       9_000),
        ] {
            assert_eq!(stopped_by_looks(every_ms, turns_for), Some(over), "every {every_ms} ms, {turns_for} s");
        }
        // One that tells it no more is not waited for for ever, and one that never did not at all.
        assert_eq!(stopped_by_looks(1_000_000, 0.0), Some(3_050));
        let mut watch = RestWatch { told_look: None, ..begin(Turning::STOPPED) };
        let over = (50..5_000).step_by(50).find(|millis| {
            watch.handle_heard(Timestamp::from_millis(*millis));
            watch.is_over(Timestamp::from_millis(*millis))
        });
        assert_eq!(over, Some(1_000));
    }

    /// Nothing waits for ever for one that is turned by something else.
    #[test]
    fn what_turns_on_for_long_is_not_waited_for() {
        assert!(stopped_after(5.0, |seconds| 5.0 * seconds).is_some_and(|millis| (10_700..=11_200).contains(&millis)));
    }

    /// A camera that sways comes back, and is not waited for for ever.
    #[test]
    fn one_that_sways_has_stopped_in_the_end() {
        let sways = |millis: u64| 1.5 * (millis as f64 / 1000.0 * 5.0).sin();
        for answers in [false, true] {
            let pitch = AngularRate::from_degrees_per_second(5.0);
            let mut watch = RestWatch { answers, ..begin(Turning { pitch, ..Turning::STOPPED }) };
            let over = (50..=60_000_u64).step_by(50).find(|millis| {
                let now = Timestamp::from_millis(*millis);
                watch.handle_heard(now);
                let (pitch, yaw) = (Angle::from_degrees(sways(*millis)), Yaw::InVehicleFrame(Angle::ZERO));
                watch.handle_report(now, Look { roll: Angle::ZERO, pitch, yaw, heading: None });
                watch.is_over(now)
            });
            assert!(over.is_some_and(|millis| millis <= 12_000), "{answers} {over:?}");
        }
    }

    /// Roll turns on like the others, and no vehicle does that.
    #[test]
    fn a_roll_that_turns_on_is_told_to_stop_until_it_does() {
        let told = AngularRate::from_degrees_per_second(-5.0);
        let mut watch = begin(Turning { roll: Some(told), ..Turning::STOPPED });
        let over = (50..=60_000_u64).step_by(50).find(|millis| {
            let (now, seconds) = (Timestamp::from_millis(*millis), *millis as f64 / 1000.0);
            watch.handle_heard(now);
            let roll = Angle::from_degrees(-5.0 * seconds.min(20.0));
            let yaw = Yaw::InVehicleFrame(Angle::ZERO);
            watch.handle_report(now, Look { roll, pitch: Angle::ZERO, yaw, heading: None });
            watch.is_over(now)
        });
        assert!(over.is_some_and(|millis| (20_700..=21_300).contains(&millis)), "{over:?}");
    }

    /// Where it is known how the vehicle turns, a rotation is told from one of the vehicle, and is stopped however long
    /// nothing arrives.
    #[test]
    fn what_turns_from_the_nose_and_over_ground_is_told_to_stop_until_it_does() {
        for reports in [YawFrame::Vehicle, YawFrame::Earth] {
            for vehicle_dps in [-4.0, 0.0, 2.0] {
                let over = stopped_over_ground(reports, vehicle_dps, 40.0);
                assert!(over.is_some_and(|millis| millis >= 40_700), "{reports:?} {vehicle_dps} {over:?}");
            }
            // Stopped, with a vehicle that makes it look as if it turned from the nose.
            let over = stopped_over_ground(reports, -5.0, 0.0);
            assert!(over.is_some_and(|millis| (10_400..=11_500).contains(&millis)), "{reports:?} {over:?}");
            assert_eq!(stopped_over_ground(reports, 5.0, 0.0), Some(1_000), "{reports:?}");
        }
    }
}
