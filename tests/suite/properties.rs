//! What holds for any input.

mod manager;
mod routing;
mod wire;
