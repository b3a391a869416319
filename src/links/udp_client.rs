//! `udpout`: speaks first, to one peer.

use std::io;
use std::net::SocketAddr;
use std::task::Context;

use super::backoff::Backoff;
use super::datagrams::DatagramSocket;
use super::inbox::{Inbox, PeerIndex, PeerSet};
use super::send_failures::SendFailures;
use super::{Link, Progress, cause};
use crate::timestamp::Timestamp;

const PEER: PeerIndex = 0;

/// A connected socket: the kernel drops what others send to it.
pub struct UdpClient {
    peer: SocketAddr,
    state: State,
    backoff: Backoff,
    failures: SendFailures,
}

#[expect(clippy::large_enum_variant, reason = "there is one for each link")]
enum State {
    Closed { retry_at: Timestamp },
    Open(DatagramSocket),
}

impl UdpClient {
    pub fn new(peer: SocketAddr) -> Self {
        Self {
            peer,
            state: State::Closed { retry_at: Timestamp::ZERO },
            backoff: Backoff::for_sockets(),
            failures: SendFailures::default(),
        }
    }

    fn open(&mut self, now: Timestamp, inbox: &mut Inbox) {
        match DatagramSocket::connect(self.peer) {
            Ok(socket) => {
                self.state = State::Open(socket);
                inbox.up();
                inbox.peer_appeared(PEER, self.peer.to_string());
            }
            Err(error) => self.close(now, &error, inbox),
        }
    }

    fn close(&mut self, now: Timestamp, error: &io::Error, inbox: &mut Inbox) {
        self.state = State::Closed { retry_at: self.backoff.failed(now) };
        inbox.down(format!("cannot send to {}: {}", self.peer, cause(error)));
    }
}

impl Link for UdpClient {
    fn poll(&mut self, now: Timestamp, cx: &mut Context<'_>, inbox: &mut Inbox) -> Progress {
        self.failures.report(inbox);
        match &self.state {
            State::Closed { retry_at } if now >= *retry_at => self.open(now, inbox),
            State::Closed { .. } => {}
            State::Open(socket) => {
                if let Some(error) = socket.unusable() {
                    self.close(now, &error.into(), inbox);
                }
            }
        }
        let State::Open(socket) = &mut self.state else { return Progress::Idle };
        match socket.poll_receive(cx, inbox) {
            Ok(progress) => {
                let mut count = 0;
                for (length, _) in socket.received() {
                    inbox.received_in(count, PEER, length);
                    count += 1;
                }
                inbox.take_buffers(count);
                if count > 0 {
                    self.backoff.reset();
                }
                progress
            }
            Err(error) => {
                self.close(now, &error, inbox);
                Progress::Idle
            }
        }
    }

    fn poll_timeout(&self) -> Option<Timestamp> {
        match &self.state {
            State::Closed { retry_at } => Some(*retry_at),
            State::Open(socket) => socket.unusable().map(|_| Timestamp::ZERO),
        }
    }

    fn send(&mut self, peers: PeerSet, frame: &[u8]) {
        if let State::Open(socket) = &mut self.state {
            socket.send(peers, |_| None, frame, &mut self.failures);
        }
    }

    fn flush(&mut self, _now: Timestamp) {
        if let State::Open(socket) = &mut self.state {
            socket.flush(&mut self.failures);
        }
    }

    fn has_unsent(&self) -> bool {
        false
    }

    fn refuse(&mut self, _peer: PeerIndex) {
        // The link has one peer for ever; without a channel nothing is sent to it, and it is asked for nothing.
    }
}
