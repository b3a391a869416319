//! What holds for any input.

mod routing;
mod wire;
