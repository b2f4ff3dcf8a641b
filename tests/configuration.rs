//! Settings over HTTP: read, put, tried out, confirmed, taken back.

mod common;

use std::io::{Read, Write};
use std::net::SocketAddr;

use common::client::{Lines, connect};
use common::http::{Reply, insist, insist_with};
use common::rig::Rig;
use common::{Gateway, ms, target, until};
use serde_json::{Value, json};

const CONFIG: &str = "/api/config";
const STATE: &str = "/api/config/state";
const PUT: &str = "PUT /api/config";
const DELETE: &str = "DELETE /api/config";
const CONFIRM: &str = "POST /api/config/confirm";

/// Status and body of an answer.
fn ask(address: SocketAddr, line: &str, body: &str) -> (u16, Value) {
    answer(&insist(address, line, body))
}

fn answer(reply: &Reply) -> (u16, Value) {
    (reply.status, reply.json())
}

fn get(gateway: &Gateway, path: &str) -> Value {
    let (status, body) = ask(gateway.main, &format!("GET {path}"), "");
    assert_eq!(status, 200, "{path}: {body}");
    body
}

fn put(gateway: &Gateway, document: &Value) -> (u16, Value) {
    ask(gateway.main, PUT, &document.to_string())
}

/// Puts a document that is taken; whether it is on trial.
fn change(gateway: &mut Gateway, document: &Value) -> bool {
    let (status, body) = put(gateway, document);
    assert_eq!((status, &body["restart"]), (200, &json!(true)), "{body}");
    let trial = &body["confirm_within_s"];
    assert!(trial.is_null() || *trial == json!(60), "{body}");
    gateway.await_start();
    !trial.is_null()
}

fn refused(answer: (u16, Value), status: u16, code: &str) -> String {
    assert_eq!((answer.0, &answer.1["error"]["code"]), (status, &json!(code)), "{}", answer.1);
    answer.1["error"]["message"].as_str().expect("a sentence").to_owned()
}

/// The settings of the factory: a board's own, or those of the file.
fn source() -> &'static str {
    if target().is_board() { "factory" } else { "file" }
}

/// Another network, where the gateway is reached all the same.
fn elsewhere(document: &Value) -> Value {
    let mut document = document.clone();
    document["net"]["dhcp"] = json!(false);
    document["net"]["address"] = json!("10.0.2.15/24");
    document["net"]["router"] = json!("10.0.2.2");
    document
}

#[test]
fn settings_are_put_and_outlast_the_power() {
    let mut rig = Rig::with_flash();
    let gateway = &mut rig.gateway;
    let mut document = get(gateway, CONFIG);
    assert_eq!(document["version"], json!(1));
    assert_eq!(get(gateway, STATE), json!({"settings": source(), "trial_left_s": null}));
    document["net"]["lease_ms"] = json!(333);
    document["axis"][0]["name"] = json!("first");
    document["axis"][1]["registers"] = json!({"status": 0x902});
    assert!(!change(gateway, &document));
    document["axis"][1]["registers"] = get(gateway, CONFIG)["axis"][1]["registers"].clone();
    assert_eq!(document["axis"][1]["registers"]["status"], json!(0x902));
    assert_eq!(get(gateway, CONFIG), document);
    assert_eq!(get(gateway, STATE), json!({"settings": "flash", "trial_left_s": null}));
    assert_eq!(Lines::connect(gateway.main).ask("axis"), "ok axes=first,y,z");
    gateway.cycle_power();
    assert_eq!(get(gateway, CONFIG), document);
    // What is read can be put, and is no other network.
    assert!(!change(gateway, &document));
    assert_eq!(get(gateway, CONFIG), document);
}

#[test]
fn a_network_that_is_confirmed_stays() {
    let mut rig = Rig::with_flash();
    let gateway = &mut rig.gateway;
    let document = elsewhere(&get(gateway, CONFIG));
    refused(ask(gateway.main, CONFIRM, ""), 409, "no-trial");
    assert!(change(gateway, &document));
    let state = get(gateway, STATE);
    assert!(state["trial_left_s"].as_u64().is_some_and(|left| (1..=60).contains(&left)), "{state}");
    refused(put(gateway, &document), 409, "on-trial");
    refused(ask(gateway.main, DELETE, ""), 409, "on-trial");
    let confirmed = json!({"settings": "flash", "trial_left_s": null});
    assert_eq!(ask(gateway.main, CONFIRM, ""), (200, confirmed));
    refused(ask(gateway.main, CONFIRM, ""), 409, "no-trial");
    gateway.cycle_power();
    assert_eq!(get(gateway, CONFIG), document);
}

#[test]
fn a_network_that_nobody_confirms_is_taken_back() {
    let mut rig = Rig::with_flash();
    let gateway = &mut rig.gateway;
    let document = get(gateway, CONFIG);
    assert!(change(gateway, &elsewhere(&document)));
    assert_eq!(get(gateway, CONFIG), elsewhere(&document));
    // After 60 s, by itself.
    gateway.await_start();
    assert_eq!(get(gateway, CONFIG), document);
    assert_eq!(get(gateway, STATE), json!({"settings": source(), "trial_left_s": null}));
}

#[test]
fn a_network_on_trial_does_not_outlast_the_power() {
    let mut rig = Rig::with_flash();
    let gateway = &mut rig.gateway;
    let mut document = get(gateway, CONFIG);
    document["net"]["idle_s"] = json!(77);
    assert!(!change(gateway, &document));
    assert!(change(gateway, &elsewhere(&document)));
    // It has had its start.
    assert_eq!(get(gateway, CONFIG), elsewhere(&document));
    gateway.cycle_power();
    assert_eq!(get(gateway, CONFIG), document);
    assert_eq!(get(gateway, STATE), json!({"settings": "flash", "trial_left_s": null}));
}

#[test]
fn the_factory_settings_come_back() {
    let mut rig = Rig::with_flash();
    let gateway = &mut rig.gateway;
    let document = get(gateway, CONFIG);
    let mut other = document.clone();
    other["net"]["idle_s"] = json!(77);
    assert!(!change(gateway, &other));
    let (status, body) = ask(gateway.main, DELETE, "");
    assert_eq!((status, body), (200, json!({"restart": true, "confirm_within_s": null})));
    gateway.await_start();
    assert_eq!(get(gateway, CONFIG), document);
    assert_eq!(get(gateway, STATE)["settings"], json!(source()));
}

#[test]
fn a_document_that_is_refused_changes_nothing() {
    let rig = Rig::with_flash();
    let gateway = &rig.gateway;
    let document = get(gateway, CONFIG);
    let with = |change: &dyn Fn(&mut Value)| {
        let mut document = document.clone();
        change(&mut document);
        put(gateway, &document)
    };
    // The sentences of --check, see tests/settings.rs.
    for (change, sentence) in [
        (
            &(|d: &mut Value| d["net"]["idle_s"] = json!(1)) as &dyn Fn(&mut Value),
            "[net] idle_s: 5 to 86400 is allowed",
        ),
        (&|d| d["net"]["hostname"] = json!("-"), "[net] hostname: 1 to 32 letters"),
        (
            &|d| d["net"]["address"] = json!("10.0.2.255/24"),
            "[net] address: it must be one that a host can have",
        ),
        (&|d| d["net"]["router"] = json!("10.9.9.9"), "[net] router: it must be another host"),
        (&|d| d["bus"][0]["baud"] = json!(1), "[[bus]] \"a\" baud: 300 to 1000000 is allowed"),
        (&|d| d["bus"][0]["port"] = json!("COM1"), "[[bus]] \"a\" port: expected \""),
        (&|d| d["bus"] = json!([]), "no [[bus]] is given"),
        (&|d| d["axis"][1]["bus"] = json!("q"), "[[axis]] \"y\" bus: there is no [[bus]] \"q\""),
        (
            &|d| d["axis"][2]["address"] = json!(1),
            "[[axis]] \"z\" address: axis \"x\" has this drive already",
        ),
        (&|d| d["version"] = json!(2), "version: 2 is not known, this firmware reads version 1"),
    ] {
        let message = refused(with(change), 400, "settings");
        assert!(message.starts_with(sentence), "{message}");
    }
    for change in [
        &(|d: &mut Value| d["net"]["colour"] = json!(1)) as &dyn Fn(&mut Value),
        &|d| d["nett"] = json!({}),
        &|d| d["net"]["idle_s"] = json!("5"),
        &|d| d["bus"][0]["units"] = json!("16-1"),
        &|d| d["bus"] = Value::Null,
        &|d| d["axis"][0]["name"] = json!("seventeen-letters"),
        &|d| d["axis"] = json!(vec![d["axis"][0].clone(); 33]),
    ] {
        refused(with(change), 400, "bad-json");
    }
    for text in
        ["", "{", "[]", "1", "{\"bus\":", &document.to_string()[1..], &format!("{document}{document}")]
    {
        refused(ask(gateway.main, PUT, text), 400, "bad-json");
    }
    assert_eq!(get(gateway, CONFIG), document);
    assert_eq!(get(gateway, STATE)["settings"], json!(source()));
    assert!(!gateway.log().contains("starting anew"));
}

#[test]
fn nobody_s_motion_is_cut_by_settings() {
    let mut rig = Rig::with_flash();
    let mut document = get(&rig.gateway, CONFIG);
    document["net"]["idle_s"] = json!(77);
    let (mut commander, _) = rig.jogging();
    let stream = commander.stream();
    let mut feeder = stream.try_clone().expect("a stream");
    let feeding = std::thread::spawn(move || {
        while feeder.write_all(b"feed\r\n").is_ok() {
            std::thread::sleep(ms(50));
        }
    });
    refused(put(&rig.gateway, &document), 409, "moving");
    refused(ask(rig.gateway.main, DELETE, ""), 409, "moving");
    assert!(rig.turns());
    stream.shutdown(std::net::Shutdown::Both).expect("closed");
    feeding.join().expect("the feeder");
    commander = Lines::connect(rig.gateway.main);
    // Owed a stop, then on its ramp.
    until("x stands", || commander.ok("axis x status").contains(" speed_rpm=0 "));
    until("the settings are taken", || put(&rig.gateway, &document).0 == 200);
    rig.gateway.await_start();
    assert_eq!(get(&rig.gateway, CONFIG), document);
}

#[test]
fn there_is_room_for_one_document_at_a_time_and_for_no_larger_one() {
    let rig = Rig::with_flash();
    let address = rig.gateway.main;
    let head =
        |length: usize| format!("PUT {CONFIG} HTTP/1.1\r\nHost: a\r\nContent-Length: {length}\r\n\r\n");
    // Refused before it is sent.
    let mut large = connect(address);
    large.write_all(head(100_000).as_bytes()).expect("sent");
    let mut reply = Vec::new();
    large.read_to_end(&mut reply).expect("an answer");
    refused(answer(&Reply::of(&reply)), 413, "too-large");
    let mut slow = connect(address);
    slow.write_all(head(2000).as_bytes()).expect("sent");
    until("the room is taken", || put(&rig.gateway, &json!({})).0 == 503);
    refused(put(&rig.gateway, &json!({})), 503, "busy");
    drop(slow);
    until("the room is free", || put(&rig.gateway, &json!({})).0 == 400);
}

#[test]
fn a_page_of_another_origin_changes_no_settings() {
    let rig = Rig::with_flash();
    for line in [PUT, DELETE, CONFIRM] {
        let reply = insist_with(rig.gateway.main, line, "Origin: http://elsewhere\r\n", "");
        refused(answer(&reply), 403, "origin");
    }
}

/// Held for good here: so the settings of the factory are in force at each start.
#[test]
fn the_button_held_at_start_brings_the_factory_settings_back() {
    if !target().is_board() {
        return;
    }
    let mut rig = Rig::on_board(|setup| setup.words.push((puente_emulator::BUTTON, 1)));
    let gateway = &mut rig.gateway;
    let document = get(gateway, CONFIG);
    let mut other = document.clone();
    other["net"]["idle_s"] = json!(77);
    assert!(!change(gateway, &other));
    assert_eq!(get(gateway, CONFIG), document);
    assert_eq!(get(gateway, STATE)["settings"], json!("factory"));
    assert!(gateway.log().contains("the button is held"));
}

#[test]
fn without_flash_settings_are_checked_and_not_taken() {
    if target().is_board() {
        return;
    }
    let gateway = Gateway::factory();
    let document = get(&gateway, CONFIG);
    refused(put(&gateway, &document), 409, "read-only");
    refused(ask(gateway.main, DELETE, ""), 409, "read-only");
    refused(put(&gateway, &json!({"bus": []})), 400, "settings");
}
