//! Absolute encoders on the synchronous serial interface (SSI).
//!
//! The controller clocks, the encoder answers with its code, most significant bit first. The data line is high at rest;
//! after the last bit the encoder holds it low for the time of its monoflop. A controller that samples the line once
//! before the first data bit and once after the last one sees `1 | code | parity, if any | 0`, and so tells an encoder
//! from a line that is torn or shorted.

use super::{EncoderFault, Width};

/// The bit after the code that makes the number of ones even or odd, in code and parity bit together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Parity {
    /// An even number of ones.
    Even,
    /// An odd number of ones.
    Odd,
}

/// How an encoder's answer is made up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Format {
    /// Bits of the code.
    pub width: Width,
    /// The parity bit; few encoders have one.
    pub parity: Option<Parity>,
}

impl Format {
    /// Samples of the data line that make an answer: 3 to 35.
    pub const fn samples(self) -> u8 {
        self.width.bits() + self.parity.is_some() as u8 + 2
    }

    /// The code in an answer whose last sample is bit 0 of `line`; it may be Gray or binary.
    ///
    /// [`EncoderFault::Line`] where the line was not high before the code and low after it or where `line` has bits
    /// above the first sample, [`EncoderFault::Parity`] where the number of ones is not as it should be.
    pub const fn decode(self, line: u64) -> Result<u32, EncoderFault> {
        let rest = self.samples() - 1;
        if line >> rest != 1 || line & 1 != 0 {
            return Err(EncoderFault::Line);
        }
        let answer = (line & !(1 << rest)) >> 1;
        let odd = answer.count_ones() & 1 == 1;
        let code = match self.parity {
            None => answer,
            Some(Parity::Even) if !odd => answer >> 1,
            Some(Parity::Odd) if odd => answer >> 1,
            Some(_) => return Err(EncoderFault::Parity),
        };
        Ok(code as u32)
    }

    /// The answer of an encoder at `code`, as [`Format::decode`] takes it; bits of the code above its width are dropped.
    pub const fn encode(self, code: u32) -> u64 {
        let code = (code & self.width.max()) as u64;
        let odd = (code.count_ones() & 1) as u64;
        let answer = match self.parity {
            None => code,
            Some(Parity::Even) => code << 1 | odd,
            Some(Parity::Odd) => code << 1 | (odd ^ 1),
        };
        1 << (self.samples() - 1) | answer << 1
    }
}

#[cfg(test)]
mod tests {
    use super::super::gray;
    use super::*;
    use proptest::prelude::*;

    const fn format(bits: u8, parity: Option<Parity>) -> Format {
        Format { width: Width::new(bits).expect("width"), parity }
    }

    #[test]
    fn a_gray_answer_by_hand() {
        // 1, the code 1 0110 0000 1101, 0. Each bit of the number is the parity of the code's bits from the left up to it.
        let line = 0b110_1100_0001_1010;
        let code = format(13, None).decode(line).expect("code");
        assert_eq!(code, 0b1_0110_0000_1101);
        assert_eq!(gray::to_binary(code), 0b1_1011_1111_0110);
    }

    #[test]
    fn parity_by_hand() {
        // 1, the code 1011, its parity, 0.
        let (one, zero) = (0b110_1110, 0b110_1100);
        let even = format(4, Some(Parity::Even));
        assert_eq!((even.decode(one), even.decode(zero)), (Ok(0b1011), Err(EncoderFault::Parity)));
        let odd = format(4, Some(Parity::Odd));
        assert_eq!((odd.decode(zero), odd.decode(one)), (Ok(0b1011), Err(EncoderFault::Parity)));
    }

    #[test]
    fn a_dead_line_is_no_position() {
        for format in
            [format(1, None), format(13, None), format(25, Some(Parity::Odd)), format(32, Some(Parity::Even))]
        {
            let torn = (1 << format.samples()) - 1;
            assert_eq!(format.decode(torn), Err(EncoderFault::Line), "always high");
            assert_eq!(format.decode(0), Err(EncoderFault::Line), "always low");
            assert_eq!(format.decode(u64::MAX), Err(EncoderFault::Line));
        }
    }

    proptest! {
        #[test]
        fn both_ways(bits in 1..=32_u8, code in any::<u32>(), parity in 0..3) {
            let format = format(bits, [None, Some(Parity::Even), Some(Parity::Odd)][parity as usize]);
            let line = format.encode(code);
            prop_assert_eq!(format.decode(line), Ok(code & format.width.max()));
            if format.parity.is_some() {
                for bit in 0..format.samples() {
                    prop_assert!(format.decode(line ^ 1 << bit).is_err(), "one bit wrong: {}", bit);
                }
            }
        }

        #[test]
        fn any_samples_decode_or_are_refused(bits in 1..=32_u8, line in any::<u64>(), odd in any::<bool>()) {
            let parity = if odd { Parity::Odd } else { Parity::Even };
            for parity in [None, Some(parity)] {
                let format = format(bits, parity);
                match format.decode(line) {
                    Ok(code) => prop_assert_eq!(format.encode(code), line),
                    Err(fault) => prop_assert!(matches!(fault, EncoderFault::Line | EncoderFault::Parity)),
                }
            }
        }
    }
}
