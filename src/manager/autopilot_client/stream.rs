//! What an autopilot's stream of setpoints asks for, and when that is something new.
//!
//! ArduPilot repeats its setpoint 50 times a second for ever, whether or not anybody asked it for anything. So what counts
//! is that it *changes*: other flags, rates where there were angles, or an angle or rate that moves by more than a
//! [tolerance](TOLERANCE_DEG) within a second. What creeps more slowly is followed by whom it is obeyed already, and asks
//! for nothing new.

use std::time::Duration;

use crate::geometry::Angle;
use crate::manager::request::{AxisDemand, Demand};
use crate::timestamp::Timestamp;

/// A stream silent for so long begins anew: its first setpoint is where it stands, and nobody's wish.
const SILENCE: Duration = Duration::from_secs(1);

/// A demand changes when it moves further than this, degrees or degrees per second, …
pub const TOLERANCE_DEG: f64 = 0.5;

/// … within so long.
const WINDOW: Duration = Duration::from_secs(1);

/// What was overruled while it moved has to rest for so long, and to move then, before it is something new; …
const REST: Duration = Duration::from_secs(2);

/// … or to jump by more than this from one setpoint to the next, in degrees.
const JUMP_DEG: f64 = 5.0;

/// Differences below this, in degrees, are the rounding of quaternions.
const ROUNDING_DEG: f64 = 0.01;

/// What one setpoint of the stream means.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Heard {
    /// The first, also after a silence.
    First,
    /// The demand is what it was, but may have crept.
    Steady { crept: bool },
    /// The demand changes: somebody asks for something.
    Changes,
    /// It changes as it did when somebody else was obeyed in its stead.
    Overruled,
}

/// An autopilot's stream of setpoints.
#[derive(Clone, Debug, Default)]
pub struct DemandStream {
    heard: Option<Timestamp>,
    /// What it last demanded, up to rounding.
    latest: Option<Demand>,
    /// What changes are told from; it follows what creeps.
    base: Option<Demand>,
    base_at: Timestamp,
    changed: Option<Timestamp>,
    is_overruled: bool,
}

impl DemandStream {
    /// Takes the next setpoint; `None` is one that demands nothing.
    pub fn hear(&mut self, now: Timestamp, demand: Option<Demand>) -> Heard {
        let is_first = !self.is_alive(now);
        let before = self.latest;
        let is_same = is_alike(before, demand, ROUNDING_DEG);
        self.heard = Some(now);
        if is_first || !is_same {
            self.latest = demand;
        }
        if is_first {
            (self.base, self.base_at) = (demand, now);
            (self.changed, self.is_overruled) = (None, false);
            return Heard::First;
        }
        if demand.is_some() && !is_alike(self.base, demand, TOLERANCE_DEG) {
            let rested = self.changed.is_none_or(|at| now.since(at) >= REST);
            self.is_overruled &= !rested && is_alike(before, demand, JUMP_DEG);
            (self.base, self.base_at) = (demand, now);
            self.changed = Some(now);
            return if self.is_overruled { Heard::Overruled } else { Heard::Changes };
        }
        if demand.is_none() || now.since(self.base_at) >= WINDOW {
            (self.base, self.base_at) = (demand, now);
        }
        Heard::Steady { crept: demand.is_some() && !is_same }
    }

    /// The autopilot asked for something by a command.
    pub fn note_command(&mut self, now: Timestamp) {
        self.changed = Some(now);
        self.is_overruled = false;
    }

    /// Somebody else is obeyed from now on: what is just moving goes on without effect.
    pub fn overrule(&mut self, now: Timestamp) {
        self.is_overruled |= self.changed.is_some_and(|at| now.since(at) < REST);
    }

    /// Whether setpoints come.
    pub fn is_alive(&self, now: Timestamp) -> bool {
        self.heard.is_some_and(|at| now.since(at) <= SILENCE)
    }

    pub fn is_overruled(&self) -> bool {
        self.is_overruled
    }

    /// When the demand last changed, since the stream began.
    pub fn changed(&self) -> Option<Timestamp> {
        self.changed
    }
}

/// Whether both ask for the same, up to `tolerance` in degrees and degrees per second.
fn is_alike(one: Option<Demand>, other: Option<Demand>, tolerance: f64) -> bool {
    let (Some(one), Some(other)) = (one, other) else { return one.is_none() && other.is_none() };
    let axes = [(one.roll, other.roll), (one.pitch, other.pitch), (one.yaw, other.yaw)];
    one.flags == other.flags && axes.into_iter().all(|(one, other)| is_axis_alike(one, other, tolerance))
}

fn is_axis_alike(one: AxisDemand, other: AxisDemand, tolerance: f64) -> bool {
    let angles = match (one.angle, other.angle) {
        (Some(one), Some(other)) => Angle::wrapped(one - other).degrees().abs() <= tolerance,
        (one, other) => one.is_none() && other.is_none(),
    };
    let rates = match (one.rate, other.rate) {
        (Some(one), Some(other)) => (one.degrees_per_second() - other.degrees_per_second()).abs() <= tolerance,
        (one, other) => one.is_none() && other.is_none(),
    };
    angles && rates
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::AngularRate;
    use crate::wire::ids::GimbalFlags;

    /// The period of ArduPilot's stream.
    const PERIOD: Duration = Duration::from_millis(20);

    fn pitch(degrees: f64) -> Option<Demand> {
        let pitch = AxisDemand { angle: Some(Angle::from_degrees(degrees)), rate: None };
        Some(Demand { pitch, ..Demand::default() })
    }

    fn turning(degrees_per_second: f64) -> Option<Demand> {
        let rate = Some(AngularRate::from_degrees_per_second(degrees_per_second));
        Some(Demand { yaw: AxisDemand { angle: None, rate }, ..Demand::default() })
    }

    /// A stream, and what each setpoint meant.
    #[derive(Default)]
    struct Run {
        now: Timestamp,
        stream: DemandStream,
    }

    impl Run {
        /// The same setpoint for so long; what the first of them meant. The others meant nothing new.
        fn repeat(&mut self, demand: Option<Demand>, lasting: Duration) -> Heard {
            let first = self.next(demand);
            for _ in 1..lasting.as_millis() / PERIOD.as_millis() {
                assert_eq!(self.next(demand), Heard::Steady { crept: false });
            }
            first
        }

        fn next(&mut self, demand: Option<Demand>) -> Heard {
            self.now += PERIOD;
            self.stream.hear(self.now, demand)
        }

        /// A pitch that moves steadily from one angle to another; how many setpoints were changes, and how many changes
        /// of something overruled.
        fn sweep(&mut self, from: f64, to: f64, degrees_per_second: f64) -> (usize, usize) {
            let steps = ((to - from).abs() / degrees_per_second / PERIOD.as_secs_f64()).round() as usize;
            let heard: Vec<Heard> =
                (1..=steps).map(|step| self.next(pitch(from + (to - from) * step as f64 / steps as f64))).collect();
            let count = |wanted: Heard| heard.iter().filter(|heard| **heard == wanted).count();
            (count(Heard::Changes), count(Heard::Overruled))
        }
    }

    const STEADY: Heard = Heard::Steady { crept: false };

    /// "Active only when its demand changes (angle beyond a small tolerance, flags, rates)", and "its first value after
    /// start/reconnect moves nothing".
    #[test]
    fn only_what_changes_is_a_demand() {
        let mut run = Run::default();
        assert_eq!(run.repeat(pitch(-30.0), Duration::from_secs(60)), Heard::First);
        assert_eq!(run.repeat(pitch(-30.3), Duration::from_secs(2)), Heard::Steady { crept: true });
        assert_eq!(run.repeat(pitch(-31.0), Duration::from_secs(2)), Heard::Changes);
        assert_eq!(run.repeat(turning(0.0), Duration::from_secs(2)), Heard::Changes);
        assert_eq!(run.repeat(turning(3.0), Duration::from_secs(2)), Heard::Changes);
        let locked = pitch(-31.0).map(|demand| Demand { flags: GimbalFlags::YAW_LOCK, ..demand });
        assert_eq!(run.repeat(locked, Duration::from_secs(2)), Heard::Changes);
        assert_eq!(run.repeat(None, Duration::from_secs(2)), STEADY);
        assert_eq!(run.repeat(locked, Duration::from_secs(2)), Heard::Changes, "after it demanded nothing");

        run.now += SILENCE;
        assert_eq!(run.repeat(pitch(80.0), Duration::from_secs(2)), Heard::First);
        assert_eq!(run.stream.changed(), None);
    }

    /// A wrap of yaw is no change, and neither is what moves by less than half a degree in a second.
    #[test]
    fn creeping_is_no_demand() {
        let yaw = |degrees| {
            let yaw = AxisDemand { angle: Some(Angle::from_degrees(degrees)), rate: None };
            Some(Demand { yaw, ..Demand::default() })
        };
        let mut run = Run::default();
        run.next(yaw(179.9));
        assert_eq!(run.next(yaw(-179.9)), Heard::Steady { crept: true });

        let mut run = Run::default();
        run.next(pitch(0.0));
        assert_eq!(run.sweep(0.0, -20.0, 0.4), (0, 0));
        let (changes, _) = run.sweep(-20.0, -40.0, 2.0);
        assert!((30..=40).contains(&changes), "{changes}: each half degree is one");
    }

    /// What moves when somebody else is obeyed is not asked for anew by going on; it is when it has rested, jumps or
    /// becomes another kind of demand.
    #[test]
    fn what_is_overruled_must_be_asked_for_anew() {
        for again in [pitch(-60.0), turning(1.0)] {
            let mut run = Run::default();
            run.next(pitch(0.0));
            assert_ne!(run.sweep(0.0, -10.0, 5.0).0, 0);
            run.stream.overrule(run.now);
            let (changes, overruled) = run.sweep(-10.0, -20.0, 5.0);
            assert!(changes == 0 && overruled > 0, "{changes} {overruled}");
            assert_eq!(run.next(again), Heard::Changes);
        }

        let mut run = Run::default();
        run.next(pitch(0.0));
        run.sweep(0.0, -10.0, 5.0);
        run.stream.overrule(run.now);
        run.repeat(pitch(-10.0), REST);
        let (changes, overruled) = run.sweep(-10.0, -20.0, 5.0);
        assert!(changes > 0 && overruled == 0, "{changes} {overruled}");
    }

    /// What it asks for by a command it asks for anew, and so does what moves after that.
    #[test]
    fn a_command_ends_that_it_is_overruled() {
        let mut run = Run::default();
        run.next(pitch(0.0));
        run.sweep(0.0, -10.0, 5.0);
        run.stream.overrule(run.now);
        assert!(run.stream.is_overruled());
        run.stream.note_command(run.now);
        assert_eq!((run.stream.is_overruled(), run.stream.changed()), (false, Some(run.now)));
        let (changes, overruled) = run.sweep(-10.0, -20.0, 5.0);
        assert!(changes > 0 && overruled == 0, "{changes} {overruled}");
    }

    /// Whoever is obeyed while it rests has not overruled what comes next.
    #[test]
    fn a_demand_that_rests_is_not_overruled() {
        let mut run = Run::default();
        run.next(pitch(0.0));
        run.repeat(pitch(-10.0), REST);
        run.stream.overrule(run.now);
        assert_eq!(run.next(pitch(-11.0)), Heard::Changes);
    }
}
