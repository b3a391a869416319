//! The real binary while it runs.

use std::net::{SocketAddr, TcpListener, UdpSocket};
use std::process::{Child, Command, Output, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::Duration;
use std::{fs, io, thread};

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

/// Fails the test, and says who is in the way, when a UDP port that cannot be chosen is not free.
#[track_caller]
pub fn require_free_udp(address: SocketAddr) {
    if let Err(error) = UdpSocket::bind(address) {
        panic!("this test needs {address}, which is held by {}: {error}", holders(address.port()).join(", "));
    }
}

/// The processes that hold a UDP port over IPv4, as `name (pid)`.
fn holders(port: u16) -> Vec<String> {
    let table = fs::read_to_string("/proc/net/udp").unwrap_or_default();
    let suffix = format!(":{port:04X}");
    let sockets: Vec<String> = table
        .lines()
        .map(|line| line.split_whitespace().collect::<Vec<_>>())
        .filter(|fields| fields.get(1).is_some_and(|local| local.ends_with(&suffix)))
        .filter_map(|fields| Some(format!("socket:[{}]", fields.get(9)?)))
        .collect();
    let mut found: Vec<String> = Vec::new();
    let entries = fs::read_dir("/proc").into_iter().flatten().flatten();
    // Beside the numbers stand links to the reader's own.
    for process in entries.filter(|entry| entry.file_name().to_string_lossy().parse::<u32>().is_ok()) {
        let files = fs::read_dir(process.path().join("fd")).into_iter().flatten().flatten();
        let mut targets = files.filter_map(|file| fs::read_link(file.path()).ok());
        if targets.any(|target| sockets.iter().any(|socket| target.as_os_str() == socket.as_str())) {
            let name = fs::read_to_string(process.path().join("comm")).unwrap_or_default();
            found.push(format!("{} ({})", name.trim(), process.file_name().display()));
        }
    }
    if found.is_empty() {
        found.push("a process of another user".to_owned());
    }
    found
}

#[test]
fn whoever_is_in_the_way_is_named() {
    let socket = UdpSocket::bind("127.0.0.1:0").expect("a free port");
    let address = socket.local_addr().expect("it is bound");

    let found = holders(address.port());

    // A process that another test starts has our sockets as well, for as long as it is not yet its own program.
    let us = format!(" ({})", std::process::id());
    let us = found.iter().find(|holder| holder.ends_with(&us)).unwrap_or_else(|| panic!("{found:?}"));
    let refusal = std::panic::catch_unwind(|| require_free_udp(address)).expect_err("it is held");
    let text = refusal.downcast_ref::<String>().expect("it says something");
    assert!(text.contains(us), "{text}");
}
