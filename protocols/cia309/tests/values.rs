//! Values, as CANopenNode's gateway (301/CO_fifo.c) has them.

use proptest::prelude::*;
use puente_cia309::value::{BadValue, DataType, Decoder, Encoder};

fn kind(name: &str) -> DataType {
    DataType::parse(name.as_bytes()).expect(name)
}

fn decode(kind: DataType, text: &[u8]) -> Result<Vec<u8>, BadValue> {
    let mut decoder = Decoder::new(kind);
    let mut bytes = Vec::new();
    for byte in text {
        decoder.push(*byte, |byte| bytes.push(byte))?;
    }
    decoder.end(|byte| bytes.push(byte))?;
    Ok(bytes)
}

/// Encodes in pieces of a size, each into no more room than it was promised.
fn encode(kind: DataType, bytes: &[u8], piece: usize) -> Vec<u8> {
    let mut encoder = Encoder::new(kind);
    let mut text = Vec::new();
    for piece in bytes.chunks(piece) {
        let before = text.len();
        encoder.push(piece, &mut |byte| text.push(byte));
        assert!(text.len() - before <= Encoder::room(piece.len()));
    }
    let before = text.len();
    encoder.end(&mut |byte| text.push(byte));
    assert!(text.len() - before <= Encoder::room(0));
    text
}

#[test]
fn values_become_bytes() {
    for (name, text, bytes) in [
        ("b", "1", &[1][..]),
        ("i8", "-128", &[0x80]),
        ("i16", "-1", &[0xFF, 0xFF]),
        ("i32", "-0x10", &[0xF0, 0xFF, 0xFF, 0xFF]),
        ("i64", "-9223372036854775808", &[0, 0, 0, 0, 0, 0, 0, 0x80]),
        ("u8", " 255 # most", &[255]),
        ("u16", "0x1234", &[0x34, 0x12]),
        ("u32", "4294967295\r\n", &[0xFF; 4]),
        ("u64", "18446744073709551615", &[0xFF; 8]),
        ("x32", "0xDEADBEEF", &[0xEF, 0xBE, 0xAD, 0xDE]),
        ("r32", "0.5", &[0, 0, 0, 0x3F]),
        ("r64", "-1e3", &[0, 0, 0, 0, 0, 0x40, 0x8F, 0xC0]),
        ("hex", "0a FFee 1 2", &[0x0A, 0xFF, 0xEE, 1, 2]),
        ("hex", "123#4", &[0x12, 3]),
        ("vs", "word#1", b"word#1"),
        ("vs", "\"two words # no comment\" # comment", b"two words # no comment"),
        ("vs", "\"he said \"\"no\"\"\"", b"he said \"no\""),
        ("vs", "5\"\"", b"5\""),
        ("os", "MTIzNDU2Nzg5", b"123456789"),
        ("us", "MTIzNA==", b"1234"),
        ("d", "MTIzNDU= # five", b"12345"),
        ("d", "MTIzNDU", b"12345"),
    ] {
        assert_eq!(decode(kind(name), text.as_bytes()).as_deref(), Ok(bytes), "{name} {text}");
    }
}

#[test]
fn what_is_no_value_is_refused() {
    for (name, text) in [
        ("u8", ""),
        ("u8", "# 1"),
        ("u8", "256"),
        ("u8", "-1"),
        ("u8", "1 2"),
        ("i8", "128"),
        ("i8", "-129"),
        ("i32", "2147483648"),
        ("u32", "4294967296"),
        ("u16", "0x"),
        ("u64", "12345678901234567890123456789012345678901"),
        ("r32", "half"),
        ("hex", "0x12"),
        ("hex", "zz"),
        ("vs", "\"open"),
        ("vs", "\"closed\"x"),
        ("vs", "two words"),
        ("vs", "5\"x"),
        ("vs", "\"\""),
        ("d", "M"),
        ("d", "MT!z"),
        ("d", "MTIz MTIz"),
        ("d", "MTIzN=x"),
    ] {
        assert_eq!(decode(kind(name), text.as_bytes()), Err(BadValue), "{name} {text}");
    }
    assert_eq!(DataType::parse(b"t"), None);
    assert_eq!(DataType::parse(b"td"), None);
    assert_eq!(DataType::parse(b"U32"), Some(DataType::Unsigned(4)));
}

#[test]
fn bytes_become_values() {
    for (name, bytes, text) in [
        ("i16", &[0xE8, 0x03][..], "1000"),
        ("i8", &[0x80], "-128"),
        ("i64", &[0xFF; 8], "-1"),
        ("b", &[1], "1"),
        ("u32", &[0x92, 1, 2, 0], "131474"),
        ("u64", &[0xFF; 8], "18446744073709551615"),
        ("x16", &[0x34, 0x12], "0x1234"),
        ("x64", &[1, 0, 0, 0, 0, 0, 0, 0], "0x0000000000000001"),
        ("r32", &[0, 0, 0, 0x3F], "0.5"),
        ("r32", &[0, 0, 0x80, 0x7F], "inf"),
        ("r64", &[0, 0, 0, 0, 0, 0x40, 0x8F, 0xC0], "-1000"),
        ("hex", &[1, 0xAB], "01 AB"),
        // A number of another size.
        ("u32", &[1, 2], "01 02"),
        ("u8", &[1, 2, 3], "01 02 03"),
        ("vs", b"a \"b\"\0", "\"a \"\"b\"\"\""),
        ("vs", b"", "\"\""),
        ("os", b"123456789", "MTIzNDU2Nzg5"),
        ("d", b"1234", "MTIzNA=="),
        ("d", b"12345", "MTIzNDU="),
        ("d", b"", ""),
    ] {
        for piece in 1..=9 {
            assert_eq!(encode(kind(name), bytes, piece), text.as_bytes(), "{name} {bytes:02X?}");
        }
    }
}

#[test]
fn real_numbers_have_cs_form() {
    for (number, text) in [
        (0.0, "0"),
        (-0.0, "-0"),
        (1.0, "1"),
        (100000.0, "100000"),
        (0.0001, "0.0001"),
        (0.00001, "1e-05"),
        (1.5e-7, "1.5e-07"),
        (1e15, "1000000000000000"),
        (1e16, "1e+16"),
        (1.25e20, "1.25e+20"),
        (-123.456, "-123.456"),
        (f64::MAX, "1.7976931348623157e+308"),
        (f64::NAN, "nan"),
        (f64::NEG_INFINITY, "-inf"),
    ] {
        assert_eq!(encode(DataType::Real(8), &number.to_le_bytes(), 8), text.as_bytes());
    }
}

fn any_kind() -> impl Strategy<Value = DataType> {
    proptest::sample::select(DataType::names().map(|(_, kind)| kind).collect::<Vec<_>>())
}

proptest! {
    /// What is shown is read as the same bytes, however they came.
    #[test]
    fn shown_and_read_again(kind in any_kind(), mut bytes in proptest::collection::vec(any::<u8>(), 1..300), piece in 1_usize..64) {
        let nan = |bytes: &[u8]| match *bytes {
            [a, b, c, d] => f32::from_le_bytes([a, b, c, d]).is_nan(),
            [a, b, c, d, e, f, g, h] => f64::from_le_bytes([a, b, c, d, e, f, g, h]).is_nan(),
            _ => false,
        };
        if let Some(size) = kind.size() {
            bytes.resize(usize::from(size), 0);
        }
        if kind == DataType::Text {
            bytes.retain(|byte| !matches!(byte, 0 | b'\r'));
        }
        if matches!(kind, DataType::Real(_)) && nan(&bytes) || bytes.is_empty() {
            return Ok(());
        }
        let text = encode(kind, &bytes, piece);
        prop_assert_eq!(decode(kind, &text), Ok(bytes));
    }

    /// Whatever is said, it is a value or it is refused.
    #[test]
    fn any_text_is_taken(kind in any_kind(), text in proptest::collection::vec(any::<u8>(), 0..60)) {
        if let Ok(bytes) = decode(kind, &text) {
            prop_assert!(!bytes.is_empty() && kind.size().is_none_or(|size| usize::from(size) == bytes.len()));
        }
    }
}
