//! Manual control (`GIMBAL_MANAGER_SET_MANUAL_CONTROL`, 288): from −1…1 to angles and rates.
//!
//! What full deflection means is the manager's business (Gimbal Protocol v2): the ends of the gimbal's reach, or the
//! configured rates.

use super::request::Demand;
use crate::geometry::{Angle, AngularRate, AxisLimits, Limits};
use crate::gimbals::settings::GimbalSettings;

/// `demand` in angles and rates, with 0 at straight ahead and each end of the stick at that end of the reach.
pub(super) fn scale(demand: &Demand, limits: &Limits, settings: &GimbalSettings) -> Demand {
    let mut scaled = *demand;
    scaled.pitch.angle = demand.pitch.angle.map(|fraction| reach(fraction, limits.pitch, 90.0));
    scaled.yaw.angle = demand.yaw.angle.map(|fraction| reach(fraction, limits.yaw, 180.0));
    scaled.pitch.rate = demand.pitch.rate.map(|fraction| rate(fraction, settings.manual_pitch_rate_dps));
    scaled.yaw.rate = demand.yaw.rate.map(|fraction| rate(fraction, settings.manual_yaw_rate_dps));
    scaled
}

/// `substitute_deg` is the reach of an axis whose limits are not known.
fn reach(fraction: Angle, limits: Option<AxisLimits>, substitute_deg: f64) -> Angle {
    let (min, max) =
        limits.map_or((-substitute_deg, substitute_deg), |limits| (limits.min().degrees(), limits.max().degrees()));
    let fraction = fraction.radians();
    Angle::from_degrees(if fraction < 0.0 { -fraction * min } else { fraction * max })
}

fn rate(fraction: AngularRate, full_dps: f64) -> AngularRate {
    AngularRate::from_degrees_per_second(fraction.radians_per_second() * full_dps)
}
