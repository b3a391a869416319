//! A cable without hardware: a pseudo-terminal whose far end opens like a serial port.

use std::io;
use std::os::fd::{AsRawFd, OwnedFd, RawFd};
use std::path::PathBuf;
use std::task::{Context, Poll};

use nix::errno::Errno;
use nix::fcntl::{FcntlArg, OFlag, fcntl};
use nix::pty::openpty;
use nix::sys::termios::{SetArg, cfmakeraw, tcgetattr, tcsetattr};
use nix::unistd::{read, ttyname, write};
use tokio::io::unix::AsyncFd;

use crate::links::inbox::{Inbox, PeerIndex, PeerSet};
use crate::links::input_ready::watch_input;
use crate::links::{Link, Progress};
use crate::timestamp::Timestamp;

/// The only one at the other end.
const PEER: PeerIndex = 0;

/// Both ends of the cable, one of them to be given away by its path.
#[derive(Debug)]
pub struct Pty {
    near: OwnedFd,
    /// Open for as long as the cable lasts, so that the near end outlives whoever opens the far one.
    far: OwnedFd,
}

impl Pty {
    /// A cable that passes every byte on as it is.
    pub fn open() -> io::Result<Self> {
        let pair = openpty(None, None)?;
        let mut mode = tcgetattr(&pair.slave)?;
        cfmakeraw(&mut mode);
        tcsetattr(&pair.slave, SetArg::TCSANOW, &mode)?;
        let flags = OFlag::from_bits_retain(fcntl(&pair.master, FcntlArg::F_GETFL)?);
        fcntl(&pair.master, FcntlArg::F_SETFL(flags | OFlag::O_NONBLOCK))?;
        Ok(Self { near: pair.master, far: pair.slave })
    }

    /// Where the far end can be opened.
    pub fn path(&self) -> io::Result<PathBuf> {
        Ok(ttyname(&self.far)?)
    }

    /// The near end as a link; needs a runtime.
    pub fn into_link(self) -> io::Result<PtyLink> {
        Ok(PtyLink { near: watch_input(Near(self.near))?, _far: self.far, is_announced: false, failed: 0 })
    }
}

struct Near(OwnedFd);

impl AsRawFd for Near {
    fn as_raw_fd(&self) -> RawFd {
        self.0.as_raw_fd()
    }
}

/// The near end of a [`Pty`].
pub struct PtyLink {
    near: AsyncFd<Near>,
    _far: OwnedFd,
    is_announced: bool,
    failed: u32,
}

impl Link for PtyLink {
    fn poll(&mut self, _now: Timestamp, cx: &mut Context<'_>, inbox: &mut Inbox) -> Progress {
        if !std::mem::replace(&mut self.is_announced, true) {
            inbox.up();
            inbox.peer_appeared(PEER, "pseudo-terminal".to_owned());
        }
        if self.failed > 0 {
            inbox.send_failed(PEER, std::mem::take(&mut self.failed), "the other end does not read");
        }
        while let Poll::Ready(Ok(mut ready)) = self.near.poll_read_ready(cx) {
            let Some(buffer) = inbox.buffer() else { return Progress::More };
            match read(&ready.get_inner().0, buffer) {
                Ok(length) if length > 0 => inbox.received(PEER, length),
                // Nothing there; the far end never closes, as it is held open here.
                _ => ready.clear_ready(),
            }
        }
        Progress::Idle
    }

    fn poll_timeout(&self) -> Option<Timestamp> {
        None
    }

    /// Writes at once, as much as there is room for: what does not fit is cut off, as on an overrun line.
    fn send(&mut self, peers: PeerSet, frame: &[u8]) {
        if !peers.contains(PEER) {
            return;
        }
        loop {
            match write(&self.near.get_ref().0, frame) {
                Ok(length) if length == frame.len() => return,
                Err(Errno::EINTR) => {}
                _ => {
                    self.failed += 1;
                    return;
                }
            }
        }
    }

    fn flush(&mut self, _now: Timestamp) {}

    fn has_unsent(&self) -> bool {
        false
    }

    fn refuse(&mut self, _peer: PeerIndex) {}
}

#[cfg(test)]
mod tests {
    use std::fs::File;
    use std::future::poll_fn;
    use std::io::{Read, Write};

    use super::*;
    use crate::links::inbox::Event;

    #[test]
    fn every_byte_value_passes_both_ways() {
        let all: Vec<u8> = (0..=255).collect();
        let runtime = tokio::runtime::Builder::new_current_thread().enable_io().build().expect("a runtime");
        runtime.block_on(async {
            let pty = Pty::open().expect("a pseudo-terminal");
            let mut far = File::options().read(true).write(true).open(pty.path().expect("a path")).expect("it opens");
            let mut link = pty.into_link().expect("a link");

            link.send(PeerSet::from(PEER), &all);
            let mut received = [0; 256];
            far.read_exact(&mut received).expect("the bytes arrive");
            assert_eq!(received[..], all);

            far.write_all(&all).expect("there is room");
            let mut arrived = Vec::new();
            let mut inbox = Inbox::default();
            poll_fn(|cx| {
                inbox.clear();
                link.poll(Timestamp::ZERO, cx, &mut inbox);
                for index in 0..inbox.len() {
                    if let Event::Received { bytes, .. } = inbox.event(index) {
                        arrived.extend_from_slice(bytes);
                    }
                }
                if arrived.len() == all.len() { Poll::Ready(()) } else { Poll::Pending }
            })
            .await;
            assert_eq!(arrived, all);
        });
    }
}
