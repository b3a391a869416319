//! Channels and links as the core sees them: bytes in, frames out, everything counted.

use std::collections::BTreeMap;
use std::time::Duration;

use super::LinkIndex;
use super::outbox::Outbox;
use super::pacing::{Departure, Origin, Priority, SerialQueue, classify};
use super::rates::RateLimits;
use super::sent::SentFrames;
use super::settings::{LinkSettings, Role, Transport};
use crate::channel::{ChannelId, ChannelSet};
use crate::timestamp::Timestamp;
use crate::wire::decoder::Patience;
use crate::wire::encoder::renumber;
use crate::wire::{DatagramFrames, Frame, MAX_FRAME_LEN, StreamDecoder, WireCounters};

/// A stream that is no serial line may hold the rest of a frame back for so long.
const STREAM_PATIENCE: Duration = Duration::from_secs(1);

/// One open conversation.
#[derive(Debug)]
pub struct Channel {
    pub link: LinkIndex,
    pub address: String,
    /// Where reads may cut frames; a datagram needs none.
    pub decoder: Option<StreamDecoder>,
    pub queue: Option<SerialQueue>,
    pub last_heard: Option<Timestamp>,
    sequences: Sequences,
    rates: RateLimits,
}

/// The next sequence number of each of our components on one channel.
#[derive(Debug, Default)]
struct Sequences(Vec<(u8, u8)>);

impl Sequences {
    /// Numbers a frame of ours that is about to leave.
    fn number(&mut self, frame: &mut [u8]) {
        let component = frame[6];
        let at = match self.0.iter().position(|(id, _)| *id == component) {
            Some(at) => at,
            None => {
                self.0.push((component, 0));
                self.0.len() - 1
            }
        };
        let (_, next) = &mut self.0[at];
        renumber(frame, *next);
        *next = next.wrapping_add(1);
    }
}

/// One configured link with its counters.
#[derive(Debug)]
pub struct Link {
    pub settings: LinkSettings,
    pub up: bool,
    pub reason: Option<String>,
    pub rx_frames: u64,
    pub rx_bytes: u64,
    /// Of these, those until a look after the last frame.
    pub rx_bytes_understood: u64,
    /// The frames until that look.
    pub rx_frames_seen: u64,
    /// Since when it is up, while nothing was ever understood on it.
    pub silent_since: Option<Timestamp>,
    pub tx_frames: u64,
    pub tx_bytes: u64,
    /// Of channels that are closed; those of open streams are added when shown.
    pub wire: WireCounters,
    pub dropped: BTreeMap<&'static str, u64>,
}

impl Link {
    fn new(settings: LinkSettings) -> Self {
        Self {
            settings,
            up: false,
            reason: None,
            rx_frames: 0,
            rx_bytes: 0,
            rx_bytes_understood: 0,
            rx_frames_seen: 0,
            silent_since: None,
            tx_frames: 0,
            tx_bytes: 0,
            wire: WireCounters::default(),
            dropped: BTreeMap::new(),
        }
    }

    pub fn count_dropped(&mut self, reason: &'static str) {
        *self.dropped.entry(reason).or_default() += 1;
    }
}

/// All links and their open channels.
#[derive(Debug)]
pub struct Channels {
    links: Vec<Link>,
    channels: Vec<Option<Channel>>,
    open: ChannelSet,
    /// Channels with a decoder that may be waiting for the rest of a frame.
    streams: ChannelSet,
    /// Channels whose output is paced.
    paced: ChannelSet,
    by_role: [ChannelSet; 4],
    /// Channels of links with a `max_rate_hz`.
    limited: ChannelSet,
    sent: SentFrames,
}

impl Channels {
    pub fn new(links: Vec<LinkSettings>) -> Self {
        let mut channels = Vec::new();
        channels.resize_with(ChannelId::COUNT, || None);
        Self {
            links: links.into_iter().map(Link::new).collect(),
            channels,
            open: ChannelSet::EMPTY,
            streams: ChannelSet::EMPTY,
            paced: ChannelSet::EMPTY,
            by_role: [ChannelSet::EMPTY; 4],
            limited: ChannelSet::EMPTY,
            sent: SentFrames::default(),
        }
    }

    pub fn links(&self) -> &[Link] {
        &self.links
    }

    pub fn links_mut(&mut self) -> &mut [Link] {
        &mut self.links
    }

    /// The link of that index, `None` for one that was never configured.
    pub fn link_mut(&mut self, link: LinkIndex) -> Option<&mut Link> {
        self.links.get_mut(link)
    }

    pub fn channel(&self, channel: ChannelId) -> Option<&Channel> {
        self.channels[channel.index()].as_ref()
    }

    pub fn channel_mut(&mut self, channel: ChannelId) -> Option<&mut Channel> {
        self.channels[channel.index()].as_mut()
    }

    /// The link that carries `channel`.
    pub fn link_of(&self, channel: ChannelId) -> Option<(LinkIndex, &Link)> {
        let link = self.channel(channel)?.link;
        Some((link, &self.links[link]))
    }

    pub fn role(&self, channel: ChannelId) -> Option<Role> {
        self.link_of(channel).map(|(_, link)| link.settings.role)
    }

    /// The open channels of links with that role.
    pub fn with_role(&self, role: Role) -> ChannelSet {
        self.by_role[role as usize]
    }

    pub fn open_set(&self) -> ChannelSet {
        self.open
    }

    /// False when there is no such link.
    pub fn open(&mut self, channel: ChannelId, link: LinkIndex, address: &str) -> bool {
        let Some(settings) = self.links.get(link).map(|link| &link.settings) else { return false };
        let (decoder, queue) = match settings.transport {
            Transport::Datagrams => (None, None),
            Transport::Stream => (Some(StreamDecoder::new(Patience::Fixed(STREAM_PATIENCE))), None),
            Transport::Serial { baud } => {
                (Some(StreamDecoder::new(Patience::Serial { baud })), Some(SerialQueue::new(baud)))
            }
        };
        let (role, limited) = (settings.role, !settings.max_rates.is_empty());
        self.close(channel);
        self.open.insert(channel);
        self.by_role[role as usize].insert(channel);
        if decoder.is_some() {
            self.streams.insert(channel);
        }
        if queue.is_some() {
            self.paced.insert(channel);
        }
        if limited {
            self.limited.insert(channel);
        }
        let address = address.to_owned();
        let (sequences, rates) = (Sequences::default(), RateLimits::default());
        let channel_state = Channel { link, address, decoder, queue, last_heard: None, sequences, rates };
        self.channels[channel.index()] = Some(channel_state);
        true
    }

    pub fn close(&mut self, channel: ChannelId) {
        let Some(mut closed) = self.channels[channel.index()].take() else { return };
        for set in
            [&mut self.open, &mut self.streams, &mut self.paced, &mut self.limited].into_iter().chain(&mut self.by_role)
        {
            set.remove(channel);
        }
        let link = &mut self.links[closed.link];
        if let Some(decoder) = &closed.decoder {
            link.wire.add(decoder.counters());
        }
        if let Some(queue) = &mut closed.queue {
            queue.clear();
            for (reason, count) in queue.dropped() {
                *link.dropped.entry(reason).or_default() += count;
            }
        }
    }

    /// R19: takes the channels out of `wanted` that had their share of this message; they are counted.
    pub fn limit_rate(&mut self, now: Timestamp, wanted: ChannelSet, frame: &Frame<'_>) -> ChannelSet {
        let mut admitted = wanted;
        for channel in wanted.intersection(self.limited) {
            if !self.admit(now, channel, frame) {
                self.count_dropped(channel, "max_rate");
                admitted.remove(channel);
            }
        }
        admitted
    }

    fn admit(&mut self, now: Timestamp, channel: ChannelId, frame: &Frame<'_>) -> bool {
        let Some(state) = self.channels[channel.index()].as_mut() else { return true };
        let Some(interval) = self.links[state.link].settings.max_rates.get(&frame.message_id()) else { return true };
        state.rates.admit(now, *interval, frame.message_id(), frame.source())
    }

    /// Keeps a frame of our own until its turn comes, in the place of an older one.
    fn hold(&mut self, channel: ChannelId, frame: &Frame<'_>) {
        let Some(state) = self.channels[channel.index()].as_mut() else { return };
        if state.rates.hold(frame.message_id(), frame.source(), frame.bytes()) {
            self.count_dropped(channel, "max_rate");
        }
    }

    /// From now on nothing is limited in rate, and nothing waits for its turn: the end has come.
    pub fn lift_limits(&mut self) {
        self.forget_held();
        self.limited = ChannelSet::EMPTY;
    }

    /// Forgets what waits for its turn under `max_rate_hz`.
    pub fn forget_held(&mut self) {
        for channel in self.limited {
            if let Some(state) = self.channel_mut(channel) {
                state.rates.forget_held();
            }
        }
    }

    /// Gives out those of our own frames whose turn under `max_rate_hz` has come.
    pub fn release_held(&mut self, now: Timestamp, outbox: &mut Outbox) {
        for channel in self.limited {
            while let Some(bytes) = self.channel_mut(channel).and_then(|state| state.rates.take_due(now)) {
                let mut frames = DatagramFrames::new(&bytes);
                if let Some(frame) = frames.next_frame() {
                    self.transmit_own(now, channel.into(), &frame, outbox);
                }
            }
        }
    }

    /// R12: gives `frame` out on `wanted` byte for byte: at once where the line is not paced, else when it is its turn.
    pub fn transmit(&mut self, now: Timestamp, wanted: ChannelSet, frame: &Frame<'_>, outbox: &mut Outbox) {
        let paced = wanted.intersection(self.paced);
        let direct = wanted.without(self.paced).intersection(self.open);
        for channel in direct {
            self.count_sent(channel, frame.bytes().len());
        }
        outbox.push_frame(direct, frame.bytes());
        for channel in paced {
            self.enqueue(now, channel, frame, Origin::Forwarded, outbox);
        }
    }

    /// Gives a frame of our own out on `wanted`, numbered for each channel; where it comes too soon, when it is its turn. What
    /// steers a gimbal does not come too soon: it may be the word that stops it.
    pub fn transmit_own(&mut self, now: Timestamp, wanted: ChannelSet, frame: &Frame<'_>, outbox: &mut Outbox) {
        let limited = match classify(frame, Origin::Own).0 {
            Priority::OwnControl => ChannelSet::EMPTY,
            Priority::Control | Priority::Addressed | Priority::Broadcast => self.limited,
        };
        for channel in wanted.intersection(self.open) {
            if limited.contains(channel) && !self.admit(now, channel, frame) {
                self.hold(channel, frame);
            } else {
                self.depart(now, channel, frame, outbox);
            }
        }
    }

    /// The same for what somebody asked for, who waits for it: as often as it is asked for.
    pub fn transmit_answer(&mut self, now: Timestamp, wanted: ChannelSet, frame: &Frame<'_>, outbox: &mut Outbox) {
        for channel in wanted.intersection(self.open) {
            self.depart(now, channel, frame, outbox);
        }
    }

    fn depart(&mut self, now: Timestamp, channel: ChannelId, frame: &Frame<'_>, outbox: &mut Outbox) {
        if self.paced.contains(channel) {
            self.enqueue(now, channel, frame, Origin::Own, outbox);
            return;
        }
        let Some(state) = self.channels[channel.index()].as_mut() else { return };
        let mut numbered = [0; MAX_FRAME_LEN];
        let numbered = &mut numbered[..frame.bytes().len()];
        numbered.copy_from_slice(frame.bytes());
        state.sequences.number(numbered);
        self.sent.note(numbered);
        self.count_sent(channel, numbered.len());
        outbox.push_frame(channel.into(), numbered);
    }

    /// Whether we sent exactly these bytes lately.
    pub fn was_sent(&self, frame: &[u8]) -> bool {
        self.sent.contains(frame)
    }

    fn enqueue(&mut self, now: Timestamp, channel: ChannelId, frame: &Frame<'_>, origin: Origin, outbox: &mut Outbox) {
        if let Some(queue) = self.channels[channel.index()].as_mut().and_then(|channel| channel.queue.as_mut()) {
            queue.push(now, frame, origin);
        }
        self.pump(now, channel, outbox);
    }

    /// Gives out what the paced lines have room for.
    pub fn pump_all(&mut self, now: Timestamp, outbox: &mut Outbox) {
        for channel in self.paced {
            self.pump(now, channel, outbox);
        }
    }

    fn pump(&mut self, now: Timestamp, channel: ChannelId, outbox: &mut Outbox) {
        let Some(state) = self.channels[channel.index()].as_mut() else { return };
        let Some(queue) = state.queue.as_mut() else { return };
        let link = &mut self.links[state.link];
        while let Some(Departure { bytes, origin }) = queue.pop(now) {
            if origin == Origin::Own {
                state.sequences.number(bytes);
                self.sent.note(bytes);
            }
            link.tx_frames += 1;
            link.tx_bytes += bytes.len() as u64;
            outbox.push_frame(channel.into(), bytes);
        }
    }

    fn count_sent(&mut self, channel: ChannelId, len: usize) {
        if let Some(link) = self.channels[channel.index()].as_ref().map(|channel| channel.link) {
            let link = &mut self.links[link];
            link.tx_frames += 1;
            link.tx_bytes += len as u64;
        }
    }

    fn count_dropped(&mut self, channel: ChannelId, reason: &'static str) {
        if let Some(link) = self.channels[channel.index()].as_ref().map(|channel| channel.link) {
            self.links[link].count_dropped(reason);
        }
    }

    /// Before the goodbye: of what waits for a paced line only control still goes out.
    pub fn keep_control(&mut self) {
        for channel in self.paced {
            if let Some(queue) = self.channels[channel.index()].as_mut().and_then(|channel| channel.queue.as_mut()) {
                queue.keep_control();
            }
        }
    }

    /// Whether no paced line has a frame left.
    pub fn is_drained(&self) -> bool {
        self.poll_output_timeout().is_none()
    }

    /// When a paced line has room, a frame's turn comes, or a stream's unfinished frame is to be given up.
    pub fn poll_timeout(&self) -> Option<Timestamp> {
        let decoders = self.streams.filter_map(|channel| self.channel(channel)?.decoder.as_ref()?.poll_timeout());
        let held = self.limited.filter_map(|channel| self.channel(channel)?.rates.poll_timeout());
        decoders.chain(held).chain(self.poll_output_timeout()).min()
    }

    /// When a paced line has room.
    pub fn poll_output_timeout(&self) -> Option<Timestamp> {
        self.paced.filter_map(|channel| self.channel(channel)?.queue.as_ref()?.poll_timeout()).min()
    }

    /// Streams whose unfinished frame is to be given up at `now`.
    pub fn stalled(&self, now: Timestamp) -> ChannelSet {
        self.streams
            .filter(|channel| {
                let decoder = self.channel(*channel).and_then(|channel| channel.decoder.as_ref());
                decoder.and_then(StreamDecoder::poll_timeout).is_some_and(|at| at <= now)
            })
            .fold(ChannelSet::EMPTY, |mut set, channel| {
                set.insert(channel);
                set
            })
    }
}
