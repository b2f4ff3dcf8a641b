//! The dialect, from the first bytes; never from a single one, for a Modbus/TCP transaction id may look like a letter.

use puente_framed::frame::PREAMBLE;

/// What a client speaks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Dialect {
    /// HTTP/1.1.
    Http,
    /// Modbus/TCP.
    ModbusTcp,
    /// Frames of the framed bus.
    Framed,
    /// Lines: console commands and Modbus ASCII frames, mixed at will.
    Lines,
    /// None of them.
    Unknown,
}

const METHODS: [&[u8]; 9] =
    [b"GET ", b"POST ", b"PUT ", b"HEAD ", b"DELETE ", b"OPTIONS ", b"PATCH ", b"TRACE ", b"CONNECT "];

/// The dialect, or none while more bytes are needed.
pub(super) fn sniff(first: &[u8]) -> Option<Dialect> {
    // An MBAP header has two zeros, the protocol id, where no text has any.
    if let [_, _, 0, 0, ..] = first {
        return Some(Dialect::ModbusTcp);
    }
    let undecided_mbap = matches!(first, [] | [_] | [_, _] | [_, _, 0]);
    // Nor has a frame: they would be its length.
    if let [PREAMBLE, ..] = first {
        return (!undecided_mbap).then_some(Dialect::Framed);
    }
    if METHODS.iter().any(|method| first.starts_with(method)) {
        return Some(Dialect::Http);
    }
    if undecided_mbap && !first.contains(&b'\n') || METHODS.iter().any(|method| method.starts_with(first)) {
        return None;
    }
    sniff_whole(first)
}

/// The dialect of bytes that no more will follow; none for no bytes at all.
pub(super) fn sniff_whole(first: &[u8]) -> Option<Dialect> {
    let first = *first.first()?;
    if first == PREAMBLE {
        return Some(Dialect::Framed);
    }
    let text = first == b':' || first.is_ascii_graphic() || first.is_ascii_whitespace();
    Some(if text { Dialect::Lines } else { Dialect::Unknown })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn first_bytes_decide() {
        let cases: [(&[u8], Option<Dialect>); 23] = [
            (b"", None),
            (b"G", None),
            (b"GET", None),
            (b"GET ", Some(Dialect::Http)),
            (b"GEx ", Some(Dialect::Lines)),
            (b"OPTIONS * HTTP/1.1", Some(Dialect::Http)),
            (b"GE\0\0\0\x06", Some(Dialect::ModbusTcp)),
            (b":0\0\0\0\x06", Some(Dialect::ModbusTcp)),
            (b"\0\x01\0\0\x01\x2C", Some(Dialect::ModbusTcp)),
            (b"GE\0", None),
            (b":010309010001F1\r\n", Some(Dialect::Lines)),
            (b"axis", Some(Dialect::Lines)),
            (b"\r\n", Some(Dialect::Lines)),
            (b"\xFF\xFE", None),
            (b"\xFF\xFE\xFD", Some(Dialect::Unknown)),
            (b"\0\x01\0\x05\0\x06", Some(Dialect::Unknown)),
            // A transaction id may begin with 7E, and an origin be a line feed.
            (b"\x7E\x01\0\0\0\x06", Some(Dialect::ModbusTcp)),
            (b"\x7E\0\0\0", Some(Dialect::ModbusTcp)),
            (b"\x7E", None),
            (b"\x7E\x0A", None),
            (b"\x7E\0\0", None),
            (b"\x7E\0\0\x2D", Some(Dialect::Framed)),
            (b"\x7E\x0A\x08", Some(Dialect::Framed)),
        ];
        for (bytes, dialect) in cases {
            assert_eq!(sniff(bytes), dialect, "{bytes:?}");
        }
        assert_eq!(sniff_whole(b"\xFF"), Some(Dialect::Unknown));
        assert_eq!(sniff_whole(b""), None);
        assert_eq!(sniff_whole(b"\x7E\x0A"), Some(Dialect::Framed));
    }
}
