//! The settings of an emulated board, over its network.

use std::net::SocketAddr;

use serde_json::Value;

use super::http::insist;

/// What the settings call its lines.
pub const LINES: [&str; 2] = ["rs485-a", "rs485-b"];
/// The same of its CAN buses.
pub const CANS: [&str; 2] = ["can-1", "can-2"];

/// The settings as they are put.
pub fn json(document: &str) -> Value {
    toml::from_str(document).expect("a document")
}

/// Gives a board these settings, with which it starts anew.
pub fn put(main: SocketAddr, settings: &Value) {
    let reply = insist(main, "PUT /api/config", &settings.to_string());
    assert_eq!(reply.status, 200, "{}\n{settings}", reply.body);
}

/// Whether a board has these settings.
pub fn has(main: SocketAddr, settings: &Value) -> bool {
    is_part(settings, &insist(main, "GET /api/config", "").json())
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
