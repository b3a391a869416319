//! Reads recordings: 8 bytes of big-endian microseconds, then one frame, and so on.

use std::path::{Path, PathBuf};

use gimbald::timestamp::Timestamp;
use gimbald::wire::{DatagramFrames, MavId};

/// One entry of a recording.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Record {
    /// Time since the first entry.
    pub at: Timestamp,
    pub bytes: Vec<u8>,
}

impl Record {
    pub fn source(&self) -> MavId {
        match self.bytes[0] {
            0xfd => MavId::new(self.bytes[5], self.bytes[6]),
            _ => MavId::new(self.bytes[3], self.bytes[4]),
        }
    }
}

/// The folder of a recording below `tests/captures/`.
pub fn capture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/captures").join(name)
}

/// Reads a whole recording.
///
/// # Panics
///
/// When the file cannot be read or an entry is no frame.
pub fn read(path: &Path) -> Vec<Record> {
    let bytes = std::fs::read(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let mut rest = &bytes[..];
    let mut records: Vec<Record> = Vec::new();
    let mut started = None;
    while let Some((stamp, after)) = rest.split_first_chunk::<8>() {
        let micros = u64::from_be_bytes(*stamp);
        let len = frame_len(after)
            .filter(|len| *len <= after.len())
            .unwrap_or_else(|| panic!("{}: no frame {} bytes before the end", path.display(), after.len()));
        let started = *started.get_or_insert(micros);
        records.push(Record { at: Timestamp::from_micros(micros - started), bytes: after[..len].to_vec() });
        rest = &after[len..];
    }
    assert!(rest.is_empty(), "{} ends inside a time stamp", path.display());
    records
}

/// The frames of a recording in a row, as a serial port would have brought them.
pub fn stream(records: &[Record]) -> Vec<u8> {
    records.iter().flat_map(|record| record.bytes.iter().copied()).collect()
}

/// Length of the frame that `bytes` begin with, as its header tells.
fn frame_len(bytes: &[u8]) -> Option<usize> {
    let payload = usize::from(*bytes.get(1)?);
    match (bytes[0], bytes.get(2)?) {
        (0xfd, flags) if flags & 1 == 1 => Some(payload + 25),
        (0xfd, _) => Some(payload + 12),
        (0xfe, _) => Some(payload + 8),
        _ => None,
    }
}

/// A recording is read back with the times and frames that were written.
#[test]
fn a_recording_is_read_with_its_times() {
    let heartbeat =
        [0xfe, 0x09, 0x00, 0x01, 0xbf, 0x00, 0x00, 0x00, 0x00, 0x00, 0x12, 0x08, 0x00, 0x04, 0x03, 0x05, 0x8c];
    let mut file = Vec::new();
    for micros in [1_700_000_000_000_000u64, 1_700_000_000_250_000] {
        file.extend_from_slice(&micros.to_be_bytes());
        file.extend_from_slice(&heartbeat);
    }
    let folder = tempfile::tempdir().expect("a folder can be made");
    let path = folder.path().join("link.tlog");
    std::fs::write(&path, file).expect("a file can be written");

    let records = read(&path);

    let record = |millis| Record { at: Timestamp::from_millis(millis), bytes: heartbeat.to_vec() };
    assert_eq!(records, [record(0), record(250)]);
    assert!(DatagramFrames::new(&records[0].bytes).next_frame().is_some());
}
