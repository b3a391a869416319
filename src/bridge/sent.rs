//! Our own latest frames, to tell a frame that came back from one that somebody else sent under our name.

use std::hash::{DefaultHasher, Hasher};

const REMEMBERED: usize = 512;

/// Fingerprints of the frames that we sent last.
#[derive(Debug, Default)]
pub struct SentFrames {
    fingerprints: Vec<u64>,
    next: usize,
}

impl SentFrames {
    pub fn note(&mut self, frame: &[u8]) {
        let fingerprint = fingerprint(frame);
        if self.fingerprints.len() < REMEMBERED {
            self.fingerprints.push(fingerprint);
        } else {
            self.fingerprints[self.next] = fingerprint;
            self.next = (self.next + 1) % REMEMBERED;
        }
    }

    pub fn contains(&self, frame: &[u8]) -> bool {
        self.fingerprints.contains(&fingerprint(frame))
    }
}

fn fingerprint(frame: &[u8]) -> u64 {
    let mut hasher = DefaultHasher::new();
    hasher.write(frame);
    hasher.finish()
}
