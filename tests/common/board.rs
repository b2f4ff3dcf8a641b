//! The settings of an emulated board, over its network.

use std::net::SocketAddr;

use serde_json::Value;

use super::client::visit;

/// What the settings call its lines.
pub const LINES: [&str; 2] = ["rs485-a", "rs485-b"];

/// The settings as they are put.
pub fn json(document: &str) -> Value {
    toml::from_str(document).expect("a document")
}

/// Gives a board these settings, with which it starts anew.
pub fn put(main: SocketAddr, settings: &Value) {
    let reply = ask(main, "PUT", &settings.to_string());
    assert!(reply.starts_with("HTTP/1.1 200 "), "{reply}\n{settings}");
}

/// Whether a board has these settings.
pub fn has(main: SocketAddr, settings: &Value) -> bool {
    let reply = ask(main, "GET", "");
    let (_, body) = reply.split_once("\r\n\r\n").unwrap_or_else(|| panic!("no reply: {reply}"));
    let all = serde_json::from_str(body).unwrap_or_else(|error| panic!("{error}: {reply}"));
    is_part(settings, &all)
}

fn ask(main: SocketAddr, method: &str, body: &str) -> String {
    let length = body.len();
    let fields = format!("Host: board\r\nConnection: close\r\nContent-Length: {length}");
    let reply = visit(main, format!("{method} /api/config HTTP/1.1\r\n{fields}\r\n\r\n{body}").as_bytes());
    String::from_utf8(reply).expect("text")
}

/// Whether `all` has the keys of `part`, and more at most.
fn is_part(part: &Value, all: &Value) -> bool {
    match (part, all) {
        (Value::Object(part), Value::Object(all)) => {
            part.iter().all(|(key, value)| all.get(key).is_some_and(|all| is_part(value, all)))
        }
        (Value::Array(part), Value::Array(all)) => {
            part.len() == all.len() && part.iter().zip(all).all(|(part, all)| is_part(part, all))
        }
        _ => part == all,
    }
}
