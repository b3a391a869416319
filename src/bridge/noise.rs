//! Serial lines on which bytes come, and no MAVLink.

use super::Bridge;
use super::conflicts::Conflict;
use super::settings::Transport;
use crate::timestamp::Timestamp;

/// So many without a frame are more than the longest one has: even a gimbal that only beats would have been understood.
const BYTES: u64 = 300;

impl Bridge {
    /// Names serial lines on which nothing is understood, as at a wrong baud rate.
    pub(super) fn look_for_noise(&mut self, now: Timestamp) {
        for (index, link) in self.channels.links_mut().iter_mut().enumerate() {
            let Transport::Serial { baud } = link.settings.transport else { continue };
            if link.rx_frames != link.rx_frames_seen {
                link.rx_frames_seen = link.rx_frames;
                link.rx_bytes_understood = link.rx_bytes;
            } else if link.rx_bytes - link.rx_bytes_understood >= BYTES {
                // Until so many come again.
                link.rx_bytes_understood = link.rx_bytes;
                self.conflicts.note(now, Conflict::NotMavlink { link: index, baud });
            }
        }
    }
}
