//! What more than one test needs.

pub mod cable;
pub mod control_rule;
pub mod daemon;
pub mod documented;
pub mod ground_station;
pub mod hub;
pub mod interception;
pub mod line;
pub mod script;
pub mod tlog;
pub mod wire;
pub mod world;
