//! The adopted system id, kept from one start to the next.

use std::path::Path;

use super::state_file::StateFile;

/// A file of one number.
#[derive(Debug)]
pub struct SystemIdFile {
    file: StateFile,
}

impl SystemIdFile {
    pub fn new(directory: Option<&Path>) -> Self {
        Self { file: StateFile::new(directory, "system-id") }
    }

    /// What an earlier run stored, if it can be used.
    pub fn read(&self) -> Option<u8> {
        let text = self.file.read()?;
        let id = text.trim().parse().ok().filter(|id| *id != 0);
        if id.is_none() {
            let path = self.file.path().map(Path::display);
            tracing::warn!(
                path = path.map(tracing::field::display),
                "the stored system id is not a number from 1 to 255"
            );
        }
        id
    }

    /// Replaces what was stored.
    pub fn store(&mut self, id: u8) {
        self.file.store(format!("{id}\n"));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_cannot_be_used_is_not_read() {
        let directory = tempfile::tempdir().expect("a directory");
        let file = SystemIdFile::new(Some(directory.path()));
        assert_eq!(file.read(), None);
        for (text, expected) in
            [("", None), ("0", None), ("256", None), ("-1", None), ("gimbal", None), ("1 2", None), ("42\n", Some(42))]
        {
            std::fs::write(directory.path().join("system-id"), text).expect("it can be written");
            assert_eq!(file.read(), expected, "{text:?}");
        }
    }
}
