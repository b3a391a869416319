//! The text of the configuration file.

use std::fs::{self, File, FileType};
use std::io::{self, Read};
use std::os::unix::fs::FileTypeExt;
use std::path::Path;

use super::problem::{Place, Problem};

/// The largest file that is read, in bytes. One with every key for 32 links has a few thousand.
const MAX_LEN: u64 = 1 << 20;

/// The file at `path`. What is no regular file is not even opened: a FIFO would wait for a writer, and opening a device
/// may set it going.
pub(super) fn read(path: &Path) -> Result<String, Problem> {
    let metadata = fs::metadata(path).map_err(|error| unreadable(&error))?;
    if !metadata.is_file() {
        return Err(refused(kind(metadata.file_type())));
    }
    if metadata.len() > MAX_LEN {
        return Err(too_large());
    }
    let mut text = Vec::new();
    // One byte more shows that the file has grown since, or is one of those that do not tell their length.
    let file = File::open(path).map_err(|error| unreadable(&error))?;
    file.take(MAX_LEN + 1).read_to_end(&mut text).map_err(|error| unreadable(&error))?;
    if text.len() as u64 > MAX_LEN {
        return Err(too_large());
    }
    String::from_utf8(text).map_err(|error| not_utf8(&error))
}

fn kind(file_type: FileType) -> &'static str {
    if file_type.is_dir() {
        "a directory"
    } else if file_type.is_fifo() {
        "a FIFO"
    } else if file_type.is_socket() {
        "a socket"
    } else {
        "a device"
    }
}

fn refused(found: &str) -> Problem {
    problem(Place::File, found.to_owned(), "a regular file, in TOML, of at most 1 MiB")
}

fn too_large() -> Problem {
    refused("larger than 1 MiB")
}

fn unreadable(error: &io::Error) -> Problem {
    match error.kind() {
        io::ErrorKind::NotFound => problem(
            Place::File,
            "no such file".to_owned(),
            "a readable TOML file: name it with --config, or install config/gimbald.toml there",
        ),
        io::ErrorKind::PermissionDenied => {
            problem(Place::File, "may not be read".to_owned(), "a readable TOML file: run this with sudo")
        }
        _ => problem(Place::File, format!("cannot be read: {error}"), "a readable TOML file"),
    }
}

fn not_utf8(error: &std::string::FromUtf8Error) -> Problem {
    let before = &error.as_bytes()[..error.utf8_error().valid_up_to()];
    let line = 1 + before.iter().filter(|byte| **byte == b'\n').count();
    problem(Place::Line(line), "a byte that is not UTF-8".to_owned(), "a TOML file in UTF-8")
}

fn problem(place: Place, found: String, expected: &str) -> Problem {
    Problem { place, key: String::new(), found, expected: expected.to_owned() }
}
