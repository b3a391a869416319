//! What every simulated peer has in common.

use crate::geometry::{Angle, AngularRate};
use crate::timestamp::Timestamp;

/// How the vehicle carries the gimbal at one moment.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PlatformMotion {
    pub heading: Angle,
    /// Positive to the right.
    pub heading_rate: AngularRate,
    /// Positive right wing down.
    pub roll_rate: AngularRate,
    /// Positive nose up.
    pub pitch_rate: AngularRate,
}

/// A simulated component at the other end of a link.
///
/// One input, then [`poll_output`](Self::poll_output) until it is `None`, then the next input; time never goes
/// backwards. Nothing is sent before the first input, so a host begins with [`handle_timeout`](Self::handle_timeout).
pub trait Peer {
    /// Takes one read: a whole datagram, or a piece of a stream.
    fn handle_received(&mut self, now: Timestamp, bytes: &[u8]);

    fn handle_timeout(&mut self, now: Timestamp);

    /// The next bytes to send, one frame unless faults cut or join them.
    fn poll_output(&mut self) -> Option<Vec<u8>>;

    fn poll_timeout(&self) -> Option<Timestamp>;

    /// Starts over as after a power-on; what was not yet sent is lost.
    fn handle_reboot(&mut self, now: Timestamp);

    /// Moves the vehicle that carries the peer; without effect on a peer that nothing carries.
    fn handle_disturbance(&mut self, _now: Timestamp, _motion: PlatformMotion) {}
}
