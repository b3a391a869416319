//! A cable to a gimbal that is away at times.

use std::cell::Cell;
use std::rc::Rc;

use gimbald::sim::peer::{Peer, PlatformMotion};
use gimbald::timestamp::Timestamp;

/// What the test does to a cable.
#[derive(Clone, Debug, Default)]
pub struct Cable {
    is_cut: Rc<Cell<bool>>,
}

impl Cable {
    /// Nothing passes either way, and nobody is told.
    pub fn cut(&self) {
        self.is_cut.set(true);
    }

    pub fn mend(&self) {
        self.is_cut.set(false);
    }
}

/// A gimbal at the end of a cable.
pub struct Cabled<P> {
    pub peer: P,
    pub cable: Cable,
}

impl<P: Peer> Peer for Cabled<P> {
    fn handle_received(&mut self, now: Timestamp, bytes: &[u8]) {
        if !self.cable.is_cut.get() {
            self.peer.handle_received(now, bytes);
        }
    }

    fn handle_timeout(&mut self, now: Timestamp) {
        self.peer.handle_timeout(now);
    }

    fn poll_output(&mut self) -> Option<Vec<u8>> {
        loop {
            let bytes = self.peer.poll_output()?;
            if !self.cable.is_cut.get() {
                return Some(bytes);
            }
        }
    }

    fn poll_timeout(&self) -> Option<Timestamp> {
        self.peer.poll_timeout()
    }

    fn handle_reboot(&mut self, now: Timestamp) {
        self.peer.handle_reboot(now);
    }

    fn handle_disturbance(&mut self, now: Timestamp, motion: PlatformMotion) {
        self.peer.handle_disturbance(now, motion);
    }
}
