//! What each command does.

pub mod status;
