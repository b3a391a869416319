//! What holds for any input.

mod adoption;
mod asked;
mod manager;
mod routing;
mod wire;
