//! What more than one test needs.

pub mod script;
pub mod tlog;
pub mod wire;
pub mod world;
