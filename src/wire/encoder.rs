//! From a message of our own to bytes.

use mavlink_core::{MavlinkVersion, MessageData};

use super::crc::Crc;
use super::frame::{Frame, Header, MAGIC_V2, MAX_FRAME_LEN};
use super::ids::MavId;

/// Room for one frame; encoding writes into it and lends the frame out.
#[derive(Clone, Debug)]
pub struct FrameBuffer([u8; MAX_FRAME_LEN]);

impl Default for FrameBuffer {
    fn default() -> Self {
        Self([0; MAX_FRAME_LEN])
    }
}

impl FrameBuffer {
    /// Encodes `message` as an unsigned MAVLink 2 frame; trailing zero bytes of the payload are cut off.
    pub fn encode<M: MessageData>(&mut self, source: MavId, sequence: u8, message: &M) -> Frame<'_> {
        let payload_len = message.ser(MavlinkVersion::V2, &mut self.0[10..265]);
        let id = M::ID.to_le_bytes();
        let len = u8::try_from(payload_len).expect("a payload has at most 255 bytes");
        self.0[..10].copy_from_slice(&[
            MAGIC_V2,
            len,
            0,
            0,
            sequence,
            source.system,
            source.component,
            id[0],
            id[1],
            id[2],
        ]);
        let end = 10 + payload_len;
        let crc = Crc::new().add(&self.0[1..end]).finish(M::EXTRA_CRC);
        self.0[end..end + 2].copy_from_slice(&crc.to_le_bytes());
        let bytes = &self.0[..end + 2];
        Frame::new(bytes, Header::read(bytes).expect("the header was just written"))
    }
}

/// Encodes `message` into a new vector, for tests and simulators.
pub fn encode_to_vec<M: MessageData>(source: MavId, sequence: u8, message: &M) -> Vec<u8> {
    FrameBuffer::default().encode(source, sequence, message).bytes().to_vec()
}
