//! How a gimbal that does not say so sends its integers: found out from what it sends.
//!
//! Sent as their bits, small integers look like floats next to zero, and negative ones like no number; sent as their value
//! they look like whole numbers. Zero looks the same either way. Bits that happen to look like a whole number are those of
//! integers beyond a thousand million, which no other value that the gimbal has will confirm.

use super::encoding::{self, Encoding};

/// What the values told so far say.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Evidence {
    bytewise: bool,
    c_cast: bool,
}

impl Evidence {
    pub fn weigh(&mut self, raw: f32, kind: u8) {
        let Some((least, most)) = encoding::range(kind) else { return };
        let value = f64::from(raw);
        if value == 0.0 {
            return;
        }
        // A float next to zero is no whole number.
        let is_whole = value.is_finite() && value.fract() == 0.0 && (least..=most).contains(&value);
        self.c_cast |= is_whole;
        self.bytewise |= !is_whole;
    }

    /// Whether an integer was told by which it can be seen.
    pub const fn is_decided(self) -> bool {
        self.bytewise || self.c_cast
    }

    /// Undecided, as bits: a gimbal that takes them for a value reads next to nothing, while one that takes a value for bits
    /// would read a thousand million.
    pub const fn encoding(self) -> Encoding {
        if self.c_cast && !self.bytewise { Encoding::CCast } else { Encoding::Bytewise }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const INT8: u8 = 2;
    const UINT32: u8 = 5;
    const INT32: u8 = 6;
    const REAL32: u8 = 9;

    /// "PARAM_ENCODE_BYTEWISE" and "PARAM_ENCODE_C_CAST": the same integers in both, and what tells them apart.
    #[test]
    fn integers_tell_how_they_are_sent() {
        let bits = f32::from_bits;
        let undecided = Evidence::default();
        let bytewise = Evidence { bytewise: true, c_cast: false };
        let c_cast = Evidence { bytewise: false, c_cast: true };
        for (told, expected) in [
            (vec![(154.0, INT32)], c_cast),
            (vec![(bits(154), INT32)], bytewise),
            (vec![(-1.0, INT8)], c_cast),
            (vec![(bits(0xff), INT8)], bytewise),
            (vec![(bits(0xffff_fffd), INT32)], bytewise),
            (vec![(4_000_000_000.0, UINT32)], c_cast),
            // Floats say nothing, and neither does zero.
            (vec![(1.0, REAL32), (0.0, INT32), (f32::NAN, REAL32)], undecided),
        ] {
            let mut evidence = Evidence::default();
            for (raw, kind) in &told {
                evidence.weigh(*raw, *kind);
            }
            assert_eq!(evidence, expected, "{told:?}");
        }
        assert_eq!(undecided.encoding(), Encoding::Bytewise);
        // The bits of a large one look like a value; those of any other do not.
        let mut mixed = c_cast;
        mixed.weigh(bits(7), INT32);
        assert_eq!(mixed.encoding(), Encoding::Bytewise);
    }
}
