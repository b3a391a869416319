//! Runs the core: the clock, the links' tasks, and the window that others see it through.

pub mod window;
