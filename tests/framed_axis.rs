//! Axes with PID modules on a framed bus: what is refused, how they move, and what ends a motion.

mod common;

use common::client::{Lines, Modbus, figure, value};
use common::http::insist;
use common::table::{Connector, Table};
use common::{Document, Gateway, ms, target, until};
use puente_cell::framed::{Config, Disturbance, Trouble};
use puente_drives::pid::State;
use puente_framed::arbiter;
use puente_line::Settings;
use serde_json::{Value, json};

/// As slow a line, with as long a gap, as keeps its manners where a busy machine is late: see the test of two gateways.
const BAUD: u32 = 57_600;
const IPG: u16 = 30;
const SLOT: u16 = 90;
const SUPERVISION: std::time::Duration = ms(1_000);
/// Counts a second.
const SPEED: u32 = 10_000;
/// Further than an axis gets while somebody ends its motion.
const FAR: i32 = 100_000;

/// A gateway of axes x and y, which have gains, and z, which has none.
struct Rig {
    table: Table,
    gateway: Gateway,
}

impl Rig {
    fn new(lease_ms: u32) -> Self {
        let rig = Self::start(lease_ms, true, "");
        rig.modules_are_there();
        rig
    }

    /// On a line that gives back what the gateway sends, or does not.
    fn start(lease_ms: u32, echo: bool, keys: &str) -> Self {
        let line = Settings { baud: BAUD, format: "8N1".parse().expect("a format") };
        let mut config = Config { echo, ..Config::new(line, &[17, 18, 19]) };
        let characters = |count: u16| line.wire_time(count.into());
        config.manners = arbiter::Config {
            gap: characters(IPG),
            slot: characters(SLOT),
            rest: characters(SLOT),
            ..config.manners
        };
        for module in &mut config.modules {
            module.servo.speed = Some(SPEED);
            module.servo.communication = SUPERVISION;
        }
        let connector = if target().is_board() { Connector::Uart } else { Connector::Pty };
        let table = Table::new(config, &[connector]);
        let gains = "gains = [0.001, 0.0, 0.000002]";
        let gateway = Document::new()
            .net(&format!("lease_ms = {lease_ms}"))
            .framed("b", &table, 0, &format!("ipg = {IPG}\nslot = {SLOT}\ncycle_ms = 100\n{keys}"))
            .module("x", "b", 17, gains)
            .module("y", "b", 18, gains)
            .module("z", "b", 19, "")
            .start();
        Self { table, gateway }
    }

    fn modules_are_there(&self) {
        let mut client = self.client();
        for axis in ["x", "y", "z"] {
            until("the module is there", || client.ask(&format!("axis {axis} status")).starts_with("ok"));
        }
    }

    fn client(&self) -> Lines {
        Lines::connect(self.gateway.main)
    }

    /// A client that has sent x far away, and that sees it on its way.
    fn moving(&self) -> Lines {
        let mut commander = self.client();
        commander.ok("axis x enable");
        commander.ok(&format!("axis x move {FAR}"));
        until("x moves", || {
            commander.ok("feed");
            self.table.position(17) > 500.0
        });
        commander
    }

    /// x stands, under current, where nobody has sent it.
    fn held_on_its_way(&self) {
        until("x stands", || {
            self.table.of(17, |module| {
                module.status().state == State::Held && module.plant().velocity().abs() < 20.0
            })
        });
        let position = self.table.position(17);
        assert!((500.0..f64::from(FAR) / 2.0).contains(&position), "{position}");
    }

    fn state(&self, address: u8) -> State {
        self.table.of(address, |module| module.status().state)
    }

    fn disturb(&self, address: u8, trouble: Trouble) {
        // At once: the past is over.
        let now = puente_line::Instant::ZERO;
        assert!(self.table.cell().disturb(now, Disturbance::Station(address, trouble)), "a module");
    }

    fn get(&self, path: &str) -> Value {
        insist(self.gateway.main, &format!("GET {path}"), "").json()
    }
}

fn event(client: &mut Lines, axis: &str) -> String {
    let status = client.ok(&format!("axis {axis} status"));
    value(&status, "event").expect("an event").to_owned()
}

fn refused(client: &mut Lines, command: &str, code: &str) -> String {
    let answer = client.ask(command);
    assert!(answer.starts_with(&format!("error {code} ")), "{command}: {answer}");
    answer
}

#[test]
fn an_axis_is_enabled_where_it_stands_and_moves_where_it_is_sent() {
    let rig = Rig::new(5000);
    let mut client = rig.client();
    refused(&mut client, "axis x move 1000", "not-enabled");
    let answer = refused(&mut client, "axis z enable", "no-gains");
    assert!(answer.contains("axis NAME gains KP KI KD"), "{answer}");
    assert_eq!(client.ok("axis z gains 0.001 0 0.000002"), "ok axis=z kp=0.001 ki=0 kd=0.000002");
    let before = rig.table.position(19);
    assert_eq!(client.ok("axis z enable"), "ok axis=z enabled=1");
    let status = client.ok("axis z status");
    assert_eq!(value(&status, "state"), Some("held"), "{status}");
    assert_eq!((value(&status, "lease"), value(&status, "event")), (Some("none"), Some("none")), "{status}");
    refused(&mut client, "axis z gains 0 0 0", "no-gains");
    refused(&mut client, "axis z move 16777217", "range");
    assert!((rig.table.position(19) - before).abs() < 2.0, "it stays where it was");
    assert_eq!(client.ok("axis z move 2000"), "ok axis=z set_point=2000 lease_ms=5000");
    until("z arrives", || (rig.table.position(19) - 2000.0).abs() < 20.0);
    // Another aim on the way.
    client.ok("axis z move 4000");
    client.ok("axis z move -1000");
    until("z arrives", || (rig.table.position(19) + 1000.0).abs() < 20.0);
    let status = client.ok("axis z status");
    assert_eq!((value(&status, "state"), value(&status, "set_point")), (Some("following"), Some("-1000")));
    assert_eq!(client.ok("axis z disable"), "ok axis=z enabled=0");
    assert_eq!(rig.state(19), State::Disabled);
    assert_eq!((rig.state(17), rig.state(18)), (State::Disabled, State::Disabled));
}

#[test]
fn what_a_drive_has_not_is_told() {
    let rig = Rig::new(250);
    let mut client = rig.client();
    for command in ["jog 100", "jog 0", "alarm", "get Pn037", "set Pn037 1"] {
        refused(&mut client, &format!("axis x {command}"), "unsupported");
    }
    refused(&mut client, "bus b scan 1-3", "unsupported");
    refused(&mut client, "axis x gains 1 2", "usage");
    refused(&mut client, "axis x gains 1 -2 0", "range");
    refused(&mut client, "axis x gains 0.0000000012 0 0", "gains");
    let status = client.ok("bus b status");
    for (key, expected) in [("protocol", "framed"), ("station", "1"), ("line", "up"), ("cycle_ms", "100")] {
        assert_eq!(value(&status, key), Some(expected), "{status}");
    }
    until("it goes round", || figure(&client.ok("bus b status"), "cycles") > 3);
}

#[test]
fn anyone_stops_it_and_its_commander_keeps_still() {
    let rig = Rig::new(5000);
    let mut commander = rig.moving();
    let mut other = rig.client();
    refused(&mut other, "axis x move 0", "leased");
    refused(&mut other, "axis x enable", "leased");
    refused(&mut other, "axis x gains 1 0 0", "leased");
    assert_eq!(other.ok("axis x stop"), "ok axis=x stopped=1");
    assert_eq!(rig.state(17), State::Held, "when it is told, it is so");
    rig.held_on_its_way();
    refused(&mut commander, &format!("axis x move {FAR}"), "standstill");
    assert_eq!(event(&mut commander, "x"), "stopped-by-other");
    // It is still under current, and its next commander need not enable it.
    other.ok("axis x move 0");
    until("x comes back", || {
        other.ok("feed");
        rig.table.position(17).abs() < 20.0
    });
    other.ok("axis x clear");
    assert_eq!((event(&mut other, "x").as_str(), rig.state(17)), ("none", State::Disabled));
}

#[test]
fn a_commander_that_falls_silent_or_is_gone_moves_nothing() {
    for (lease_ms, gone) in [(300, false), (5000, true)] {
        let rig = Rig::new(lease_ms);
        let commander = rig.moving();
        let mut watcher = rig.client();
        if gone {
            drop(commander);
        }
        rig.held_on_its_way();
        let cause = if gone { "commander-disconnected" } else { "lease-expired" };
        until("the event is latched", || event(&mut watcher, "x") == cause);
        until("the stop is confirmed", || watcher.ask("axis x move 0").starts_with("ok"));
    }
}

#[test]
fn a_stop_or_off_of_what_stands_changes_nothing() {
    let rig = Rig::new(250);
    let mut client = rig.client();
    for _ in 0..3 {
        client.ok("axis x stop");
        assert_eq!(rig.state(17), State::Disabled, "a stop puts nothing under current");
        client.ok("axis x disable");
    }
    client.ok("axis x enable");
    client.ok("axis x stop");
    assert_eq!(rig.state(17), State::Held);
    client.ok("axis x enable");
    assert_eq!(rig.state(17), State::Held);
}

#[test]
fn a_fault_is_told_and_acknowledged() {
    let rig = Rig::new(5000);
    let mut commander = rig.moving();
    rig.disturb(17, Trouble::Amplifier(true));
    until("the fault is told", || value(&commander.ok("axis x status"), "state") == Some("fault"));
    let status = commander.ok("axis x status");
    assert!(status.contains(" fault=\"amplifier fault\" "), "{status}");
    until("the lease is over", || event(&mut commander, "x") == "drive-fault");
    assert_eq!(value(&commander.ok("axis x status"), "lease"), Some("none"));
    refused(&mut commander, "axis x enable", "fault");
    let axis = rig.get("/api/axes/x");
    assert_eq!((&axis["state"], &axis["fault"]), (&json!("fault"), &json!("amplifier fault")), "{axis}");
    assert_eq!((&axis["online"], &axis["enabled"]), (&json!(true), &json!(false)));
    rig.disturb(17, Trouble::Amplifier(false));
    assert_eq!(commander.ok("axis x clear"), "ok axis=x enabled=0");
    assert_eq!((rig.state(17), event(&mut commander, "x").as_str()), (State::Disabled, "none"));
    commander.ok("axis x enable");
    assert_eq!(rig.state(17), State::Held);
}

#[test]
fn a_module_that_is_not_heard_is_told_and_the_others_go_on() {
    let rig = Rig::new(5000);
    let mut client = rig.client();
    client.ok("axis y enable");
    rig.disturb(17, Trouble::Mute(true));
    until("x is silent", || client.ask("axis x status").starts_with("error no-reply "));
    refused(&mut client, "axis x enable", "no-reply");
    refused(&mut client, "axis x stop", "no-reply");
    assert_eq!(rig.state(17), State::Disabled);
    let axes = rig.get("/api/axes");
    assert_eq!((&axes[0]["online"], &axes[1]["online"]), (&json!(false), &json!(true)), "{axes}");
    assert_eq!(axes[0]["error"]["code"], "no-reply", "{axes}");
    client.ok("axis y move 1000");
    until("y arrives", || (rig.table.position(18) - 1000.0).abs() < 20.0);
    rig.disturb(17, Trouble::Mute(false));
    until("x is back", || client.ask("axis x status").starts_with("ok"));
    assert_eq!(rig.state(17), State::Disabled, "and off, as it was");
    client.ok("axis x enable");
}

/// An adapter whose receiver is off while it sends.
#[test]
fn a_line_that_gives_nothing_back_is_told() {
    // All sixteen, with their back-offs, would take a minute on this line.
    let rig = Rig::start(5000, false, "attempts = 3");
    let mut client = rig.client();
    until("it is told", || client.ask("axis x status").starts_with("error not-sent "));
    let answer = refused(&mut client, "axis x enable", "not-sent");
    assert!(answer.contains("echo = \"off\""), "{answer}");
    let status = client.ok("bus b status");
    assert!(matches!(value(&status, "line"), Some("no-echo" | "collisions")), "{status}");
    let bus = rig.get("/api/buses");
    assert!(bus[0]["statistics"]["failure"].is_string(), "{bus}");
}

#[test]
fn a_line_that_gives_nothing_back_is_used_where_that_is_known() {
    let rig = Rig::start(5000, false, "echo = \"off\"");
    rig.modules_are_there();
    let mut client = rig.client();
    client.ok("axis x enable");
    assert_eq!(rig.state(17), State::Held);
}

/// One that was put into the queue of a framed bus stayed there for ever: found by the fuzz target of the front.
#[test]
fn a_modbus_broadcast_does_not_go_to_a_framed_bus() {
    let rig = Rig::start(5000, true, "");
    let mut client = Modbus::connect(rig.gateway.modbus);
    const PATH_UNAVAILABLE: u8 = 0x0A;
    assert_eq!(client.write(0, 0x0303, 1), Err(PATH_UNAVAILABLE));
}

#[test]
fn over_http() {
    let rig = Rig::new(300);
    let main = rig.gateway.main;
    let ask = |line: &str, body: &str| insist(main, line, body);
    assert_eq!(ask("POST /api/axes/z/enable", "").error(), (409, "no-gains".into()));
    let gains = json!({"kp": 0.001, "ki": 0.0, "kd": 0.000002});
    let put = ask("PUT /api/axes/z/gains", &gains.to_string());
    assert_eq!((put.status, put.json()), (200, gains.clone()));
    assert_eq!(rig.get("/api/axes/z/gains"), gains);
    for (body, code) in [("{\"kp\":1}", "bad-json"), ("{\"kp\":1,\"ki\":-1,\"kd\":0}", "range")] {
        assert_eq!(ask("PUT /api/axes/z/gains", body).error(), (400, code.into()));
    }
    assert_eq!(ask("POST /api/axes/z/enable", "").json()["state"], "held");
    let moved = ask("POST /api/axes/z/move", "{\"position\": 1500, \"hold_ms\": 5000}");
    let told = moved.json();
    assert_eq!((moved.status, &told["state"], &told["set_point"]), (200, &json!("following"), &json!(1500)));
    assert!(told["lease"]["left_ms"].as_u64().is_some_and(|left| left > 300), "{told}");
    let near = |value: &Value| value.as_f64().is_some_and(|value| (value - 1500.0).abs() < 20.0);
    let mut axis = Value::Null;
    until("z arrives", || {
        axis = rig.get("/api/axes/z");
        near(&axis["position"]) && near(&axis["reference"])
    });
    for (key, expected) in [
        ("drive", json!("pid")),
        ("bus", json!("b")),
        ("address", json!(19)),
        ("online", json!(true)),
        ("enabled", json!(true)),
        ("state", json!("following")),
        ("fault", Value::Null),
        ("set_point", json!(1500)),
        ("gains", gains),
        ("event", Value::Null),
        ("error", Value::Null),
    ] {
        assert_eq!(axis[key], expected, "{key} in {axis}");
    }
    assert_eq!(ask("POST /api/axes/z/jog", "{\"rpm\": 5}").error(), (404, "unsupported".into()));
    assert_eq!(ask("POST /api/axes/z/stop", "").status, 200);
    assert_eq!(ask("POST /api/axes/z/disable", "").json()["state"], "disabled");
    let bus = &rig.get("/api/buses")[0];
    assert_eq!((&bus["protocol"], &bus["policy"]), (&json!("framed"), &json!("truncated")), "{bus}");
    assert!(bus["statistics"]["cycles"].as_u64().is_some_and(|cycles| cycles > 0), "{bus}");
    let metrics = ask("GET /metrics", "").body;
    for line in ["puente_axis_position_counts{axis=\"z\"} ", "puente_cycles_total{bus=\"b\",event=\"done\"} "]
    {
        assert!(metrics.contains(line), "{metrics}");
    }
}

#[test]
fn a_renewal_that_comes_late_moves_nothing() {
    let rig = Rig::new(300);
    let ask = |command: &str, body: Value| {
        insist(rig.gateway.main, &format!("POST /api/axes/x/{command}"), &body.to_string())
    };
    assert_eq!(ask("enable", Value::Null).status, 200);
    let renewal = json!({"position": FAR, "hold_ms": 300, "renew": true});
    let ended = (503, "not-sent".to_owned());
    assert_eq!(ask("move", renewal.clone()).error(), ended, "there is nothing to renew");
    assert_eq!(rig.state(17), State::Held);
    assert_eq!(ask("move", json!({"position": FAR, "hold_ms": 5000})).status, 200);
    let renewed = ask("move", renewal.clone()).json();
    assert!(renewed["lease"]["left_ms"].as_u64().is_some_and(|left| left <= 300), "{renewed}");
    rig.held_on_its_way();
    assert_eq!(event(&mut rig.client(), "x"), "lease-expired");
    assert_eq!(ask("move", renewal).error(), ended);
    assert_eq!(rig.state(17), State::Held);
    assert_eq!(ask("move", json!({"position": 0, "hold_ms": 5000})).json()["state"], "following");
}
