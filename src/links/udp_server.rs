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

#[cfg(test)]
mod tests {
    use std::net::UdpSocket;
    use std::time::Duration;

    use super::super::harness::{PATIENCE, Rig, Seen, noise};
    use super::super::inbox::PEERS;
    use super::*;

    const ANY: &str = "127.0.0.1:0";

    fn rig() -> (Rig<UdpServer>, SocketAddr) {
        let mut rig = Rig::new(UdpServer::listening(ANY.parse().expect("an address")));
        assert_eq!(rig.next(), Seen::Up);
        let address = address_of(&rig);
        (rig, address)
    }

    fn address_of(rig: &Rig<UdpServer>) -> SocketAddr {
        match &rig.link.state {
            State::Open(socket) => socket.local_address(),
            State::Closed { .. } => panic!("the link is up"),
        }
    }

    fn peer() -> (UdpSocket, String) {
        let socket = UdpSocket::bind(ANY).expect("a free port");
        socket.set_read_timeout(Some(PATIENCE)).expect("a socket takes it");
        let address = socket.local_addr().expect("it is bound").to_string();
        (socket, address)
    }

    fn receive(socket: &UdpSocket) -> Vec<u8> {
        let mut buffer = [0; 512];
        let length = socket.recv(&mut buffer).expect("something is sent in time");
        buffer[..length].to_vec()
    }

    /// "`udpin`: bind, learn peers", each a conversation of its own.
    #[test]
    fn each_sender_is_a_peer_of_its_own() {
        let (mut rig, address) = rig();
        let peers: Vec<_> = (0..PEERS).map(|_| peer()).collect();

        for (number, (socket, name)) in peers.iter().enumerate() {
            socket.send_to(&[number as u8], address).expect("sent");
            assert_eq!(rig.next(), Seen::Appeared(number, name.clone()));
            assert_eq!(rig.next(), Seen::Received(number, vec![number as u8]));
        }
        for (number, (socket, _)) in peers.iter().enumerate() {
            rig.send(number, &[100 + number as u8]);
            assert_eq!(receive(socket), [100 + number as u8]);
        }
        let (late, _) = peer();
        late.send_to(b"late", address).expect("sent");
        rig.expect_silence();
    }

    #[test]
    fn one_frame_goes_to_all_that_it_is_for() {
        let (mut rig, address) = rig();
        let peers: Vec<_> = (0..3).map(|_| peer().0).collect();
        for (number, socket) in peers.iter().enumerate() {
            socket.send_to(b"here", address).expect("sent");
            assert!(matches!(rig.next(), Seen::Appeared(peer, _) if peer == number));
            assert_eq!(rig.next(), Seen::Received(number, b"here".to_vec()));
        }
        let mut first_and_last = PeerSet::from(0);
        first_and_last.insert(2);

        for number in 0..100 {
            rig.link.send(first_and_last, &[number]);
        }
        rig.send(1, b"end");

        for socket in [&peers[0], &peers[2]] {
            assert!((0..100).all(|number| receive(socket) == [number]));
        }
        assert_eq!(receive(&peers[1]), b"end");
    }

    #[test]
    fn the_longest_datagrams_arrive_whole_and_in_order() {
        let (mut rig, address) = rig();
        let (socket, name) = peer();
        let bytes = noise(65_507);

        for (length, number) in [65_507, 1, 2_048, 65_000, 2_049].into_iter().zip(0..) {
            socket.send_to(&bytes[..length], address).expect("sent");
            if number == 0 {
                assert_eq!(rig.next(), Seen::Appeared(0, name.clone()));
            }
            assert_eq!(rig.next(), Seen::Received(0, bytes[..length].to_vec()));
        }
    }

    /// "10 MB of random bytes": whatever comes in is handed on, and each batch is bounded.
    #[test]
    fn a_flood_passes_without_growth() {
        let (mut rig, address) = rig();
        let (socket, _) = peer();
        let bytes = noise(40_000);
        socket.send_to(&[0], address).expect("sent");
        assert!(matches!(rig.next(), Seen::Appeared(0, _)));
        rig.receive(0, 1);

        for _ in 0..250 {
            for piece in bytes.chunks(1_000) {
                socket.send_to(piece, address).expect("sent");
            }
            assert_eq!(rig.receive(0, bytes.len()), bytes);
        }
    }

    /// "a peer silent for 60 s is closed".
    #[test]
    fn a_silent_peer_leaves() {
        let (mut rig, address) = rig();
        let (socket, name) = peer();
        socket.send_to(b"once", address).expect("sent");
        assert_eq!(rig.next(), Seen::Appeared(0, name));
        rig.receive(0, 4);
        assert_eq!(rig.link.poll_timeout(), Some(rig.now + Duration::from_secs(60)));

        rig.pass(Duration::from_secs(59));
        rig.expect_silence();
        rig.pass(Duration::from_secs(1));
        assert_eq!(rig.next(), Seen::Left(0));
        assert_eq!(rig.link.poll_timeout(), None);
    }

    /// "A link that cannot open (… port taken …) is down and retried, never fatal."
    #[test]
    fn a_port_that_is_taken_is_waited_for() {
        let (other, name) = peer();
        let mut rig = Rig::new(UdpServer::listening(other.local_addr().expect("it is bound")));

        assert_eq!(rig.next(), Seen::Down(format!("cannot listen on {name}: address already in use")));
        rig.expect_silence();
        drop(other);
        assert_eq!(rig.link.poll_timeout(), Some(rig.now + Duration::from_millis(250)));
        rig.pass(Duration::from_millis(250));
        assert_eq!(rig.next(), Seen::Up);
    }

    /// A receiver that is gone answers with ICMP; that concerns nobody else.
    #[test]
    fn a_peer_that_is_gone_disturbs_nothing() {
        let (mut rig, address) = rig();
        let (gone, _) = peer();
        let (there, _) = peer();
        for socket in [&gone, &there] {
            socket.send_to(b"here", address).expect("sent");
            assert!(matches!(rig.next(), Seen::Appeared(..)));
            assert!(matches!(rig.next(), Seen::Received(..)));
        }
        drop(gone);

        for number in 0..100 {
            rig.send(0, b"nobody");
            rig.send(1, &[number]);
            assert_eq!(receive(&there), [number]);
        }
        rig.expect_silence();
    }

    /// "`udpbcast`: to a broadcast address until somebody answers, then to whoever answered".
    #[test]
    fn a_broadcast_ends_with_the_first_answer_and_returns_with_silence() {
        let (ground, _) = peer();
        let port = ground.local_addr().expect("it is bound").port();
        // The whole of 127.0.0.0/8 is this machine, its broadcast address included; a socket for all addresses hears it.
        drop(ground);
        let ground = UdpSocket::bind(("0.0.0.0", port)).expect("it was free a moment ago");
        ground.set_read_timeout(Some(PATIENCE)).expect("a socket takes it");
        let broadcast = SocketAddr::from(([127, 255, 255, 255], port));
        let mut rig = Rig::new(UdpServer::broadcasting(broadcast));
        assert_eq!(rig.next(), Seen::Up);
        assert_eq!(rig.next(), Seen::Appeared(0, broadcast.to_string()));

        rig.send(0, b"anybody");
        let mut buffer = [0; 64];
        let (length, from) = ground.recv_from(&mut buffer).expect("the broadcast arrives");
        assert_eq!(&buffer[..length], b"anybody");
        ground.send_to(b"me", SocketAddr::from(([127, 0, 0, 1], from.port()))).expect("sent");

        assert_eq!(rig.next(), Seen::Left(0));
        assert_eq!(rig.next(), Seen::Appeared(0, format!("127.0.0.1:{port}")));
        assert_eq!(rig.next(), Seen::Received(0, b"me".to_vec()));
        rig.pass(Duration::from_secs(10));
        assert_eq!(rig.next(), Seen::Left(0));
        assert_eq!(rig.next(), Seen::Appeared(0, broadcast.to_string()));
    }
}
