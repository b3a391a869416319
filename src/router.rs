//! Decides where a frame goes; never sends.
//!
//! Implements the routing rules of the MAVLink developer guide, numbered in `docs/routing.md`.

mod routes;
mod rules;

pub use routes::Routes;
pub use rules::{Router, Verdict};
