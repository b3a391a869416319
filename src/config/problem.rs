//! What is wrong with a configuration, in words for the operator.

use std::fmt;
use std::path::{Path, PathBuf};

/// Everything that is wrong with one configuration; never empty. Prints one line for each problem.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub struct Problems {
    file: PathBuf,
    list: Vec<Problem>,
}

/// One thing that is wrong.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Problem {
    pub place: Place,
    /// The setting, such as `link.ground.endpoint`; empty when it concerns none.
    pub key: String,
    /// Finishes "here is …".
    pub found: String,
    /// Finishes "expected …".
    pub expected: String,
}

/// Where a value comes from. Orders as it is reported: the file, its lines, the variables.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Place {
    /// The file as a whole.
    File,
    /// A line of it, counted from one.
    Line(usize),
    /// An environment variable, by its name.
    Variable(String),
}

/// So many characters of a value, key or name are shown.
const SHOWN_LEN: usize = 60;

/// What the operator wrote, as it is shown: as it is, or its beginning and `…`.
pub(super) fn shortened(text: String) -> String {
    match text.char_indices().nth(SHOWN_LEN) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text,
    }
}

impl Problems {
    pub(super) fn new(file: PathBuf, mut list: Vec<Problem>) -> Self {
        list.sort_by(|a, b| a.place.cmp(&b.place));
        Self { file, list }
    }

    pub fn file(&self) -> &Path {
        &self.file
    }

    /// In the order of the file, then by variable.
    pub fn list(&self) -> &[Problem] {
        &self.list
    }
}

impl fmt::Display for Problems {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (position, problem) in self.list.iter().enumerate() {
            if position > 0 {
                writeln!(f)?;
            }
            match &problem.place {
                Place::File => write!(f, "{}: ", self.file.display())?,
                Place::Line(line) => write!(f, "{}:{line}: ", self.file.display())?,
                Place::Variable(name) => write!(f, "{name}: ")?,
            }
            if !problem.key.is_empty() {
                write!(f, "{}: ", problem.key)?;
            }
            write!(f, "{}; expected {}", problem.found, problem.expected)?;
        }
        Ok(())
    }
}
