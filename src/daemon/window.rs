//! How the rest of the process sees the core: it asks for a snapshot, and reads the latest one.

use std::sync::Arc;

use tokio::sync::{mpsc, watch};

use crate::bridge::snapshot::Snapshot;

/// What may be asked of the core.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CoreRequest {
    /// Publish a fresh snapshot.
    Refresh,
}

/// The ends of the core's channels that others hold; nothing is computed unless it was asked for.
#[derive(Clone, Debug)]
pub struct CoreHandle {
    pub requests: mpsc::Sender<CoreRequest>,
    pub snapshots: watch::Receiver<Arc<Snapshot>>,
}
