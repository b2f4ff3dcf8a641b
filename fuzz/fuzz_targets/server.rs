//! What a server's decoder gives was on the line; it never spins; and after a pause it hears a request, whatever was before.
#![no_main]

use std::time::Duration;

use puente_fuzz::{Operands, adu, holds, line};
use puente_line::Instant;
use puente_modbus::Mode;
use puente_modbus::server::Decoder;

const REQUEST: &[u8] = &[6, 0, 0x25, 0, 0x64];

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    let mut operands = Operands(data);
    let mode = if operands.byte() & 1 == 0 { Mode::Rtu } else { Mode::Ascii };
    let mut decoder = Decoder::new(mode, line());
    let mut now = Instant::from_millis(5_000);
    let mut heard = Vec::new();
    while !operands.0.is_empty() {
        let event = operands.byte();
        let bytes = match event & 3 {
            0 | 1 => operands.bytes(usize::from(event >> 2)).to_vec(),
            2 => {
                let unit = operands.byte();
                adu(mode, unit, operands.bytes(usize::from(event >> 4) + 1))
            }
            _ => {
                now += operands.pause();
                Vec::new()
            }
        };
        decoder.receive(now, &bytes);
        heard.extend(bytes);
        while let Some(result) = decoder.poll(now) {
            if let Ok(frame) = result {
                assert!(holds(mode, &heard, &adu(mode, frame.unit, &frame.pdu)));
            }
        }
        assert!(decoder.poll_at().is_none_or(|at| at > now), "polling would spin");
    }
    now += Duration::from_secs(2);
    decoder.receive(now, &adu(mode, 7, REQUEST));
    let last = std::iter::from_fn(|| decoder.poll(now)).last().expect("a result").expect("a request");
    assert_eq!((last.unit, last.pdu.as_slice()), (7, REQUEST));
});
