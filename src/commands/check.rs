//! `gimbald check`: is the configuration right?

use std::io::Write;

use crate::cli::ConfigArgs;
use crate::config::settings::DaemonSettings;
use crate::config::{self, problem::Problems};
use crate::exit_code::ExitCode;

/// Prints one line when everything is right, and one for each problem to `errors` when not. Opens nothing.
pub fn check(arguments: &ConfigArgs, output: &mut impl Write, errors: &mut impl Write) -> ExitCode {
    match config::load(&arguments.config, config::process_environment()) {
        Ok(settings) => {
            // The exit code says it too; nobody is left to tell when the reader is gone.
            let _ = writeln!(output, "{}: {}", arguments.config.display(), summary(&settings));
            ExitCode::Ok
        }
        Err(problems) => report(&problems, errors),
    }
}

/// Prints what is wrong with the configuration, a line for each problem.
pub fn report(problems: &Problems, errors: &mut impl Write) -> ExitCode {
    // As above.
    let _ = writeln!(errors, "{problems}");
    ExitCode::Config
}

fn summary(settings: &DaemonSettings) -> String {
    let links = settings.core.links.iter().map(|link| format!("{} ({})", link.name, link.endpoint));
    let gimbals = settings.core.gimbals.iter().map(|gimbal| gimbal.name.clone());
    let page = settings.http.as_ref().map(|http| format!("http://{}", http.listen));
    let gimbals = listed(gimbals.collect(), "those that are found");
    format!(
        "ok; links: {}; gimbals: {gimbals}; page: {}",
        listed(links.collect(), "none"),
        page.as_deref().unwrap_or("none")
    )
}

fn listed(items: Vec<String>, when_empty: &str) -> String {
    if items.is_empty() { when_empty.to_owned() } else { items.join(", ") }
}
