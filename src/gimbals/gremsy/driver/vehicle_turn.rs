//! How fast the vehicle turns under the gimbal, by what the gimbal tells of both yaws.

use crate::geometry::{Angle, AngularRate};
use crate::timestamp::Timestamp;
use std::time::Duration;

/// A heading older than this says nothing of now.
const FRESH: Duration = Duration::from_millis(500);
/// The rate is that of about so long.
const SMOOTHED_OVER: Duration = Duration::from_millis(200);
/// No vehicle turns faster; what seems to is a jump of the gimbal's idea of North.
const FASTEST: AngularRate = AngularRate::from_degrees_per_second(180.0);

#[derive(Clone, Copy, Debug, Default)]
pub struct VehicleTurn {
    latest: Option<(Timestamp, Angle)>,
    rate: AngularRate,
}

impl VehicleTurn {
    /// The heading that the gimbal reckons with; its offset does not matter.
    pub fn handle_heading(&mut self, now: Timestamp, heading: Angle) {
        let before = self.latest.replace((now, heading));
        let Some((at, before)) = before.filter(|(at, _)| now.since(*at) <= FRESH && now > *at) else {
            self.rate = AngularRate::ZERO;
            return;
        };
        let passed = now.since(at);
        let turned = (heading - before).wrapped().radians() / passed.as_secs_f64();
        let turned = AngularRate::from_radians_per_second(turned);
        if turned.abs() <= FASTEST {
            let share = (passed.as_secs_f64() / SMOOTHED_OVER.as_secs_f64()).min(1.0);
            let change = turned.radians_per_second() - self.rate.radians_per_second();
            self.rate = self.rate + AngularRate::from_radians_per_second(share * change);
        }
    }

    /// `None` where it is not known at present.
    pub fn rate(&self, now: Timestamp) -> Option<AngularRate> {
        self.latest.filter(|(at, _)| now.since(*at) <= FRESH).map(|_| self.rate)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rate_is_that_of_the_heading_across_north_and_ends_with_it() {
        let mut turn = VehicleTurn::default();
        for step in 0..40_u64 {
            let heading = Angle::from_degrees(355.0 + 0.5 * step as f64).wrapped();
            turn.handle_heading(Timestamp::from_millis(50 * step), heading);
        }
        let now = Timestamp::from_millis(1_950);
        let rate = turn.rate(now).expect("it is fresh").degrees_per_second();
        assert!((rate - 10.0).abs() < 0.1, "{rate}");
        assert_eq!(turn.rate(now + Duration::from_millis(501)), None);
        // A jump of its idea of North is no turn.
        turn.handle_heading(now + Duration::from_millis(50), Angle::from_degrees(120.0));
        let rate = turn.rate(now + Duration::from_millis(50)).expect("it is fresh").degrees_per_second();
        assert!((rate - 10.0).abs() < 0.1, "{rate}");
    }
}
