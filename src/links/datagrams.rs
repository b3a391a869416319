//! A UDP socket that receives and sends many datagrams with one system call each.

use std::io::{self, IoSlice, IoSliceMut};
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr, SocketAddrV4, SocketAddrV6, UdpSocket};
use std::os::fd::AsRawFd;
use std::task::{Context, Poll};

use nix::errno::Errno;
use nix::sys::socket::{MsgFlags, MultiHeaders, SockaddrStorage, recvmmsg, sendmmsg};
use socket2::{Domain, Protocol, Socket, Type};
use tokio::io::unix::AsyncFd;

use super::Progress;
use super::inbox::{Inbox, PeerIndex, PeerSet, READS};
use super::input_ready::watch_input;
use super::send_failures::SendFailures;

/// Asked of the kernel, which gives what it may: bursts wait there while another link is served.
const RECEIVE_BUFFER: usize = 1 << 20;
/// Datagrams in the system call that finds out whether there are many: mostly there is one, and to prepare room for
/// many costs more than to receive it.
const FEW: usize = 4;
/// Most datagrams in one system call.
const SENDS: usize = 32;
/// Frames are collected up to so many bytes.
const COLLECTED_BYTES: usize = 16 * 1024;

/// One socket, its received batch, and the frames that are to be sent.
pub struct DatagramSocket {
    /// Waits for input only: a UDP socket reports room for output after each datagram that left, and every report
    /// would wake the event loop.
    socket: AsyncFd<UdpSocket>,
    /// Not shared with other sockets: the kernel writes the length of the addresses of this socket's family to it.
    receive_headers: MultiHeaders<SockaddrStorage>,
    send_headers: MultiHeaders<SockaddrStorage>,
    received: Vec<(usize, Option<SocketAddr>)>,
    /// The last batch was of many.
    is_busy: bool,
    outgoing: Outgoing,
    unusable: Option<Errno>,
}

/// The frames collected for the next system call.
#[derive(Default)]
struct Outgoing {
    bytes: Vec<u8>,
    /// Start and end in `bytes`, and whom it is for.
    frames: Vec<(usize, usize, PeerIndex)>,
    addresses: Vec<Option<SockaddrStorage>>,
}

impl DatagramSocket {
    /// A socket bound to `address`.
    pub fn bind(address: SocketAddr) -> io::Result<Self> {
        let socket = new_socket(address)?;
        socket.bind(&address.into())?;
        Self::registered(socket)
    }

    /// A socket that talks to `peer` only.
    pub fn connect(peer: SocketAddr) -> io::Result<Self> {
        let socket = new_socket(peer)?;
        socket.connect(&peer.into())?;
        Self::registered(socket)
    }

    /// A socket that may send to `broadcast`.
    pub fn broadcast(broadcast: SocketAddr) -> io::Result<Self> {
        let socket = new_socket(broadcast)?;
        socket.set_broadcast(true)?;
        let any = match broadcast {
            SocketAddr::V4(_) => IpAddr::V4(Ipv4Addr::UNSPECIFIED),
            SocketAddr::V6(_) => IpAddr::V6(Ipv6Addr::UNSPECIFIED),
        };
        socket.bind(&SocketAddr::new(any, 0).into())?;
        Self::registered(socket)
    }

    fn registered(socket: Socket) -> io::Result<Self> {
        Ok(Self {
            socket: watch_input(UdpSocket::from(socket))?,
            receive_headers: MultiHeaders::preallocate(READS, None),
            send_headers: MultiHeaders::preallocate(SENDS, None),
            received: Vec::with_capacity(READS),
            is_busy: false,
            outgoing: Outgoing::default(),
            unusable: None,
        })
    }

    #[cfg(test)]
    pub fn local_address(&self) -> SocketAddr {
        self.socket.get_ref().local_addr().expect("a bound socket has an address")
    }

    /// Receives one batch into the free buffers of `inbox`.
    ///
    /// [`Self::received`] tells what is in which buffer.
    pub fn poll_receive(&mut self, cx: &mut Context<'_>, inbox: &mut Inbox) -> io::Result<Progress> {
        self.received.clear();
        loop {
            let mut ready = match self.socket.poll_read_ready(cx) {
                Poll::Pending => return Ok(Progress::Idle),
                Poll::Ready(ready) => ready?,
            };
            if !self.received.is_empty() {
                // A full batch: the rest waits until this one is dealt with and the other links had their turn.
                return Ok(Progress::More);
            }
            let (socket, headers) = (self.socket.get_ref(), &mut self.receive_headers);
            let (most, result) = if self.is_busy {
                (READS, receive::<READS>(socket, headers, inbox, &mut self.received))
            } else {
                (FEW, receive::<FEW>(socket, headers, inbox, &mut self.received))
            };
            self.is_busy = self.received.len() >= FEW;
            match result {
                Ok(()) if self.received.len() == most => {}
                // Fewer than asked for means that the socket is empty.
                Ok(()) | Err(Errno::EAGAIN) => ready.clear_ready(),
                // An earlier datagram was refused by its receiver; nothing is wrong with this socket.
                Err(Errno::ECONNREFUSED | Errno::EHOSTUNREACH | Errno::EINTR) => {}
                Err(error) => return Err(error.into()),
            }
        }
    }

    /// Length and sender of each datagram of the last batch, in the order of the free buffers of the inbox.
    pub fn received(&self) -> impl Iterator<Item = (usize, Option<SocketAddr>)> + '_ {
        self.received.iter().copied()
    }

    /// Why the last send found that the socket has an address or a route that does not exist any more.
    pub fn unusable(&self) -> Option<Errno> {
        self.unusable
    }

    /// Collects `frame` for each of `peers`. `address` is `None` where the socket is connected.
    pub fn send(
        &mut self,
        peers: PeerSet,
        address: impl Fn(PeerIndex) -> Option<SockaddrStorage>,
        frame: &[u8],
        failures: &mut SendFailures,
    ) {
        if self.outgoing.bytes.len() + frame.len() > COLLECTED_BYTES {
            self.flush(failures);
        }
        let mut range = self.outgoing.append(frame);
        for peer in peers {
            if self.outgoing.frames.len() == SENDS {
                self.flush(failures);
                range = self.outgoing.append(frame);
            }
            self.outgoing.frames.push((range.0, range.1, peer));
            self.outgoing.addresses.push(address(peer));
        }
    }

    /// Sends what was collected; what the kernel does not take is dropped and noted in `failures`.
    pub fn flush(&mut self, failures: &mut SendFailures) {
        let mut sent = 0;
        let mut refusals = 0;
        while sent < self.outgoing.frames.len() {
            match send(self.socket.get_ref(), &mut self.send_headers, &self.outgoing, sent) {
                Ok(count) => {
                    sent += count.max(1);
                    self.unusable = None;
                }
                Err(Errno::EINTR) => {}
                // Tells about an earlier datagram; this one was not tried. Bounded, as several may be on their way.
                Err(Errno::ECONNREFUSED) if refusals < SENDS => refusals += 1,
                Err(error @ (Errno::EAGAIN | Errno::ENOBUFS)) => {
                    for (_, _, peer) in &self.outgoing.frames[sent..] {
                        failures.note(*peer, 1, error.desc());
                    }
                    break;
                }
                Err(error) => {
                    failures.note(self.outgoing.frames[sent].2, 1, error.desc());
                    self.unusable = Some(error).filter(|error| concerns_the_socket(*error));
                    sent += 1;
                }
            }
        }
        self.outgoing.clear();
    }
}

impl Outgoing {
    fn append(&mut self, frame: &[u8]) -> (usize, usize) {
        let start = self.bytes.len();
        self.bytes.extend_from_slice(frame);
        (start, self.bytes.len())
    }

    fn clear(&mut self) {
        self.bytes.clear();
        self.frames.clear();
        self.addresses.clear();
    }
}

fn new_socket(address: SocketAddr) -> io::Result<Socket> {
    let socket = Socket::new(Domain::for_address(address), Type::DGRAM.nonblocking(), Some(Protocol::UDP))?;
    socket.set_recv_buffer_size(RECEIVE_BUFFER)?;
    Ok(socket)
}

/// The socket's own address or route does not exist any more; a new socket may find another.
fn concerns_the_socket(error: Errno) -> bool {
    matches!(error, Errno::ENETUNREACH | Errno::ENETDOWN | Errno::EADDRNOTAVAIL | Errno::EINVAL | Errno::ENODEV)
}

/// Receives at most `MOST` datagrams.
fn receive<const MOST: usize>(
    socket: &UdpSocket,
    headers: &mut MultiHeaders<SockaddrStorage>,
    inbox: &mut Inbox,
    received: &mut Vec<(usize, Option<SocketAddr>)>,
) -> Result<(), Errno> {
    let mut free = inbox.buffers();
    let mut buffers: [_; MOST] = std::array::from_fn(|_| [IoSliceMut::new(free.next().unwrap_or_default())]);
    let datagrams = recvmmsg(socket.as_raw_fd(), headers, &mut buffers, MsgFlags::MSG_DONTWAIT, None)?;
    received.extend(datagrams.map(|datagram| (datagram.bytes, datagram.address.as_ref().and_then(to_std))));
    Ok(())
}

/// Sends from the frame at index `first` on; how many were sent.
fn send(
    socket: &UdpSocket,
    headers: &mut MultiHeaders<SockaddrStorage>,
    outgoing: &Outgoing,
    first: usize,
) -> Result<usize, Errno> {
    let frames = &outgoing.frames[first..];
    let slices: [_; SENDS] = std::array::from_fn(|index| {
        let (start, end, _) = frames.get(index).copied().unwrap_or_default();
        [IoSlice::new(&outgoing.bytes[start..end])]
    });
    let addresses = &outgoing.addresses[first..];
    let sent = sendmmsg(socket.as_raw_fd(), headers, &slices[..frames.len()], addresses, [], MsgFlags::MSG_DONTWAIT)?;
    Ok(sent.count())
}

fn to_std(address: &SockaddrStorage) -> Option<SocketAddr> {
    if let Some(v4) = address.as_sockaddr_in() {
        return Some(SocketAddrV4::new(v4.ip(), v4.port()).into());
    }
    let v6 = address.as_sockaddr_in6()?;
    Some(SocketAddrV6::new(v6.ip(), v6.port(), v6.flowinfo(), v6.scope_id()).into())
}
