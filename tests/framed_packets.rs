//! Dialect 7E: a client's packets go on the framed bus, and those for it come back.

mod common;

use std::thread;

use common::client::{self, Lines, Modbus, value};
use common::framed::{Packets, keys, line, modules, packet, setting, wish};
use common::wire::Wire;
use common::{Document, Gateway, ms, until};
use puente_cell::framed::Cell;
use puente_drives::pid::State;
use puente_framed::{Class, Kind, Reason, frame};
use puente_modules::{Control, Report};

/// The gateway's station.
const STATION: u8 = 1;
/// A module that is an axis of the gateway, x,
const AXIS: u8 = 17;
/// and one that is none.
const OTHER: u8 = 18;
/// Addresses of clients.
const A: u8 = 50;
const B: u8 = 51;

struct Rig {
    wire: Wire<Cell>,
    gateway: Gateway,
}

impl Rig {
    fn new() -> Self {
        Self::with("lease_ms = 1000")
    }

    fn with(net: &str) -> Self {
        let wire = modules(&[AXIS, OTHER]);
        let document = Document::new().net(net).framed("b", line(), &wire, &keys(""));
        let gateway = document.module("x", "b", AXIS, "gains = [1.0, 0.0, 0.0]").start();
        Self { wire, gateway }
    }

    fn client(&self) -> Packets {
        Packets::connect(self.gateway.main)
    }

    fn state(&self, module: u8) -> State {
        self.wire.device().module(module).expect("a module").status().state
    }

    fn position(&self, module: u8) -> i64 {
        self.wire.device().module(module).expect("a module").status().position
    }

    fn status(&self) -> String {
        Lines::connect(self.gateway.main).ask("axis x status")
    }
}

/// The LRC of a frame.
fn lrc(bytes: &[u8]) -> u8 {
    bytes[bytes.len() - 2]
}

#[test]
fn a_module_answers_the_address_that_asks() {
    let rig = Rig::new();
    let answer = rig.client().ask(&wish(A, OTHER, Control::Observe, 0.0));
    assert_eq!((answer.origin, answer.kind), (OTHER, Kind::Single(Class::Status)));
    let [(A, data)] = answer.sections.as_slice() else { panic!("{answer:?}") };
    assert_eq!(Report::parse(data).expect("a report").state, State::Disabled);
}

/// A packet of the thesis from origin 0 goes as one of the gateway's.
#[test]
fn origin_0_becomes_the_gateways_own() {
    let rig = Rig::new();
    let packet = packet(0, Kind::Plain, &[(OTHER, &setting(0.0, None))]);
    let answer = rig.client().ask(&packet);
    assert_eq!((answer.origin, answer.kind), (OTHER, Kind::Receipt { lrc: lrc(&packet) }));
    assert_eq!(answer.sections[0].0, STATION);
}

/// What is between frames does not matter, nor how they are cut; what is damaged is told, and the next is understood.
#[test]
fn garbage_is_passed_over_and_damage_told() {
    let rig = Rig::new();
    let mut client = rig.client();
    let good = wish(A, OTHER, Control::Observe, 0.0);
    let mut damaged = good.clone();
    damaged[7] ^= 1;
    client.send(&[&damaged[..], b"\r\n\0", &good[..10]].concat());
    thread::sleep(ms(20));
    client.send(&good[10..]);
    assert_eq!(client.receive().refusal(), Some((Reason::Meaningless, lrc(&damaged))));
    assert_eq!(client.receive().origin, OTHER);
}

/// A frame that never ends is given up, and does not hide those after it.
#[test]
fn a_frame_that_stops_is_given_up() {
    let rig = Rig::new();
    let mut client = rig.client();
    client.send(&wish(A, OTHER, Control::Observe, 0.0)[..20]);
    assert_eq!(client.receive().refusal().map(|(reason, _)| reason), Some(Reason::Meaningless));
    assert_eq!(client.ask(&wish(A, OTHER, Control::Observe, 0.0)).origin, OTHER);
}

/// Who closes its side gets what it has asked for.
#[test]
fn a_client_that_has_said_all_is_answered() {
    let rig = Rig::new();
    let mut client = rig.client();
    client.send(&wish(A, OTHER, Control::Observe, 0.0));
    client.close();
    assert_eq!(client.receive().origin, OTHER);
    assert_eq!(client.next_within(ms(20_000)), None);
}

/// Each gets what is for it, and nobody waits for ever.
#[test]
fn clients_take_turns() {
    let rig = Rig::new();
    let ask = |address: u8| {
        let mut client = rig.client();
        thread::spawn(move || {
            for _ in 0..10 {
                let answer = client.ask(&wish(address, OTHER, Control::Observe, 0.0));
                assert_eq!((answer.origin, answer.sections[0].0), (OTHER, address));
            }
        })
    };
    for client in [A, B, B + 1].map(ask) {
        client.join().expect("it was answered");
    }
}

/// The longest packet goes whole, and one client hears the other.
#[test]
fn the_longest_packet_goes_from_client_to_client() {
    let rig = Rig::new();
    let (mut from, mut to) = (rig.client(), rig.client());
    assert_eq!(to.ask(&wish(B, OTHER, Control::Observe, 0.0)).origin, OTHER);
    let data = [0x7E; 252];
    let sections = [B, 201, 202, 203, 204, 205].map(|address| (address, &data[..]));
    let long = packet(A, Kind::Plain, &sections);
    assert_eq!(long.len(), frame::MAX_FRAME);
    from.send(&long);
    let heard = to.receive();
    assert_eq!((heard.origin, heard.kind, heard.sections.len()), (A, Kind::Plain, 6));
    assert!(heard.sections.iter().all(|(_, got)| got[..] == data));
    assert_eq!(from.ask(&wish(A, OTHER, Control::Observe, 0.0)).origin, OTHER);
}

/// A module that is no axis of the gateway is the client's own business.
#[test]
fn a_module_that_is_no_axis_is_moved_freely() {
    let rig = Rig::new();
    let mut client = rig.client();
    for control in [Control::Observe, Control::Hold] {
        client.ask(&wish(A, OTHER, control, 0.0));
    }
    until("it follows", || {
        client.ask(&wish(A, OTHER, Control::Follow, 500.0));
        rig.position(OTHER) > 400
    });
}

/// The rules of the axis hold for what clients send past it: the lease, and the stop when its holder is gone.
#[test]
fn who_moves_an_axis_has_its_lease_and_when_he_goes_it_stops() {
    let rig = Rig::new();
    let mut client = rig.client();
    for control in [Control::Observe, Control::Hold] {
        client.ask(&wish(A, AXIS, control, 0.0));
    }
    until("it follows", || {
        client.ask(&wish(A, AXIS, Control::Follow, 1_000_000.0));
        rig.state(AXIS) == State::Enabled
    });
    let status = rig.status();
    assert!(value(&status, "lease").is_some_and(|holder| holder != "none"), "{status}");
    let refused = rig.client().ask(&wish(B, AXIS, Control::Follow, 0.0));
    assert_eq!(refused.refusal().map(|(reason, _)| reason), Some(Reason::Denied));
    drop(client);
    until("it stands", || rig.state(AXIS) != State::Enabled);
    until("its event", || value(&rig.status(), "event") == Some("commander-disconnected"));
}

/// Anyone may stop an axis, however it was moved.
#[test]
fn a_packet_stops_what_another_moves() {
    let rig = Rig::new();
    let mut commander = Lines::connect(rig.gateway.main);
    commander.ok("axis x enable");
    commander.ok("axis x move 1000000");
    until("it moves", || rig.position(AXIS) > 100);
    let denied = rig.client().ask(&wish(B, AXIS, Control::Follow, 0.0));
    assert_eq!(denied.refusal().map(|(reason, _)| reason), Some(Reason::Denied));
    assert_eq!(rig.state(AXIS), State::Enabled, "it goes on");
    rig.client().ask(&wish(B, AXIS, Control::Hold, 0.0));
    until("it stands", || rig.state(AXIS) == State::Held);
    assert_eq!(value(&rig.status(), "event"), Some("stopped-by-other"));
}

/// When all places are taken a packet may stop an axis, and do nothing else.
#[test]
fn a_visitor_may_only_stop() {
    let rig = Rig::with("lease_ms = 1000\nclients = 1");
    let mut commander = Lines::connect(rig.gateway.main);
    commander.ok("axis x enable");
    commander.ok("axis x move 1000000");
    until("it moves", || rig.position(AXIS) > 100);
    for refused in [wish(B, AXIS, Control::Observe, 0.0), wish(B, OTHER, Control::Off, 0.0)] {
        let answer = rig.client().ask(&refused);
        assert_eq!(answer.refusal(), Some((Reason::Denied, lrc(&refused))));
    }
    rig.client().send(&wish(B, AXIS, Control::Hold, 0.0));
    until("it stands", || rig.state(AXIS) == State::Held);
}

/// A Modbus/TCP transaction id may begin with 7E.
#[test]
fn modbus_tcp_is_told_from_packets() {
    let rig = Rig::new();
    let mut client = Modbus::connect(rig.gateway.main);
    std::io::Write::write_all(&mut client.stream, &client::mbap(0x7E32, 1, &[3, 0, 0, 0, 1])).expect("sent");
    // No bus serves a unit here.
    assert_eq!(client.receive(), (0x7E32, 1, vec![0x83, 0x0A]));
}

#[test]
fn without_a_framed_bus_every_packet_is_refused() {
    let wire = common::wire::cell(puente_modbus::Mode::Rtu, common::fast(), &[1]);
    let gateway = Document::new().bus("a", puente_modbus::Mode::Rtu, common::fast(), &wire, "").start();
    let packet = wish(A, OTHER, Control::Observe, 0.0);
    let answer = Packets::connect(gateway.main).ask(&packet);
    assert_eq!(answer.refusal(), Some((Reason::NoLine, lrc(&packet))));
}

/// Where nobody is at the other end of the line, not even its echo.
#[test]
fn a_line_that_is_not_there_is_told() {
    let mut rig = Rig::new();
    let packet = wish(A, OTHER, Control::Observe, 0.0);
    let mut client = rig.client();
    assert_eq!(client.ask(&packet).origin, OTHER);
    rig.wire.pull();
    let answer = client.ask(&packet);
    let refusal = answer.refusal().expect("a refusal");
    assert!(matches!(refusal, (Reason::NoLine | Reason::NoEcho, _)), "{refusal:?}");
    assert_eq!(refusal.1, lrc(&packet));
    rig.wire.plug();
    until("it is there again", || client.ask(&packet).origin == OTHER);
}
