//! The command line: every command with its arguments and its help.

mod of_family;
pub mod order;
mod sim;

use std::ffi::OsString;
use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::path::PathBuf;

use clap::{Args, CommandFactory, FromArgMatches, Parser, Subcommand};

use crate::config::{DEFAULT_FILE, settings::HttpSettings};
use crate::daemon::logging::LogFilter;
use crate::endpoint::Endpoint;
use crate::exit_code::ExitCode;
pub use sim::{
    GremsyArgs, SimCommand, SimGimbalArgs, SimVehicleArgs, SimulatedAutopilot, SimulatedFamily, SimulatedFrames,
    SimulatedGeneration, SimulatedGimbalOutput, SimulatedReports, SimulatedStatusFrame,
};

/// One more than where QGroundControl listens.
const DEMO_CLIENT: SocketAddr = SocketAddr::new(IpAddr::V4(Ipv4Addr::LOCALHOST), 14551);

const ENDPOINTS: &str = "\
Endpoints:
  serial:PATH:BAUD      a serial port, for example serial:/dev/ttyUSB0:115200
  udpin:ADDR:PORT       wait for datagrams and answer whoever sends them
  udpout:ADDR:PORT      send datagrams to one peer, speaking first
  udpbcast:ADDR:PORT    to a broadcast address until somebody answers
  tcpin:ADDR:PORT       wait for connections
  tcpout:ADDR:PORT      connect, and again when the connection is lost
";

/// MAVLink router and gimbal manager for one vehicle's companion computer.
#[derive(Debug, Parser)]
#[command(
    name = "gimbald",
    version,
    about = "MAVLink router and gimbal manager for a companion computer",
    after_help = "\
Examples:
  gimbald demo                                   try everything without hardware
  gimbald scan                                   find the gimbal on the serial ports
  gimbald check --config ./gimbald.toml          is the configuration right?
  gimbald run --config ./gimbald.toml --log debug
  gimbald status --watch                         what is the running daemon doing?
  gimbald gimbal camera point --pitch-deg -30    ask something of a gimbal

Exit codes: 0 done, 64 wrong arguments, 69 something needed is not there, 77 not allowed, 78 wrong configuration."
)]
pub struct Cli {
    /// What to log: error, warn, info, debug, trace, or by module as in 'info,gimbald::links=debug'
    #[arg(long, global = true, display_order = 101, value_name = "FILTER", default_value = "info")]
    pub log: LogFilter,

    #[command(subcommand)]
    pub command: Command,
}

#[derive(Debug, Subcommand)]
pub enum Command {
    /// Run the service: route MAVLink between the configured links and manage their gimbals
    #[command(after_help = "\
Examples:
  gimbald run
  gimbald run --config ./gimbald.toml --log debug
  GIMBALD__LINK__GROUND__ENDPOINT=udpout:10.0.0.2:14550 gimbald run

Environment variables named GIMBALD__… override single values of the file. SIGTERM and SIGHUP
end the service.")]
    Run(ConfigArgs),

    /// Say whether the configuration is right, and if not, everything that is wrong with it
    #[command(after_help = "\
Examples:
  gimbald check
  gimbald check --config ./gimbald.toml

Prints a line for each problem: file, line, key, what was found, what is expected. Opens no port.
Exit codes: 0 when all is right, 78 when not.")]
    Check(ConfigArgs),

    /// Show the whole system without hardware: simulated vehicle and gimbal, real daemon between them
    #[command(after_help = format!("\
Examples:
  gimbald demo                                   then open http://127.0.0.1:8080 and QGroundControl
  gimbald demo --ground udpbcast:192.168.1.255:14550
  gimbald demo --http 127.0.0.1:8081 --client 127.0.0.1:14561     beside another one
  gimbald demo --duration 10
  gimbald demo --family gremsy --gremsy-generation v1

{ENDPOINTS}"))]
    Demo(DemoArgs),

    /// Run one simulated peer
    #[command(subcommand, arg_required_else_help = true)]
    Sim(SimCommand),

    /// Ask a running daemon how it is, and print it for a person
    #[command(after_help = "\
Examples:
  gimbald status
  gimbald status --watch
  gimbald status --config ./gimbald.toml         of the daemon that runs with it
  gimbald status --url http://192.168.1.10:8080 --json

Exit codes: 0 when the daemon answered, 69 when not, 64 for a URL and 78 for a configuration that cannot be read.")]
    Status(StatusArgs),

    /// Show a gimbal by its name, or ask something of it
    #[command(
        subcommand_value_name = "COMMAND",
        after_help = "\
Examples:
  gimbald gimbal                                 which are there?
  gimbald gimbal camera                          how is it?
  gimbald gimbal camera control take
  gimbald gimbal camera point --pitch-deg -30 --yaw-deg 20
  gimbald gimbal camera turn --yaw-dps 10 --for 3
  gimbald gimbal camera stop
  gimbald gimbal camera roi 47.3977 8.5456 430
  gimbald gimbal camera parameters
  gimbald gimbal camera set-parameter PWR_PAN 60
  gimbald gimbal camera motors off --yes-motors-off
  gimbald gimbal camera reboot --yes-reboot

All but showing needs the token of [http] token_file. It is looked for in --token-file, else in the file that
GIMBALD__HTTP__TOKEN_FILE or the configuration names. Whoever asks takes part in control as 'http'; who asks for nothing
for lease_timeout_s loses it. What can cost the camera or the flight (motors off, reboot, shutdown) needs its --yes-… and
control, taken before.
Exit codes: 0 done, 64 wrong arguments or no such gimbal, 69 the daemon or the gimbal is not there or cannot, 77 no token, a
wrong one, or somebody else is in control, 78 the configuration cannot be read, or the token file holds no token."
    )]
    Gimbal(GimbalArgs),

    /// Find out which serial device, baud rate and gimbal family answer
    #[command(after_help = "\
Examples:
  gimbald scan                                   every serial device
  gimbald scan /dev/ttyUSB0

A port that a running 'gimbald run' or another program holds is left alone; a running gimbald is asked what is there. On
the others every usual baud rate is tried for about 2.5 seconds, so a port where nobody answers takes 20 seconds. A gimbal
may be silent until it hears somebody, so HEARTBEAT is sent (from system 1, component 191, as onboard controller and as
a vehicle of no kind, in turn), whoever was heard is asked for GIMBAL_DEVICE_INFORMATION, gimbals that do not answer for
parameters of certain makes, and a Gremsy for GIMBAL_DEVICE_ATTITUDE_STATUS ten times a second. Nothing is sent that
moves anything.
Exit codes: 0 when something answered, 69 when not, 64 for a DEVICE that is no serial port, 78 for a configuration that
cannot be read.")]
    Scan(ScanArgs),
}

#[derive(Debug, Args)]
pub struct ConfigArgs {
    /// The configuration file
    #[arg(long, value_name = "FILE", default_value = DEFAULT_FILE)]
    pub config: PathBuf,
}

#[derive(Debug, Args)]
pub struct DemoArgs {
    /// Where the ground station listens
    #[arg(long, value_name = "ENDPOINT", default_value = "udpout:127.0.0.1:14550")]
    pub ground: Endpoint,

    /// Where to show the page
    #[arg(long, value_name = "ADDR:PORT", default_value_t = HttpSettings::DEFAULT_LISTEN)]
    pub http: SocketAddr,

    /// Where a second client, such as MAVSDK or MAVProxy, may connect over UDP
    #[arg(long, value_name = "ADDR:PORT", default_value_t = DEMO_CLIENT)]
    pub client: SocketAddr,

    /// What kind of gimbal to simulate
    #[arg(long, value_name = "FAMILY", value_enum, default_value_t = SimulatedFamily::MavlinkV2)]
    pub family: SimulatedFamily,

    /// End after so many seconds; without it, at Ctrl-C
    #[arg(long, value_name = "SECONDS", value_parser = clap::value_parser!(u32).range(1..))]
    pub duration: Option<u32>,

    #[command(flatten)]
    pub gremsy: GremsyArgs,
}

/// Which running daemon is asked.
#[derive(Clone, Debug, Default, Args)]
pub struct DaemonArgs {
    /// Where the daemon's page is; without it, where GIMBALD__HTTP__LISTEN or the configuration has it
    #[arg(long, global = true, display_order = 100, value_name = "URL")]
    pub url: Option<String>,

    /// The daemon's configuration [default: /etc/gimbald/gimbald.toml]
    #[arg(long, global = true, display_order = 100, value_name = "FILE")]
    pub config: Option<PathBuf>,
}

#[derive(Debug, Args)]
pub struct StatusArgs {
    #[command(flatten)]
    pub daemon: DaemonArgs,

    /// Print again whenever something changes, until Ctrl-C
    #[arg(long)]
    pub watch: bool,

    /// Print the daemon's JSON as it is
    #[arg(long)]
    pub json: bool,
}

#[derive(Debug, Args)]
pub struct GimbalArgs {
    /// The gimbal, as it is called in the status; without it and a command, those that there are
    #[arg(value_name = "NAME")]
    pub name: Option<String>,

    #[command(flatten)]
    pub daemon: DaemonArgs,

    /// The file with the token of those who may control gimbals; without it, the one that GIMBALD__HTTP__TOKEN_FILE or the
    /// configuration names
    #[arg(long, global = true, display_order = 100, value_name = "FILE")]
    pub token_file: Option<PathBuf>,

    /// Print the daemon's JSON as it is
    #[arg(long, global = true, display_order = 100)]
    pub json: bool,

    #[command(subcommand)]
    pub order: Option<order::Order>,
}

#[derive(Debug, Args)]
pub struct ScanArgs {
    /// The serial device to try; every one when it is left out
    #[arg(value_name = "DEVICE")]
    pub device: Option<PathBuf>,

    /// Asked first.
    #[command(flatten)]
    pub daemon: DaemonArgs,
}

impl Cli {
    /// Reads the arguments of a process. When there is nothing to run (help was asked for, or the arguments are
    /// wrong), prints what there is to say and gives the code to end with.
    pub fn read(arguments: impl IntoIterator<Item = OsString>) -> Result<Self, ExitCode> {
        let mut command = Self::command();
        let read = command.try_get_matches_from_mut(arguments).and_then(|matches| {
            of_family::check(&mut command, &matches)?;
            Self::from_arg_matches(&matches).map_err(|error| error.format(&mut command))
        });
        read.map_err(|error| {
            let code = if error.use_stderr() { ExitCode::Usage } else { ExitCode::Ok };
            // Nobody is left to tell when the terminal is gone.
            let _ = error.print();
            code
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(line: &str) -> Result<Cli, ExitCode> {
        Cli::read(line.split(' ').map(OsString::from))
    }

    /// Clap finds clashing names, impossible defaults and the like.
    #[test]
    fn the_arguments_are_consistent() {
        Cli::command().debug_assert();
    }

    /// "Exit codes follow sysexits: 0, also for `--help` and `--version`; 64 usage".
    #[test]
    fn help_is_a_success_and_wrong_arguments_are_usage_errors() {
        for (line, code) in [
            ("gimbald --help", ExitCode::Ok),
            ("gimbald --version", ExitCode::Ok),
            ("gimbald help run", ExitCode::Ok),
            ("gimbald sim gimbal --help", ExitCode::Ok),
            ("gimbald", ExitCode::Usage),
            ("gimbald sim", ExitCode::Usage),
            ("gimbald fly", ExitCode::Usage),
            ("gimbald run --confg x", ExitCode::Usage),
            ("gimbald run --log a=b=c", ExitCode::Usage),
            ("gimbald sim gimbal", ExitCode::Usage),
            ("gimbald sim gimbal --endpoint /dev/ttyUSB0", ExitCode::Usage),
            ("gimbald sim vehicle --endpoint udpin:127.0.0.1:1 --system-id 0", ExitCode::Usage),
            ("gimbald sim gimbal --endpoint udpin:127.0.0.1:1 --slew 0", ExitCode::Usage),
            ("gimbald sim gimbal --endpoint udpin:127.0.0.1:1 --slew NaN", ExitCode::Usage),
            ("gimbald sim gimbal --endpoint udpin:127.0.0.1:1 --yaw-range 361", ExitCode::Usage),
            ("gimbald sim gimbal --endpoint udpin:127.0.0.1:1 --family gremsy --gremsy-firmware 7.8", ExitCode::Usage),
            ("gimbald sim gimbal --endpoint udpin:127.0.0.1:1 --family gremsy --gremsy-rc-type radio", ExitCode::Usage),
            ("gimbald sim gimbal --endpoint udpin:127.0.0.1:1 --gremsy-quiet", ExitCode::Usage),
            ("gimbald demo --duration 0", ExitCode::Usage),
            ("gimbald demo --family mavlink_v1 --gremsy-generation v1", ExitCode::Usage),
        ] {
            assert_eq!(read(line).map(|_| ()), Err(code), "{line}");
        }
    }

    #[test]
    fn defaults_are_the_documented_ones() {
        let Ok(Cli { log, command: Command::Run(run) }) = read("gimbald run") else { panic!("run") };
        assert_eq!((log.to_string().as_str(), run.config), ("info", PathBuf::from("/etc/gimbald/gimbald.toml")));

        let Ok(Cli { command: Command::Demo(demo), .. }) = read("gimbald demo") else { panic!("demo") };
        assert_eq!(demo.ground.to_string(), "udpout:127.0.0.1:14550");
        assert_eq!(demo.http.to_string(), "127.0.0.1:8080");
        assert_eq!(demo.client.to_string(), "127.0.0.1:14551");
        assert_eq!(demo.duration, None);

        let Ok(Cli { command: Command::Status(status), .. }) = read("gimbald status") else { panic!("status") };
        assert_eq!((status.daemon.url, status.daemon.config), (None, None));
    }

    #[test]
    fn the_log_filter_may_stand_anywhere() {
        for line in ["gimbald --log debug scan", "gimbald scan --log debug", "gimbald scan /dev/ttyS0 --log=debug"] {
            assert_eq!(read(line).expect(line).log.to_string(), "debug", "{line}");
        }
    }
}
