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

/// Whether `GIMBAL_DEVICE_INFORMATION` with that vendor is a Gremsy's.
pub fn is_vendor(vendor: &str) -> bool {
    vendor.trim().eq_ignore_ascii_case("gremsy")
}
