//! The real binary while it runs.

use std::net::{SocketAddr, TcpListener, UdpSocket};
use std::process::{Child, Command, Output, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::Duration;
use std::{io, thread};

use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;

use crate::gimbald::Outcome;

/// A running `gimbald`; it is killed when it is dropped before its end.
pub struct Process {
    pid: Pid,
    ended: Receiver<io::Result<Output>>,
    has_ended: bool,
}

impl Process {
    /// Starts `gimbald` with these arguments and an empty environment.
    pub fn start(arguments: &[&str]) -> Self {
        let child = Command::new(env!("CARGO_BIN_EXE_gimbald"))
            .args(arguments)
            .env_clear()
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("cargo built the binary");
        let pid = Pid::from_raw(i32::try_from(child.id()).expect("process ids are small"));
        let (sender, ended) = channel();
        thread::spawn(move || sender.send(Child::wait_with_output(child)));
        Self { pid, ended, has_ended: false }
    }

    /// Asks it to end, as a service manager does.
    pub fn terminate(&self) {
        kill(self.pid, Signal::SIGTERM).expect("it runs");
    }

    /// What it left behind; it must end by itself within `patience`.
    #[track_caller]
    pub fn end(mut self, patience: Duration) -> Outcome {
        let finished = match self.ended.recv_timeout(patience) {
            Ok(finished) => finished.expect("its output can be read"),
            Err(RecvTimeoutError::Timeout) => panic!("it still runs after {patience:?}"),
            Err(RecvTimeoutError::Disconnected) => panic!("nobody waits for it"),
        };
        self.has_ended = true;
        Outcome {
            code: finished.status.code(),
            output: String::from_utf8(finished.stdout).expect("gimbald prints UTF-8"),
            errors: String::from_utf8(finished.stderr).expect("gimbald prints UTF-8"),
        }
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        if !self.has_ended && self.ended.try_recv().is_err() {
            // It may have ended this moment.
            let _ = kill(self.pid, Signal::SIGKILL);
        }
    }
}

/// An address on the loopback that no UDP socket has at the moment.
pub fn free_udp() -> SocketAddr {
    UdpSocket::bind("127.0.0.1:0").and_then(|socket| socket.local_addr()).expect("a free port")
}

/// The same for TCP.
pub fn free_tcp() -> SocketAddr {
    TcpListener::bind("127.0.0.1:0").and_then(|socket| socket.local_addr()).expect("a free port")
}
