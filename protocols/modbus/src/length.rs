//! How long a PDU is, from its first bytes: what ends an RTU frame.

use crate::MAX_PDU;
use crate::function as fc;

/// Length of a PDU that may not be complete.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Length {
    /// So many bytes.
    Known(usize),
    /// The bytes that tell have not come yet.
    More,
    /// The function code does not tell; silence ends the frame.
    Silence,
    /// It cannot be a PDU of this kind.
    Never,
}

/// Of a reply.
pub(crate) fn reply(pdu: &[u8]) -> Length {
    match *pdu {
        [] => Length::More,
        [0 | fc::EXCEPTION, ..] => Length::Never,
        [fc::EXCEPTION..=0xFF, ..] => Length::Known(2),
        [
            fc::READ_COILS..=fc::READ_INPUT_REGISTERS
            | fc::REPORT_SERVER_ID
            | fc::READ_WRITE_MULTIPLE_REGISTERS,
            ref rest @ ..,
        ] => rest.first().map_or(Length::More, |count| known(2 + usize::from(*count))),
        [
            fc::WRITE_SINGLE_COIL
            | fc::WRITE_SINGLE_REGISTER
            | fc::DIAGNOSTICS
            | fc::WRITE_MULTIPLE_COILS
            | fc::WRITE_MULTIPLE_REGISTERS,
            ..,
        ] => Length::Known(5),
        [fc::MASK_WRITE_REGISTER, ..] => Length::Known(7),
        [fc::ENCAPSULATED_INTERFACE] => Length::More,
        [fc::ENCAPSULATED_INTERFACE, fc::MEI_DEVICE_IDENTIFICATION, ..] => identification(pdu),
        _ => Length::Silence,
    }
}

/// Of a request.
pub(crate) fn request(pdu: &[u8]) -> Length {
    match *pdu {
        [] => Length::More,
        [0 | fc::EXCEPTION..=0xFF, ..] => Length::Never,
        [fc::READ_COILS..=fc::WRITE_SINGLE_REGISTER, ..] => Length::Known(5),
        // Return Query Data (00) has any number of words, the others one.
        [fc::DIAGNOSTICS, s1, s0, ..] if (s1, s0) != (0, 0) => Length::Known(5),
        [fc::DIAGNOSTICS, _, _, ..] => Length::Silence,
        [fc::DIAGNOSTICS, ..] => Length::More,
        [fc::WRITE_MULTIPLE_COILS | fc::WRITE_MULTIPLE_REGISTERS, ref rest @ ..] => {
            rest.get(4).map_or(Length::More, |count| known(6 + usize::from(*count)))
        }
        [fc::REPORT_SERVER_ID, ..] => Length::Known(1),
        [fc::MASK_WRITE_REGISTER, ..] => Length::Known(7),
        [fc::READ_WRITE_MULTIPLE_REGISTERS, ref rest @ ..] => {
            rest.get(8).map_or(Length::More, |count| known(10 + usize::from(*count)))
        }
        [fc::ENCAPSULATED_INTERFACE] => Length::More,
        [fc::ENCAPSULATED_INTERFACE, fc::MEI_DEVICE_IDENTIFICATION, ..] => Length::Known(4),
        _ => Length::Silence,
    }
}

/// Of a Read Device Identification reply: the objects are walked, since nothing counts their bytes.
fn identification(pdu: &[u8]) -> Length {
    let Some(&count) = pdu.get(6) else {
        return Length::More;
    };
    let mut end = 7;
    for _ in 0..count {
        if end + 2 > MAX_PDU {
            return Length::Never;
        }
        let Some(&length) = pdu.get(end + 1) else {
            return Length::More;
        };
        end += 2 + usize::from(length);
    }
    known(end)
}

fn known(length: usize) -> Length {
    if length <= MAX_PDU { Length::Known(length) } else { Length::Never }
}
