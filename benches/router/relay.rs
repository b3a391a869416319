//! The floor for a design without batching: poll, receive, send, and nothing else.

use std::net::{SocketAddr, UdpSocket};
use std::os::fd::AsFd;

use nix::poll::{PollFd, PollFlags, PollTimeout, poll};

/// Forwards what comes to `listen` to `peer`, for ever.
pub fn run(listen: &str, peer: &str) {
    let peer: SocketAddr = peer.parse().expect("the rig gives an address");
    let input = UdpSocket::bind(listen).expect("the port is free");
    let output = UdpSocket::bind("127.0.0.1:0").expect("a free port");
    input.set_nonblocking(true).expect("a socket takes it");
    let mut buffer = vec![0; 65_536];
    loop {
        let mut waiting = [PollFd::new(input.as_fd(), PollFlags::POLLIN)];
        poll(&mut waiting, PollTimeout::NONE).expect("a socket can be waited for");
        if let Ok((length, _)) = input.recv_from(&mut buffer) {
            output.send_to(&buffer[..length], peer).expect("the peer is there");
        }
    }
}
