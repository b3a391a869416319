//! Which ground stations speak, and whether two do under one id.
//!
//! 255/190 is what most ground stations call themselves. Two of them cannot be told apart, not even as holders of a
//! gimbal: the messages name them by their ids only.

use std::time::Duration;

use crate::channel::ChannelId;
use crate::timestamp::Timestamp;
use crate::wire::MavId;

/// A station silent on one channel for so long has left it.
const LEFT_AFTER: Duration = Duration::from_secs(5);

const MAX_STATIONS: usize = 64;

/// Where each ground station was heard.
#[derive(Debug, Default)]
pub struct Stations {
    known: Vec<Station>,
}

#[derive(Clone, Copy, Debug)]
struct Station {
    id: MavId,
    channel: ChannelId,
    heard: Timestamp,
    /// The number of the heartbeat heard last there. One that has it elsewhere has come by two ways.
    sequence: u8,
    /// Where it was heard since.
    elsewhere: Option<ChannelId>,
}

impl Stations {
    /// A ground station beat on `channel`; the other channel on which it was heard while it was on this one.
    pub fn handle_heartbeat(
        &mut self,
        now: Timestamp,
        id: MavId,
        channel: ChannelId,
        sequence: u8,
    ) -> Option<ChannelId> {
        let Some(station) = self.known.iter_mut().find(|station| station.id == id) else {
            self.make_room();
            self.known.push(Station { id, channel, heard: now, sequence, elsewhere: None });
            return None;
        };
        if station.channel == channel {
            (station.heard, station.sequence) = (now, sequence);
            return station.elsewhere.take();
        }
        if now.since(station.heard) >= LEFT_AFTER {
            *station = Station { id, channel, heard: now, sequence, elsewhere: None };
        } else if station.sequence != sequence {
            station.elsewhere = Some(channel);
        }
        None
    }

    fn make_room(&mut self) {
        if self.known.len() < MAX_STATIONS {
            return;
        }
        if let Some(at) = (0..self.known.len()).min_by_key(|at| self.known[*at].heard) {
            self.known.swap_remove(at);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STATION: MavId = MavId::new(255, 190);

    /// A station that was restarted speaks from another port; it is not two.
    #[test]
    fn a_station_that_moved_is_one() {
        let mut stations = Stations::default();
        let on = |channel| ChannelId::new(channel).expect("below the bound");
        let mut beat = |second, channel| {
            // Each connection of a station has numbers of its own.
            let sequence = second as u8 + 100 * channel as u8;
            stations.handle_heartbeat(Timestamp::from_secs(second), STATION, on(channel), sequence)
        };
        for second in 0..10 {
            assert_eq!(beat(second, 0), None);
        }
        for second in 10..30 {
            assert_eq!(beat(second, 1), None);
        }
        assert_eq!(beat(30, 0), None);
        assert_eq!(beat(30, 1), Some(on(0)), "now both speak");
    }

    /// Somebody who sends back what he hears is no second station.
    #[test]
    fn an_echo_is_no_station() {
        let mut stations = Stations::default();
        let on = |channel| ChannelId::new(channel).expect("below the bound");
        for second in 0..10 {
            for channel in [0, 1] {
                let heard = stations.handle_heartbeat(Timestamp::from_secs(second), STATION, on(channel), second as u8);
                assert_eq!(heard, None);
            }
        }
    }
}
