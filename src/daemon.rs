//! The process around the core: clock, links, log, state file, service manager, and the window that others see it
//! through.

pub mod logging;
pub mod window;
