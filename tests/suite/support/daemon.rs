//! The real daemon as a process, and what is around it: real sockets, pseudo-terminals and simulated peers on them.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{Read, Write};
use std::net::{IpAddr, Ipv4Addr, SocketAddr, TcpListener, TcpStream, UdpSocket};
use std::os::fd::OwnedFd;
use std::os::unix::fs::{OpenOptionsExt, symlink};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicU8, Ordering};
use std::sync::mpsc::{Sender, TryRecvError, channel};
use std::sync::{Arc, Mutex};
use std::thread::{JoinHandle, sleep};
use std::time::Duration;

use gimbald::bridge::snapshot::Snapshot;
use gimbald::daemon::clock::Clock;
use gimbald::sim::peer::Peer;
use gimbald::timestamp::Timestamp;
use gimbald::wire::decoder::Patience;
use gimbald::wire::dialect::{MavMessage, MessageData};
use gimbald::wire::{DatagramFrames, FrameBuffer, MavId, StreamDecoder};
use nix::fcntl::OFlag;
use nix::pty::{grantpt, posix_openpt, ptsname_r, unlockpt};
use nix::sys::signal::{Signal, kill};
use nix::sys::termios::{SetArg, cfmakeraw, tcgetattr, tcsetattr};
use nix::unistd::Pid;
use serde_json::Value;

/// No wait is longer than this.
pub const PATIENCE: Duration = Duration::from_secs(8);

/// What `check` gives as soon as it gives something.
#[track_caller]
pub fn wait_for<T>(what: &str, mut check: impl FnMut() -> Option<T>) -> T {
    let clock = Clock::start();
    loop {
        if let Some(result) = check() {
            return result;
        }
        assert!(clock.now() < Timestamp::ZERO + PATIENCE, "waited in vain for {what}");
        sleep(Duration::from_millis(5));
    }
}

/// The surroundings of one daemon: a folder for its files and an address for its ports that no other test has.
pub struct Site {
    pub folder: tempfile::TempDir,
    pub address: IpAddr,
    /// What stands for each usual port: somebody may have the usual one on every address of this machine.
    ports: Mutex<BTreeMap<u16, u16>>,
}

impl Site {
    pub fn new() -> Self {
        static SITES: AtomicU8 = AtomicU8::new(1);
        let [.., high, low] = std::process::id().to_be_bytes();
        let number = SITES.fetch_add(1, Ordering::Relaxed);
        let address = Ipv4Addr::new(127, 1 + high % 254, low, number);
        let folder = tempfile::tempdir().expect("a temporary folder");
        Self { folder, address: address.into(), ports: Mutex::default() }
    }

    /// Where what usually has this port is at this site.
    pub fn port(&self, usual: u16) -> SocketAddr {
        let mut ports = self.ports.lock().expect("no test panics in here");
        SocketAddr::new(self.address, *ports.entry(usual).or_insert_with(|| free_port(self.address)))
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Starts `gimbald run`; in `config`, `{ip}:PORT` stands for [`port`](Self::port) and `{dir}` for our folder.
    pub fn start(&self, config: &str, variables: &[(&str, &str)]) -> Daemon {
        let text = self.filled(&format!("{config}\n[http]\nlisten = \"{{ip}}:8080\"\n"));
        fs::write(self.path("c.toml"), text).expect("a writable folder");
        let log = File::create(self.path("log")).expect("a writable folder");
        let child = Command::new(env!("CARGO_BIN_EXE_gimbald"))
            .args(["run", "--config", "c.toml"])
            .current_dir(self.folder.path())
            .env_clear()
            .envs(variables.iter().map(|(name, value)| (name, self.filled(value))))
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(log)
            .spawn()
            .expect("cargo built the binary");
        Daemon { child, http: self.port(8080), log: self.path("log") }
    }

    fn filled(&self, text: &str) -> String {
        let mut parts = text.split("{ip}:");
        let mut filled = parts.next().unwrap_or_default().to_owned();
        for part in parts {
            let end = part.find(|char: char| !char.is_ascii_digit()).unwrap_or(part.len());
            let usual = part[..end].parse().expect("a port follows the address");
            filled.push_str(&self.port(usual).to_string());
            filled.push_str(&part[end..]);
        }
        filled.replace("{dir}", &self.folder.path().to_string_lossy())
    }
}

/// A port that nobody has there, neither for UDP nor for TCP.
fn free_port(address: IpAddr) -> u16 {
    wait_for("a free port", || {
        let port = TcpListener::bind((address, 0)).ok()?.local_addr().ok()?.port();
        UdpSocket::bind((address, port)).is_ok().then_some(port)
    })
}

/// The text of a `[[link]]`.
pub fn link(name: &str, role: &str, endpoint: &str) -> String {
    format!("[[link]]\nname = \"{name}\"\nrole = \"{role}\"\nendpoint = \"{endpoint}\"\n")
}

/// A running `gimbald`; killed when it is dropped.
pub struct Daemon {
    child: Child,
    http: SocketAddr,
    log: PathBuf,
}

impl Drop for Daemon {
    fn drop(&mut self) {
        // It may have ended by itself.
        let _ = self.child.kill();
        let _ = self.child.wait();
        if std::thread::panicking() {
            eprintln!("{}", fs::read_to_string(&self.log).unwrap_or_default());
        }
    }
}

impl Daemon {
    pub fn signal(&self, signal: Signal) {
        kill(Pid::from_raw(self.child.id() as i32), signal).expect("it runs");
    }

    pub fn is_alive(&mut self) -> bool {
        self.child.try_wait().expect("our child").is_none()
    }

    /// Waits for the end: the exit code, `None` after a signal.
    pub fn wait(&mut self) -> Option<i32> {
        wait_for("the end of the process", || self.child.try_wait().expect("our child")).code()
    }

    /// Status code and body of a page, `None` when nobody answers within a second.
    pub fn get(&self, path: &str) -> Option<(u16, String)> {
        let mut stream = TcpStream::connect_timeout(&self.http, Duration::from_secs(1)).ok()?; // not yet, or no more
        stream.set_read_timeout(Some(Duration::from_secs(1))).expect("a time-out");
        let request = format!("GET {path} HTTP/1.1\r\nHost: {}\r\nConnection: close\r\n\r\n", self.http);
        stream.write_all(request.as_bytes()).ok()?;
        let mut answer = String::new();
        stream.read_to_string(&mut answer).ok()?;
        let (head, body) = answer.split_once("\r\n\r\n")?;
        Some((head.split(' ').nth(1)?.parse().expect("a status code"), body.to_owned()))
    }

    pub fn json(&self) -> Option<Value> {
        let (code, body) = self.get("/api/v1/status")?;
        (code == 200).then(|| serde_json::from_str(&body).expect("JSON"))
    }

    pub fn status(&self) -> Snapshot {
        let value = wait_for("the status", || self.json());
        serde_json::from_value(value).expect("a snapshot")
    }

    /// Waits until the status is as it should be.
    #[track_caller]
    pub fn wait_until(&self, what: &str, mut is: impl FnMut(&Snapshot) -> bool) -> Snapshot {
        let clock = Clock::start();
        loop {
            let status = self.status();
            if is(&status) {
                return status;
            }
            assert!(clock.now() < Timestamp::ZERO + PATIENCE, "waited in vain for {what}: {status:#?}");
            sleep(Duration::from_millis(5));
        }
    }

    #[track_caller]
    pub fn wait_until_up(&self) -> Snapshot {
        self.wait_until("all links", |status| status.links.iter().all(|link| link.state == "up"))
    }

    /// Waits until there is a gimbal that can be steered.
    #[track_caller]
    pub fn wait_for_gimbal(&self) -> Snapshot {
        self.wait_until("the gimbal", |status| {
            status.gimbals.first().is_some_and(|gimbal| gimbal.state == "alive" && gimbal.vendor.is_some())
        })
    }

    /// Processor time used so far, to 10 ms.
    pub fn processor_time(&self) -> Duration {
        let stat = self.proc("stat");
        let (_, fields) = stat.rsplit_once(") ").expect("the name stands in parentheses");
        let ticks: u64 =
            fields.split(' ').skip(11).take(2).map(|field| field.parse::<u64>().expect("a number of ticks")).sum();
        Duration::from_millis(10 * ticks)
    }

    /// Resident memory in KiB.
    pub fn resident_kib(&self) -> u64 {
        let status = self.proc("status");
        let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).expect("it has memory");
        line.trim_end_matches("kB").trim().parse().expect("a number")
    }

    fn proc(&self, name: &str) -> String {
        fs::read_to_string(Path::new("/proc").join(self.child.id().to_string()).join(name)).expect("it runs")
    }
}

/// A frame as it was received.
#[derive(Clone, Debug)]
pub struct Heard {
    pub at: Timestamp,
    pub source: MavId,
    pub id: u32,
    bytes: Vec<u8>,
}

impl Heard {
    pub fn decode<M: MessageData>(&self) -> Option<M> {
        DatagramFrames::new(&self.bytes).next_frame()?.decode()
    }
}

/// A component on a UDP socket of its own, scripted by the test.
pub struct Station {
    socket: UdpSocket,
    to: SocketAddr,
    pub id: MavId,
    sequence: u8,
    pub clock: Clock,
}

impl Station {
    /// Speaks to the port `to` of the daemon.
    pub fn new(id: MavId, to: SocketAddr) -> Self {
        let socket = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).expect("a free port");
        socket2::SockRef::from(&socket).set_recv_buffer_size(4 << 20).expect("it can be set");
        Self { socket, to, id, sequence: 0, clock: Clock::start() }
    }

    pub fn send(&mut self, message: &MavMessage) {
        let frame = FrameBuffer::default().encode_any(self.id, self.sequence, message).bytes().to_vec();
        self.sequence = self.sequence.wrapping_add(1);
        self.send_bytes(&frame);
    }

    /// The daemon need not be there.
    pub fn send_bytes(&self, bytes: &[u8]) {
        let _ = self.socket.send_to(bytes, self.to);
    }

    /// What arrives until `end`.
    pub fn hear_until(&self, end: Timestamp) -> Vec<Heard> {
        let mut heard = Vec::new();
        loop {
            let left = end.since(self.clock.now());
            if left.is_zero() {
                return heard;
            }
            self.socket.set_read_timeout(Some(left)).expect("a time-out");
            heard.extend(self.hear().unwrap_or_default());
        }
    }

    pub fn hear_for(&self, duration: Duration) -> Vec<Heard> {
        self.hear_until(self.clock.now() + duration)
    }

    /// What has arrived so far.
    pub fn hear_now(&self) -> Vec<Heard> {
        self.socket.set_nonblocking(true).expect("it can be set");
        let heard = std::iter::from_fn(|| self.hear()).flatten().collect();
        self.socket.set_nonblocking(false).expect("it can be set");
        heard
    }

    /// The first frame from which `pick` makes something; others are forgotten.
    #[track_caller]
    pub fn wait_for<T>(&self, what: &str, mut pick: impl FnMut(&Heard) -> Option<T>) -> T {
        self.socket.set_read_timeout(Some(Duration::from_millis(50))).expect("a time-out");
        let end = self.clock.now() + PATIENCE;
        loop {
            if let Some(picked) = self.hear().unwrap_or_default().iter().find_map(&mut pick) {
                return picked;
            }
            assert!(self.clock.now() < end, "waited in vain for {what}");
        }
    }

    /// The frames of one datagram, `None` when none came in time.
    fn hear(&self) -> Option<Vec<Heard>> {
        let mut buffer = [0; 2048];
        // Nothing in time, or the daemon was not there for the datagram before.
        let length = self.socket.recv(&mut buffer).ok()?;
        let at = self.clock.now();
        let mut frames = DatagramFrames::new(&buffer[..length]);
        let mut heard = Vec::new();
        while let Some(frame) = frames.next_frame() {
            let (source, id, bytes) = (frame.source(), frame.message_id(), frame.bytes().to_vec());
            heard.push(Heard { at, source, id, bytes });
        }
        Some(heard)
    }
}

/// A peer that the test can look at while it lives at the other end of a cable.
pub struct Shared<P>(Arc<Mutex<State<P>>>);

struct State<P> {
    peer: P,
    /// Goes on while the cable is out.
    clock: Clock,
    decoder: StreamDecoder,
    heard: Vec<Heard>,
}

impl<P> Clone for Shared<P> {
    fn clone(&self) -> Self {
        Self(self.0.clone())
    }
}

impl<P: Peer + Send + 'static> Shared<P> {
    pub fn new(peer: P) -> Self {
        let decoder = StreamDecoder::new(Patience::Serial { baud: 115_200 });
        Self(Arc::new(Mutex::new(State { peer, clock: Clock::start(), decoder, heard: Vec::new() })))
    }

    /// Puts the cable in: the peer is at `path`, which must be free.
    pub fn plug_in(&self, path: &Path) -> Cable {
        let line = Line::open();
        symlink(&line.device, path).expect("the path is free");
        let (stop, stopped) = channel();
        let shared = self.clone();
        let thread = std::thread::spawn(move || {
            while stopped.try_recv() == Err(TryRecvError::Empty) {
                shared.live(&line);
                sleep(Duration::from_millis(1));
            }
        });
        Cable { path: path.to_owned(), end: Some((stop, thread)) }
    }

    /// Does what there is to do on a line.
    fn live(&self, line: &Line) {
        let state = &mut *self.state();
        let now = state.clock.now();
        let bytes = line.read();
        if !bytes.is_empty() {
            state.peer.handle_received(now, &bytes);
            state.decoder.push(now, &bytes);
            while let Some(frame) = state.decoder.next_frame() {
                let (source, id, bytes) = (frame.source(), frame.message_id(), frame.bytes().to_vec());
                state.heard.push(Heard { at: now, source, id, bytes });
            }
        }
        if state.peer.poll_timeout().is_none_or(|at| at <= now) {
            state.peer.handle_timeout(now);
        }
        while let Some(bytes) = state.peer.poll_output() {
            line.write(&bytes);
        }
    }

    /// Looks at the peer.
    pub fn with<T>(&self, look: impl FnOnce(&P, Timestamp) -> T) -> T {
        let state = self.state();
        look(&state.peer, state.clock.now())
    }

    /// What it heard so far; it is forgotten.
    pub fn take_heard(&self) -> Vec<Heard> {
        std::mem::take(&mut self.state().heard)
    }

    fn state(&self) -> std::sync::MutexGuard<'_, State<P>> {
        self.0.lock().expect("no peer panics")
    }
}

/// A pseudo-terminal without a peer. No process that another test starts holds it open by chance.
pub struct Line {
    near: File,
    /// Keeps the line alive while nobody else has its far end open.
    _far: File,
    pub device: PathBuf,
}

impl Line {
    pub fn open() -> Self {
        let flags = OFlag::O_RDWR | OFlag::O_NOCTTY | OFlag::O_NONBLOCK | OFlag::O_CLOEXEC;
        let near = posix_openpt(flags).expect("a pseudo-terminal");
        grantpt(&near).and_then(|()| unlockpt(&near)).expect("it is ours");
        let device = PathBuf::from(ptsname_r(&near).expect("it has a name"));
        let flags = OFlag::O_NOCTTY.bits();
        let far = File::options().read(true).write(true).custom_flags(flags).open(&device).expect("it opens");
        let mut mode = tcgetattr(&far).expect("a terminal");
        cfmakeraw(&mut mode);
        tcsetattr(&far, SetArg::TCSANOW, &mode).expect("it takes the mode");
        Self { near: File::from(OwnedFd::from(near)), _far: far, device }
    }

    /// What there is to read.
    pub fn read(&self) -> Vec<u8> {
        let mut buffer = vec![0; 65_536];
        // Nothing there.
        let length = (&self.near).read(&mut buffer).unwrap_or(0);
        buffer.truncate(length);
        buffer
    }

    /// Writes what there is room for, as a line does that is overrun: how much that was.
    pub fn write(&self, bytes: &[u8]) -> usize {
        (&self.near).write(bytes).unwrap_or(0)
    }
}

/// A peer at the end of a pseudo-terminal; pulled out when it is dropped.
pub struct Cable {
    path: PathBuf,
    end: Option<(Sender<()>, JoinHandle<()>)>,
}

impl Cable {
    pub fn pull(self) {}
}

impl Drop for Cable {
    fn drop(&mut self) {
        // The device goes as a real one does: first its name, then what was open.
        let _ = fs::remove_file(&self.path);
        if let Some((stop, thread)) = self.end.take() {
            // It may have ended by itself.
            let _ = stop.send(());
            let _ = thread.join();
        }
    }
}
