//! Whether a v1 gimbal goes where it is told to look.
//!
//! It answers nothing that could be relied on, and tells neither its end stops nor that its motors are off. So it counts as
//! one that does not move only where no end stop explains it: it has rested for eight seconds more than 10 degrees off its
//! target, and the way there leads towards level or the nose, or down from level, or through a yaw that it has had before.

use std::time::Duration;

use crate::geometry::Angle;
use crate::timestamp::Timestamp;

const APART: Angle = Angle::from_degrees(10.0);
/// One that turns by less within this time rests: slower than 0.2 degrees per second no gimbal is.
const STILL: Angle = Angle::from_degrees(1.5);
const PATIENCE: Duration = Duration::from_secs(8);
/// One that has turned by so much moves.
const MOVED: Angle = Angle::from_degrees(5.0);

/// As far down every gimbal looks.
const SURELY_DOWN: Angle = Angle::from_degrees(-30.0);

/// Pitch and yaw, yaw from the nose.
pub type Pose = [Angle; 2];

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Finding {
    Moves,
    DoesNotMove,
}

/// Down or left, up or right.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Way {
    Down,
    Up,
}

#[derive(Debug, Default)]
pub struct Obedience {
    target: Option<Pose>,
    /// Where it rests, and since when.
    rests: Option<(Timestamp, Pose)>,
    /// Where it was when it was last seen to have moved.
    moved_at: Option<Pose>,
    /// Pitch went down the last time that it moved, perhaps to its end stop.
    went_down: bool,
    /// For each axis, which way its target lies too far, and since when.
    apart: [Option<(Way, Timestamp)>; 2],
    /// The yaws that it has had, and the nose.
    yaws: Option<(Angle, Angle)>,
}

impl Obedience {
    /// Where it was told to look; `None` where it was told something else, or is left to somebody else.
    pub fn handle_target(&mut self, pose: Option<Pose>) {
        self.target = pose;
        if pose.is_none() {
            self.apart = [None; 2];
        }
    }

    /// It is not ready, or says nothing: what it has not done meanwhile does not count.
    pub fn pause(&mut self) {
        self.rests = None;
        self.apart = [None; 2];
    }

    /// Where it looks.
    pub fn handle_report(&mut self, now: Timestamp, pose: Pose) -> Option<Finding> {
        let is_near =
            |a: Pose, b: Pose, within: Angle| a.iter().zip(b).all(|(a, b)| (*a - b).wrapped().abs() <= within);
        if !self.rests.is_some_and(|(_, rest)| is_near(rest, pose, STILL)) {
            self.rests = Some((now, pose));
        }
        let (least, most) = self.yaws.unwrap_or((Angle::ZERO, Angle::ZERO));
        self.yaws = Some((if pose[1] < least { pose[1] } else { least }, if pose[1] > most { pose[1] } else { most }));
        let moved_at = *self.moved_at.get_or_insert(pose);
        if !is_near(moved_at, pose, MOVED) {
            self.moved_at = Some(pose);
            if (pose[0] - moved_at[0]).abs() > STILL {
                self.went_down = pose[0] < moved_at[0];
            }
            return Some(Finding::Moves);
        }
        let target = self.target?;
        for axis in 0..2 {
            let off = target[axis] - pose[axis];
            let way = if off < Angle::ZERO { Way::Down } else { Way::Up };
            self.apart[axis] = match self.apart[axis] {
                _ if off.wrapped().abs() <= APART => None,
                Some((before, since)) if before == way => Some((way, since)),
                _ => Some((way, now)),
            };
        }
        let has_lasted = |since: Timestamp| now.since(since) >= PATIENCE;
        if !self.rests.is_some_and(|(since, _)| has_lasted(since)) {
            return None;
        }
        let mut is_sure = false;
        for axis in 0..2 {
            let Some((way, _)) = self.apart[axis].filter(|(_, since)| has_lasted(*since)) else { continue };
            let (from, to) = self.surely_reached(axis);
            // So much of the way it could have gone for certain.
            is_sure |=
                (target[axis].clamp(from, to) - pose[axis]).abs() > APART && is_on_the_way(way, pose[axis], from, to);
        }
        is_sure.then_some(Finding::DoesNotMove)
    }

    pub fn forget(&mut self) {
        *self = Self::default();
    }

    /// Angles of an axis that no end stop keeps from it.
    fn surely_reached(&self, axis: usize) -> (Angle, Angle) {
        match axis {
            0 if self.went_down => (Angle::ZERO, Angle::ZERO),
            0 => (SURELY_DOWN, Angle::ZERO),
            _ => self.yaws.unwrap_or((Angle::ZERO, Angle::ZERO)),
        }
    }
}

/// Whether one goes that way from `at` towards what lies between `from` and `to`.
fn is_on_the_way(way: Way, at: Angle, from: Angle, to: Angle) -> bool {
    match way {
        Way::Down => at > from,
        Way::Up => at < to,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pose(pitch: f64, yaw: f64) -> Pose {
        [Angle::from_degrees(pitch), Angle::from_degrees(yaw)]
    }

    /// Reports ten times a second of where it is at so many milliseconds, and when it was found not to move.
    fn watch(obedience: &mut Obedience, from: u64, until: u64, at: impl Fn(u64) -> Pose) -> Option<u64> {
        (from..until).step_by(100).find(|millis| {
            obedience.handle_report(Timestamp::from_millis(*millis), at(*millis)) == Some(Finding::DoesNotMove)
        })
    }

    /// One that is told `target` 1 s after it was first heard, and is heard for 40 s more.
    fn found(target: Pose, at: impl Fn(u64) -> Pose) -> Option<u64> {
        let mut obedience = Obedience::default();
        assert_eq!(watch(&mut obedience, 0, 1_000, &at), None);
        obedience.handle_target(Some(target));
        watch(&mut obedience, 1_000, 40_000, &at)
    }

    #[test]
    #[rustfmt::skip]
    fn one_that_stays_where_it_is_does_not_move_where_no_end_stop_explains_it() {
        for (target,            at,                 expected) in [
            (pose(-30.0, 0.0),  pose(0.0, 0.0),     Some(9_000)), // down from level
            (pose(0.0, 0.0),    pose(-60.0, 0.0),   Some(9_000)), // back to level
            (pose(20.0, 0.0),   pose(-60.0, 0.0),   Some(9_000)), // and beyond it
            (pose(0.0, 0.0),    pose(40.0, 0.0),    Some(9_000)), // down to level
            (pose(0.0, 10.0),   pose(0.0, 90.0),    Some(9_000)), // to the nose
            (pose(20.0, 45.0),  pose(0.0, 0.0),     None),        // it may have neither
            (pose(20.0, 0.0),   pose(0.0, 0.0),     None),        // it may look no further up
            (pose(0.0, 45.0),   pose(0.0, 0.0),     None),        // it may have no yaw
            (pose(-80.0, 0.0),  pose(-45.0, 0.0),   None),        // it may look no further down
            (pose(0.0, -120.0), pose(0.0, -90.0),   None),        // it may turn no further
            (pose(-9.0, 9.0),   pose(0.0, 0.0),     None),        // that is where it looks, nearly
        ] {
            assert_eq!(found(target, |_| at), expected, "{target:?} from {at:?}");
        }
    }

    #[test]
    fn one_that_moves_does() {
        for rate in [0.3, 1.0, 30.0] {
            let slow = |millis: u64| pose((-rate * (millis.saturating_sub(1_000) as f64) / 1_000.0).max(-60.0), 0.0);
            assert_eq!(found(pose(-60.0, 0.0), slow), None, "{rate} degrees per second");
            // To its end stop, and no further.
            for end in [-25.0, -15.0] {
                let stopped = |millis: u64| pose(slow(millis)[0].degrees().max(end), 0.0);
                assert_eq!(found(pose(-60.0, 0.0), stopped), None, "{rate} degrees per second");
            }
        }
        // It shakes.
        let shakes = |millis: u64| pose(if millis % 1_000 < 500 { 0.0 } else { 3.0 }, 0.0);
        assert_eq!(found(pose(-30.0, 0.0), shakes), None);
    }

    /// It went there, and its motors failed there.
    #[test]
    fn one_that_moved_before_is_found_when_it_is_called_back() {
        let mut obedience = Obedience::default();
        let at = |millis: u64| pose(-(millis.min(6_000) as f64) / 100.0, 0.0);
        obedience.handle_target(Some(pose(-60.0, 0.0)));
        assert_eq!(watch(&mut obedience, 0, 20_000, at), None);
        obedience.handle_target(Some(pose(-80.0, 40.0)));
        assert_eq!(watch(&mut obedience, 20_000, 40_000, at), None, "it may be at its end stop, and have no yaw");
        obedience.handle_target(Some(pose(-20.0, 40.0)));
        assert_eq!(watch(&mut obedience, 40_000, 60_000, at), Some(48_000));
    }

    #[test]
    fn what_is_not_asked_of_it_or_not_heard_does_not_count() {
        let mut obedience = Obedience::default();
        let level = |_| pose(0.0, 0.0);
        assert_eq!(watch(&mut obedience, 0, 20_000, level), None, "it was told nothing");
        obedience.handle_target(Some(pose(-30.0, 0.0)));
        assert_eq!(watch(&mut obedience, 20_000, 27_000, level), None);
        obedience.handle_target(None);
        assert_eq!(watch(&mut obedience, 27_000, 60_000, level), None, "its radio control has it");
        obedience.handle_target(Some(pose(-30.0, 0.0)));
        assert_eq!(watch(&mut obedience, 60_000, 67_000, level), None);
        obedience.pause();
        assert_eq!(watch(&mut obedience, 67_000, 74_000, level), None, "it was not ready");
        assert_eq!(watch(&mut obedience, 74_000, 76_000, level), Some(75_000));
    }
}
