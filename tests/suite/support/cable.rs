//! A cable to a gimbal that is away at times, and behind which the gimbal may take another id.

use std::cell::Cell;
use std::rc::Rc;

use gimbald::wire::dialect::{GIMBAL_MANAGER_STATUS_DATA, MavMessage};
use gimbald::wire::ids::message;
use gimbald::wire::target::{MessageShape, message_shape};
use gimbald::wire::{DatagramFrames, FrameBuffer, MavId, Target};

use super::interception::{Interceptor, Passage};
use super::wire::checksum;
use super::world::GIMBAL;

/// What the test does to a cable.
#[derive(Clone, Debug, Default)]
pub struct Cable {
    is_cut: Rc<Cell<bool>>,
    is_deaf: Rc<Cell<bool>>,
    /// By how much the gimbal's clock is behind, milliseconds.
    clock_back_ms: Rc<Cell<u32>>,
    /// What the gimbal at its end, which is [`GIMBAL`], is called on this side.
    alias: Rc<Cell<Option<MavId>>>,
}

impl Cable {
    /// Nothing passes either way, and nobody is told.
    pub fn cut(&self) {
        self.is_cut.set(true);
    }

    /// The gimbal is heard, and hears nothing.
    pub fn cut_towards_gimbal(&self) {
        self.is_deaf.set(true);
    }

    pub fn mend(&self) {
        self.is_cut.set(false);
        self.is_deaf.set(false);
    }

    /// The time since boot that the gimbal tells jumps back, as where a frame that was held up arrives at last.
    pub fn set_clock_back(&self, millis: u32) {
        self.clock_back_ms.set(millis);
    }

    pub fn rename(&self, id: MavId) {
        self.alias.set(Some(id));
    }
}

/// For the gimbal at its end.
impl Interceptor for Cable {
    fn towards_peer(&mut self, bytes: &[u8]) -> Passage {
        if self.is_cut.get() || self.is_deaf.get() {
            return Passage::Lost;
        }
        match self.alias.get() {
            None => Passage::Through,
            Some(alias) => towards_gimbal(bytes, alias),
        }
    }

    fn towards_core(&mut self, bytes: &[u8]) -> Passage {
        if self.is_cut.get() {
            return Passage::Lost;
        }
        let bytes = with_clock_back(bytes.to_vec(), self.clock_back_ms.get());
        Passage::As(match self.alias.get() {
            Some(alias) => from_gimbal(bytes, alias),
            None => bytes,
        })
    }
}

/// The time since boot comes first in both messages that tell where a gimbal looks.
fn with_clock_back(mut bytes: Vec<u8>, millis: u32) -> Vec<u8> {
    let frame = DatagramFrames::new(&bytes).next_frame().expect("the gimbal sends whole frames");
    let tells_time = [message::GIMBAL_DEVICE_ATTITUDE_STATUS, message::MOUNT_ORIENTATION].contains(&frame.message_id());
    if millis == 0 || !tells_time {
        return bytes;
    }
    let told = u32::from_le_bytes([bytes[10], bytes[11], bytes[12], bytes[13]]);
    bytes[10..14].copy_from_slice(&told.saturating_sub(millis).to_le_bytes());
    with_checksum(bytes)
}

/// What is for `alias` is for the gimbal; what is for the gimbal's own id is for nobody.
fn towards_gimbal(bytes: &[u8], alias: MavId) -> Passage {
    let frame = DatagramFrames::new(bytes).next_frame().expect("the core sends whole frames");
    if let Some(mut status) = frame.decode::<GIMBAL_MANAGER_STATUS_DATA>() {
        if status.gimbal_device_id != alias.component {
            return Passage::Lost;
        }
        status.gimbal_device_id = GIMBAL.component;
        let message = MavMessage::GIMBAL_MANAGER_STATUS(status);
        let encoded = FrameBuffer::default().encode_any(frame.source(), frame.sequence(), &message).bytes().to_vec();
        return Passage::As(encoded);
    }
    match frame.target() {
        Target::Component(target) if target == alias => Passage::As(with_target(bytes.to_vec(), GIMBAL)),
        Target::Component(GIMBAL) => Passage::Lost,
        _ => Passage::Through,
    }
}

/// A frame that has a target, with another one.
fn with_target(mut bytes: Vec<u8>, target: MavId) -> Vec<u8> {
    let shape = shape(&bytes);
    let at = |offset: Option<u8>| 10 + usize::from(offset.expect("it has a target"));
    bytes[at(shape.system_offset)] = target.system;
    bytes[at(shape.component_offset)] = target.component;
    with_checksum(bytes)
}

fn from_gimbal(mut bytes: Vec<u8>, alias: MavId) -> Vec<u8> {
    bytes[5..7].copy_from_slice(&[alias.system, alias.component]);
    with_checksum(bytes)
}

fn with_checksum(mut bytes: Vec<u8>) -> Vec<u8> {
    let end = 10 + usize::from(bytes[1]);
    let sum = checksum(&bytes[1..end], shape(&bytes).crc_extra);
    bytes[end..end + 2].copy_from_slice(&sum.to_le_bytes());
    bytes
}

fn shape(bytes: &[u8]) -> &'static MessageShape {
    message_shape(u32::from_le_bytes([bytes[7], bytes[8], bytes[9], 0])).expect("a known message")
}
