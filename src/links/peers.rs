//! Who was heard on a UDP socket that many may speak to.

use std::net::SocketAddr;
use std::time::Duration;

use nix::sys::socket::SockaddrStorage;

use super::inbox::{PEERS, PeerIndex, PeerSet};
use crate::timestamp::Timestamp;

/// A peer not heard for so long is closed.
const SILENCE: Duration = Duration::from_secs(60);
/// A peer heard within this time does not make room for another.
const PROTECTION: Duration = Duration::from_secs(10);
/// When everybody was silent for so long, the broadcast address is spoken to again.
const ANSWER: Duration = Duration::from_secs(10);

/// At most [`PEERS`] addresses, each heard lately; or the broadcast address while there is nobody else.
pub struct Peers {
    slots: [Option<Peer>; PEERS],
    broadcast: Option<SocketAddr>,
    /// Whoever was heard last is the most likely to be heard next.
    last: PeerIndex,
    /// Nobody is silent for too long before.
    check_at: Option<Timestamp>,
}

struct Peer {
    address: SocketAddr,
    /// The same for the kernel.
    destination: SockaddrStorage,
    /// `None` for the broadcast address.
    heard: Option<Timestamp>,
}

/// What a datagram's sender is to us.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sender {
    Known(PeerIndex),
    /// It has `peer` from this datagram on; those of `left`, of whom `peer` may be one, are gone.
    New {
        peer: PeerIndex,
        left: PeerSet,
    },
    /// There is no room.
    Refused,
}

impl Peers {
    /// `broadcast` is spoken to while there is no peer.
    pub fn new(broadcast: Option<SocketAddr>) -> Self {
        Self { slots: Default::default(), broadcast, last: 0, check_at: None }
    }

    /// A datagram came from `address`.
    pub fn heard(&mut self, now: Timestamp, address: SocketAddr) -> Sender {
        if let Some(peer) = self.find(address) {
            self.last = peer;
            if let Some(known) = &mut self.slots[peer] {
                known.heard = Some(now);
            }
            return Sender::Known(peer);
        }
        let Some((peer, left)) = self.make_room(now) else { return Sender::Refused };
        self.slots[peer] = Some(Peer { address, destination: address.into(), heard: Some(now) });
        self.last = peer;
        self.schedule_check();
        Sender::New { peer, left }
    }

    fn find(&self, address: SocketAddr) -> Option<PeerIndex> {
        let is_at = |peer: &PeerIndex| self.slots[*peer].as_ref().is_some_and(|known| known.address == address);
        Some(self.last).filter(is_at).or_else(|| (0..PEERS).find(is_at))
    }

    fn make_room(&mut self, now: Timestamp) -> Option<(PeerIndex, PeerSet)> {
        if let Some(broadcast) = self.slots.iter().position(|slot| matches!(slot, Some(Peer { heard: None, .. }))) {
            return Some((broadcast, broadcast.into()));
        }
        if let Some(free) = self.slots.iter().position(Option::is_none) {
            return Some((free, PeerSet::default()));
        }
        let heard = |peer: &PeerIndex| self.slots[*peer].as_ref().and_then(|known| known.heard);
        let longest_silent = (0..PEERS).min_by_key(heard)?;
        let silent_for = now.since(heard(&longest_silent)?);
        (silent_for > PROTECTION).then(|| (longest_silent, longest_silent.into()))
    }

    /// The broadcast address takes its place if there is nobody else.
    pub fn speak_to_broadcast(&mut self) -> Option<(PeerIndex, SocketAddr)> {
        let address = self.broadcast.filter(|_| self.slots.iter().all(Option::is_none))?;
        self.slots[0] = Some(Peer { address, destination: address.into(), heard: None });
        Some((0, address))
    }

    /// Removes whom nobody hears any more.
    pub fn expire(&mut self, now: Timestamp) -> PeerSet {
        let mut left = PeerSet::default();
        if self.check_at.is_none_or(|at| now < at) {
            return left;
        }
        let nobody_answers = self.broadcast.is_some() && self.newest().is_some_and(|at| now.since(at) >= ANSWER);
        let limit = if nobody_answers { ANSWER } else { SILENCE };
        for (peer, slot) in self.slots.iter_mut().enumerate() {
            if slot.as_ref().and_then(|known| known.heard).is_some_and(|at| now.since(at) >= limit) {
                *slot = None;
                left.insert(peer);
            }
        }
        self.schedule_check();
        left
    }

    fn schedule_check(&mut self) {
        let silence = self.times().min().map(|oldest| oldest + SILENCE);
        let answer = self.newest().filter(|_| self.broadcast.is_some()).map(|newest| newest + ANSWER);
        self.check_at = silence.into_iter().chain(answer).min();
    }

    fn newest(&self) -> Option<Timestamp> {
        self.times().max()
    }

    fn times(&self) -> impl Iterator<Item = Timestamp> + '_ {
        self.slots.iter().flatten().filter_map(|peer| peer.heard)
    }

    /// When [`Self::expire`] may have something to remove.
    pub fn check_at(&self) -> Option<Timestamp> {
        self.check_at
    }

    /// Those of `peers` that are there.
    pub fn present(&self, peers: PeerSet) -> PeerSet {
        let mut present = PeerSet::default();
        for peer in peers.filter(|peer| self.slots[*peer].is_some()) {
            present.insert(peer);
        }
        present
    }

    pub fn destination(&self, peer: PeerIndex) -> Option<SockaddrStorage> {
        self.slots[peer].as_ref().map(|known| known.destination)
    }

    pub fn remove(&mut self, peer: PeerIndex) {
        self.slots[peer] = None;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NOW: Timestamp = Timestamp::from_secs(100);
    const BROADCAST: &str = "192.168.1.255:14550";

    fn address(number: u16) -> SocketAddr {
        SocketAddr::from(([10, 0, 0, 1], 14_000 + number))
    }

    fn seconds(seconds: u64) -> Duration {
        Duration::from_secs(seconds)
    }

    fn full() -> Peers {
        let mut peers = Peers::new(None);
        for number in 0..PEERS as u16 {
            let new = Sender::New { peer: usize::from(number), left: PeerSet::default() };
            assert_eq!(peers.heard(NOW, address(number)), new);
        }
        peers
    }

    /// "at most 16 peers per link; the longest-silent one makes room".
    #[test]
    fn the_longest_silent_peer_makes_room() {
        let mut peers = full();
        let later = NOW + seconds(11);
        for number in (0..PEERS as u16).filter(|number| *number != 5) {
            assert_eq!(peers.heard(later, address(number)), Sender::Known(usize::from(number)));
        }

        assert_eq!(peers.heard(later, address(99)), Sender::New { peer: 5, left: 5.into() });
        assert_eq!(peers.heard(later, address(99)), Sender::Known(5));
    }

    /// "never one heard within the last 10 s".
    #[test]
    fn a_peer_heard_lately_makes_no_room() {
        let mut peers = full();
        assert_eq!(peers.heard(NOW + seconds(10), address(99)), Sender::Refused);
    }

    /// "a peer silent for 60 s is closed".
    /// Client checklist E133: "… the old one is dropped after its time."
    #[test]
    fn a_silent_peer_is_closed_after_a_minute() {
        let mut peers = Peers::new(None);
        peers.heard(NOW, address(0));
        peers.heard(NOW, address(1));
        assert_eq!(peers.check_at(), Some(NOW + seconds(60)));
        peers.heard(NOW + seconds(30), address(1));

        assert_eq!(peers.expire(NOW + seconds(59)), PeerSet::default());
        assert_eq!(peers.expire(NOW + seconds(60)), PeerSet::from(0));
        assert_eq!(peers.check_at(), Some(NOW + seconds(90)));
        assert_eq!(peers.expire(NOW + seconds(90)), PeerSet::from(1));
        assert_eq!(peers.check_at(), None);
    }

    /// "to a broadcast address until somebody answers, then to whoever answered".
    #[test]
    fn the_first_answer_ends_the_broadcast() {
        let broadcast: SocketAddr = BROADCAST.parse().expect("an address");
        let mut peers = Peers::new(Some(broadcast));
        assert_eq!(peers.speak_to_broadcast(), Some((0, broadcast)));
        assert_eq!(peers.speak_to_broadcast(), None);

        assert_eq!(peers.heard(NOW, address(1)), Sender::New { peer: 0, left: 0.into() });
        assert_eq!(peers.heard(NOW, address(2)), Sender::New { peer: 1, left: PeerSet::default() });
        assert_eq!(peers.destination(0), Some(address(1).into()));
        assert_eq!(peers.speak_to_broadcast(), None);
    }

    /// "back to broadcast after all are silent for 10 s"; until then a silent one is kept.
    #[test]
    fn silence_of_all_brings_the_broadcast_back() {
        let broadcast: SocketAddr = BROADCAST.parse().expect("an address");
        let mut peers = Peers::new(Some(broadcast));
        peers.heard(NOW, address(1));
        peers.heard(NOW, address(2));
        peers.heard(NOW + seconds(5), address(2));
        assert_eq!(peers.check_at(), Some(NOW + seconds(10)));

        assert_eq!(peers.expire(NOW + seconds(10)), PeerSet::default());
        assert_eq!(peers.check_at(), Some(NOW + seconds(15)));
        let mut both = PeerSet::from(0);
        both.insert(1);
        assert_eq!(peers.expire(NOW + seconds(15)), both);
        assert_eq!(peers.speak_to_broadcast(), Some((0, broadcast)));
    }

    #[test]
    fn nothing_is_sent_to_whom_is_gone() {
        let mut peers = full();
        peers.remove(3);
        let mut asked = PeerSet::from(3);
        asked.insert(4);
        assert_eq!(peers.present(asked), PeerSet::from(4));
        assert_eq!(peers.destination(3), None);
    }
}
