//! Where the running daemon is asked: as the command line says, or its environment, or its configuration.

use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr};

use super::client::{ClientError, Target};
use crate::cli::DaemonArgs;
use crate::config;
use crate::config::settings::WindowSettings;

/// Whom to ask; the configuration need not be there when `--url` says it.
pub fn target(arguments: &DaemonArgs) -> Result<Target, ClientError> {
    match &arguments.url {
        Some(url) => Target::parse(url),
        None => Target::parse(&format!("http://{}", from_here(settings(arguments)?.listen))),
    }
}

/// What the configuration says of the daemon's window.
pub fn settings(arguments: &DaemonArgs) -> Result<WindowSettings, ClientError> {
    config::load_window(arguments.config.as_deref(), config::process_environment()).map_err(ClientError::Config)
}

/// How a program of this computer reaches who listens at `listen`: a port of every address is one of its own.
pub fn from_here(mut listen: SocketAddr) -> SocketAddr {
    match listen.ip() {
        IpAddr::V4(ip) if ip.is_unspecified() => listen.set_ip(Ipv4Addr::LOCALHOST.into()),
        IpAddr::V6(ip) if ip.is_unspecified() => listen.set_ip(Ipv6Addr::LOCALHOST.into()),
        IpAddr::V4(_) | IpAddr::V6(_) => {}
    }
    listen
}

#[cfg(test)]
mod tests {
    use std::fs;

    use clap::Parser;

    use super::*;
    use crate::cli::{Cli, Command};
    use crate::exit_code::ExitCode;

    /// Every command that asks a daemon finds it in the same way, and its options may stand behind all others.
    fn daemon_args(line: &str) -> DaemonArgs {
        match Cli::try_parse_from(line.split(' ')).unwrap_or_else(|error| panic!("{line}: {error}")).command {
            Command::Status(arguments) => arguments.daemon,
            Command::Scan(arguments) => arguments.daemon,
            Command::Gimbal(arguments) => arguments.daemon,
            other => panic!("{other:?} asks no daemon"),
        }
    }

    /// The page is looked for where the configuration that is named has it, on this computer, whatever else is wrong with
    /// that configuration.
    #[test]
    fn the_configuration_says_where_the_page_is() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("gimbald.toml");
        let config = file.to_str().expect("UTF-8");
        for command in ["status", "scan", "gimbal", "gimbal camera", "gimbal camera stop"] {
            for (text, options, expected) in [
                ("[http]\nlisten = \"127.0.0.1:9090\"\n", "", "http://127.0.0.1:9090"),
                ("[http]\nlisten = \"0.0.0.0:9090\"\n[vehicle]\nx = 1\n", "", "http://127.0.0.1:9090"),
                ("[http]\nlisten = \"[::]:9090\"\n", "", "http://[::1]:9090"),
                ("[http]\n", "", "http://127.0.0.1:8080"),
                ("", "", "http://127.0.0.1:8080"),
                ("[http]\nlisten = \"127.0.0.1:9090\"\n", " --url http://drone:80", "http://drone:80"),
            ] {
                fs::write(&file, text).expect("a writable folder");
                let arguments = daemon_args(&format!("gimbald {command} --config {config}{options}"));
                assert_eq!(target(&arguments).expect("right").url, expected, "{command}: {text} {options}");
            }
        }
    }

    /// "78 configuration, a missing file included": who names one does not get the answer of another daemon.
    #[test]
    fn a_configuration_that_cannot_be_used_is_not_passed_over() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("gimbald.toml");
        let shown = file.display();
        for (text, expected) in [
            (None, format!("{shown}: no such file; expected ")),
            (Some("[http\n"), format!("{shown}:1: ")),
            (Some("[http]\nlisten = 8080\n"), format!("{shown}:2: http.listen: found 8080; expected ")),
        ] {
            match text {
                Some(text) => fs::write(&file, text).expect("a writable folder"),
                None => assert!(!file.exists()),
            }
            let error = target(&daemon_args(&format!("gimbald status --config {shown}"))).expect_err("it is wrong");
            assert!(error.to_string().starts_with(&expected), "{error}");
            assert_eq!(error.exit_code(), ExitCode::Config, "{error}");
            let with_url = daemon_args(&format!("gimbald status --config {shown} --url http://drone"));
            assert_eq!(target(&with_url).expect("it is not needed").host, "drone");
        }
    }
}
