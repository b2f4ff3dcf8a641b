#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| puente_fuzz::master::run(puente_modbus::Mode::Rtu, data));
