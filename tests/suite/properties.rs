//! What holds for any input.

mod manager;
mod wire;
