//! What holds for any input.

mod wire;
