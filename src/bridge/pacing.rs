//! R20: the output of a serial line: whole frames at the speed of the wire, control first, ours before others', nothing
//! stale.
//!
//! The kernel's buffer would hold a second of frames that nobody can recall. So a frame is given out only when the one
//! before it has left the wire, and waits here until then, where a newer setpoint can take its place.

use std::collections::{BTreeMap, VecDeque};
use std::time::Duration;

use crate::timestamp::Timestamp;
use crate::wire::ids::{command, message};
use crate::wire::{Frame, MAX_FRAME_LEN, MavId, Target};

/// How soon a frame is due on the wire.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Priority {
    /// Our own commands and setpoints: what stops a gimbal waits for nobody who floods the line.
    OwnControl,
    /// Others' commands and setpoints, and answers to commands.
    Control,
    /// What is addressed to somebody, and the state that a gimbal needs to stabilise.
    Addressed,
    /// Telemetry for everybody.
    Broadcast,
}

/// Frames with the same key say the same thing at different times: only the newest is worth sending.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ReplaceKey {
    message_id: u32,
    source: MavId,
    target: Target,
}

/// How soon `frame` is due, and whether a newer one takes its place.
pub fn classify(frame: &Frame<'_>, origin: Origin) -> (Priority, Option<ReplaceKey>) {
    let demand = if origin == Origin::Own { Priority::OwnControl } else { Priority::Control };
    let key = || Some(ReplaceKey { message_id: frame.message_id(), source: frame.source(), target: frame.target() });
    match frame.message_id() {
        message::COMMAND_INT | message::COMMAND_LONG => match setpoint_command(frame) {
            true => (demand, key()),
            false => (demand, None),
        },
        message::COMMAND_ACK => (Priority::Control, None),
        message::COMMAND_CANCEL => (demand, None),
        message::GIMBAL_MANAGER_SET_ATTITUDE
        | message::GIMBAL_DEVICE_SET_ATTITUDE
        | message::GIMBAL_MANAGER_SET_PITCHYAW
        | message::GIMBAL_MANAGER_SET_MANUAL_CONTROL
        | message::MANUAL_CONTROL
        | message::MOUNT_CONTROL => (demand, key()),
        message::AUTOPILOT_STATE_FOR_GIMBAL_DEVICE
        | message::HEARTBEAT
        | message::GIMBAL_MANAGER_STATUS
        | message::SYSTEM_TIME => (Priority::Addressed, key()),
        message::TIMESYNC => (Priority::Addressed, None),
        _ if frame.target() == Target::Everyone => (Priority::Broadcast, None),
        _ => (Priority::Addressed, None),
    }
}

/// `DO_MOUNT_CONTROL` is streamed like a setpoint by ArduPilot; other commands are each meant.
fn setpoint_command(frame: &Frame<'_>) -> bool {
    let number = frame.payload().get(28..30).map(|bytes| u16::from_le_bytes([bytes[0], bytes[1]]));
    number == Some(command::DO_MOUNT_CONTROL)
}

/// Why a queued frame was not sent.
pub const REPLACED: &str = "replaced_by_newer";
pub const QUEUE_FULL: &str = "queue_full";
pub const STALE: &str = "stale";
pub const LINK_DOWN: &str = "link_down";
pub const SHUTTING_DOWN: &str = "shutting_down";

/// Telemetry waits at most so long; what is older by the time the wire is free has been overtaken by the next.
pub const MAX_BROADCAST_AGE: Duration = Duration::from_millis(300);

/// What is addressed to somebody waits at most so long: its sender repeats it after about that time.
pub const MAX_ADDRESSED_AGE: Duration = Duration::from_millis(1_000);

/// A command that is older was given up by its sender, or sent again.
pub const MAX_CONTROL_AGE: Duration = Duration::from_millis(2_000);

const SLOTS: usize = 128;

const PRIORITIES: usize = 4;

/// So many frames of each priority wait at most; control may take the room of the others.
const MAX_WAITING: [usize; PRIORITIES] = [32, SLOTS, 42, 42];

/// Others' control may take so many slots from what is addressed.
const CONTROL_SHARE: usize = 96;

const MAX_AGES: [Duration; PRIORITIES] = [MAX_CONTROL_AGE, MAX_CONTROL_AGE, MAX_ADDRESSED_AGE, MAX_BROADCAST_AGE];

/// So many frames of our own control, and so many of others', leave in a row at most while one of the next priority
/// waits: commands of others have a share of the line beside ours, and leave one to the state that a gimbal needs.
const MAX_IN_A_ROW: [u8; 2] = [4, 8];

/// A frame may be given out this much before the wire is free, so that a late wake-up leaves no gap on it.
const LEAD: Duration = Duration::from_micros(800);

/// We fill 96 % of the wire: crystals differ by a per cent or two, and a line driven faster than it drains would
/// build up the very queue in the kernel that pacing is there to avoid.
const FILL: f64 = 0.96;

/// The frames waiting for one serial line.
#[derive(Debug)]
pub struct SerialQueue {
    nanos_per_byte: u64,
    line_free_at: Timestamp,
    slots: Vec<Slot>,
    free: Vec<u8>,
    waiting: [VecDeque<u8>; PRIORITIES],
    /// How many frames of each control have left since one of the next priority has waited.
    in_a_row: [u8; MAX_IN_A_ROW.len()],
    dropped: BTreeMap<&'static str, u64>,
}

#[derive(Clone, Debug)]
struct Slot {
    bytes: [u8; MAX_FRAME_LEN],
    len: usize,
    key: Option<ReplaceKey>,
    origin: Origin,
    queued_at: Timestamp,
}

/// Whose frame it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Origin {
    /// Somebody else's, to be sent as it came.
    Forwarded,
    /// Ours. It is numbered when it leaves: those it overtakes, and those that give way to newer ones, must leave no
    /// gap in the numbers.
    Own,
}

/// A frame whose turn it is.
#[derive(Debug)]
pub struct Departure<'a> {
    pub bytes: &'a mut [u8],
    pub origin: Origin,
}

impl SerialQueue {
    /// `baud` in bits per second, ten bits to the byte.
    pub fn new(baud: u32) -> Self {
        let (origin, queued_at) = (Origin::Forwarded, Timestamp::ZERO);
        let empty = Slot { bytes: [0; MAX_FRAME_LEN], len: 0, key: None, origin, queued_at };
        Self {
            nanos_per_byte: (1e10 / (f64::from(baud.max(1)) * FILL)) as u64,
            line_free_at: Timestamp::ZERO,
            slots: vec![empty; SLOTS],
            free: (0..SLOTS as u8).rev().collect(),
            waiting: Default::default(),
            in_a_row: [0; MAX_IN_A_ROW.len()],
            dropped: BTreeMap::new(),
        }
    }

    pub fn push(&mut self, now: Timestamp, frame: &Frame<'_>, origin: Origin) {
        let (priority, key) = classify(frame, origin);
        let queue = priority as usize;
        let same = |slot: &u8| key.is_some() && self.slots[usize::from(*slot)].key == key;
        if let Some(slot) = self.waiting[queue].iter().copied().find(same) {
            self.count(REPLACED);
            self.fill(slot, now, frame, key, origin);
            return;
        }
        if self.waiting[queue].len() >= MAX_WAITING[queue] {
            self.drop_oldest(queue);
        } else if self.free.is_empty() {
            self.drop_oldest(self.first_to_give_way());
        }
        let slot = self.free.pop().expect("one was free or has just become so");
        self.fill(slot, now, frame, key, origin);
        self.waiting[queue].push_back(slot);
    }

    /// The next frame, if the wire is free for one.
    pub fn pop(&mut self, now: Timestamp) -> Option<Departure<'_>> {
        if self.line_free_at > now + LEAD {
            return None;
        }
        let slot = self.next_fresh(now)?;
        self.free.push(slot);
        let slot = &mut self.slots[usize::from(slot)];
        let wire_time = Duration::from_nanos(self.nanos_per_byte * slot.len as u64);
        self.line_free_at = self.line_free_at.max(now) + wire_time;
        Some(Departure { bytes: &mut slot.bytes[..slot.len], origin: slot.origin })
    }

    /// When [`pop`](Self::pop) will have a frame, `None` when nothing waits.
    pub fn poll_timeout(&self) -> Option<Timestamp> {
        let waits = self.waiting.iter().any(|queue| !queue.is_empty());
        waits.then(|| Timestamp::from_micros(self.line_free_at.as_micros().saturating_sub(LEAD.as_micros() as u64)))
    }

    /// The port was closed: nothing that waits may be sent on another day.
    pub fn clear(&mut self) {
        for queue in 0..self.waiting.len() {
            while let Some(slot) = self.waiting[queue].pop_front() {
                self.count(LINK_DOWN);
                self.free.push(slot);
            }
        }
        self.line_free_at = Timestamp::ZERO;
    }

    /// The end is near: only control still goes out.
    pub fn keep_control(&mut self) {
        for queue in Priority::Addressed as usize..self.waiting.len() {
            while let Some(slot) = self.waiting[queue].pop_front() {
                self.count(SHUTTING_DOWN);
                self.free.push(slot);
            }
        }
    }

    /// How many frames were not sent, by reason.
    pub fn dropped(&self) -> &BTreeMap<&'static str, u64> {
        &self.dropped
    }

    fn next_fresh(&mut self, now: Timestamp) -> Option<u8> {
        while let Some(queue) = self.next_queue() {
            let slot = self.waiting[queue].pop_front()?;
            if now.since(self.slots[usize::from(slot)].queued_at) <= MAX_AGES[queue] {
                self.note_departure(queue);
                return Some(slot);
            }
            self.count(STALE);
            self.free.push(slot);
        }
        None
    }

    /// The most urgent of those that wait, unless it has had its run and the next is to have a turn.
    fn next_queue(&self) -> Option<usize> {
        let mut queue = self.waiting.iter().position(|queue| !queue.is_empty())?;
        while MAX_IN_A_ROW.get(queue).is_some_and(|most| self.in_a_row[queue] >= *most) && self.next_waits(queue) {
            queue += 1;
        }
        Some(queue)
    }

    fn next_waits(&self, queue: usize) -> bool {
        self.waiting.get(queue + 1).is_some_and(|next| !next.is_empty())
    }

    fn note_departure(&mut self, queue: usize) {
        let next_waits = self.next_waits(queue);
        let more_urgent = queue.min(self.in_a_row.len());
        self.in_a_row[..more_urgent].fill(0);
        if let Some(count) = self.in_a_row.get_mut(queue) {
            *count = if next_waits { *count + 1 } else { 0 };
        }
    }

    /// In which queue room is made when all slots are taken: in the least urgent, but a flood of others' commands makes it
    /// in itself before it takes all from what is addressed.
    fn first_to_give_way(&self) -> usize {
        let [_, control, _, broadcast] = &self.waiting;
        if broadcast.is_empty() && control.len() > CONTROL_SHARE {
            return Priority::Control as usize;
        }
        let least_urgent = self.waiting.iter().rposition(|queue| !queue.is_empty());
        least_urgent.expect("the slots that are not free wait in some queue")
    }

    /// Makes room by what is others' and was not about to be replaced; what is ours gives way to nothing of others'.
    fn drop_oldest(&mut self, queue: usize) {
        let waiting = &self.waiting[queue];
        let slot = |slot: &u8| &self.slots[usize::from(*slot)];
        let others = |at: &u8| slot(at).origin == Origin::Forwarded;
        let oldest = waiting.iter().position(|at| others(at) && slot(at).key.is_none());
        let oldest = oldest.or_else(|| waiting.iter().position(others)).unwrap_or(0);
        if let Some(oldest) = self.waiting[queue].remove(oldest) {
            self.count(QUEUE_FULL);
            self.free.push(oldest);
        }
    }

    fn fill(&mut self, slot: u8, now: Timestamp, frame: &Frame<'_>, key: Option<ReplaceKey>, origin: Origin) {
        let slot = &mut self.slots[usize::from(slot)];
        let bytes = frame.bytes();
        slot.bytes[..bytes.len()].copy_from_slice(bytes);
        slot.len = bytes.len();
        slot.key = key;
        slot.origin = origin;
        slot.queued_at = now;
    }

    fn count(&mut self, reason: &'static str) {
        *self.dropped.entry(reason).or_default() += 1;
    }
}

#[cfg(test)]
mod tests;
