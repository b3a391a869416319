//! `gimbald demo`: the whole system without hardware.
//!
//! Vehicle and gimbal are peers of their own on real links, a UDP socket and a pseudo-terminal; between them runs the
//! daemon as it always does.

use std::env;
use std::fs;
use std::io::{self, Write};
use std::net::{Ipv4Addr, SocketAddr, TcpListener, UdpSocket};
use std::path::{Path, PathBuf};
use std::thread;
use std::time::Duration;

use nix::sys::signal::{Signal, raise};
use tokio::sync::oneshot;

use crate::bridge::settings::{Role, Settings};
use crate::cli::{DemoArgs, SimulatedFamily};
use crate::commands::daemon_address::from_here;
use crate::commands::sim::{NoSuchGremsy, gremsy_settings};
use crate::config::settings::{DaemonSettings, Directories, HttpSettings, link_on};
use crate::daemon::clock::unix_time_us;
use crate::daemon::supervisor;
use crate::endpoint::Endpoint;
use crate::exit_code::ExitCode;
use crate::gimbals::mavlink_v2::sim::{Device, DeviceSettings};
use crate::gimbals::settings::{Family, GimbalSettings};
use crate::gimbals::{gremsy, mavlink_v1};
use crate::links::{self, Link};
use crate::sim::host::{self, HostError};
use crate::sim::peer::Peer;
use crate::sim::pty::Pty;
use crate::sim::vehicle::{Vehicle, VehicleSettings};
use crate::timestamp::Timestamp;
use crate::token::Token;

const GIMBAL_BAUD: u32 = 115_200;

/// Why there is no demo.
#[derive(Debug, thiserror::Error)]
enum DemoError {
    #[error("the page cannot be shown at {address} (does gimbald run there?); name another place with --http")]
    Page {
        address: SocketAddr,
        #[source]
        cause: io::Error,
    },
    #[error(
        "a second client cannot connect at UDP {address} (does another demo run?); name another place with --client"
    )]
    Client {
        address: SocketAddr,
        #[source]
        cause: io::Error,
    },
    #[error(transparent)]
    Gimbal(#[from] NoSuchGremsy),
    #[error("no pseudo-terminal for the gimbal")]
    Pty(#[source] io::Error),
    #[error("no UDP port for the vehicle")]
    Port(#[source] io::Error),
    #[error("no token for control over HTTP can be kept among the temporary files")]
    Token(#[source] io::Error),
    #[error("no thread for a simulated peer")]
    Thread(#[source] io::Error),
    #[error(transparent)]
    Daemon(#[from] supervisor::RunError),
}

/// Runs until SIGTERM, SIGINT or SIGHUP, or until the duration that was asked for is over.
pub fn demo(arguments: &DemoArgs, output: &mut impl Write, errors: &mut impl Write) -> ExitCode {
    match run(arguments, output) {
        Ok(()) => ExitCode::Ok,
        Err(DemoError::Gimbal(error)) => {
            // As below.
            let _ = writeln!(errors, "gimbald demo: {error}");
            ExitCode::Usage
        }
        Err(error) => {
            let cause = std::error::Error::source(&error).map(|cause| format!(": {cause}")).unwrap_or_default();
            // The exit code says it too; nobody is left to tell when the reader is gone.
            let _ = writeln!(errors, "gimbald demo: {error}{cause}");
            ExitCode::Unavailable
        }
    }
}

fn run(arguments: &DemoArgs, output: &mut impl Write) -> Result<(), DemoError> {
    // Without them the instructions would lead to somebody else's daemon.
    TcpListener::bind(arguments.http).map_err(|cause| DemoError::Page { address: arguments.http, cause })?;
    UdpSocket::bind(arguments.client).map_err(|cause| DemoError::Client { address: arguments.client, cause })?;
    let cable = Pty::open().map_err(DemoError::Pty)?;
    let path = cable.path().map_err(DemoError::Pty)?.to_string_lossy().into_owned();
    let autopilot = free_port().map_err(DemoError::Port)?;
    let token_file = TokenFile::new().map_err(DemoError::Token)?;
    let gimbal = Endpoint::Serial { path, baud: GIMBAL_BAUD };
    let settings = daemon_settings(arguments, gimbal, autopilot, token_file.token.clone());

    let vehicle = VehicleSettings { unix_time_us: unix_time_us(), ..VehicleSettings::default() };
    let vehicle = Simulation::start("vehicle", Vehicle::new(Timestamp::ZERO, vehicle), move || {
        Ok(links::link(&Endpoint::UdpOut(autopilot)))
    })?;
    let gimbal = match arguments.family {
        SimulatedFamily::MavlinkV2 => {
            let device = Device::new(Timestamp::ZERO, DeviceSettings::default());
            Simulation::start("gimbal", device, move || Ok(Box::new(cable.into_link()?)))?
        }
        SimulatedFamily::MavlinkV1 => {
            let device = mavlink_v1::sim::Device::new(Timestamp::ZERO, mavlink_v1::sim::DeviceSettings::default());
            Simulation::start("gimbal", device, move || Ok(Box::new(cable.into_link()?)))?
        }
        SimulatedFamily::Gremsy => {
            let device = gremsy::sim::Device::new(Timestamp::ZERO, gremsy_settings(&arguments.gremsy)?);
            Simulation::start("gimbal", device, move || Ok(Box::new(cable.into_link()?)))?
        }
    };
    if let Some(seconds) = arguments.duration {
        end_after(Duration::from_secs(u64::from(seconds))).map_err(DemoError::Thread)?;
    }
    // The demo goes on when nobody reads what it says.
    let _ = write!(output, "{}", instructions(arguments, &settings, &token_file.path)).and_then(|()| output.flush());

    let result = supervisor::run(settings);
    vehicle.end();
    gimbal.end();
    Ok(result?)
}

fn daemon_settings(arguments: &DemoArgs, gimbal: Endpoint, autopilot: SocketAddr, token: Token) -> DaemonSettings {
    let all = [
        ("gimbal", Role::Gimbal, gimbal),
        ("autopilot", Role::Autopilot, Endpoint::UdpIn(autopilot)),
        ("ground", Role::Ground, arguments.ground.clone()),
        ("client", Role::Ground, Endpoint::UdpIn(arguments.client)),
    ];
    let links = all.iter().map(|(name, role, endpoint)| link_on((*name).to_owned(), *role, endpoint)).collect();
    let gimbals = match arguments.family {
        // What it speaks is found out.
        SimulatedFamily::MavlinkV2 | SimulatedFamily::Gremsy => Vec::new(),
        SimulatedFamily::MavlinkV1 => {
            vec![GimbalSettings { family: Family::MavlinkV1, ..GimbalSettings::found("camera".to_owned()) }]
        }
    };
    DaemonSettings {
        core: Settings { links, gimbals, ..Settings::default() },
        endpoints: all.into_iter().map(|(_, _, endpoint)| endpoint).collect(),
        http: Some(HttpSettings { listen: arguments.http, token: Some(token) }),
        // A simulated vehicle's id is not worth keeping.
        directories: Directories::default(),
    }
}

fn instructions(arguments: &DemoArgs, settings: &DaemonSettings, token_file: &Path) -> String {
    let name = settings.core.gimbals.first().map_or("gimbal-154", |gimbal| gimbal.name.as_str());
    let (page, client) = (from_here(arguments.http), from_here(arguments.client));
    // A configuration that is installed here may have its page elsewhere.
    let url = format!(" --url http://{page}");
    let listed: Vec<_> =
        settings.core.links.iter().map(|link| format!("    {:<10} {}", link.name, link.endpoint)).collect();
    format!(
        "\
gimbald demo: a simulated vehicle and gimbal, and the daemon between them

  Page             http://{page}
  QGroundControl   start it; the vehicle appears by itself ({})
  MAVSDK           connection udpout://{client}
  MAVProxy         mavproxy.py --master=udpout:{client}, then: module load camera; camera set manager_component 191
  Command line     gimbald gimbal {name} point --pitch-deg -30 --token-file {}{url}

  Links
{}

Ctrl-C ends it.
",
        arguments.ground,
        token_file.display(),
        listed.join("\n"),
    )
}

/// The token of this demo, in a file that ends with it.
struct TokenFile {
    token: Token,
    path: PathBuf,
}

impl TokenFile {
    fn new() -> io::Result<Self> {
        let token = Token::random()?;
        // Part of another, so that the name cannot be taken before.
        let name: String = Token::random()?.reveal().chars().take(8).collect();
        let path = env::temp_dir().join(format!("gimbald-demo-{name}"));
        token.write(&path)?;
        Ok(Self { token, path })
    }
}

impl Drop for TokenFile {
    fn drop(&mut self) {
        // It is worth nothing any more.
        let _ = fs::remove_file(&self.path);
    }
}

/// A UDP port on the loopback that nobody has at the moment.
fn free_port() -> io::Result<SocketAddr> {
    UdpSocket::bind((Ipv4Addr::LOCALHOST, 0))?.local_addr()
}

/// Ends the process, with a goodbye, when the time is over.
fn end_after(duration: Duration) -> io::Result<()> {
    thread::Builder::new().name("duration".to_owned()).spawn(move || {
        thread::sleep(duration);
        if let Err(error) = raise(Signal::SIGTERM) {
            tracing::error!(%error, "the time is over, but the demo could not be ended");
        }
    })?;
    Ok(())
}

/// A simulated peer on a thread of its own.
struct Simulation {
    name: &'static str,
    stop: oneshot::Sender<()>,
    thread: thread::JoinHandle<Result<(), HostError>>,
}

impl Simulation {
    fn start<P: Peer + Send + 'static>(
        name: &'static str,
        peer: P,
        open: impl FnOnce() -> io::Result<Box<dyn Link>> + Send + 'static,
    ) -> Result<Self, DemoError> {
        let (stop, stopped) = oneshot::channel();
        let stopped = async {
            // Whether it was told or the sender is gone, it is over.
            let _ = stopped.await;
            Ok(())
        };
        let thread = thread::Builder::new()
            .name(name.to_owned())
            .spawn(move || host::run(peer, open, stopped))
            .map_err(DemoError::Thread)?;
        Ok(Self { name, stop, thread })
    }

    fn end(self) {
        // It may have ended by itself.
        let _ = self.stop.send(());
        match self.thread.join() {
            Ok(Ok(())) => {}
            Ok(Err(error)) => tracing::error!(peer = self.name, %error, "a simulated peer failed"),
            Err(_) => tracing::error!(peer = self.name, "a simulated peer panicked"),
        }
    }
}
