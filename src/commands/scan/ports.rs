//! Which serial ports there are, and which of them somebody else is using.

use std::ffi::OsString;
use std::fs::{self, File, Metadata, OpenOptions};
use std::io::{self, IsTerminal};
use std::os::unix::fs::{FileTypeExt, MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};

use nix::errno::Errno;
use nix::fcntl::OFlag;
use nix::sys::stat::{major, minor};
use tokio_serial::{ErrorKind, SerialStream};

use crate::links::serial_port;

/// A serial port under the name that is shown.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Port {
    pub name: PathBuf,
    /// The device itself, with every link followed.
    pub device: PathBuf,
}

/// A running gimbald is asked at its page, which may be elsewhere.
const ASK_IT: &str = "; if it is the service, name its page with --url or its configuration with --config, and it is asked what is there";

/// Why a port is not tried.
#[derive(Debug, thiserror::Error)]
pub enum PortError {
    #[error("in use by {name} (process {process}){}", if name == "gimbald" { ASK_IT } else { "" })]
    HeldBy { process: u32, name: String },
    #[error("in use by another process")]
    InUse,
    #[error("not a serial port, or one without hardware")]
    NotASerialPort,
    /// A terminal behind which there is no line; what it is.
    #[error("{0}, where no gimbal can be")]
    NoLine(&'static str),
    #[error("cannot be opened: {0}")]
    Open(String),
}

impl Port {
    /// The port at `path`; the error is that of a path that leads nowhere.
    pub fn at(path: &Path) -> io::Result<Self> {
        Ok(Self { name: std::path::absolute(path)?, device: fs::canonicalize(path)? })
    }

    /// Opens the port for us alone, at `baud`, unless somebody has it.
    pub fn open(&self, baud: u32) -> Result<SerialStream, PortError> {
        let file = fs::metadata(&self.device).map_err(|error| refused(&error))?;
        // Nothing else is opened: that alone can have effects, as with a pipe or a watchdog.
        if !file.file_type().is_char_device() || subsystem(&file).is_some_and(|subsystem| subsystem != "tty") {
            return Err(PortError::NotASerialPort);
        }
        // To open the multiplexer makes a new pseudo-terminal, which stays as silent as nobody at a real port.
        if let Some(what) = serial_port::terminal_without_line(&file) {
            return Err(PortError::NoLine(what));
        }
        if let Some(holder) = holder(Path::new("/proc"), &self.device) {
            return Err(holder);
        }
        // Stays open until the port is: a last close would drop the line's DTR in between.
        let first = without_waiting(&self.device).map_err(|error| refused(&error))?;
        if !first.is_terminal() {
            return Err(PortError::NotASerialPort);
        }
        let path = self.device.to_str().ok_or_else(|| PortError::Open("its name is no UTF-8".to_owned()))?;
        serial_port::open(path, baud).map_err(|error| match error.kind {
            // So the library calls a lock, or a port that was opened for its holder alone.
            ErrorKind::NoDevice => PortError::InUse,
            ErrorKind::InvalidInput | ErrorKind::Unknown | ErrorKind::Io(_) => PortError::Open(error.description),
        })
    }
}

/// The part of the kernel that a device belongs to; `None` for pseudo-terminals, and where the kernel does not tell.
fn subsystem(file: &Metadata) -> Option<OsString> {
    let (major, minor) = (major(file.rdev()), minor(file.rdev()));
    let link = fs::read_link(format!("/sys/dev/char/{major}:{minor}/subsystem")).ok()?; // the kernel does not tell
    link.file_name().map(ToOwned::to_owned)
}

fn without_waiting(device: &Path) -> io::Result<File> {
    let flags = OFlag::O_NOCTTY | OFlag::O_NONBLOCK;
    OpenOptions::new().read(true).write(true).custom_flags(flags.bits()).open(device)
}

fn refused(error: &io::Error) -> PortError {
    match error.raw_os_error().map(Errno::from_raw) {
        Some(Errno::EBUSY) => PortError::InUse,
        Some(Errno::EACCES) => PortError::Open(
            "permission denied; run it with sudo, or as a member of the port's group (ls -l)".to_owned(),
        ),
        // A port without hardware, as boards announce many of.
        Some(Errno::ENXIO | Errno::ENODEV | Errno::EIO) => PortError::NotASerialPort,
        Some(errno) => PortError::Open(errno.desc().to_owned()),
        None => PortError::Open(error.to_string()),
    }
}

/// Every serial port below `dev` once, by its best name: one that stays the same when the port is plugged elsewhere.
pub fn all(dev: &Path) -> Vec<Port> {
    let mut names = entries(&dev.join("serial/by-id"), |_| true);
    names.push(dev.join("serial0"));
    for kind in ["ttyUSB", "ttyACM", "ttyAMA", "ttyS"] {
        names.extend(entries(dev, |name| {
            name.strip_prefix(kind).is_some_and(|number| number.starts_with(|digit: char| digit.is_ascii_digit()))
        }));
    }
    let mut ports: Vec<Port> = Vec::new();
    for name in names {
        // A link that leads nowhere is no port.
        let Ok(port) = Port::at(&name) else { continue };
        if !ports.iter().any(|known| known.device == port.device) {
            ports.push(port);
        }
    }
    ports
}

/// The files in a folder whose names are `wanted`, `ttyS2` before `ttyS10`; none when there is no such folder.
fn entries(folder: &Path, wanted: impl Fn(&str) -> bool) -> Vec<PathBuf> {
    let Ok(entries) = fs::read_dir(folder) else { return Vec::new() };
    let mut names: Vec<String> = entries
        .flatten()
        .filter_map(|entry| entry.file_name().into_string().ok()) // udev writes plain letters
        .filter(|name| wanted(name))
        .collect();
    names.sort_by_key(|name| (name.len(), name.clone()));
    names.into_iter().map(|name| folder.join(name)).collect()
}

/// Another process that has `device` open, as far as we may look into processes.
fn holder(proc: &Path, device: &Path) -> Option<PortError> {
    let processes = fs::read_dir(proc).ok()?; // without /proc there is nothing to see
    for entry in processes.flatten() {
        let Some(process) = entry.file_name().to_str().and_then(|name| name.parse::<u32>().ok()) else { continue };
        // Processes of others, and those that have ended since, cannot be looked into.
        let Ok(descriptors) = fs::read_dir(entry.path().join("fd")) else { continue };
        let holds = |descriptor: fs::DirEntry| fs::read_link(descriptor.path()).is_ok_and(|file| file == device);
        if process != std::process::id() && descriptors.flatten().any(holds) {
            let name = fs::read_to_string(entry.path().join("comm")).unwrap_or_default();
            let name = if name.trim().is_empty() { "another program" } else { name.trim() };
            return Some(PortError::HeldBy { process, name: name.to_owned() });
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::symlink;

    use nix::pty::{OpenptyResult, openpty};
    use nix::unistd::ttyname;

    use super::*;

    fn pseudo_terminal() -> (OpenptyResult, Port) {
        let pty = openpty(None, None).expect("a pseudo-terminal");
        let port = Port::at(&ttyname(&pty.slave).expect("it has a name")).expect("it is there");
        (pty, port)
    }

    /// "No duplicates through links."
    #[test]
    fn each_port_is_listed_once_by_its_best_name() {
        let (dev, targets) = (tempfile::tempdir().expect("a folder"), tempfile::tempdir().expect("a folder"));
        let (dev, targets) = (dev.path(), targets.path());
        fs::create_dir_all(dev.join("serial/by-id")).expect("a folder");
        for (name, target) in [
            ("ttyS10", "f"),
            ("ttyS2", "e"),
            ("ttyAMA0", "d"),
            ("serial0", "d"),
            ("ttyACM0", "c"),
            ("ttyUSB1", "b"),
            ("ttyUSB0", "a"),
            ("serial/by-id/usb-b", "b"),
            ("tty", "g"),
            ("ttyS", "h"),
            ("ttyprintk", "i"),
            ("serial1", "j"),
        ] {
            fs::write(targets.join(target), "").expect("a file");
            symlink(targets.join(target), dev.join(name)).expect("a link");
        }
        symlink(targets.join("gone"), dev.join("ttyUSB7")).expect("a link");

        let names: Vec<PathBuf> = all(dev).into_iter().map(|port| port.name).collect();

        let expected = ["serial/by-id/usb-b", "serial0", "ttyUSB0", "ttyACM0", "ttyS2", "ttyS10"];
        assert_eq!(names, expected.map(|name| dev.join(name)));
        assert_eq!(all(&dev.join("nowhere")), []);
    }

    #[test]
    fn what_is_no_terminal_is_not_opened() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("file");
        fs::write(&file, "").expect("a file");
        for path in [file.as_path(), folder.path(), Path::new("/dev/null")] {
            let refused = Port::at(path).expect("it is there").open(115_200);
            assert!(matches!(refused, Err(PortError::NotASerialPort)), "{}", path.display());
        }
    }

    /// "Refuse it clearly": the multiplexer is a terminal, and whoever opens it finds a pseudo-terminal where nobody is.
    #[test]
    fn a_terminal_without_a_line_is_not_opened() {
        for path in ["/dev/ptmx", "/dev/pts/ptmx"] {
            let refused = Port::at(Path::new(path)).expect("it is there").open(115_200).map(drop);
            let text = refused.expect_err("it is no port").to_string();
            assert_eq!(text, "what makes pseudo-terminals, where no gimbal can be", "{path}");
        }
    }

    /// A port is held by a lock, or by a program that takes none and shows in /proc. One test for both: a process that
    /// is started while the lock is held would inherit it.
    #[test]
    fn a_port_that_somebody_holds_is_in_use() {
        let (_pty, port) = pseudo_terminal();
        let held = port.open(115_200).expect("it is free");
        assert!(matches!(port.open(115_200), Err(PortError::InUse)));
        drop(held);
        port.open(115_200).expect("it is free again");

        let terminal = File::options().read(true).write(true).open(&port.device).expect("it opens");
        let mut other = std::process::Command::new("sleep").arg("60").stdin(terminal).spawn().expect("a process");

        let refused = port.open(115_200);
        other.kill().expect("it runs");
        other.wait().expect("it ends");

        let text = refused.map(|_| ()).expect_err("it is held").to_string();
        assert_eq!(text, format!("in use by sleep (process {})", other.id()));
        port.open(115_200).expect("it is free again");
    }

    /// A daemon whose page is elsewhere was not asked.
    #[test]
    fn a_running_gimbald_can_be_asked() {
        let told = |name: &str| PortError::HeldBy { process: 7, name: name.to_owned() }.to_string();
        assert_eq!(told("minicom"), "in use by minicom (process 7)");
        assert_eq!(
            told("gimbald"),
            "in use by gimbald (process 7); if it is the service, name its page with --url or its configuration with --config, and it is asked what is there"
        );
    }
}
