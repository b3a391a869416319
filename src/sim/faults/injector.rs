//! A peer seen through its faults.

use std::collections::{BTreeMap, VecDeque};
use std::time::Duration;

use super::{Faults, Window, rewrite};
use crate::sim::peer::{Peer, PlatformMotion};
use crate::sim::random::Random;
use crate::timestamp::Timestamp;
use crate::wire::ids::message;

/// How long a frame is held at most, to be overtaken or joined with the next.
const HOLD: Duration = Duration::from_millis(100);

/// Between the two pieces of a split frame.
const SPLIT_GAP: Duration = Duration::from_millis(2);

/// Pieces on their way; what is sent beyond them is lost.
const CAPACITY: usize = 4096;

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Event {
    PowerOff,
    /// Power comes back, or the peer restarts by itself.
    Boot,
    ClockJump(i64),
}

/// Does what [`Faults`] say to what the peer `P` sends.
#[derive(Debug)]
pub struct FaultyPeer<P> {
    peer: P,
    faults: Faults,
    random: Random,
    now: Timestamp,
    /// To come, in order of time.
    events: VecDeque<(Timestamp, Event)>,
    powered: bool,
    clock_shift_ms: i64,
    sequence_shift: u8,
    /// Frames that wait for the next one, and until when.
    held: Option<(Timestamp, Vec<u8>)>,
    /// By the time they leave, then by the order in which they came.
    on_the_way: BTreeMap<(Timestamp, u64), Vec<u8>>,
    count: u64,
    last_release: Timestamp,
}

impl<P: Peer> FaultyPeer<P> {
    pub fn new(peer: P, faults: Faults) -> Self {
        let cuts = faults.power_cuts.iter().flat_map(|cut| [(cut.from, Event::PowerOff), (cut.until, Event::Boot)]);
        let reboots = faults.reboots.iter().map(|at| (*at, Event::Boot));
        let jumps = faults.clock_jumps.iter().map(|jump| (jump.at, Event::ClockJump(jump.by_ms)));
        let mut events: Vec<_> = cuts.chain(reboots).chain(jumps).collect();
        events.sort_unstable();
        Self {
            peer,
            random: Random::new(faults.seed),
            faults,
            now: Timestamp::ZERO,
            events: events.into(),
            powered: true,
            clock_shift_ms: 0,
            sequence_shift: 0,
            held: None,
            on_the_way: BTreeMap::new(),
            count: 0,
            last_release: Timestamp::ZERO,
        }
    }

    pub fn peer(&self) -> &P {
        &self.peer
    }

    fn advance(&mut self, now: Timestamp) {
        self.now = now;
        while let Some((at, event)) = self.events.front().copied()
            && at <= now
        {
            self.events.pop_front();
            match event {
                Event::PowerOff => {
                    self.powered = false;
                    self.forget();
                }
                Event::Boot => {
                    self.powered = true;
                    self.clock_shift_ms = 0;
                    self.forget();
                    self.peer.handle_reboot(now);
                }
                Event::ClockJump(by_ms) => self.clock_shift_ms += by_ms,
            }
        }
    }

    fn forget(&mut self) {
        self.held = None;
        self.on_the_way.clear();
    }

    /// Takes what the peer has to say after an input.
    fn collect(&mut self) {
        while let Some(frame) = self.peer.poll_output() {
            if self.powered && !any_contains(&self.faults.silences, self.now) {
                self.pass(frame);
            }
        }
        if let Some((_, frames)) = self.held.take_if(|(until, _)| *until <= self.now) {
            self.release(frames, Duration::ZERO, false);
        }
    }

    fn pass(&mut self, mut frame: Vec<u8>) {
        let is_ack = rewrite::message_id(&frame) == Some(message::COMMAND_ACK);
        if self.random.chance(self.faults.drop) || (is_ack && self.random.chance(self.faults.ack_loss)) {
            return;
        }
        if is_ack && self.random.chance(self.faults.ack_target) {
            rewrite::redirect_ack(&mut frame);
        }
        if self.clock_shift_ms != 0 {
            rewrite::shift_clock(&mut frame, self.clock_shift_ms);
        }
        if self.random.chance(self.faults.nan) {
            rewrite::put_nan(&mut frame, &mut self.random);
        }
        if self.random.chance(self.faults.sequence_gap) {
            self.sequence_shift = self.sequence_shift.wrapping_add(1 + self.random.below(10) as u8);
        }
        if self.sequence_shift != 0 {
            rewrite::shift_sequence(&mut frame, self.sequence_shift);
        }
        let extra_delay = match rewrite::message_id(&frame) {
            Some(message::COMMAND_ACK) => self.faults.ack_delay,
            Some(message::PARAM_VALUE) => self.faults.slow_parameters,
            _ => Duration::ZERO,
        };
        if self.random.chance(self.faults.foreign) {
            self.put_on_the_line(rewrite::foreign_heartbeat(), Duration::ZERO);
        }
        if self.random.chance(self.faults.twin) {
            self.put_on_the_line(rewrite::attitude_of_twin(&frame, self.now), Duration::ZERO);
        }
        if self.random.chance(self.faults.duplicate) {
            self.put_on_the_line(frame.clone(), extra_delay);
        }
        self.put_on_the_line(frame, extra_delay);
    }

    fn put_on_the_line(&mut self, mut bytes: Vec<u8>, extra_delay: Duration) {
        if self.random.chance(self.faults.corrupt) {
            let at = self.random.below(bytes.len());
            bytes[at] ^= 1 << self.random.below(8);
        }
        if self.random.chance(self.faults.truncate) {
            bytes.truncate(1 + self.random.below(bytes.len() - 1));
        }
        if self.random.chance(self.faults.garbage) {
            let len = 1 + self.random.below(32);
            bytes.splice(0..0, std::iter::repeat_with(|| self.random.byte()).take(len));
        }
        if any_contains(&self.faults.baud_mismatches, self.now) {
            bytes.fill_with(|| self.random.byte());
        }
        if self.random.chance(self.faults.merge) {
            let (_, held) = self.held.get_or_insert_with(|| (self.now + HOLD, Vec::new()));
            held.extend(bytes);
            return;
        }
        if let Some((_, mut held)) = self.held.take() {
            held.extend(bytes);
            bytes = held;
        }
        let overtaken = self.random.chance(self.faults.reorder);
        let hold = if overtaken { HOLD.mul_f64(self.random.unit()) } else { Duration::ZERO };
        let late = overtaken || !extra_delay.is_zero();
        if bytes.len() > 1 && self.random.chance(self.faults.split) {
            let rest = bytes.split_off(1 + self.random.below(bytes.len() - 1));
            self.release(bytes, extra_delay + hold, late);
            self.release(rest, extra_delay + hold + SPLIT_GAP, late);
        } else {
            self.release(bytes, extra_delay + hold, late);
        }
    }

    /// Lets `bytes` leave after the usual delay and `extra`; those that come `late` are overtaken by others.
    fn release(&mut self, bytes: Vec<u8>, extra: Duration, late: bool) {
        if self.on_the_way.len() == CAPACITY {
            return;
        }
        let jitter =
            if self.faults.jitter.is_zero() { Duration::ZERO } else { self.faults.jitter.mul_f64(self.random.unit()) };
        let mut at = self.now + self.faults.delay + jitter + extra;
        if !late {
            at = at.max(self.last_release);
            self.last_release = at;
        }
        self.on_the_way.insert((at, self.count), bytes);
        self.count += 1;
    }
}

fn any_contains(windows: &[Window], now: Timestamp) -> bool {
    windows.iter().any(|window| window.contains(now))
}

impl<P: Peer> Peer for FaultyPeer<P> {
    fn handle_received(&mut self, now: Timestamp, bytes: &[u8]) {
        self.advance(now);
        if self.powered && !self.random.chance(self.faults.deaf) {
            self.peer.handle_received(now, bytes);
        }
        self.collect();
    }

    fn handle_timeout(&mut self, now: Timestamp) {
        self.advance(now);
        if self.powered {
            self.peer.handle_timeout(now);
        }
        self.collect();
    }

    fn poll_output(&mut self) -> Option<Vec<u8>> {
        let entry = self.on_the_way.first_entry()?;
        (entry.key().0 <= self.now).then(|| entry.remove())
    }

    fn poll_timeout(&self) -> Option<Timestamp> {
        let peer = if self.powered { self.peer.poll_timeout() } else { None };
        let event = self.events.front().map(|(at, _)| *at);
        let held = self.held.as_ref().map(|(until, _)| *until);
        let next = self.on_the_way.first_key_value().map(|((at, _), _)| *at);
        [peer, event, held, next].into_iter().flatten().min()
    }

    fn handle_reboot(&mut self, now: Timestamp) {
        self.advance(now);
        self.forget();
        self.peer.handle_reboot(now);
        self.collect();
    }

    fn handle_disturbance(&mut self, now: Timestamp, motion: PlatformMotion) {
        self.advance(now);
        if self.powered {
            self.peer.handle_disturbance(now, motion);
        }
        self.collect();
    }
}

#[cfg(test)]
mod tests;
