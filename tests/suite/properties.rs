//! What holds for any input.

mod adoption;
mod manager;
mod routing;
mod wire;
