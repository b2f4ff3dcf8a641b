//! The longitudinal redundancy check of ASCII frames (serial line V1.02, clause 2.5.2.2).

/// The two's complement of the sum of `bytes` modulo 256, so that a frame's bytes and its LRC add up to 0.
pub fn lrc(bytes: &[u8]) -> u8 {
    bytes.iter().fold(0, |sum: u8, byte| sum.wrapping_sub(*byte))
}
