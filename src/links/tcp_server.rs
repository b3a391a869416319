//! `tcpin`: listens; each connection is a peer.

use std::io;
use std::net::SocketAddr;
use std::task::{Context, Poll};
use std::time::Duration;

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
/// How long accepting rests after it failed.
const ACCEPT_RETRY: Duration = Duration::from_secs(2);

pub struct TcpServer {
    address: SocketAddr,
    state: State,
    connections: [Option<Connection>; PEERS],
    backoff: Backoff,
    failures: SendFailures,
    refusal_told: bool,
    /// Accepting failed; it is tried again then.
    accept_at: Option<Timestamp>,
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
            accept_at: None,
        }
    }

    fn open(&mut self, now: Timestamp, inbox: &mut Inbox) {
        match listen(self.address) {
            Ok(listener) => {
                self.state = State::Open(listener);
                self.backoff.reset();
                inbox.up();
            }
            Err(error) => {
                self.state = State::Closed { retry_at: self.backoff.failed(now) };
                inbox.down(format!("cannot listen on {}: {}", self.address, cause(&error)));
            }
        }
    }

    fn accept(&mut self, now: Timestamp, cx: &mut Context<'_>, inbox: &mut Inbox) -> Progress {
        if self.accept_at.is_some_and(|at| now < at) {
            return Progress::Idle;
        }
        self.accept_at = None;
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
                    // This process or the machine has no descriptor left; the connections there are go on.
                    tracing::warn!(address = %self.address, reason = cause(&error), "a connection cannot be accepted");
                    self.accept_at = Some(now + ACCEPT_RETRY);
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
                    inbox.send_failed(peer, connection.unsent(), "the connection was lost");
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
            State::Open(_) => {
                let connections = self.connections.iter().flatten().filter_map(Connection::poll_timeout);
                connections.chain(self.accept_at).min()
            }
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

#[cfg(test)]
mod tests {
    use std::io::{Read, Write};
    use std::net::TcpStream;

    use super::super::harness::{PATIENCE, Rig, Seen, noise, read_available, write_aside};
    use super::*;

    const FRAME_LENGTH: usize = 280;

    fn rig() -> (Rig<TcpServer>, SocketAddr) {
        let mut rig = Rig::new(TcpServer::new("127.0.0.1:0".parse().expect("an address")));
        assert_eq!(rig.next(), Seen::Up);
        let address = match &rig.link.state {
            State::Open(listener) => listener.local_addr().expect("it is bound"),
            State::Closed { .. } => panic!("the link is up"),
        };
        (rig, address)
    }

    fn connect(rig: &mut Rig<TcpServer>, address: SocketAddr, expected: PeerIndex) -> TcpStream {
        let stream = TcpStream::connect(address).expect("the link listens");
        stream.set_read_timeout(Some(PATIENCE)).expect("a socket takes it");
        let name = stream.local_addr().expect("it is connected").to_string();
        assert_eq!(rig.next(), Seen::Appeared(expected, name));
        stream
    }

    fn frame(number: u32) -> Vec<u8> {
        number.to_le_bytes().into_iter().cycle().take(FRAME_LENGTH).collect()
    }

    /// "`tcpin`: listen, each connection a channel (bounded 16)".
    #[test]
    fn each_connection_is_a_peer_and_the_seventeenth_is_closed() {
        let (mut rig, address) = rig();
        let mut peers: Vec<_> = (0..PEERS).map(|peer| connect(&mut rig, address, peer)).collect();
        for (number, stream) in peers.iter_mut().enumerate() {
            stream.write_all(&[number as u8]).expect("sent");
            assert_eq!(rig.next(), Seen::Received(number, vec![number as u8]));
            rig.send(number, &[100 + number as u8]);
            let mut answer = [0];
            stream.read_exact(&mut answer).expect("the answer arrives");
            assert_eq!(answer, [100 + number as u8]);
        }

        let mut refused = TcpStream::connect(address).expect("the kernel takes it");
        refused.set_read_timeout(Some(PATIENCE)).expect("a socket takes it");
        rig.expect_silence();
        assert_eq!(refused.read(&mut [0]).expect("it is closed in good order"), 0);

        drop(peers.remove(3));
        assert_eq!(rig.next(), Seen::Left(3));
        connect(&mut rig, address, 3);
    }

    /// "a TCP peer that does not read never delays others: bounded pending output per connection, whole frames dropped
    /// and reported", and what a slow reader does get are whole frames.
    #[test]
    fn a_peer_that_does_not_read_costs_the_others_nothing() {
        let (mut rig, address) = rig();
        let mut slow = connect(&mut rig, address, 0);
        let mut quick = connect(&mut rig, address, 1);
        let mut both = PeerSet::from(0);
        both.insert(1);

        let mut dropped = 0;
        let mut sent = 0;
        while dropped < 100 {
            rig.send(both, &frame(sent));
            let mut arrived = [0; FRAME_LENGTH];
            quick.read_exact(&mut arrived).expect("it arrives at once");
            assert_eq!(arrived[..], frame(sent));
            sent += 1;
            rig.until(|rig| match rig.poll_once() {
                Some(Seen::SendFailed(0, count, "the other side does not read fast enough")) => {
                    dropped += count;
                    Some(())
                }
                Some(other) => panic!("unexpected {other:?}"),
                None => Some(()),
            });
        }

        slow.set_nonblocking(true).expect("a socket takes it");
        let mut arrived = Vec::new();
        rig.until(|rig| {
            read_available(&mut slow, &mut arrived);
            (!rig.link.has_unsent() && arrived.len() == (sent - dropped) as usize * FRAME_LENGTH).then_some(())
        });
        for (number, arrived) in (0..).zip(arrived.chunks(FRAME_LENGTH)) {
            assert_eq!(arrived, frame(number), "whole frames in their order");
        }
    }

    /// "never spins on": as long as a peer does not read, the link is woken by room or by the end of its patience, also
    /// when others' wake-ups and further frames flush it.
    #[test]
    fn a_peer_that_does_not_read_wakes_nobody() {
        let (mut rig, address) = rig();
        let mut slow = connect(&mut rig, address, 0);
        // The kernel finds more room for a while; what counts is that it has none in the end.
        while rig.poll_once().is_none() {
            rig.send(0, &frame(1));
        }
        rig.expect_silence();

        for _ in 0..10 {
            rig.send(0, &frame(2));
            assert_eq!(rig.link.poll_timeout(), Some(rig.now + Duration::from_secs(10)));
            assert!(matches!(rig.poll_once(), None | Some(Seen::SendFailed(0, ..))));
        }

        slow.set_nonblocking(true).expect("a socket takes it");
        rig.until(|rig| {
            read_available(&mut slow, &mut Vec::new());
            (!rig.link.has_unsent()).then_some(())
        });
        assert_eq!(rig.link.poll_timeout(), None);
    }

    /// "connection closed after 10 s without progress".
    #[test]
    fn a_peer_that_takes_nothing_for_ten_seconds_is_closed() {
        let (mut rig, address) = rig();
        let _slow = connect(&mut rig, address, 0);
        while !rig.link.has_unsent() {
            rig.send(0, &frame(1));
        }
        assert_eq!(rig.link.poll_timeout(), Some(Timestamp::ZERO), "to be polled, so that room will wake it");
        // The kernel finds more room for a while; what counts is that it has none in the end.
        while rig.poll_once().is_none() {
            rig.send(0, &frame(1));
        }
        rig.expect_silence();
        assert_eq!(rig.link.poll_timeout(), Some(rig.now + Duration::from_secs(10)));
        rig.pass(Duration::from_secs(9));
        rig.expect_silence();

        rig.pass(Duration::from_secs(1));
        let Seen::SendFailed(0, frames, "the connection was lost") = rig.next() else {
            panic!("what waited is reported")
        };
        assert!(frames > 0);
        assert_eq!(rig.next(), Seen::Left(0));
    }

    #[test]
    fn a_port_that_is_taken_is_waited_for() {
        let other = std::net::TcpListener::bind("127.0.0.1:0").expect("a free port");
        let address = other.local_addr().expect("it is bound");
        let mut rig = Rig::new(TcpServer::new(address));
        assert_eq!(rig.next(), Seen::Down(format!("cannot listen on {address}: address already in use")));
        drop(other);
        rig.pass(Duration::from_millis(250));
        assert_eq!(rig.next(), Seen::Up);
    }

    #[test]
    fn ten_megabytes_pass_without_growth() {
        let (mut rig, address) = rig();
        let stream = connect(&mut rig, address, 0);
        let bytes = noise(10_000_000);
        let writer = write_aside(stream, bytes.clone());
        assert!(rig.receive(0, bytes.len()) == bytes, "what arrives is what was sent");
        writer.join().expect("all was written");
    }
}
