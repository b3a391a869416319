//! What a link tells the event loop.

use std::ops::Range;

/// Which of a link's peers; below [`PEERS`].
pub type PeerIndex = usize;

/// Most peers of one link at a time.
pub const PEERS: usize = 16;

/// Most reads in one batch.
pub const READS: usize = 32;

/// What the longest datagram needs.
pub const READ_LENGTH: usize = 65_536;

/// Distance of two reads in memory. A power of two would put the beginnings of all reads, where the short ones are,
/// into the same few sets of the processor's caches.
const STRIDE: usize = READ_LENGTH + 320;

/// A set of a link's peers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PeerSet(u16);

impl PeerSet {
    pub fn insert(&mut self, peer: PeerIndex) {
        self.0 |= 1 << peer;
    }

    pub fn contains(self, peer: PeerIndex) -> bool {
        self.0 & (1 << peer) != 0
    }
}

impl From<PeerIndex> for PeerSet {
    fn from(peer: PeerIndex) -> Self {
        Self(1 << peer)
    }
}

impl Iterator for PeerSet {
    type Item = PeerIndex;

    /// Takes the lowest peer out of the set.
    fn next(&mut self) -> Option<PeerIndex> {
        if self.0 == 0 {
            return None;
        }
        let peer = self.0.trailing_zeros() as PeerIndex;
        self.0 &= self.0 - 1;
        Some(peer)
    }
}

/// What happened on a link.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Event<'a> {
    /// Port open, socket bound, or TCP connected.
    Up,
    /// Not usable, and all its peers are gone.
    Down {
        reason: &'a str,
    },
    /// `address` is shown to people.
    PeerAppeared {
        peer: PeerIndex,
        address: &'a str,
    },
    PeerLeft {
        peer: PeerIndex,
    },
    /// One read: a whole datagram, or a piece of a stream.
    Received {
        peer: PeerIndex,
        bytes: &'a [u8],
    },
    /// Frames were dropped.
    SendFailed {
        peer: PeerIndex,
        frames: u32,
        reason: &'static str,
    },
}

#[derive(Debug)]
enum Entry {
    Up,
    Down(String),
    PeerAppeared(PeerIndex, String),
    PeerLeft(PeerIndex),
    Received(PeerIndex, Range<usize>),
    SendFailed(PeerIndex, u32, &'static str),
}

/// The events of one poll of one link, and the memory that its reads go to.
///
/// One is enough for all links, as they are polled in turn. Each read has room for the longest datagram there is; the
/// pages that no read ever touched cost nothing.
pub struct Inbox {
    memory: Box<[u8]>,
    used: usize,
    entries: Vec<Entry>,
}

impl Default for Inbox {
    fn default() -> Self {
        Self { memory: vec![0; READS * STRIDE].into_boxed_slice(), used: 0, entries: Vec::with_capacity(READS * 2) }
    }
}

impl Inbox {
    pub fn clear(&mut self) {
        self.used = 0;
        self.entries.clear();
    }

    pub fn len(&self) -> usize {
        self.entries.len()
    }

    pub fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// The event at `index`, which is below [`Self::len`].
    pub fn event(&self, index: usize) -> Event<'_> {
        match &self.entries[index] {
            Entry::Up => Event::Up,
            Entry::Down(reason) => Event::Down { reason },
            Entry::PeerAppeared(peer, address) => Event::PeerAppeared { peer: *peer, address },
            Entry::PeerLeft(peer) => Event::PeerLeft { peer: *peer },
            Entry::Received(peer, range) => {
                Event::Received { peer: *peer, bytes: self.memory.get(range.clone()).unwrap_or_default() }
            }
            Entry::SendFailed(peer, frames, reason) => Event::SendFailed { peer: *peer, frames: *frames, reason },
        }
    }

    pub fn up(&mut self) {
        self.entries.push(Entry::Up);
    }

    pub fn down(&mut self, reason: String) {
        self.entries.push(Entry::Down(reason));
    }

    pub fn peer_appeared(&mut self, peer: PeerIndex, address: String) {
        self.entries.push(Entry::PeerAppeared(peer, address));
    }

    pub fn peer_left(&mut self, peer: PeerIndex) {
        self.entries.push(Entry::PeerLeft(peer));
    }

    /// Says nothing about no frames.
    pub fn send_failed(&mut self, peer: PeerIndex, frames: u32, reason: &'static str) {
        if frames > 0 {
            self.entries.push(Entry::SendFailed(peer, frames, reason));
        }
    }

    /// The buffers that are still free, [`READ_LENGTH`] long each.
    pub fn buffers(&mut self) -> impl Iterator<Item = &mut [u8]> {
        self.memory[self.used * STRIDE..].chunks_exact_mut(STRIDE).map(|buffer| &mut buffer[..READ_LENGTH])
    }

    /// The first free buffer; `None` when the batch is full.
    pub fn buffer(&mut self) -> Option<&mut [u8]> {
        self.buffers().next()
    }

    /// `length` bytes from `peer` are in the free buffer of that index.
    pub fn received_in(&mut self, buffer: usize, peer: PeerIndex, length: usize) {
        let start = (self.used + buffer) * STRIDE;
        self.entries.push(Entry::Received(peer, start..start + length));
    }

    /// The first `count` free buffers are in use.
    pub fn take_buffers(&mut self, count: usize) {
        self.used += count;
    }

    /// `length` bytes from `peer` are in [`Self::buffer`], which is in use then.
    pub fn received(&mut self, peer: PeerIndex, length: usize) {
        self.received_in(0, peer, length);
        self.take_buffers(1);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn events_come_out_in_the_order_they_went_in() {
        let mut inbox = Inbox::default();
        inbox.up();
        inbox.peer_appeared(3, "10.0.0.1:14550".into());
        inbox.buffer().expect("a fresh inbox has room")[..2].copy_from_slice(&[1, 2]);
        inbox.received(3, 2);
        inbox.buffers().nth(1).expect("room")[..1].copy_from_slice(&[9]);
        inbox.received_in(1, 4, 1);
        inbox.take_buffers(2);

        let events: Vec<_> = (0..inbox.len()).map(|index| inbox.event(index)).collect();

        assert_eq!(
            events,
            [
                Event::Up,
                Event::PeerAppeared { peer: 3, address: "10.0.0.1:14550" },
                Event::Received { peer: 3, bytes: &[1, 2] },
                Event::Received { peer: 4, bytes: &[9] },
            ]
        );
        assert_eq!(inbox.buffers().count(), READS - 3);
    }

    #[test]
    fn a_full_inbox_has_no_buffer() {
        let mut inbox = Inbox::default();
        for _ in 0..READS {
            assert_eq!(inbox.buffer().map(|buffer| buffer.len()), Some(READ_LENGTH));
            inbox.received(0, READ_LENGTH);
        }
        assert!(inbox.buffer().is_none());

        inbox.clear();
        assert!(inbox.is_empty());
        assert_eq!(inbox.buffers().count(), READS);
    }
}
