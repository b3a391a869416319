//! MAVLink as bytes: framing, checksums, targets, and the messages we know.

mod crc;
pub mod decoder;
pub mod dialect;
pub mod encoder;
pub mod frame;
pub mod ids;
mod table;
pub mod target;

pub use decoder::{DatagramFrames, StreamDecoder, WireCounters};
pub use encoder::{FrameBuffer, encode_to_vec};
pub use frame::{Frame, MAX_FRAME_LEN, Version};
pub use ids::MavId;
pub use target::Target;
