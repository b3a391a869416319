//! The rates that a gimbal was told since it was last known to stand.
//!
//! Which of them it has heard last is not known while its line is out, so one that turns as any of them says may be turning.

use std::time::Duration;

use crate::geometry::AngularRate;
use crate::gimbals::setpoint::Turning;

/// It turns on when that is so much of the least that it was told, or so many degrees per second where its own speed allows no
/// more, and not less than it may seem to turn at rest, in a gust.
const TURNS_ON: f64 = 0.5;
const TURNS_ON_DPS: f64 = 2.0;
const SEEMS_TO_TURN_DPS: f64 = 1.0;

/// How it turns is taken from where it looked so long before; longer where it may turn slowly, so that noise comes to less.
const WITHIN: Duration = Duration::from_millis(250);
const SLOWLY_WITHIN: Duration = Duration::from_millis(800);
const SLOWLY_DPS: f64 = 4.0;

/// The least rate that one axis was told in either direction, degrees per second.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ToldAxis {
    up: Option<f64>,
    down: Option<f64>,
}

impl ToldAxis {
    const ANY: Self = Self { up: Some(1.0), down: Some(1.0) };

    fn add(&mut self, rate: AngularRate) {
        let rate = rate.degrees_per_second();
        let side = if rate > 0.0 { &mut self.up } else { &mut self.down };
        if rate != 0.0 {
            *side = Some(side.map_or(rate.abs(), |least| least.min(rate.abs())));
        }
    }

    /// Whether what turned by so many degrees in a time turns as it was told.
    pub fn is_as_told(self, turned: f64, passed: Duration) -> bool {
        let rate = turned / passed.as_secs_f64();
        let told = if rate > 0.0 { self.up } else { self.down };
        told.is_some_and(|told| rate.abs() >= (told * TURNS_ON).clamp(SEEMS_TO_TURN_DPS, TURNS_ON_DPS))
    }

    fn is_slow(self) -> bool {
        [self.up, self.down].into_iter().flatten().any(|least| least < SLOWLY_DPS)
    }
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ToldRates {
    pub roll: ToldAxis,
    pub pitch: ToldAxis,
    pub yaw: ToldAxis,
}

impl ToldRates {
    /// An earlier run told it, or another driver: any rate.
    pub const ANY: Self = Self { roll: ToldAxis::ANY, pitch: ToldAxis::ANY, yaw: ToldAxis::ANY };

    pub fn add(&mut self, turning: Turning) {
        self.roll.add(turning.roll.unwrap_or(AngularRate::ZERO));
        self.pitch.add(turning.pitch);
        self.yaw.add(turning.yaw);
    }

    /// So far apart two looks tell whether it turns.
    pub fn looks_apart(self) -> Duration {
        if [self.roll, self.pitch, self.yaw].into_iter().any(ToldAxis::is_slow) { SLOWLY_WITHIN } else { WITHIN }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn told(rates: &[f64]) -> ToldAxis {
        let mut told = ToldAxis::default();
        for rate in rates {
            told.add(AngularRate::from_degrees_per_second(*rate));
        }
        told
    }

    #[test]
    #[rustfmt::skip]
    fn what_turns_as_any_of_the_rates_says_turns_on() {
        for (rates,               turns_at, turns_on) in [
            (&[][..],             5.0,      false),
            (&[0.0],              5.0,      false),
            (&[5.0],              5.0,      true),
            (&[5.0],              2.4,      true),
            (&[5.0],              1.9,      false),
            (&[1.5],              1.0,      true),
            (&[1.5],              0.9,      false),
            (&[5.0],             -5.0,      false),
            (&[5.0, -20.0],      -5.0,      true),
            (&[5.0, 60.0],        4.0,      true),
            // That is all it can.
            (&[100.0],            4.0,      true),
            (&[100.0, 0.6],       1.1,      true),
            // A gust.
            (&[100.0, 0.6],       0.9,      false),
        ] {
            let second = Duration::from_secs(1);
            assert_eq!(told(rates).is_as_told(turns_at, second), turns_on, "{rates:?} {turns_at}");
        }
    }
}
