//! Puts the daemon together, and runs it until it is asked to end.

use std::future::poll_fn;
use std::io;
use std::sync::Arc;

use tokio::sync::{mpsc, watch};

use super::clock::{Clock, DeadlineTimer};
use super::event_loop::{EventLoop, Kept, REQUESTS, Window};
use super::shutdown::Shutdown;
use super::state_file::StateFile;
use super::system_id_file::SystemIdFile;
use super::systemd::ServiceManager;
use super::turning_file::TurningFile;
use super::window::CoreHandle;
use crate::bridge::Bridge;
use crate::config::settings::DaemonSettings;
use crate::{http, links};

/// Why the daemon could not start, or not go on.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    #[error("the event loop could not be started")]
    Runtime(#[source] io::Error),
    #[error("the signals that end the process could not be caught")]
    Signals(#[source] io::Error),
    #[error("the timer failed")]
    Timer(#[source] io::Error),
    #[error("the thread that serves HTTP could not be started")]
    HttpThread(#[source] io::Error),
}

/// Runs until SIGTERM, SIGINT or SIGHUP.
///
/// The window runs on a thread of its own, so that no page ever holds up a frame; what becomes of it does not concern
/// the core.
pub fn run(settings: DaemonSettings) -> Result<(), RunError> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_io().build().map_err(RunError::Runtime)?;
    runtime.block_on(async {
        let mut event_loop = assemble(settings)?;
        poll_fn(|cx| event_loop.poll(cx)).await.map_err(RunError::Timer)
    })
}

fn assemble(settings: DaemonSettings) -> Result<EventLoop, RunError> {
    // Signals first: whoever ends us while we start gets a goodbye too.
    let shutdown = Shutdown::new().map_err(RunError::Signals)?;
    let timer = DeadlineTimer::new().map_err(RunError::Timer)?;
    let clock = Clock::start();

    let state = settings.directories.state.as_deref();
    let system_id_file = SystemIdFile::new(state);
    let gimbal_ids_file = StateFile::new(state, "gimbal-ids");
    let turning_file = TurningFile::new(settings.directories.runtime);
    let mut core_settings = settings.core;
    core_settings.stored_system_id = core_settings.stored_system_id.or_else(|| system_id_file.read());
    core_settings.left_turning.append(&mut turning_file.read());
    let gimbal_ids = gimbal_ids_file.read().unwrap_or_default();
    core_settings.kept_ids.extend(gimbal_ids.lines().map(str::to_owned));
    let names = core_settings.links.iter().map(|link| link.name.clone()).collect();
    let core = Bridge::new(clock.now(), core_settings);

    let (requests, received_requests) = mpsc::channel(REQUESTS);
    let (published, snapshots) = watch::channel(Arc::new(core.snapshot(clock.now())));
    if let Some(http) = settings.http {
        let handle = CoreHandle { requests, snapshots };
        http::spawn(http, handle).map_err(RunError::HttpThread)?;
    }

    let links = settings.endpoints.iter().map(links::link).collect();
    let window = Window { requests: received_requests, snapshots: published };
    let kept = Kept { system_id: system_id_file, gimbal_ids: gimbal_ids_file, turning: turning_file };
    Ok(EventLoop::new(core, links, names, clock, timer, shutdown, ServiceManager::new(), kept, window))
}
