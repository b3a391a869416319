//! Gives bytes their meaning: frames, routes, gimbals; the core of the daemon as one plain value.
//!
//! **One input, then [`Bridge::poll_output`] until it is `None`, then the next input.** Time never goes backwards and
//! only comes in as `now`.

pub mod settings;
pub mod snapshot;

use std::fmt;

/// Position of a link in [`settings::Settings::links`].
pub type LinkIndex = usize;

/// One conversation on a link: a serial port, a TCP connection, or one UDP peer. At most [`ChannelId::COUNT`] at once.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ChannelId(u8);

impl ChannelId {
    pub const COUNT: usize = 64;

    /// `None` when `index` is not below [`Self::COUNT`].
    pub fn new(index: usize) -> Option<Self> {
        (index < Self::COUNT).then_some(Self(index as u8))
    }

    pub fn index(self) -> usize {
        usize::from(self.0)
    }
}

impl fmt::Display for ChannelId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "channel {}", self.0)
    }
}

/// A set of channels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ChannelSet(u64);

impl ChannelSet {
    pub const EMPTY: Self = Self(0);

    pub fn insert(&mut self, channel: ChannelId) {
        self.0 |= 1 << channel.0;
    }

    pub fn remove(&mut self, channel: ChannelId) {
        self.0 &= !(1 << channel.0);
    }

    pub fn contains(self, channel: ChannelId) -> bool {
        self.0 & (1 << channel.0) != 0
    }

    pub fn is_empty(self) -> bool {
        self.0 == 0
    }

    pub fn union(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    pub fn intersection(self, other: Self) -> Self {
        Self(self.0 & other.0)
    }

    pub fn without(self, other: Self) -> Self {
        Self(self.0 & !other.0)
    }
}

impl From<ChannelId> for ChannelSet {
    fn from(channel: ChannelId) -> Self {
        Self(1 << channel.0)
    }
}

impl Iterator for ChannelSet {
    type Item = ChannelId;

    /// Takes the lowest channel out of the set.
    fn next(&mut self) -> Option<ChannelId> {
        if self.0 == 0 {
            return None;
        }
        let channel = ChannelId(self.0.trailing_zeros() as u8);
        self.0 &= self.0 - 1;
        Some(channel)
    }
}

/// What happened outside.
#[derive(Clone, Copy, Debug)]
pub enum Input<'a> {
    /// Port open, socket bound, or TCP connected.
    LinkUp {
        link: LinkIndex,
    },
    LinkDown {
        link: LinkIndex,
        reason: &'a str,
    },
    /// A peer was heard or may be spoken to; `address` is shown to people.
    ChannelOpened {
        channel: ChannelId,
        link: LinkIndex,
        address: &'a str,
    },
    ChannelClosed {
        channel: ChannelId,
    },
    /// One read: a whole datagram, or a piece of a stream.
    Received {
        channel: ChannelId,
        bytes: &'a [u8],
    },
    /// Bytes given out before could not be sent.
    SendFailed {
        channel: ChannelId,
        frames: u32,
        reason: &'static str,
    },
    /// The process is to end: stop what moves, say goodbye.
    Shutdown,
}

/// What is to be done.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Output<'a> {
    /// Send one whole frame to each of `channels`.
    Transmit { channels: ChannelSet, bytes: &'a [u8] },
    /// Keep the adopted system id for the next start.
    StoreSystemId(u8),
}
