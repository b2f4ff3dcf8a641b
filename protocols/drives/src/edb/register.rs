//! Addresses of the registers, and the subset of them that the gateway needs.
//!
//! Confidence is given per item as in the [module documentation](super).

use core::ops::RangeInclusive;
use serde::{Deserialize, Serialize};

/// Parameters: the address is the Pn number, so Pn037 is 0025h. Read and write. Thesis, ProNet.
pub const PARAMETERS: RangeInclusive<u16> = 0x0000..=0x02FD;

/// The last ten alarm numbers, as in [`alarm_name`](super::alarm_name); which end is the newest is assumed: the first.
/// Read only. ProNet.
pub const ALARM_HISTORY: RangeInclusive<u16> = 0x07F1..=0x07FA;

/// Zero offset of the speed reference; unit not found. Read only. ProNet.
pub const SPEED_REFERENCE_OFFSET: u16 = 0x07FB;

/// Zero offset of the torque reference; unit not found. Read only. ProNet.
pub const TORQUE_REFERENCE_OFFSET: u16 = 0x07FC;

/// Zero offset of the phase current Iu; unit not found. Read only. ProNet.
pub const IU_OFFSET: u16 = 0x07FD;

/// Zero offset of the phase current Iv; unit not found. Read only. ProNet.
pub const IV_OFFSET: u16 = 0x07FE;

/// Speed feedback, r/min, signed. Read only. ProNet. First word of the [monitor block](super::Monitor).
pub const SPEED_FEEDBACK: u16 = 0x0806;

/// Speed reference, r/min, signed. Read only. ProNet.
pub const SPEED_REFERENCE: u16 = 0x0807;

/// Torque reference, % of rated torque, signed. Read only. ProNet.
pub const TORQUE_REFERENCE: u16 = 0x0808;

/// Internal torque reference, % of rated torque, signed. Read only. ProNet.
pub const INTERNAL_TORQUE_REFERENCE: u16 = 0x0809;

/// Encoder rotation pulses. Read only. ProNet.
pub const ENCODER_PULSES: u16 = 0x080A;

/// Input signals, bits; their meaning was not found. Read only. ProNet.
pub const INPUT_SIGNALS: u16 = 0x080B;

/// Encoder signals, bits; their meaning was not found. Read only. ProNet.
pub const ENCODER_SIGNALS: u16 = 0x080C;

/// Output signals, bits; their meaning was not found. Read only. ProNet.
pub const OUTPUT_SIGNALS: u16 = 0x080D;

/// Pulse setting (reference pulse). Read only. ProNet.
pub const PULSE_SETTING: u16 = 0x080E;

/// Present position, low word: pulses, 0 to 9999. Read only. ProNet. See [`position`](super::position).
pub const POSITION_LOW: u16 = 0x080F;

/// Present position, high word: 10 000 pulses. Read only. ProNet. See [`position`](super::position).
pub const POSITION_HIGH: u16 = 0x0810;

/// Error counter, low 16 bits of a binary 32-bit number of pulses. Read only. ProNet.
pub const ERROR_COUNTER_LOW: u16 = 0x0811;

/// Error counter, high 16 bits of a binary 32-bit number of pulses. Read only. ProNet.
pub const ERROR_COUNTER_HIGH: u16 = 0x0812;

/// Set-pulse counter, low word: pulses, 0 to 9999. Read only. ProNet.
pub const SET_PULSES_LOW: u16 = 0x0813;

/// Set-pulse counter, high word: 10 000 pulses. Read only. ProNet.
pub const SET_PULSES_HIGH: u16 = 0x0814;

/// Load inertia, % (ProNet); HAL calls it load. Read only.
pub const LOAD_INERTIA: u16 = 0x0815;

/// Motor overload, %. Read only. ProNet.
pub const MOTOR_OVERLOAD: u16 = 0x0816;

/// Number of the present alarm, 0 for none; see [`alarm_name`](super::alarm_name). Read only. ProNet.
pub const ALARM: u16 = 0x0817;

/// I/O signals set over the network, bits; their meaning was not found. Lost at power off. Read and write. ProNet.
/// With Pn216 other than 0 these bits may enable the servo or move the motor.
pub const IO_SIGNALS: u16 = 0x0900;

/// Status word, see [`Status`](super::Status). Read only. Thesis, HAL.
pub const STATUS: u16 = 0x0901;

/// Software version; HAL reads D201h as "D-2.01". Read only. HAL, low for EDB.
pub const SOFTWARE_VERSION: u16 = 0x090E;

/// CPLD version. Read only. HAL, low for EDB.
pub const CPLD_VERSION: u16 = 0x090F;

/// Read by the thesis to search for a drive (table 4.5), with the reply decoded as a status word. Not in the ProNet
/// table; low.
pub const SEARCH: u16 = 0x1000;

/// Revolutions of a 17-bit multi-turn encoder. Read only. ProNet; the single-turn rows that follow were not found.
pub const MULTI_TURN: u16 = 0x1010;

/// Clears the alarm history: write 1. HAL, low for EDB.
pub const CLEAR_HISTORY: u16 = 0x1021;

/// Clears the present alarm: write 1. HAL, assumed for EDB.
pub const CLEAR_ALARM: u16 = 0x1022;

/// JOG servo enable: 1 = on, 0 = off. HAL, assumed for EDB.
pub const JOG_ENABLE: u16 = 0x1023;

/// JOG forward: 1 = on, 0 = off, at the speed of Pn037. HAL, assumed for EDB.
pub const JOG_FORWARD: u16 = 0x1024;

/// JOG reverse: 1 = on, 0 = off, at the speed of Pn037. HAL, assumed for EDB.
pub const JOG_REVERSE: u16 = 0x1025;

/// The register addresses that the gateway uses. The default is the family's; a configuration may override each one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Registers {
    /// Status word, default [`STATUS`].
    pub status: u16,
    /// Speed feedback and first word of the [monitor block](super::Monitor), default [`SPEED_FEEDBACK`].
    pub speed_feedback: u16,
    /// Number of the present alarm, default [`ALARM`].
    pub alarm: u16,
    /// First of the ten words of the alarm history, default the start of [`ALARM_HISTORY`].
    pub alarm_history: u16,
    /// JOG speed, r/min, default 0025h (Pn037). Thesis.
    pub jog_speed: u16,
    /// Clears the present alarm, default [`CLEAR_ALARM`], assumed.
    pub clear_alarm: u16,
    /// JOG servo enable, default [`JOG_ENABLE`], assumed.
    pub jog_enable: u16,
    /// JOG forward, default [`JOG_FORWARD`], assumed.
    pub jog_forward: u16,
    /// JOG reverse, default [`JOG_REVERSE`], assumed.
    pub jog_reverse: u16,
}

impl Default for Registers {
    fn default() -> Self {
        Self {
            status: STATUS,
            speed_feedback: SPEED_FEEDBACK,
            alarm: ALARM,
            alarm_history: *ALARM_HISTORY.start(),
            jog_speed: super::Parameter::JOG_SPEED.address(),
            clear_alarm: CLEAR_ALARM,
            jog_enable: JOG_ENABLE,
            jog_forward: JOG_FORWARD,
            jog_reverse: JOG_REVERSE,
        }
    }
}

impl Registers {
    /// An address that two of the registers written to have, with which one command would carry out another.
    pub fn written_twice(&self) -> Option<u16> {
        let written = [self.jog_speed, self.clear_alarm, self.jog_enable, self.jog_forward, self.jog_reverse];
        let again = |(at, address): &(usize, &u16)| written.iter().take(*at).any(|other| other == *address);
        written.iter().enumerate().find(again).map(|(_, address)| *address)
    }
}

#[cfg(test)]
mod tests {
    use super::Registers;

    #[test]
    fn registers_written_to_are_told_apart() {
        let family = Registers::default();
        assert_eq!(family.written_twice(), None);
        assert_eq!(Registers { status: family.jog_forward, ..family }.written_twice(), None);
        assert_eq!(Registers { jog_reverse: 0x1024, ..family }.written_twice(), Some(0x1024));
        assert_eq!(Registers { jog_speed: 0x1022, ..family }.written_twice(), Some(0x1022));
    }
}
