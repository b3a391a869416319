//! How simulated components read, keep time and speak: what is the same in all of them.

use std::time::Duration;

use crate::sim::outbox::Outbox;
use crate::sim::peer::{Peer, PlatformMotion};
use crate::timestamp::Timestamp;
use crate::wire::decoder::Patience;
use crate::wire::{Frame, MavId, StreamDecoder};

/// A frame whose rest does not come within this was noise.
const DECODER_PATIENCE: Duration = Duration::from_millis(100);

/// The component's end of its link.
#[derive(Debug)]
pub struct Line {
    decoder: StreamDecoder,
    pub outbox: Outbox,
}

impl Line {
    pub fn new(id: MavId) -> Self {
        Self { decoder: StreamDecoder::new(Patience::Fixed(DECODER_PATIENCE)), outbox: Outbox::new(id) }
    }

    pub fn id(&self) -> MavId {
        self.outbox.source()
    }
}

/// One simulated component. What it has of frames and times makes it a [`Peer`].
pub trait Component {
    fn line(&self) -> &Line;

    fn line_mut(&mut self) -> &mut Line;

    /// Comes to `now`, before anything that happens then.
    fn advance(&mut self, now: Timestamp);

    /// A frame that came, whomever it is for.
    fn handle_frame(&mut self, now: Timestamp, frame: &Frame<'_>);

    /// Says what is due at `now`, after all that happened.
    fn send_due(&mut self, now: Timestamp);

    /// When it wants to be called again, if nothing comes before.
    fn next_due(&self) -> Option<Timestamp>;

    /// Starts over as after a power-on.
    fn restart(&mut self, now: Timestamp);

    /// The vehicle that carries it moves like this; without effect on a component that nothing carries.
    fn carry(&mut self, _now: Timestamp, _motion: PlatformMotion) {}
}

impl<C: Component> Peer for C {
    fn handle_received(&mut self, now: Timestamp, bytes: &[u8]) {
        self.advance(now);
        self.line_mut().decoder.push(now, bytes);
        read_frames(self, now);
        self.send_due(now);
    }

    fn handle_timeout(&mut self, now: Timestamp) {
        self.advance(now);
        if self.line().decoder.poll_timeout().is_some_and(|at| at <= now) {
            self.line_mut().decoder.handle_timeout(now);
            read_frames(self, now);
        }
        self.send_due(now);
    }

    fn poll_output(&mut self) -> Option<Vec<u8>> {
        self.line_mut().outbox.poll()
    }

    fn poll_timeout(&self) -> Option<Timestamp> {
        [self.next_due(), self.line().decoder.poll_timeout()].into_iter().flatten().min()
    }

    fn handle_reboot(&mut self, now: Timestamp) {
        self.restart(now);
    }

    fn handle_disturbance(&mut self, now: Timestamp, motion: PlatformMotion) {
        self.carry(now, motion);
    }
}

fn read_frames<C: Component>(component: &mut C, now: Timestamp) {
    let mut decoder = std::mem::take(&mut component.line_mut().decoder);
    while let Some(frame) = decoder.next_frame() {
        component.handle_frame(now, &frame);
    }
    component.line_mut().decoder = decoder;
}
