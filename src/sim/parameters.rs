//! The parameter protocol of a simulated peer.

use std::collections::VecDeque;
use std::time::Duration;

use crate::sim::outbox::Outbox;
use crate::timestamp::Timestamp;
use crate::wire::Frame;
use crate::wire::dialect::{CharArray, PARAM_REQUEST_READ_DATA, PARAM_SET_DATA, PARAM_VALUE_DATA};
use crate::wire::ids::message;

/// Values of one answer to `PARAM_REQUEST_LIST` follow each other at this interval.
const LIST_INTERVAL: Duration = Duration::from_millis(5);

/// `MAV_PARAM_TYPE_UINT32`.
const UINT32: u8 = 5;
/// `MAV_PARAM_TYPE_INT32`.
const INT32: u8 = 6;
/// `MAV_PARAM_TYPE_REAL32`.
const REAL32: u8 = 9;

/// The name under which PX4 tells the checksum of all its parameters.
const HASH_CHECK: &str = "_HASH_CHECK";

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ParameterValue {
    Integer(i32),
    Float(f32),
}

/// How an integer travels in the float field of `PARAM_VALUE`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum IntegerEncoding {
    /// As its bits (`MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_BYTEWISE`).
    Bytewise,
    /// As its value (`MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_C_CAST`).
    CCast,
}

/// Answers `PARAM_REQUEST_LIST`, `PARAM_REQUEST_READ` and `PARAM_SET`.
#[derive(Clone, Debug)]
pub struct ParameterServer {
    /// Sorted by name.
    list: Vec<(&'static str, ParameterValue)>,
    encoding: IntegerEncoding,
    has_hash: bool,
    pending: VecDeque<usize>,
    next: Timestamp,
}

impl ParameterServer {
    pub fn new(mut list: Vec<(&'static str, ParameterValue)>, encoding: IntegerEncoding) -> Self {
        list.sort_by_key(|(name, _)| *name);
        Self { list, encoding, has_hash: false, pending: VecDeque::new(), next: Timestamp::ZERO }
    }

    /// Also offers `_HASH_CHECK`, as PX4 does.
    pub fn with_hash(mut self) -> Self {
        self.has_hash = true;
        self
    }

    pub fn value(&self, name: &str) -> Option<ParameterValue> {
        self.list.iter().find(|(known, _)| *known == name).map(|(_, value)| *value)
    }

    /// Takes a frame that addresses this component; true when it was one of the parameter protocol.
    ///
    /// A name or an index that is not known is not answered.
    pub fn handle_frame(&mut self, now: Timestamp, frame: &Frame<'_>, outbox: &mut Outbox) -> bool {
        match frame.message_id() {
            message::PARAM_REQUEST_LIST => {
                if self.has_hash {
                    self.send_hash(outbox);
                }
                self.pending = (0..self.list.len()).collect();
                self.next = now;
                self.handle_timeout(now, outbox);
            }
            message::PARAM_REQUEST_READ => {
                let Some(request) = frame.decode::<PARAM_REQUEST_READ_DATA>() else { return true };
                let name = request.param_id.to_str().unwrap_or("");
                if let Ok(index) = usize::try_from(request.param_index) {
                    self.send(index, outbox);
                } else if self.has_hash && name == HASH_CHECK {
                    self.send_hash(outbox);
                } else if let Some(index) = self.list.iter().position(|(known, _)| *known == name) {
                    self.send(index, outbox);
                }
            }
            message::PARAM_SET => {
                let Some(set) = frame.decode::<PARAM_SET_DATA>() else { return true };
                let name = set.param_id.to_str().unwrap_or("");
                if self.has_hash && name == HASH_CHECK {
                    // A client whose copy has this checksum says so, and the list need not be sent.
                    self.pending.clear();
                } else if let Some(index) = self.list.iter().position(|(known, _)| *known == name) {
                    let old = self.list[index].1;
                    self.list[index].1 = self.decode(old, set.param_value);
                    self.send(index, outbox);
                }
            }
            _ => return false,
        }
        true
    }

    pub fn handle_timeout(&mut self, now: Timestamp, outbox: &mut Outbox) {
        while self.next <= now
            && let Some(index) = self.pending.pop_front()
        {
            self.send(index, outbox);
            self.next += LIST_INTERVAL;
        }
    }

    pub fn poll_timeout(&self) -> Option<Timestamp> {
        (!self.pending.is_empty()).then_some(self.next)
    }

    fn decode(&self, old: ParameterValue, raw: f32) -> ParameterValue {
        match (old, self.encoding) {
            (ParameterValue::Float(_), _) => ParameterValue::Float(raw),
            (ParameterValue::Integer(_), IntegerEncoding::Bytewise) => {
                ParameterValue::Integer(raw.to_bits().cast_signed())
            }
            (ParameterValue::Integer(_), IntegerEncoding::CCast) => ParameterValue::Integer(raw.round() as i32),
        }
    }

    fn send(&self, index: usize, outbox: &mut Outbox) {
        let Some((name, value)) = self.list.get(index) else { return };
        let (param_value, param_type) = match (*value, self.encoding) {
            (ParameterValue::Float(value), _) => (value, REAL32),
            (ParameterValue::Integer(value), IntegerEncoding::Bytewise) => (f32::from_bits(bits(value)), INT32),
            (ParameterValue::Integer(value), IntegerEncoding::CCast) => (value as f32, INT32),
        };
        outbox.send(&PARAM_VALUE_DATA {
            param_id: CharArray::from(*name),
            param_value,
            param_type,
            param_count: self.list.len() as u16,
            param_index: index as u16,
        });
    }

    fn send_hash(&self, outbox: &mut Outbox) {
        outbox.send(&PARAM_VALUE_DATA {
            param_id: CharArray::from(HASH_CHECK),
            param_value: f32::from_bits(self.hash()),
            param_type: UINT32,
            param_count: self.list.len() as u16,
            param_index: u16::MAX,
        });
    }

    /// CRC-32 over name and value bits of every parameter in order, started at 0 and not inverted at the end.
    fn hash(&self) -> u32 {
        let mut crc = 0;
        for (name, value) in &self.list {
            let bits = match *value {
                ParameterValue::Integer(value) => bits(value),
                ParameterValue::Float(value) => value.to_bits(),
            };
            crc = name.bytes().chain(bits.to_le_bytes()).fold(crc, crc32_step);
        }
        crc
    }
}

fn bits(value: i32) -> u32 {
    value.cast_unsigned()
}

fn crc32_step(crc: u32, byte: u8) -> u32 {
    (0..8).fold(crc ^ u32::from(byte), |crc, _| if crc & 1 == 0 { crc >> 1 } else { (crc >> 1) ^ 0xedb8_8320 })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wire::dialect::{MessageData, PARAM_REQUEST_LIST_DATA};
    use crate::wire::{DatagramFrames, MavId, encode_to_vec};

    const GCS: MavId = MavId::new(255, 190);

    fn ask<M: MessageData>(server: &mut ParameterServer, now: Timestamp, request: &M) -> Vec<PARAM_VALUE_DATA> {
        let mut outbox = Outbox::new(MavId::new(1, 1));
        let bytes = encode_to_vec(GCS, 0, request);
        let frame = DatagramFrames::new(&bytes).next_frame().expect("one frame");
        assert!(server.handle_frame(now, &frame, &mut outbox));
        drain(&mut outbox)
    }

    fn drain(outbox: &mut Outbox) -> Vec<PARAM_VALUE_DATA> {
        std::iter::from_fn(|| outbox.poll())
            .map(|bytes| {
                DatagramFrames::new(&bytes).next_frame().and_then(|frame| frame.decode()).expect("PARAM_VALUE")
            })
            .collect()
    }

    fn names(values: &[PARAM_VALUE_DATA]) -> Vec<&str> {
        values.iter().map(|value| value.param_id.to_str().expect("a name")).collect()
    }

    fn server() -> ParameterServer {
        let list = vec![("B", ParameterValue::Integer(7)), ("A", ParameterValue::Float(1.5))];
        ParameterServer::new(list, IntegerEncoding::Bytewise).with_hash()
    }

    #[test]
    fn a_list_comes_in_order_and_spread_out() {
        let mut server = server();
        let request = PARAM_REQUEST_LIST_DATA { target_system: 1, target_component: 1 };

        let first = ask(&mut server, Timestamp::ZERO, &request);
        assert_eq!(names(&first), ["_HASH_CHECK", "A"]);
        assert_eq!((first[0].param_index, first[1].param_count, first[1].param_index), (65_535, 2, 0));

        assert_eq!(server.poll_timeout(), Some(Timestamp::from_millis(5)));
        let mut outbox = Outbox::new(MavId::new(1, 1));
        server.handle_timeout(Timestamp::from_millis(5), &mut outbox);
        let second = drain(&mut outbox);
        assert_eq!(names(&second), ["B"]);
        assert_eq!((second[0].param_value.to_bits(), second[0].param_type), (7, INT32));
        assert_eq!(server.poll_timeout(), None);
    }

    #[test]
    fn a_value_is_set_and_echoed_and_an_unknown_one_is_not_answered() {
        let mut server = server();
        let set = |name: &str, value| PARAM_SET_DATA {
            target_system: 1,
            target_component: 1,
            param_id: CharArray::from(name),
            param_value: value,
            param_type: INT32,
        };

        let echo = ask(&mut server, Timestamp::ZERO, &set("B", f32::from_bits(9)));
        assert_eq!((names(&echo), echo[0].param_value.to_bits()), (vec!["B"], 9));
        assert_eq!(server.value("B"), Some(ParameterValue::Integer(9)));
        assert!(ask(&mut server, Timestamp::ZERO, &set("C", 0.0)).is_empty());
    }

    #[test]
    fn reading_goes_by_index_or_by_name() {
        let mut server = server();
        let read = |name: &str, param_index| PARAM_REQUEST_READ_DATA {
            target_system: 1,
            target_component: 1,
            param_id: CharArray::from(name),
            param_index,
        };

        assert_eq!(names(&ask(&mut server, Timestamp::ZERO, &read("", 1))), ["B"]);
        assert_eq!(names(&ask(&mut server, Timestamp::ZERO, &read("A", -1))), ["A"]);
        assert_eq!(names(&ask(&mut server, Timestamp::ZERO, &read("_HASH_CHECK", -1))), ["_HASH_CHECK"]);
        assert!(ask(&mut server, Timestamp::ZERO, &read("", 2)).is_empty());
    }
}
