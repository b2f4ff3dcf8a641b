//! Connections as programs use them: many requests at once, or each request on a connection of its own.

mod common;

use std::io::{Read, Write};
use std::net::SocketAddr;
use std::thread;
use std::time::Instant;

use common::client::{Lines, Modbus, connect, mbap, read_pdu, rest};
use common::http::{Reply, request};
use common::rig::Rig;
use common::wire::cell;
use common::{target, thesis};
use puente_modbus::Mode;

const STATUS: u16 = 0x0901;
const SPEED: u16 = 0x0025;
/// A PDU that the gateway answers by itself, with exception 01: there is no function 0.
const NO_FUNCTION: [u8; 2] = [0x00, 0x00];
const REFUSED: [u8; 2] = [0x80, 0x01];

#[test]
fn pipelined_requests_are_answered_each_with_its_own_value() {
    let rig = Rig::new(Mode::Ascii, 250);
    let pipeline = target().pipeline as u16;
    for unit in 1..=3 {
        let mut cell = rig.wire.device();
        cell.drive_mut(unit).expect("a drive").force(SPEED, u16::from(unit) * 1000);
    }
    for address in [rig.gateway.main, rig.gateway.modbus] {
        let mut stream = connect(address);
        for round in 0..3 {
            let unit = |number: u16| 1 + (number % 3) as u8;
            let numbers: Vec<u16> = (0..pipeline).map(|number| round * pipeline + number).collect();
            // All in one piece.
            let frame = |number: &u16| mbap(*number, unit(*number), &read_pdu(SPEED, 1));
            stream.write_all(&numbers.iter().flat_map(frame).collect::<Vec<_>>()).expect("sent");
            let mut replies: Vec<_> = numbers.iter().map(|_| reply(&mut stream)).collect();
            replies.sort();
            let value = |number: u16| (u16::from(unit(number)) * 1000).to_be_bytes();
            let expected =
                |number: &u16| mbap(*number, unit(*number), &[&[3, 2][..], &value(*number)].concat());
            assert_eq!(replies, numbers.iter().map(expected).collect::<Vec<_>>());
        }
    }
}

/// The next Modbus/TCP frame, all of it.
fn reply(stream: &mut impl Read) -> Vec<u8> {
    let mut frame = vec![0; 6];
    stream.read_exact(&mut frame).expect("a reply");
    let length = usize::from(u16::from_be_bytes([frame[4], frame[5]]));
    assert!((3..=254).contains(&length), "{frame:02X?}");
    frame.resize(6 + length, 0);
    stream.read_exact(&mut frame[6..]).expect("a reply");
    frame
}

/// A program that waits for the reply and for its end.
fn get(address: SocketAddr, path: &str) -> Reply {
    let mut stream = connect(address);
    stream.write_all(request(&format!("GET {path}"), "").as_bytes()).expect("sent");
    Reply::of(&rest(&mut stream))
}

/// How a client uses a connection that it makes for one request.
#[derive(Clone, Copy)]
enum Manner {
    Modbus,
    Http,
    Console,
}

/// A connection for each request, as many programs do. None is refused, reset, or answered wrong.
fn eight_reconnect(manners: [Manner; 8]) {
    let wire = cell(Mode::Ascii, thesis(), &[1, 2, 3]);
    // The host takes clients from its backlog before it learns that others have gone, and counts both for a moment.
    let clients = format!("clients = {}", target().clients);
    let gateway = &Rig::document(Mode::Ascii, 250, &wire, "reply_timeout_ms = 3000").net(&clients).start();
    let time = target().reconnecting;
    let start = Instant::now();
    let visits: Vec<u32> = thread::scope(|scope| {
        let client = |(number, manner): (u8, Manner)| {
            scope.spawn(move || {
                let mut visits = 0;
                while start.elapsed() < time {
                    match manner {
                        Manner::Modbus => visit(gateway.modbus, number, visits),
                        Manner::Http => assert_eq!(get(gateway.main, "/nothing").error().0, 404),
                        Manner::Console => assert_eq!(Lines::connect(gateway.main).ask("feed"), "ok"),
                    }
                    visits += 1;
                }
                visits
            })
        };
        let clients: Vec<_> = (0..).zip(manners).map(client).collect();
        clients.into_iter().map(|client| client.join().expect("no refusal")).collect()
    });
    println!("visits of each client in {time:?}: {visits:?}");
    assert!(visits.iter().all(|visits| *visits > 0));
}

fn visit(address: SocketAddr, client: u8, visit: u32) {
    let unit = 1 + client % 3;
    let mut modbus = Modbus::connect(address);
    // The line is slow: most requests are answered without it.
    if visit % 16 == u32::from(client) {
        let read = modbus.read(unit, STATUS, 1);
        assert!(read.is_ok(), "client {client}, visit {visit}: {read:?}");
    } else {
        assert_eq!(modbus.ask(unit, &NO_FUNCTION), REFUSED, "client {client}, visit {visit}");
    }
}

#[test]
fn eight_clients_that_always_reconnect_are_never_refused_at_the_modbus_port() {
    eight_reconnect([Manner::Modbus; 8]);
}

#[test]
fn eight_clients_that_always_reconnect_are_never_refused_at_the_main_port() {
    use Manner::{Console, Http};
    eight_reconnect([Http, Console, Http, Console, Http, Console, Http, Console]);
}

#[test]
fn eight_clients_that_always_reconnect_are_never_refused_at_both_ports() {
    use Manner::{Console, Http, Modbus};
    eight_reconnect([Modbus, Http, Modbus, Console, Modbus, Http, Modbus, Console]);
}
