//! gimbald: a MAVLink gimbal manager daemon for companion computers.
//!
//! `docs/architecture.md` tells how the parts fit together.

pub mod bridge;
pub mod commands;
pub mod config;
pub mod daemon;
pub mod endpoint;
pub mod gimbals;
pub mod http;
pub mod manager;
pub mod timers;
pub mod timestamp;
pub mod wire;
