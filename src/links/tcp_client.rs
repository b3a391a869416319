//! `tcpout`: connects, and again when the connection is lost.

use std::future::Future;
use std::io;
use std::net::SocketAddr;
use std::pin::Pin;
use std::task::{Context, Poll};
use std::time::Duration;

use tokio::net::TcpStream;

use super::backoff::Backoff;
use super::connection::Connection;
use super::inbox::{Inbox, PeerIndex, PeerSet};
use super::send_failures::SendFailures;
use super::{Link, Progress, cause};
use crate::timestamp::Timestamp;

const PEER: PeerIndex = 0;
const CONNECT_TIMEOUT: Duration = Duration::from_secs(5);

pub struct TcpClient {
    peer: SocketAddr,
    state: State,
    backoff: Backoff,
    failures: SendFailures,
}

enum State {
    Closed { retry_at: Timestamp },
    Connecting { attempt: Pin<Box<dyn Future<Output = io::Result<TcpStream>>>>, give_up_at: Timestamp },
    Open(Connection),
}

impl TcpClient {
    pub fn new(peer: SocketAddr) -> Self {
        Self {
            peer,
            state: State::Closed { retry_at: Timestamp::ZERO },
            backoff: Backoff::for_sockets(),
            failures: SendFailures::default(),
        }
    }

    fn connect(&mut self, now: Timestamp, cx: &mut Context<'_>, inbox: &mut Inbox) {
        if let State::Closed { retry_at } = &self.state
            && now >= *retry_at
        {
            let attempt = Box::pin(TcpStream::connect(self.peer));
            self.state = State::Connecting { attempt, give_up_at: now + CONNECT_TIMEOUT };
        }
        if let State::Connecting { attempt, give_up_at } = &mut self.state {
            let connected = match attempt.as_mut().poll(cx) {
                Poll::Ready(result) => result.and_then(Connection::new),
                Poll::Pending if now >= *give_up_at => Err(io::Error::new(io::ErrorKind::TimedOut, "no answer")),
                Poll::Pending => return,
            };
            match connected {
                Ok(connection) => {
                    self.state = State::Open(connection);
                    self.backoff.reset();
                    inbox.up();
                    inbox.peer_appeared(PEER, self.peer.to_string());
                }
                Err(error) => self.close(now, format!("cannot connect to {}: {}", self.peer, cause(&error)), inbox),
            }
        }
    }

    fn close(&mut self, now: Timestamp, reason: String, inbox: &mut Inbox) {
        self.state = State::Closed { retry_at: self.backoff.failed(now) };
        inbox.down(reason);
    }
}

impl Link for TcpClient {
    fn poll(&mut self, now: Timestamp, cx: &mut Context<'_>, inbox: &mut Inbox) -> Progress {
        self.failures.report(inbox);
        self.connect(now, cx, inbox);
        let State::Open(connection) = &mut self.state else { return Progress::Idle };
        match connection.poll(now, PEER, cx, inbox) {
            Ok(progress) => progress,
            Err(error) => {
                inbox.send_failed(PEER, connection.unsent(), "the connection was lost");
                self.close(now, format!("lost {}: {}", self.peer, cause(&error)), inbox);
                Progress::Idle
            }
        }
    }

    fn poll_timeout(&self) -> Option<Timestamp> {
        match &self.state {
            State::Closed { retry_at } => Some(*retry_at),
            State::Connecting { give_up_at, .. } => Some(*give_up_at),
            State::Open(connection) => connection.poll_timeout(),
        }
    }

    fn send(&mut self, _peers: PeerSet, frame: &[u8]) {
        if let State::Open(connection) = &mut self.state {
            connection.send(PEER, frame, &mut self.failures);
        }
    }

    fn flush(&mut self, now: Timestamp) {
        if let State::Open(connection) = &mut self.state {
            connection.flush(now);
        }
    }

    fn has_unsent(&self) -> bool {
        matches!(&self.state, State::Open(connection) if connection.unsent() > 0)
    }

    fn refuse(&mut self, _peer: PeerIndex) {
        // The link has one peer for ever; without a channel nothing is sent to it, and it is asked for nothing.
    }
}
