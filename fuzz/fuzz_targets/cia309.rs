//! Whatever a client says in CiA 309-3, it is a command or it is refused; a value that is taken is shown as one that is the same.
#![no_main]

use puente_cia309::value::{Decoder, Encoder};
use puente_cia309::{Command, Session};

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    let mut session = Session::new(Some(1));
    for line in data.split(|byte| *byte == b'\n') {
        let Ok(Some(request)) = session.parse(line, |net| net < 3) else { continue };
        match request.command {
            Command::Set(setting) => session.set(setting),
            Command::Write { kind, value, .. } => {
                assert!(line.ends_with(value));
                let Some(bytes) = decode(Decoder::new(kind), value) else { continue };
                let mut text = Vec::new();
                let mut encoder = Encoder::new(kind);
                for piece in bytes.chunks(7) {
                    encoder.push(piece, &mut |byte| text.push(byte));
                }
                encoder.end(&mut |byte| text.push(byte));
                assert!(text.len() <= Encoder::room(bytes.len()) + Encoder::room(0));
                let again = decode(Decoder::new(kind), &text);
                // Not every number is one, and a text loses what would end it.
                assert!(
                    again.as_deref() == Some(&bytes)
                        || text == b"nan"
                        || bytes.contains(&0)
                        || text == b"\"\""
                );
            }
            _ => {}
        }
    }
});

fn decode(mut decoder: Decoder, text: &[u8]) -> Option<Vec<u8>> {
    let mut bytes = Vec::new();
    for byte in text {
        decoder.push(*byte, |byte| bytes.push(byte)).ok()?;
    }
    decoder.end(|byte| bytes.push(byte)).ok()?;
    Some(bytes)
}
