//! `tcpin`: listens; each connection is a peer.

use std::io;
use std::net::SocketAddr;
use std::task::{Context, Poll};

use socket2::{Domain, Protocol, Socket, Type};
use tokio::net::TcpListener;

use super::backoff::Backoff;
use super::connection::Connection;
use super::inbox::{Inbox, PEERS, PeerIndex, PeerSet};
use super::send_failures::SendFailures;
use super::{Link, Progress, cause};
use crate::timestamp::Timestamp;

/// Connections that the kernel keeps until they are accepted.
const BACKLOG: i32 = 16;
/// Connections accepted in one poll.
const ACCEPTS: usize = 4;

pub struct TcpServer {
    address: SocketAddr,
    state: State,
    connections: [Option<Connection>; PEERS],
    backoff: Backoff,
    failures: SendFailures,
    refusal_told: bool,
}

enum State {
    Closed { retry_at: Timestamp },
    Open(TcpListener),
}

impl TcpServer {
    pub fn new(address: SocketAddr) -> Self {
        Self {
            address,
            state: State::Closed { retry_at: Timestamp::ZERO },
            connections: Default::default(),
            backoff: Backoff::for_sockets(),
            failures: SendFailures::default(),
            refusal_told: false,
        }
    }

    fn open(&mut self, now: Timestamp, inbox: &mut Inbox) {
        match listen(self.address) {
            Ok(listener) => {
                self.state = State::Open(listener);
                self.backoff.reset();
                inbox.up();
            }
            Err(error) => self.close(now, &error, inbox),
        }
    }

    fn close(&mut self, now: Timestamp, error: &io::Error, inbox: &mut Inbox) {
        self.state = State::Closed { retry_at: self.backoff.failed(now) };
        self.connections = Default::default();
        inbox.down(format!("cannot listen on {}: {}", self.address, cause(error)));
    }

    fn accept(&mut self, now: Timestamp, cx: &mut Context<'_>, inbox: &mut Inbox) -> Progress {
        for _ in 0..ACCEPTS {
            let State::Open(listener) = &self.state else { return Progress::Idle };
            match listener.poll_accept(cx) {
                Poll::Pending => return Progress::Idle,
                Poll::Ready(Ok((stream, _))) => match Connection::new(stream).and_then(with_address) {
                    Ok((connection, address)) => self.admit(connection, address, inbox),
                    Err(error) => tracing::debug!(reason = cause(&error), "a connection was gone at once"),
                },
                Poll::Ready(Err(error)) if error.kind() == io::ErrorKind::ConnectionAborted => {}
                Poll::Ready(Err(error)) => {
                    self.close(now, &error, inbox);
                    return Progress::Idle;
                }
            }
        }
        Progress::More
    }

    fn admit(&mut self, connection: Connection, address: SocketAddr, inbox: &mut Inbox) {
        match self.connections.iter().position(Option::is_none) {
            Some(peer) => {
                self.connections[peer] = Some(connection);
                inbox.peer_appeared(peer, address.to_string());
            }
            None if self.refusal_told => {}
            None => {
                self.refusal_told = true;
                tracing::warn!(%address, "too many connections to one port, newcomers are closed");
            }
        }
    }
}

fn listen(address: SocketAddr) -> io::Result<TcpListener> {
    let socket = Socket::new(Domain::for_address(address), Type::STREAM.nonblocking(), Some(Protocol::TCP))?;
    // Connections of an earlier run that the kernel is still winding up do not keep us from the port.
    socket.set_reuse_address(true)?;
    socket.bind(&address.into())?;
    socket.listen(BACKLOG)?;
    TcpListener::from_std(socket.into())
}

fn with_address(connection: Connection) -> io::Result<(Connection, SocketAddr)> {
    let address = connection.address()?;
    Ok((connection, address))
}

impl Link for TcpServer {
    fn poll(&mut self, now: Timestamp, cx: &mut Context<'_>, inbox: &mut Inbox) -> Progress {
        self.failures.report(inbox);
        if let State::Closed { retry_at } = &self.state
            && now >= *retry_at
        {
            self.open(now, inbox);
        }
        let mut progress = self.accept(now, cx, inbox);
        for (peer, slot) in self.connections.iter_mut().enumerate() {
            let Some(connection) = slot else { continue };
            match connection.poll(now, peer, cx, inbox) {
                Ok(Progress::Idle) => {}
                Ok(Progress::More) => progress = Progress::More,
                Err(error) => {
                    tracing::debug!(peer, reason = cause(&error), "connection closed");
                    if connection.unsent() > 0 {
                        inbox.send_failed(peer, connection.unsent(), "the connection was lost");
                    }
                    *slot = None;
                    inbox.peer_left(peer);
                }
            }
        }
        progress
    }

    fn poll_timeout(&self) -> Option<Timestamp> {
        match &self.state {
            State::Closed { retry_at } => Some(*retry_at),
            State::Open(_) => self.connections.iter().flatten().filter_map(Connection::poll_timeout).min(),
        }
    }

    fn send(&mut self, peers: PeerSet, frame: &[u8]) {
        for peer in peers {
            if let Some(connection) = &mut self.connections[peer] {
                connection.send(peer, frame, &mut self.failures);
            }
        }
    }

    fn flush(&mut self, now: Timestamp) {
        for connection in self.connections.iter_mut().flatten() {
            connection.flush(now);
        }
    }

    fn has_unsent(&self) -> bool {
        self.connections.iter().flatten().any(|connection| connection.unsent() > 0)
    }

    fn refuse(&mut self, peer: PeerIndex) {
        self.connections[peer] = None;
    }
}
