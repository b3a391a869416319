//! A cable to a gimbal that is away at times, and behind which the gimbal may take another id.

use std::cell::Cell;
use std::rc::Rc;

use gimbald::wire::dialect::{
    COMMAND_LONG_DATA, GIMBAL_DEVICE_SET_ATTITUDE_DATA, GIMBAL_MANAGER_STATUS_DATA, MavMessage,
    PARAM_REQUEST_LIST_DATA, PARAM_REQUEST_READ_DATA,
};
use gimbald::wire::target::message_shape;
use gimbald::wire::{DatagramFrames, Frame, FrameBuffer, MavId};

use super::interception::{Interceptor, Passage};
use super::wire::checksum;
use super::world::GIMBAL;

/// What the test does to a cable.
#[derive(Clone, Debug, Default)]
pub struct Cable {
    is_cut: Rc<Cell<bool>>,
    /// What the gimbal at its end, which is [`GIMBAL`], is called on this side.
    alias: Rc<Cell<Option<MavId>>>,
}

impl Cable {
    /// Nothing passes either way, and nobody is told.
    pub fn cut(&self) {
        self.is_cut.set(true);
    }

    pub fn mend(&self) {
        self.is_cut.set(false);
    }

    pub fn rename(&self, id: MavId) {
        self.alias.set(Some(id));
    }
}

/// For the gimbal at its end.
impl Interceptor for Cable {
    fn towards_peer(&mut self, bytes: &[u8]) -> Passage {
        if self.is_cut.get() {
            return Passage::Lost;
        }
        match self.alias.get() {
            None => Passage::Through,
            Some(alias) => towards_gimbal(bytes, alias).map_or(Passage::Lost, Passage::As),
        }
    }

    fn towards_core(&mut self, bytes: &[u8]) -> Passage {
        if self.is_cut.get() {
            return Passage::Lost;
        }
        self.alias.get().map_or(Passage::Through, |alias| Passage::As(from_gimbal(bytes.to_vec(), alias)))
    }
}

/// What is for `alias` is for the gimbal; what is for the gimbal's own id is for nobody.
fn towards_gimbal(bytes: &[u8], alias: MavId) -> Option<Vec<u8>> {
    let frame = DatagramFrames::new(bytes).next_frame().expect("the core sends whole frames");
    let is_its = |system: &mut u8, component: &mut u8| {
        let target = MavId::new(*system, *component);
        (*system, *component) = if target == alias { (GIMBAL.system, GIMBAL.component) } else { (*system, *component) };
        target != GIMBAL
    };
    if let Some(mut status) = frame.decode::<GIMBAL_MANAGER_STATUS_DATA>() {
        let is_its = status.gimbal_device_id == alias.component;
        status.gimbal_device_id = GIMBAL.component;
        let message = MavMessage::GIMBAL_MANAGER_STATUS(status);
        let encode = || FrameBuffer::default().encode_any(frame.source(), frame.sequence(), &message).bytes().to_vec();
        return is_its.then(encode);
    }
    let changed = with_target(&frame, is_its)?;
    Some(changed.unwrap_or_else(|| bytes.to_vec()))
}

/// The frame with the target that `change` makes of it, `None` where it says no; untouched where it has none that
/// matters.
fn with_target(frame: &Frame<'_>, change: impl Fn(&mut u8, &mut u8) -> bool) -> Option<Option<Vec<u8>>> {
    let again = |message: MavMessage| {
        let encoded = FrameBuffer::default().encode_any(frame.source(), frame.sequence(), &message).bytes().to_vec();
        Some(Some(encoded))
    };
    if let Some(mut command) = frame.decode::<COMMAND_LONG_DATA>() {
        let is_its = change(&mut command.target_system, &mut command.target_component);
        return if is_its { again(MavMessage::COMMAND_LONG(command)) } else { None };
    }
    if let Some(mut setpoint) = frame.decode::<GIMBAL_DEVICE_SET_ATTITUDE_DATA>() {
        let is_its = change(&mut setpoint.target_system, &mut setpoint.target_component);
        return if is_its { again(MavMessage::GIMBAL_DEVICE_SET_ATTITUDE(setpoint)) } else { None };
    }
    if let Some(mut request) = frame.decode::<PARAM_REQUEST_READ_DATA>() {
        let is_its = change(&mut request.target_system, &mut request.target_component);
        return if is_its { again(MavMessage::PARAM_REQUEST_READ(request)) } else { None };
    }
    if let Some(mut request) = frame.decode::<PARAM_REQUEST_LIST_DATA>() {
        let is_its = change(&mut request.target_system, &mut request.target_component);
        return if is_its { again(MavMessage::PARAM_REQUEST_LIST(request)) } else { None };
    }
    Some(None)
}

fn from_gimbal(mut bytes: Vec<u8>, alias: MavId) -> Vec<u8> {
    let shape = message_shape(u32::from_le_bytes([bytes[7], bytes[8], bytes[9], 0])).expect("a known message");
    bytes[5..7].copy_from_slice(&[alias.system, alias.component]);
    let end = 10 + usize::from(bytes[1]);
    let sum = checksum(&bytes[1..end], shape.crc_extra);
    bytes[end..end + 2].copy_from_slice(&sum.to_le_bytes());
    bytes
}
