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

#[cfg(test)]
mod tests {
    use std::net::UdpSocket;
    use std::time::Duration;

    use super::super::harness::{PATIENCE, Rig, Seen, noise};
    use super::*;

    fn peer() -> (UdpSocket, SocketAddr) {
        let socket = UdpSocket::bind("127.0.0.1:0").expect("a free port");
        socket.set_read_timeout(Some(PATIENCE)).expect("a socket takes it");
        let address = socket.local_addr().expect("it is bound");
        (socket, address)
    }

    fn rig(address: SocketAddr) -> Rig<UdpClient> {
        let mut rig = Rig::new(UdpClient::new(address));
        assert_eq!(rig.next(), Seen::Up);
        assert_eq!(rig.next(), Seen::Appeared(PEER, address.to_string()));
        rig
    }

    /// "`udpout`: speak first".
    #[test]
    fn it_speaks_first_and_listens_to_its_peer_alone() {
        let (socket, address) = peer();
        let mut rig = rig(address);

        rig.send(PEER, b"hello");
        let mut buffer = [0; 64];
        let (length, link) = socket.recv_from(&mut buffer).expect("the frame arrives");
        assert_eq!(&buffer[..length], b"hello");
        let (stranger, _) = peer();
        stranger.send_to(b"not for you", link).expect("sent");
        socket.send_to(b"welcome", link).expect("sent");

        assert_eq!(rig.next(), Seen::Received(PEER, b"welcome".to_vec()));
        rig.expect_silence();
    }

    /// A ground station that was closed answers with ICMP until it is started again.
    #[test]
    fn a_peer_that_does_not_listen_is_spoken_to_until_it_does() {
        let (socket, address) = peer();
        let mut rig = rig(address);
        drop(socket);
        for _ in 0..1_000 {
            rig.send(PEER, b"is anybody there");
        }
        rig.expect_silence();

        let socket = UdpSocket::bind(address).expect("it was free a moment ago");
        socket.set_read_timeout(Some(PATIENCE)).expect("a socket takes it");
        rig.send(PEER, b"now");
        let mut buffer = [0; 64];
        let (length, link) = socket.recv_from(&mut buffer).expect("the first frame after the start arrives");
        assert_eq!(&buffer[..length], b"now");
        socket.send_to(b"yes", link).expect("sent");
        assert_eq!(rig.next(), Seen::Received(PEER, b"yes".to_vec()));
    }

    #[test]
    fn a_flood_passes_without_growth() {
        let (socket, address) = peer();
        let mut rig = rig(address);
        rig.send(PEER, b"hello");
        let (_, link) = socket.recv_from(&mut [0; 64]).expect("the frame arrives");
        let bytes = noise(40_000);

        for _ in 0..250 {
            for piece in bytes.chunks(1_000) {
                socket.send_to(piece, link).expect("sent");
            }
            assert_eq!(rig.receive(PEER, bytes.len()), bytes);
        }
    }

    /// "A link that cannot open (… network not up …) is down and retried, never fatal."
    #[test]
    fn a_network_that_is_missing_is_waited_for() {
        // Reserved for documentation of IPv6 over a link that has no number: no route leads there.
        let nowhere: SocketAddr = "[fe80::1]:14550".parse().expect("an address");
        let mut rig = Rig::new(UdpClient::new(nowhere));
        for wait in [250, 500, 1_000, 2_000, 2_000] {
            let Seen::Down(reason) = rig.next() else { panic!("the link is down") };
            assert!(reason.starts_with("cannot send to [fe80::1]:14550: "), "{reason}");
            assert_eq!(rig.link.poll_timeout(), Some(rig.now + Duration::from_millis(wait)));
            rig.pass(Duration::from_millis(wait));
        }
    }
}
