//! A peer behind somebody who decides what of its line gets through: a cable that is cut, an answer that is lost, a gimbal
//! that does not do as it is told.

use std::collections::VecDeque;

use gimbald::sim::peer::{Peer, PlatformMotion};
use gimbald::timestamp::Timestamp;

/// What becomes of one frame.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Passage {
    Through,
    Lost,
    /// Another one arrives in its place.
    As(Vec<u8>),
    /// It is lost, and whoever sent it hears this from where it was to go.
    Answered(Vec<u8>),
}

/// Who stands between a peer and the core. What he does not decide gets through.
pub trait Interceptor {
    /// A frame that the peer would hear.
    fn towards_peer(&mut self, _bytes: &[u8]) -> Passage {
        Passage::Through
    }

    /// A frame that the peer says; an answer to it is heard by nobody.
    fn towards_core(&mut self, _bytes: &[u8]) -> Passage {
        Passage::Through
    }
}

/// A peer and who stands before it. Time, power and the vehicle's motion get through in any case.
#[derive(Debug)]
pub struct Intercepted<P, I> {
    peer: P,
    interceptor: I,
    answers: VecDeque<Vec<u8>>,
}

impl<P, I> Intercepted<P, I> {
    pub fn new(peer: P, interceptor: I) -> Self {
        Self { peer, interceptor, answers: VecDeque::new() }
    }
}

impl<P: Peer, I: Interceptor> Peer for Intercepted<P, I> {
    fn handle_received(&mut self, now: Timestamp, bytes: &[u8]) {
        match self.interceptor.towards_peer(bytes) {
            Passage::Through => self.peer.handle_received(now, bytes),
            Passage::Lost => {}
            Passage::As(bytes) => self.peer.handle_received(now, &bytes),
            Passage::Answered(answer) => self.answers.push_back(answer),
        }
    }

    fn handle_timeout(&mut self, now: Timestamp) {
        self.peer.handle_timeout(now);
    }

    fn poll_output(&mut self) -> Option<Vec<u8>> {
        if let Some(answer) = self.answers.pop_front() {
            return Some(answer);
        }
        loop {
            let bytes = self.peer.poll_output()?;
            match self.interceptor.towards_core(&bytes) {
                Passage::Through => return Some(bytes),
                Passage::As(bytes) => return Some(bytes),
                Passage::Lost | Passage::Answered(_) => {}
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
