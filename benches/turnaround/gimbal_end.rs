//! Where the gimbal is: a UDP port or the far end of a serial cable.

use std::fmt;
use std::fs::File;
use std::io::{Read, Write};
use std::net::{SocketAddr, UdpSocket};
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};

use nix::fcntl::{FcntlArg, OFlag, fcntl};
use nix::pty::openpty;
use nix::sys::termios::{SetArg, cfmakeraw, tcgetattr, tcsetattr};
use nix::unistd::ttyname;

/// Of the serial line, which a pseudo-terminal does not heed but the daemon's pacing does.
pub const BAUD: u32 = 921_600;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Transport {
    Udp,
    Serial,
}

impl fmt::Display for Transport {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(match self {
            Self::Udp => "UDP",
            Self::Serial => "a pseudo-terminal",
        })
    }
}

pub enum GimbalEnd {
    Udp {
        socket: UdpSocket,
        /// Where the other end listens.
        peer: SocketAddr,
    },
    Serial {
        near: File,
        /// Open for as long as the cable lasts.
        far: OwnedFd,
    },
}

impl GimbalEnd {
    /// `peer` is whom it speaks to over UDP.
    pub fn open(transport: Transport, peer: SocketAddr) -> Self {
        match transport {
            Transport::Udp => {
                let socket = UdpSocket::bind("127.0.0.1:0").expect("a free port");
                socket.set_nonblocking(true).expect("a socket takes it");
                Self::Udp { socket, peer }
            }
            Transport::Serial => {
                let pair = openpty(None, None).expect("a pseudo-terminal");
                let mut mode = tcgetattr(&pair.slave).expect("it has a mode");
                cfmakeraw(&mut mode);
                tcsetattr(&pair.slave, SetArg::TCSANOW, &mode).expect("it takes another");
                fcntl(pair.master.as_fd(), FcntlArg::F_SETFL(OFlag::O_NONBLOCK)).expect("it takes the flag");
                Self::Serial { near: pair.master.into(), far: pair.slave }
            }
        }
    }

    /// Path of the serial device for the other end.
    pub fn device(&self) -> Option<String> {
        match self {
            Self::Udp { .. } => None,
            Self::Serial { far, .. } => Some(ttyname(far).expect("it has a name").display().to_string()),
        }
    }

    /// Of a gimbal on UDP.
    pub fn address(&self) -> SocketAddr {
        match self {
            Self::Udp { socket, .. } => socket.local_addr().expect("it is bound"),
            Self::Serial { .. } => unreachable!("a serial device has no address"),
        }
    }

    pub fn as_fd(&self) -> BorrowedFd<'_> {
        match self {
            Self::Udp { socket, .. } => socket.as_fd(),
            Self::Serial { near, .. } => near.as_fd(),
        }
    }

    /// What is there to be read; `None` when nothing is.
    pub fn read(&self, buffer: &mut [u8]) -> Option<usize> {
        match self {
            Self::Udp { socket, .. } => socket.recv(buffer).ok(),
            Self::Serial { near, .. } => (&*near).read(buffer).ok(),
        }
    }

    pub fn write(&self, bytes: &[u8]) {
        match self {
            Self::Udp { socket, peer } => {
                socket.send_to(bytes, peer).expect("this machine reaches itself");
            }
            Self::Serial { near, .. } => (&*near).write_all(bytes).expect("the line has room"),
        }
    }
}
