//! What gimbals ask of the autopilot by `REQUEST_DATA_STREAM` (66), and what passes to them for it.
//!
//! "May ask the vehicle for data with REQUEST_DATA_STREAM: POSITION(6) → GLOBAL_POSITION_INT, EXTRA1(10) → ATTITUDE"
//! (ArduPilot's contract for MAVLink gimbals). The request goes on to the autopilot as it came; what the autopilot then
//! says to all passes to that gimbal's link, where nothing else of the kind does (D14), as often as was asked.

use std::time::Duration;

use crate::channel::{ChannelId, ChannelSet};
use crate::timestamp::Timestamp;
use crate::wire::dialect::REQUEST_DATA_STREAM_DATA;
use crate::wire::ids::{mav_data_stream, message};

/// A gimbal is told no more often, however much it asks for.
const MOST_HZ: u16 = 50;

/// What each gimbal's channel has asked for.
#[derive(Debug, Default)]
pub struct GimbalStreams {
    /// One for each channel and message, so at most twice as many as there are channels.
    entries: Vec<Entry>,
}

#[derive(Clone, Copy, Debug)]
struct Entry {
    channel: ChannelId,
    message_id: u32,
    interval: Duration,
    /// When the next one is due.
    next: Timestamp,
}

impl GimbalStreams {
    /// A gimbal on `channel` asks the autopilot for a stream, or for its end.
    pub fn handle_request(&mut self, now: Timestamp, channel: ChannelId, request: &REQUEST_DATA_STREAM_DATA) {
        let message_ids: &[u32] = match request.req_stream_id {
            mav_data_stream::ALL => &[message::ATTITUDE, message::GLOBAL_POSITION_INT],
            mav_data_stream::POSITION => &[message::GLOBAL_POSITION_INT],
            mav_data_stream::EXTRA1 => &[message::ATTITUDE],
            _ => return,
        };
        let rate_hz = request.req_message_rate.min(MOST_HZ);
        let starts = request.start_stop == 1 && rate_hz > 0;
        for &message_id in message_ids {
            let known =
                self.entries.iter().position(|entry| (entry.channel, entry.message_id) == (channel, message_id));
            if !starts {
                if let Some(at) = known {
                    self.entries.swap_remove(at);
                }
                continue;
            }
            let interval = Duration::from_secs(1) / u32::from(rate_hz);
            match known {
                Some(at) => self.entries[at].interval = interval,
                None => self.entries.push(Entry { channel, message_id, interval, next: now }),
            }
        }
    }

    pub fn close_channel(&mut self, channel: ChannelId) {
        self.entries.retain(|entry| entry.channel != channel);
    }

    /// Which of `gimbals` get this one of the autopilot's messages: those that asked for it and whose turn it is. One that
    /// comes a little early has its turn, or at the rate that was asked every other would be lost.
    pub fn admit(&mut self, now: Timestamp, message_id: u32, gimbals: ChannelSet) -> ChannelSet {
        let mut admitted = ChannelSet::EMPTY;
        for entry in &mut self.entries {
            let is_due = entry.next <= now + entry.interval / 5;
            if entry.message_id != message_id || !gimbals.contains(entry.channel) || !is_due {
                continue;
            }
            admitted.insert(entry.channel);
            let is_late = now.since(entry.next) > entry.interval / 2;
            entry.next = if is_late { now } else { entry.next } + entry.interval;
        }
        admitted
    }

    /// How often the message is wanted at least by any of them.
    pub fn wanted(&self, message_id: u32) -> Option<Duration> {
        self.entries.iter().filter(|entry| entry.message_id == message_id).map(|entry| entry.interval).min()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// However often the message comes, and however irregularly, the gimbal has it about as often as it asked.
    #[test]
    fn a_gimbal_gets_a_message_as_often_as_it_asked() {
        let channel = ChannelId::new(3).expect("below the bound");
        for (rate_hz, every_ms, jitter_ms, expected) in [
            (10, 100, 0, 90..=110),
            (10, 100, 18, 90..=110),
            (10, 20, 5, 90..=110),
            (10, 83, 0, 90..=110),
            (10, 250, 0, 39..=41),
            (2, 100, 20, 18..=22),
            (1_000, 5, 0, 480..=510),
        ] {
            let mut streams = GimbalStreams::default();
            streams.handle_request(Timestamp::ZERO, channel, &request(mav_data_stream::EXTRA1, rate_hz, 1));
            let times = (1..).map(|turn: u64| turn * every_ms + if turn.is_multiple_of(2) { jitter_ms } else { 0 });
            let admitted = times
                .take_while(|at| *at <= 10_000)
                .filter(|at| !streams.admit(Timestamp::from_millis(*at), message::ATTITUDE, channel.into()).is_empty());
            assert!(expected.contains(&admitted.count()), "{rate_hz} Hz of one every {every_ms} ms");
        }
    }

    #[test]
    fn each_channel_has_what_it_asked_for_until_it_asks_for_the_end() {
        let [one, other] = [1, 2].map(|index| ChannelId::new(index).expect("below the bound"));
        let both = ChannelSet::from(one).union(other.into());
        let mut streams = GimbalStreams::default();
        let admit = |streams: &mut GimbalStreams, millis, id| streams.admit(Timestamp::from_millis(millis), id, both);
        assert_eq!(admit(&mut streams, 0, message::ATTITUDE), ChannelSet::EMPTY);
        streams.handle_request(Timestamp::ZERO, one, &request(mav_data_stream::POSITION, 2, 1));
        streams.handle_request(Timestamp::ZERO, other, &request(mav_data_stream::ALL, 4, 1));
        streams.handle_request(Timestamp::ZERO, one, &request(11, 4, 1));
        assert_eq!(admit(&mut streams, 1_000, message::ATTITUDE), other.into());
        assert_eq!(admit(&mut streams, 1_000, message::GLOBAL_POSITION_INT), both);
        assert_eq!(admit(&mut streams, 1_000, message::SYS_STATUS), ChannelSet::EMPTY);
        assert_eq!(streams.wanted(message::GLOBAL_POSITION_INT), Some(Duration::from_millis(250)));

        streams.handle_request(Timestamp::ZERO, other, &request(mav_data_stream::ALL, 4, 0));
        assert_eq!(admit(&mut streams, 2_000, message::GLOBAL_POSITION_INT), one.into());
        streams.handle_request(Timestamp::ZERO, one, &request(mav_data_stream::POSITION, 0, 1));
        assert_eq!(admit(&mut streams, 3_000, message::GLOBAL_POSITION_INT), ChannelSet::EMPTY);
        streams.handle_request(Timestamp::ZERO, one, &request(mav_data_stream::POSITION, 2, 1));
        streams.close_channel(one);
        assert_eq!(streams.wanted(message::GLOBAL_POSITION_INT), None);
    }

    fn request(req_stream_id: u8, req_message_rate: u16, start_stop: u8) -> REQUEST_DATA_STREAM_DATA {
        REQUEST_DATA_STREAM_DATA { req_message_rate, target_system: 1, target_component: 1, req_stream_id, start_stop }
    }
}
