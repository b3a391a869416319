//! How far the axes of a gimbal reach, and which way round its yaw goes.

use super::angle::Angle;

/// The end stops of one axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisLimits {
    min: Angle,
    max: Angle,
}

/// The end stops of a gimbal's axes; `None` is an axis without any, or one that nothing is known of.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Limits {
    pub roll: Option<AxisLimits>,
    pub pitch: Option<AxisLimits>,
    /// In the vehicle frame; may reach beyond ±180°. `None` turns without end.
    pub yaw: Option<AxisLimits>,
}

/// How far beyond an end stop a turn still counts as within reach, so that rounding on the wire (±180° in single
/// precision) does not send the gimbal round the other way.
const ROUNDING: Angle = Angle::from_degrees(0.01);

/// How much nearer the other end stop has to look for a gimbal to swing there all the way round.
const SWING_FOR: Angle = Angle::from_degrees(10.0);

impl AxisLimits {
    /// `None` when a limit is not finite, or `min` lies above `max`.
    pub fn new(min: Angle, max: Angle) -> Option<Self> {
        (min.is_finite() && max.is_finite() && min <= max).then_some(Self { min, max })
    }

    pub const fn min(self) -> Angle {
        self.min
    }

    pub const fn max(self) -> Angle {
        self.max
    }

    pub const fn clamp(self, angle: Angle) -> Angle {
        angle.clamp(self.min, self.max)
    }

    /// The angle within the limits that looks along `wanted`, or comes closest to it.
    ///
    /// Where several turns are within reach, or equally far out of it, it is the one nearest to `current`.
    pub fn clamp_turns(self, wanted: Angle, current: Angle) -> Angle {
        let turn = Angle::FULL_TURN.radians();
        let first = ((self.min - ROUNDING - wanted).radians() / turn).ceil();
        let last = ((self.max + ROUNDING - wanted).radians() / turn).floor();
        let plus_turns = |turns: f64| self.clamp(wanted + Angle::from_radians(turns * turn));
        if first <= last {
            let nearest = ((current - wanted).radians() / turn).round();
            return plus_turns(nearest.max(first).min(last));
        }
        // None is within reach, so the last one before the lower and the first one beyond the upper end stop are
        // neighbours.
        let (below, above) = (plus_turns(last), plus_turns(first));
        let miss = |end: Angle| (end - wanted).wrapped().abs();
        let difference = miss(below) - miss(above);
        let below_is_better = if difference.abs() <= ROUNDING {
            (below - current).abs() < (above - current).abs()
        } else {
            difference < Angle::ZERO
        };
        if below_is_better { below } else { above }
    }
}

impl Limits {
    pub fn clamp_roll(&self, roll: Angle) -> Angle {
        self.roll.map_or(roll, |limits| limits.clamp(roll))
    }

    pub fn clamp_pitch(&self, pitch: Angle) -> Angle {
        self.pitch.map_or(pitch, |limits| limits.clamp(pitch))
    }

    /// The yaw to turn to from `current`, both in the vehicle frame, to look along `wanted` or as near as can be.
    ///
    /// Without end stops it is the short way, so the result may lie beyond ±180°; wrap it where turns do not count.
    ///
    /// Where it cannot look, behind its end stops, it stays at the end it is at until the other is clearly better:
    /// otherwise a direction that wobbles about the back would have it swing from one end to the other.
    pub fn clamp_yaw(&self, wanted: Angle, current: Angle) -> Angle {
        let Some(limits) = self.yaw else { return wanted.nearest_to(current) };
        let nearest = limits.clamp_turns(wanted, current);
        let miss = |end: Angle| (end - wanted).wrapped().abs();
        let at_end = [limits.min, limits.max].into_iter().find(|end| (*end - current).abs() <= ROUNDING);
        match at_end {
            Some(end) if miss(nearest) > ROUNDING && miss(end) - miss(nearest) < SWING_FOR => end,
            _ => nearest,
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn limits(min: f64, max: f64) -> AxisLimits {
        AxisLimits::new(Angle::from_degrees(min), Angle::from_degrees(max)).expect("the limits are in order")
    }

    #[test]
    fn limits_that_make_no_sense_are_refused() {
        let angle = Angle::from_degrees;

        assert_eq!(AxisLimits::new(angle(f64::NAN), angle(10.0)), None);
        assert_eq!(AxisLimits::new(angle(-10.0), angle(f64::NAN)), None);
        assert_eq!(AxisLimits::new(angle(-10.0), angle(f64::INFINITY)), None);
        assert_eq!(AxisLimits::new(angle(10.0), angle(-10.0)), None);
        assert!(AxisLimits::new(angle(10.0), angle(10.0)).is_some());
    }

    #[test]
    fn roll_and_pitch_stop_at_their_limits() {
        let gimbal = Limits { roll: None, pitch: Some(limits(-90.0, 30.0)), yaw: None };

        assert_eq!(gimbal.clamp_pitch(Angle::from_degrees(-91.0)), Angle::from_degrees(-90.0));
        assert_eq!(gimbal.clamp_pitch(Angle::from_degrees(31.0)), Angle::from_degrees(30.0));
        assert_eq!(gimbal.clamp_pitch(Angle::from_degrees(-45.0)), Angle::from_degrees(-45.0));
        assert_eq!(gimbal.clamp_roll(Angle::from_degrees(400.0)), Angle::from_degrees(400.0));
    }

    /// "vehicle yaw: choose the representation inside [yaw_min, yaw_max] nearest the current yaw".
    #[test]
    #[rustfmt::skip]
    fn yaw_takes_the_turn_within_its_limits_that_is_nearest() {
        for (min,   max,   wanted,  current, expected) in [
            (-320.0, 320.0,   170.0,    0.0,   170.0),
            (-320.0, 320.0,   170.0, -100.0,  -190.0),
            (-320.0, 320.0,  -170.0,  179.0,   190.0),
            (-320.0, 320.0,    30.0,  300.0,    30.0),
            (-320.0, 320.0,   -50.0,  300.0,   310.0),
            (-720.0, 720.0,    10.0,  700.0,   370.0),
            (-720.0, 720.0,    -5.0,  700.0,   715.0),
            (-180.0, 180.0,   190.0,   10.0,  -170.0),
            // Single precision puts 180° just beyond the limit; that is no reason to go round.
            (-180.0, 180.0, f64::from(std::f32::consts::PI).to_degrees(),           170.0, 180.0),
            (-180.0, 180.0, f64::from(std::f32::consts::PI).to_degrees() - 360.0,   170.0, 180.0),
            // No representation is within reach: the end stop that looks nearest to the wanted direction.
            (-160.0, 160.0,   170.0, -150.0,   160.0),
            (-160.0, 160.0,  -170.0,  150.0,  -160.0),
            (-160.0, 160.0,   180.0,   90.0,   160.0),
            (-160.0, 160.0,   180.0,  -90.0,  -160.0),
            (10.0,    90.0,   -80.0,   50.0,    10.0),
            (10.0,    90.0,     0.0,   50.0,    10.0),
            (400.0,  410.0,    30.0,  405.0,   400.0),
        ] {
            let gimbal = Limits { yaw: Some(limits(min, max)), ..Limits::default() };

            let yaw = gimbal.clamp_yaw(Angle::from_degrees(wanted), Angle::from_degrees(current)).degrees();

            assert!((yaw - expected).abs() < 1e-4, "{wanted}° from {current}° within {min}..{max} gave {yaw}°");
        }
    }

    #[test]
    #[rustfmt::skip]
    fn behind_its_end_stops_yaw_stays_at_the_end_it_is_at() {
        for (wanted, current, expected) in [
            (175.0,    160.0,  160.0),
            (-179.0,   160.0,  160.0),
            (-175.5,   160.0,  160.0),
            (-174.5,   160.0, -160.0),
            (-175.5,   150.0, -160.0),
            (-150.0,   160.0, -150.0),
            (175.5,   -160.0, -160.0),
            (174.5,   -160.0,  160.0),
            (159.0,   -160.0,  159.0),
        ] {
            let gimbal = Limits { yaw: Some(limits(-160.0, 160.0)), ..Limits::default() };

            let yaw = gimbal.clamp_yaw(Angle::from_degrees(wanted), Angle::from_degrees(current)).degrees();

            assert!((yaw - expected).abs() < 1e-4, "{wanted}° from {current}° gave {yaw}°");
        }
    }

    /// "with INFINITE_YAW shortest way".
    #[test]
    fn yaw_without_end_stops_takes_the_short_way() {
        let gimbal = Limits::default();

        let yaw = gimbal.clamp_yaw(Angle::from_degrees(-179.0), Angle::from_degrees(179.0));

        assert!((yaw.degrees() - 181.0).abs() < 1e-9);
    }

    proptest! {
        #[test]
        fn yaw_stays_within_its_limits_and_looks_as_near_as_can_be(
            min in -800.0..800.0_f64, span in 0.0..900.0_f64, wanted in -720.0..720.0_f64, share in 0.0..=1.0_f64,
        ) {
            let axis = limits(min, min + span);
            let wanted = Angle::from_degrees(wanted);

            let yaw = axis.clamp_turns(wanted, Angle::from_degrees(min + share * span));

            prop_assert!(axis.min() <= yaw && yaw <= axis.max());
            let miss = |angle: Angle| (angle - wanted).wrapped().abs().degrees();
            let best = (0..=1000)
                .map(|step| miss(Angle::from_degrees(min + span * f64::from(step) / 1000.0)))
                .fold(f64::INFINITY, f64::min);
            prop_assert!(miss(yaw) <= best + 0.02, "missed by {}°, {best}° is possible", miss(yaw));
        }
    }
}
