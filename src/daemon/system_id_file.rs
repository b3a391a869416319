//! The adopted system id, kept from one start to the next.

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread;

/// Ids that may wait for the storage; an autopilot changes its id once in a lifetime.
const WAITING: usize = 4;
const NAME: &str = "system-id";
const NEW_NAME: &str = "system-id.new";

/// A file of one number in the state directory; nothing is kept without that directory.
#[derive(Debug)]
pub struct SystemIdFile {
    directory: Option<PathBuf>,
    /// Leads to the thread that writes, once there was something to write.
    writer: Option<SyncSender<u8>>,
}

impl SystemIdFile {
    pub fn new(directory: Option<PathBuf>) -> Self {
        Self { directory, writer: None }
    }

    /// What an earlier run stored, if it can be used.
    pub fn read(&self) -> Option<u8> {
        let path = self.directory.as_ref()?.join(NAME);
        let text = match fs::read_to_string(&path) {
            Ok(text) => text,
            Err(error) if error.kind() == io::ErrorKind::NotFound => return None,
            Err(error) => {
                tracing::warn!(path = %path.display(), %error, "the stored system id cannot be read");
                return None;
            }
        };
        let id = text.trim().parse().ok().filter(|id| *id != 0);
        if id.is_none() {
            tracing::warn!(path = %path.display(), "the stored system id is not a number from 1 to 255");
        }
        id
    }

    /// Replaces what was stored, on a thread of its own, because storage can be slow.
    pub fn store(&mut self, id: u8) {
        let Some(directory) = &self.directory else { return };
        let stored = match &self.writer {
            Some(writer) => writer.try_send(id).map_err(|error| error.to_string()),
            None => start_writer(directory.clone(), id)
                .map(|writer| self.writer = Some(writer))
                .map_err(|error| error.to_string()),
        };
        if let Err(reason) = stored {
            tracing::error!(id, reason, "the system id cannot be stored");
        }
    }
}

/// Starts the thread that writes, with `first` to begin with.
fn start_writer(directory: PathBuf, first: u8) -> io::Result<SyncSender<u8>> {
    let (writer, ids) = sync_channel(WAITING);
    thread::Builder::new().name("system-id".to_owned()).spawn(move || write_all(&directory, first, &ids))?;
    Ok(writer)
}

fn write_all(directory: &Path, first: u8, ids: &Receiver<u8>) {
    for id in std::iter::once(first).chain(ids) {
        if let Err(error) = replace(directory, id) {
            tracing::error!(directory = %directory.display(), %error, "the system id cannot be stored");
        }
    }
}

/// Whenever the power fails, the file holds the old number or the new one.
fn replace(directory: &Path, id: u8) -> io::Result<()> {
    let new = directory.join(NEW_NAME);
    let mut file = File::create(&new)?;
    writeln!(file, "{id}")?;
    file.sync_all()?;
    fs::rename(&new, directory.join(NAME))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn directory() -> tempfile::TempDir {
        tempfile::tempdir().expect("a directory")
    }

    #[test]
    fn what_was_stored_is_read_at_the_next_start() {
        let directory = directory();
        let file = SystemIdFile::new(Some(directory.path().to_owned()));
        assert_eq!(file.read(), None);

        let (more, ids) = sync_channel(WAITING);
        more.send(42).expect("there is room");
        drop(more);
        write_all(directory.path(), 7, &ids);

        assert_eq!(file.read(), Some(42));
        let names: Vec<_> = fs::read_dir(directory.path()).expect("it is there").flatten().collect();
        assert_eq!(names.len(), 1, "nothing is left behind: {names:?}");
    }

    #[test]
    fn what_cannot_be_used_is_not_read() {
        let directory = directory();
        let file = SystemIdFile::new(Some(directory.path().to_owned()));
        for text in ["", "0", "256", "-1", "gimbal", "1 2"] {
            fs::write(directory.path().join(NAME), text).expect("it can be written");
            assert_eq!(file.read(), None, "{text:?}");
        }
    }

    #[test]
    fn a_missing_directory_is_an_error_that_is_told() {
        let directory = directory();
        let error = replace(&directory.path().join("missing"), 1).expect_err("there is no such directory");
        assert_eq!(error.kind(), io::ErrorKind::NotFound);
    }
}
