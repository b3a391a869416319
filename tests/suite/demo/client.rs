//! A scripted ground station, on a real socket and in real time.

use std::fmt::Debug;
use std::io::{ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpStream, UdpSocket};
use std::time::{Duration, Instant};

use gimbald::bridge::snapshot::Snapshot;
use gimbald::wire::dialect::{COMMAND_ACK_DATA, COMMAND_LONG_DATA, MavMessage, MessageData};
use gimbald::wire::{DatagramFrames, Frame, FrameBuffer, MavId, Version};

use crate::support::world::{GCS, MANAGER, heartbeat};

/// Everything that is waited for comes within this time, or the test fails.
const PATIENCE: Duration = Duration::from_secs(5);
const HEARTBEAT_INTERVAL: Duration = Duration::from_millis(500);
/// How long one read may wait, so that heartbeats go on.
const READ_TIMEOUT: Duration = Duration::from_millis(100);

#[expect(clippy::disallowed_methods, reason = "a real process is waited for in real time")]
fn real_now() -> Instant {
    Instant::now()
}

/// The station; what it heard since its last command is kept.
pub struct Client {
    socket: UdpSocket,
    buffer: FrameBuffer,
    sequence: u8,
    heartbeat_at: Instant,
    heard: Vec<Vec<u8>>,
}

impl Client {
    /// A station that speaks first, to `daemon`, which need not be there yet.
    pub fn new(daemon: SocketAddr) -> Self {
        let socket = UdpSocket::bind("127.0.0.1:0").expect("a free port");
        socket.set_read_timeout(Some(READ_TIMEOUT)).expect("it can be set");
        socket.connect(daemon).expect("nothing is sent");
        Self { socket, buffer: FrameBuffer::default(), sequence: 0, heartbeat_at: real_now(), heard: Vec::new() }
    }

    fn send(&mut self, message: &MavMessage) {
        let frame = self.buffer.encode_any(GCS, self.sequence, message);
        self.sequence = self.sequence.wrapping_add(1);
        match self.socket.send(frame.bytes()) {
            Ok(_) => {}
            // An earlier datagram came too early.
            Err(error) if error.kind() == ErrorKind::ConnectionRefused => {}
            Err(error) => panic!("{error}"),
        }
    }

    /// Sends a command to the gimbal manager and waits for its result.
    #[track_caller]
    pub fn command(&mut self, command: u16, parameters: [f32; 7]) -> u8 {
        let [param1, param2, param3, param4, param5, param6, param7] = parameters;
        self.heard.clear();
        self.send(&MavMessage::COMMAND_LONG(COMMAND_LONG_DATA {
            param1,
            param2,
            param3,
            param4,
            param5,
            param6,
            param7,
            command,
            target_system: MANAGER.system,
            target_component: MANAGER.component,
            confirmation: 0,
        }));
        self.wait_for(|source, ack: &COMMAND_ACK_DATA| {
            let to_us = (ack.target_system, ack.target_component) == (GCS.system, GCS.component);
            (source == MANAGER && ack.command == command && to_us).then_some(ack.result)
        })
    }

    /// The first message since the last command in which `look` finds what it looks for.
    #[track_caller]
    pub fn wait_for<M: MessageData + Debug, T>(&mut self, mut look: impl FnMut(MavId, &M) -> Option<T>) -> T {
        let deadline = real_now() + PATIENCE;
        let mut last = None;
        let mut next = 0;
        loop {
            for bytes in &self.heard[next..] {
                let frame = frame(bytes);
                let Some(message) = (frame.message_id() == M::ID).then(|| frame.decode::<M>()).flatten() else {
                    continue;
                };
                if let Some(found) = look(frame.source(), &message) {
                    return found;
                }
                last = Some(message);
            }
            next = self.heard.len();
            assert!(real_now() < deadline, "the {} waited for did not come, the last was {last:?}", M::NAME);
            self.listen();
        }
    }

    /// Takes one datagram, and keeps saying that we are there.
    fn listen(&mut self) {
        let now = real_now();
        if now >= self.heartbeat_at {
            self.heartbeat_at = now + HEARTBEAT_INTERVAL;
            self.send(&heartbeat(6, 8));
        }
        let mut datagram = [0; 2048];
        match self.socket.recv(&mut datagram) {
            Ok(length) => self.heard.extend(frames_of(&datagram[..length])),
            Err(error) if [ErrorKind::WouldBlock, ErrorKind::ConnectionRefused].contains(&error.kind()) => {}
            Err(error) => panic!("{error}"),
        }
    }
}

/// The frames of a datagram, which holds whole frames of MAVLink 2 and nothing else.
#[track_caller]
pub fn frames_of(datagram: &[u8]) -> Vec<Vec<u8>> {
    let mut frames = DatagramFrames::new(datagram);
    let mut found = Vec::new();
    while let Some(frame) = frames.next_frame() {
        assert_eq!(frame.version(), Version::V2, "{}", frame.name());
        found.push(frame.bytes().to_vec());
    }
    assert_eq!(found.concat(), datagram);
    found
}

pub fn frame(bytes: &[u8]) -> Frame<'_> {
    DatagramFrames::new(bytes).next_frame().expect("it was a frame before")
}

/// `/api/v1/status` of the daemon whose page is at `page`.
#[track_caller]
pub fn status(page: SocketAddr) -> Snapshot {
    let mut connection = TcpStream::connect_timeout(&page, PATIENCE).expect("the page is there");
    connection.set_read_timeout(Some(PATIENCE)).expect("it can be set");
    write!(connection, "GET /api/v1/status HTTP/1.1\r\nHost: {page}\r\nConnection: close\r\n\r\n").expect("sent");
    let mut answer = String::new();
    connection.read_to_string(&mut answer).expect("an answer, and then the end");
    let (head, body) = answer.split_once("\r\n\r\n").expect("a head and a body");
    assert!(head.starts_with("HTTP/1.1 200 OK\r\n"), "{head}");
    serde_json::from_str(body).expect("a snapshot")
}
