//! One module for each command: what it does with its arguments, and how it ends.

pub mod check;
mod client;
mod daemon_address;
pub mod demo;
pub mod gimbal;
pub mod run;
pub mod scan;
pub mod sim;
pub mod status;
