//! Whatever a client says in controller mode, it is a frame or it is none; a frame is written as one that is the same.
#![no_main]

use puente_frametext::{Message, Mode, parse};

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    if let Ok(frame) = parse(data) {
        let text = Message(Mode::Controller, &frame).to_string();
        assert_eq!(parse(text.trim_matches([':', '\r', '\n']).as_bytes()), Ok(frame));
    }
});
