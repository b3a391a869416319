//! Serial lines on which bytes come, and no MAVLink, or to a gimbal, and nothing at all.

use std::time::Duration;

use super::Bridge;
use super::conflicts::Conflict;
use super::settings::{Role, Transport};
use crate::timestamp::Timestamp;

/// So many without a frame are more than the longest one has: even a gimbal that only beats would have been understood.
const BYTES: u64 = 300;

/// "If nothing in 10 s": a gimbal that waits for a heartbeat has understood one by then, if it can.
const SILENCE: Duration = Duration::from_secs(10);

impl Bridge {
    /// Names serial lines on which nothing is understood, as at a wrong baud rate, and those on which a gimbal is missed and
    /// nothing ever came: one that waits for a heartbeat is silent at a wrong baud rate.
    pub(super) fn look_for_noise(&mut self, now: Timestamp) {
        let gimbals = &self.roster;
        let misses = |link| {
            let mut shown = gimbals.iter().filter(|gimbal| gimbal.is_shown()).peekable();
            shown.peek().is_none() || shown.any(|gimbal| gimbal.manager.device().is_none() && gimbal.may_be_on(link))
        };
        for (index, link) in self.channels.links_mut().iter_mut().enumerate() {
            let Transport::Serial { baud } = link.settings.transport else { continue };
            let is_silent = link.up && link.rx_frames == 0 && link.rx_bytes < BYTES;
            link.silent_since = is_silent.then(|| link.silent_since.unwrap_or(now));
            if link.settings.role == Role::Gimbal {
                let silence = Conflict::SilentLine { link: index, baud };
                if misses(index) && link.silent_since.is_some_and(|since| now.since(since) >= SILENCE) {
                    self.conflicts.note(now, silence);
                } else {
                    self.conflicts.end(silence);
                }
            }
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
