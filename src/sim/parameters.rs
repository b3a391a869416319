//! The parameter protocol of a simulated peer.

use std::collections::VecDeque;
use std::ops::RangeInclusive;
use std::time::Duration;

use crate::sim::outbox::Outbox;
use crate::sim::random::Random;
use crate::timestamp::Timestamp;
use crate::wire::Frame;
use crate::wire::dialect::{CharArray, PARAM_REQUEST_READ_DATA, PARAM_SET_DATA, PARAM_VALUE_DATA};
use crate::wire::ids::message;

/// Values of one answer to `PARAM_REQUEST_LIST` follow each other at this interval.
const LIST_INTERVAL: Duration = Duration::from_millis(5);

/// `MAV_PARAM_TYPE_INT16`.
const INT16: u8 = 4;
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
    Short(i16),
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

/// One parameter.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameter {
    pub name: &'static str,
    pub index: u16,
    pub value: ParameterValue,
    pub writable: Writable,
}

/// What may be written to a parameter.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Writable {
    Anything,
    Within(RangeInclusive<i16>),
    Nothing,
}

/// How long it takes until a written parameter is told back.
#[derive(Clone, Debug)]
struct Flash {
    least: Duration,
    spread: Duration,
    random: Random,
}

/// Answers `PARAM_REQUEST_LIST`, `PARAM_REQUEST_READ` and `PARAM_SET`.
#[derive(Clone, Debug)]
pub struct ParameterServer {
    /// Sorted by index.
    list: Vec<Parameter>,
    encoding: IntegerEncoding,
    has_hash: bool,
    flash: Option<Flash>,
    /// Places in the list, yet to be told.
    pending: VecDeque<usize>,
    next: Timestamp,
    /// The same for what was written, with the time.
    echoes: Vec<(Timestamp, usize)>,
}

impl ParameterServer {
    /// With indices in the order of the names.
    pub fn new(mut list: Vec<(&'static str, ParameterValue)>, encoding: IntegerEncoding) -> Self {
        list.sort_by_key(|(name, _)| *name);
        let list = (0..).zip(list).map(|(index, (name, value))| Parameter {
            name,
            index,
            value,
            writable: Writable::Anything,
        });
        Self::with_parameters(list.collect(), encoding)
    }

    /// With indices of its own, which may leave places free.
    pub fn with_parameters(mut list: Vec<Parameter>, encoding: IntegerEncoding) -> Self {
        list.sort_by_key(|parameter| parameter.index);
        Self {
            list,
            encoding,
            has_hash: false,
            flash: None,
            pending: VecDeque::new(),
            next: Timestamp::ZERO,
            echoes: Vec::new(),
        }
    }

    /// Also offers `_HASH_CHECK`, as PX4 does.
    pub fn with_hash(mut self) -> Self {
        self.has_hash = true;
        self
    }

    /// Tells what was written only after `least`, or as much as `spread` later.
    pub fn with_flash(mut self, least: Duration, spread: Duration, seed: u64) -> Self {
        self.flash = Some(Flash { least, spread, random: Random::new(seed) });
        self
    }

    pub fn value(&self, name: &str) -> Option<ParameterValue> {
        self.list.iter().find(|parameter| parameter.name == name).map(|parameter| parameter.value)
    }

    /// Forgets what is still to be told, as at a restart; the values stay.
    pub fn forget_questions(&mut self) {
        self.pending.clear();
        self.echoes.clear();
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
                if let Ok(index) = u16::try_from(request.param_index) {
                    if let Some(place) = self.list.iter().position(|parameter| parameter.index == index) {
                        self.send(place, outbox);
                    }
                } else if self.has_hash && name == HASH_CHECK {
                    self.send_hash(outbox);
                } else if let Some(place) = self.place(name) {
                    self.send(place, outbox);
                }
            }
            message::PARAM_SET => {
                let Some(set) = frame.decode::<PARAM_SET_DATA>() else { return true };
                let name = set.param_id.to_str().unwrap_or("");
                if self.has_hash && name == HASH_CHECK {
                    // A client whose copy has this checksum says so, and the list need not be sent.
                    self.pending.clear();
                } else if let Some(place) = self.place(name) {
                    self.write(place, set.param_value);
                    match &mut self.flash {
                        Some(flash) => {
                            let delay = flash.least + flash.spread.mul_f64(flash.random.unit());
                            self.echoes.push((now + delay, place));
                        }
                        None => self.send(place, outbox),
                    }
                }
            }
            _ => return false,
        }
        true
    }

    pub fn handle_timeout(&mut self, now: Timestamp, outbox: &mut Outbox) {
        while self.next <= now
            && let Some(place) = self.pending.pop_front()
        {
            self.send(place, outbox);
            self.next += LIST_INTERVAL;
        }
        while let Some(due) = self.echoes.iter().position(|(at, _)| *at <= now) {
            let (_, place) = self.echoes.remove(due);
            self.send(place, outbox);
        }
    }

    pub fn poll_timeout(&self) -> Option<Timestamp> {
        let list = (!self.pending.is_empty()).then_some(self.next);
        self.echoes.iter().map(|(at, _)| *at).chain(list).min()
    }

    fn place(&self, name: &str) -> Option<usize> {
        self.list.iter().position(|parameter| parameter.name == name)
    }

    /// A value that may not be written leaves the old one.
    fn write(&mut self, place: usize, raw: f32) {
        let Parameter { value: old, writable, .. } = &self.list[place];
        let new = self.decode(*old, raw);
        let number = match new {
            ParameterValue::Short(value) => f64::from(value),
            ParameterValue::Integer(value) => f64::from(value),
            ParameterValue::Float(value) => f64::from(value),
        };
        let may = match writable {
            Writable::Anything => true,
            Writable::Within(range) => (f64::from(*range.start())..=f64::from(*range.end())).contains(&number),
            Writable::Nothing => false,
        };
        if may {
            self.list[place].value = new;
        }
    }

    fn decode(&self, old: ParameterValue, raw: f32) -> ParameterValue {
        // A float cast saturates, and turns NaN into 0.
        match (old, self.encoding) {
            (ParameterValue::Float(_), _) => ParameterValue::Float(raw),
            (ParameterValue::Integer(_), IntegerEncoding::Bytewise) => {
                ParameterValue::Integer(raw.to_bits().cast_signed())
            }
            (ParameterValue::Integer(_), IntegerEncoding::CCast) => ParameterValue::Integer(raw.round() as i32),
            (ParameterValue::Short(_), IntegerEncoding::Bytewise) => {
                ParameterValue::Short((raw.to_bits() as u16).cast_signed())
            }
            (ParameterValue::Short(_), IntegerEncoding::CCast) => ParameterValue::Short(raw.round() as i16),
        }
    }

    fn send(&self, place: usize, outbox: &mut Outbox) {
        let Parameter { name, index, value, .. } = &self.list[place];
        let (param_value, param_type) = match (*value, self.encoding) {
            (ParameterValue::Float(value), _) => (value, REAL32),
            (ParameterValue::Integer(value), IntegerEncoding::Bytewise) => (f32::from_bits(bits(value)), INT32),
            (ParameterValue::Integer(value), IntegerEncoding::CCast) => (value as f32, INT32),
            (ParameterValue::Short(value), IntegerEncoding::Bytewise) => {
                (f32::from_bits(u32::from(value.cast_unsigned())), INT16)
            }
            (ParameterValue::Short(value), IntegerEncoding::CCast) => (f32::from(value), INT16),
        };
        outbox.send(&PARAM_VALUE_DATA {
            param_id: CharArray::from(*name),
            param_value,
            param_type,
            param_count: self.count(),
            param_index: *index,
        });
    }

    /// With the places that are free.
    fn count(&self) -> u16 {
        self.list.last().map_or(0, |parameter| parameter.index + 1)
    }

    fn send_hash(&self, outbox: &mut Outbox) {
        outbox.send(&PARAM_VALUE_DATA {
            param_id: CharArray::from(HASH_CHECK),
            param_value: f32::from_bits(self.hash()),
            param_type: UINT32,
            param_count: self.count(),
            param_index: u16::MAX,
        });
    }

    /// CRC-32 over name and value bits of every parameter in order, started at 0 and not inverted at the end.
    fn hash(&self) -> u32 {
        let mut crc = 0;
        for Parameter { name, value, .. } in &self.list {
            let bits = match *value {
                ParameterValue::Short(value) => bits(i32::from(value)),
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
mod tests;
