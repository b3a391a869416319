//! CRC-16/MCRF4XX, the checksum of every MAVLink frame.

/// The checksum while bytes are being added.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Crc(u16);

impl Crc {
    pub const fn new() -> Self {
        Self(0xffff)
    }

    /// Adds `bytes`, eight at a time where there are as many.
    pub fn add(self, bytes: &[u8]) -> Self {
        let mut crc = self.0;
        let mut chunks = bytes.chunks_exact(8);
        for chunk in &mut chunks {
            crc = TABLES[7][usize::from(chunk[0] ^ crc as u8)]
                ^ TABLES[6][usize::from(chunk[1] ^ (crc >> 8) as u8)]
                ^ TABLES[5][usize::from(chunk[2])]
                ^ TABLES[4][usize::from(chunk[3])]
                ^ TABLES[3][usize::from(chunk[4])]
                ^ TABLES[2][usize::from(chunk[5])]
                ^ TABLES[1][usize::from(chunk[6])]
                ^ TABLES[0][usize::from(chunk[7])];
        }
        for byte in chunks.remainder() {
            crc = step(crc, *byte);
        }
        Self(crc)
    }

    /// Closes the checksum with the message's `CRC_EXTRA`.
    pub const fn finish(self, crc_extra: u8) -> u16 {
        step(self.0, crc_extra)
    }

    /// Whether there is any `CRC_EXTRA` with which the checksum would be `sum`.
    ///
    /// Each frame that was closed properly has one; of random bytes 1 in 256 has.
    pub fn can_finish_as(self, sum: u16) -> bool {
        TABLES[0].contains(&(sum ^ (self.0 >> 8)))
    }
}

const fn step(crc: u16, byte: u8) -> u16 {
    (crc >> 8) ^ TABLES[0][((crc ^ byte as u16) & 0xff) as usize]
}

/// `TABLES[n][b]`: what byte `b` contributes when `n` more bytes follow it.
static TABLES: [[u16; 256]; 8] = tables();

const fn tables() -> [[u16; 256]; 8] {
    let mut tables = [[0u16; 256]; 8];
    let mut byte = 0;
    while byte < 256 {
        let mut crc = byte as u16;
        let mut bit = 0;
        while bit < 8 {
            crc = if crc & 1 == 1 { (crc >> 1) ^ 0x8408 } else { crc >> 1 };
            bit += 1;
        }
        tables[0][byte] = crc;
        byte += 1;
    }
    let mut later = 1;
    while later < 8 {
        let mut byte = 0;
        while byte < 256 {
            let before = tables[later - 1][byte];
            tables[later][byte] = (before >> 8) ^ tables[0][(before & 0xff) as usize];
            byte += 1;
        }
        later += 1;
    }
    tables
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The check value of CRC-16/MCRF4XX in the catalogue of parametrised CRC algorithms.
    #[test]
    fn digits_have_the_catalogued_checksum() {
        assert_eq!(Crc::new().add(b"123456789"), Crc(0x6f91));
    }

    #[test]
    fn eight_bytes_at_a_time_is_the_same_as_one_at_a_time() {
        let bytes: Vec<u8> = (0..=255).map(|n: u8| n.wrapping_mul(37) ^ 0x5a).collect();
        for len in 0..bytes.len() {
            let singly = bytes[..len].iter().fold(Crc::new(), |crc, byte| crc.add(&[*byte]));
            assert_eq!(Crc::new().add(&bytes[..len]), singly, "{len} bytes");
        }
    }

    #[test]
    fn every_properly_closed_sum_can_be_explained_and_few_others() {
        let crc = Crc::new().add(b"gimbal");
        assert!((0..=255).all(|extra| crc.can_finish_as(crc.finish(extra))));
        assert_eq!((0..=u16::MAX).filter(|sum| crc.can_finish_as(*sum)).count(), 256);
    }
}
