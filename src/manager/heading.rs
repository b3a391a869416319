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
    /// `None` until both were known at one moment.
    bias: Option<Angle>,
    apart_since: Option<Timestamp>,
}

impl HeadingBias {
    /// The gimbal has told its heading; what the autopilot's is at this moment.
    pub(super) fn handle_heading(&mut self, now: Timestamp, of_gimbal: Angle, of_vehicle: Option<Angle>) {
        self.bias = of_vehicle.map(|of_vehicle| (of_gimbal - of_vehicle).wrapped());
        let apart = self.bias.is_some_and(|bias| bias.abs() > Angle::from_degrees(APART_DEG));
        self.apart_since = apart.then(|| self.apart_since.unwrap_or(now));
    }

    /// The heading by which yaw is turned from one frame to the other: the gimbal's, if it tells one, for the yaw is the
    /// gimbal's too. It tells it a few times a second only; in between, and while it does not tell, it turns as
    /// the autopilot says, so that the camera stays where it is.
    pub(super) fn heading(self, of_gimbal: Option<Angle>, of_vehicle: Option<Angle>) -> Option<Angle> {
        match (of_vehicle, self.bias) {
            (Some(of_vehicle), Some(bias)) => Some((of_vehicle + bias).wrapped()),
            _ => of_gimbal.or(of_vehicle),
        }
    }

    /// By how much they are apart, if they are so for long.
    pub(super) fn apart(self, now: Timestamp) -> Option<Angle> {
        self.apart_since.filter(|since| now.since(*since) >= APART_AFTER).and(self.bias)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// "delta_yaw if trusted, else ψ".
    #[test]
    #[rustfmt::skip]
    fn the_heading_is_the_gimbals_and_turns_as_the_autopilot_says() {
        let degrees = |angle: Option<f64>| angle.map(Angle::from_degrees);
        for (compared_with, of_gimbal,   of_vehicle,   expected) in [
            (Some(30.0),    Some(45.0),  Some(30.0),   Some(45.0)),
            (Some(30.0),    Some(45.0),  Some(40.0),   Some(55.0)),
            (Some(30.0),    None,        Some(40.0),   Some(55.0)),
            (Some(30.0),    Some(45.0),  None,         Some(45.0)),
            (Some(30.0),    None,        None,         None),
            (None,          Some(45.0),  Some(30.0),   Some(45.0)),
            (None,          None,        Some(30.0),   Some(30.0)),
        ] {
            let mut bias = HeadingBias::default();
            bias.handle_heading(Timestamp::ZERO, Angle::from_degrees(45.0), degrees(compared_with));
            let found = bias.heading(degrees(of_gimbal), degrees(of_vehicle)).map(|angle| angle.degrees().round());
            assert_eq!(found, expected, "{compared_with:?} {of_gimbal:?} {of_vehicle:?}");
        }
    }

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
                bias.handle_heading(Timestamp::from_secs(second), degrees(told), Some(degrees(of_vehicle)));
                assert_eq!(bias.apart(Timestamp::from_secs(second)), None, "not before it lasted");
            }
            let apart = bias.apart(Timestamp::from_secs(10)).map(|angle| angle.degrees().round());
            assert_eq!(apart, expected, "{of_gimbal} against {of_vehicle}");
        }
    }
}
