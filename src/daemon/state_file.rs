//! What is kept for good from one start to the next.

use std::fs::{self, File};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread;

/// Texts that may wait for the storage, of which the last one is written: gimbals are found a few at once, and then hardly
/// anything changes.
const WAITING: usize = 64;

/// More is not read.
const MAX_BYTES: u64 = 16 * 1024;

/// A file in the state directory; nothing is kept without that directory.
#[derive(Debug)]
pub struct StateFile {
    path: Option<PathBuf>,
    /// Leads to the thread that writes, once there was something to write.
    writer: Option<SyncSender<String>>,
}

impl StateFile {
    pub fn new(directory: Option<&Path>, name: &str) -> Self {
        Self { path: directory.map(|directory| directory.join(name)), writer: None }
    }

    pub fn path(&self) -> Option<&Path> {
        self.path.as_deref()
    }

    /// What an earlier run stored.
    pub fn read(&self) -> Option<String> {
        let path = self.path()?;
        match read_beginning(path) {
            Ok(text) => Some(text),
            Err(error) if error.kind() == io::ErrorKind::NotFound => None,
            Err(error) => {
                tracing::warn!(path = %path.display(), %error, "what was stored cannot be read");
                None
            }
        }
    }

    /// Replaces what was stored, on a thread of its own, because storage can be slow.
    pub fn store(&mut self, text: String) {
        let Some(path) = &self.path else { return };
        let stored = match &self.writer {
            Some(writer) => writer.try_send(text).map_err(|error| error.to_string()),
            None => start_writer(path.clone(), text)
                .map(|writer| self.writer = Some(writer))
                .map_err(|error| error.to_string()),
        };
        if let Err(reason) = stored {
            tracing::error!(path = %path.display(), reason, "it cannot be stored");
        }
    }
}

/// Whatever stands there: what is no UTF-8 spoils no other line.
pub fn read_beginning(path: &Path) -> io::Result<String> {
    // A pipe in its place would be waited for.
    if !fs::metadata(path)?.is_file() {
        return Err(io::Error::other("it is no file; remove it"));
    }
    let mut bytes = Vec::new();
    File::open(path)?.take(MAX_BYTES).read_to_end(&mut bytes)?;
    Ok(String::from_utf8_lossy(&bytes).into_owned())
}

/// Starts the thread that writes, with `first` to begin with.
fn start_writer(path: PathBuf, first: String) -> io::Result<SyncSender<String>> {
    let (writer, texts) = sync_channel(WAITING);
    thread::Builder::new().name("state".to_owned()).spawn(move || write_all(&path, first, &texts))?;
    Ok(writer)
}

fn write_all(path: &Path, first: String, texts: &Receiver<String>) {
    for text in std::iter::once(first).chain(texts) {
        let newest = texts.try_iter().last().unwrap_or(text);
        if let Err(error) = replace(path, &newest) {
            tracing::error!(path = %path.display(), %error, "it cannot be stored");
        }
    }
}

/// Whenever the power fails, the file holds the old text or the new one.
fn replace(path: &Path, text: &str) -> io::Result<()> {
    let new = path.with_extension("new");
    let mut file = File::create(&new)?;
    file.write_all(text.as_bytes())?;
    file.sync_all()?;
    fs::rename(&new, path)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn directory() -> tempfile::TempDir {
        tempfile::tempdir().expect("a directory")
    }

    #[test]
    fn what_was_stored_last_is_read_at_the_next_start() {
        let directory = directory();
        let file = StateFile::new(Some(directory.path()), "gimbal-ids");
        assert_eq!(file.read(), None);

        let (more, texts) = sync_channel(WAITING);
        for text in ["second", "third", "1/70\t192\t1\n"] {
            more.send(text.to_owned()).expect("there is room");
        }
        drop(more);
        write_all(file.path().expect("it has one"), "first".to_owned(), &texts);

        assert_eq!(file.read().as_deref(), Some("1/70\t192\t1\n"));
        let names: Vec<_> = fs::read_dir(directory.path()).expect("it is there").flatten().collect();
        assert_eq!(names.len(), 1, "nothing is left behind: {names:?}");
    }

    #[test]
    fn whatever_else_stands_there_spoils_no_line_and_holds_nobody_up() {
        let directory = directory();
        let file = StateFile::new(Some(directory.path()), "gimbal-ids");
        let path = directory.path().join("gimbal-ids");
        fs::write(&path, b"\xff\xfe\n1/70\t192\t1\n").expect("a writable folder");
        assert_eq!(file.read().expect("a text").lines().nth(1), Some("1/70\t192\t1"));
        fs::write(&path, vec![b'\n'; 1_000_000]).expect("a writable folder");
        assert_eq!(file.read().map(|text| text.len()), Some(16 * 1024));
        fs::remove_file(&path).expect("it is there");
        nix::unistd::mkfifo(&path, nix::sys::stat::Mode::S_IRWXU).expect("a folder with room for it");
        assert_eq!(file.read(), None);
        replace(&path, "1/70\t192\t1\n").expect("a writable folder");
        assert_eq!(file.read().as_deref(), Some("1/70\t192\t1\n"));
    }

    #[test]
    fn a_missing_directory_is_an_error_that_is_told() {
        let directory = directory();
        let error = replace(&directory.path().join("missing/system-id"), "1").expect_err("no such directory");
        assert_eq!(error.kind(), io::ErrorKind::NotFound);
    }

    #[test]
    fn without_a_directory_nothing_is_kept() {
        let mut file = StateFile::new(None, "gimbal-ids");
        file.store("1/70\t192\t1\n".to_owned());
        assert_eq!(file.read(), None);
    }
}
