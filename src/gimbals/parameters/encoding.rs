//! How a value travels in the float field of `PARAM_VALUE` and `PARAM_SET`.

use crate::wire::dialect::CharArray;

/// The length of `param_id`, which has no terminator where a name fills it.
const NAME_LEN: usize = 16;

/// `MAV_PARAM_TYPE`.
mod kind {
    pub const UINT8: u8 = 1;
    pub const INT8: u8 = 2;
    pub const UINT16: u8 = 3;
    pub const INT16: u8 = 4;
    pub const UINT32: u8 = 5;
    pub const INT32: u8 = 6;
    pub const REAL32: u8 = 9;
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Encoding {
    /// Every value is an int16, sent as that number.
    Int16AsNumber,
    /// By its `param_type`, integers as their bits (`MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_BYTEWISE`).
    Bytewise,
    /// By its `param_type`, integers as their value (`MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_C_CAST`).
    CCast,
}

impl Encoding {
    /// The number that was sent; `None` where it is none, or a type that is not known.
    pub fn decode(self, raw: f32, kind: u8) -> Option<f64> {
        let value = match (self, kind) {
            (Self::Int16AsNumber | Self::CCast, _) | (Self::Bytewise, kind::REAL32) => f64::from(raw),
            (Self::Bytewise, _) => {
                let [a, b, c, d] = raw.to_bits().to_le_bytes();
                match kind {
                    kind::UINT8 => f64::from(a),
                    kind::INT8 => f64::from(i8::from_le_bytes([a])),
                    kind::UINT16 => f64::from(u16::from_le_bytes([a, b])),
                    kind::INT16 => f64::from(i16::from_le_bytes([a, b])),
                    kind::UINT32 => f64::from(u32::from_le_bytes([a, b, c, d])),
                    kind::INT32 => f64::from(i32::from_le_bytes([a, b, c, d])),
                    _ => return None,
                }
            }
        };
        value.is_finite().then_some(value)
    }

    /// The bits of the field for a value, or what is wrong with it. `kind` as the gimbal told it.
    pub fn encode(self, value: f64, kind: impl Into<Option<u8>>) -> Result<u32, String> {
        let kind = self.kind(kind.into());
        if !(value as f32).is_finite() {
            return Err("a parameter is a finite number".to_owned());
        }
        if let Some((least, most)) = range(kind)
            && (value.fract() != 0.0 || value < least || value > most)
        {
            return Err(format!("{value} is no whole number from {least} to {most}"));
        }
        if self == Self::Bytewise && kind != kind::REAL32 && range(kind).is_none() {
            return Err(format!("the gimbal gives this parameter a type that PARAM_SET cannot carry ({kind})"));
        }
        if self != Self::Bytewise || kind == kind::REAL32 {
            // Adding zero keeps −0 off the wire.
            return Ok((value as f32 + 0.0).to_bits());
        }
        // Within the range of its type, so nothing is cut off; a negative one is its two's complement.
        Ok(match kind {
            kind::UINT8 | kind::UINT16 | kind::UINT32 => value as u32,
            kind::INT8 => u32::from((value as i8).cast_unsigned()),
            kind::INT16 => u32::from((value as i16).cast_unsigned()),
            _ => (value as i32).cast_unsigned(),
        })
    }

    /// The field and the type to be sent with it, of a value that [`encode`](Self::encode) takes.
    pub fn encode_typed(self, value: f64, kind: Option<u8>) -> (f32, u8) {
        let bits = self.encode(value, kind).unwrap_or_else(|_| (value as f32).to_bits());
        (f32::from_bits(bits), self.kind(kind))
    }

    fn kind(self, told: Option<u8>) -> u8 {
        match self {
            Self::Int16AsNumber => kind::INT16,
            Self::Bytewise | Self::CCast => told.unwrap_or(kind::REAL32),
        }
    }
}

/// The integers that a type holds, at its ends; `None` where it is none.
pub fn range(kind: u8) -> Option<(f64, f64)> {
    match kind {
        kind::UINT8 => Some((0.0, f64::from(u8::MAX))),
        kind::INT8 => Some((f64::from(i8::MIN), f64::from(i8::MAX))),
        kind::UINT16 => Some((0.0, f64::from(u16::MAX))),
        kind::INT16 => Some((f64::from(i16::MIN), f64::from(i16::MAX))),
        kind::UINT32 => Some((0.0, f64::from(u32::MAX))),
        kind::INT32 => Some((f64::from(i32::MIN), f64::from(i32::MAX))),
        _ => None,
    }
}

/// Whether a type holds whole numbers alone.
pub fn is_whole(kind: u8) -> bool {
    range(kind).is_some()
}

/// The name up to its first NUL; `None` where it is empty or no name.
pub fn read_name(raw: &CharArray<NAME_LEN>) -> Option<&str> {
    let bytes: &[u8; NAME_LEN] = raw;
    let end = bytes.iter().position(|byte| *byte == 0).unwrap_or(NAME_LEN);
    let name = std::str::from_utf8(&bytes[..end]).ok()?;
    check_name(name).is_ok().then_some(name)
}

/// What is wrong with a name.
pub fn check_name(name: &str) -> Result<(), String> {
    let is_name = |byte: u8| byte.is_ascii_graphic();
    if name.is_empty() || name.len() > NAME_LEN || !name.bytes().all(is_name) {
        return Err(format!("the name of a parameter has 1 to {NAME_LEN} ASCII characters without blanks"));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[rustfmt::skip]
    fn values_come_back_in_every_encoding() {
        for (encoding,               kind,         value,      bits) in [
            (Encoding::Int16AsNumber, kind::INT16,      45.0,  45.0_f32.to_bits()),
            // Whatever type the gimbal names, it is the number.
            (Encoding::Int16AsNumber, kind::REAL32,    -45.0,  (-45.0_f32).to_bits()),
            (Encoding::CCast,         kind::INT32,      -7.0,  (-7.0_f32).to_bits()),
            (Encoding::CCast,         kind::REAL32,      0.5,  0.5_f32.to_bits()),
            (Encoding::Bytewise,      kind::REAL32,      0.5,  0.5_f32.to_bits()),
            (Encoding::Bytewise,      kind::UINT8,     200.0,  200),
            (Encoding::Bytewise,      kind::INT8,       -1.0,  0xff),
            (Encoding::Bytewise,      kind::UINT16,  40_000.0, 40_000),
            (Encoding::Bytewise,      kind::INT16,      -2.0,  0xfffe),
            (Encoding::Bytewise,      kind::UINT32,  70_000.0, 70_000),
            (Encoding::Bytewise,      kind::INT32,      -3.0,  0xffff_fffd),
        ] {
            assert_eq!(encoding.encode(value, kind), Ok(bits), "{encoding:?} {kind} {value}");
            assert_eq!(encoding.decode(f32::from_bits(bits), kind), Some(value), "{encoding:?} {kind} {value}");
        }
    }

    #[test]
    #[rustfmt::skip]
    fn what_is_no_value_is_refused() {
        for (encoding,                kind,         value,     problem) in [
            (Encoding::Int16AsNumber, kind::INT16,  0.5,       "0.5 is no whole number from -32768 to 32767"),
            (Encoding::Int16AsNumber, kind::INT16,  40_000.0,  "40000 is no whole number from -32768 to 32767"),
            (Encoding::Bytewise,      kind::UINT8,  -1.0,      "-1 is no whole number from 0 to 255"),
            (Encoding::Bytewise,      kind::REAL32, f64::NAN,  "a parameter is a finite number"),
            (Encoding::CCast,         kind::REAL32, 1e300,     "a parameter is a finite number"),
            (Encoding::Bytewise,      10,           1.0,       "the gimbal gives this parameter a type that PARAM_SET cannot carry (10)"),
        ] {
            assert_eq!(encoding.encode(value, kind), Err(problem.to_owned()));
        }
        assert_eq!(Encoding::CCast.decode(f32::NAN, kind::REAL32), None);
        assert_eq!(Encoding::Bytewise.decode(1.0, 77), None);
    }

    #[test]
    fn a_name_may_fill_the_field_and_has_no_control_characters() {
        assert_eq!(read_name(&CharArray::from("RC_REVERSE_AXISX")), Some("RC_REVERSE_AXISX"));
        assert_eq!(read_name(&CharArray::from("STIFF_TILT")), Some("STIFF_TILT"));
        assert_eq!(read_name(&CharArray::from("")), None);
        assert_eq!(read_name(&CharArray::from("A\u{1b}[2J")), None);
        assert!(check_name("SEVENTEEN_LETTERS").is_err());
    }
}
