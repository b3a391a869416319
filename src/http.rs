//! The window: the state of the daemon as a page for people and as JSON for programs, and what is asked of gimbals.
//!
//! Runs on a thread of its own, so that nothing a browser does delays a frame. It sees the core through a
//! [`CoreHandle`] only: it asks for a snapshot and shows the one that the core publishes, and gives on what is asked.
//! Reading needs no token; control does (`control`).

#[cfg(test)]
pub(crate) mod canned;
mod control;
mod fresh;
mod gimbals;
mod hosts;
mod openapi;
mod page;
pub mod readiness;
mod routes;
mod server;
#[cfg(test)]
mod tests;

use std::io;
use std::thread::JoinHandle;

use crate::config::settings::HttpSettings;
use crate::daemon::window::CoreHandle;

/// Starts the window's thread, which ends when the core has dropped its ends of `core`.
///
/// A port that is taken, or an address that is not there yet, is no error: it is logged and tried again. The error is
/// that of a system out of threads or file descriptors.
pub fn spawn(settings: HttpSettings, core: CoreHandle) -> io::Result<JoinHandle<()>> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_io().enable_time().build()?;
    std::thread::Builder::new()
        .name("http".to_owned())
        .spawn(move || runtime.block_on(server::run(settings, core, server::Limits::default())))
}
