//! Plain angles and rates; degrees are for people, vendors and commands only.

use std::f64::consts::{PI, TAU};
use std::ops::{Add, AddAssign, Neg, Sub, SubAssign};
use std::time::Duration;

/// An angle; it may count several turns until it is [`wrapped`](Self::wrapped).
#[derive(Clone, Copy, Debug, Default, PartialEq, PartialOrd)]
pub struct Angle {
    radians: f64,
}

impl Angle {
    pub const ZERO: Self = Self::from_radians(0.0);
    pub const HALF_TURN: Self = Self::from_radians(PI);
    pub const FULL_TURN: Self = Self::from_radians(TAU);

    pub const fn from_radians(radians: f64) -> Self {
        Self { radians }
    }

    pub const fn from_degrees(degrees: f64) -> Self {
        Self::from_radians(degrees.to_radians())
    }

    pub const fn radians(self) -> f64 {
        self.radians
    }

    pub const fn degrees(self) -> f64 {
        self.radians.to_degrees()
    }

    pub const fn abs(self) -> Self {
        Self::from_radians(self.radians.abs())
    }

    /// The same direction within (−180°, 180°].
    pub fn wrapped(self) -> Self {
        if self.radians > -PI && self.radians <= PI {
            return self;
        }
        let turned = self.radians.rem_euclid(TAU);
        Self::from_radians(if turned > PI { turned - TAU } else { turned })
    }

    /// The same direction, whole turns away, that lies at most half a turn from `other`.
    pub fn nearest_to(self, other: Self) -> Self {
        other + (self - other).wrapped()
    }

    /// The nearest angle between `min` and `max`.
    pub const fn clamp(self, min: Self, max: Self) -> Self {
        Self::from_radians(self.radians.max(min.radians).min(max.radians))
    }

    pub const fn is_finite(self) -> bool {
        self.radians.is_finite()
    }
}

impl Add for Angle {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self::from_radians(self.radians + other.radians)
    }
}

impl AddAssign for Angle {
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl Sub for Angle {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        Self::from_radians(self.radians - other.radians)
    }
}

impl SubAssign for Angle {
    fn sub_assign(&mut self, other: Self) {
        *self = *self - other;
    }
}

impl Neg for Angle {
    type Output = Self;

    fn neg(self) -> Self {
        Self::from_radians(-self.radians)
    }
}

/// How fast an angle changes.
#[derive(Clone, Copy, Debug, Default, PartialEq, PartialOrd)]
pub struct AngularRate {
    radians_per_second: f64,
}

impl AngularRate {
    pub const ZERO: Self = Self::from_radians_per_second(0.0);

    pub const fn from_radians_per_second(radians_per_second: f64) -> Self {
        Self { radians_per_second }
    }

    pub const fn from_degrees_per_second(degrees_per_second: f64) -> Self {
        Self::from_radians_per_second(degrees_per_second.to_radians())
    }

    pub const fn radians_per_second(self) -> f64 {
        self.radians_per_second
    }

    pub const fn degrees_per_second(self) -> f64 {
        self.radians_per_second.to_degrees()
    }

    pub const fn abs(self) -> Self {
        Self::from_radians_per_second(self.radians_per_second.abs())
    }

    pub fn is_zero(self) -> bool {
        self.radians_per_second == 0.0
    }

    /// The nearest rate between `min` and `max`.
    pub const fn clamp(self, min: Self, max: Self) -> Self {
        Self::from_radians_per_second(self.radians_per_second.max(min.radians_per_second).min(max.radians_per_second))
    }

    /// How far this rate turns within `duration`.
    pub fn over(self, duration: Duration) -> Angle {
        Angle::from_radians(self.radians_per_second * duration.as_secs_f64())
    }
}

impl Add for AngularRate {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self::from_radians_per_second(self.radians_per_second + other.radians_per_second)
    }
}

impl Neg for AngularRate {
    type Output = Self;

    fn neg(self) -> Self {
        Self::from_radians_per_second(-self.radians_per_second)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    #[rustfmt::skip]
    fn wrapping_ends_within_half_a_turn_with_180_degrees_included() {
        for (degrees,  wrapped) in [
            (0.0,         0.0),
            (180.0,     180.0),
            (-180.0,    180.0),
            (181.0,    -179.0),
            (-181.0,    179.0),
            (360.0,       0.0),
            (540.0,     180.0),
            (-720.5,     -0.5),
        ] {
            let result = Angle::from_degrees(degrees).wrapped().degrees();

            assert!((result - wrapped).abs() < 1e-12, "{degrees}° became {result}°");
        }
    }

    #[test]
    fn a_rate_turns_by_its_time() {
        let rate = AngularRate::from_degrees_per_second(-30.0);

        assert!((rate.over(Duration::from_millis(500)).degrees() + 15.0).abs() < 1e-12);
        assert_eq!(rate.over(Duration::ZERO), Angle::ZERO);
        assert!(((-rate).degrees_per_second() - 30.0).abs() < 1e-12);
    }

    #[test]
    fn clamping_keeps_what_is_inside() {
        let (low, high) = (Angle::from_degrees(-10.0), Angle::from_degrees(20.0));

        assert_eq!(Angle::from_degrees(-11.0).clamp(low, high), low);
        assert_eq!(Angle::from_degrees(5.0).clamp(low, high), Angle::from_degrees(5.0));
        assert_eq!(Angle::from_degrees(21.0).clamp(low, high), high);
    }

    proptest! {
        #[test]
        fn wrapping_never_changes_the_direction(radians in -1e4..1e4_f64) {
            let wrapped = Angle::from_radians(radians).wrapped().radians();

            prop_assert!(wrapped > -PI && wrapped <= PI);
            prop_assert!((wrapped.sin() - radians.sin()).abs() < 1e-9);
            prop_assert!((wrapped.cos() - radians.cos()).abs() < 1e-9);
        }

        #[test]
        fn the_nearest_turn_is_at_most_half_a_turn_away(wanted in -50.0..50.0_f64, current in -50.0..50.0_f64) {
            let (wanted, current) = (Angle::from_radians(wanted), Angle::from_radians(current));

            let near = wanted.nearest_to(current);

            prop_assert!((near - current).abs().radians() <= PI + 1e-12);
            prop_assert!((near - wanted).wrapped().abs().radians() < 1e-9);
        }
    }
}
