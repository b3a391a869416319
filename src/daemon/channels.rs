//! Which channel is which peer of which link.

use crate::channel::{ChannelId, ChannelSet};
use crate::links::inbox::{PEERS, PeerIndex, PeerSet};

/// Gives the channels' numbers out.
pub struct ChannelTable {
    /// Link and peer of each channel.
    owners: [Option<(usize, PeerIndex)>; ChannelId::COUNT],
    links: Vec<LinkChannels>,
}

#[derive(Clone, Default)]
struct LinkChannels {
    by_peer: [Option<ChannelId>; PEERS],
    all: ChannelSet,
}

impl ChannelTable {
    pub fn new(links: usize) -> Self {
        Self { owners: [None; ChannelId::COUNT], links: vec![LinkChannels::default(); links] }
    }

    /// The channel of a peer that appeared; `None` when all are in use.
    pub fn open(&mut self, link: usize, peer: PeerIndex) -> Option<ChannelId> {
        let free = self.owners.iter().position(Option::is_none).and_then(ChannelId::new)?;
        self.owners[free.index()] = Some((link, peer));
        self.links[link].by_peer[peer] = Some(free);
        self.links[link].all.insert(free);
        Some(free)
    }

    pub fn channel(&self, link: usize, peer: PeerIndex) -> Option<ChannelId> {
        self.links[link].by_peer[peer]
    }

    /// Frees the channel of a peer that left, if it had one.
    pub fn close(&mut self, link: usize, peer: PeerIndex) -> Option<ChannelId> {
        let channel = self.links[link].by_peer[peer].take()?;
        self.links[link].all.remove(channel);
        self.owners[channel.index()] = None;
        Some(channel)
    }

    /// Frees all channels of a link.
    pub fn close_all(&mut self, link: usize) -> ChannelSet {
        let closed = std::mem::take(&mut self.links[link]).all;
        for channel in closed {
            self.owners[channel.index()] = None;
        }
        closed
    }

    /// `channels` by link; channels that nobody has are left out.
    pub fn by_link(&self, channels: ChannelSet) -> impl Iterator<Item = (usize, PeerSet)> + '_ {
        let mut rest = channels;
        std::iter::from_fn(move || {
            loop {
                let (link, peer) = match self.owners[rest.next()?.index()] {
                    Some(owner) => owner,
                    None => continue,
                };
                let mut peers = PeerSet::from(peer);
                let others = rest.intersection(self.links[link].all);
                for (_, other) in others.filter_map(|channel| self.owners[channel.index()]) {
                    peers.insert(other);
                }
                rest = rest.without(others);
                return Some((link, peers));
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn set(channels: &[ChannelId]) -> ChannelSet {
        let mut set = ChannelSet::EMPTY;
        channels.iter().for_each(|channel| set.insert(*channel));
        set
    }

    #[test]
    fn channels_are_sorted_by_their_link() {
        let mut table = ChannelTable::new(3);
        let ground = [table.open(2, 0), table.open(2, 7)].map(|channel| channel.expect("there is room"));
        let gimbal = table.open(0, 0).expect("there is room");
        let late = table.open(2, 1).expect("there is room");

        let sorted: Vec<_> = table.by_link(set(&[ground[0], ground[1], gimbal, late])).collect();

        let mut peers = PeerSet::from(0);
        peers.insert(7);
        peers.insert(1);
        assert_eq!(sorted, [(2, peers), (0, PeerSet::from(0))]);
        assert_eq!(table.channel(2, 7), Some(ground[1]));
    }

    #[test]
    fn a_closed_channel_is_nobodys() {
        let mut table = ChannelTable::new(1);
        let first = table.open(0, 4).expect("there is room");
        assert_eq!(table.close(0, 4), Some(first));
        assert_eq!(table.close(0, 4), None);
        assert_eq!(table.by_link(set(&[first])).count(), 0);
        assert_eq!(table.open(0, 5), Some(first));
    }

    #[test]
    fn a_link_that_goes_down_frees_its_channels() {
        let mut table = ChannelTable::new(2);
        let first = table.open(0, 0).expect("there is room");
        let second = table.open(0, 1).expect("there is room");
        let other = table.open(1, 0).expect("there is room");

        assert_eq!(table.close_all(0), set(&[first, second]));
        assert_eq!(table.close_all(0), ChannelSet::EMPTY);
        assert_eq!(table.by_link(set(&[first, second, other])).collect::<Vec<_>>(), [(1, PeerSet::from(0))]);
    }

    #[test]
    fn the_channel_behind_the_last_is_refused() {
        let mut table = ChannelTable::new(5);
        for number in 0..ChannelId::COUNT {
            assert!(table.open(number / PEERS, number % PEERS).is_some());
        }
        assert_eq!(table.open(4, 0), None);
    }
}
