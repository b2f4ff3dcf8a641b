//! Who may command an axis, in every dialect: one at a time, and stop for everyone.

mod common;

use std::thread;
use std::time::{Duration, Instant};

use common::client::{Lines, Modbus, figure, reset, send_and_close};
use common::http::{Reply, ask};
use common::rig::{ENABLE, FORWARD, REVERSE, Rig};
use common::{MODES, ms, target, until};
use puente_modbus::Mode;

const BUSY: Result<(), u8> = Err(0x06);

impl Rig {
    fn modbus(&self) -> Modbus {
        Modbus::connect(self.gateway.main)
    }

    /// A Modbus/TCP client that has started a jog of x by plain register writes.
    fn raw_jogging(&self, direction: u16) -> Modbus {
        let mut client = self.modbus();
        assert_eq!(client.write(1, ENABLE, 1), Ok(()));
        assert_eq!(client.write(1, direction, 1), Ok(()));
        assert!(self.turns());
        client
    }
}

fn keeps_turning(rig: &Rig, time: Duration, mut meanwhile: impl FnMut()) {
    let start = Instant::now();
    while start.elapsed() < time {
        meanwhile();
        assert!(rig.turns(), "stopped after {:?}", start.elapsed());
        thread::sleep(ms(20));
    }
}

#[test]
fn a_jog_by_plain_modbus_writes_is_under_the_lease_too() {
    for mode in MODES {
        let rig = Rig::new(mode, 300);
        let mut client = rig.raw_jogging(FORWARD);
        let mut last = Instant::now();
        keeps_turning(&rig, ms(800), || {
            last = Instant::now();
            assert!(client.read(1, 0x0806, 1).is_ok());
        });
        let (before, late) = rig.stop_after(last);
        println!("{mode:?}: stop {late:?} after the last word, lease 300 ms");
        // The last reading, and no other frame.
        assert!(before == 1 && late >= ms(300), "{before} frames, {late:?}");
        assert_eq!(rig.event(), "lease-expired");
        // Reading goes on; the axis stays at rest.
        assert_eq!(client.read(1, FORWARD, 1), Ok(vec![0]));
    }
}

#[test]
fn a_jog_by_modbus_ascii_frames_is_under_the_lease_too() {
    let rig = Rig::new(Mode::Ascii, 300);
    let mut client = Lines::connect(rig.gateway.main);
    assert_eq!(client.ask(":010610230001C5"), ":010610230001C5");
    assert_eq!(client.ask(":010610240001C4"), ":010610240001C4");
    let asked = Instant::now();
    rig.stop_after(asked);
    assert_eq!(rig.event(), "lease-expired");
}

#[test]
fn closing_a_modbus_connection_stops_its_jog() {
    for (direction, off) in [(FORWARD, 0x24), (REVERSE, 0x25)] {
        for abort in [false, true] {
            let rig = Rig::new(Mode::Rtu, 5000);
            let client = rig.raw_jogging(direction);
            let closed = Instant::now();
            if abort {
                reset(client.stream)
            } else {
                drop(client)
            }
            let (_, late) = rig.stop_after(closed);
            assert!(late < ms(2500), "not by the end of the lease");
            until("that direction is off", || rig.wire.pdus(1).contains(&vec![6, 0x10, off, 0, 0]));
        }
    }
}

/// A controller that writes both directions in each of its cycles stops one of them all the time.
#[test]
fn a_commander_that_stops_one_direction_still_answers_for_the_other() {
    let rig = Rig::new(Mode::Rtu, 400);
    let mut client = rig.raw_jogging(REVERSE);
    keeps_turning(&rig, ms(1000), || {
        assert_eq!(client.write(1, REVERSE, 1), Ok(()));
        assert_eq!(client.write(1, FORWARD, 0), Ok(()));
    });
    Lines::connect(rig.gateway.main).error("axis x jog 5", "leased");
    drop(client);
    until("x stands", || !rig.turns());
}

#[test]
fn a_modbus_stop_of_anyone_stops_the_axis_whichever_direction_it_names() {
    for register in [ENABLE, FORWARD, REVERSE] {
        let rig = Rig::new(Mode::Rtu, 5000);
        let (mut commander, _) = rig.jogging();
        assert_eq!(rig.modbus().write(1, register, 0), Ok(()));
        until("x stands", || !rig.turns());
        commander.error("axis x jog 100", "standstill");
        assert_eq!(rig.event(), "stopped-by-other");
    }
}

#[test]
fn a_second_client_is_refused_in_every_dialect_but_may_read() {
    let rig = Rig::new(Mode::Ascii, 5000);
    let (mut commander, _) = rig.jogging();
    let mut other = Lines::connect(rig.gateway.main);
    for command in ["jog 50", "enable", "clear", "set Pn037 200"] {
        let refusal = other.error(&format!("axis x {command}"), "leased");
        assert!(refusal.contains(": client ") && refusal.contains("stop is allowed"), "{refusal}");
    }
    other.ok("axis x status");
    assert_eq!(other.ok("axis x get Pn037"), "ok axis=x Pn037=100 unit=r/min");
    let mut modbus = rig.modbus();
    for (register, value) in [(ENABLE, 1), (FORWARD, 1), (REVERSE, 1), (0x1022, 1), (0x0025, 200)] {
        assert_eq!(modbus.write(1, register, value), BUSY);
    }
    assert_eq!(modbus.read(1, 0x0025, 1), Ok(vec![100]));
    let reply = http(&rig, "POST /api/axes/x/jog", "{\"rpm\":50,\"hold_ms\":500}");
    assert_eq!(reply.error(), (409, "leased".to_owned()));
    // The other axes are free, and the commander is not disturbed.
    other.ok("axis y enable");
    commander.ok("axis x jog 120");
    assert_eq!(rig.event(), "none");
    assert!(rig.turns());
}

#[test]
fn everyone_may_stop_in_every_dialect() {
    type Stop = fn(&Rig);
    let stops: [(&str, Stop); 5] = [
        ("console stop", |rig| drop(Lines::connect(rig.gateway.main).ok("axis x stop"))),
        ("console jog 0", |rig| drop(Lines::connect(rig.gateway.main).ok("axis x jog 0"))),
        ("console disable", |rig| drop(Lines::connect(rig.gateway.main).ok("axis x disable"))),
        ("HTTP stop", |rig| assert_eq!(http(rig, "POST /api/axes/x/stop", "").status, 200)),
        ("all off", |rig| {
            let all_off = [0x10, 0x10, 0x23, 0, 3, 6, 0, 0, 0, 0, 0, 0];
            assert_eq!(rig.modbus().ask(1, &all_off), [0x10, 0x10, 0x23, 0, 3]);
        }),
    ];
    for (what, stop) in stops {
        let rig = Rig::new(Mode::Ascii, 5000);
        let (mut commander, _) = rig.jogging();
        stop(&rig);
        until(what, || !rig.turns());
        commander.error("axis x jog 100", "standstill");
        assert_eq!(rig.event(), "stopped-by-other", "{what}");
    }
}

#[test]
fn a_button_that_is_still_held_does_not_restart_what_somebody_else_has_stopped() {
    let rig = Rig::new(Mode::Ascii, 5000);
    let (mut commander, _) = rig.jogging();
    Lines::connect(rig.gateway.main).ok("axis x stop");
    for _ in 0..5 {
        commander.error("axis x jog 100", "standstill");
        thread::sleep(ms(400));
    }
    assert!(!rig.turns());
    thread::sleep(ms(1000));
    commander.ok("axis x jog 100");
    assert!(rig.turns());
}

#[test]
fn when_the_lease_has_ended_the_next_client_may_command() {
    let rig = Rig::new(Mode::Ascii, 250);
    let (mut first, _) = rig.jogging();
    let asked = Instant::now();
    rig.stop_after(asked);
    let mut second = Lines::connect(rig.gateway.main);
    until("the stop is confirmed and the axis free", || second.ask("axis x jog 60").starts_with("ok"));
    first.error("axis x jog 100", "leased");
}

#[test]
fn an_http_jog_ends_with_its_hold_time_whatever_else_its_client_asks() {
    let rig = Rig::new(Mode::Ascii, 5000);
    assert_eq!(http(&rig, "POST /api/axes/x/enable", "").status, 200);
    let reply = http(&rig, "POST /api/axes/x/jog", "{\"rpm\":100,\"hold_ms\":400}");
    let confirmed = Instant::now();
    assert_eq!(reply.status, 200, "{reply:?}");
    keeps_turning(&rig, ms(250), || assert_eq!(http(&rig, "GET /metrics", "").status, 200));
    let (before, late) = rig.stop_after(confirmed);
    println!("HTTP: stop {late:?} after the reply to a jog with hold_ms 400");
    assert!(before <= target().frames_before_stop && late > ms(300), "{before} frames, {late:?}");
    assert_eq!(rig.event(), "lease-expired");
}

#[test]
fn motion_for_all_drives_at_once_is_refused_and_a_stop_for_all_is_not() {
    for mode in MODES {
        let rig = Rig::new(mode, 5000);
        let (_commander, _) = rig.jogging();
        let mut other = rig.modbus();
        let motion = [6, 0x10, 0x24, 0, 1];
        assert_eq!(other.ask(0, &motion), [0x86, 1]);
        other.send(0, &[6, 0x10, 0x24, 0, 0]);
        until("x stands", || !rig.turns());
        assert!(!rig.wire.requests().iter().any(|heard| heard.unit == 0 && heard.pdu == motion));
        assert_eq!(rig.event(), "stopped-by-other");
    }
}

#[test]
fn a_client_that_has_closed_its_side_cannot_start_motion() {
    let rig = Rig::new(Mode::Ascii, 5000);
    Lines::connect(rig.gateway.main).ok("axis x enable");
    let reply = send_and_close(rig.gateway.main, b"axis x jog 100\r\n");
    let reply = String::from_utf8_lossy(&reply);
    let started = reply.starts_with("ok");
    // It may just have begun when the end was seen; then it ends at once.
    assert!(started || reply.starts_with("error gone ") || reply.starts_with("error not-sent "), "{reply}");
    until("x stands", || !rig.turns());
    let status = Lines::connect(rig.gateway.main).ok("axis x status");
    assert_eq!(figure(&status, "jog_rpm"), 0, "{status}");
}

fn http(rig: &Rig, line: &str, body: &str) -> Reply {
    ask(rig.gateway.main, line, body)
}
