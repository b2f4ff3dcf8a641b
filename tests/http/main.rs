//! The HTTP interface over real sockets, with simulated drives.

mod client;
#[path = "../common/mod.rs"]
mod common;
mod malformed;
mod nodes;

use client::Gateway;
use common::{target, until};
use serde_json::{Value, json};

const JOG: &str = "POST /api/axes/x/jog";

fn keys(value: &Value) -> Vec<&str> {
    value.as_object().expect("an object").keys().map(String::as_str).collect()
}

fn error(status: u16, code: &str) -> (u16, String) {
    (status, code.to_owned())
}

fn enable(gateway: &Gateway, axis: &str) {
    assert_eq!(gateway.ask(&format!("POST /api/axes/{axis}/enable"), "").status, 200);
}

#[test]
fn axes_with_values_and_a_dead_one() {
    let gateway = Gateway::start(16);
    let reply = gateway.ask("GET /api/axes", "");
    assert_eq!(reply.status, 200);
    assert_eq!(reply.field("content-type"), Some("application/json"));
    assert_eq!(reply.field("cache-control"), Some("no-store"));
    assert!(reply.fields.iter().all(|(name, _)| !name.starts_with("access-control")));
    let list = reply.json();
    let [x, y, dead] = list.as_array().expect("an array").as_slice() else { panic!("{list}") };
    let mut expected = vec![
        "name",
        "bus",
        "address",
        "drive",
        "max_rpm",
        "online",
        "enabled",
        "jog_rpm",
        "speed_rpm",
        "torque_percent",
        "position_pulses",
        "alarm",
        "alarm_text",
        "status",
        "flags",
        "age_ms",
        "lease",
        "event",
        "error",
    ];
    expected.sort_unstable();
    assert_eq!(keys(x), expected);
    assert_eq!((&x["name"], &x["drive"], &x["address"]), (&json!("x"), &json!("edb"), &json!(1)));
    assert_eq!((&x["online"], &x["speed_rpm"], &x["error"]), (&json!(true), &json!(0), &Value::Null));
    assert!(x["age_ms"].as_u64().expect("an age") < 1000, "{x}");
    assert_eq!(y["max_rpm"], 200);
    assert_eq!(
        (&dead["online"], &dead["speed_rpm"], &dead["age_ms"]),
        (&json!(false), &Value::Null, &Value::Null)
    );
    assert_eq!(dead["error"]["code"], "no-reply");
    // It is left alone for a while now.
    assert_eq!(gateway.axis("dead")["error"]["code"], "not-sent");
    assert_eq!(gateway.ask("GET /api/axes/dead/parameters/Pn037", "").error(), error(503, "not-sent"));
}

#[test]
fn a_jog_lasts_as_long_as_its_hold() {
    let gateway = Gateway::start(16);
    enable(&gateway, "x");
    let reply = gateway.ask(JOG, "{\"rpm\":-100,\"hold_ms\":1500}");
    assert_eq!(reply.status, 200, "{}", reply.body);
    let jog = reply.json();
    assert_eq!((&jog["axis"], &jog["enabled"], &jog["jog_rpm"]), (&json!("x"), &json!(true), &json!(-100)));
    assert!(jog["lease"]["left_ms"].as_u64().expect("a time") <= 1500);
    gateway.await_axis("x", |axis| axis["speed_rpm"].as_i64() < Some(0));
    let lost = gateway.await_axis("x", |axis| axis["event"] != Value::Null && axis["jog_rpm"] == 0);
    assert_eq!((&lost["event"]["cause"], &lost["lease"]), (&json!("lease-expired"), &Value::Null));
    gateway.await_axis("x", |axis| axis["speed_rpm"] == 0);
    assert_eq!(gateway.ask("POST /api/axes/x/clear", "").json()["enabled"], false);
    assert_eq!(gateway.axis("x")["event"], Value::Null);
}

#[test]
fn one_commands_and_everyone_stops() {
    let gateway = Gateway::start(16);
    let (a, b) = ("X-Client: a\r\n", "X-Client: b\r\n");
    let long = "{\"rpm\":100,\"hold_ms\":5000}";
    assert_eq!(gateway.ask("POST /api/axes/x/disable", "").status, 200);
    assert_eq!(gateway.ask_as(JOG, a, long).error(), error(409, "not-enabled"));
    enable(&gateway, "x");
    assert_eq!(gateway.ask_as(JOG, a, long).status, 200);
    // The same user over another connection goes on; another user may not.
    assert_eq!(gateway.ask_as(JOG, a, long).status, 200);
    assert_eq!(gateway.ask_as(JOG, b, long).error(), error(409, "leased"));
    assert_eq!(gateway.ask_as("POST /api/axes/x/enable", b, "").error(), error(409, "leased"));
    assert_eq!(
        gateway.ask_as("PUT /api/axes/x/parameters/Pn037", b, "{\"value\":5}").error(),
        error(409, "leased")
    );
    let holder = &gateway.axis("x")["lease"]["holder"];
    assert!(holder.as_str().expect("a holder").starts_with("web client "), "{holder}");
    let stopped = gateway.ask_as("POST /api/axes/x/stop", b, "");
    assert_eq!((stopped.status, &stopped.json()["jog_rpm"]), (200, &json!(0)));
    assert_eq!(gateway.ask_as(JOG, a, long).error(), error(409, "standstill"));
    assert_eq!(gateway.axis("x")["event"]["cause"], "stopped-by-other");
}

#[test]
fn parameters() {
    let gateway = Gateway::start(16);
    let path = "/api/axes/x/parameters/Pn037";
    let written = gateway.ask(&format!("PUT {path}"), "{\"value\":123}");
    let expected = json!({"axis": "x", "parameter": "Pn037", "value": 123, "unit": "r/min", "name": "JOG speed",
        "min": null, "max": null, "default": null});
    assert_eq!((written.status, written.json()), (200, expected.clone()));
    assert_eq!(gateway.ask(&format!("GET {path}"), "").json(), expected);
    assert_eq!(gateway.ask(&format!("PUT {path}"), "{\"value\":65536}").error(), error(400, "range"));
    assert_eq!(gateway.ask(&format!("PUT {path}"), "{\"value\":-1}").error(), error(400, "range"));
    assert_eq!(gateway.ask(&format!("PUT {path}"), "123").error(), error(400, "bad-json"));
    assert_eq!(gateway.ask("GET /api/axes/x/parameters/Pn999", "").error(), error(400, "parameter"));
    assert_eq!(gateway.ask("GET /api/axes/x/parameters/Pn765", "").error(), error(502, "exception"));
    assert_eq!(gateway.ask(&format!("GET {path}"), "").json(), expected, "nothing else was written");
}

#[test]
fn refusals() {
    let gateway = Gateway::start(16);
    enable(&gateway, "y");
    for (request, body, expected) in [
        ("GET /api/axes/nobody", "", error(404, "unknown-axis")),
        ("POST /api/axes/nobody/stop", "", error(404, "unknown-axis")),
        ("GET /nothing", "", error(404, "not-found")),
        ("POST /api/axes/x/fly", "", error(404, "not-found")),
        ("DELETE /api/axes", "", error(405, "method")),
        ("GET /api/axes/x/jog", "", error(405, "method")),
        ("POST /api/axes/y/jog", "", error(400, "bad-json")),
        ("POST /api/axes/y/jog", "{\"rpm\":\"fast\"}", error(400, "bad-json")),
        ("POST /api/axes/y/jog", "{\"rpm\":100,\"hold_ms\":49}", error(400, "range")),
        ("POST /api/axes/y/jog", "{\"rpm\":100,\"hold_ms\":5001}", error(400, "range")),
        ("POST /api/axes/y/jog", "{\"rpm\":201}", error(400, "range")),
        ("POST /api/axes/y/jog", "{\"rpm\":-201}", error(400, "range")),
    ] {
        assert_eq!(gateway.ask(request, body).error(), expected, "{request} {body}");
    }
    let long = format!("{{\"rpm\":{}1}}", " ".repeat(300));
    assert_eq!(gateway.ask("POST /api/axes/y/jog", &long).error(), error(413, "too-large"));
    assert_eq!(gateway.ask("PUT /metrics", "").field("allow"), Some("GET, HEAD"));
    assert_eq!(gateway.ask("GET /api/axes/x/stop", "").field("allow"), Some("POST"));
    assert_eq!(gateway.axis("y")["jog_rpm"], 0);
}

#[test]
fn pages_of_other_origins_move_nothing() {
    let gateway = Gateway::start(16);
    enable(&gateway, "x");
    let body = "{\"rpm\":100,\"hold_ms\":200}";
    for origin in ["http://evil.example", "null", "http://127.0.0.1"] {
        let field = format!("Origin: {origin}\r\n");
        assert_eq!(gateway.ask_as(JOG, &field, body).error(), error(403, "origin"), "{origin}");
        let put = gateway.ask_as("PUT /api/axes/x/parameters/Pn037", &field, "{\"value\":9}");
        assert_eq!(put.error(), error(403, "origin"), "{origin}");
    }
    assert_eq!((&gateway.axis("x")["jog_rpm"], &gateway.axis("x")["lease"]), (&json!(0), &Value::Null));
    let own = format!("Origin: {}\r\n", gateway.origin());
    assert_eq!(gateway.ask_as(JOG, &own, body).status, 200);
}

#[test]
fn over_the_limit_there_is_still_a_stop() {
    let gateway = Gateway::start(1);
    let mut only = gateway.connect();
    only.send("POST /api/axes/x/enable HTTP/1.1\r\n\r\n");
    assert_eq!(only.reply().status, 200);
    only.send("POST /api/axes/x/jog HTTP/1.1\r\nContent-Length: 26\r\n\r\n{\"rpm\":100,\"hold_ms\":5000}");
    assert_eq!(only.reply().status, 200);
    for request in ["GET /", "GET /api/axes", "GET /nothing", "POST /api/axes/x/enable", JOG] {
        let reply = gateway.ask(request, "");
        assert_eq!(reply.error(), error(503, "full"), "{request}");
        assert_eq!(reply.field("connection"), Some("close"));
    }
    assert_eq!(gateway.ask("POST /api/axes/x/stop", "").json()["jog_rpm"], 0);
    assert_eq!(gateway.ask("POST /api/axes/x/disable", "").json()["enabled"], false);
    only.send("GET /api/axes/x HTTP/1.1\r\n\r\n");
    assert_eq!(only.reply().json()["enabled"], false);
}

#[test]
fn buses() {
    let gateway = Gateway::start(16);
    gateway.axis("x");
    gateway.axis("dead");
    let list = gateway.ask("GET /api/buses", "").json();
    let a = &list[0];
    let port = json!(gateway.gateway.ports[0]);
    assert_eq!((&a["name"], &a["protocol"], &a["port"]), (&json!("a"), &json!("modbus-rtu"), &port));
    let baud = json!(common::fast().baud);
    assert_eq!((&a["baud"], &a["format"], &a["units"]), (&baud, &json!("8E1"), &json!("1-9")));
    assert_eq!(a["statistics"]["confirmed"], 2, "status word and monitor block: {a}");
    assert!(a["statistics"]["latency_mean_us"].as_u64().expect("a time") > 0);
    let dead = &list[1]["statistics"];
    assert_eq!(
        (&dead["no_reply"], &dead["resting"], &dead["confirmed"]),
        (&json!(1), &json!(1), &json!(0)),
        "{dead}"
    );
    assert_eq!(dead["latency_mean_us"], Value::Null);
}

#[test]
fn metrics_are_well_formed() {
    let gateway = Gateway::start(16);
    gateway.ask("GET /api/axes", "");
    let reply = gateway.ask("GET /metrics", "");
    assert_eq!(reply.field("content-type"), Some("text/plain; version=0.0.4; charset=utf-8"));
    let (mut families, mut samples) = (std::collections::HashMap::new(), std::collections::HashMap::new());
    let mut last = "";
    for line in reply.body.lines() {
        if let Some(rest) = line.strip_prefix("# TYPE ") {
            let (name, kind) = rest.split_once(' ').expect("a type");
            assert!(families.insert(name, kind).is_none(), "{name} twice");
            last = name;
        } else if !line.starts_with("# HELP ") {
            let (sample, value) = line.rsplit_once(' ').expect("a sample");
            let name = sample.split('{').next().expect("a name");
            assert!(
                name == last || families[last] == "histogram" && name.starts_with(last),
                "{line} after {last}"
            );
            let value: f64 = value.parse().expect("a number");
            assert!(samples.insert(sample, value).is_none(), "{sample} twice");
        }
    }
    assert_eq!(samples["puente_bus_requests_total{bus=\"a\",outcome=\"confirmed\"}"], 4.0);
    assert_eq!(samples["puente_bus_requests_total{bus=\"b\",outcome=\"no-reply\"}"], 1.0);
    assert_eq!(samples["puente_bus_resting{bus=\"b\"}"], 1.0);
    assert_eq!(samples["puente_bus_latency_seconds_count{bus=\"a\"}"], 4.0);
    assert_eq!(samples["puente_bus_latency_seconds_bucket{bus=\"a\",le=\"+Inf\"}"], 4.0);
    assert!(samples["puente_bus_latency_seconds_sum{bus=\"a\"}"] > 0.0);
    let mut buckets = 0.0;
    for bound in ["0.005", "0.01", "0.02", "0.05", "0.1", "0.2", "0.5", "1", "2"] {
        let count =
            samples[format!("puente_bus_latency_seconds_bucket{{bus=\"a\",le=\"{bound}\"}}").as_str()];
        assert!((buckets..=4.0).contains(&count), "{bound}: {count} after {buckets}");
        buckets = count;
    }
    assert_eq!(samples["puente_axis_speed_rpm{axis=\"x\"}"], 0.0);
    assert!(samples["puente_axis_age_seconds{axis=\"x\"}"] < 10.0);
    assert!(!samples.contains_key("puente_axis_speed_rpm{axis=\"dead\"}"), "nothing is known of it");
    // The connection before this one may not have ended yet.
    assert!((1.0..=2.0).contains(&samples["puente_clients"]));
}

#[test]
fn the_gateway_tells_of_itself() {
    let gateway = Gateway::start(16);
    let reply = gateway.ask("GET /api/system", "");
    assert_eq!(reply.status, 200);
    let system = reply.json();
    let expected = [
        "version",
        "commit",
        "board",
        "uptime_ms",
        "reset",
        "resets",
        "stack",
        "free",
        "temperature_c",
        "last_panic",
        "last_watchdog",
    ];
    let (mut expected, mut found) = (expected.to_vec(), keys(&system));
    expected.sort_unstable();
    found.sort_unstable();
    assert_eq!(found, expected);
    assert_eq!(
        (&system["version"], &system["board"]),
        (&json!(env!("CARGO_PKG_VERSION")), &json!(target().name))
    );
    let commit = system["commit"].as_str().expect("a commit");
    let short = (7..=40).contains(&commit.len()) && commit.chars().all(|digit| digit.is_ascii_hexdigit());
    assert!(commit == "unknown" || short, "{commit}");
    for unknown in ["temperature_c", "last_panic", "last_watchdog"] {
        assert_eq!(system[unknown], Value::Null, "{unknown}");
    }
    for of_board in ["reset", "resets", "stack"] {
        assert_eq!(system[of_board] == Value::Null, !target().is_board(), "{of_board}");
    }
    let (name, tickets, sheets) = (target().name, target().tickets, target().sheets);
    // This reply needs a sheet.
    assert_eq!(
        (&system["free"]["requests"], &system["free"]["replies"]),
        (&json!(tickets), &json!(sheets - 1))
    );
    // This client has a place, and those before it one until they have left.
    let free = || gateway.ask("GET /api/system", "").json()["free"]["places"].as_u64();
    until("all places but one are free", || free() == Some(target().places - 1));
    let mut console = gateway.connect();
    console.send("system\r\n");
    let line = console.line();
    assert!(
        line.starts_with(&format!("ok version={} commit={commit} board={name} ", env!("CARGO_PKG_VERSION")))
    );
    assert!(line.contains(&format!(" free_requests={tickets} free_replies={sheets} ")), "{line}");
    assert_eq!(line.contains(" reset="), target().is_board(), "{line}");
}

#[test]
fn the_log_has_the_recent_lines() {
    let gateway = Gateway::start(16);
    for _ in 0..100 {
        gateway.ask("GET /nothing", "");
    }
    let reply = gateway.ask("GET /api/log", "");
    assert_eq!((reply.status, reply.field("content-type")), (200, Some("text/plain; charset=utf-8")));
    assert!(reply.body.ends_with('\n'));
    let connected = reply.body.lines().filter_map(|line| {
        let text = line.split_once("] ").unwrap_or_else(|| panic!("{line}")).1;
        text.strip_suffix(" connected")?.strip_prefix("client ")?.split_once(": ")?.0.parse().ok()
    });
    let clients: Vec<u32> = connected.collect();
    assert!(clients.is_sorted_by(|a, b| a + 1 == *b), "each client once, in order: {}", reply.body);
    assert!(clients.len() >= target().logged_clients, "{}", reply.body);
}

#[test]
fn the_page_and_its_files() {
    let gateway = Gateway::start(16);
    let page = include_str!("../../src/front/http/page/index.html");
    for (path, content_type, file) in [
        ("/", "text/html", page),
        ("/panel.css", "text/css", include_str!("../../src/front/http/page/panel.css")),
        ("/pid.js", "text/javascript", include_str!("../../src/front/http/page/pid.js")),
        ("/panel.js", "text/javascript", include_str!("../../src/front/http/page/panel.js")),
        ("/?x=1", "text/html", page),
    ] {
        let reply = gateway.ask(&format!("GET {path}"), "");
        assert_eq!(reply.status, 200, "{path}");
        assert!(reply.field("content-type").expect("a type").starts_with(content_type));
        assert!(reply.field("content-security-policy").expect("a policy").contains("default-src 'none'"));
        assert!(reply.body == file, "{path}: {} bytes, expected {}", reply.body.len(), file.len());
    }
}
