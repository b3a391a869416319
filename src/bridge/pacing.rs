//! R20: the output of a serial line: whole frames at the speed of the wire, control first, nothing stale.
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
    /// Commands, their answers, setpoints.
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
pub fn classify(frame: &Frame<'_>) -> (Priority, Option<ReplaceKey>) {
    let key = || Some(ReplaceKey { message_id: frame.message_id(), source: frame.source(), target: frame.target() });
    match frame.message_id() {
        message::COMMAND_INT | message::COMMAND_LONG => match setpoint_command(frame) {
            true => (Priority::Control, key()),
            false => (Priority::Control, None),
        },
        message::COMMAND_ACK | message::COMMAND_CANCEL => (Priority::Control, None),
        message::GIMBAL_MANAGER_SET_ATTITUDE
        | message::GIMBAL_DEVICE_SET_ATTITUDE
        | message::GIMBAL_MANAGER_SET_PITCHYAW
        | message::GIMBAL_MANAGER_SET_MANUAL_CONTROL
        | message::MANUAL_CONTROL
        | message::MOUNT_CONTROL => (Priority::Control, key()),
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

/// So many frames of each priority wait at most; control may take the room of the others.
const MAX_WAITING: [usize; 3] = [SLOTS, 42, 42];

const MAX_AGES: [Duration; 3] = [MAX_CONTROL_AGE, MAX_ADDRESSED_AGE, MAX_BROADCAST_AGE];

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
    waiting: [VecDeque<u8>; 3],
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
            dropped: BTreeMap::new(),
        }
    }

    pub fn push(&mut self, now: Timestamp, frame: &Frame<'_>, origin: Origin) {
        let (priority, key) = classify(frame);
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
            let least_urgent = self.waiting.iter().rposition(|queue| !queue.is_empty());
            self.drop_oldest(least_urgent.expect("the slots that are not free wait in some queue"));
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
        for queue in 1..self.waiting.len() {
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
        for (queue, max_age) in MAX_AGES.into_iter().enumerate() {
            while let Some(slot) = self.waiting[queue].pop_front() {
                if now.since(self.slots[usize::from(slot)].queued_at) <= max_age {
                    return Some(slot);
                }
                self.count(STALE);
                self.free.push(slot);
            }
        }
        None
    }

    fn drop_oldest(&mut self, queue: usize) {
        if let Some(oldest) = self.waiting[queue].pop_front() {
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
mod tests {
    use super::*;
    use crate::wire::dialect::{ATTITUDE_DATA, COMMAND_ACK_DATA, GIMBAL_DEVICE_SET_ATTITUDE_DATA};
    use crate::wire::{DatagramFrames, encode_to_vec};

    /// "paced to the baud rate": what is given out in a second is what the wire can carry in it.
    #[test]
    fn a_full_line_is_filled_and_not_overfilled() {
        let mut queue = SerialQueue::new(115_200);
        let mut sent = 0;
        for millis in 0..1_000 {
            let now = Timestamp::from_millis(millis);
            push(&mut queue, now, &attitude(millis as u8));
            while let Some(bytes) = pop(&mut queue, now) {
                sent += bytes.len();
            }
        }
        assert!((10_900..=11_520).contains(&sent), "{sent} bytes in a second at 115200 baud");
    }

    /// "control first": a command waits for nothing but the frame in progress.
    #[test]
    fn control_overtakes_telemetry() {
        let mut queue = SerialQueue::new(115_200);
        push(&mut queue, Timestamp::ZERO, &attitude(0));
        push(&mut queue, Timestamp::ZERO, &attitude(1));
        push(&mut queue, Timestamp::ZERO, &ack(7));

        assert_eq!(pop(&mut queue, Timestamp::ZERO), Some(ack(7)));
        assert_eq!(pop(&mut queue, Timestamp::ZERO), None);
        let free = queue.poll_timeout().expect("telemetry waits");
        assert_eq!(pop(&mut queue, free), Some(attitude(0)));
    }

    /// "the newest setpoint replaces the queued one".
    #[test]
    fn the_newest_setpoint_replaces_the_queued_one() {
        let mut queue = SerialQueue::new(57_600);
        push(&mut queue, Timestamp::ZERO, &setpoint(1, 0.1));
        push(&mut queue, Timestamp::ZERO, &setpoint(2, 0.2));

        assert_eq!(pop(&mut queue, Timestamp::ZERO), Some(setpoint(2, 0.2)));
        assert_eq!(queue.poll_timeout(), None);
        assert_eq!(queue.dropped(), &BTreeMap::from([(REPLACED, 1)]));
    }

    /// "bounded in time": telemetry that could not be sent in time is not sent late.
    #[test]
    fn stale_telemetry_is_dropped_and_counted() {
        let mut queue = SerialQueue::new(57_600);
        push(&mut queue, Timestamp::ZERO, &attitude(0));
        push(&mut queue, Timestamp::from_millis(290), &attitude(1));

        assert_eq!(pop(&mut queue, Timestamp::from_millis(301)), Some(attitude(1)));
        assert_eq!(queue.dropped(), &BTreeMap::from([(STALE, 1)]));
    }

    /// "old frames discarded on reopening".
    #[test]
    fn nothing_waits_over_a_reopening() {
        let mut queue = SerialQueue::new(57_600);
        push(&mut queue, Timestamp::ZERO, &ack(1));
        queue.clear();
        assert_eq!(pop(&mut queue, Timestamp::from_secs(1)), None);
        assert_eq!(queue.dropped(), &BTreeMap::from([(LINK_DOWN, 1)]));
    }

    /// "When a link's output queue is full, stream frames are dropped before COMMAND_*" (Protocol checklist 155).
    #[test]
    fn a_full_queue_drops_telemetry_before_control_and_the_oldest_first() {
        let mut queue = SerialQueue::new(921_600);
        for n in 0..100 {
            push(&mut queue, Timestamp::ZERO, &attitude(n));
            push(&mut queue, Timestamp::ZERO, &ack(n));
        }
        assert_eq!(queue.dropped(), &BTreeMap::from([(QUEUE_FULL, 200 - SLOTS as u64)]));
        let sent = drain(&mut queue);
        let expected = (0..100).map(ack).chain((72..100).map(attitude));
        assert_eq!(sent, expected.collect::<Vec<_>>());
    }

    #[test]
    fn a_flood_of_control_is_bounded_and_the_newest_frames_stay() {
        let mut queue = SerialQueue::new(57_600);
        for n in 0..200 {
            push(&mut queue, Timestamp::ZERO, &ack(n));
        }
        assert_eq!(queue.dropped(), &BTreeMap::from([(QUEUE_FULL, 200 - SLOTS as u64)]));
        assert_eq!(drain(&mut queue), (72..200).map(ack).collect::<Vec<_>>());
    }

    /// Everything that waits, at the pace of the line.
    fn drain(queue: &mut SerialQueue) -> Vec<Vec<u8>> {
        let mut sent = Vec::new();
        while let Some(at) = queue.poll_timeout() {
            sent.extend(pop(queue, at));
        }
        sent
    }

    fn pop(queue: &mut SerialQueue, now: Timestamp) -> Option<Vec<u8>> {
        queue.pop(now).map(|departure| departure.bytes.to_vec())
    }

    fn push(queue: &mut SerialQueue, now: Timestamp, bytes: &[u8]) {
        queue.push(now, &DatagramFrames::new(bytes).next_frame().expect("one frame"), Origin::Forwarded);
    }

    fn attitude(sequence: u8) -> Vec<u8> {
        let message = ATTITUDE_DATA {
            time_boot_ms: 1,
            roll: 0.0,
            pitch: 0.0,
            yaw: 0.0,
            rollspeed: 0.0,
            pitchspeed: 0.0,
            yawspeed: 1.0,
        };
        encode_to_vec(MavId::new(1, 1), sequence, &message)
    }

    fn ack(sequence: u8) -> Vec<u8> {
        let message = COMMAND_ACK_DATA {
            command: 1000,
            result: 0,
            progress: 255,
            result_param2: 0,
            target_system: 1,
            target_component: 154,
        };
        encode_to_vec(MavId::new(255, 190), sequence, &message)
    }

    fn setpoint(sequence: u8, rate: f32) -> Vec<u8> {
        let message = GIMBAL_DEVICE_SET_ATTITUDE_DATA {
            q: [f32::NAN; 4],
            angular_velocity_x: f32::NAN,
            angular_velocity_y: rate,
            angular_velocity_z: 0.0,
            flags: 44,
            target_system: 1,
            target_component: 154,
        };
        encode_to_vec(MavId::new(1, 191), sequence, &message)
    }
}
