//! The operator's settings: one TOML file, overridden by `GIMBALD__` environment variables.
//!
//! The file (`file.rs`) is read into values that know where they stand (`document.rs`), variables are laid over it
//! (`environment.rs`), each value is checked for itself (`schema.rs`), then all of them together (`checks.rs`). Whatever
//! is wrong is collected on the way, so that everything is reported at once.

mod checks;
mod document;
mod environment;
mod file;
mod numbering;
pub mod problem;
mod reader;
pub mod schema;
pub mod settings;
mod signs;
mod suggestion;

use std::path::{Path, PathBuf};

use problem::Problems;
use settings::{DaemonSettings, WindowSettings};

/// Where the configuration is looked for when the command line names no other file.
pub const DEFAULT_FILE: &str = "/etc/gimbald/gimbald.toml";

/// Reads the file at `path`, lays the `GIMBALD__` variables of `environment` over it, and checks the whole.
///
/// `STATE_DIRECTORY` and `RUNTIME_DIRECTORY`, as systemd sets them, name the directories for what is kept until the next
/// start. Other variables are ignored.
pub fn load(path: &Path, environment: impl Iterator<Item = (String, String)>) -> Result<DaemonSettings, Problems> {
    let in_file = |list| Problems::new(path.to_owned(), list);
    let text = file::read(path).map_err(|problem| in_file(vec![problem]))?;
    let mut root = document::parse(&text).map_err(|problem| in_file(vec![problem]))?;

    let mut problems = Vec::new();
    let mut directories = settings::Directories::default();
    let mut overrides = Vec::new();
    for (name, value) in environment {
        if name == "STATE_DIRECTORY" {
            directories.state = first_directory(&value);
        } else if name == "RUNTIME_DIRECTORY" {
            directories.runtime = first_directory(&value);
        } else if name.starts_with(environment::PREFIX) {
            overrides.push((name, value));
        }
    }
    overrides.sort();
    environment::apply(&mut root, overrides, &mut problems);

    let configuration = schema::read(root, &mut problems);
    let token = checks::check(&configuration, &mut problems);
    if problems.is_empty() { Ok(settings::build(configuration, token, directories)) } else { Err(in_file(problems)) }
}

/// Where the window of the daemon with this configuration is, for those who ask it something.
///
/// Only `[http]` must be right. Without `path` it is the usual file, which need not be there, nor be ours to read.
pub fn load_window(
    path: Option<&Path>,
    environment: impl Iterator<Item = (String, String)>,
) -> Result<WindowSettings, Problems> {
    let file = path.unwrap_or(Path::new(DEFAULT_FILE));
    let in_file = |list| Problems::new(file.to_owned(), list);
    let mut root = match (file::read(file).and_then(|text| document::parse(&text)), path) {
        (Ok(root), _) => root,
        (Err(problem), Some(_)) => return Err(in_file(vec![problem])),
        // `gimbald check` says what is wrong with it.
        (Err(_), None) => document::Table::new(),
    };
    let overrides = environment.filter(|(name, _)| name.starts_with(environment::PREFIX)).collect();
    let mut problems = Vec::new();
    environment::apply(&mut root, overrides, &mut problems);
    let http = schema::read(root, &mut problems).http;
    problems.retain(|problem| problem.key == "http" || problem.key.starts_with("http."));
    if problems.is_empty() { Ok(settings::window(http)) } else { Err(in_file(problems)) }
}

/// The variables of this process; bytes that are no UTF-8 become U+FFFD, which no setting accepts.
pub fn process_environment() -> impl Iterator<Item = (String, String)> {
    std::env::vars_os().map(|(name, value)| (name.to_string_lossy().into_owned(), value.to_string_lossy().into_owned()))
}

/// Such a variable holds the paths of all directories of its kind with colons between them; ours is the first.
fn first_directory(value: &str) -> Option<PathBuf> {
    value.split(':').next().filter(|path| !path.is_empty()).map(PathBuf::from)
}
