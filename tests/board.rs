//! What only a board does: it records why it fails, starts anew, and stops the axes that may have moved.
//! `cargo xtask emulate --test` runs this file, and names the firmware for tests in the variable `PUENTE_IMAGE`.

mod common;

use std::io::Write;
use std::net::SocketAddr;
use std::thread;
use std::time::{Duration, Instant};

use common::client::{Lines, Modbus, figure, read_pdu, value};
use common::http::{Reply, answer};
use common::rig::Rig;
use common::{Gateway, ms, until};
use serde_json::Value;

/// The reply of a board that may not be there; HTTP/1.0 has it in no chunks.
fn get(address: SocketAddr, path: &str) -> Option<Reply> {
    let reply = answer(address, &format!("GET {path} HTTP/1.0\r\n\r\n"))?;
    assert_eq!((reply.status, reply.field("transfer-encoding")), (200, None), "{reply:?}");
    Some(reply)
}

/// `/api/system` once the board has been reset so often.
fn system(rig: &Rig, resets: u64) -> Value {
    let mut system = Value::Null;
    until("the board answers after its reset", || {
        if let Some(reply) = get(rig.gateway.main, "/api/system") {
            system = reply.json();
        }
        system["resets"] == resets
    });
    system
}

/// Has a board obey a console line that ends it, with x jogging: how long after that the stop of x was on the wire. The
/// commander goes on with its work, so that no lease ends before the board has failed.
fn fails(rig: &mut Rig, hook: &str) -> Duration {
    rig.gateway.will_fail();
    let (commander, _) = rig.jogging();
    let mut stream = commander.stream();
    let obeyed = Instant::now();
    stream.write_all(format!("{hook}\r\naxis x status\r\n").as_bytes()).expect("sent");
    while obeyed.elapsed() < ms(1000) && stream.write_all(b"feed\r\n").is_ok() {
        thread::sleep(ms(50));
    }
    let (_, late) = rig.stop_after(obeyed);
    late
}

/// That x was stopped by the board after its start, and that a client may command it then.
fn stopped_by_the_new_start(rig: &Rig, after: &str, late: Duration) {
    println!("{after}: the stop was on the wire after {late:?}");
    assert_eq!(rig.event(), "gateway-restarted");
    let mut client = Lines::connect(rig.gateway.main);
    client.ok("axis x clear");
    client.ok("axis x enable");
    client.ok("axis x jog 50");
    client.ok("axis x stop");
}

#[test]
fn a_panic_is_recorded_and_its_axis_stopped() {
    let mut rig = Rig::on_board(|_| {});
    let before = system(&rig, 0);
    assert_eq!(before["reset"], "power-on");
    let late = fails(&mut rig, "debug panic");
    let system = system(&rig, 1);
    assert_eq!(system["reset"], "panic");
    let panic = &system["last_panic"];
    let text = panic["text"].as_str().expect("a text");
    assert!(text.contains("hooks.rs:") && text.ends_with(": a test hook was asked for"), "{system}");
    assert_eq!((&panic["cause"], &system["last_watchdog"]), (&Value::from("panic"), &Value::Null));
    assert!(
        panic["uptime_ms"].as_u64() > before["uptime_ms"].as_u64(),
        "the uptime is the one before: {system}"
    );
    let line = Lines::connect(rig.gateway.main).ok("system");
    assert!(
        line.contains(" reset=panic resets=1 ") && line.ends_with(&format!(" last_panic=\"{text}\"")),
        "{line}"
    );
    stopped_by_the_new_start(&rig, "panic", late);
}

#[test]
fn a_fault_is_recorded_and_its_axis_stopped() {
    let mut rig = Rig::on_board(|_| {});
    let late = fails(&mut rig, "debug fault");
    let system = system(&rig, 1);
    assert_eq!(
        (&system["reset"], &system["last_panic"]["cause"]),
        (&Value::from("fault"), &Value::from("fault"))
    );
    assert!(system["last_panic"]["text"].as_str().expect("a text").starts_with("fault at 0x"), "{system}");
    stopped_by_the_new_start(&rig, "fault", late);
}

/// What `/api/system` says of the watchdog after its reset.
fn hung(rig: &Rig) -> String {
    let system = system(rig, 1);
    assert_eq!((&system["reset"], &system["last_panic"]), (&Value::from("watchdog"), &Value::Null));
    let text = system["last_watchdog"]["text"].as_str().expect("a text").to_owned();
    let line = Lines::connect(rig.gateway.main).ok("system");
    assert!(line.contains(" reset=watchdog resets=1 "), "{line}");
    assert!(line.ends_with(&format!(" last_watchdog=\"{text}\"")), "{line}");
    text
}

/// The buses go on while the front hangs: the lease ends as always, long before the watchdog comes.
#[test]
fn a_front_that_hangs_is_found_and_the_lease_stops_its_axis() {
    let mut rig = Rig::on_board(|_| {});
    let late = fails(&mut rig, "debug hang front");
    println!("hang of the front: the stop was on the wire after {late:?}");
    assert!(!rig.gateway.log().contains("started after"), "the stop came before the reset");
    assert_eq!(hung(&rig), "the network's tasks or an interrupt held the processor");
    assert_eq!(rig.event(), "none", "nothing had to be stopped again");
}

#[test]
fn a_bus_that_keeps_the_processor_is_found_and_its_axis_stopped() {
    let mut rig = Rig::on_board(|_| {});
    let late = fails(&mut rig, "debug hang bus");
    assert!(!rig.gateway.log().contains("lease-expired"), "the new start stops it");
    assert_eq!(hung(&rig), "the bus tasks held the processor");
    stopped_by_the_new_start(&rig, "hang of the bus", late);
}

#[test]
fn a_bus_that_waits_for_ever_is_found_and_its_axis_stopped() {
    let mut rig = Rig::on_board(|_| {});
    let late = fails(&mut rig, "debug stall bus");
    assert_eq!(hung(&rig), "bus a makes no progress");
    stopped_by_the_new_start(&rig, "stall of the bus", late);
}

#[test]
fn a_restart_on_purpose_stops_what_moves() {
    let rig = Rig::on_board(|_| {});
    let (commander, _) = rig.jogging();
    let mut stream = commander.stream();
    stream.write_all(b"debug restart\r\n").expect("sent");
    rig.stop_after(Instant::now());
    let system = system(&rig, 1);
    assert_eq!((&system["reset"], &system["last_panic"]), (&Value::from("software"), &Value::Null));
    assert_eq!(rig.event(), "gateway-restarted");
}

#[test]
fn resets_are_counted_and_the_last_panic_stays() {
    let mut rig = Rig::on_board(|_| {});
    rig.gateway.will_fail();
    let mut client = Lines::connect(rig.gateway.main);
    client.ok("axis y enable");
    client.ok("axis y jog 100");
    client.ok("axis y stop");
    drop(client);
    let before = rig.wire.requests().len();
    for (resets, hook, reset) in [(1, "debug panic", "panic"), (2, "debug restart", "software")] {
        Lines::connect(rig.gateway.main).send(hook);
        assert_eq!(system(&rig, resets)["reset"], reset);
    }
    rig.gateway.monitor("system_reset");
    let system = system(&rig, 3);
    assert_eq!(
        (&system["reset"], &system["last_panic"]["cause"]),
        (&Value::from("pin"), &Value::from("panic"))
    );
    // None moved when the board was reset.
    assert_eq!(rig.event(), "none");
    assert!(rig.wire.requests()[before..].iter().all(|request| request.pdu[0] == 3), "nothing was written");
}

#[test]
fn the_board_tells_of_itself() {
    let rig = Rig::on_board(|_| {});
    let system = system(&rig, 0);
    assert_eq!((&system["board"], &system["reset"]), (&Value::from("mps2-an500"), &Value::from("power-on")));
    for (key, least, most) in [("requests", 20, 24), ("replies", 0, 4), ("places", 10, 18)] {
        let free = system["free"][key].as_u64().expect("a number");
        assert!((least..=most).contains(&free), "{key}: {system}");
    }
    let stack = |key: &str| system["stack"][key].as_u64().expect("a number");
    assert!(0 < stack("used") && stack("used") < stack("size"), "{system}");
    let line = Lines::connect(rig.gateway.main).ok("system");
    assert!(figure(&line, "uptime_ms") >= system["uptime_ms"].as_u64().expect("a time"), "{line}");
    assert_eq!(value(&line, "commit"), system["commit"].as_str());
}

#[test]
fn the_log_is_served_in_whole_lines() {
    let rig = Rig::on_board(|_| {});
    for _ in 0..60 {
        Lines::connect(rig.gateway.main).ok("feed");
        thread::sleep(ms(2));
    }
    let log = get(rig.gateway.main, "/api/log").expect("a log").body;
    assert!((2000..=3072).contains(&log.len()), "{} bytes", log.len());
    for line in log.lines() {
        assert!(
            line.starts_with('[') && line.get(11..19) == Some(" INFO ] ") || line.contains("] "),
            "{line}"
        );
    }
    let (kept, shown) = (log.lines().collect::<Vec<_>>(), rig.gateway.log());
    let first = shown.lines().position(|line| line == kept[0]).expect("the same line");
    assert!(shown.lines().skip(first).zip(&kept).all(|(shown, kept)| shown == *kept), "{log}");
    assert!(log.ends_with('\n') && log.contains(" connected\n"));
}

/// The lamps of the emulated board, as its register has them: link, bus, fault.
fn lamps(gateway: &mut Gateway) -> [bool; 3] {
    let answer = gateway.monitor("xp /1xw 0x4002f004");
    let (_, word) = answer.trim_end().rsplit_once("0x").expect("a word");
    let leds = u32::from_str_radix(word, 16).expect("a number");
    [leds & 1 != 0, leds & 2 != 0, leds & 4 != 0]
}

#[test]
fn the_lamps_show_its_link_its_bus_and_a_missing_slave() {
    let mut rig = Rig::on_board(|_| {});
    let gateway = &mut rig.gateway;
    until("the link lamp is on, alone", || lamps(gateway) == [true, false, false]);
    let mut client = Modbus::connect(gateway.main);
    until("the bus lamp shows a transaction", || {
        client.ask(1, &read_pdu(0x0901, 1));
        lamps(gateway) == [true, true, false]
    });
    until("the bus lamp goes out", || lamps(gateway) == [true, false, false]);
    client.ask(9, &read_pdu(0x0901, 1));
    for on in [true, false, true] {
        until("the fault lamp blinks for a slave that is not there", || lamps(gateway)[2] == on);
    }
    gateway.monitor("set_link lan9118.0 off");
    until("the link lamp goes out", || !lamps(gateway)[0]);
    gateway.monitor("set_link lan9118.0 on");
    until("the link lamp is on again", || lamps(gateway)[0]);
}

#[test]
fn the_fault_lamp_stays_on_after_a_panic() {
    let mut rig = Rig::on_board(|_| {});
    fails(&mut rig, "debug panic");
    until("the fault lamp is on", || lamps(&mut rig.gateway)[2]);
    // Longer than it would be on if it blinked.
    for _ in 0..20 {
        thread::sleep(ms(50));
        assert!(lamps(&mut rig.gateway)[2]);
    }
}
