//! Host alone: a board's UART does not vanish with its wire; there a wire that is pulled is a silent one.
//!
//! A line that vanishes and comes back: requests fail meanwhile, and heal by themselves.

mod common;

use std::thread;
use std::time::{Duration, Instant};

use common::can::Adapter;
use common::client::{Lines, Modbus, write_pdu};
use common::framed::{Packets, wish};
use common::rig::{FORWARD, Rig};
use common::servos::{self, AXES, Far, drives};
use common::wire::{Device, Script, Wire, frame, healthy, values};
use common::{Document, MODES, fast, ms, until};
use puente_cell::can::Cell;
use puente_framed::Reason;
use puente_modbus::Mode;
use puente_modules::Control;

fn slaves(mode: Mode) -> Script {
    Script::new(mode, fast(), move |unit, request| {
        vec![(Duration::ZERO, frame(mode, unit, &healthy(unit, request)))]
    })
}

fn heals<D: Device>(mode: Mode, mut wire: Wire<D>) {
    let other = common::wire::script(mode, fast(), move |unit, request| {
        vec![(Duration::ZERO, frame(mode, unit, &healthy(unit, request)))]
    });
    let gateway = Document::new()
        .bus("a", mode, fast(), &wire, "units = \"1-3\"\nreply_timeout_ms = 500")
        .bus("b", mode, fast(), &other, "units = \"4-6\"")
        .start();
    let mut client = Modbus::connect(gateway.main);
    let mut of_other_bus = Modbus::connect(gateway.main);
    for round in 1..=2 {
        assert_eq!(client.read(1, round, 2), Ok(values(1, round, 2)));
        wire.pull();
        until("a failure", || client.read(1, 7, 1) != Ok(values(1, 7, 1)));
        let pulled = Instant::now();
        while pulled.elapsed() < ms(500) {
            assert_eq!(client.read(1, 7, 1), Err(0x0B));
            assert_eq!(of_other_bus.read(4, 7, 1), Ok(values(4, 7, 1)), "another bus is not disturbed");
        }
        let reply = Lines::connect(gateway.main).ask("bus a scan 2-3");
        assert!(reply.starts_with("error not-sent") || reply.ends_with("found="), "{reply}");
        wire.plug();
        until("the line is healed", || client.read(1, round, 2) == Ok(values(1, round, 2)));
        assert_eq!(client.read(2, 0x0100, 20), Ok(values(2, 0x0100, 20)));
    }
    assert!(gateway.log().matches("trying again").count() <= 6, "a line that stays away is told once");
}

#[test]
fn a_serial_device_that_is_unplugged() {
    for mode in MODES {
        heals(mode, Wire::pty(slaves(mode)));
    }
}

#[test]
fn a_tcp_line_whose_server_restarts() {
    for mode in MODES {
        heals(mode, Wire::tcp(slaves(mode)));
    }
}

#[test]
fn a_line_that_is_not_there_yet_when_the_gateway_starts() {
    let mut wire = Wire::tcp(slaves(Mode::Rtu));
    wire.pull();
    let gateway = Document::new().bus("a", Mode::Rtu, fast(), &wire, "").start();
    let mut client = Modbus::connect(gateway.main);
    assert_eq!(client.read(1, 7, 1), Err(0x0B));
    wire.plug();
    until("the line is found", || client.read(1, 7, 1) == Ok(values(1, 7, 1)));
}

#[test]
fn what_could_not_be_sent_is_told_so() {
    let mut wire = Wire::tcp(slaves(Mode::Rtu));
    wire.pull();
    let gateway = Document::new().bus("a", Mode::Rtu, fast(), &wire, "").axis("x", "a", 1, "").start();
    let mut console = Lines::connect(gateway.main);
    let reply = console.error("axis x set Pn037 100", "not-sent");
    assert!(reply.contains("not sent: the port of the bus failed"), "{reply}");
    wire.plug();
    until("the line is found", || console.ask("axis x get Pn037").starts_with("ok"));
    assert!(!wire.pdus(1).iter().any(|pdu| pdu[0] == 6), "and is not sent later");
}

#[test]
fn an_axis_whose_commander_left_while_the_wire_was_pulled_is_stopped_when_it_is_back() {
    let mut rig = Rig::new(Mode::Rtu, 5000);
    let (commander, _) = rig.jogging();
    rig.wire.pull();
    drop(commander);
    thread::sleep(ms(300));
    assert!(rig.turns(), "a real drive goes on too");
    rig.wire.plug();
    until("x stands", || !rig.turns());
    assert!(rig.wire.pdus(1).contains(&write_pdu(FORWARD, 0)));
}

/// The adapter of a CAN bus, on a serial device or behind a TCP port. Another bus goes on.
#[test]
fn a_can_adapter_that_is_unplugged_is_told_by_its_axes_and_used_again_when_it_is_back() {
    for wire in [Wire::pty, Wire::tcp] {
        let far = Far::new();
        let adapter = wire(Adapter::new(Cell::new(drives())));
        let mut rig = servos::Rig::with(adapter, 5_000, "", "", |document| far.settings(document));
        rig.are_present(&AXES);
        let mut commander = rig.turning();
        far.turn(&mut commander);
        let mut events = rig.client();
        for command in ["set network 1", "set events bus 1"] {
            assert_eq!(events.ask(&format!("[1] {command}")), "[1] OK");
        }
        rig.adapter.pull();
        rig.is_refused("down", &mut commander);
        assert_eq!(events.line(), "1 0 ERROR 304 #CAN init.");
        far.goes_on(&mut commander);
        rig.adapter.plug();
        rig.comes_back(&mut commander);
        far.goes_on(&mut commander);
        assert_eq!(events.line(), "1 0 ERROR 305 #CAN active.");
    }
}

/// A packet of dialect 7E is told so too, and goes when the line is back.
#[test]
fn a_packet_for_a_line_that_is_gone_is_refused() {
    // What is sent comes back, as from a line on which nobody else is.
    let mut wire = Wire::new(Mirror::default());
    let document = Document::new().framed_wire("b", fast(), &wire, "ipg = 30\nslot = 90");
    let gateway = document.module("x", "b", 17, "").start();
    let packet = wish(50, 18, Control::Observe, 0.0);
    let mut client = Packets::connect(gateway.main);
    let mut reason = || {
        client.send(&packet);
        client.next_within(ms(1_000)).map(|packet| packet.refusal().expect("a refusal").0)
    };
    until("it goes", || reason().is_none());
    wire.pull();
    until("it is told", || reason() == Some(Reason::NoLine));
    wire.plug();
    until("it goes again", || reason().is_none());
}

/// A line that gives everything back.
#[derive(Default)]
struct Mirror(Vec<u8>);

impl Device for Mirror {
    fn receive(&mut self, _: puente_line::Instant, bytes: &[u8]) {
        self.0.extend(bytes);
    }

    fn poll(&mut self, _: puente_line::Instant) -> Option<Vec<u8>> {
        (!self.0.is_empty()).then(|| std::mem::take(&mut self.0))
    }

    fn poll_at(&self) -> Option<puente_line::Instant> {
        None
    }

    fn requests(&mut self) -> Vec<(puente_line::Instant, u8, Vec<u8>)> {
        Vec::new()
    }
}
