//! HTTP, as the tests speak it.

use std::io::{BufRead, Read, Write};
use std::net::{SocketAddr, TcpStream};

use serde_json::Value;

use super::client::{send_and_close, visit};
use super::ms;

/// A request on a connection of its own; `line` as in `GET /api/axes`.
pub fn request(line: &str, body: &str) -> String {
    request_with(line, "", body)
}

/// As `request` with more header fields, each ending with CRLF.
pub fn request_with(line: &str, fields: &str, body: &str) -> String {
    let length =
        if line.starts_with("GET") { String::new() } else { format!("Content-Length: {}\r\n", body.len()) };
    format!("{line} HTTP/1.1\r\nHost: gateway\r\nConnection: close\r\n{fields}{length}\r\n{body}")
}

/// The reply to a request of one who closes its side behind it.
#[track_caller]
pub fn ask(address: SocketAddr, line: &str, body: &str) -> Reply {
    Reply::of(&send_and_close(address, request(line, body).as_bytes()))
}

/// As `ask`, of one who comes again where it is refused.
#[track_caller]
pub fn insist(address: SocketAddr, line: &str, body: &str) -> Reply {
    insist_with(address, line, "", body)
}

/// As `insist` with more header fields, each ending with CRLF.
#[track_caller]
pub fn insist_with(address: SocketAddr, line: &str, fields: &str, body: &str) -> Reply {
    Reply::of(&visit(address, request_with(line, fields, body).as_bytes()))
}

/// The reply to a whole request; none where nobody answers within a second.
pub fn answer(address: SocketAddr, request: &str) -> Option<Reply> {
    let mut stream = TcpStream::connect(address).ok()?;
    stream.set_read_timeout(Some(ms(1000))).ok()?;
    stream.write_all(request.as_bytes()).ok()?;
    let mut reply = Vec::new();
    stream.read_to_end(&mut reply).ok()?;
    (!reply.is_empty()).then(|| Reply::of(&reply))
}

#[derive(Debug)]
pub struct Reply {
    pub status: u16,
    /// Names in lower case, and values.
    pub fields: Vec<(String, String)>,
    pub body: String,
}

impl Reply {
    /// All that came on a connection: one reply.
    #[track_caller]
    pub fn of(mut bytes: &[u8]) -> Self {
        let reply = Self::read(&mut bytes);
        assert!(bytes.is_empty(), "{reply:?} and then {}", bytes.escape_ascii());
        reply
    }

    /// The next reply of a connection.
    #[track_caller]
    pub fn read(stream: &mut impl BufRead) -> Self {
        let mut reply = Self::head(stream);
        let mut body = Vec::new();
        if let Some(length) = reply.field("content-length") {
            body.resize(length.parse().expect("a length"), 0);
            stream.read_exact(&mut body).expect("a body");
        } else if reply.field("transfer-encoding") == Some("chunked") {
            while let Some(chunk) = chunk(stream) {
                body.extend(chunk);
            }
        } else {
            stream.read_to_end(&mut body).expect("a body");
        }
        reply.body = String::from_utf8(body).expect("text");
        reply
    }

    /// A reply without its body.
    #[track_caller]
    pub fn head(stream: &mut impl BufRead) -> Self {
        let first = line(stream);
        let status = first.strip_prefix("HTTP/1.1 ").and_then(|rest| rest.split_once(' ')?.0.parse().ok());
        let status = status.unwrap_or_else(|| panic!("no status line: {first}"));
        let mut fields = Vec::new();
        loop {
            let line = line(stream);
            if line.is_empty() {
                return Self { status, fields, body: String::new() };
            }
            let (name, value) = line.split_once(": ").expect("a field");
            fields.push((name.to_ascii_lowercase(), value.to_owned()));
        }
    }

    pub fn field(&self, name: &str) -> Option<&str> {
        self.fields.iter().find(|(field, _)| field == name).map(|(_, value)| value.as_str())
    }

    #[track_caller]
    pub fn json(&self) -> Value {
        serde_json::from_str(&self.body).unwrap_or_else(|error| panic!("{error}: {}", self.body))
    }

    /// Status and code of an error.
    #[track_caller]
    pub fn error(&self) -> (u16, String) {
        assert_eq!(self.field("content-type"), Some("application/json"), "{self:?}");
        let json = self.json();
        assert!(json["error"]["message"].as_str().is_some_and(|text| !text.is_empty()), "{json}");
        (self.status, json["error"]["code"].as_str().expect("a code").to_owned())
    }
}

/// The next line, without its end.
#[track_caller]
pub fn line(stream: &mut impl BufRead) -> String {
    let mut line = String::new();
    stream.read_line(&mut line).expect("a line");
    line.strip_suffix("\r\n").unwrap_or_else(|| panic!("not a whole line: {line:?}")).to_owned()
}

fn chunk(stream: &mut impl BufRead) -> Option<Vec<u8>> {
    let length = usize::from_str_radix(&line(stream), 16).expect("a length");
    let mut chunk = vec![0; length];
    stream.read_exact(&mut chunk).expect("a chunk");
    assert_eq!(line(stream), "");
    (length > 0).then_some(chunk)
}
