//! Which gimbals were told to turn, kept from one start to the next: whoever is killed cannot stop them.

use std::fs;
use std::io;
use std::path::PathBuf;

use super::state_file::read_beginning;

const NAME: &str = "turning";
/// What is written goes here first, so that a process that is killed meanwhile leaves one or the other.
const NEXT_NAME: &str = "turning.next";

/// A file in the runtime directory, a line of each gimbal, which is in memory and outlives a restart; nothing is kept without that
/// directory. It is written when a rotation starts or ends, on the way to the gimbal, which costs a few dozen microseconds.
#[derive(Debug)]
pub struct TurningFile {
    directory: Option<PathBuf>,
}

impl TurningFile {
    pub fn new(directory: Option<PathBuf>) -> Self {
        Self { directory }
    }

    /// The lines of the gimbals that an earlier run left turning.
    pub fn read(&self) -> Vec<String> {
        let Some(path) = self.path() else { return Vec::new() };
        match read_beginning(&path) {
            Ok(text) => text.lines().filter(|line| !line.is_empty()).map(str::to_owned).collect(),
            Err(error) if error.kind() == io::ErrorKind::NotFound => Vec::new(),
            Err(error) => {
                tracing::warn!(path = %path.display(), %error, "whether a gimbal was left turning cannot be read");
                Vec::new()
            }
        }
    }

    /// Replaces what was kept.
    pub fn store(&self, lines: &str) {
        let Some(path) = self.path() else { return };
        let stored = if lines.is_empty() {
            fs::remove_file(&path)
        } else {
            let next = path.with_file_name(NEXT_NAME);
            fs::write(&next, lines).and_then(|()| fs::rename(&next, &path))
        };
        match stored {
            Ok(()) => {}
            Err(error) if lines.is_empty() && error.kind() == io::ErrorKind::NotFound => {}
            Err(error) => tracing::error!(path = %path.display(), %error, "that a gimbal turns cannot be kept"),
        }
    }

    fn path(&self) -> Option<PathBuf> {
        self.directory.as_ref().map(|directory| directory.join(NAME))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_turns_is_read_at_the_next_start_and_nobody_after_all_stopped() {
        let directory = tempfile::tempdir().expect("a directory");
        let file = TurningFile::new(Some(directory.path().to_owned()));
        assert_eq!(file.read(), Vec::<String>::new());
        file.store("camera\t1/154\ngimbal-171\n");
        assert_eq!(TurningFile::new(Some(directory.path().to_owned())).read(), ["camera\t1/154", "gimbal-171"]);
        file.store("");
        file.store("");
        assert_eq!(file.read(), Vec::<String>::new());
        assert_eq!(fs::read_dir(directory.path()).expect("it is there").count(), 0);
    }

    #[test]
    fn whatever_else_stands_there_spoils_no_line_and_holds_nobody_up() {
        let directory = tempfile::tempdir().expect("a directory");
        let file = TurningFile::new(Some(directory.path().to_owned()));
        let path = directory.path().join(NAME);
        fs::write(&path, b"\xff\xfe\ncamera\t1/154\n").expect("a writable folder");
        assert_eq!(file.read()[1..], ["camera\t1/154"]);
        fs::write(&path, vec![b'\t'; 1_000_000]).expect("a writable folder");
        assert_eq!(file.read().concat().len(), 16 * 1024);
        fs::remove_file(&path).expect("it is there");
        nix::unistd::mkfifo(&path, nix::sys::stat::Mode::S_IRWXU).expect("a folder with room for it");
        assert_eq!(file.read(), Vec::<String>::new());
        file.store("camera\n");
        assert_eq!(file.read(), ["camera"]);
    }

    #[test]
    fn without_a_directory_nothing_is_kept() {
        let file = TurningFile::new(None);
        file.store("camera\n");
        assert_eq!(file.read(), Vec::<String>::new());
    }
}
