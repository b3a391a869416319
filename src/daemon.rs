//! The process around the core: clock, links, log, state file, service manager, and the window that others see it
//! through.

mod askers;
mod channels;
pub mod clock;
mod event_loop;
pub mod logging;
pub mod shutdown;
mod state_file;
pub mod supervisor;
mod system_id_file;
mod systemd;
mod turning_file;
pub mod window;
