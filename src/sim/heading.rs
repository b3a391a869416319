//! Where a simulated gimbal believes North is: the heading that its autopilot tells it.

use std::time::Duration;

use crate::geometry::{Angle, AngularRate};
use crate::timestamp::Timestamp;

/// A heading that is older counts as unknown.
const VALID: Duration = Duration::from_secs(1);
/// While 286 comes at least as often, `ATTITUDE` is not looked at.
const PREFERENCE: Duration = Duration::from_millis(500);
/// Holding a direction needs at least ten headings a second, for two seconds.
const REFERENCE_GAP: Duration = Duration::from_millis(100);
const REFERENCE_TIME: Duration = Duration::from_secs(2);
/// Between two headings, a faster turn is a jump and no rate; radians per second.
const FASTEST_TURN: f64 = 3.5;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HeadingSource {
    /// `AUTOPILOT_STATE_FOR_GIMBAL_DEVICE`.
    State,
    /// `ATTITUDE`.
    Attitude,
}

#[derive(Clone, Copy, Debug)]
struct Sample {
    at: Timestamp,
    source: HeadingSource,
    heading: Angle,
    rate: AngularRate,
}

/// The vehicle's heading as it was last told, and since when it has been told often enough to lean on.
#[derive(Clone, Copy, Debug, Default)]
pub struct HeadingBelief {
    last: Option<Sample>,
    steady_since: Option<Timestamp>,
}

impl HeadingBelief {
    /// Takes a heading, and the rate of turn if it came with one; false when a better source makes it superfluous.
    pub fn handle_heading(
        &mut self,
        now: Timestamp,
        source: HeadingSource,
        heading: Angle,
        rate: Option<AngularRate>,
    ) -> bool {
        let before = self.last.filter(|last| now.since(last.at) <= VALID);
        if let Some(last) = before
            && source == HeadingSource::Attitude
            && last.source == HeadingSource::State
            && now.since(last.at) <= PREFERENCE
        {
            return false;
        }
        let measured = before.and_then(|last| {
            let time = now.since(last.at).as_secs_f64();
            let rate = (heading - last.heading).wrapped().radians() / time;
            (rate.abs() <= FASTEST_TURN).then(|| AngularRate::from_radians_per_second(rate))
        });
        if self.last.is_none_or(|last| now.since(last.at) > REFERENCE_GAP) {
            self.steady_since = Some(now);
        }
        let rate = rate.or(measured).unwrap_or(AngularRate::ZERO);
        self.last = Some(Sample { at: now, source, heading, rate });
        true
    }

    /// Heading and rate of turn at `now`; `None` when none was told for a second.
    pub fn at(&self, now: Timestamp) -> Option<(Angle, AngularRate)> {
        let last = self.last.filter(|last| now.since(last.at) <= VALID)?;
        Some((last.heading + last.rate.over(now.since(last.at)), last.rate))
    }

    /// Whether headings come often enough to hold a direction without drift.
    pub fn is_reference(&self, now: Timestamp) -> bool {
        let Some((last, since)) = self.last.zip(self.steady_since) else { return false };
        now.since(last.at) <= REFERENCE_GAP && last.at.since(since) >= REFERENCE_TIME
    }
}
