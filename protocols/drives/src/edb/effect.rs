//! What a raw request does to a drive.

use super::Registers;
use puente_modbus::Words;
use puente_modbus::request::Request;

/// What a request does to a drive, as far as the request itself tells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Effect {
    /// Changes nothing.
    Read,
    /// May change something in the drive, but no JOG register to anything that moves.
    Write,
    /// Sets a JOG register to something that is not known to be 0: the motor may start, or stay under way.
    Motion,
    /// Writes zeros to JOG registers and nothing else: the motor stops or stays at rest.
    Stop,
}

/// Classifies a request to an EDB drive by the JOG registers that it writes: enable, forward and reverse.
///
/// Functions 06, 10h, 16h and 17h are looked into; every other function that may change the drive, and every function
/// without a type, is a [`Effect::Write`]. A mask write (16h) is a [`Effect::Stop`] only where its masks leave 0 of any
/// value. Other ways to move a motor are not seen: the I/O signal word 0900h where Pn216 gives inputs to the network,
/// and Pn037 during a JOG count as [`Effect::Write`].
pub fn effect(registers: &Registers, request: &Request<'_>) -> Effect {
    match *request {
        Request::WriteSingleRegister { address, value } => writes(registers, [(Some(address), value == 0)]),
        Request::MaskWriteRegister { address, and_mask, or_mask } => {
            // The result is (present AND and_mask) OR (or_mask AND NOT and_mask).
            writes(registers, [(Some(address), and_mask == 0 && or_mask == 0)])
        }
        Request::WriteMultipleRegisters { address, words } => writes(registers, numbered(address, words)),
        Request::ReadWriteMultipleRegisters { write_address, words, .. } => {
            writes(registers, numbered(write_address, words))
        }
        _ if request.is_write() => Effect::Write,
        _ => Effect::Read,
    }
}

/// The addresses written, `None` past the last one, and whether 0 goes there.
fn numbered(address: u16, words: Words<'_>) -> impl Iterator<Item = (Option<u16>, bool)> {
    (0..).zip(words.iter()).map(move |(at, word)| (address.checked_add(at), word == 0))
}

fn writes(registers: &Registers, written: impl IntoIterator<Item = (Option<u16>, bool)>) -> Effect {
    let jog = [registers.jog_enable, registers.jog_forward, registers.jog_reverse];
    let mut effect = None;
    for (address, zero) in written {
        let word = match address {
            Some(address) if jog.contains(&address) && zero => Effect::Stop,
            Some(address) if jog.contains(&address) => return Effect::Motion,
            _ => Effect::Write,
        };
        effect = match effect {
            None | Some(Effect::Stop) => Some(word),
            other => other,
        };
    }
    effect.unwrap_or(Effect::Write)
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use proptest::prelude::*;
    use std::vec::Vec;

    fn of(pdu: &[u8]) -> Effect {
        effect(&Registers::default(), &Request::parse(pdu).expect("a request"))
    }

    #[test]
    fn single_writes() {
        assert_eq!(of(&[0x06, 0x10, 0x23, 0, 1]), Effect::Motion);
        assert_eq!(of(&[0x06, 0x10, 0x24, 0, 1]), Effect::Motion);
        assert_eq!(of(&[0x06, 0x10, 0x25, 1, 0]), Effect::Motion, "anything but 0");
        for register in [0x23, 0x24, 0x25] {
            assert_eq!(of(&[0x06, 0x10, register, 0, 0]), Effect::Stop);
        }
        assert_eq!(of(&[0x06, 0x10, 0x22, 0, 1]), Effect::Write, "clear alarm");
        assert_eq!(of(&[0x06, 0x10, 0x26, 0, 1]), Effect::Write);
        assert_eq!(of(&[0x06, 0x00, 0x25, 0, 100]), Effect::Write, "Pn037");
    }

    #[test]
    fn multiple_writes() {
        assert_eq!(of(&[0x10, 0x10, 0x23, 0, 3, 6, 0, 0, 0, 0, 0, 0]), Effect::Stop);
        assert_eq!(of(&[0x10, 0x10, 0x23, 0, 3, 6, 0, 0, 0, 1, 0, 0]), Effect::Motion);
        assert_eq!(of(&[0x10, 0x10, 0x22, 0, 3, 6, 0, 1, 0, 0, 0, 1]), Effect::Motion, "forward is last");
        assert_eq!(of(&[0x10, 0x10, 0x22, 0, 2, 4, 0, 0, 0, 0]), Effect::Write, "more than JOG registers");
        assert_eq!(of(&[0x10, 0x10, 0x25, 0, 2, 4, 0, 0, 0, 0]), Effect::Write, "more than JOG registers");
        assert_eq!(of(&[0x10, 0x00, 0x25, 0, 1, 2, 0, 1]), Effect::Write);
        assert_eq!(of(&[0x10, 0xFF, 0xFF, 0, 2, 4, 0, 1, 0, 1]), Effect::Write, "past the last address");
    }

    #[test]
    fn mask_writes() {
        assert_eq!(of(&[0x16, 0x10, 0x24, 0, 0, 0, 0]), Effect::Stop);
        assert_eq!(of(&[0x16, 0x10, 0x24, 0, 0, 0, 1]), Effect::Motion);
        assert_eq!(of(&[0x16, 0x10, 0x24, 0xFF, 0xFE, 0, 0]), Effect::Motion, "the other bits stay");
        assert_eq!(of(&[0x16, 0x10, 0x22, 0, 0, 0, 1]), Effect::Write);
    }

    #[test]
    fn read_and_write_in_one() {
        let request = |register, value| [0x17, 0x09, 0x01, 0, 1, 0x10, register, 0, 1, 2, 0, value];
        assert_eq!(of(&request(0x24, 1)), Effect::Motion);
        assert_eq!(of(&request(0x24, 0)), Effect::Stop);
        assert_eq!(of(&request(0x22, 1)), Effect::Write);
    }

    #[test]
    fn all_other_functions() {
        for function in 1..=4 {
            assert_eq!(of(&[function, 0x10, 0x24, 0, 1]), Effect::Read);
        }
        assert_eq!(of(&[0x05, 0x10, 0x24, 0xFF, 0]), Effect::Write);
        assert_eq!(of(&[0x0F, 0x10, 0x23, 0, 3, 1, 7]), Effect::Write);
        assert_eq!(of(&[0x11]), Effect::Read);
        assert_eq!(of(&[0x2B, 0x0E, 1, 0]), Effect::Read);
        assert_eq!(of(&[0x41, 0x10, 0x24, 0, 1]), Effect::Write, "no type");
    }

    #[test]
    fn configured_registers_count() {
        let registers = Registers { jog_forward: 0x2000, ..Registers::default() };
        let write = |address| Request::WriteSingleRegister { address, value: 1 };
        assert_eq!(effect(&registers, &write(0x2000)), Effect::Motion);
        assert_eq!(effect(&registers, &write(0x1024)), Effect::Write);
    }

    proptest! {
        #[test]
        fn any_pdu_is_classified_without_panic(pdu in prop::collection::vec(any::<u8>(), 0..253)) {
            if let Ok(request) = Request::parse(&pdu) {
                let effect = effect(&Registers::default(), &request);
                prop_assert_eq!(effect != Effect::Read, request.is_write());
            }
        }

        #[test]
        fn a_run_of_registers_moves_where_a_jog_register_gets_other_than_zero(
            first in 0x1018..0x1028_u16,
            values in prop::collection::vec(0..=1_u16, 1..20),
        ) {
            let bytes: Vec<u8> = values.iter().flat_map(|value| value.to_be_bytes()).collect();
            let request = Request::WriteMultipleRegisters { address: first, words: Words::from_bytes(&bytes) };
            let written = || (first..).zip(&values);
            let jog = |address| (0x1023..=0x1025).contains(&address);
            let expected = if written().any(|(address, value)| jog(address) && *value != 0) {
                Effect::Motion
            } else if written().all(|(address, _)| jog(address)) {
                Effect::Stop
            } else {
                Effect::Write
            };
            prop_assert_eq!(effect(&Registers::default(), &request), expected);
        }
    }
}
