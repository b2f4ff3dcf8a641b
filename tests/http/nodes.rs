//! Nodes of a CANopen bus and their objects.

use puente_cell::can::{DriveFault, Fault};
use serde_json::{Value, json};

use super::common::http::{Reply, insist, insist_with};
use super::common::servos::Rig;
use super::common::until;
use super::{error, keys};

fn ask(rig: &Rig, line: &str, body: &str) -> Reply {
    let (method, path) = line.split_once(' ').expect("a method and a path");
    insist(rig.gateway.main, &format!("{method} /api/buses/can/nodes{path}"), body)
}

fn get(rig: &Rig, path: &str) -> Value {
    ask(rig, &format!("GET {path}"), "").json()
}

#[test]
fn nodes_and_their_emergencies() {
    let rig = Rig::start(5_000, "", |document| document.node("can", 9, "name = \"spare\"\noptional = true"));
    rig.are_present(&[("u", 2), ("v", 3), ("w", 4)]);
    let found = get(&rig, "");
    let nodes = found.as_array().expect("an array");
    let ids: Vec<_> = nodes.iter().map(|node| node["node"].clone()).collect();
    assert_eq!(ids, [2, 3, 4, 9]);
    let node = get(&rig, "/3");
    let all = "node name axis optional state health verdict heard_ms emergency duplicate objects";
    let mut all: Vec<_> = all.split(' ').collect();
    let mut found = keys(&node);
    all.sort_unstable();
    found.sort_unstable();
    assert_eq!(found, all);
    assert_eq!((&node["axis"], &node["health"]), (&json!("v"), &json!("booted")));
    assert_eq!((&node["emergency"], &node["duplicate"]), (&json!(null), &json!(false)));
    let spare = get(&rig, "/9");
    assert_eq!((&spare["name"], &spare["health"]), (&json!("spare"), &json!("absent")));
    assert_eq!(
        (&spare["optional"], &spare["axis"], &spare["state"]),
        (&json!(true), &json!(null), &json!(null))
    );

    assert_eq!(get(&rig, "/3/emergencies"), json!([]));
    rig.suffer(3, Fault::Drive(DriveFault::OverCurrent));
    until("it is told", || get(&rig, "/3")["emergency"].is_object());
    let emergency = get(&rig, "/3")["emergency"].clone();
    assert!(emergency["text"].as_str().is_some_and(|text| !text.is_empty()), "{emergency}");
    assert_eq!(get(&rig, "/3/emergencies")[0]["emergency"]["code"], emergency["code"]);
    assert_eq!(get(&rig, "/2/emergencies"), json!([]));
}

#[test]
fn nodes_are_commanded() {
    let rig = Rig::new(5_000);
    let state = |id: u8| get(&rig, &format!("/{id}"))["state"].clone();
    assert_eq!(ask(&rig, "POST /3/preop", "").json(), json!({"node": 3, "command": "preop"}));
    until("it obeys", || state(3) == json!("pre-operational"));
    assert_eq!(state(2), json!("operational"));
    assert_eq!(ask(&rig, "POST /3/start", "").status, 200);
    until("it obeys", || state(3) == json!("operational"));
    assert_eq!(ask(&rig, "POST /0/stop", "").json(), json!({"node": 0, "command": "stop"}));
    until("all obey", || (2..5).all(|id| state(id) == json!("stopped")));
    // It takes an axis from whom it belongs to.
    assert_eq!(ask(&rig, "POST /0/start", "").status, 200);
    until("all obey", || (2..5).all(|id| state(id) == json!("operational")));
    let mut commander = rig.client();
    commander.ok("axis u enable");
    commander.ok("axis u velocity 100");
    for path in ["/2/stop", "/0/reset"] {
        assert_eq!(ask(&rig, &format!("POST {path}"), "").error(), error(409, "leased"), "{path}");
    }
    commander.ok("axis u stop");
}

#[test]
fn objects_are_read_and_written() {
    let rig = Rig::new(5_000);
    let value = |path: &str| get(&rig, &format!("/2/objects/{path}"))["value"].clone();
    assert!(value("6083:0/u32").is_u64());
    assert_eq!(value("6083:0/u32"), value("0x6083/u32"));
    let put = |path: &str, body: &str| ask(&rig, &format!("PUT /2/objects/{path}"), body);
    assert_eq!(put("6083:0/u32", "{\"value\":70000}").status, 200);
    assert_eq!(value("6083/u32"), json!(70_000));
    assert_eq!(value("6083/hex"), json!("70 11 01 00"));
    assert_eq!(value("6083"), json!("70 11 01 00"), "nothing is known of its type");
    assert_eq!(put("6083/hex", "{\"value\":\"01 00 00 00\"}").status, 200);
    assert_eq!(value("6083/i32"), json!(1));
    let reply = ask(&rig, "GET /2/objects/9999", "");
    assert_eq!(reply.error(), error(502, "abort"));
    assert_eq!(reply.json()["error"]["abort"], json!("06020000"));
    assert_eq!(ask(&rig, "GET /77/objects/1000", "").error(), error(504, "no-reply"));
    for (body, status, code) in [
        ("{\"value\":-1}", 400, "value"),
        ("{\"value\":4294967296}", 400, "value"),
        ("{\"value\":\"one\"}", 400, "value"),
        ("{\"value\":1,\"more\":2}", 400, "bad-json"),
        ("{}", 400, "bad-json"),
        ("1", 400, "bad-json"),
    ] {
        assert_eq!(put("6083:0/u32", body).error(), error(status, code), "{body}");
    }
    assert_eq!(value("6083/i32"), json!(1), "nothing of it was written");
    // A set-point is for whoever commands the axis, and so is anything else meanwhile. Reads are free.
    let mut commander = rig.client();
    commander.ok("axis u enable");
    commander.ok("axis u velocity 100");
    for (path, value) in [("60FF/i32", 5), ("6040/u16", 15), ("6083/u32", 5)] {
        let body = format!("{{\"value\":{value}}}");
        assert_eq!(put(path, &body).error(), error(409, "leased"), "{path}");
    }
    assert_eq!(value("6083/u32"), json!(1));
    // A controlword that stops is everyone's.
    assert_eq!(put("6040/u16", "{\"value\":2}").status, 200);
    until("it stands", || rig.velocity(2) == 0.0);
}

#[test]
fn a_data_sheet_gives_names_and_types() {
    const SHEET: &str =
        "[6083]\nParameterName=Profile acceleration\nObjectType=7\nDataType=0x0007\nAccessType=rw\n";
    let rig = Rig::new(5_000);
    assert_eq!(get(&rig, "/2/eds"), json!({"objects": 0, "left_out": 0}));
    let put = |sheet: &str| ask(&rig, "PUT /2/eds", sheet);
    assert_eq!(put(SHEET).json(), json!({"objects": 1, "left_out": 0}));
    assert_eq!(get(&rig, "/2")["objects"], json!(1));
    assert_eq!(get(&rig, "/2/objects").as_array().map(Vec::len), Some(1));
    let object = get(&rig, "/2/objects/6083");
    assert_eq!((&object["name"], &object["type"]), (&json!("Profile acceleration"), &json!("u32")));
    assert!(object["value"].is_u64(), "{object}");
    assert_eq!(get(&rig, "/3/objects"), json!([]), "it is of one node");
    // A mistake is told, and nothing of the file is kept.
    assert_eq!(put("[6083]\nDataType=0x0007\nthis is no line\n").error(), error(400, "eds"));
    assert_eq!(ask(&rig, "DELETE /2/eds", "").json(), json!({"objects": 0, "left_out": 0}));
    assert_eq!(get(&rig, "/2/objects/6083")["name"], json!(null));
}

#[test]
fn what_there_is_not_of_a_node() {
    let rig = Rig::new(5_000);
    for (line, status, code) in [
        ("GET /0", 404, "unknown-node"),
        ("GET /128", 404, "unknown-node"),
        ("GET /two", 404, "unknown-node"),
        ("GET /2/wings", 404, "not-found"),
        ("POST /2/fly", 404, "not-found"),
        ("POST /128/start", 404, "unknown-node"),
        ("DELETE /2", 405, "method"),
        ("GET /2/start", 405, "method"),
        ("POST /2/objects/6083", 405, "method"),
        ("GET /2/objects/wings", 400, "object"),
        ("GET /2/objects/10000", 400, "object"),
        ("GET /2/objects/6083:256", 400, "object"),
        ("GET /2/objects/6083:0/u7", 400, "type"),
    ] {
        assert_eq!(ask(&rig, line, "").error(), error(status, code), "{line}");
    }
    let path = "GET /api/buses/nope/nodes/2";
    assert_eq!(insist(rig.gateway.main, path, "").error(), error(404, "unknown-bus"));
    // A browser writes nothing from a page of another origin.
    let origin = "Origin: http://elsewhere\r\n";
    let line = "PUT /api/buses/can/nodes/2/objects/6083/u32";
    let reply = insist_with(rig.gateway.main, line, origin, "{\"value\":5}");
    assert_eq!(reply.error(), error(403, "origin"));
}
