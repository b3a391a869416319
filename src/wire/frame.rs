//! One MAVLink packet with its original bytes.

use mavlink_core::{MavlinkVersion, MessageData};

use super::ids::MavId;
use super::target::{MessageShape, Target, message_shape};

/// `incompat_flags` bit of a signed frame.
pub const INCOMPAT_SIGNED: u8 = 0x01;

pub const MAGIC_V1: u8 = 0xfe;
pub const MAGIC_V2: u8 = 0xfd;

/// The longest frame there is: header, 255 bytes of payload, checksum and signature.
pub const MAX_FRAME_LEN: usize = 10 + 255 + 2 + 13;

const HEADER_V1: usize = 6;
const HEADER_V2: usize = 10;
pub(super) const CRC_LEN: usize = 2;
const SIGNATURE_LEN: usize = 13;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Version {
    V1,
    V2,
}

/// A whole, checked MAVLink packet; forwarded exactly as it came.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Frame<'a> {
    bytes: &'a [u8],
    header: Header,
}

/// The parts of a frame's header, still unchecked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Header {
    pub version: Version,
    pub payload_len: u8,
    pub incompat_flags: u8,
    pub sequence: u8,
    pub source: MavId,
    pub message_id: u32,
    pub shape: Option<&'static MessageShape>,
}

impl Header {
    /// Reads a header that starts at the first of `bytes`; `None` while too few have arrived.
    pub fn read(bytes: &[u8]) -> Option<Self> {
        match *bytes.first()? {
            MAGIC_V1 if bytes.len() >= HEADER_V1 => Some(Self {
                version: Version::V1,
                payload_len: bytes[1],
                incompat_flags: 0,
                sequence: bytes[2],
                source: MavId::new(bytes[3], bytes[4]),
                message_id: u32::from(bytes[5]),
                shape: message_shape(u32::from(bytes[5])),
            }),
            MAGIC_V2 if bytes.len() >= HEADER_V2 => {
                let message_id = u32::from_le_bytes([bytes[7], bytes[8], bytes[9], 0]);
                Some(Self {
                    version: Version::V2,
                    payload_len: bytes[1],
                    incompat_flags: bytes[2],
                    sequence: bytes[4],
                    source: MavId::new(bytes[5], bytes[6]),
                    message_id,
                    shape: message_shape(message_id),
                })
            }
            _ => None,
        }
    }

    pub fn payload_start(&self) -> usize {
        match self.version {
            Version::V1 => HEADER_V1,
            Version::V2 => HEADER_V2,
        }
    }

    pub fn payload_end(&self) -> usize {
        self.payload_start() + usize::from(self.payload_len)
    }

    pub fn frame_len(&self) -> usize {
        let signature = if self.incompat_flags & INCOMPAT_SIGNED == 0 { 0 } else { SIGNATURE_LEN };
        self.payload_end() + CRC_LEN + signature
    }
}

impl<'a> Frame<'a> {
    /// Wraps bytes that the decoder or encoder found to be one frame.
    pub(super) fn new(bytes: &'a [u8], header: Header) -> Self {
        debug_assert_eq!(bytes.len(), header.frame_len());
        Self { bytes, header }
    }

    /// The frame as it was received, signature included.
    pub fn bytes(&self) -> &'a [u8] {
        self.bytes
    }

    pub fn payload(&self) -> &'a [u8] {
        &self.bytes[self.header.payload_start()..self.header.payload_end()]
    }

    pub fn version(&self) -> Version {
        self.header.version
    }

    pub fn sequence(&self) -> u8 {
        self.header.sequence
    }

    pub fn source(&self) -> MavId {
        self.header.source
    }

    pub fn message_id(&self) -> u32 {
        self.header.message_id
    }

    pub fn is_signed(&self) -> bool {
        self.header.incompat_flags & INCOMPAT_SIGNED != 0
    }

    /// Whether the definitions hold this message, so that its checksum was checked.
    pub fn is_known(&self) -> bool {
        self.header.shape.is_some()
    }

    pub fn name(&self) -> &'static str {
        self.header.shape.map_or("unknown message", |shape| shape.name)
    }

    /// Whom the message addresses; everyone for a message that is not known.
    pub fn target(&self) -> Target {
        self.header.shape.map_or(Target::Everyone, |shape| Target::read(shape, self.payload()))
    }

    /// The content as message type `M`; `None` if this is another message.
    ///
    /// Missing trailing bytes read zero and surplus bytes are ignored, as MAVLink 2 demands.
    pub fn decode<M: MessageData>(&self) -> Option<M> {
        if self.header.message_id != M::ID {
            return None;
        }
        let version = match self.header.version {
            Version::V1 => MavlinkVersion::V1,
            Version::V2 => MavlinkVersion::V2,
        };
        // Every field of our dialect is a plain number, so no value is refused.
        M::deser(version, self.payload()).ok()
    }
}
