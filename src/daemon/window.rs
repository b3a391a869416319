//! How the rest of the process sees the core: it asks for a snapshot and reads the latest one, and asks things of gimbals.

use std::sync::Arc;

use tokio::sync::{mpsc, oneshot, watch};

use crate::bridge::snapshot::Snapshot;
use crate::manager::asked::{Answer, Asked};

/// What may be asked of the core.
#[derive(Debug)]
pub enum CoreRequest {
    /// Publish a fresh snapshot.
    Refresh,
    /// Something of the gimbal of that name, by somebody who may.
    Ask { gimbal: String, asked: Asked, answer: oneshot::Sender<Answer> },
}

/// The ends of the core's channels that others hold; nothing is computed unless it was asked for.
#[derive(Clone, Debug)]
pub struct CoreHandle {
    pub requests: mpsc::Sender<CoreRequest>,
    pub snapshots: watch::Receiver<Arc<Snapshot>>,
}
