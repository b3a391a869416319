//! Peers behind one line, and peers that the test looks at while they live somewhere.

use std::cell::{Ref, RefCell, RefMut};
use std::collections::VecDeque;
use std::rc::Rc;

use gimbald::sim::peer::{Peer, PlatformMotion};
use gimbald::timestamp::Timestamp;

/// Several peers that hear each other and share the line to the daemon: a gimbal behind an autopilot that passes on
/// whatever it hears, a ground station on that autopilot's radio.
pub struct Hub {
    members: Vec<Box<dyn Peer>>,
    echoes: bool,
    outgoing: VecDeque<Vec<u8>>,
}

impl Hub {
    pub fn new(members: Vec<Box<dyn Peer>>) -> Self {
        Self { members, echoes: false, outgoing: VecDeque::new() }
    }

    /// One that sends back whatever it hears from the daemon.
    pub fn echoing(members: Vec<Box<dyn Peer>>) -> Self {
        Self { echoes: true, ..Self::new(members) }
    }

    /// Lets everybody hear what somebody said, until nobody says anything more.
    fn pass_on(&mut self, now: Timestamp) {
        let mut speaker = 0;
        let mut silent = 0;
        while silent < self.members.len() {
            silent += 1;
            while let Some(bytes) = self.members[speaker].poll_output() {
                silent = 0;
                for (at, member) in self.members.iter_mut().enumerate() {
                    if at != speaker {
                        member.handle_received(now, &bytes);
                    }
                }
                self.outgoing.push_back(bytes);
            }
            speaker = (speaker + 1) % self.members.len();
        }
    }
}

impl Peer for Hub {
    fn handle_received(&mut self, now: Timestamp, bytes: &[u8]) {
        if self.echoes {
            self.outgoing.push_back(bytes.to_vec());
        }
        for member in &mut self.members {
            member.handle_received(now, bytes);
        }
        self.pass_on(now);
    }

    fn handle_timeout(&mut self, now: Timestamp) {
        for member in &mut self.members {
            member.handle_timeout(now);
        }
        self.pass_on(now);
    }

    fn poll_output(&mut self) -> Option<Vec<u8>> {
        self.outgoing.pop_front()
    }

    fn poll_timeout(&self) -> Option<Timestamp> {
        self.members.iter().filter_map(|member| member.poll_timeout()).min()
    }

    fn handle_reboot(&mut self, now: Timestamp) {
        for member in &mut self.members {
            member.handle_reboot(now);
        }
    }

    fn handle_disturbance(&mut self, now: Timestamp, motion: PlatformMotion) {
        for member in &mut self.members {
            member.handle_disturbance(now, motion);
        }
    }
}

/// A peer that lives in the world and can be looked at.
pub struct Watched<P>(Rc<RefCell<P>>);

impl<P> Clone for Watched<P> {
    fn clone(&self) -> Self {
        Self(self.0.clone())
    }
}

impl<P> Watched<P> {
    pub fn new(peer: P) -> Self {
        Self(Rc::new(RefCell::new(peer)))
    }

    pub fn look(&self) -> Ref<'_, P> {
        self.0.borrow()
    }

    pub fn touch(&self) -> RefMut<'_, P> {
        self.0.borrow_mut()
    }
}

impl<P: Peer> Peer for Watched<P> {
    fn handle_received(&mut self, now: Timestamp, bytes: &[u8]) {
        self.touch().handle_received(now, bytes);
    }

    fn handle_timeout(&mut self, now: Timestamp) {
        self.touch().handle_timeout(now);
    }

    fn poll_output(&mut self) -> Option<Vec<u8>> {
        self.touch().poll_output()
    }

    fn poll_timeout(&self) -> Option<Timestamp> {
        self.look().poll_timeout()
    }

    fn handle_reboot(&mut self, now: Timestamp) {
        self.touch().handle_reboot(now);
    }

    fn handle_disturbance(&mut self, now: Timestamp, motion: PlatformMotion) {
        self.touch().handle_disturbance(now, motion);
    }
}
