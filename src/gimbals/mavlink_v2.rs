//! Gimbals that speak the device side of MAVLink Gimbal Protocol v2.

pub mod driver;
pub mod packet;
pub mod sim;

pub use driver::MavlinkV2Driver;
