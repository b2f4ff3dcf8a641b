//! The reflected Gray code of absolute encoders.
//!
//! Neighbours differ in one bit, the last and the first value too: a sample taken while the disc passes from one value to
//! the next is one or the other, never a third.

/// The number that a code of up to 32 bits stands for.
pub const fn to_binary(code: u32) -> u32 {
    let code = code ^ (code >> 16);
    let code = code ^ (code >> 8);
    let code = code ^ (code >> 4);
    let code = code ^ (code >> 2);
    code ^ (code >> 1)
}

/// The code of a number.
pub const fn from_binary(number: u32) -> u32 {
    number ^ (number >> 1)
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use proptest::prelude::*;
    use std::vec;

    #[test]
    fn four_bits_by_hand() {
        let codes = [
            0b0000, 0b0001, 0b0011, 0b0010, 0b0110, 0b0111, 0b0101, 0b0100, 0b1100, 0b1101, 0b1111, 0b1110,
            0b1010, 0b1011, 0b1001, 0b1000,
        ];
        for (number, code) in (0..).zip(codes) {
            assert_eq!((to_binary(code), from_binary(number)), (number, code));
        }
    }

    /// The code as it is defined: the codes of n + 1 bits are those of n bits, then the same backwards with the new bit.
    #[test]
    fn all_codes_of_16_bits_against_reflection() {
        let mut codes = vec![0_u32; 1 << 16];
        let mut length = 1;
        while length < codes.len() {
            for at in 0..length {
                codes[length + at] = codes[length - 1 - at] | length as u32;
            }
            length *= 2;
        }
        for (number, code) in (0..).zip(codes) {
            assert_eq!(to_binary(code), number, "{code:016b}");
            assert_eq!(from_binary(number), code, "{number}");
        }
    }

    #[test]
    fn neighbours_differ_in_one_bit_across_the_end_too() {
        for bits in 1..=16 {
            let last = (1_u32 << bits) - 1;
            for number in 0..=last {
                let next = if number == last { 0 } else { number + 1 };
                assert_eq!(
                    (from_binary(number) ^ from_binary(next)).count_ones(),
                    1,
                    "{bits} bits, {number}"
                );
            }
        }
    }

    proptest! {
        #[test]
        fn both_ways(number in any::<u32>()) {
            prop_assert_eq!(to_binary(from_binary(number)), number);
            prop_assert_eq!(from_binary(to_binary(number)), number);
        }
    }
}
