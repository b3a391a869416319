use std::fs::File;
use std::io::Read;
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
use crate::daemon::clock::Clock;
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
        let thread = std::thread::spawn(move || live(peer, &pty.master, || heard.attempts() == understood, &stopped));
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

/// A daemon that has `port` open at 57600 baud, heard `components` there, and is asked once.
fn daemon_with(port: &Path, components: &[&str]) -> (Target, JoinHandle<()>) {
    let mut snapshot = crate::http::canned::snapshot();
    snapshot.links[0].endpoint = format!("serial:{}:57600", port.display());
    snapshot.links[0].peers[0].components = components.iter().map(|id| (*id).to_owned()).collect();
    let body = serde_json::to_string(&snapshot).expect("JSON");
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    let daemon = format!("http://{}", listener.local_addr().expect("it is bound"));
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
    (Target::parse(&daemon).expect("right"), server)
}

/// "It asks a running daemon first and never opens a port that a process holds."
#[test]
fn a_port_of_the_running_daemon_is_left_alone() {
    let gimbal = Plugged::new(Device::new(Timestamp::ZERO, DeviceSettings::default()), 1);
    let (daemon, server) = daemon_with(&gimbal.path, &["1/154"]);

    let (result, output, errors) = gimbal.scan(&gimbal.path, &daemon);

    server.join().expect("no panic");
    result.expect("the daemon knows it");
    let shown = gimbal.path.display();
    let expected = format!("{shown}: 57600 baud, up\n  1/154: mavlink_v2 v2, Acme, Pixy, firmware 7.8.1, alive\n");
    assert_eq!(output, expected);
    assert_eq!(errors, format!("{shown}: left alone, it belongs to the running gimbald, which says:\n"));
    assert_eq!(gimbal.end(), 0);
}

/// "`gimbald scan` finds baud rate … and never opens a port that a process holds": where the daemon may have the wrong one,
/// it has to make room; who hears somebody there has the right one, gimbal or not.
#[test]
fn a_daemon_that_understands_nothing_has_to_make_room() {
    for (components, is_understood) in [(&[][..], false), (&["1/1"], true)] {
        let gimbal = Plugged::new(Device::new(Timestamp::ZERO, DeviceSettings::default()), 2);
        let (daemon, server) = daemon_with(&gimbal.path, components);

        let (result, output, errors) = gimbal.scan(&gimbal.path, &daemon);

        server.join().expect("no panic");
        assert!(matches!(result, Err(ScanError::NothingAnswered)), "{result:?}");
        let shown = gimbal.path.display();
        assert_eq!(output, format!("{shown}: 57600 baud, up\n"));
        let advice = format!(
            "{shown}: nothing that it understands was heard there at 57600 baud; to try the other rates, stop the service \
             (sudo systemctl stop gimbald) and scan again\n"
        );
        let advice = if is_understood { "" } else { &advice };
        assert_eq!(errors, format!("{shown}: left alone, it belongs to the running gimbald, which says:\n{advice}"));
        assert_eq!(gimbal.end(), 0);
    }
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
    let text =
        "/dev/ptmx: what makes pseudo-terminals, where no gimbal can be; expected a serial port such as /dev/ttyUSB0";
    assert_eq!((error.exit_code(), error.to_string().as_str()), (ExitCode::Usage, text));
    let error = scan_at(&gone, &no_daemon()).0.expect_err("not there");
    let text = format!("{}: No such file or directory (os error 2)", gone.display());
    assert_eq!((error.exit_code(), error.to_string()), (ExitCode::Unavailable, text));
}
