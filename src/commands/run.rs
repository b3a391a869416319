//! `gimbald run`: the service.

use std::error::Error;
use std::io::Write;

use crate::cli::ConfigArgs;
use crate::config;
use crate::daemon::supervisor;
use crate::exit_code::ExitCode;

use super::check;

/// Runs the daemon until SIGTERM, SIGINT or SIGHUP; what is wrong with the configuration goes to `errors`.
pub fn run(arguments: &ConfigArgs, errors: &mut impl Write) -> ExitCode {
    let settings = match config::load(&arguments.config, config::process_environment()) {
        Ok(settings) => settings,
        Err(problems) => return check::report(&problems, errors),
    };
    match supervisor::run(settings) {
        Ok(()) => ExitCode::Ok,
        Err(error) => {
            let cause = error.source().map(|cause| format!(": {cause}")).unwrap_or_default();
            // The exit code says it too; nobody is left to tell when the reader is gone.
            let _ = writeln!(errors, "gimbald: {error}{cause}");
            ExitCode::Unavailable
        }
    }
}
