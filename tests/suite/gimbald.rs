//! Runs the real binary to its end.

use std::path::Path;
use std::process::Command;

/// What a finished process left behind.
#[derive(Debug, PartialEq, Eq)]
pub struct Outcome {
    pub code: Option<i32>,
    pub output: String,
    pub errors: String,
}

/// `gimbald` with these arguments, in `directory`, and with no other environment than `variables`.
pub fn gimbald(directory: &Path, arguments: &[&str], variables: &[(&str, &str)]) -> Outcome {
    let finished = Command::new(env!("CARGO_BIN_EXE_gimbald"))
        .args(arguments)
        .current_dir(directory)
        .env_clear()
        .envs(variables.iter().copied())
        .output()
        .expect("cargo built the binary");
    Outcome {
        code: finished.status.code(),
        output: String::from_utf8(finished.stdout).expect("gimbald prints UTF-8"),
        errors: String::from_utf8(finished.stderr).expect("gimbald prints UTF-8"),
    }
}
