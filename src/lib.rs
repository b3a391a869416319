//! gimbald: a MAVLink gimbal manager daemon for companion computers.
//!
//! `docs/architecture.md` tells how the parts fit together.

pub mod actions;
pub mod bridge;
pub mod channel;
pub mod cli;
pub mod commands;
pub mod config;
pub mod daemon;
pub mod endpoint;
pub mod exit_code;
pub mod geometry;
pub mod gimbals;
pub mod http;
pub mod links;
pub mod manager;
pub mod router;
pub mod sim;
pub mod timers;
pub mod timestamp;
pub mod token;
pub mod vehicle;
pub mod wire;
