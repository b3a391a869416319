//! Gimbals by Gremsy, whose firmware speaks MAVLink in two generations: mount commands with the vendor's own modes
//! (v1), and the Gimbal Protocol v2 with the vendor's own flags (v2).
//!
//! Facts are those of the vendor's gSDK (2020 to 2026) and its guide; what no published source settles says so.

pub mod config;
pub mod driver;
pub mod modes;
pub mod packet;
pub mod parameters;
pub mod readings;
pub mod sim;
pub mod status;
pub mod version;

pub use driver::GremsyDriver;

use self::parameters::ParameterTable;
use crate::gimbals::mavlink_v2::packet::{WhichGimbal, read_information};
use crate::gimbals::settings::Family;
use crate::wire::dialect::{CharArray, MavMessage, PARAM_REQUEST_READ_DATA, PARAM_VALUE_DATA};
use crate::wire::{Frame, MavId};

/// Whether `GIMBAL_DEVICE_INFORMATION` with that vendor is a Gremsy's.
pub fn is_vendor(vendor: &str) -> bool {
    vendor.trim().eq_ignore_ascii_case("gremsy")
}

/// Whether by that frame a gimbal says that it is a Gremsy: by its maker's name, or by a parameter that only a Gremsy has.
pub fn is_known_by(frame: &Frame<'_>) -> bool {
    let value = frame.decode::<PARAM_VALUE_DATA>();
    let name = value.as_ref().and_then(|value| value.param_id.to_str().ok());
    vendor(frame).is_some_and(|vendor| is_vendor(&vendor)) || ParameterTable::recognised_by(name).is_some()
}

/// Whether by that frame a gimbal says that somebody else made it.
pub fn is_denied_by(frame: &Frame<'_>) -> bool {
    vendor(frame).is_some_and(|vendor| !vendor.is_empty() && !is_vendor(&vendor))
}

/// Who made it, as a v2 device says of itself.
fn vendor(frame: &Frame<'_>) -> Option<String> {
    let information = read_information(frame).filter(|information| information.of == WhichGimbal::Sender)?;
    Some(information.identity.vendor)
}

/// Asks a gimbal for parameters that only a Gremsy has.
pub fn telling_questions(device: MavId) -> impl Iterator<Item = MavMessage> {
    ParameterTable::TELLING_NAMES.into_iter().map(move |name| {
        MavMessage::PARAM_REQUEST_READ(PARAM_REQUEST_READ_DATA {
            param_index: -1,
            target_system: device.system,
            target_component: device.component,
            param_id: CharArray::from(name),
        })
    })
}

/// What is wrong with a Gremsy that is driven as one of `family`.
pub fn wrong_family(family: Family) -> String {
    format!(
        "this gimbal says that it is a Gremsy, but its family is {}. Set family = \"gremsy\", or leave the key out",
        family.name()
    )
}
