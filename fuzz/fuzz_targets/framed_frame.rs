//! A framed packet that is taken says what its bytes say, in whatever pieces they come.
#![no_main]

use puente_framed::frame::{self, MAX_FRAME};
use puente_framed::{Decoder, Frame};

fn again(frame: &Frame<'_>) -> Vec<u8> {
    let mut buffer = heapless::Vec::<u8, MAX_FRAME>::new();
    frame::emit(&mut buffer, frame.origin, frame.kind, frame.body).expect("what was parsed can be written");
    buffer.to_vec()
}

/// Frames in the order in which they are found, silence at last.
fn decode<const N: usize>(data: &[u8]) -> Vec<Vec<u8>> {
    let mut decoder = Decoder::<N>::new();
    let mut found = Vec::new();
    let mut take = |decoder: &mut Decoder<N>| {
        while decoder.advance() {
            let frame = decoder.frame().expect("a frame was found");
            assert_eq!(again(&frame), decoder.frame_bytes());
            found.push(decoder.frame_bytes().to_vec());
        }
    };
    for byte in data {
        decoder.push(*byte);
        take(&mut decoder);
    }
    decoder.silence();
    take(&mut decoder);
    assert!(!decoder.is_inside() && !decoder.is_ready());
    found
}

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    if let Ok(frame) = frame::parse(data) {
        assert_eq!(again(&frame), data);
        assert_eq!(decode::<MAX_FRAME>(data), [data]);
    }
    for frame in decode::<MAX_FRAME>(data).into_iter().chain(decode::<64>(data)) {
        assert!(data.windows(frame.len()).any(|window| window == frame));
    }
});
