//! The monitor block: what the motor does now.

/// The monitor block, 18 words from [`SPEED_FEEDBACK`](super::register::SPEED_FEEDBACK), which one read delivers.
///
/// Signed values are assumed to be two's complement.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Monitor {
    /// Speed feedback, r/min.
    pub speed_feedback: i16,
    /// Speed reference, r/min.
    pub speed_reference: i16,
    /// Torque reference, % of rated torque.
    pub torque_reference: i16,
    /// Internal torque reference, % of rated torque.
    pub internal_torque_reference: i16,
    /// Encoder rotation pulses.
    pub encoder_pulses: u16,
    /// Input signals, bits of unknown meaning.
    pub input_signals: u16,
    /// Encoder signals, bits of unknown meaning.
    pub encoder_signals: u16,
    /// Output signals, bits of unknown meaning.
    pub output_signals: u16,
    /// Pulse setting (reference pulse).
    pub pulse_setting: u16,
    /// Present position, pulses, see [`position`].
    pub position: i32,
    /// Error counter, pulses: a binary 32-bit number, unlike the position.
    pub error_counter: i32,
    /// Set-pulse counter, pulses, split like the position.
    pub set_pulses: i32,
    /// Load inertia, %.
    pub load_inertia: u16,
    /// Motor overload, %.
    pub motor_overload: u16,
    /// Number of the present alarm, 0 for none.
    pub alarm: u16,
}

impl Monitor {
    /// Words of the block.
    pub const WORDS: usize = 18;

    /// The values of a block read from the drive; `None` unless there are exactly [`Monitor::WORDS`] words.
    pub fn decode(words: impl IntoIterator<Item = u16>) -> Option<Self> {
        let mut words = words.into_iter();
        let mut block = [0; Self::WORDS];
        for word in &mut block {
            *word = words.next()?;
        }
        if words.next().is_some() {
            return None;
        }
        let [
            speed_feedback,
            speed_reference,
            torque_reference,
            internal_torque_reference,
            encoder_pulses,
            input_signals,
            encoder_signals,
            output_signals,
            pulse_setting,
            position_low,
            position_high,
            error_low,
            error_high,
            set_low,
            set_high,
            load_inertia,
            motor_overload,
            alarm,
        ] = block;
        Some(Self {
            speed_feedback: speed_feedback.cast_signed(),
            speed_reference: speed_reference.cast_signed(),
            torque_reference: torque_reference.cast_signed(),
            internal_torque_reference: internal_torque_reference.cast_signed(),
            encoder_pulses,
            input_signals,
            encoder_signals,
            output_signals,
            pulse_setting,
            position: position(position_low, position_high),
            error_counter: (u32::from(error_high) << 16 | u32::from(error_low)).cast_signed(),
            set_pulses: position(set_low, set_high),
            load_inertia,
            motor_overload,
            alarm,
        })
    }

    /// The block as a drive sends it.
    pub fn words(&self) -> [u16; Self::WORDS] {
        let (position_low, position_high) = position_words(self.position);
        let (set_low, set_high) = position_words(self.set_pulses);
        let error = self.error_counter.cast_unsigned();
        [
            self.speed_feedback.cast_unsigned(),
            self.speed_reference.cast_unsigned(),
            self.torque_reference.cast_unsigned(),
            self.internal_torque_reference.cast_unsigned(),
            self.encoder_pulses,
            self.input_signals,
            self.encoder_signals,
            self.output_signals,
            self.pulse_setting,
            position_low,
            position_high,
            error as u16,
            (error >> 16) as u16,
            set_low,
            set_high,
            self.load_inertia,
            self.motor_overload,
            self.alarm,
        ]
    }
}

/// Pulses of a counter that is split in decimal: `low + 10000 * high` (ProNet).
///
/// How a drive shows a negative position is not documented. Assumed: two's complement words, so that both -1 as
/// (9999, -1) and -1 as (-1, 0) are understood.
pub const fn position(low: u16, high: u16) -> i32 {
    low.cast_signed() as i32 + 10_000 * high.cast_signed() as i32
}

/// The (low, high) words of a counter that is split in decimal, the low word from 0 to 9999.
///
/// The counter wraps beyond what the high word holds, -327 680 000 to 327 679 999 pulses.
pub const fn position_words(pulses: i32) -> (u16, u16) {
    (pulses.rem_euclid(10_000) as u16, pulses.div_euclid(10_000) as u16)
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use proptest::prelude::*;
    use std::vec::Vec;

    #[test]
    fn positions() {
        assert_eq!(position(0, 0), 0);
        assert_eq!(position(9_999, 0), 9_999);
        assert_eq!(position(1, 1), 10_001);
        assert_eq!(position(9_999, 0xFFFF), -1);
        assert_eq!(position(0xFFFF, 0), -1);
        assert_eq!(position_words(-1), (9_999, 0xFFFF));
        assert_eq!(position_words(123_456), (3_456, 12));
        assert_eq!(position(9_999, 0x7FFF), 327_679_999);
        assert_eq!(position(0, 0x8000), -327_680_000);
        assert_eq!(position_words(327_680_000), (0, 0x8000), "wraps");
    }

    #[test]
    fn position_is_split_in_decimal_and_error_counter_in_binary() {
        let mut words = [0; Monitor::WORDS];
        words[9..13].copy_from_slice(&[1, 2, 3, 4]); // 080Fh to 0812h
        words[0] = 0xFFFF;
        words[17] = 14;
        let monitor = Monitor::decode(words).expect("18 words");
        assert_eq!(monitor.position, 20_001);
        assert_eq!(monitor.error_counter, 0x0004_0003);
        assert_eq!(monitor.speed_feedback, -1);
        assert_eq!(monitor.alarm, 14);
    }

    #[test]
    fn error_counter_may_be_negative() {
        let monitor = Monitor { error_counter: -2, ..Monitor::default() };
        assert_eq!(monitor.words()[11..13], [0xFFFE, 0xFFFF]);
        assert_eq!(Monitor::decode(monitor.words()), Some(monitor));
    }

    proptest! {
        #[test]
        fn only_a_whole_block_decodes(words in prop::collection::vec(any::<u16>(), 0..40)) {
            let count = words.len();
            prop_assert_eq!(Monitor::decode(words).is_some(), count == Monitor::WORDS);
        }

        #[test]
        fn what_is_decoded_encodes_to_the_same_values(words in prop::collection::vec(any::<u16>(), 18)) {
            let monitor = Monitor::decode(words.iter().copied()).expect("18 words");
            let encoded: Vec<u16> = monitor.words().into();
            // Words of odd counters (low word beyond 9999) are not unique; everything else is.
            prop_assert_eq!(&encoded[..9], &words[..9]);
            prop_assert_eq!(&encoded[11..13], &words[11..13]);
            prop_assert_eq!(&encoded[15..], &words[15..]);
        }

        #[test]
        fn positions_round_trip(pulses in -327_680_000..327_680_000_i32) {
            let (low, high) = position_words(pulses);
            prop_assert!(low < 10_000);
            prop_assert_eq!(position(low, high), pulses);
        }
    }
}
