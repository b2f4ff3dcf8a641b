//! Malformed input on every dialect but HTTP (see tests/http): its own error, and nobody else is disturbed.

mod common;

use std::io::{Read, Write};
use std::net::{Shutdown, SocketAddr, TcpStream};
use std::thread;

use common::client::{
    Lines, Modbus, Poller, closes_within, connect, mbap, read_pdu, rest, send_and_close, write_pdu,
};
use common::wire::{Wire, cell};
use common::{Document, Gateway, fast, ms, target};
use puente_cell::Cell;
use puente_modbus::{Mode, ascii};

const STATUS: u16 = 0x0901;
const VALUE: u16 = 0x0163;
/// Polled by another client all the time.
const POLLED: u8 = 3;

/// A gateway whose units 1 to 3 answer, and another client that must not notice anything.
struct Rig {
    wire: Wire<Cell>,
    gateway: Gateway,
    poller: Option<Poller>,
}

impl Rig {
    fn new() -> Self {
        let wire = cell(Mode::Rtu, fast(), &[1, 2, 3]);
        for unit in 1..=3 {
            wire.device().drive_mut(unit).expect("a drive").force(STATUS, VALUE);
        }
        let document = Document::new().bus("a", Mode::Rtu, fast(), &wire, "units = \"1-3\"");
        let gateway = document.axis("x", "a", 1, "").start();
        let poller = Some(Poller::start(gateway.main, POLLED, STATUS, VALUE));
        Self { wire, gateway, poller }
    }

    /// The port of every dialect, and that of Modbus/TCP alone.
    fn ports(&self) -> [SocketAddr; 2] {
        [self.gateway.main, self.gateway.modbus]
    }

    /// What others sent to units 1 and 2.
    fn sent(&self) -> usize {
        self.wire.requests().iter().filter(|request| request.unit != POLLED).count()
    }

    /// The gateway serves new clients, and has served the other one all the time.
    fn end(mut self) {
        for port in self.ports() {
            assert_eq!(Modbus::connect(port).read(1, STATUS, 1), Ok(vec![VALUE]));
        }
        Lines::connect(self.gateway.main).ok("axis x status");
        assert!(self.poller.take().expect("it runs").end() > 0);
    }
}

fn good(transaction: u16) -> Vec<u8> {
    mbap(transaction, 1, &read_pdu(STATUS, 1))
}

fn good_reply(transaction: u16) -> Vec<u8> {
    let [high, low] = VALUE.to_be_bytes();
    mbap(transaction, 1, &[3, 2, high, low])
}

#[test]
fn an_mbap_length_that_cannot_be_ends_the_connection() {
    let rig = Rig::new();
    for port in rig.ports() {
        for length in [0_u16, 1, 255, 300, 0xFFFF] {
            let mut stream = connect(port);
            stream.write_all(&good(1)).expect("sent");
            let mut reply = vec![0; good_reply(1).len()];
            stream.read_exact(&mut reply).expect("a reply");
            assert_eq!(reply, good_reply(1));
            let header = [&[0, 2, 0, 0][..], &length.to_be_bytes(), &[1]].concat();
            stream.write_all(&header).expect("sent");
            assert!(closes_within(&mut stream, ms(3000)), "length {length}");
            // The same as the very first bytes.
            let mut stream = connect(port);
            stream.write_all(&header).expect("sent");
            assert!(closes_within(&mut stream, ms(3000)), "length {length} first");
        }
    }
    assert_eq!(rig.sent(), 10);
    rig.end();
}

#[test]
fn an_mbap_frame_cut_short_has_no_reply() {
    let rig = Rig::new();
    for port in rig.ports() {
        for count in 4..good(1).len() {
            assert_eq!(send_and_close(port, &good(1)[..count]), b"", "{count} bytes");
        }
    }
    assert_eq!(rig.sent(), 0);
    rig.end();
}

#[test]
fn a_frame_of_another_protocol_is_skipped() {
    let rig = Rig::new();
    for port in rig.ports() {
        for length in [0_usize, 1, 6, 300, 3000] {
            let foreign = [&[0, 9, 0, 1][..], &(length as u16).to_be_bytes(), &vec![0xA5; length]].concat();
            let reply = send_and_close(port, &[good(1), foreign, good(2)].concat());
            assert_eq!(reply, [good_reply(1), good_reply(2)].concat(), "{length} bytes");
        }
    }
    // What begins like this on the port of every dialect is none.
    let reply = send_and_close(rig.gateway.main, &[&[0, 9, 0, 1, 0, 6][..], &good(1)].concat());
    assert!(reply.starts_with(b"error unknown-dialect "), "{}", reply.escape_ascii());
    rig.end();
}

/// Request PDU and exception code.
const REFUSED: [(&[u8], u8); 16] = [
    (&[0x80], 1),
    (&[0x83, 0, 0], 1),
    (&[0xFF], 1),
    (&[0], 1),
    (&[3], 3),
    (&[3, 9, 1, 0], 3),
    (&[3, 9, 1, 0, 0], 3),
    (&[3, 9, 1, 0, 126], 3),
    (&[3, 9, 1, 0xFF, 0xFF], 3),
    (&[3, 9, 1, 0, 1, 0], 3),
    (&[5, 0, 1, 0, 1], 3),
    (&[6, 0, 0x25, 0], 3),
    (&[0x10, 0, 0x25, 0, 0, 0], 3),
    (&[0x10, 0, 0x25, 0, 2, 4, 0, 1], 3),
    (&[0x10, 0, 0x25, 0, 1, 4, 0, 1, 0, 1], 3),
    (&[1, 0, 0, 0x07, 0xD1], 3),
];

#[test]
fn a_malformed_request_is_refused_unsent_and_the_connection_stays_usable() {
    let rig = Rig::new();
    for port in rig.ports() {
        let mut client = Modbus::connect(port);
        for (pdu, code) in REFUSED {
            assert_eq!(client.ask(1, pdu), [pdu[0] | 0x80, code], "{pdu:02X?}");
        }
        for unit in [4, 247, 248, 255] {
            assert_eq!(client.read(unit, STATUS, 1), Err(0x0A), "no bus serves unit {unit}");
        }
        assert_eq!(client.ask(0, &read_pdu(STATUS, 1)), [0x83, 1], "nobody answers a reading by all");
        assert_eq!(rig.sent(), 0, "nothing of this was on the wire");
    }
    let mut lines = Lines::connect(rig.gateway.main);
    for (pdu, code) in REFUSED {
        let reply = ascii::emit(1, &[pdu[0] | 0x80, code]);
        let request = ascii::emit(1, pdu);
        let ask = |bytes: &[u8]| String::from_utf8(bytes.to_vec()).expect("text").trim_end().to_owned();
        assert_eq!(lines.ask(&ask(&request)), ask(&reply), "{pdu:02X?}");
    }
    assert_eq!(rig.sent(), 0, "nothing of this was on the wire");
    rig.end();
}

#[test]
fn a_line_that_is_no_frame_has_its_own_error_and_the_next_one_is_served() {
    let rig = Rig::new();
    let mut client = Lines::connect(rig.gateway.main);
    for (line, code) in [
        (":010309010001F2", "bad-lrc"),
        (":010309010001F", "odd-digits"),
        (":01030901000xF1", "not-hex"),
        (":01 0309010001F1", "not-hex"),
        (":010309:010001F1", "not-hex"),
        (":01030901\u{e9}", "not-hex"),
        (":", "too-short"),
        (":01", "too-short"),
        (":01FF", "too-short"),
        ("=081,1,2X", "frame-data"),
        (":081,2,00", "frame-data"),
        (":081,0", "unknown-bus"),
        ("axis x jog", "usage"),
        ("axis x jog 1e3", "number"),
        ("axis x set Pn037 65536", "number"),
        ("axis x get Pn", "parameter"),
        ("axis x get Pn9999999999", "parameter"),
        ("axis x y z 1 2 3", "usage"),
        ("axis w status", "unknown-axis"),
        ("bus w status", "unknown-bus"),
        ("bus a scan 0-3", "number"),
        ("bus a scan 3-1", "number"),
        ("bus a scan 1-248", "number"),
        ("axis x status\0", "text"),
        ("\0\0\0\0", "text"),
        ("\u{e9}t\u{e9}", "text"),
        ("\x1B[A", "text"),
    ] {
        client.error(line, code);
        assert_eq!(client.ask("feed"), "ok", "after {line:?}");
    }
    assert_eq!(client.ask("[1] 4 read 0x1017 0 i16"), "[1] ERROR:104 #No default net set.");
    assert_eq!(client.ask("4 read 0x1017 0 i16"), "[0] ERROR:101 #Syntax error.");
    assert_eq!(client.ask("feed"), "ok");
    let frame = format!(":{}", "00".repeat(256));
    client.error(&frame, "too-long");
    client.error(&"a".repeat(514), "too-long");
    assert!(client.ask(&"a".repeat(513)).starts_with("error unknown-command "));
    // Empty lines have no answer.
    client.send("\r\n\n  \r\n\t");
    assert_eq!(client.ask(":010309010001F1"), ":010302016396");
    assert_eq!(rig.sent(), 1);
    rig.end();
}

#[test]
fn a_line_of_10_kb_has_one_error_and_the_next_one_is_served() {
    let rig = Rig::new();
    for (first, length) in [("a", 10_000), (":", 10_000), ("axis x jog ", 10_000), ("a", 200_000)] {
        let text = format!("{first}{}\r\nfeed\r\n", "1".repeat(length));
        let reply = String::from_utf8(send_and_close(rig.gateway.main, text.as_bytes())).expect("text");
        let lines: Vec<&str> = reply.lines().collect();
        let [error, "ok"] = lines.as_slice() else { panic!("{length}: {reply}") };
        assert!(error.starts_with("error too-long "), "{error}");
    }
    rig.end();
}

/// `printf ... | nc`: the client closes its side at once.
#[test]
fn a_client_that_closes_its_side_gets_all_its_replies() {
    let rig = Rig::new();
    let pipeline = target().pipeline as u16;
    let frames = (1..=pipeline).flat_map(good).collect::<Vec<u8>>();
    let replies = (1..=pipeline).flat_map(good_reply).collect::<Vec<u8>>();
    for port in rig.ports() {
        assert_eq!(send_and_close(port, &frames), replies);
    }
    let lines = b":010309010001F1\r\nfeed\naxis\n:010309010001F1";
    let reply = send_and_close(rig.gateway.main, lines);
    assert_eq!(
        String::from_utf8_lossy(&reply),
        ":010302016396\r\nok\r\nok axes=x\r\n:010302016396\r\n",
        "also to a last line without an end"
    );
    rig.end();
}

#[test]
fn a_client_that_sends_byte_by_byte_is_served() {
    let rig = Rig::new();
    let mut slow = vec![(rig.gateway.main, b"axis\r\n".to_vec(), b"ok axes=x\r\n".to_vec())];
    for port in rig.ports() {
        slow.push((port, good(0x4745), good_reply(0x4745)));
        // Looks like the start of "GET " and of ":01", but is neither.
        slow.push((port, good(0x3A30), good_reply(0x3A30)));
    }
    slow.push((rig.gateway.main, b":010309010001F1\r\n".to_vec(), b":010302016396\r\n".to_vec()));
    thread::scope(|scope| {
        for (port, bytes, expected) in slow {
            scope.spawn(move || {
                let mut stream = connect(port);
                for byte in bytes {
                    stream.write_all(&[byte]).expect("sent");
                    thread::sleep(ms(10));
                }
                let mut reply = vec![0; expected.len()];
                stream.read_exact(&mut reply).expect("a reply");
                assert_eq!(reply, expected);
            });
        }
    });
    rig.end();
}

#[test]
fn a_client_that_takes_no_replies_is_dropped_and_holds_nobody_up() {
    let rig = Rig::new();
    let greedy = |port: SocketAddr, request: Vec<u8>| {
        let mut stream = connect(port);
        let many = request.repeat(1000);
        // Until the gateway does not take any more, or drops the connection.
        while stream.write_all(&many).is_ok() {}
        let mut sent_back = Vec::new();
        let _ = stream.read_to_end(&mut sent_back);
    };
    thread::scope(|scope| {
        scope.spawn(|| greedy(rig.gateway.main, b"help\r\n".to_vec()));
        scope.spawn(|| greedy(rig.gateway.modbus, mbap(1, 9, &read_pdu(0, 1))));
    });
    let log = rig.gateway.log();
    assert_eq!(log.matches("dropped, takes no replies").count(), 2, "{log}");
    rig.end();
}

/// SplitMix64, as reproducible noise.
struct Noise(u64);

impl Noise {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mixed = (self.0 ^ self.0 >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let mixed = (mixed ^ mixed >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
        mixed ^ mixed >> 31
    }

    fn bytes(&mut self, most: u64) -> Vec<u8> {
        (0..self.next() % (most + 1)).map(|_| self.next() as u8).collect()
    }
}

#[test]
fn random_bytes_on_both_ports_are_survived() {
    let rig = Rig::new();
    let heads: [&[u8]; 8] = [
        b"",
        b":",
        b":0103",
        b"axis x ",
        b"GET /api/axes HTTP/1.1\r\n",
        b"POST /api/axes/x/jog HTTP/1.1\r\nContent-Length: 20\r\n\r\n",
        &[0, 1, 0, 0, 0, 6, 2, 3],
        &[0, 1, 0, 0, 0, 20, 2],
    ];
    let mut noise = Noise(7);
    for round in 0..400 {
        let head = heads[round % heads.len()];
        let bytes = [head, &noise.bytes(600)].concat();
        let mut stream: TcpStream = connect(rig.ports()[round / heads.len() % 2]);
        // The gateway may have dropped the connection before all was sent.
        let _ = stream.write_all(&bytes);
        let _ = stream.shutdown(Shutdown::Write);
        rest(&mut stream);
    }
    // Whatever of this were good frames: none may have left a drive under a command that nobody answers for.
    drop(Modbus::connect(rig.gateway.main).ask(1, &write_pdu(0x1023, 0)));
    rig.end();
}
