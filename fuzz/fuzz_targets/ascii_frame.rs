//! An ASCII frame that is taken says what its characters say, and taking it in one piece or by the character is the same.
#![no_main]

use puente_line::Instant;
use puente_modbus::ascii;

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    let whole = ascii::parse(data);
    if let Ok(frame) = &whole {
        let adu = ascii::emit(frame.unit, &frame.pdu);
        assert!(adu.starts_with(data.to_ascii_uppercase().trim_ascii_end()));
    }
    let mut decoder = ascii::Decoder::new();
    let mut found = Vec::new();
    for character in data {
        found.extend(decoder.push(Instant::ZERO, *character));
    }
    if whole.is_ok() && data.ends_with(b"\n") {
        assert_eq!(found, [whole]);
    }
    for frame in found.into_iter().flatten() {
        let adu = ascii::emit(frame.unit, &frame.pdu);
        assert!(puente_fuzz::holds(puente_modbus::Mode::Ascii, data, &adu));
    }
});
