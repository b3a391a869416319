//! Both ends of a forwarder: an autopilot that sends, and a ground station that counts what arrives.

use std::io::ErrorKind;
use std::net::{SocketAddr, UdpSocket};
use std::time::Duration;

use gimbald::wire::dialect::STATUSTEXT_DATA;
use gimbald::wire::{MavId, encode_to_vec};

/// Frames on their way at any time.
const IN_FLIGHT: u32 = 64;
/// A frame that takes longer is lost.
const LOST: Duration = Duration::from_millis(200);
/// How long a forwarder may take to start, in units of [`LOST`].
const START_ATTEMPTS: u32 = 50;
const FRAME_LENGTH: usize = 64;

pub struct Rig {
    autopilot: UdpSocket,
    ground: UdpSocket,
    /// Where the forwarder listens for the autopilot.
    pub listen: SocketAddr,
    /// The same frame under each sequence number.
    frames: Vec<Vec<u8>>,
}

impl Rig {
    pub fn new() -> Self {
        let free = UdpSocket::bind("127.0.0.1:0").expect("a free port");
        let listen = free.local_addr().expect("it is bound");
        drop(free);
        let socket = || UdpSocket::bind("127.0.0.1:0").expect("a free port");
        let (autopilot, ground) = (socket(), socket());
        ground.set_read_timeout(Some(LOST)).expect("a socket takes it");
        Self { autopilot, ground, listen, frames: (0..=u8::MAX).map(frame).collect() }
    }

    /// Where the ground station is.
    pub fn peer(&self) -> SocketAddr {
        self.ground.local_addr().expect("it is bound")
    }

    /// Returns when the first frame came through.
    pub fn wait_for_forwarder(&self) {
        for _ in 0..START_ATTEMPTS {
            self.send(0);
            if self.receive() {
                while self.receive() {}
                return;
            }
        }
        panic!("nothing is forwarded from {} to {}", self.listen, self.peer());
    }

    /// Sends `count` frames, a new one for each that arrives; how many arrived.
    pub fn closed_loop(&self, count: u32) -> u32 {
        let mut sent = 0;
        let mut delivered = 0;
        while delivered < count {
            if sent == delivered {
                for _ in 0..IN_FLIGHT {
                    self.send(sent);
                    sent += 1;
                }
            }
            if self.receive() {
                delivered += 1;
                self.send(sent);
                sent += 1;
            } else {
                // Whatever is missing is lost; the next frames fill the loop again.
                println!("{} frames were lost", sent - delivered);
                sent = delivered;
            }
        }
        while self.receive() {
            delivered += 1;
        }
        delivered
    }

    fn send(&self, number: u32) {
        let frame = &self.frames[number as usize % self.frames.len()];
        self.autopilot.send_to(frame, self.listen).expect("this machine reaches itself");
    }

    /// Whether one of our frames arrived in time; what the forwarder says on its own account does not count.
    fn receive(&self) -> bool {
        let mut buffer = [0; 512];
        loop {
            match self.ground.recv(&mut buffer) {
                Ok(FRAME_LENGTH) => return true,
                Ok(_) => {}
                Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => return false,
                Err(error) => panic!("the ground station cannot receive: {error}"),
            }
        }
    }
}

fn frame(sequence: u8) -> Vec<u8> {
    // An id other than 0 keeps the bytes behind the text, and makes the frame 64 bytes long.
    let text = STATUSTEXT_DATA { severity: 6, text: [b'g'; 50].into(), id: 1, chunk_seq: 0 };
    let frame = encode_to_vec(MavId::new(1, 1), sequence, &text);
    assert_eq!(frame.len(), FRAME_LENGTH);
    frame
}
