//! The same scenarios on two targets: the gateway of this machine in `cargo test`, and the firmware on an emulated board
//! in `cargo xtask test`, which names the image in the variable `PUENTE_IMAGE`. Both have a board's factory settings
//! and command simulated drives, whose line and state are looked at here.

mod common;

use std::io::{BufRead, BufReader, Read, Write};
use std::net::SocketAddr;
use std::thread;
use std::time::{Duration, Instant};

use common::client::{
    Lines, Modbus, closes_within, connect, mbap, read_pdu, rest, send_and_close, write_pdu,
};
use common::rig::{ENABLE, FORWARD, REVERSE, Rig};
use common::{Gateway, ms, until};

const STATUS: u16 = 0x0901;
const SPEED: u16 = 0x0025;
/// A PDU that the gateway answers by itself, with exception 01: there is no function 0.
const NO_FUNCTION: [u8; 2] = [0x00, 0x00];
const REFUSED: [u8; 2] = [0x80, 0x01];
/// Requests of one connection that a board takes at once.
const PIPELINE: u16 = 4;
/// Clients that the factory settings allow.
const CLIENTS: usize = 16;

fn on_board() -> bool {
    std::env::var_os("PUENTE_IMAGE").is_some()
}

#[test]
fn the_exchanges_of_the_thesis_are_on_the_wire_as_printed() {
    let rig = Rig::on_target();
    {
        let mut cell = rig.wire.device();
        let drive = cell.drive_mut(1).expect("drive 1");
        drive.force(0x1000, 0x0036);
        drive.force(STATUS, 0x0163);
    }
    let before = rig.wire.bytes().len();
    let mut client = Lines::connect(rig.gateway.main);
    let mut sent = String::new();
    for (request, reply) in [
        (":010310000001EB", ":0103020036C4"),
        (":010309010001F1", ":010302016396"),
        (":01060025006470", ":01060025006470"),
    ] {
        assert_eq!(client.ask(request), reply);
        sent = sent + request + "\r\n";
    }
    let bytes = rig.wire.bytes();
    assert_eq!(String::from_utf8_lossy(&bytes[before..]), sent);
    assert_eq!(rig.wire.device().drive(1).expect("drive 1").read(SPEED), Ok(100));
}

#[test]
fn a_client_that_closes_its_side_after_a_request_gets_the_answer() {
    let rig = Rig::on_target();
    let reply = send_and_close(rig.gateway.main, b":010309010001F1\r\n");
    assert_eq!(String::from_utf8_lossy(&reply), ":01030201A455\r\n");
}

#[test]
fn every_axis_is_enabled_jogged_and_stopped_from_the_console() {
    let rig = Rig::on_target();
    let mut client = Lines::connect(rig.gateway.main);
    assert_eq!(client.ask("axis"), "ok axes=x,y,z");
    for (name, unit) in [("x", 1), ("y", 2), ("z", 3)] {
        client.ok(&format!("axis {name} enable"));
        client.ok(&format!("axis {name} jog -120"));
        until("the motor turns at the speed asked for", || {
            client.ok(&format!("axis {name} status")).contains(" speed_rpm=-120 ")
        });
        let read = |register| rig.wire.device().drive(unit).expect("the drive").read(register);
        assert_eq!((read(ENABLE), read(FORWARD), read(REVERSE)), (Ok(1), Ok(0), Ok(1)));
        client.ok(&format!("axis {name} stop"));
        assert_eq!((read(FORWARD), read(REVERSE)), (Ok(0), Ok(0)));
        until("the motor stands", || client.ok(&format!("axis {name} status")).contains(" speed_rpm=0 "));
    }
}

#[test]
fn modbus_tcp_reads_and_writes_through_both_ports() {
    let rig = Rig::on_target();
    for (address, speed) in [(rig.gateway.main, 120), (rig.gateway.modbus, 130)] {
        let mut client = Modbus::connect(address);
        for unit in 1..=3 {
            assert_eq!(client.write(unit, SPEED, speed + u16::from(unit)), Ok(()));
        }
        for unit in 1..=3 {
            assert_eq!(client.read(unit, SPEED, 1), Ok(vec![speed + u16::from(unit)]));
        }
        assert_eq!(client.read(1, 0x5000, 1), Err(0x02), "the drive's own refusal");
        assert_eq!(client.ask(1, &NO_FUNCTION), REFUSED);
    }
}

#[test]
fn pipelined_requests_are_answered_each_with_its_own_value() {
    let rig = Rig::on_target();
    for unit in 1..=3 {
        let mut cell = rig.wire.device();
        cell.drive_mut(unit).expect("a drive").force(SPEED, u16::from(unit) * 1000);
    }
    for address in [rig.gateway.main, rig.gateway.modbus] {
        let mut stream = connect(address);
        for round in 0..3 {
            let unit = |number: u16| 1 + (number % 3) as u8;
            let numbers: Vec<u16> = (0..PIPELINE).map(|number| round * PIPELINE + number).collect();
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

/// Status, and what follows the head.
fn get(address: SocketAddr, path: &str) -> (String, String) {
    let mut stream = connect(address);
    let request = format!("GET {path} HTTP/1.1\r\nHost: gateway\r\nConnection: close\r\n\r\n");
    stream.write_all(request.as_bytes()).expect("sent");
    let reply = String::from_utf8(rest(&mut stream)).expect("text");
    let (head, body) = reply.split_once("\r\n\r\n").unwrap_or_else(|| panic!("no head: {reply}"));
    (head.lines().next().expect("a status line").to_owned(), body.to_owned())
}

#[test]
fn http_serves_the_page_and_an_axis() {
    let rig = Rig::on_target();
    for (path, file) in [
        ("/", include_str!("../src/front/http/page/index.html")),
        ("/panel.js", include_str!("../src/front/http/page/panel.js")),
        ("/panel.css", include_str!("../src/front/http/page/panel.css")),
    ] {
        let (status, body) = get(rig.gateway.main, path);
        assert!(status.ends_with("200 OK"), "{path}: {status}");
        assert!(body == file, "{path}: {} bytes, expected {}", body.len(), file.len());
    }
    let (status, body) = get(rig.gateway.main, "/api/axes/y");
    assert!(status.ends_with("200 OK"), "{status}");
    for part in ["\"name\":\"y\"", "\"address\":2", "\"online\":true", "\"speed_rpm\":0", "\"error\":null"] {
        assert!(body.contains(part), "{part} in {body}");
    }
    let (status, _) = get(rig.gateway.main, "/nothing");
    assert!(status.contains(" 404 "), "{status}");
}

#[test]
fn an_axis_whose_commander_says_nothing_is_stopped() {
    let rig = Rig::on_target();
    let (commander, confirmed) = rig.jogging();
    rig.stop_after(confirmed);
    assert_eq!(rig.event(), "lease-expired");
    let on = |register: u16| rig.wire.pdus(1).contains(&write_pdu(register, 1));
    assert!(on(FORWARD) && !on(REVERSE));
    drop(commander);
}

#[test]
fn an_axis_whose_commander_closes_is_stopped() {
    let rig = Rig::on_target();
    let (commander, confirmed) = rig.jogging();
    drop(commander);
    rig.stop_after(confirmed);
    // On a slow machine the lease may have been over before.
    assert!(["commander-disconnected", "lease-expired"].contains(&rig.event().as_str()));
}

#[test]
fn sixteen_are_served_at_once_and_the_next_may_stop_only() {
    let rig = Rig::on_target();
    let doors = [rig.gateway.main, rig.gateway.modbus];
    let mut clients = Vec::new();
    for number in 0..CLIENTS {
        let mut client = Modbus::connect(doors[number % doors.len()]);
        assert_eq!(client.ask(1, &NO_FUNCTION), REFUSED, "client {number}");
        clients.push(client);
    }
    for (number, client) in clients.iter_mut().enumerate() {
        assert!(client.read(1 + (number % 3) as u8, STATUS, 1).is_ok(), "client {number}");
    }
    until("one more is taken in", || answer(rig.gateway.main, "axis x status").starts_with("error full "));
    until("one more may stop", || answer(rig.gateway.main, "axis x stop").starts_with("ok "));
    drop(clients.pop());
    until("a place is free", || answer(rig.gateway.main, "axis x status").starts_with("ok "));
    // Nobody else has noticed.
    for client in &mut clients {
        assert_eq!(client.ask(1, &NO_FUNCTION), REFUSED);
    }
}

/// What a new client is answered; nothing where it is refused, as a board may while its last places are being cleared.
fn answer(address: SocketAddr, command: &str) -> String {
    let mut stream = connect(address);
    let mut line = String::new();
    let asked = stream.write_all(format!("{command}\r\n").as_bytes());
    let answered = asked.and_then(|()| BufReader::new(stream).read_line(&mut line));
    answered.map_or(String::new(), |_| line)
}

#[test]
fn malformed_modbus_tcp_disturbs_nobody_else() {
    let rig = Rig::on_target();
    let mut other = Modbus::connect(rig.gateway.modbus);
    for length in [0_u16, 1, 255, 0xFFFF] {
        let mut stream = connect(rig.gateway.modbus);
        let [high, low] = length.to_be_bytes();
        stream.write_all(&[0, 1, 0, 0, high, low, 1, 3, 9, 1, 0, 1]).expect("sent");
        assert!(closes_within(&mut stream, Duration::from_secs(20)), "length {length}");
        assert!(other.read(1, STATUS, 1).is_ok());
    }
    // Of another protocol: dropped, and the next one is answered.
    let mut stream = connect(rig.gateway.modbus);
    let foreign = [0, 1, 0, 7, 0, 6, 1, 3, 9, 1, 0, 1];
    stream.write_all(&[&foreign[..], &mbap(2, 1, &NO_FUNCTION)].concat()).expect("sent");
    assert_eq!(reply(&mut stream), mbap(2, 1, &REFUSED));
    // In pieces.
    for byte in mbap(3, 1, &read_pdu(STATUS, 1)) {
        stream.write_all(&[byte]).expect("sent");
        thread::sleep(ms(2));
    }
    assert_eq!(reply(&mut stream)[..8], [0, 3, 0, 0, 0, 5, 1, 3]);
    assert!(other.read(1, STATUS, 1).is_ok());
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
    let rig = Rig::on_target();
    let time = Duration::from_secs(if on_board() { 30 } else { 3 });
    let start = Instant::now();
    let visits: Vec<u32> = thread::scope(|scope| {
        let client = |(number, manner): (u8, Manner)| {
            let gateway = &rig.gateway;
            scope.spawn(move || {
                let mut visits = 0;
                while start.elapsed() < time {
                    match manner {
                        Manner::Modbus => visit(gateway.modbus, number, visits),
                        Manner::Http => assert_eq!(get(gateway.main, "/nothing").0, "HTTP/1.1 404 Not Found"),
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

/// The lamps of the emulated board, as its register has them: link, bus, fault.
fn lamps(gateway: &mut Gateway) -> [bool; 3] {
    let answer = gateway.monitor("xp /1xw 0x4002f004");
    let (_, word) = answer.trim_end().rsplit_once("0x").expect("a word");
    let leds = u32::from_str_radix(word, 16).expect("a number");
    [leds & 1 != 0, leds & 2 != 0, leds & 4 != 0]
}

#[test]
fn the_lamps_of_a_board_show_its_link_its_bus_and_a_missing_slave() {
    if !on_board() {
        return;
    }
    let mut rig = Rig::on_target();
    let gateway = &mut rig.gateway;
    until("the link lamp is on, alone", || lamps(gateway) == [true, false, false]);
    let mut client = Modbus::connect(gateway.main);
    until("the bus lamp shows a transaction", || {
        client.ask(1, &read_pdu(STATUS, 1));
        lamps(gateway) == [true, true, false]
    });
    until("the bus lamp goes out", || lamps(gateway) == [true, false, false]);
    client.ask(9, &read_pdu(STATUS, 1));
    for on in [true, false, true] {
        until("the fault lamp blinks for a slave that is not there", || lamps(gateway)[2] == on);
    }
    gateway.monitor("set_link lan9118.0 off");
    until("the link lamp goes out", || !lamps(gateway)[0]);
    gateway.monitor("set_link lan9118.0 on");
    until("the link lamp is on again", || lamps(gateway)[0]);
}
