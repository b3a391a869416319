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

#[cfg(test)]
mod tests {
    use std::io::{Read, Write};
    use std::net::TcpListener;

    use super::super::harness::{PATIENCE, Rig, Seen, noise, write_aside};
    use super::*;

    fn listener() -> (TcpListener, SocketAddr) {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
        let address = listener.local_addr().expect("it is bound");
        (listener, address)
    }

    fn connected(listener: &TcpListener, address: SocketAddr) -> (Rig<TcpClient>, std::net::TcpStream) {
        let mut rig = Rig::new(TcpClient::new(address));
        assert_eq!(rig.next(), Seen::Up);
        assert_eq!(rig.next(), Seen::Appeared(PEER, address.to_string()));
        let (stream, _) = listener.accept().expect("it connected");
        stream.set_read_timeout(Some(PATIENCE)).expect("a socket takes it");
        (rig, stream)
    }

    #[test]
    fn bytes_go_both_ways() {
        let (listener, address) = listener();
        let (mut rig, mut stream) = connected(&listener, address);

        rig.send(PEER, b"hello");
        let mut buffer = [0; 5];
        stream.read_exact(&mut buffer).expect("the frame arrives");
        assert_eq!(&buffer, b"hello");
        stream.write_all(b"welcome").expect("sent");
        assert_eq!(rig.receive(PEER, 7), b"welcome");
    }

    /// "`tcpout`: … TCP with back-off to 2 s".
    #[test]
    fn a_refused_connection_is_tried_again_with_growing_waits() {
        let (listener, address) = listener();
        drop(listener);
        let mut rig = Rig::new(TcpClient::new(address));
        for wait in [250, 500, 1_000, 2_000, 2_000] {
            assert_eq!(rig.next(), Seen::Down(format!("cannot connect to {address}: connection refused")));
            assert_eq!(rig.link.poll_timeout(), Some(rig.now + Duration::from_millis(wait)));
            rig.pass(Duration::from_millis(wait));
        }
    }

    #[test]
    fn a_connection_that_ends_is_made_again() {
        let (listener, address) = listener();
        let (mut rig, stream) = connected(&listener, address);
        drop(stream);
        assert_eq!(rig.next(), Seen::Down(format!("lost {address}: the other side closed the connection")));

        rig.pass(Duration::from_millis(250));
        assert_eq!(rig.next(), Seen::Up);
    }

    /// "connect non-blocking with 5 s time-out".
    #[test]
    fn an_attempt_without_an_answer_is_given_up() {
        // A listener whose queue is full answers no further attempt.
        let socket = socket2::Socket::new(socket2::Domain::IPV4, socket2::Type::STREAM, None).expect("a socket");
        let any: SocketAddr = "127.0.0.1:0".parse().expect("an address");
        socket.bind(&any.into()).expect("a free port");
        socket.listen(0).expect("it is bound");
        let address = socket.local_addr().expect("it is bound").as_socket().expect("an IP address");
        let _in_the_queue = std::net::TcpStream::connect(address).expect("there is one place");

        let mut rig = Rig::new(TcpClient::new(address));
        rig.expect_silence();
        assert_eq!(rig.link.poll_timeout(), Some(rig.now + Duration::from_secs(5)));
        rig.pass(Duration::from_secs(5));
        assert_eq!(rig.next(), Seen::Down(format!("cannot connect to {address}: no answer")));
    }

    #[test]
    fn ten_megabytes_pass_without_growth() {
        let (listener, address) = listener();
        let (mut rig, stream) = connected(&listener, address);
        let bytes = noise(10_000_000);
        let writer = write_aside(stream, bytes.clone());

        assert!(rig.receive(PEER, bytes.len()) == bytes, "what arrives is what was sent");
        writer.join().expect("all was written");
    }
}
