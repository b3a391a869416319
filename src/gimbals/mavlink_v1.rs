//! Gimbals that speak MAVLink v1 mount commands, as ArduPilot's contract for them has it.

pub mod config;
pub mod driver;
mod obedience;
pub mod packet;
pub mod sim;

pub use driver::MavlinkV1Driver;
