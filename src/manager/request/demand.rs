//! What is demanded of the axes, and the numbers that none can follow.

use super::Refusal;
use crate::geometry::{Angle, AngularRate};
use crate::wire::ids::GimbalFlags;

/// Degrees: beyond half a turn of pitch, or a turn of yaw, is no angle of a gimbal.
pub const PITCH_RANGE: f64 = 180.0;
pub const YAW_RANGE: f64 = 360.0;

/// Degrees; an angle in radians may be rounded to beyond its range.
const ROUNDING: f64 = 0.01;

/// Radians per second; no gimbal turns a hundredth as fast for long.
pub const LARGEST_RATE: f64 = 100.0;

/// Where one would have the gimbal look, or how it is to turn. `None` makes no demand on that axis.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Demand {
    pub flags: GimbalFlags,
    pub roll: AxisDemand,
    /// Up is positive.
    pub pitch: AxisDemand,
    /// Right is positive; from the vehicle's nose or from North as `flags` say.
    pub yaw: AxisDemand,
    pub kind: DemandKind,
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AxisDemand {
    pub angle: Option<Angle>,
    pub rate: Option<AngularRate>,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DemandKind {
    /// Repeated by its sender; a rate that is not refreshed stops soon.
    #[default]
    Streamed,
    /// Sent once.
    Commanded,
    /// −1 to 1 of what the gimbal can do (288); angles and rates are fractions until the manager scales them.
    Manual,
}

impl Demand {
    /// What no gimbal can do, whatever its capabilities.
    pub(super) fn check(&self) -> Result<(), Refusal> {
        if self.flags.contains(GimbalFlags::YAW_IN_VEHICLE_FRAME | GimbalFlags::YAW_IN_EARTH_FRAME) {
            return Err(Refusal::denied("both_yaw_frames"));
        }
        Ok(())
    }

    /// Whether it asks the gimbal to turn on and on.
    pub fn turns(&self) -> bool {
        let axes = [self.roll, self.pitch, self.yaw];
        axes.iter().any(|axis| axis.angle.is_none() && axis.rate.is_some_and(|rate| !rate.is_zero()))
    }
}

/// Of radians, up to `range` in degrees.
pub fn angle(radians: f32, range: f64) -> Result<Option<Angle>, Refusal> {
    let degrees = number(radians)?.map(f64::to_degrees);
    let angle = within(degrees, range + ROUNDING, "angle_out_of_range")?;
    Ok(angle.map(Angle::from_degrees))
}

pub fn rate(radians_per_second: f32) -> Result<Option<AngularRate>, Refusal> {
    let rate = within(number(radians_per_second)?, LARGEST_RATE, "rate_out_of_range")?;
    Ok(rate.map(AngularRate::from_radians_per_second))
}

pub fn within(value: Option<f64>, largest: f64, reason: &'static str) -> Result<Option<f64>, Refusal> {
    if value.is_some_and(|value| value.abs() > largest) { Err(Refusal::denied(reason)) } else { Ok(value) }
}

/// NaN is no demand; an infinite number is a fault.
pub fn number(value: f32) -> Result<Option<f64>, Refusal> {
    match value {
        value if value.is_nan() => Ok(None),
        value if value.is_infinite() => Err(Refusal::denied("infinite_number")),
        value => Ok(Some(f64::from(value))),
    }
}
