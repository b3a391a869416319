//! `serial`: a serial port or pseudo-terminal, which may go and come back at any time.

use std::io;
use std::path::Path;
use std::task::{Context, Poll};
use std::time::Duration;

use tokio::io::unix::AsyncFd;
use tokio_serial::{ClearBuffer, SerialPort, SerialStream};

use super::backoff::Backoff;
use super::frame_queue::FrameQueue;
use super::inbox::{Inbox, PeerIndex, PeerSet};
use super::input_ready::watch_input;
use super::send_failures::SendFailures;
use super::{Link, Progress, cause, serial_port};
use crate::timestamp::Timestamp;

const PEER: PeerIndex = 0;
/// What may wait for a line that was thought to be free: two long frames. More would arrive too late to be of use.
const OUTPUT_LIMIT: usize = 600;
/// Frames that wait longer are dropped, unless they are partly on the line.
const STALL_LIMIT: Duration = Duration::from_secs(1);
/// How often a line that took nothing is tried again.
const RETRY_INTERVAL: Duration = Duration::from_millis(5);
/// What the terminal layer hands out at a time.
const READ_LENGTH: usize = 4096;
/// Reads in one batch.
const READS: usize = 4;

/// Opened by its configured path, again and again, because the device behind it may be another after it came back.
pub struct SerialLink {
    path: String,
    baud: u32,
    state: State,
    backoff: Backoff,
    failures: SendFailures,
}

enum State {
    Closed { retry_at: Timestamp },
    Open(Port),
}

struct Port {
    /// Waits for input only: drivers report room for output after every frame, and each report would wake the event
    /// loop. The pace is kept by the core, so that there nearly always is room.
    device: AsyncFd<SerialStream>,
    output: FrameQueue,
    retry_at: Option<Timestamp>,
    failure: Option<io::Error>,
}

impl SerialLink {
    pub fn new(path: String, baud: u32) -> Self {
        Self {
            path,
            baud,
            state: State::Closed { retry_at: Timestamp::ZERO },
            backoff: Backoff::for_devices(),
            failures: SendFailures::default(),
        }
    }

    fn open(&mut self, now: Timestamp, inbox: &mut Inbox) {
        match Port::open(&self.path, self.baud) {
            Ok(port) => {
                self.state = State::Open(port);
                inbox.up();
                inbox.peer_appeared(PEER, self.path.clone());
            }
            Err(error) => {
                self.state = State::Closed { retry_at: self.backoff.failed(now) };
                inbox.down(format!("cannot open {}: {}", self.path, why_closed(&self.path, &error)));
            }
        }
    }
}

/// The library calls a lock, and a port that was opened for its holder alone, a device that is not there.
fn why_closed(path: &str, error: &io::Error) -> String {
    if error.kind() == io::ErrorKind::NotFound && Path::new(path).exists() {
        return "another program holds it; gimbald scan names it".to_owned();
    }
    cause(error)
}

impl Port {
    fn open(path: &str, baud: u32) -> io::Result<Self> {
        // To open the multiplexer makes a new pseudo-terminal, where nobody is.
        if let Some(what) = serial_port::leads_to_no_line(path) {
            return Err(io::Error::other(format!("it is {what}, where no gimbal can be")));
        }
        let device = serial_port::open(path, baud)?;
        // What came in while nobody listened is stale.
        device.clear(ClearBuffer::Input)?;
        Ok(Self { device: watch_input(device)?, output: FrameQueue::new(OUTPUT_LIMIT), retry_at: None, failure: None })
    }

    fn poll(&mut self, cx: &mut Context<'_>, inbox: &mut Inbox) -> io::Result<Progress> {
        for _ in 0..READS {
            let Some(buffer) = inbox.buffer() else { return Ok(Progress::More) };
            let mut ready = match self.device.poll_read_ready_mut(cx) {
                Poll::Pending => return Ok(Progress::Idle),
                Poll::Ready(ready) => ready?,
            };
            match ready.get_inner_mut().try_read(&mut buffer[..READ_LENGTH]) {
                Ok(0) => return Err(io::Error::new(io::ErrorKind::UnexpectedEof, "the device is gone")),
                Ok(length) => {
                    // Fewer bytes than asked for means that there are no more.
                    if length < READ_LENGTH {
                        ready.clear_ready();
                    }
                    inbox.received(PEER, length);
                }
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => ready.clear_ready(),
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => return Err(error),
            }
        }
        Ok(Progress::More)
    }

    fn flush(&mut self, now: Timestamp) {
        if self.output.is_empty() {
            return;
        }
        let device = self.device.get_mut();
        if let Err(error) = self.output.write(now, |bytes| device.try_write(bytes)) {
            self.failure = Some(error);
        }
        self.retry_at = self.output.stalled_since().map(|_| now + RETRY_INTERVAL);
    }

    fn retry(&mut self, now: Timestamp, failures: &mut SendFailures) {
        if self.retry_at.is_some_and(|at| now >= at) {
            self.flush(now);
        }
        if self.output.stalled_since().is_some_and(|since| now.since(since) >= STALL_LIMIT) {
            failures.note(PEER, self.output.drop_unbegun(), "the line takes nothing");
        }
    }
}

impl Drop for Port {
    fn drop(&mut self) {
        // Closing waits, for up to 30 s with some drivers, until a line that takes nothing has taken what is left.
        if (self.failure.is_some() || self.output.stalled_since().is_some())
            && let Err(error) = self.device.get_ref().clear(ClearBuffer::Output)
        {
            tracing::debug!(%error, "the output of a lost device could not be dropped");
        }
    }
}

impl Link for SerialLink {
    fn poll(&mut self, now: Timestamp, cx: &mut Context<'_>, inbox: &mut Inbox) -> Progress {
        if let State::Closed { retry_at } = &self.state
            && now >= *retry_at
        {
            self.open(now, inbox);
        }
        let State::Open(port) = &mut self.state else { return Progress::Idle };
        port.retry(now, &mut self.failures);
        self.failures.report(inbox);
        let result = match port.failure.take() {
            Some(error) => Err(error),
            None => port.poll(cx, inbox),
        };
        match result {
            Ok(progress) => progress,
            Err(error) => {
                let reason = format!("lost {}: {}", self.path, cause(&error));
                port.failure = Some(error);
                inbox.send_failed(PEER, port.output.frames(), "the device is gone");
                self.state = State::Closed { retry_at: self.backoff.failed(now) };
                inbox.down(reason);
                Progress::Idle
            }
        }
    }

    fn poll_timeout(&self) -> Option<Timestamp> {
        match &self.state {
            State::Closed { retry_at } => Some(*retry_at),
            State::Open(Port { failure: Some(_), .. }) => Some(Timestamp::ZERO),
            State::Open(port) => port.retry_at,
        }
    }

    fn send(&mut self, _peers: PeerSet, frame: &[u8]) {
        if let State::Open(port) = &mut self.state
            && !port.output.push(frame)
        {
            self.failures.note(PEER, 1, "the line takes nothing");
        }
    }

    fn flush(&mut self, now: Timestamp) {
        if let State::Open(port) = &mut self.state {
            port.flush(now);
        }
    }

    fn has_unsent(&self) -> bool {
        matches!(&self.state, State::Open(port) if !port.output.is_empty())
    }

    fn refuse(&mut self, _peer: PeerIndex) {
        // The link has one peer for ever; without a channel nothing is sent to it, and it is asked for nothing.
    }
}

#[cfg(test)]
mod tests;
