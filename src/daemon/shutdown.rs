//! The end of the process: SIGTERM, SIGINT.

use std::io;
use std::task::{Context, Poll};
use std::time::Duration;

use tokio::signal::unix::{Signal, SignalKind, signal};

use crate::timestamp::Timestamp;

/// Goodbyes that did not leave within this time stay behind.
const PATIENCE: Duration = Duration::from_millis(500);

/// Waits for a request to end, and then for the time that it may take.
pub struct Shutdown {
    terminate: Signal,
    interrupt: Signal,
    leave_at: Option<Timestamp>,
}

impl Shutdown {
    pub fn new() -> io::Result<Self> {
        Ok(Self {
            terminate: signal(SignalKind::terminate())?,
            interrupt: signal(SignalKind::interrupt())?,
            leave_at: None,
        })
    }

    /// `true` once, when the end is asked for. Who asks again need not wait any longer.
    pub fn poll(&mut self, now: Timestamp, cx: &mut Context<'_>) -> bool {
        let mut first = false;
        while self.asked(cx) {
            first |= self.leave_at.is_none();
            self.leave_at = Some(if self.leave_at.is_none() { now + PATIENCE } else { now });
        }
        first
    }

    fn asked(&mut self, cx: &mut Context<'_>) -> bool {
        matches!(self.terminate.poll_recv(cx), Poll::Ready(Some(())))
            || matches!(self.interrupt.poll_recv(cx), Poll::Ready(Some(())))
    }

    /// When to leave even if not everything was said; `None` while nobody asked for the end.
    pub fn leave_at(&self) -> Option<Timestamp> {
        self.leave_at
    }
}
