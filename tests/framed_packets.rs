//! Dialect 7E: a client's packets go on the framed bus, and those for it come back.

mod common;

use std::thread;

use common::client::{self, Lines, Modbus, value};
use common::framed::{Packets, packet, setting, wish};
use common::table::{Connector, Table};
use common::{Document, Gateway, fast, ms, target, until};
use puente_cell::framed::Config;
use puente_drives::pid::State;
use puente_framed::{Class, Kind, Reason, arbiter, frame};
use puente_line::Settings;
use puente_modbus::Mode;
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
/// Further than an axis gets while somebody ends its motion.
const FAR: i32 = 100_000;

/// As slow a line, with as long a gap, as keeps its manners where a busy machine is late: see the test of two gateways.
const KEYS: &str = "ipg = 30\nslot = 90\ncycle_ms = 60";

fn line() -> Settings {
    Settings { baud: 57_600, format: "8N1".parse().expect("a format") }
}

struct Rig {
    table: Table,
    gateway: Gateway,
}

impl Rig {
    fn new() -> Self {
        Self::with("lease_ms = 5000")
    }

    fn with(net: &str) -> Self {
        let line = line();
        let mut config = Config::new(line, &[AXIS, OTHER]);
        let slot = line.wire_time(90);
        config.manners = arbiter::Config { gap: line.wire_time(30), slot, rest: slot, ..config.manners };
        for module in &mut config.modules {
            module.servo.speed = Some(10_000);
            module.servo.communication = ms(2_000);
        }
        let connector = if target().is_board() { Connector::Uart } else { Connector::Pty };
        let table = Table::new(config, &[connector]);
        let document = Document::new().net(net).framed("b", &table, 0, KEYS);
        let gateway = document.module("x", "b", AXIS, "gains = [0.001, 0.0, 0.000002]").start();
        let mut client = Lines::connect(gateway.main);
        until("the module is there", || client.ask("axis x status").starts_with("ok"));
        Self { table, gateway }
    }

    fn client(&self) -> Packets {
        Packets::connect(self.gateway.main)
    }

    fn state(&self, module: u8) -> State {
        self.table.of(module, |module| module.status().state)
    }

    fn status(&self) -> String {
        let mut status = String::new();
        until("a status", || {
            status = Lines::connect(self.gateway.main).ask("axis x status");
            status.starts_with("ok")
        });
        status
    }

    /// A console that has sent x far away.
    fn moving(&self) -> Lines {
        let mut commander = Lines::connect(self.gateway.main);
        // There may be no place yet, and a report may be late on a busy machine.
        until("it is sent away", || {
            let mut asked = |command: &str| commander.ask(command).starts_with("ok");
            let sent = asked("axis x enable") && asked(&format!("axis x move {FAR}"));
            if !sent {
                commander = Lines::connect(self.gateway.main);
            }
            sent
        });
        until("it moves", || {
            commander.ok("feed");
            self.table.position(AXIS) > 100.0
        });
        commander
    }

    /// Has a client send a module far away, step by step, until it moves.
    fn send_away(&self, client: &mut Packets, module: u8) {
        until("it moves", || {
            let control = match self.state(module) {
                State::Fault(_) => Control::Off,
                State::Disabled => {
                    client.ask(&wish(A, module, Control::Observe, 0.0));
                    Control::Hold
                }
                State::Starting => Control::Hold,
                State::Held | State::Enabled => Control::Follow,
            };
            client.ask(&wish(A, module, control, FAR as f32));
            self.table.position(module) > 100.0
        });
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
    assert_eq!(client.receive().refusal(), Some((Reason::Meaningless, lrc(&damaged))));
    client.send(&good[10..]);
    let answer = client.next_within(ms(1_000)).unwrap_or_else(|| client.ask(&good));
    assert_eq!(answer.origin, OTHER);
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

/// Who closes its side gets what it has asked for, and then the connection ends.
#[test]
fn a_client_that_has_said_all_is_answered() {
    let rig = Rig::new();
    until("it is answered", || {
        let mut client = rig.client();
        client.send(&wish(A, OTHER, Control::Observe, 0.0));
        client.close();
        let answer = client.next_within(ms(20_000));
        assert!(client.next_within(ms(20_000)).is_none());
        answer.is_some_and(|answer| answer.origin == OTHER)
    });
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
    // A module that was disturbed may have answered twice.
    let heard = std::iter::repeat_with(|| to.receive()).find(|packet| packet.origin == A).expect("it");
    assert_eq!((heard.kind, heard.sections.len()), (Kind::Plain, 6));
    assert!(heard.sections.iter().all(|(_, got)| got[..] == data));
    assert_eq!(from.ask(&wish(A, OTHER, Control::Observe, 0.0)).origin, OTHER);
}

/// A module that is no axis of the gateway is the client's own business.
#[test]
fn a_module_that_is_no_axis_is_moved_freely() {
    let rig = Rig::new();
    rig.send_away(&mut rig.client(), OTHER);
    assert_eq!(value(&rig.status(), "lease"), Some("none"));
}

/// The rules of the axis hold for what clients send past it: the lease, and the stop when its holder is gone.
#[test]
fn who_moves_an_axis_has_its_lease_and_when_he_goes_it_stops() {
    let rig = Rig::new();
    let mut client = rig.client();
    rig.send_away(&mut client, AXIS);
    let status = rig.status();
    assert!(value(&status, "lease").is_some_and(|holder| holder != "none"), "{status}");
    let refused = rig.client().ask(&wish(B, AXIS, Control::Follow, 0.0));
    assert_eq!(refused.refusal().map(|(reason, _)| reason), Some(Reason::Denied));
    drop(client);
    until("it stands", || rig.state(AXIS) != State::Enabled);
    assert!(rig.table.position(AXIS) < f64::from(FAR) / 2.0);
    until("its event", || value(&rig.status(), "event") == Some("commander-disconnected"));
}

/// Anyone may stop an axis, however it was moved; nobody else may move it.
#[test]
fn a_packet_stops_what_another_moves() {
    let rig = Rig::new();
    let mut commander = rig.moving();
    let denied = rig.client().ask(&wish(B, AXIS, Control::Follow, 0.0));
    assert_eq!(denied.refusal().map(|(reason, _)| reason), Some(Reason::Denied));
    commander.ok("feed");
    assert_eq!(rig.state(AXIS), State::Enabled, "it goes on");
    rig.client().send(&wish(B, AXIS, Control::Hold, 0.0));
    until("it stands", || rig.state(AXIS) == State::Held);
    assert!(rig.table.position(AXIS) < f64::from(FAR) / 2.0);
    until("its event", || value(&rig.status(), "event") == Some("stopped-by-other"));
}

/// When all places are taken a packet may stop an axis, and do nothing else.
#[test]
fn a_visitor_may_only_stop() {
    let rig = Rig::with("lease_ms = 5000\nclients = 1");
    let _commander = rig.moving();
    for refused in [wish(B, AXIS, Control::Observe, 0.0), wish(B, OTHER, Control::Off, 0.0)] {
        until("a visitor is heard", || {
            let mut visitor = rig.client();
            visitor.send(&refused);
            let answer = visitor.next_within(ms(5_000));
            answer
                .inspect(|answer| assert_eq!(answer.refusal(), Some((Reason::Denied, lrc(&refused)))))
                .is_some()
        });
    }
    until("it stands", || {
        rig.client().send(&wish(B, AXIS, Control::Hold, 0.0));
        rig.state(AXIS) == State::Held
    });
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
    let wire = common::wire::cell(Mode::Rtu, fast(), &[1]);
    let gateway = Document::new().bus("a", Mode::Rtu, fast(), &wire, "").start();
    let packet = wish(A, OTHER, Control::Observe, 0.0);
    let answer = Packets::connect(gateway.main).ask(&packet);
    assert_eq!(answer.refusal(), Some((Reason::NoLine, lrc(&packet))));
}

/// A line on which the gateway does not hear itself.
#[test]
fn a_line_that_does_not_work_is_told() {
    let wire = common::wire::script(Mode::Rtu, line(), |_, _| Vec::new());
    let document = Document::new().framed_wire("b", line(), &wire, KEYS);
    let gateway = document.module("x", "b", AXIS, "").start();
    let packet = wish(A, OTHER, Control::Observe, 0.0);
    let mut client = Packets::connect(gateway.main);
    client.send(&packet);
    assert_eq!(client.receive().refusal(), Some((Reason::NoEcho, lrc(&packet))));
}
