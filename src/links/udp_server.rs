//! `udpin` and `udpbcast`: one socket, and the peers that were heard on it.

use std::io;
use std::net::SocketAddr;
use std::task::Context;

use super::backoff::Backoff;
use super::datagrams::DatagramSocket;
use super::inbox::{Inbox, PeerIndex, PeerSet};
use super::peers::{Peers, Sender};
use super::send_failures::SendFailures;
use super::{Link, Progress, cause};
use crate::timestamp::Timestamp;

/// Binds a port and learns its peers; each of them is a conversation of its own.
pub struct UdpServer {
    mode: Mode,
    state: State,
    peers: Peers,
    backoff: Backoff,
    failures: SendFailures,
    refusal_told: bool,
}

#[derive(Clone, Copy)]
enum Mode {
    Listen(SocketAddr),
    /// Sends here while there is nobody else.
    Broadcast(SocketAddr),
}

#[expect(clippy::large_enum_variant, reason = "there is one for each link")]
enum State {
    Closed { retry_at: Timestamp },
    Open(DatagramSocket),
}

impl UdpServer {
    pub fn listening(address: SocketAddr) -> Self {
        Self::new(Mode::Listen(address))
    }

    pub fn broadcasting(address: SocketAddr) -> Self {
        Self::new(Mode::Broadcast(address))
    }

    fn new(mode: Mode) -> Self {
        Self {
            mode,
            state: State::Closed { retry_at: Timestamp::ZERO },
            peers: mode.no_peers(),
            backoff: Backoff::for_sockets(),
            failures: SendFailures::default(),
            refusal_told: false,
        }
    }

    fn open(&mut self, now: Timestamp, inbox: &mut Inbox) {
        match self.mode.socket() {
            Ok(socket) => {
                self.state = State::Open(socket);
                self.backoff.reset();
                inbox.up();
                self.speak_to_broadcast(inbox);
            }
            Err(error) => self.close(now, &error, inbox),
        }
    }

    fn close(&mut self, now: Timestamp, error: &io::Error, inbox: &mut Inbox) {
        self.state = State::Closed { retry_at: self.backoff.failed(now) };
        self.peers = self.mode.no_peers();
        inbox.down(match self.mode {
            Mode::Listen(address) => format!("cannot listen on {address}: {}", cause(error)),
            Mode::Broadcast(address) => format!("cannot broadcast to {address}: {}", cause(error)),
        });
    }

    fn speak_to_broadcast(&mut self, inbox: &mut Inbox) {
        if let Some((peer, address)) = self.peers.speak_to_broadcast() {
            inbox.peer_appeared(peer, address.to_string());
        }
    }

    fn expire_peers(&mut self, now: Timestamp, inbox: &mut Inbox) {
        for peer in self.peers.expire(now) {
            inbox.peer_left(peer);
        }
        self.speak_to_broadcast(inbox);
    }

    /// Puts the batch that was just received under the names of its senders.
    fn sort(&mut self, now: Timestamp, inbox: &mut Inbox) {
        let State::Open(socket) = &self.state else { return };
        let mut count = 0;
        for (buffer, (length, address)) in socket.received().enumerate() {
            count = buffer + 1;
            let Some(address) = address else { continue };
            match self.peers.heard(now, address) {
                Sender::Known(peer) => inbox.received_in(buffer, peer, length),
                Sender::New { peer, left } => {
                    for gone in left {
                        inbox.peer_left(gone);
                    }
                    inbox.peer_appeared(peer, SocketAddr::new(address.ip().to_canonical(), address.port()).to_string());
                    inbox.received_in(buffer, peer, length);
                }
                Sender::Refused => {
                    if !std::mem::replace(&mut self.refusal_told, true) {
                        tracing::warn!(%address, "too many peers on one port, newcomers are ignored");
                    }
                }
            }
        }
        inbox.take_buffers(count);
    }
}

impl Mode {
    fn socket(self) -> io::Result<DatagramSocket> {
        match self {
            Self::Listen(address) => DatagramSocket::bind(address),
            Self::Broadcast(address) => DatagramSocket::broadcast(address),
        }
    }

    fn no_peers(self) -> Peers {
        match self {
            Self::Listen(_) => Peers::new(None),
            Self::Broadcast(address) => Peers::new(Some(address)),
        }
    }
}

impl Link for UdpServer {
    fn poll(&mut self, now: Timestamp, cx: &mut Context<'_>, inbox: &mut Inbox) -> Progress {
        self.failures.report(inbox);
        if let State::Closed { retry_at } = &self.state
            && now >= *retry_at
        {
            self.open(now, inbox);
        }
        let State::Open(socket) = &mut self.state else { return Progress::Idle };
        let progress = match socket.poll_receive(cx, inbox) {
            Ok(progress) => progress,
            Err(error) => {
                self.close(now, &error, inbox);
                return Progress::Idle;
            }
        };
        self.sort(now, inbox);
        self.expire_peers(now, inbox);
        progress
    }

    fn poll_timeout(&self) -> Option<Timestamp> {
        match &self.state {
            State::Closed { retry_at } => Some(*retry_at),
            State::Open(_) => self.peers.check_at(),
        }
    }

    fn send(&mut self, peers: PeerSet, frame: &[u8]) {
        if let State::Open(socket) = &mut self.state {
            let peers = self.peers.present(peers);
            socket.send(peers, |peer| self.peers.destination(peer), frame, &mut self.failures);
        }
    }

    // An error concerns one destination: the socket serves the others, and waits for that network to return.
    fn flush(&mut self, _now: Timestamp) {
        if let State::Open(socket) = &mut self.state {
            socket.flush(&mut self.failures);
        }
    }

    fn has_unsent(&self) -> bool {
        false
    }

    fn refuse(&mut self, peer: PeerIndex) {
        self.peers.remove(peer);
    }
}
