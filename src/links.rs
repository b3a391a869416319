//! Moves bytes between the core and the outside: serial ports, UDP and TCP sockets.
//!
//! A link is a state machine that the event loop polls. It opens itself, opens itself again after a failure, and
//! tells through an [`Inbox`] what happened; nothing of it ever ends the process.

pub mod backoff;
mod connection;
mod datagrams;
mod frame_queue;
pub mod inbox;
pub mod input_ready;
mod peers;
mod send_failures;
mod serial;
pub mod serial_port;
mod tcp_client;
mod tcp_server;
mod udp_client;
mod udp_server;

#[cfg(test)]
mod harness;

use std::io;
use std::task::Context;

use nix::errno::Errno;

use crate::endpoint::Endpoint;
use crate::timestamp::Timestamp;
use inbox::{Inbox, PeerIndex, PeerSet};

/// One configured port.
///
/// [`Link::poll`] is called at every wake-up of the event loop, whichever link caused it.
pub trait Link {
    /// Appends to `inbox` what happened since the last call, reading one bounded batch at most.
    ///
    /// After [`Progress::Idle`] the waker of `cx` is called when there is more to do, and [`Link::poll_timeout`] tells
    /// when to call without having been woken.
    fn poll(&mut self, now: Timestamp, cx: &mut Context<'_>, inbox: &mut Inbox) -> Progress;

    /// When [`Link::poll`] has something to do although nothing arrives.
    fn poll_timeout(&self) -> Option<Timestamp>;

    /// Takes one whole frame for each of `peers`; it may leave only with [`Link::flush`].
    ///
    /// What cannot be sent is dropped and reported by a later [`Link::poll`].
    fn send(&mut self, peers: PeerSet, frame: &[u8]);

    /// Sends what [`Link::send`] took.
    fn flush(&mut self, now: Timestamp);

    /// Whether frames that were taken still wait for room in the kernel.
    fn has_unsent(&self) -> bool;

    /// Ends the conversation with a peer that cannot be served.
    fn refuse(&mut self, peer: PeerIndex);
}

/// Whether a link wants to be polled again at once.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Progress {
    Idle,
    /// The batch was full; there may be more to read.
    More,
}

/// The link for `endpoint`, closed until it is polled.
pub fn link(endpoint: &Endpoint) -> Box<dyn Link> {
    match endpoint {
        Endpoint::Serial { path, baud } => Box::new(serial::SerialLink::new(path.clone(), *baud)),
        Endpoint::UdpIn(address) => Box::new(udp_server::UdpServer::listening(*address)),
        Endpoint::UdpOut(address) => Box::new(udp_client::UdpClient::new(*address)),
        Endpoint::UdpBroadcast(address) => Box::new(udp_server::UdpServer::broadcasting(*address)),
        Endpoint::TcpIn(address) => Box::new(tcp_server::TcpServer::new(*address)),
        Endpoint::TcpOut(address) => Box::new(tcp_client::TcpClient::new(*address)),
    }
}

/// The cause in plain words, without the number of the error.
fn cause(error: &io::Error) -> String {
    let text = error.raw_os_error().map_or_else(|| error.to_string(), |code| Errno::from_raw(code).desc().to_owned());
    let mut letters = text.chars();
    letters.next().map(|first| first.to_lowercase().chain(letters).collect()).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cause_is_told_in_plain_words() {
        assert_eq!(cause(&Errno::EADDRINUSE.into()), "address already in use");
        assert_eq!(cause(&io::Error::new(io::ErrorKind::NotFound, "No such file")), "no such file");
    }
}
