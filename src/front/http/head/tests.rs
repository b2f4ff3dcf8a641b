use std::format;
use std::vec::Vec;

use super::*;

fn head(text: &str) -> Head<'_> {
    let (head, length) = Head::parse(text.as_bytes()).expect("valid").expect("whole");
    assert_eq!(length, text.len());
    head
}

fn problem(text: &str) -> Problem {
    Head::parse(text.as_bytes()).expect_err("a problem")
}

#[test]
fn what_matters_is_read() {
    let jog = head(
        "POST /api/axes/x/jog?a=b HTTP/1.1\r\nhost: gw\r\nContent-Length:  11 \r\nX-Client: abc\r\nExpect: 100-Continue\r\n\r\n",
    );
    assert_eq!(jog.method, Method::Post);
    assert_eq!(jog.path, "/api/axes/x/jog");
    assert_eq!((jog.body, jog.chunks, jog.keep_alive, jog.expects_continue), (11, true, true, true));
    assert_eq!((jog.foreign, jog.client), (false, Some(hash(b"abc"))));

    let old = head("GET / HTTP/1.0\r\n\r\n");
    assert_eq!((old.body, old.chunks, old.keep_alive, old.client), (0, false, false, None));
    assert!(!head("GET / HTTP/1.1\r\nConnection: x, Close\r\n\r\n").keep_alive);
}

#[test]
fn targets() {
    for (target, expected) in [
        ("/", "/"),
        ("/metrics#x", "/metrics"),
        ("/?x", "/"),
        ("http://gw:80/api/axes?x", "/api/axes"),
        ("http://gw", "/"),
        ("*", "*"),
    ] {
        assert_eq!(path(target), expected, "{target}");
    }
}

#[test]
fn only_a_whole_head_is_taken() {
    let text = b"POST /a HTTP/1.1\r\nHost: b\r\nContent-Length: 2\r\n\r\n{}GET ";
    let end = text.len() - 6;
    for length in 0..end {
        assert_eq!(Head::parse(&text[..length]), Ok(None), "{length}");
    }
    for length in end..=text.len() {
        let (_, used) = Head::parse(&text[..length]).expect("valid").expect("whole");
        assert_eq!(used, end);
    }
}

#[test]
fn a_body_of_doubtful_length_is_refused() {
    let with = |field: &str| problem(&format!("POST / HTTP/1.1\r\n{field}\r\n\r\n"));
    for bad in ["-1", "+1", "0x1f", "1 2", "", "1,1"] {
        assert_eq!(
            with(&format!("Content-Length: {bad}")),
            Problem::Request("Content-Length is no number"),
            "{bad}"
        );
    }
    // What is too large is refused by who knows what the body is for.
    for (text, length) in [("257", 257), ("18446744073709551616", usize::MAX), (&"9".repeat(200), usize::MAX)]
    {
        let request = format!("POST / HTTP/1.1\r\nContent-Length: {text}\r\n\r\n");
        let (head, _) = Head::parse(request.as_bytes()).expect("valid").expect("whole");
        assert_eq!(head.body, length, "{text}");
    }
    assert_eq!(
        with("Content-Length: 1\r\ncontent-length: 1"),
        Problem::Request("Content-Length is given twice")
    );
    assert_eq!(with("Transfer-Encoding: chunked"), Problem::LengthRequired);
    assert_eq!(with("Host: a\r\nHost: b"), Problem::Request("Host is given twice"));
}

#[test]
fn what_is_no_http_is_refused_at_once() {
    for text in [
        "GET  HTTP/1.1\r\n\r\n",
        "GET / HTTP/2.0\r\n",
        "GET / HTTP/1.1\r\nno colon\r\n",
        "G\0T / HTTP/1.1\r\n",
    ] {
        assert!(matches!(problem(text), Problem::Head(_)), "{text:?}");
    }
    let many: Vec<_> = (0..=MAX_FIELDS).map(|n| format!("A{n}: b\r\n")).collect();
    assert_eq!(problem(&format!("GET / HTTP/1.1\r\n{}\r\n", many.concat())), Problem::HeadTooLarge);
}

#[test]
fn pages_of_other_origins_are_told_apart() {
    let foreign = |fields: &str| head(&format!("POST / HTTP/1.1\r\n{fields}\r\n")).foreign;
    assert!(!foreign("Host: gw:8080\r\n"));
    assert!(!foreign("Host: gw:8080\r\nOrigin: http://GW:8080\r\n"));
    assert!(!foreign("Origin: https://gw\r\nHost: gw\r\n"));
    for origin in [
        "http://evil",
        "http://gw:8081",
        "http://gw",
        "null",
        "",
        "gw:8080",
        "ftp://gw:8080",
        "http://gw:8080/",
    ] {
        assert!(foreign(&format!("Host: gw:8080\r\nOrigin: {origin}\r\n")), "{origin}");
    }
    assert!(foreign("Origin: http://gw\r\n"), "no host to compare with");
}

proptest::proptest! {
    #[test]
    fn any_bytes_are_read_without_panic(bytes in proptest::collection::vec(0..=255_u8, 0..300)) {
        if let Ok(Some((_, length))) = Head::parse(&bytes) {
            proptest::prop_assert!(length <= bytes.len());
        }
    }

    #[test]
    fn any_field_is_read_without_panic(name in "[A-Za-z-]{1,20}", value in "[ -~]{0,60}") {
        let _ = Head::parse(format!("PUT / HTTP/1.1\r\n{name}: {value}\r\n\r\n").as_bytes());
    }
}
