//! The end of the process: SIGTERM, SIGINT, and SIGHUP, which a terminal sends that is closed, or a line that is cut.

use std::task::{Context, Poll};
use std::time::Duration;
use std::{fs, io};

use tokio::signal::unix::{Signal, SignalKind, signal};

use crate::timestamp::Timestamp;

/// Goodbyes that did not leave within this time stay behind.
const PATIENCE: Duration = Duration::from_millis(500);

/// Waits for a request to end, and then for the time that it may take.
pub struct Shutdown {
    signals: Vec<Signal>,
    leave_at: Option<Timestamp>,
}

impl Shutdown {
    pub fn new() -> io::Result<Self> {
        let mut signals = vec![signal(SignalKind::terminate())?, signal(SignalKind::interrupt())?];
        if !is_hangup_ignored() {
            signals.push(signal(SignalKind::hangup())?);
        }
        Ok(Self { signals, leave_at: None })
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
        self.signals.iter_mut().any(|signal| matches!(signal.poll_recv(cx), Poll::Ready(Some(()))))
    }

    /// When to leave even if not everything was said; `None` while nobody asked for the end.
    pub fn leave_at(&self) -> Option<Timestamp> {
        self.leave_at
    }
}

/// Whoever started the process with `nohup` wants it to outlive the terminal.
fn is_hangup_ignored() -> bool {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default(); // without it nobody is known to want that
    let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let mask = ignored.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or(0);
    mask & (1 << (SignalKind::hangup().as_raw_value() - 1)) != 0
}
