//! What the operator said, checked.

pub mod settings;
