//! One TCP connection.

use std::io;
use std::net::SocketAddr;
use std::pin::Pin;
use std::task::{Context, Poll};
use std::time::Duration;

use socket2::{SockRef, TcpKeepalive};
use tokio::io::{AsyncRead, ReadBuf};
use tokio::net::TcpStream;

use super::Progress;
use super::frame_queue::FrameQueue;
use super::inbox::{self, Inbox, PeerIndex};
use super::send_failures::SendFailures;
use crate::timestamp::Timestamp;

/// What one connection may have waiting, so that a peer that does not read costs neither memory nor others' time.
const OUTPUT_LIMIT: usize = 64 * 1024;
/// What the kernel keeps on top of that; more would only grow stale there.
const KERNEL_BUFFER: usize = 64 * 1024;
/// A peer that takes nothing for so long is closed.
const STALL_LIMIT: Duration = Duration::from_secs(10);
/// Reads of one connection in one batch: as many as leave the same for all others.
const READS: usize = inbox::READS / inbox::PEERS;

pub struct Connection {
    stream: TcpStream,
    output: FrameQueue,
    /// Whether room for more output will wake the event loop.
    waits_for_room: bool,
    failure: Option<io::Error>,
}

impl Connection {
    pub fn new(stream: TcpStream) -> io::Result<Self> {
        let socket = SockRef::from(&stream);
        socket.set_tcp_nodelay(true)?;
        socket.set_send_buffer_size(KERNEL_BUFFER)?;
        socket.set_tcp_user_timeout(Some(STALL_LIMIT))?;
        // Finds out about a peer that vanished while there is nothing to send to it.
        let probes = TcpKeepalive::new()
            .with_time(Duration::from_secs(10))
            .with_interval(Duration::from_secs(5))
            .with_retries(3);
        socket.set_tcp_keepalive(&probes)?;
        Ok(Self { stream, output: FrameQueue::new(OUTPUT_LIMIT), waits_for_room: false, failure: None })
    }

    pub fn address(&self) -> io::Result<SocketAddr> {
        let address = self.stream.peer_addr()?;
        Ok(SocketAddr::new(address.ip().to_canonical(), address.port()))
    }

    /// Reads, and writes what waits. An error, of which the end of the stream is one, ends the connection.
    pub fn poll(
        &mut self,
        now: Timestamp,
        peer: PeerIndex,
        cx: &mut Context<'_>,
        inbox: &mut Inbox,
    ) -> io::Result<Progress> {
        self.poll_output(now, cx);
        if let Some(error) = self.failure.take() {
            return Err(error);
        }
        for _ in 0..READS {
            let Some(buffer) = inbox.buffer() else { return Ok(Progress::More) };
            let mut read = ReadBuf::new(buffer);
            match Pin::new(&mut self.stream).poll_read(cx, &mut read) {
                Poll::Pending => return Ok(Progress::Idle),
                Poll::Ready(result) => result?,
            }
            match read.filled().len() {
                0 => return Err(io::Error::new(io::ErrorKind::UnexpectedEof, "the other side closed the connection")),
                length => inbox.received(peer, length),
            }
        }
        Ok(Progress::More)
    }

    fn poll_output(&mut self, now: Timestamp, cx: &mut Context<'_>) {
        while !self.output.is_empty() && self.failure.is_none() {
            match self.stream.poll_write_ready(cx) {
                Poll::Pending => {
                    self.waits_for_room = true;
                    break;
                }
                Poll::Ready(Ok(())) => {
                    self.waits_for_room = false;
                    self.flush(now);
                }
                Poll::Ready(Err(error)) => self.failure = Some(error),
            }
        }
        if self.output.stalled_since().is_some_and(|since| now.since(since) >= STALL_LIMIT) {
            self.failure = Some(io::Error::new(io::ErrorKind::TimedOut, "the other side does not read"));
        }
    }

    pub fn poll_timeout(&self) -> Option<Timestamp> {
        let stalled_since = self.output.stalled_since();
        if self.failure.is_some() || stalled_since.is_some() && !self.waits_for_room {
            return Some(Timestamp::ZERO);
        }
        stalled_since.map(|since| since + STALL_LIMIT)
    }

    pub fn send(&mut self, peer: PeerIndex, frame: &[u8], failures: &mut SendFailures) {
        if !self.output.push(frame) {
            failures.note(peer, 1, "the other side does not read fast enough");
        }
    }

    pub fn flush(&mut self, now: Timestamp) {
        if !self.output.is_empty()
            && !self.waits_for_room
            && let Err(error) = self.output.write(now, |bytes| self.stream.try_write(bytes))
        {
            self.failure = Some(error);
        }
    }

    /// Frames that did not go out.
    pub fn unsent(&self) -> u32 {
        self.output.frames()
    }
}
