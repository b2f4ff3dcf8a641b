//! EDB: any request has one effect, and none that moves or stops is taken for a reading.
#![no_main]

use puente_drives::edb::{self, Effect, Monitor, Parameter, Registers};
use puente_modbus::request::Request;

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    if let Ok(request) = Request::parse(data) {
        let registers = Registers::default();
        let effect = edb::effect(&registers, &request);
        assert_eq!(effect == Effect::Read, !request.is_write(), "{request:?}");
        if let Request::WriteSingleRegister { address, value } = request {
            let jog = [registers.jog_enable, registers.jog_forward, registers.jog_reverse].contains(&address);
            assert_eq!(effect == Effect::Motion, jog && value != 0);
            assert_eq!(effect == Effect::Stop, jog && value == 0);
        }
    }
    if let Ok(text) = core::str::from_utf8(data)
        && let Ok(parameter) = text.parse::<Parameter>()
    {
        assert!(parameter.to_string().eq_ignore_ascii_case(text));
    }
    let words: Vec<u16> = data.as_chunks().0.iter().map(|word| u16::from_be_bytes(*word)).collect();
    assert_eq!(Monitor::decode(words.iter().copied()).is_some(), words.len() == Monitor::WORDS);
});
