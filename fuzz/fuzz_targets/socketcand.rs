//! Whatever either end says, the codec takes it or leaves it; what it takes it makes again.
#![no_main]

use puente_socketcand::{Message, Request, Texts};

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    let mut texts = Texts::new();
    for byte in data {
        let Some(Some(text)) = texts.push(*byte) else { continue };
        if let Ok(request) = Request::parse(text)
            && let Some(said) = request.emit()
        {
            assert_eq!(Request::parse(&said.as_bytes()[1..said.len() - 1]), Ok(request));
        }
        if let Ok(message) = Message::parse(text)
            && let Some(said) = message.emit()
        {
            assert_eq!(Message::parse(&said.as_bytes()[1..said.len() - 1]), Ok(message));
        }
    }
});
