//! The floor for a design without batching: poll, receive, send, and nothing else.

use std::fs::File;
use std::io::Write;
use std::net::{SocketAddr, UdpSocket};
use std::os::fd::AsFd;

use nix::poll::{PollFd, PollFlags, PollTimeout, poll};

/// What lies between the ends of a route on the command line.
const ARROW: char = '>';

/// A route as [`run`] reads it: from a port of the relay to a UDP address or a serial device.
pub fn route(listen: SocketAddr, to: &str) -> String {
    format!("{listen}{ARROW}{to}")
}

enum Output {
    Udp(UdpSocket, SocketAddr),
    Device(File),
}

/// Forwards along each of `routes`, for ever.
pub fn run<'a>(routes: impl IntoIterator<Item = &'a str>) {
    let (inputs, mut outputs): (Vec<_>, Vec<_>) = routes.into_iter().map(open).unzip();
    let mut buffer = vec![0; 65_536];
    loop {
        let mut waiting: Vec<_> = inputs.iter().map(|input| PollFd::new(input.as_fd(), PollFlags::POLLIN)).collect();
        poll(&mut waiting, PollTimeout::NONE).expect("a socket can be waited for");
        for ((waited, input), output) in waiting.iter().zip(&inputs).zip(&mut outputs) {
            if waited.any() == Some(true)
                && let Ok((length, _)) = input.recv_from(&mut buffer)
            {
                match output {
                    Output::Udp(socket, peer) => {
                        socket.send_to(&buffer[..length], *peer).expect("the peer is there");
                    }
                    Output::Device(device) => device.write_all(&buffer[..length]).expect("the device is there"),
                }
            }
        }
    }
}

fn open(route: &str) -> (UdpSocket, Output) {
    let (listen, to) = route.split_once(ARROW).expect("the rig gives both ends");
    let input = UdpSocket::bind(listen).expect("the port is free");
    input.set_nonblocking(true).expect("a socket takes it");
    let output = match to.parse() {
        Ok(peer) => Output::Udp(UdpSocket::bind("127.0.0.1:0").expect("a free port"), peer),
        Err(_) => Output::Device(File::options().write(true).open(to).expect("the device is there")),
    };
    (input, output)
}
