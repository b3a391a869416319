//! From a message of our own to bytes.

use mavlink_core::{MavlinkVersion, Message, MessageData};

use super::crc::Crc;
use super::dialect::MavMessage;
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
        self.complete(source, sequence, M::ID, M::EXTRA_CRC, payload_len)
    }

    /// The same for a message of any type.
    pub fn encode_any(&mut self, source: MavId, sequence: u8, message: &MavMessage) -> Frame<'_> {
        let payload_len = message.ser(MavlinkVersion::V2, &mut self.0[10..265]);
        let id = message.message_id();
        self.complete(source, sequence, id, MavMessage::extra_crc(id), payload_len)
    }

    fn complete(&mut self, source: MavId, sequence: u8, id: u32, crc_extra: u8, payload_len: usize) -> Frame<'_> {
        let len = u8::try_from(payload_len).expect("a payload has at most 255 bytes");
        let [id_low, id_middle, id_high, _] = id.to_le_bytes();
        let header = [MAGIC_V2, len, 0, 0, sequence, source.system, source.component, id_low, id_middle, id_high];
        self.0[..10].copy_from_slice(&header);
        let end = 10 + payload_len;
        let crc = Crc::new().add(&self.0[1..end]).finish(crc_extra);
        self.0[end..end + 2].copy_from_slice(&crc.to_le_bytes());
        let bytes = &self.0[..end + 2];
        Frame::new(bytes, Header::read(bytes).expect("the header was just written"))
    }
}

/// Gives an unsigned MAVLink 2 frame of a known message another sequence number, and the checksum that goes with it.
pub fn renumber(frame: &mut [u8], sequence: u8) {
    frame[4] = sequence;
    let header = Header::read(frame).expect("a whole frame was given");
    let shape = header.shape.expect("a message of our own is known");
    let end = header.payload_end();
    let crc = Crc::new().add(&frame[1..end]).finish(shape.crc_extra);
    frame[end..end + 2].copy_from_slice(&crc.to_le_bytes());
}

/// Encodes `message` into a new vector, for tests and simulators.
pub fn encode_to_vec<M: MessageData>(source: MavId, sequence: u8, message: &M) -> Vec<u8> {
    FrameBuffer::default().encode(source, sequence, message).bytes().to_vec()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wire::dialect::MESSAGE_INTERVAL_DATA;

    #[test]
    fn a_renumbered_frame_is_the_frame_of_that_number() {
        let message = MESSAGE_INTERVAL_DATA { interval_us: 200_000, message_id: 281 };
        let mut frame = encode_to_vec(MavId::new(1, 191), 7, &message);

        renumber(&mut frame, 200);

        assert_eq!(frame, encode_to_vec(MavId::new(1, 191), 200, &message));
    }
}
