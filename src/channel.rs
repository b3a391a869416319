//! Channels: the conversations that links carry.

use std::fmt;

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

    pub const fn is_empty(self) -> bool {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_set_gives_its_channels_in_order() {
        let channel = |index| ChannelId::new(index).expect("below the bound");
        let mut set = ChannelSet::EMPTY;
        for index in [63, 0, 7] {
            set.insert(channel(index));
        }
        set.remove(channel(7));

        assert_eq!(set.collect::<Vec<_>>(), [channel(0), channel(63)]);
        assert_eq!(ChannelId::new(64), None);
    }
}
