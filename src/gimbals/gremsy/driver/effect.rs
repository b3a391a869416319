//! Whether a Gremsy does what it acknowledges.
//!
//! "if the commanded pose differs by > 10° from the report for > 3 s with rate < 1 °/s and not at a limit" (gimbals 1.10) it
//! does not move; and one that moved to the same pitch with the other sign reports it upside down.

use std::time::Duration;

use crate::geometry::{Angle, Yaw};
use crate::timestamp::Timestamp;

const APART: Angle = Angle::from_degrees(10.0);
const APART_FOR: Duration = Duration::from_secs(3);
/// It rests while it turns by no more than this.
const STILL: Angle = Angle::from_degrees(1.0);
const RESTS_AFTER: Duration = Duration::from_secs(1);

/// A pitch is upside down when it is this close to its opposite …
const MIRRORED_WITHIN: Angle = Angle::from_degrees(3.0);
/// … after the gimbal has turned by at least this.
const MOVED: Angle = Angle::from_degrees(5.0);

/// Where it looks, or is to look.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    pub pitch: Angle,
    pub yaw: Yaw,
}

impl Pose {
    /// By no more than one that rests turns.
    fn is_near(self, other: Self) -> bool {
        (self.pitch - other.pitch).abs() <= STILL && yaw_apart(self.yaw, other.yaw).is_some_and(|apart| apart <= STILL)
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Finding {
    /// It is where it was told to be.
    Works,
    NoEffect,
    InvertedPitch,
}

#[derive(Debug, Default)]
pub struct EffectWatch {
    target: Option<Target>,
    /// Where it has rested, and since when.
    rests: Option<(Timestamp, Pose)>,
    apart_since: Option<Timestamp>,
}

#[derive(Clone, Copy, Debug)]
struct Target {
    pose: Pose,
    /// The pitch of a target and of the gimbal when they parted.
    base: Angle,
    from: Option<Angle>,
}

impl EffectWatch {
    /// What it was told; `None` where that is no attitude.
    pub fn handle_target(&mut self, pose: Option<Pose>) {
        let Some(pose) = pose else {
            self.target = None;
            self.apart_since = None;
            return;
        };
        if self.target.is_none_or(|target| !target.pose.is_near(pose)) {
            self.apart_since = None;
        }
        let kept = self.target.filter(|target| (target.base - pose.pitch).abs() < MOVED);
        let from = self.rests.map(|(_, pose)| pose.pitch);
        let (base, from) = kept.map_or((pose.pitch, from), |target| (target.base, target.from));
        self.target = Some(Target { pose, base, from });
    }

    /// Where it looks; at a limit it is as near as it can be.
    pub fn handle_report(&mut self, now: Timestamp, pose: Pose, at_limit: bool) -> Option<Finding> {
        // What is measured from something else than before begins anew.
        if !self.rests.is_some_and(|(_, rest)| rest.is_near(pose)) {
            self.rests = Some((now, pose));
        }
        let Target { pose: wanted, from, .. } = self.target?;
        let rests_for = self.rests.map_or(Duration::ZERO, |(since, _)| now.since(since));
        let pitch_apart = (wanted.pitch - pose.pitch).abs();
        let apart = pitch_apart > APART || yaw_apart(wanted.yaw, pose.yaw).is_some_and(|apart| apart > APART);
        if !apart {
            self.apart_since = None;
            return Some(Finding::Works);
        }
        let since = *self.apart_since.get_or_insert(now);
        let mirrored = (wanted.pitch + pose.pitch).abs() < MIRRORED_WITHIN && pitch_apart > APART;
        let moved = from.is_some_and(|from| (from - pose.pitch).abs() > MOVED);
        if mirrored && moved && rests_for >= RESTS_AFTER {
            self.target = None;
            self.rests = None;
            self.apart_since = None;
            return Some(Finding::InvertedPitch);
        }
        // Its end stops go with the vehicle: at one of them it is as near to a yaw from North as it can be.
        let may_be_at_end = pitch_apart <= APART && matches!(wanted.yaw, Yaw::InEarthFrame(_));
        if at_limit {
            self.apart_since = None;
        }
        let is_stuck = now.since(since) > APART_FOR && rests_for > APART_FOR && !at_limit && !may_be_at_end;
        is_stuck.then_some(Finding::NoEffect)
    }

    /// It cannot move at this moment: what it has not done until now does not count.
    pub fn pause(&mut self) {
        self.apart_since = None;
        self.rests = None;
    }

    pub fn forget(&mut self) {
        *self = Self::default();
    }
}

/// `None` where they are measured from different things.
fn yaw_apart(a: Yaw, b: Yaw) -> Option<Angle> {
    (a.frame() == b.frame()).then(|| (a.angle() - b.angle()).wrapped().abs())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pose(pitch: f64, yaw: f64) -> Pose {
        Pose { pitch: Angle::from_degrees(pitch), yaw: Yaw::InVehicleFrame(Angle::from_degrees(yaw)) }
    }

    /// Reports twenty times a second; when it finds what first, in milliseconds.
    fn watch(target: Pose, at: impl Fn(u64) -> Pose, at_limit: bool) -> Vec<(u64, Finding)> {
        let mut watch = EffectWatch::default();
        let mut found: Vec<(u64, Finding)> = Vec::new();
        watch.handle_report(Timestamp::ZERO, at(0), at_limit);
        for millis in (50..8_000).step_by(50) {
            watch.handle_target((found.len() < 2).then_some(target));
            let finding = watch.handle_report(Timestamp::from_millis(millis), at(millis), at_limit);
            if let Some(finding) = finding
                && found.last().is_none_or(|(_, last)| *last != finding)
            {
                found.push((millis, finding));
            }
        }
        found
    }

    /// Moves at 20°/s.
    fn slew(from: f64, to: f64) -> impl Fn(u64) -> Pose {
        move |millis| {
            let gone = 0.02 * millis as f64;
            pose(if (to - from).abs() <= gone { to } else { from + gone * (to - from).signum() }, 0.0)
        }
    }

    #[test]
    fn a_gimbal_that_moves_works() {
        assert_eq!(watch(pose(-60.0, 0.0), slew(0.0, -60.0), false), [(2_500, Finding::Works)]);
    }

    #[test]
    fn one_that_stays_where_it_is_does_not() {
        for target in [pose(-60.0, 0.0), pose(0.0, 40.0)] {
            assert_eq!(watch(target, |_| pose(0.0, 0.0), false), [(3_100, Finding::NoEffect)]);
            assert_eq!(watch(target, |_| pose(0.0, 0.0), true), [], "it is at a limit");
        }
        let turning = |millis: u64| pose(0.0, 0.002 * millis as f64);
        assert_eq!(watch(pose(-60.0, 0.0), turning, false), [], "it is on its way");
    }

    /// "For > 3 s": since it was told so, and could.
    #[test]
    fn one_that_was_at_its_limit_has_time_to_leave_it() {
        let (limit, home) = (pose(0.0, 60.0), pose(0.0, 0.0));
        let mut watch = EffectWatch::default();
        let mut report = |target, millis, at, at_limit| {
            watch.handle_target(Some(target));
            watch.handle_report(Timestamp::from_millis(millis), at, at_limit)
        };
        for millis in (0..10_000).step_by(50) {
            assert_eq!(report(pose(0.0, 120.0), millis, limit, true), None);
        }
        for millis in (10_000..13_000).step_by(50) {
            assert_eq!(report(home, millis, limit, false), None, "{millis}");
        }
        assert_eq!(report(home, 13_100, limit, false), Some(Finding::NoEffect));
    }

    /// In lock mode the yaw is told from North: one that rested before is not at rest because it is measured otherwise.
    #[test]
    fn one_that_turns_after_a_change_of_its_mode_works() {
        let north = |degrees| Pose { yaw: Yaw::InEarthFrame(Angle::from_degrees(degrees)), ..pose(0.0, 0.0) };
        let mut watch = EffectWatch::default();
        watch.handle_report(Timestamp::ZERO, pose(0.0, 0.0), false);
        watch.handle_target(Some(north(160.0)));
        let found: Vec<Finding> = (50..7_000)
            .step_by(50)
            .filter_map(|millis| {
                watch.handle_report(Timestamp::from_millis(millis), north(0.02 * millis as f64), false)
            })
            .collect();
        assert_eq!(found, [], "at 140 degrees of 160 it is on its way");
        let stuck = (7_000..11_000)
            .step_by(50)
            .find_map(|millis| watch.handle_report(Timestamp::from_millis(millis), north(140.0), false));
        assert_eq!(stuck, None, "its end stop may be there");
    }

    /// "MOUNT_ORIENTATION pitch seen inverted with Gremsy" (mavros pull request 1744).
    #[test]
    fn a_pitch_with_the_other_sign_is_recognised_when_it_has_moved() {
        assert_eq!(watch(pose(-30.0, 0.0), slew(0.0, 30.0), false)[0], (2_450, Finding::InvertedPitch));
        // It was there all the time: it does not move.
        assert_eq!(watch(pose(-30.0, 0.0), |_| pose(30.0, 0.0), false), [(3_100, Finding::NoEffect)]);
    }

    /// Yaw in another frame than it was told cannot be compared.
    #[test]
    fn a_yaw_in_another_frame_is_not_compared() {
        let target = Pose { yaw: Yaw::InEarthFrame(Angle::from_degrees(90.0)), ..pose(0.0, 0.0) };
        assert_eq!(watch(target, |_| pose(0.0, 0.0), false), [(50, Finding::Works)]);
    }
}
