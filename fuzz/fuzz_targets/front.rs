//! Every dialect: a client sends anything in any portions. Nothing panics, the visit ends, and what comes back is whole
//! frames, lines or HTTP replies; what goes on a framed bus is whole frames.
#![no_main]

use puente::port::Door;
use puente_framed::frame;
use puente_fuzz::visit::visit;

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    let Some((&choice, sent)) = data.split_first() else {
        return;
    };
    let door = if choice & 1 == 0 { Door::Main } else { Door::Modbus };
    let size = usize::from(choice >> 1).max(1);
    let got = visit(door, sent.chunks(size).map(<[u8]>::to_vec).collect());
    if door == Door::Modbus {
        let mut rest = got.as_slice();
        while let [_, _, 0, 0, high, low, after @ ..] = rest {
            let length = usize::from(u16::from_be_bytes([*high, *low]));
            assert!((3..=254).contains(&length));
            rest = &after[length..];
        }
        assert!(rest.is_empty(), "replies are whole frames");
    } else if sent.starts_with(&[0x7E]) && sent.get(2..4) != Some(&[0, 0]) {
        let mut rest = got.as_slice();
        while let Some(header) = rest.first_chunk() {
            let length = frame::announced(*header).expect("a header");
            let (reply, after) = rest.split_at_checked(length).expect("a whole frame");
            frame::parse(reply).expect("a frame");
            rest = after;
        }
        assert!(rest.is_empty(), "replies are whole frames");
    } else if !got.is_empty() && !sent.starts_with(b"HEAD ") && sent.get(2..4) != Some(&[0, 0]) {
        let text = got.starts_with(b"HTTP/1.1 ") || got.ends_with(b"\r\n");
        assert!(text, "{}", got.escape_ascii());
    }
});
