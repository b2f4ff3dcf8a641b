//! Values of objects in requests.

use heapless::{String, Vec};
use puente_cia309::value::DataType;
use serde::Deserialize;
use serde::de::IgnoredAny;

use super::super::api::{json, nothing_after};
use super::super::head::MAX_BODY;
use super::super::problem::Problem;
use crate::front::dictionary::Named;
use crate::front::objects::decode;

const EXPECTED: &str = "{\"value\": 10000}";

/// The bytes of an object from the body of a request: `{"value": ..}`, a number, or text as CiA 309-3 has it.
pub(super) fn bytes(body: &[u8], (name, kind): Named) -> Result<Vec<u8, MAX_BODY>, Problem> {
    let token = token(body).ok_or(Problem::Json(EXPECTED))?;
    if token.starts_with(b"\"") {
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct Text {
            value: String<MAX_BODY>,
        }
        let mut unescaped = [0; MAX_BODY];
        let read = serde_json_core::from_slice_escaped::<Text>(body, &mut unescaped);
        let (text, used) = read.map_err(|_| Problem::Json(EXPECTED))?;
        nothing_after(body, used, EXPECTED)?;
        return decode(text.value.as_bytes(), kind).ok_or(Problem::Value(name));
    }
    #[derive(Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Shape {
        #[allow(dead_code, reason = "only its place matters here")]
        value: IgnoredAny,
    }
    json::<Shape>(body, EXPECTED)?;
    let text = match (token, kind) {
        (_, DataType::Hex | DataType::Text | DataType::Base64) => return Err(Problem::Value(name)),
        (b"true", DataType::Unsigned(1)) => b"1",
        (b"false", DataType::Unsigned(1)) => b"0",
        (token, _) => token,
    };
    decode(text, kind).ok_or(Problem::Value(name))
}

/// What the only key of a body leads to: the first characters of it, or a number as a whole.
fn token(body: &[u8]) -> Option<&[u8]> {
    const KEY: &[u8] = b"\"value\"";
    let at = body.windows(KEY.len()).position(|window| window == KEY)? + KEY.len();
    let value = body.get(at..)?.trim_ascii_start().strip_prefix(b":")?.trim_ascii_start();
    let ends = |byte: &u8| matches!(byte, b',' | b'}') || byte.is_ascii_whitespace();
    let end = value.iter().position(ends).unwrap_or(value.len());
    value.get(..end)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::front::dictionary::named;
    use crate::front::objects::Shown;

    fn read(body: &str, kind: &str) -> Result<std::vec::Vec<u8>, Problem> {
        bytes(body.as_bytes(), named(kind).expect("a type")).map(|bytes| bytes.to_vec())
    }

    fn shown(bytes: &[u8], kind: &str) -> std::string::String {
        let value = Shown { bytes, kind: named(kind).expect("a type").1 };
        let mut room = [0; 600];
        let length = serde_json_core::to_slice(&value, &mut room).expect("room");
        core::str::from_utf8(&room[..length]).expect("UTF-8").to_owned()
    }

    #[test]
    fn values_are_read_and_shown() {
        for (json, kind, bytes) in [
            ("10000", "u32", &[0x10, 0x27, 0, 0][..]),
            ("-1", "i16", &[0xFF, 0xFF]),
            ("-2147483648", "i32", &[0, 0, 0, 0x80]),
            ("18446744073709551615", "u64", &[0xFF; 8]),
            ("-9223372036854775808", "i64", &[0, 0, 0, 0, 0, 0, 0, 0x80]),
            ("0.5", "r32", &[0, 0, 0, 0x3F]),
            ("1", "b", &[1]),
            ("\"save\"", "vs", b"save"),
            ("\"a \\\"b\\\"\"", "vs", b"a \"b\""),
            ("\"10 27\"", "hex", &[0x10, 0x27]),
            ("\"MTIzNA==\"", "d", b"1234"),
            ("\"0x1234\"", "x16", &[0x34, 0x12]),
        ] {
            assert_eq!(read(&format!("{{\"value\":{json}}}"), kind).as_deref(), Ok(bytes), "{json} {kind}");
            assert_eq!(shown(bytes, kind), json, "{kind}");
        }
        assert_eq!(read(" { \"value\" : true } \n", "b").as_deref(), Ok(&[1][..]));
        assert_eq!(read("{\"value\":\"0x10\"}", "u8").as_deref(), Ok(&[0x10][..]));
        // Of another size than its type; no number; text that has ended, and in Latin-1.
        assert_eq!(shown(&[1, 2], "u32"), "\"01 02\"");
        assert_eq!(shown(&f32::NAN.to_le_bytes(), "r32"), "null");
        assert_eq!(shown(b"Drive\0\0", "vs"), "\"Drive\"");
        assert_eq!(shown(b"\xB0C", "vs"), "\"°C\"");
        assert_eq!(shown(&[], "vs"), "\"\"");
    }

    #[test]
    fn what_is_no_value_is_refused() {
        for body in [
            "",
            "{}",
            "[]",
            "{\"value\":}",
            "{\"value\":1",
            "{\"value\":1}}",
            "{\"value\":1,\"type\":\"u8\"}",
        ] {
            assert_eq!(read(body, "u8"), Err(Problem::Json(EXPECTED)), "{body}");
        }
        for (value, kind) in [
            ("256", "u8"),
            ("-1", "u8"),
            ("1.5", "i32"),
            ("1e2", "i32"),
            ("10", "hex"),
            ("1", "vs"),
            ("\"\"", "vs"),
            ("\"x\"", "u8"),
            ("null", "u8"),
            ("[1]", "u8"),
        ] {
            let name = named(kind).expect("a type").0;
            assert_eq!(read(&format!("{{\"value\":{value}}}"), kind), Err(Problem::Value(name)), "{value}");
        }
    }

    proptest::proptest! {
        #[test]
        fn any_body_is_read_without_panic(body in "(\\{\"value\" ?: ?)?[\\[\\]{}\":,a-z0-9\\\\. u-]{0,64}", kind in proptest::sample::select(&["u8", "i64", "r32", "vs", "hex", "d"][..])) {
            let _ = read(&body, kind);
        }
    }
}
