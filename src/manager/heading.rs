//! What the gimbal takes for the vehicle's heading, against what the autopilot says it is.
//!
//! Gimbals tell it as `delta_yaw` (285). Some measure yaw from where they looked when they were switched on, others have a
//! compass of their own; that the two disagree moves nothing, but somebody ought to know.

use std::time::Duration;

use crate::geometry::Angle;
use crate::timestamp::Timestamp;

/// Headings that differ by more are apart …
const APART_DEG: f64 = 20.0;
/// … when they do for so long: a turn reaches the one later than the other.
const APART_AFTER: Duration = Duration::from_secs(10);

/// How much more the gimbal's heading is than the autopilot's.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct HeadingBias {
    bias: Angle,
    apart_since: Option<Timestamp>,
}

impl HeadingBias {
    /// Both headings were told at this moment.
    pub(super) fn handle_headings(&mut self, now: Timestamp, of_gimbal: Angle, of_vehicle: Angle) {
        self.bias = (of_gimbal - of_vehicle).wrapped();
        let apart = self.bias.abs() > Angle::from_degrees(APART_DEG);
        self.apart_since = apart.then(|| self.apart_since.unwrap_or(now));
    }

    /// What the gimbal's heading is, by the autopilot's: the camera stays where it is while the gimbal does not tell.
    pub(super) fn applied_to(self, of_vehicle: Angle) -> Angle {
        (of_vehicle + self.bias).wrapped()
    }

    /// By how much they are apart, if they are so for long.
    pub(super) fn apart(self, now: Timestamp) -> Option<Angle> {
        self.apart_since.filter(|since| now.since(*since) >= APART_AFTER).map(|_| self.bias)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// "warn when |heading − gimbal heading| drifts", also across North, and not because of one late message.
    #[test]
    #[rustfmt::skip]
    fn headings_are_apart_when_they_differ_for_long() {
        for (of_gimbal, of_vehicle, between, expected) in [
            (90.0,      30.0,       None,          Some(60.0)),
            (-170.0,    170.0,      None,          None),
            (-150.0,    170.0,      None,          Some(40.0)),
            (45.0,      30.0,       None,          None),
            (90.0,      30.0,       Some(40.0),    None),
        ] {
            let degrees = Angle::from_degrees;
            let mut bias = HeadingBias::default();
            for second in 0..10 {
                let told = between.filter(|_| second == 5).unwrap_or(of_gimbal);
                bias.handle_headings(Timestamp::from_secs(second), degrees(told), degrees(of_vehicle));
                assert_eq!(bias.apart(Timestamp::from_secs(second)), None, "not before it lasted");
            }
            let apart = bias.apart(Timestamp::from_secs(10)).map(|angle| angle.degrees().round());
            assert_eq!(apart, expected, "{of_gimbal} against {of_vehicle}");
        }
    }
}
