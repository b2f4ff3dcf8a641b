//! Frames among what a client has sent.

use puente_framed::frame::{self, HEADER, PREAMBLE};

/// What the bytes begin with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Found {
    /// Nothing: there are none.
    Nothing,
    /// So many bytes of no frame.
    Garbage(usize),
    /// What may become a frame of so many bytes, at least.
    Partial(usize),
    /// What has the length of a frame, this one, but not its checks. There may be others in it.
    Damaged(usize),
    /// A frame of so many bytes.
    Frame(usize),
}

/// As the line's decoder finds frames: whatever begins with 7E and can be a frame holds back what is inside it, until it
/// is whole.
pub(super) fn search(bytes: &[u8]) -> Found {
    match bytes.iter().position(|byte| *byte == PREAMBLE) {
        Some(0) => {}
        Some(garbage) => return Found::Garbage(garbage),
        None if bytes.is_empty() => return Found::Nothing,
        None => return Found::Garbage(bytes.len()),
    }
    let Some(header) = bytes.first_chunk() else {
        return Found::Partial(HEADER);
    };
    let Ok(length) = frame::announced(*header) else {
        return Found::Garbage(1);
    };
    match bytes.get(..length).map(frame::parse) {
        None => Found::Partial(length),
        Some(Err(_)) => Found::Damaged(length),
        Some(Ok(_)) => Found::Frame(length),
    }
}

#[cfg(test)]
mod tests {
    use std::vec::Vec;

    use proptest::prelude::*;
    use puente_framed::frame::MAX_FRAME;
    use puente_framed::{Class, Decoder, Kind, section};

    use super::*;

    fn frame(origin: u8, kind: Kind, address: u8, data: &[u8]) -> Vec<u8> {
        let mut body = heapless::Vec::<u8, 300>::new();
        section::push(&mut body, address, data).expect("room");
        let mut frame = heapless::Vec::<u8, MAX_FRAME>::new();
        frame::emit(&mut frame, origin, kind, &body).expect("a frame");
        frame.to_vec()
    }

    /// All frames in `bytes`, after which nothing comes.
    fn found(mut bytes: &[u8]) -> Vec<Vec<u8>> {
        let mut frames = Vec::new();
        loop {
            let done = match search(bytes) {
                Found::Nothing => return frames,
                Found::Garbage(count) => count,
                Found::Partial(_) | Found::Damaged(_) => 1,
                Found::Frame(length) => {
                    frames.push(bytes[..length].to_vec());
                    length
                }
            };
            bytes = &bytes[done..];
        }
    }

    #[test]
    fn a_frame_is_told_from_what_is_around_it() {
        let frame = frame(9, Kind::Single(Class::Data), 17, b"hold");
        assert_eq!(search(&[]), Found::Nothing);
        assert_eq!(search(b"\0\r\n"), Found::Garbage(3));
        assert_eq!(search(&[b"\0", &frame[..]].concat()), Found::Garbage(1));
        assert_eq!(search(&frame[..1]), Found::Partial(HEADER));
        assert_eq!(search(&frame[..9]), Found::Partial(frame.len()));
        assert_eq!(search(&[&frame[..], b"\0"].concat()), Found::Frame(frame.len()));
        let mut damaged = frame.clone();
        damaged[6] ^= 1;
        assert_eq!(search(&damaged), Found::Damaged(frame.len()));
        // A reserved tag.
        assert_eq!(search(&[PREAMBLE, 9, 0x40, 45]), Found::Garbage(1));
    }

    proptest! {
        /// Whatever comes, the frames that are found are those that the line's decoder finds.
        #[test]
        fn as_on_the_line(
            pieces in prop::collection::vec(
                (any::<u8>(), prop::collection::vec(prop_oneof![Just(0x7E), Just(0), any::<u8>()], 0..60), 0..4_u8),
                0..8,
            ),
        ) {
            let mut bytes = Vec::new();
            for (origin, data, what) in pieces {
                let whole = frame(origin, if what == 0 { Kind::Plain } else { Kind::Single(Class::Status) }, 17, &data);
                match what {
                    0 | 1 => bytes.extend(whole),
                    2 => bytes.extend(&whole[..whole.len() / 2]),
                    _ => bytes.extend(data),
                }
            }
            let mut decoder = Decoder::<MAX_FRAME>::new();
            let mut expected = Vec::new();
            for byte in &bytes {
                decoder.push(*byte);
                while decoder.is_ready() && decoder.advance() {
                    expected.push(decoder.frame_bytes().to_vec());
                }
            }
            decoder.silence();
            while decoder.advance() {
                expected.push(decoder.frame_bytes().to_vec());
            }
            prop_assert_eq!(found(&bytes), expected);
        }
    }
}
