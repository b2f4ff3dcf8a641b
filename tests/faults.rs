//! Faults on the line: never a wrong value to a client, and the next request to a healthy unit is answered.
//!
//! Each register's value tells its unit and address, so that a value of another request or unit cannot pass.

mod common;

use std::thread;
use std::time::{Duration, Instant};

use common::client::Modbus;
use common::wire::{Chunk, Script, Wire, frame, healthy, script, values};
use common::{Document, Gateway, MODES, fast, ms, thesis, until};
use puente_modbus::Mode;

/// The unit whose answers go wrong, and one whose answers do not.
const FAULTY: u8 = 1;
const HEALTHY: u8 = 2;
/// Readings of this register go wrong.
const SPOILT: u16 = 0x0100;
const REPLY_TIMEOUT: Duration = Duration::from_millis(500);
/// No usable reply: exception 0B.
const NO_REPLY: Result<Vec<u16>, u8> = Err(0x0B);

struct Rig {
    wire: Wire<Script>,
    gateway: Gateway,
    client: Modbus,
}

/// What a faulty slave makes of its right reply: unit and PDU of the request, PDU of the reply.
type Spoil = fn(Mode, &[u8], &[u8]) -> Vec<Chunk>;

impl Rig {
    fn new(mode: Mode, spoil: Spoil, more: &str) -> Self {
        let wire = script(mode, fast(), move |unit, request| {
            let reply = healthy(unit, request);
            match *request {
                [3 | 6, 0x01, 0x00, ..] if unit == FAULTY => spoil(mode, request, &reply),
                _ => vec![(Duration::ZERO, frame(mode, unit, &reply))],
            }
        });
        let more = format!("reply_timeout_ms = {}\n{more}", REPLY_TIMEOUT.as_millis());
        let gateway = Document::new().bus("a", mode, fast(), &wire, &more).start();
        let client = Modbus::connect(gateway.modbus);
        let mut rig = Self { wire, gateway, client };
        rig.all_is_well();
        rig
    }

    /// Both units answer right, each twice in turn.
    fn all_is_well(&mut self) {
        for address in [0x0200, 0x0300] {
            for unit in [HEALTHY, FAULTY] {
                assert_eq!(self.client.read(unit, address, 2), Ok(values(unit, address, 2)));
            }
        }
    }

    fn spoilt(&mut self) -> Result<Vec<u16>, u8> {
        self.client.read(FAULTY, SPOILT, 2)
    }
}

/// The spoilt reading ends as `expected`, a healthy unit is answered right after it, and then the faulty one; on both
/// kinds of line at a time.
fn holds(spoil: Spoil, more: &str, expected: fn() -> Result<Vec<u16>, u8>) {
    thread::scope(|scope| {
        for mode in MODES {
            scope.spawn(move || {
                let mut rig = Rig::new(mode, spoil, &format!("quarantine_ms = 20\n{more}"));
                for _ in 0..2 {
                    assert_eq!(rig.spoilt(), expected(), "{mode:?}");
                    rig.all_is_well();
                }
                let spoilt = |pdu: &&Vec<u8>| pdu[1..3] == SPOILT.to_be_bytes();
                let sent = rig.wire.pdus(FAULTY).iter().filter(spoilt).count();
                assert_eq!(sent, 2, "{mode:?}: each request is on the wire once");
            });
        }
    });
}

fn right() -> Result<Vec<u16>, u8> {
    Ok(values(FAULTY, SPOILT, 2))
}

fn at_once(bytes: Vec<u8>) -> Vec<Chunk> {
    vec![(Duration::ZERO, bytes)]
}

#[test]
fn silent() {
    holds(|_, _, _| Vec::new(), "", || NO_REPLY);
}

#[test]
fn corrupt() {
    fn spoil(mode: Mode, _: &[u8], reply: &[u8]) -> Vec<Chunk> {
        let mut bytes = frame(mode, FAULTY, reply);
        // A digit of the first value, in either framing.
        let at = bytes.len() / 2;
        bytes[at] = if bytes[at] == b'0' { b'1' } else { b'0' };
        at_once(bytes)
    }
    holds(spoil, "", || NO_REPLY);
}

#[test]
fn truncated_anywhere() {
    for keep in [1, 2, 4, 6] {
        // The closure must be a plain function: one for each length.
        let spoil: Spoil = match keep {
            1 => |mode, _, reply| at_once(frame(mode, FAULTY, reply)[..1].to_vec()),
            2 => |mode, _, reply| at_once(frame(mode, FAULTY, reply)[..2].to_vec()),
            4 => |mode, _, reply| at_once(frame(mode, FAULTY, reply)[..4].to_vec()),
            _ => |mode, _, reply| {
                let bytes = frame(mode, FAULTY, reply);
                at_once(bytes[..bytes.len() - 1].to_vec())
            },
        };
        holds(spoil, "", || NO_REPLY);
    }
}

#[test]
fn wrong_unit() {
    holds(|mode, _, reply| at_once(frame(mode, HEALTHY, reply)), "", || NO_REPLY);
}

#[test]
fn wrong_function() {
    fn spoil(mode: Mode, _: &[u8], reply: &[u8]) -> Vec<Chunk> {
        at_once(frame(mode, FAULTY, &[&[4], &reply[1..]].concat()))
    }
    holds(spoil, "", || NO_REPLY);
}

#[test]
fn wrong_byte_count() {
    // A count that does not fit the frame, and a whole frame with one register more or less than asked.
    fn too_high(mode: Mode, _: &[u8], reply: &[u8]) -> Vec<Chunk> {
        at_once(frame(mode, FAULTY, &[&[3, 6], &reply[2..]].concat()))
    }
    fn too_low(mode: Mode, _: &[u8], reply: &[u8]) -> Vec<Chunk> {
        at_once(frame(mode, FAULTY, &[&[3, 2], &reply[2..]].concat()))
    }
    fn more(mode: Mode, _: &[u8], reply: &[u8]) -> Vec<Chunk> {
        at_once(frame(mode, FAULTY, &[&[3, 6], &reply[2..], &[0, 0]].concat()))
    }
    fn fewer(mode: Mode, _: &[u8], reply: &[u8]) -> Vec<Chunk> {
        at_once(frame(mode, FAULTY, &[&[3, 2], &reply[2..4]].concat()))
    }
    for spoil in [too_high, too_low, more, fewer] {
        holds(spoil, "", || NO_REPLY);
    }
}

#[test]
fn a_frame_of_another_unit_before_the_reply() {
    fn spoil(mode: Mode, request: &[u8], reply: &[u8]) -> Vec<Chunk> {
        let foreign = frame(mode, HEALTHY, &healthy(HEALTHY, request));
        vec![(Duration::ZERO, foreign), (ms(10), frame(mode, FAULTY, reply))]
    }
    holds(spoil, "", right);
}

#[test]
fn garbage_before_the_reply() {
    fn spoil(mode: Mode, _: &[u8], reply: &[u8]) -> Vec<Chunk> {
        // Looks like the start of a reply of the right unit and function with many registers.
        let noise = [&[0x00, 0xFF][..], &[FAULTY, 3, 200, 1, 2], b":0103"].concat();
        at_once([noise, frame(mode, FAULTY, reply)].concat())
    }
    holds(spoil, "", right);
}

#[test]
fn garbage_after_the_reply() {
    fn spoil(mode: Mode, _: &[u8], reply: &[u8]) -> Vec<Chunk> {
        let mut chunks = at_once([&frame(mode, FAULTY, reply)[..], &[0x00, 0xFF, FAULTY, 3]].concat());
        chunks.push((ms(1), b"\x03\x04:0203".to_vec()));
        chunks
    }
    holds(spoil, "", right);
}

#[test]
fn a_duplicate_reply() {
    fn together(mode: Mode, _: &[u8], reply: &[u8]) -> Vec<Chunk> {
        at_once([frame(mode, FAULTY, reply), frame(mode, FAULTY, reply)].concat())
    }
    fn apart(mode: Mode, _: &[u8], reply: &[u8]) -> Vec<Chunk> {
        vec![(Duration::ZERO, frame(mode, FAULTY, reply)), (ms(4), frame(mode, FAULTY, reply))]
    }
    holds(together, "", right);
    // Where a slave is known to repeat itself after a while, only its rest tells the second reply from the next one.
    holds(apart, "rest_ms = 50", right);
}

fn echoed(mode: Mode, request: &[u8], reply: &[u8]) -> Vec<Chunk> {
    vec![(Duration::ZERO, frame(mode, FAULTY, request)), (ms(10), frame(mode, FAULTY, reply))]
}

#[test]
fn an_echo_where_none_is_expected_is_never_taken_for_the_reply() {
    fn alone(mode: Mode, request: &[u8], _: &[u8]) -> Vec<Chunk> {
        at_once(frame(mode, FAULTY, request))
    }
    holds(alone, "", || NO_REPLY);
    holds(echoed, "", right);
}

/// A line that echoes all that is sent on it, as two wires with the receiver left on do.
fn echoing_line(mode: Mode, echo: fn(Vec<u8>) -> Vec<u8>) -> Wire<Script> {
    script(mode, fast(), move |unit, request| {
        let mut chunks = vec![(Duration::ZERO, echo(frame(mode, unit, request)))];
        if unit != 9 {
            chunks.push((ms(5), frame(mode, unit, &healthy(unit, request))));
        }
        chunks
    })
}

#[test]
fn an_echoing_line_is_served_with_strip_and_with_verify() {
    for mode in MODES {
        for setting in ["echo = \"strip\"", "echo = \"verify\""] {
            let wire = echoing_line(mode, |request| request);
            let more = format!("reply_timeout_ms = 500\n{setting}");
            let gateway = Document::new().bus("a", mode, fast(), &wire, &more).start();
            let mut client = Modbus::connect(gateway.main);
            for address in [1, 2, 3] {
                assert_eq!(client.read(FAULTY, address, 2), Ok(values(FAULTY, address, 2)), "{setting}");
                assert_eq!(client.write(HEALTHY, address, 7), Ok(()), "{setting}");
            }
            // Nobody is there: the echo of a writing, which looks like its reply, is not taken for it.
            assert_eq!(client.write(9, 1, 7), Err(0x0B), "{mode:?} {setting}");
            assert_eq!(client.read(FAULTY, 4, 1), Ok(values(FAULTY, 4, 1)));
        }
    }
}

#[test]
fn an_echo_that_differs_or_is_missing_is_an_error() {
    for mode in MODES {
        let differs: fn(Vec<u8>) -> Vec<u8> = |mut request| {
            request[1] ^= 1;
            request
        };
        for (echo, setting) in [(differs, "verify"), (|_| Vec::new(), "verify"), (|_| Vec::new(), "strip")] {
            let wire = echoing_line(mode, echo);
            let more = format!("reply_timeout_ms = 500\necho = \"{setting}\"");
            let gateway = Document::new().bus("a", mode, fast(), &wire, &more).start();
            let mut client = Modbus::connect(gateway.main);
            assert_eq!(client.read(FAULTY, 1, 2), NO_REPLY, "{mode:?} {setting}");
        }
    }
}

/// A reply that comes late meets the next request to the same unit only where the quarantine is off, and is known by
/// its length then.
#[test]
fn a_late_reply_is_not_taken_for_that_of_another_quantity() {
    for quarantine in ["", "quarantine_ms = 0"] {
        for mode in MODES {
            let spoil: Spoil = |mode, _, reply| vec![(REPLY_TIMEOUT + ms(60), frame(mode, FAULTY, reply))];
            let mut rig = Rig::new(mode, spoil, quarantine);
            assert_eq!(rig.spoilt(), NO_REPLY);
            assert_eq!(rig.client.read(FAULTY, 0x0200, 3), Ok(values(FAULTY, 0x0200, 3)), "{mode:?}");
            until("the late reply is seen as what it is", || rig.gateway.bus_figure("late") == 1);
            rig.all_is_well();
            assert_eq!(rig.gateway.bus_figure("no_reply"), 1);
        }
    }
}

/// Nothing in such a reply tells that it is late: it is kept apart by the quarantine, while others are served.
#[test]
fn a_late_reply_is_not_taken_for_that_of_another_address() {
    for mode in MODES {
        let spoil: Spoil = |mode, _, reply| vec![(REPLY_TIMEOUT + ms(60), frame(mode, FAULTY, reply))];
        let mut rig = Rig::new(mode, spoil, "");
        assert_eq!(rig.spoilt(), NO_REPLY);
        let mut other = Modbus::connect(rig.gateway.main);
        let number = rig.client.send(FAULTY, &common::client::read_pdu(0x0200, 2));
        assert_eq!(other.read(HEALTHY, 0x0200, 2), Ok(values(HEALTHY, 0x0200, 2)));
        let (answered, unit, pdu) = rig.client.receive();
        assert_eq!((answered, unit), (number, FAULTY));
        assert_eq!(pdu, healthy(FAULTY, &common::client::read_pdu(0x0200, 2)), "{mode:?}");
        let requests = rig.wire.requests();
        let order: Vec<u8> = requests.iter().rev().take(3).map(|request| request.unit).collect();
        assert_eq!(order, [FAULTY, HEALTHY, FAULTY], "the healthy unit did not wait for the quarantine");
        assert_eq!(rig.gateway.bus_figure("late"), 1, "the late reply was seen as what it is");
        rig.all_is_well();
    }
}

/// A wrong implementation waits for the reply time-out, 2 s, or for a silence.
#[test]
fn an_exception_is_forwarded_at_once() {
    for mode in MODES {
        let wire = script(mode, fast(), move |unit, request| {
            vec![(ms(3), frame(mode, unit, &[request[0] | 0x80, 2]))]
        });
        let gateway = Document::new().bus("a", mode, fast(), &wire, "reply_timeout_ms = 2000").start();
        let mut client = Modbus::connect(gateway.main);
        let mut delays: Vec<Duration> = (0..50)
            .map(|address| {
                assert_eq!(client.read(FAULTY, address, 1), Err(2));
                let received = Instant::now();
                received.duration_since(wire.sent().last().expect("a reply").0)
            })
            .collect();
        delays.sort();
        let [quarter, median, worst] = [12, 25, 49].map(|at| delays[at]);
        println!("{mode:?}: exception forwarded after {median:?} (median of 50), {worst:?} at worst");
        // Not the median, which on a busy machine tells of other programs.
        assert!(quarter < ms(5), "{mode:?}: {delays:?}");
    }
}

#[test]
fn a_line_that_is_never_silent_stalls_nobody_for_ever() {
    let character = thesis().wire_time(1);
    for mode in MODES {
        let wire = script(mode, thesis(), move |unit, request| match unit {
            // Noise without a pause for 3 s, as much as the line carries.
            FAULTY => (0..ms(3000).as_micros() / character.as_micros())
                .map(|at| (character * at as u32, vec![0xFF]))
                .collect(),
            _ => vec![(Duration::ZERO, frame(mode, unit, &healthy(unit, request)))],
        });
        let gateway = Document::new().bus("a", mode, thesis(), &wire, "reply_timeout_ms = 300").start();
        let mut client = Modbus::connect(gateway.main);
        assert_eq!(client.read(FAULTY, 1, 1), NO_REPLY);
        assert_eq!(client.read(HEALTHY, 1, 1), Ok(values(HEALTHY, 1, 1)), "{mode:?}");
        let asked = wire.requests().last().expect("the request").at;
        until("noise after the request, which did not wait for its end", || {
            wire.sent().iter().any(|(at, bytes)| *at > asked && *bytes == [0xFF])
        });
    }
}
