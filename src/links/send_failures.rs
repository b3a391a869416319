//! Frames that a link dropped, until it can say so.

use super::inbox::{Inbox, PEERS, PeerIndex};

/// Per peer, how many frames were dropped since the last report, and why the last one was.
#[derive(Debug, Default)]
pub struct SendFailures {
    peers: [(u32, &'static str); PEERS],
    any: bool,
}

impl SendFailures {
    pub fn note(&mut self, peer: PeerIndex, frames: u32, reason: &'static str) {
        if frames > 0 {
            let (count, last_reason) = &mut self.peers[peer];
            *count = count.saturating_add(frames);
            *last_reason = reason;
            self.any = true;
        }
    }

    pub fn report(&mut self, inbox: &mut Inbox) {
        if !std::mem::take(&mut self.any) {
            return;
        }
        for (peer, entry) in self.peers.iter_mut().enumerate() {
            let (frames, reason) = std::mem::take(entry);
            inbox.send_failed(peer, frames, reason);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::inbox::Event;
    use super::*;

    #[test]
    fn failures_are_told_once_per_peer() {
        let mut inbox = Inbox::default();
        let mut failures = SendFailures::default();
        failures.note(2, 1, "first");
        failures.note(2, 2, "second");
        failures.note(5, 0, "nothing");

        failures.report(&mut inbox);
        failures.report(&mut inbox);

        let events: Vec<_> = (0..inbox.len()).map(|index| inbox.event(index)).collect();
        assert_eq!(events, [Event::SendFailed { peer: 2, frames: 3, reason: "second" }]);
    }
}
