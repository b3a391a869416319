//! Which driver belongs to which family.

use super::detection::Detection;
use super::driver::GimbalDriver;
use super::gremsy::GremsyDriver;
use super::mavlink_v1::MavlinkV1Driver;
use super::mavlink_v2::MavlinkV2Driver;
use super::settings::{Family, GimbalSettings};

/// The driver of a gimbal of `family`.
pub fn driver(family: Family, settings: &GimbalSettings) -> Box<dyn GimbalDriver> {
    match family {
        Family::Auto => Box::new(Detection::new(settings.clone())),
        Family::MavlinkV2 => Box::new(MavlinkV2Driver::new()),
        Family::MavlinkV1 => Box::new(MavlinkV1Driver::new(settings.v1)),
        Family::Gremsy => Box::new(GremsyDriver::new(settings.gremsy)),
    }
}
