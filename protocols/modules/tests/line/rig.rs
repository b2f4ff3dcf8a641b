//! Gateways and modules on a simulated line.

use std::time::Duration;

use puente_drives::pid::{self, Encoder, Event, Gains, Input, State, Width};
use puente_framed::arbiter::Echo;
use puente_framed::frame::MAX_FRAME;
use puente_framed::station;
use puente_line::{Instant, Settings};
use puente_modules::master::{self, Axis, Output};
use puente_modules::{Control, Form, Master, Node, Report, node};
use puente_shared_line::{Drive, Heard, Line, Node as Seat, Place};

pub type Gateway = Master<3, 3, 2, MAX_FRAME>;

/// Steps of a module's loop a second. Fewer than of a real one, for these tests look at the bus.
const RATE: u32 = 1_000;
/// Counts a second at full command.
const TOP_SPEED: f64 = 200_000.0;

pub fn fast() -> Settings {
    Settings { baud: 1_000_000, format: "8N1".parse().expect("format") }
}

pub fn station(address: u8) -> station::Config {
    station::Config::new(address, fast(), 64)
}

/// Whoever is on the line.
pub enum Side {
    Gateway(Box<GatewaySide>),
    Module(Box<ModuleSide>),
    /// One that is not there any more, or not yet.
    Nobody,
    /// Says what it is given, with manners.
    Ghost(Box<Ghost>),
}

/// A gateway, and what it was told.
pub struct GatewaySide {
    pub master: Gateway,
    pub reports: Vec<(Instant, usize, Report)>,
    pub events: Vec<(usize, Event)>,
    pub fell: Vec<(usize, Control)>,
    pub missed: Vec<usize>,
    pub heard: Vec<Vec<u8>>,
    pub posted: Vec<bool>,
    /// When each of its frames began, and its bytes.
    pub sent: Vec<(Instant, Vec<u8>)>,
    /// Where it does not hear itself: until when.
    mute: Option<Instant>,
    /// A client's frames that wait.
    pub client: Vec<Vec<u8>>,
}

impl GatewaySide {
    pub fn last(&self, axis: usize) -> Option<Report> {
        self.reports.iter().rfind(|(_, of, _)| *of == axis).map(|(.., report)| *report)
    }

    fn poll(&mut self, now: Instant) -> Option<Drive> {
        loop {
            if let Some(frame) = self.client.first()
                && self.master.post(now, frame).is_ok()
            {
                self.client.remove(0);
            }
            match self.master.poll(now) {
                master::Action::Transmit(bytes) => {
                    if self.mute.is_some() {
                        self.mute = Some(now + fast().wire_time(bytes.len()) + Duration::from_micros(5));
                    }
                    self.sent.push((now, bytes.to_vec()));
                    return Some(Drive::Transmit(bytes.to_vec()));
                }
                master::Action::Jam(bytes) => return Some(Drive::Jam(bytes.to_vec())),
                master::Action::Reported { axis, report, .. } => self.reports.push((now, axis, report)),
                master::Action::Event { axis, event } => self.events.push((axis, event)),
                master::Action::Fell { axis, to } => self.fell.push((axis, to)),
                master::Action::Missed { axis } => self.missed.push(axis),
                master::Action::Heard(bytes) => self.heard.push(bytes.to_vec()),
                master::Action::Posted(outcome) => self.posted.push(outcome.is_ok()),
                master::Action::Failed => {}
                master::Action::Idle => return None,
            }
        }
    }
}

/// A module with an axis that moves as fast as it is told to.
pub struct ModuleSide {
    pub node: Node<2, 4, MAX_FRAME>,
    pub module: pid::Module,
    pub position: f64,
    next_step: Instant,
}

impl ModuleSide {
    pub fn new(address: u8, form: Form, now: Instant, seed: u64) -> Self {
        let config = pid::Config {
            rate: RATE,
            following_error: 1_000_000,
            ..pid::Config::new(Encoder::Binary(Width::W32))
        };
        Self {
            node: Node::new(node::Config { station: station(address), form }, now, seed),
            module: pid::Module::new(config).expect("settings"),
            position: 1_000_000.0,
            next_step: now,
        }
    }

    pub fn state(&self) -> State {
        self.module.status().state
    }

    fn poll(&mut self, now: Instant) -> Option<Drive> {
        while self.next_step <= now {
            let encoder = Ok(self.position as i64 as u32);
            let output = self.module.step(Input { encoder, amplifier_fault: false, now: self.next_step });
            self.position += f64::from(output.command) * TOP_SPEED / f64::from(RATE);
            self.next_step += Duration::from_secs(1) / RATE;
            if let Some(event) = output.event {
                self.node.event(event);
            }
        }
        match self.node.poll(now, &mut self.module) {
            node::Action::Transmit(bytes) => Some(Drive::Transmit(bytes.to_vec())),
            node::Action::Jam(bytes) => Some(Drive::Jam(bytes.to_vec())),
            node::Action::Idle => None,
        }
    }
}

/// A bare station that says what it is given.
pub struct Ghost {
    pub station: puente_framed::Station<0, 0, 1, 16, MAX_FRAME>,
    pub frames: Vec<Vec<u8>>,
    /// Frames heard, whole.
    pub heard: Vec<Vec<u8>>,
}

impl Ghost {
    fn poll(&mut self, now: Instant) -> Option<Drive> {
        loop {
            if let Some(frame) = self.frames.first()
                && self.station.post_frame(now, frame).is_ok()
            {
                self.frames.remove(0);
            }
            match self.station.poll(now) {
                station::Action::Transmit(bytes) => return Some(Drive::Transmit(bytes.to_vec())),
                station::Action::Jam(bytes) => return Some(Drive::Jam(bytes.to_vec())),
                station::Action::Heard(_) => self.heard.push(self.station.heard().to_vec()),
                station::Action::Idle => return None,
                _ => {}
            }
        }
    }
}

impl Seat for Side {
    fn hear(&mut self, now: Instant, heard: Heard) {
        match (self, heard) {
            (Self::Gateway(side), _) if side.mute.is_some_and(|until| now <= until) => {}
            (Self::Gateway(side), Heard::Byte(byte)) => side.master.receive(now, byte),
            (Self::Gateway(side), Heard::Damaged) => side.master.line_error(now),
            (Self::Module(side), Heard::Byte(byte)) => side.node.receive(now, byte),
            (Self::Module(side), Heard::Damaged) => side.node.line_error(now),
            (Self::Ghost(side), Heard::Byte(byte)) => side.station.receive(now, byte),
            (Self::Ghost(side), Heard::Damaged) => side.station.line_error(now),
            (Self::Nobody, _) => {}
        }
    }

    fn carrier(&mut self, now: Instant) {
        match self {
            Self::Gateway(side) if side.mute.is_some_and(|until| now <= until) => {}
            Self::Gateway(side) => side.master.carrier(now),
            Self::Module(side) => side.node.carrier(now),
            Self::Ghost(side) => side.station.carrier(now),
            Self::Nobody => {}
        }
    }

    fn poll(&mut self, now: Instant) -> Option<Drive> {
        match self {
            Self::Gateway(side) => side.poll(now),
            Self::Module(side) => side.poll(now),
            Self::Ghost(side) => side.poll(now),
            Self::Nobody => None,
        }
    }

    fn poll_at(&self) -> Option<Instant> {
        match self {
            Self::Gateway(side) => side.master.poll_at(),
            Self::Module(side) => [side.node.poll_at(), Some(side.next_step)].into_iter().flatten().min(),
            Self::Ghost(side) => side.station.poll_at(),
            Self::Nobody => None,
        }
    }
}

/// A line with its stations by address.
pub struct Rig {
    pub line: Line<Side>,
    seats: Vec<u8>,
    seed: u64,
}

impl Rig {
    pub fn new(noise: f64, seed: u64) -> Self {
        Self { line: Line::new(fast(), station(1).arbiter.gap, noise, seed), seats: Vec::new(), seed }
    }

    fn join(&mut self, address: u8, side: Side) {
        let position = Duration::from_nanos(70 * u64::from(address));
        self.line.join(side, Place { position, ..Place::new(fast()) });
        self.seats.push(address);
    }

    fn seed(&mut self) -> u64 {
        self.seed += 1;
        self.seed.wrapping_mul(0x9E37_79B9)
    }

    /// A gateway with its axes.
    pub fn gateway(&mut self, address: u8, cycle_ms: u64, axes: &[(u8, Form)]) {
        let side = self.gateway_side(address, Duration::from_millis(cycle_ms), axes);
        self.join(address, side);
    }

    /// One on an adapter that does not give back what it sends.
    pub fn gateway_without_echo(&mut self, address: u8, cycle_ms: u64, axes: &[(u8, Form)]) {
        let mut station = station(address);
        station.arbiter.echo = Echo::None;
        let config = master::Config { station, cycle: Duration::from_millis(cycle_ms) };
        let Side::Gateway(mut side) = self.gateway_of(config, axes) else { unreachable!() };
        side.mute = Some(Instant::ZERO);
        self.join(address, Side::Gateway(side));
        // It cannot hear a collision.
        let seat = self.seat(address);
        self.line.place(seat).judged = false;
    }

    pub fn gateway_side(&mut self, address: u8, cycle: Duration, axes: &[(u8, Form)]) -> Side {
        self.gateway_of(master::Config { station: station(address), cycle }, axes)
    }

    fn gateway_of(&mut self, config: master::Config, axes: &[(u8, Form)]) -> Side {
        let axes = axes.iter().map(|(address, form)| Axis { address: *address, form: *form });
        let (now, seed) = (self.line.now(), self.seed());
        Side::Gateway(Box::new(GatewaySide {
            master: Master::new(config, axes, now, seed),
            reports: Vec::new(),
            events: Vec::new(),
            fell: Vec::new(),
            missed: Vec::new(),
            heard: Vec::new(),
            posted: Vec::new(),
            sent: Vec::new(),
            mute: None,
            client: Vec::new(),
        }))
    }

    pub fn module(&mut self, address: u8, form: Form) {
        let side = self.module_side(address, form);
        self.join(address, side);
    }

    pub fn module_side(&mut self, address: u8, form: Form) -> Side {
        let (now, seed) = (self.line.now(), self.seed());
        Side::Module(Box::new(ModuleSide::new(address, form, now, seed)))
    }

    pub fn ghost(&mut self, address: u8) {
        let (now, seed) = (self.line.now(), self.seed());
        let station = puente_framed::Station::new(station(address), now, seed);
        self.join(address, Side::Ghost(Box::new(Ghost { station, frames: Vec::new(), heard: Vec::new() })));
    }

    pub fn seat(&self, address: u8) -> usize {
        self.seats.iter().position(|seat| *seat == address).expect("it has joined")
    }

    /// Takes a station off the line; what it was going to say is not said.
    pub fn kill(&mut self, address: u8) {
        self.replace(address, Side::Nobody);
        let seat = self.seat(address);
        self.line.place(seat).judged = false;
    }

    pub fn replace(&mut self, address: u8, side: Side) {
        let seat = self.seat(address);
        *self.line.tell(seat) = side;
    }

    pub fn at(&self, address: u8) -> &GatewaySide {
        match self.line.node(self.seat(address)) {
            Side::Gateway(side) => side,
            _ => panic!("{address} is no gateway"),
        }
    }

    pub fn at_mut(&mut self, address: u8) -> &mut GatewaySide {
        let seat = self.seat(address);
        match self.line.tell(seat) {
            Side::Gateway(side) => side,
            _ => panic!("{address} is no gateway"),
        }
    }

    pub fn of(&self, address: u8) -> &ModuleSide {
        match self.line.node(self.seat(address)) {
            Side::Module(side) => side,
            _ => panic!("{address} is no module"),
        }
    }

    pub fn ghost_at(&mut self, address: u8) -> &mut Ghost {
        let seat = self.seat(address);
        match self.line.tell(seat) {
            Side::Ghost(side) => side,
            _ => panic!("{address} is no ghost"),
        }
    }

    /// What a gateway wants of one of its axes.
    pub fn want(&mut self, gateway: u8, axis: usize, control: Control, set_point: i32) {
        let output = Output { control, gains: gains(), set_point };
        self.at_mut(gateway).master.set(axis, output);
    }

    pub fn run(&mut self, time: Duration) {
        let until = self.line.now() + time;
        self.line.run_until(until).unwrap_or_else(|violation| panic!("{violation}"));
    }

    pub fn run_ms(&mut self, ms: u64) {
        self.run(Duration::from_millis(ms));
    }

    /// Puts axes under current, and waits until they are held.
    pub fn enable(&mut self, gateway: u8, axes: &[usize]) {
        self.run_ms(20);
        for axis in axes {
            self.want(gateway, *axis, Control::Hold, 0);
        }
        self.run_ms(80);
        for axis in axes {
            let report = self.at(gateway).last(*axis).expect("a report");
            assert_eq!((report.state, report.refused), (State::Held, None), "axis {axis} of {gateway}");
        }
    }
}

pub fn gains() -> Gains {
    Gains::new(0.000_1, 0.0, 0.0).expect("gains")
}
