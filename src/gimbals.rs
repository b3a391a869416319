//! Gimbals behind one driver trait, a folder per family.

pub mod adapt;
pub mod boot_clock;
pub mod capabilities;
pub mod details;
pub mod detection;
pub mod driver;
pub mod families;
pub mod gremsy;
pub mod heard_time;
pub mod mavlink_v1;
pub mod mavlink_v2;
pub mod operation;
pub mod parameters;
pub mod report;
pub mod rest_watch;
pub mod setpoint;
pub mod settings;
pub mod signs;
pub mod told_rates;

pub use driver::{CommandOutcome, DriverOutput, GimbalDriver};
