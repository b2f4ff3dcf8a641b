use core::convert::Infallible;
use std::format;
use std::string::String as StdString;
use std::vec::Vec;

use embassy_futures::block_on;

use super::*;

/// A client that takes everything, a few bytes at a time.
#[derive(Default)]
struct Client(Vec<u8>);

impl embedded_io_async::ErrorType for Client {
    type Error = Infallible;
}

impl Write for Client {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, Infallible> {
        let count = bytes.len().min(100);
        self.0.extend(&bytes[..count]);
        Ok(count)
    }

    async fn flush(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
}

fn sheets() -> &'static Sheets {
    static SHEETS: std::sync::OnceLock<Sheets> = std::sync::OnceLock::new();
    SHEETS.get_or_init(Sheets::new)
}

const LATEST: Manner = Manner { chunks: true, body: true, keep_alive: true };

/// What a client gets that asks in this manner: head, body.
fn got(manner: Manner, reply: impl AsyncFnOnce(&mut Reply<'_, Client>)) -> (StdString, StdString) {
    let mut client = Client::default();
    block_on(async { reply(&mut Reply::new(&mut client, sheets(), manner)).await });
    let text = StdString::from_utf8(client.0).expect("text");
    let (head, body) = text.split_once("\r\n\r\n").expect("a head");
    (head.into(), body.into())
}

fn unchunk(mut body: &str) -> StdString {
    let mut whole = StdString::new();
    loop {
        let (length, rest) = body.split_once("\r\n").expect("a length");
        let (data, rest) = rest.split_at(usize::from_str_radix(length, 16).expect("hex"));
        body = rest.strip_prefix("\r\n").expect("the end of a chunk");
        if data.is_empty() {
            assert_eq!(body, "");
            return whole;
        }
        whole += data;
    }
}

#[test]
fn what_fits_is_sent_with_its_length() {
    let (head, body) = got(LATEST, async |reply| reply.value(&[1, 2]).await.expect("sent"));
    assert!(
        head.starts_with("HTTP/1.1 200 OK\r\nContent-Type: application/json\r\nCache-Control: no-store\r\n")
    );
    assert!(head.ends_with("\r\nContent-Length: 5") && !head.contains("Connection"), "{head}");
    assert_eq!(body, "[1,2]");
}

#[test]
fn what_does_not_fit_is_sent_in_chunks() {
    for count in [BODY / 10 - 1, BODY / 10, BODY / 10 + 1, BODY] {
        let lines = async |reply: &mut Reply<'_, Client>| {
            for line in 0..count {
                reply.put(format_args!("{line:09}\n")).await.expect("sent");
            }
            reply.finish().await.expect("sent");
        };
        let expected: StdString = (0..count).map(|line| format!("{line:09}\n")).collect();
        let (head, body) = got(LATEST, lines);
        if expected.len() <= BODY {
            assert!(head.contains(&format!("Content-Length: {}", expected.len())), "{head}");
            assert_eq!(body, expected);
        } else {
            assert!(
                head.contains("Transfer-Encoding: chunked") && !head.contains("Content-Length"),
                "{head}"
            );
            assert_eq!(unchunk(&body), expected);
        }
        // HTTP/1.0 knows no chunks: the end of the connection ends the reply.
        let (head, body) = got(Manner { chunks: false, keep_alive: false, ..LATEST }, lines);
        assert!(!head.contains("chunked") && head.contains("Connection: close"), "{head}");
        assert_eq!(body, expected);
        let (with_body, _) = got(LATEST, lines);
        let (head, body) = got(Manner { body: false, ..LATEST }, lines);
        assert_eq!((head, body), (with_body, StdString::new()), "HEAD");
    }
}

#[test]
fn a_chunk_may_end_with_the_reply() {
    let (_, body) = got(LATEST, async |reply| {
        reply.put(format_args!("{}", "a".repeat(BODY))).await.expect("sent");
        reply.piece(false).await.expect("sent");
        reply.finish().await.expect("sent");
    });
    assert_eq!(unchunk(&body), "a".repeat(BODY));
}

#[test]
fn what_is_longer_than_the_buffer_ends_the_visit() {
    let mut client = Client::default();
    let mut reply = Reply::new(&mut client, sheets(), LATEST);
    let long = "a".repeat(BODY + 1);
    assert_eq!(block_on(reply.put(format_args!("{long}"))), Err(End::Broken));
}

#[test]
fn problems_are_json() {
    let close = Manner { keep_alive: false, ..LATEST };
    let (head, body) = got(close, async |reply| {
        reply.put(format_args!("[")).await.expect("kept");
        reply.problem(&Problem::Method("GET, HEAD, PUT")).await.expect("sent");
    });
    assert!(
        head.starts_with("HTTP/1.1 405 Method Not Allowed\r\nContent-Type: application/json\r\n"),
        "{head}"
    );
    assert!(
        head.contains("\r\nAllow: GET, HEAD, PUT\r\n") && head.contains("\r\nConnection: close\r\n"),
        "{head}"
    );
    assert_eq!(body, "{\"error\":{\"code\":\"method\",\"message\":\"this path takes GET, HEAD, PUT\"}}");
}

#[test]
fn files_come_with_a_policy() {
    let (head, body) = got(Manner { keep_alive: false, ..LATEST }, async |reply| {
        reply.asset(&super::super::page::INDEX).await.expect("sent");
    });
    assert!(head.contains("Content-Security-Policy: default-src 'none'"), "{head}");
    assert!(head.contains("Content-Type: text/html"), "{head}");
    assert!(head.ends_with(&format!("Content-Length: {}", body.len())), "{head}");
    assert!(head.len() + 4 <= FRONT);
}

#[test]
fn a_sheet_goes_back_when_its_reply_is_dropped() {
    let all: Vec<_> = (0..SHEETS).map(|_| block_on(sheets().lend())).collect();
    let mut client = Client::default();
    {
        let mut reply = Reply::new(&mut client, sheets(), LATEST);
        let waits = core::pin::pin!(reply.value(&1))
            .poll(&mut core::task::Context::from_waker(core::task::Waker::noop()));
        assert!(waits.is_pending(), "no sheet is left");
    }
    drop(all);
    let mut reply = Reply::new(&mut client, sheets(), LATEST);
    block_on(reply.value(&1)).expect("sent");
}

#[test]
fn lines_that_are_taken_come_whole_in_any_manner() {
    let lines: Vec<_> = (0..500).map(|number| format!("line {number}\n")).collect();
    for chunks in [true, false] {
        let mut left = &lines[..];
        let manner = Manner { chunks, ..LATEST };
        let (head, body) = got(manner, async |reply| {
            while !left.is_empty() {
                let take = |room: &mut [u8]| {
                    let mut filled = 0;
                    while let Some((line, rest)) = left.split_first()
                        && let Some(place) = room.get_mut(filled..filled + line.len())
                    {
                        place.copy_from_slice(line.as_bytes());
                        filled += line.len();
                        left = rest;
                    }
                    filled
                };
                reply.take(take).await.expect("sent");
            }
            reply.finish().await.expect("sent");
        });
        let body = if chunks { unchunk(&body) } else { body };
        assert!(body == lines.concat(), "{head}");
    }
}
