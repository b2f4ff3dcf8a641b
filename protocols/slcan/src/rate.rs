//! Bit rates by their number.

/// A bit rate of the `S` command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rate {
    /// `S0`.
    K10,
    /// `S1`.
    K20,
    /// `S2`.
    K50,
    /// `S3`.
    K100,
    /// `S4`.
    K125,
    /// `S5`.
    K250,
    /// `S6`.
    K500,
    /// `S7`: **800 kbit/s with Lawicel's adapters, 750 kbit/s with CANable and in python-can**. Nothing tells which: ask the
    /// adapter's documentation.
    K800,
    /// `S8`.
    M1,
}

const RATES: [(Rate, u32); 9] = [
    (Rate::K10, 10_000),
    (Rate::K20, 20_000),
    (Rate::K50, 50_000),
    (Rate::K100, 100_000),
    (Rate::K125, 125_000),
    (Rate::K250, 250_000),
    (Rate::K500, 500_000),
    (Rate::K800, 800_000),
    (Rate::M1, 1_000_000),
];

impl Rate {
    /// The rate of so many bit/s; 750 000 is [`Rate::K800`] too.
    pub fn of(bits: u32) -> Option<Self> {
        let bits = if bits == 750_000 { 800_000 } else { bits };
        RATES.iter().find(|(_, other)| *other == bits).map(|(rate, _)| *rate)
    }

    /// In bit/s; of `S7` what Lawicel says.
    pub const fn bits(self) -> u32 {
        match self {
            Self::K10 => 10_000,
            Self::K20 => 20_000,
            Self::K50 => 50_000,
            Self::K100 => 100_000,
            Self::K125 => 125_000,
            Self::K250 => 250_000,
            Self::K500 => 500_000,
            Self::K800 => 800_000,
            Self::M1 => 1_000_000,
        }
    }

    /// The digit after `S`.
    pub const fn digit(self) -> u8 {
        b'0' + self as u8
    }

    /// The rate of a digit after `S`.
    pub fn of_digit(digit: u8) -> Option<Self> {
        RATES.iter().map(|(rate, _)| *rate).find(|rate| rate.digit() == digit)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// FACTS of python-can and Lawicel: S0 10k to S8 1M.
    #[test]
    fn rates_have_their_digits() {
        let digits = [10, 20, 50, 100, 125, 250, 500, 800, 1000];
        for (digit, kilobits) in (b'0'..).zip(digits) {
            let rate = Rate::of_digit(digit).expect("a rate");
            assert_eq!(rate.bits(), kilobits * 1000);
            assert_eq!(Rate::of(rate.bits()), Some(rate));
            assert_eq!(rate.digit(), digit);
        }
        assert_eq!(Rate::of(750_000), Some(Rate::K800));
        assert_eq!(Rate::of(83_300), None);
        assert_eq!(Rate::of_digit(b'9'), None);
    }
}
