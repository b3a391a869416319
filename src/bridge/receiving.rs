//! From bytes to frames: a datagram is whole, a stream goes through its channel's decoder.

use super::Bridge;
use crate::channel::ChannelId;
use crate::timestamp::Timestamp;
use crate::wire::{DatagramFrames, StreamDecoder};

impl Bridge {
    pub(super) fn handle_received(&mut self, now: Timestamp, channel: ChannelId, bytes: &[u8]) {
        let Some(state) = self.channels.channel_mut(channel) else { return };
        state.last_heard = Some(now);
        let (link, is_stream) = (state.link, state.decoder.is_some());
        if let Some(link) = self.channels.link_mut(link) {
            link.rx_bytes += bytes.len() as u64;
        }
        if is_stream {
            self.decode_stream(now, channel, |decoder| decoder.push(now, bytes));
            return;
        }
        let mut frames = DatagramFrames::new(bytes);
        while let Some(frame) = frames.next_frame() {
            self.handle_frame(now, channel, &frame);
        }
        if let Some(link) = self.channels.link_mut(link) {
            link.rx_frames += frames.counters().frames;
            link.wire.add(frames.counters());
        }
    }

    pub(super) fn decode_stream(&mut self, now: Timestamp, channel: ChannelId, feed: impl FnOnce(&mut StreamDecoder)) {
        // The decoder is taken out while its frames are dealt with, and put back behind them.
        let Some(state) = self.channels.channel_mut(channel) else { return };
        let link = state.link;
        let Some(mut decoder) = state.decoder.take() else { return };
        feed(&mut decoder);
        let mut frames = 0;
        while let Some(frame) = decoder.next_frame() {
            frames += 1;
            self.handle_frame(now, channel, &frame);
        }
        if let Some(state) = self.channels.channel_mut(channel) {
            state.decoder = Some(decoder);
        }
        if let Some(link) = self.channels.link_mut(link) {
            link.rx_frames += frames;
        }
    }
}
