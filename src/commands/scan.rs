//! `gimbald scan`: which serial port, baud rate and gimbal family answer.

mod conversation;
mod ports;

use std::collections::BTreeMap;
use std::fmt;
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};

use tokio::io::unix::AsyncFd;
use tokio::time::timeout;
use tokio_serial::{ClearBuffer, SerialPort, SerialStream};

use self::conversation::{Conversation, Party};
use self::ports::{Port, PortError};
use super::client::{ClientError, Target, printable_text};
use super::daemon_address;
use super::status;
use crate::bridge::settings::Role;
use crate::bridge::snapshot::{GimbalSnapshot, LinkSnapshot};
use crate::cli::ScanArgs;
use crate::daemon::clock::Clock;
use crate::endpoint::Endpoint;
use crate::exit_code::ExitCode;
use crate::links::input_ready::watch_input;
use crate::wire::MavId;

/// The likely ones first.
const BAUDS: [u32; 8] = [115_200, 921_600, 57_600, 230_400, 460_800, 500_000, 1_000_000, 38_400];

/// Why a scan could not be made.
#[derive(Debug, thiserror::Error)]
enum ScanError {
    #[error("{}: {cause}", path.display())]
    NoSuchPort { path: PathBuf, cause: io::Error },
    #[error("{}: not a serial port, or one without hardware; expected a device such as /dev/ttyUSB0", .0.display())]
    NotASerialPort(PathBuf),
    #[error("{}: {what}, where no gimbal can be; expected a serial port such as /dev/ttyUSB0", path.display())]
    NoLine { path: PathBuf, what: &'static str },
    #[error("no serial ports found")]
    NoPorts,
    #[error("nothing answered")]
    NothingAnswered,
    #[error(transparent)]
    Daemon(#[from] ClientError),
    #[error("the scan could not be started: {0}")]
    Runtime(#[source] io::Error),
}

impl ScanError {
    fn exit_code(&self) -> ExitCode {
        match self {
            Self::NotASerialPort(_) | Self::NoLine { .. } => ExitCode::Usage,
            Self::Daemon(error) => error.exit_code(),
            Self::NoSuchPort { .. } | Self::NoPorts | Self::NothingAnswered | Self::Runtime(_) => ExitCode::Unavailable,
        }
    }
}

/// Tries the ports one after the other; findings go to `output`, progress and problems to `errors`.
pub fn scan(arguments: &ScanArgs, output: &mut impl Write, errors: &mut impl Write) -> ExitCode {
    let daemon = daemon_address::target(&arguments.daemon).map_err(ScanError::Daemon);
    match daemon.and_then(|daemon| run(arguments.device.as_deref(), &daemon, output, errors)) {
        Ok(()) => ExitCode::Ok,
        Err(error) => {
            say(errors, format_args!("gimbald scan: {error}"));
            error.exit_code()
        }
    }
}

fn run(
    device: Option<&Path>,
    daemon: &Target,
    output: &mut impl Write,
    errors: &mut impl Write,
) -> Result<(), ScanError> {
    let ports = match device {
        Some(path) => {
            vec![Port::at(path).map_err(|cause| ScanError::NoSuchPort { path: path.to_owned(), cause })?]
        }
        None => ports::all(Path::new("/dev")),
    };
    if ports.is_empty() {
        return Err(ScanError::NoPorts);
    }
    let runtime = tokio::runtime::Builder::new_current_thread().enable_io().enable_time().build();
    runtime.map_err(ScanError::Runtime)?.block_on(async {
        let held = held_by_daemon(daemon, errors).await;
        let mut names = Names::default();
        let mut told = false;
        for port in ports {
            let shown = port.name.display();
            if let Some(held) = held.iter().find(|held| held.device == port.device) {
                say(errors, format_args!("{shown}: left alone, it belongs to the running gimbald, which says:"));
                say(output, format_args!("{held}"));
                told |= !held.gimbals.is_empty();
                continue;
            }
            match try_port(&port, errors).await {
                Ok(Some(finding)) => {
                    say(output, format_args!("{}", finding.described(&mut names)));
                }
                Ok(None) => say(errors, format_args!("{shown}: nothing answers")),
                Err(TryError::Port(PortError::NotASerialPort)) => {
                    if device.is_some() {
                        return Err(ScanError::NotASerialPort(port.name));
                    }
                }
                // None of these is ever listed, so it was named.
                Err(TryError::Port(PortError::NoLine(what))) => {
                    return Err(ScanError::NoLine { path: port.name, what });
                }
                Err(error) => say(errors, format_args!("{shown}: {error}")),
            }
        }
        if names.0.is_empty() && !told { Err(ScanError::NothingAnswered) } else { Ok(()) }
    })
}

/// The daemon's serial links, whose ports it opens again whenever they are free.
async fn held_by_daemon(daemon: &Target, errors: &mut impl Write) -> Vec<Held> {
    match status::snapshot(daemon).await {
        Ok(snapshot) => snapshot.links.iter().filter_map(|link| Held::of_link(link, &snapshot.gimbals)).collect(),
        Err(ClientError::Unreachable { .. }) => Vec::new(),
        Err(error) => {
            say(errors, format_args!("which ports a running gimbald has cannot be asked ({error}); locks tell"));
            Vec::new()
        }
    }
}

/// A port of the running daemon, and what that knows of it.
#[derive(Debug)]
struct Held {
    device: PathBuf,
    path: String,
    baud: u32,
    /// `up` or `down`.
    state: String,
    gimbals: Vec<GimbalSnapshot>,
}

impl Held {
    fn of_link(link: &LinkSnapshot, gimbals: &[GimbalSnapshot]) -> Option<Self> {
        let Ok(Endpoint::Serial { path, baud }) = link.endpoint.parse() else { return None };
        // A path that leads nowhere leads to none of the ports that are there.
        let device = Port::at(Path::new(&path)).ok()?.device;
        let heard: Vec<&String> = link.peers.iter().flat_map(|peer| &peer.components).collect();
        let is_there = |gimbal: &&GimbalSnapshot| gimbal.device.as_ref().is_some_and(|device| heard.contains(&device));
        let gimbals = gimbals.iter().filter(is_there).cloned().collect();
        Some(Self { device, path, baud, state: link.state.clone(), gimbals })
    }
}

impl fmt::Display for Held {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {} baud, {}", self.path, self.baud, printable_text(&self.state))?;
        for gimbal in &self.gimbals {
            let generation = gimbal.details.generation.iter();
            let product = [&gimbal.vendor, &gimbal.model].into_iter().flatten();
            let firmware = gimbal.firmware.iter().map(|version| format!("firmware {version}"));
            let family = [gimbal.family.as_str()].into_iter().chain(generation.map(String::as_str)).collect::<Vec<_>>();
            let told = product.cloned().chain(firmware).chain([gimbal.state.clone()]);
            let told = [family.join(" ")].into_iter().chain(told).collect::<Vec<_>>().join(", ");
            let device = gimbal.device.as_deref().unwrap_or_default();
            write!(f, "\n  {}: {}", printable_text(device), printable_text(&told))?;
        }
        Ok(())
    }
}

#[derive(Debug, thiserror::Error)]
enum TryError {
    #[error(transparent)]
    Port(#[from] PortError),
    #[error("lost: {0}")]
    Lost(#[from] io::Error),
}

/// Tries each baud rate until somebody answers.
async fn try_port(port: &Port, errors: &mut impl Write) -> Result<Option<Finding>, TryError> {
    let mut device = watch_input(port.open(BAUDS[0])?)?;
    let clock = Clock::start();
    for baud in BAUDS {
        if let Err(error) = device.get_mut().set_baud_rate(baud) {
            say(errors, format_args!("{}: {baud} baud: {error}", port.name.display()));
            continue;
        }
        say(errors, format_args!("{}: {baud} baud …", port.name.display()));
        // What came in, or waits to go out, at another rate is noise at this one.
        device.get_ref().clear(ClearBuffer::All).map_err(io::Error::from)?;
        let parties = converse(&mut device, baud, clock).await?;
        if !parties.is_empty() {
            return Ok(Some(Finding { port: port.clone(), baud, parties }));
        }
    }
    Ok(None)
}

/// Speaks with whoever is at the other end, for as long as it is worth it.
async fn converse(device: &mut AsyncFd<SerialStream>, baud: u32, clock: Clock) -> io::Result<BTreeMap<MavId, Party>> {
    let mut conversation = Conversation::new(clock.now(), baud);
    let mut buffer = [0; 4096];
    loop {
        let now = clock.now();
        if conversation.is_over(now) {
            return Ok(conversation.into_parties());
        }
        conversation.handle_timeout(now);
        while let Some(frame) = conversation.poll_output() {
            match device.get_mut().write(&frame) {
                Ok(_) => {}
                // A line that takes nothing has nobody who answers; what is cut off is repeated.
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => {}
                Err(error) => return Err(error),
            }
        }
        let Ok(ready) = timeout(conversation.poll_timeout().since(now), device.readable_mut()).await else { continue };
        let mut ready = ready?;
        match ready.get_inner_mut().read(&mut buffer) {
            Ok(0) => return Err(io::Error::new(io::ErrorKind::UnexpectedEof, "the device is gone")),
            Ok(length) => conversation.handle_received(clock.now(), &buffer[..length]),
            Err(error) if error.kind() == io::ErrorKind::WouldBlock => ready.clear_ready(),
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
}

/// Who answered, and where.
#[derive(Debug)]
struct Finding {
    port: Port,
    baud: u32,
    /// Not empty.
    parties: BTreeMap<MavId, Party>,
}

/// The names that were given to links so far.
#[derive(Debug, Default)]
struct Names(Vec<String>);

impl Names {
    /// `name`, or with a number behind it when that is taken.
    fn take(&mut self, name: &str) -> String {
        let others = self.0.iter().filter(|taken| taken.split('-').next() == Some(name)).count();
        let name = if others == 0 { name.to_owned() } else { format!("{name}-{}", others + 1) };
        self.0.push(name.clone());
        name
    }
}

impl Finding {
    fn role(&self) -> Role {
        let any = |is: fn(&Party) -> bool| self.parties.values().any(is);
        if any(Party::is_autopilot) {
            Role::Autopilot
        } else if any(Party::is_gimbal) {
            Role::Gimbal
        } else if any(Party::is_ground_station) {
            Role::Ground
        } else {
            Role::Peer
        }
    }

    fn described(&self, names: &mut Names) -> String {
        let role = self.role().name();
        let path = self.port.name.display();
        let endpoint = toml::Value::String(format!("serial:{path}:{}", self.baud));
        let parties: String = self.parties.iter().map(|(id, party)| format!("  {id}: {party}\n")).collect();
        let name = names.take(role);
        let gimbals = self.gimbal_entries(&name, names);
        format!(
            "{path}: {} baud\n{parties}\n[[link]]\nname = \"{name}\"\nrole = \"{role}\"\nendpoint = {endpoint}\n{gimbals}",
            self.baud
        )
    }

    /// An entry for each gimbal on `link`; of several, each is named by its component.
    fn gimbal_entries(&self, link: &str, names: &mut Names) -> String {
        let gimbals: Vec<_> = self.parties.iter().filter(|(_, party)| party.is_gimbal()).collect();
        let entry = |(id, party): &(&MavId, &Party)| {
            let name = names.take("camera");
            // What is in doubt the daemon finds out.
            let family = party.family().map(|family| format!("family = \"{}\"\n", family.name())).unwrap_or_default();
            let component =
                if gimbals.len() > 1 { format!("component_id = {}\n", id.component) } else { String::new() };
            format!("\n[[gimbal]]\nname = \"{name}\"\nlink = \"{link}\"\n{family}{component}")
        };
        gimbals.iter().map(entry).collect()
    }
}

impl fmt::Display for Party {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if !self.is_gimbal() {
            return write!(f, "MAVLink, no gimbal");
        }
        if self.is_doubtful() {
            return write!(f, "a gimbal that only beats: mavlink_v1, or a mavlink_v2 that is still starting");
        }
        write!(f, "{}", self.speaks())?;
        let Some(identity) = &self.identity else { return write!(f, ", which does not tell its make") };
        for name in [&identity.vendor, &identity.model, &identity.custom_name] {
            if !name.is_empty() {
                write!(f, ", {}", printable_text(name))?;
            }
        }
        match identity.firmware {
            Some([major, minor, patch, 0]) => write!(f, ", firmware {major}.{minor}.{patch}"),
            Some([major, minor, patch, development]) => write!(f, ", firmware {major}.{minor}.{patch}-{development}"),
            None => Ok(()),
        }
    }
}

fn say(to: &mut impl Write, line: fmt::Arguments<'_>) {
    // The exit code says it too; nobody is left to tell when the reader is gone.
    let _ = writeln!(to, "{line}").and_then(|()| to.flush());
}

#[cfg(test)]
mod tests {
    use std::fs::File;
    use std::net::{Ipv4Addr, SocketAddr, TcpListener};
    use std::os::fd::{AsFd, OwnedFd};
    use std::os::unix::fs::symlink;
    use std::sync::mpsc::{Receiver, Sender, TryRecvError, channel};
    use std::sync::{Arc, LazyLock, Mutex};
    use std::thread::JoinHandle;
    use std::time::Duration;

    use nix::errno::Errno;
    use nix::fcntl::{FcntlArg, OFlag, fcntl};
    use nix::pty::openpty;
    use nix::unistd::{read, ttyname, write};
    use socket2::{Domain, Socket, Type};

    use super::*;
    use crate::gimbals::mavlink_v2::sim::{Device, DeviceSettings};
    use crate::sim::peer::Peer;
    use crate::sim::vehicle::{Vehicle, VehicleSettings};
    use crate::timestamp::Timestamp;

    /// What a scan says of its progress, as it says it.
    #[derive(Clone, Default)]
    struct Said(Arc<Mutex<Vec<u8>>>);

    impl Said {
        fn text(&self) -> String {
            String::from_utf8(self.0.lock().expect("no panic").clone()).expect("text")
        }

        /// How many baud rates were set so far.
        fn attempts(&self) -> usize {
            self.text().matches(" baud …\n").count()
        }
    }

    impl Write for Said {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            self.0.lock().expect("no panic").write(bytes)
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    /// A peer behind a pseudo-terminal, which understands one of the baud rates that are tried, counted from one.
    ///
    /// A pseudo-terminal passes bytes on at any rate; the scan says which one is set. Nobody but the scan has its near end
    /// open: a process that another test starts would inherit it, and the port would be in use.
    struct Plugged {
        path: PathBuf,
        said: Said,
        stop: Sender<()>,
        thread: JoinHandle<usize>,
    }

    impl Plugged {
        fn new(peer: impl Peer + Send + 'static, understood: usize) -> Self {
            let pty = openpty(None, None).expect("a pseudo-terminal");
            fcntl(pty.master.as_fd(), FcntlArg::F_SETFL(OFlag::O_NONBLOCK)).expect("it takes the flag");
            let path = ttyname(&pty.slave).expect("it has a name");
            drop(pty.slave);
            let (stop, stopped) = channel();
            let said = Said::default();
            let heard = said.clone();
            let thread =
                std::thread::spawn(move || live(peer, &pty.master, || heard.attempts() == understood, &stopped));
            Self { path, said, stop, thread }
        }

        /// Scans the port under the name `path`: what came of it, what was found, what was said.
        fn scan(&self, path: &Path, daemon: &Target) -> (Result<(), ScanError>, String, String) {
            let mut output = Vec::new();
            let result = run(Some(path), daemon, &mut output, &mut self.said.clone());
            (result, String::from_utf8(output).expect("text"), self.said.text())
        }

        /// Takes the peer away: how many bytes it was sent.
        fn end(self) -> usize {
            self.stop.send(()).expect("it still lives");
            self.thread.join().expect("no panic")
        }
    }

    fn live(mut peer: impl Peer, line: &OwnedFd, understands: impl Fn() -> bool, stopped: &Receiver<()>) -> usize {
        let clock = Clock::start();
        let mut received = 0;
        let mut buffer = [0; 1024];
        while stopped.try_recv() == Err(TryRecvError::Empty) {
            let now = clock.now();
            match read(line, &mut buffer) {
                Ok(length) => {
                    received += length;
                    if understands() {
                        peer.handle_received(now, &buffer[..length]);
                    }
                }
                Err(Errno::EAGAIN | Errno::EIO | Errno::EINTR) => {}
                Err(error) => panic!("{error}"),
            }
            peer.handle_timeout(now);
            while let Some(bytes) = peer.poll_output() {
                let heard = if understands() { &bytes[..] } else { &[0x55; 16] };
                assert_eq!(write(line, heard), Ok(heard.len()));
            }
            std::thread::sleep(Duration::from_millis(2));
        }
        received
    }

    /// A port where nobody listens, and that nobody else can get while the tests run.
    fn no_daemon() -> Target {
        static TAKEN: LazyLock<Socket> = LazyLock::new(|| {
            let socket = Socket::new(Domain::IPV4, Type::STREAM, None).expect("a socket");
            socket.bind(&SocketAddr::from((Ipv4Addr::LOCALHOST, 0)).into()).expect("a free port");
            socket
        });
        let address = TAKEN.local_addr().expect("it is bound").as_socket().expect("of IP");
        Target::parse(&format!("http://{address}")).expect("right")
    }

    fn scan_at(path: &Path, daemon: &Target) -> (Result<(), ScanError>, String, String) {
        let (mut output, mut errors) = (Vec::new(), Vec::new());
        let result = run(Some(path), daemon, &mut output, &mut errors);
        let text = |bytes| String::from_utf8(bytes).expect("text");
        (result, text(output), text(errors))
    }

    /// "Reports device, baud, system/component, family, vendor, model, firmware, and the [[link]] lines to paste", with
    /// those that name the gimbal.
    #[test]
    fn a_gimbal_is_found_at_its_baud_rate() {
        let settings = DeviceSettings { listens_first: None, ..DeviceSettings::default() };
        let gimbal = Plugged::new(Device::new(Timestamp::ZERO, settings), 2);
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("by id:gimbal");
        symlink(&gimbal.path, &path).expect("a link");

        let (result, output, errors) = gimbal.scan(&path, &no_daemon());

        result.expect("it answers");
        let shown = path.display();
        let expected = format!(
            "{shown}: 921600 baud\n  1/154: mavlink_v2, gimbald, Simulated v2, firmware 1.0.0\n\n\
             [[link]]\nname = \"gimbal\"\nrole = \"gimbal\"\nendpoint = \"serial:{shown}:921600\"\n\n\
             [[gimbal]]\nname = \"camera\"\nlink = \"gimbal\"\nfamily = \"mavlink_v2\"\n\n"
        );
        assert_eq!(output, expected);
        assert_eq!(errors, format!("{shown}: 115200 baud …\n{shown}: 921600 baud …\n"));
        gimbal.end();
    }

    #[test]
    fn an_autopilot_is_said_to_be_no_gimbal() {
        let time = Timestamp::ZERO;
        let autopilot = Plugged::new(Vehicle::new(time, VehicleSettings::default()), 1);

        let (result, output, _) = autopilot.scan(&autopilot.path, &no_daemon());

        result.expect("it answers");
        let shown = autopilot.path.display();
        let expected = format!(
            "{shown}: 115200 baud\n  1/1: MAVLink, no gimbal\n\n\
             [[link]]\nname = \"autopilot\"\nrole = \"autopilot\"\nendpoint = \"serial:{shown}:115200\"\n\n"
        );
        assert_eq!(output, expected);
        autopilot.end();
    }

    /// "It asks a running daemon first and never opens a port that a process holds."
    #[test]
    fn a_port_of_the_running_daemon_is_left_alone() {
        let gimbal = Plugged::new(Device::new(Timestamp::ZERO, DeviceSettings::default()), 1);
        let mut snapshot = crate::http::canned::snapshot();
        snapshot.links[0].endpoint = format!("serial:{}:57600", gimbal.path.display());
        snapshot.links[0].peers[0].components = vec!["1/154".to_owned()];
        let body = serde_json::to_string(&snapshot).expect("JSON");
        let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
        let daemon = format!("http://{}", listener.local_addr().expect("it is bound"));
        let daemon = Target::parse(&daemon).expect("right");
        let server = std::thread::spawn(move || {
            let (mut client, _) = listener.accept().expect("a client");
            let mut asked = Vec::new();
            while !asked.ends_with(b"\r\n\r\n") {
                let mut byte = [0];
                client.read_exact(&mut byte).expect("a request");
                asked.push(byte[0]);
            }
            write!(client, "HTTP/1.1 200 OK\r\nContent-Length: {}\r\n\r\n{body}", body.len()).expect("it listens");
        });

        let (result, output, errors) = gimbal.scan(&gimbal.path, &daemon);

        server.join().expect("no panic");
        result.expect("the daemon knows it");
        let shown = gimbal.path.display();
        let expected = format!("{shown}: 57600 baud, up\n  1/154: mavlink_v2 v2, Acme, Pixy, firmware 7.8.1, alive\n");
        assert_eq!(output, expected);
        assert_eq!(errors, format!("{shown}: left alone, it belongs to the running gimbald, which says:\n"));
        assert_eq!(gimbal.end(), 0);
    }

    /// "69 when not, 64 for a DEVICE that is no tty (clear text)."
    #[test]
    fn wrong_devices_have_their_exit_codes() {
        let folder = tempfile::tempdir().expect("a folder");
        let (file, gone) = (folder.path().join("file"), folder.path().join("gone"));
        File::create(&file).expect("a file");

        let error = scan_at(&file, &no_daemon()).0.expect_err("no terminal");
        let text = format!(
            "{}: not a serial port, or one without hardware; expected a device such as /dev/ttyUSB0",
            file.display()
        );
        assert_eq!((error.exit_code(), error.to_string()), (ExitCode::Usage, text));
        let error = scan_at(Path::new("/dev/ptmx"), &no_daemon()).0.expect_err("no line");
        let text = "/dev/ptmx: what makes pseudo-terminals, where no gimbal can be; expected a serial port such as /dev/ttyUSB0";
        assert_eq!((error.exit_code(), error.to_string().as_str()), (ExitCode::Usage, text));
        let error = scan_at(&gone, &no_daemon()).0.expect_err("not there");
        let text = format!("{}: No such file or directory (os error 2)", gone.display());
        assert_eq!((error.exit_code(), error.to_string()), (ExitCode::Unavailable, text));
    }

    /// Names come from devices.
    #[test]
    fn names_of_gimbals_do_not_command_the_terminal() {
        let identity = crate::gimbals::report::Identity { vendor: "a\u{202e}b".to_owned(), ..Default::default() };
        let mut party = Party::default();
        party.is_gimbal_device = true;
        assert_eq!(party.to_string(), "mavlink_v2, which does not tell its make");
        party.identity = Some(identity);
        assert_eq!(party.to_string(), "mavlink_v2, a\u{fffd}b");
    }

    /// Of two gimbals on one line each has its component; what only beats may be of any family.
    #[test]
    fn each_gimbal_has_an_entry() {
        let mut v2 = Party::default();
        v2.is_gimbal_device = true;
        let beats = Party::beating_as_gimbal();
        let port = Port { name: "/dev/ttyUSB0".into(), device: "/dev/ttyUSB0".into() };
        let parties = [(MavId::new(1, 154), v2), (MavId::new(1, 171), beats)].into();
        let finding = Finding { port, baud: 115_200, parties };

        let entries = finding.gimbal_entries("gimbal", &mut Names::default());

        assert_eq!(
            entries,
            "\n[[gimbal]]\nname = \"camera\"\nlink = \"gimbal\"\nfamily = \"mavlink_v2\"\ncomponent_id = 154\n\
             \n[[gimbal]]\nname = \"camera-2\"\nlink = \"gimbal\"\ncomponent_id = 171\n"
        );
    }

    #[test]
    fn two_links_of_one_role_have_two_names() {
        let mut names = Names::default();
        assert_eq!(
            ["gimbal", "autopilot", "gimbal", "gimbal"].map(|name| names.take(name)),
            ["gimbal", "autopilot", "gimbal-2", "gimbal-3"]
        );
    }
}
