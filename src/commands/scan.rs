//! `gimbald scan`: which serial port, baud rate and gimbal family answer.

mod conversation;
mod finding;
mod held;
mod party;
mod ports;
mod trying;

use std::fmt;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use self::finding::Names;
use self::ports::{Port, PortError};
use self::trying::TryError;
use super::client::{ClientError, Target};
use super::daemon_address;
use crate::cli::ScanArgs;
use crate::exit_code::ExitCode;

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
        let held = held::by_daemon(daemon, errors).await;
        let mut names = Names::default();
        let mut told = false;
        for port in ports {
            let shown = port.name.display();
            if let Some(held) = held.iter().find(|held| held.device == port.device) {
                say(errors, format_args!("{shown}: left alone, it belongs to the running gimbald, which says:"));
                say(output, format_args!("{held}"));
                if let Some(advice) = held.advice() {
                    say(errors, format_args!("{shown}: {advice}"));
                }
                told |= !held.gimbals.is_empty();
                continue;
            }
            match trying::try_port(&port, errors).await {
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
        if names.is_empty() && !told { Err(ScanError::NothingAnswered) } else { Ok(()) }
    })
}

fn say(to: &mut impl Write, line: fmt::Arguments<'_>) {
    // The exit code says it too; nobody is left to tell when the reader is gone.
    let _ = writeln!(to, "{line}").and_then(|()| to.flush());
}

#[cfg(test)]
mod tests;
