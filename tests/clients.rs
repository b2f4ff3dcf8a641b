//! Sixteen clients at once, a place for those who come to stop an axis, and nobody stays for ever.

mod common;

use std::io::Write;
use std::net::{SocketAddr, TcpStream};
use std::thread;
use std::time::{Duration, Instant};

use common::client::{Lines, Modbus, connect, mbap, read_pdu, rest, visit, write_pdu};
use common::http::insist;
use common::rig::{FORWARD, Rig};
use common::{Document, fast, ms, until, wire};
use puente_modbus::Mode;

const CLIENTS: usize = 16;

/// As many consoles as may be served at once, the first of them jogging x.
fn full_house(rig: &Rig) -> (Lines, Vec<Lines>) {
    let (commander, _) = rig.jogging();
    let other = |_| {
        let mut client = Lines::connect(rig.gateway.main);
        client.ok("feed");
        client
    };
    (commander, (1..CLIENTS).map(other).collect())
}

fn say(address: SocketAddr, command: &str) -> String {
    String::from_utf8(visit(address, format!("{command}\r\n").as_bytes())).expect("text")
}

/// The HTTP status of a request.
fn status(address: SocketAddr, line: &str) -> u16 {
    insist(address, line, "").status
}

#[test]
fn sixteen_clients_are_served_and_the_seventeenth_may_stop_and_no_more() {
    let rig = Rig::new(Mode::Ascii, 5000);
    let (mut commander, mut others) = full_house(&rig);
    let seventeenth = |command| say(rig.gateway.main, command);
    for command in ["axis x status", "feed", "axis x jog 10", "axis y enable", "help", "bus a scan 1-3"] {
        assert!(seventeenth(command).starts_with("error full "), "{command}");
        commander.ok("feed");
    }
    for port in [rig.gateway.main, rig.gateway.modbus] {
        assert_eq!(visit(port, &mbap(1, 1, &read_pdu(FORWARD, 1))), mbap(1, 1, &[0x83, 6]));
        // Who comes to the other door of a board may have to wait for a place there.
        commander.ok("feed");
        assert_eq!(visit(port, &mbap(2, 2, &write_pdu(FORWARD, 1))), mbap(2, 2, &[0x86, 6]));
        commander.ok("feed");
    }
    assert_eq!(status(rig.gateway.main, "GET /api/axes"), 503);
    commander.ok("feed");
    assert!(rig.turns());

    assert!(seventeenth("axis x stop").starts_with("ok "));
    until("x stands", || !rig.turns());
    assert!(others.iter_mut().all(|client| client.ask("feed") == "ok"), "nobody was put out for it");

    // A place becomes free, and the next one is served in full.
    drop(others.pop());
    until("a place is free", || seventeenth("feed") == "ok\r\n");
    commander.ok("feed");
}

#[test]
fn the_seventeenth_may_stop_in_every_dialect() {
    let off = write_pdu(FORWARD, 0);
    let stops: [&dyn Fn(SocketAddr, SocketAddr); 4] = [
        &|main, _| assert!(say(main, "axis x disable").starts_with("ok ")),
        &|main, _| assert_eq!(say(main, ":010610240000C5"), ":010610240000C5\r\n"),
        &|_, modbus| assert_eq!(visit(modbus, &mbap(1, 1, &off)), mbap(1, 1, &off)),
        &|main, _| assert_eq!(status(main, "POST /api/axes/x/stop"), 200),
    ];
    for stop in stops {
        let rig = Rig::new(Mode::Rtu, 5000);
        let (_commander, _others) = full_house(&rig);
        assert!(rig.turns());
        stop(rig.gateway.main, rig.gateway.modbus);
        until("x stands", || !rig.turns());
    }
}

/// Connections beyond the limit that say nothing are let go soon, so that the next one can stop.
#[test]
fn a_crowd_at_the_door_does_not_keep_a_stop_out_for_long() {
    let rig = Rig::new(Mode::Rtu, 5000);
    let (mut commander, _others) = full_house(&rig);
    let crowd: Vec<TcpStream> = (0..6).map(|_| connect(rig.gateway.main)).collect();
    let start = Instant::now();
    thread::scope(|scope| {
        let stopper = scope.spawn(|| assert!(say(rig.gateway.main, "axis x stop").starts_with("ok ")));
        while !stopper.is_finished() {
            commander.ok("feed");
            thread::sleep(ms(100));
        }
    });
    let waited = start.elapsed();
    println!("a stop behind six silent visitors: {waited:?}");
    assert!(waited < Duration::from_secs(8), "{waited:?}");
    assert!(!rig.turns());
    drop(crowd);
}

#[test]
fn who_says_nothing_is_let_go_and_who_speaks_stays() {
    let wire = wire::cell(Mode::Rtu, fast(), &[1]);
    let gateway = Document::new().net("idle_s = 5").bus("a", Mode::Rtu, fast(), &wire, "").start();
    let silent = |port, first: &'static [u8]| {
        move || {
            let mut stream = connect(port);
            stream.write_all(first).expect("sent");
            let start = Instant::now();
            // An HTTP request that does not come to its end is told so first; the others are just let go.
            let last_words = rest(&mut stream);
            let expected: &[u8] = if first.starts_with(b"GET") { b"HTTP/1.1 408 " } else { b"" };
            assert!(last_words.starts_with(expected), "{}", last_words.escape_ascii());
            start.elapsed()
        }
    };
    thread::scope(|scope| {
        let visitors = [
            scope.spawn(silent(gateway.main, b"")),
            scope.spawn(silent(gateway.main, b"ax")),
            scope.spawn(silent(gateway.main, b"axis")),
            scope.spawn(silent(gateway.main, b":01030901")),
            scope.spawn(silent(gateway.main, &[0, 1, 0, 0, 0, 6])),
            scope.spawn(silent(gateway.main, b"GET / HTTP/1.1\r\n")),
            scope.spawn(silent(gateway.modbus, b"")),
            scope.spawn(silent(gateway.modbus, &[0, 1])),
        ];
        let talker = scope.spawn(|| {
            let (mut lines, mut modbus) = (Lines::connect(gateway.main), Modbus::connect(gateway.modbus));
            for _ in 0..6 {
                lines.ok("feed");
                assert_eq!(modbus.read(9, 0, 1), Err(0x0B));
                thread::sleep(ms(2000));
            }
        });
        for visitor in visitors {
            let stayed = visitor.join().expect("let go");
            assert!((ms(4000)..ms(16_000)).contains(&stayed), "{stayed:?}");
        }
        talker.join().expect("served all the time");
    });
}
