//! Gateways and modules on the simulated line, and what their cycles are like.

use std::time::Duration;

use puente_drives::pid::{self, Encoder, Gains, Input, State, Width};
use puente_framed::frame::{self, MAX_FRAME};
use puente_framed::station;
use puente_line::{Instant, Settings};
use puente_modules::master::{self, Axis, Output, Statistics};
use puente_modules::{Control, Form, Master, Node, node};
use puente_shared_line::{Drive, Heard, Line, Node as Seat, Place};

/// Gains as in examples/tx8.toml.
const GAINS: [f32; 3] = [1e-3, 0.0, 2e-6];
/// Where the axes stand, counts: a set-point there has six digits.
const POSITION: u32 = 123_456;
/// The modules' loops need not be quick here.
const LOOP: Duration = Duration::from_millis(1);
/// From the beginning until all axes are under current and follow.
const SETTLE: Duration = Duration::from_millis(300);

/// A gateway: the address of its first module, how many it has, and its cycle.
#[derive(Clone, Copy)]
pub struct Gateway {
    pub first: u8,
    pub axes: u8,
    pub form: Form,
    pub cycle: Duration,
}

/// What the cycles of one gateway were like.
#[derive(Clone, Copy, Debug)]
pub struct Figures {
    /// From one cycle's frame to the next.
    pub mean: Duration,
    pub longest: Duration,
    pub cycles: usize,
    /// Characters of a cycle's frame.
    pub update: usize,
    /// Reports a cycle.
    pub reports: f64,
    /// What the station has met, since the axes followed.
    pub collisions: u32,
    pub overruns: u32,
    pub missed: u32,
}

/// What was measured, of each gateway, and the part of the time in which there were characters on the line.
pub struct Measured {
    pub gateways: Vec<Figures>,
    pub share: f64,
}

enum Side {
    Gateway { master: Box<Master<3, 3, 2, MAX_FRAME>>, sent: Vec<(Instant, usize)>, reports: usize },
    Module { node: Box<Node<2, 2, MAX_FRAME>>, module: Box<pid::Module>, step: Instant },
}

impl Seat for Side {
    fn hear(&mut self, now: Instant, heard: Heard) {
        match (self, heard) {
            (Self::Gateway { master, .. }, Heard::Byte(byte)) => master.receive(now, byte),
            (Self::Gateway { master, .. }, Heard::Damaged) => master.line_error(now),
            (Self::Module { node, .. }, Heard::Byte(byte)) => node.receive(now, byte),
            (Self::Module { node, .. }, Heard::Damaged) => node.line_error(now),
        }
    }

    fn carrier(&mut self, now: Instant) {
        match self {
            Self::Gateway { master, .. } => master.carrier(now),
            Self::Module { node, .. } => node.carrier(now),
        }
    }

    fn poll(&mut self, now: Instant) -> Option<Drive> {
        match self {
            Self::Gateway { master, sent, reports } => loop {
                match master.poll(now) {
                    master::Action::Transmit(bytes) => {
                        if frame::parse(bytes).is_ok_and(|frame| frame.kind == CYCLE) {
                            sent.push((now, bytes.len()));
                        }
                        return Some(Drive::Transmit(bytes.to_vec()));
                    }
                    master::Action::Jam(bytes) => {
                        // What collided was no cycle's frame yet.
                        sent.pop();
                        return Some(Drive::Jam(bytes.to_vec()));
                    }
                    master::Action::Reported { .. } => *reports += 1,
                    master::Action::Idle => return None,
                    _ => {}
                }
            },
            Self::Module { node, module, step } => {
                while *step <= now {
                    let input = Input { encoder: Ok(POSITION), amplifier_fault: false, now: *step };
                    if let Some(event) = module.step(input).event {
                        node.event(event);
                    }
                    *step += LOOP;
                }
                match node.poll(now, &mut **module) {
                    node::Action::Transmit(bytes) => Some(Drive::Transmit(bytes.to_vec())),
                    node::Action::Jam(bytes) => Some(Drive::Jam(bytes.to_vec())),
                    node::Action::Idle => None,
                }
            }
        }
    }

    fn poll_at(&self) -> Option<Instant> {
        match self {
            Self::Gateway { master, .. } => master.poll_at(),
            Self::Module { node, step, .. } => [node.poll_at(), Some(*step)].into_iter().flatten().min(),
        }
    }
}

/// The kind of a cycle's frame.
const CYCLE: puente_framed::Kind = puente_framed::Kind::Single(puente_framed::Class::Data);

/// The line of all rows.
pub fn settings() -> Result<Settings, String> {
    let format = "8N1".parse().map_err(|error| format!("{error}"))?;
    Ok(Settings { baud: 1_000_000, format })
}

/// Lets the gateways have their axes follow, and measures for `time`.
pub fn measure(gateways: &[Gateway], time: Duration) -> Result<Measured, String> {
    let settings = settings()?;
    let station = |address| station::Config::new(address, settings, 64);
    let mut line = Line::new(settings, station(1).arbiter.gap, 0.0, 1);
    let now = line.now();
    for (address, gateway) in (1..).zip(gateways) {
        let axes = (0..gateway.axes).map(|axis| Axis { address: gateway.first + axis, form: gateway.form });
        let config = master::Config { station: station(address), cycle: gateway.cycle };
        let master = Box::new(Master::new(config, axes, now, u64::from(address) * 7_919));
        line.join(Side::Gateway { master, sent: Vec::new(), reports: 0 }, Place::new(settings));
    }
    for gateway in gateways {
        for address in gateway.first..gateway.first + gateway.axes {
            let config = node::Config { station: station(address), form: gateway.form };
            let encoder = Encoder::Binary(Width::W32);
            let config_of_loop = pid::Config { rate: 1_000, ..pid::Config::new(encoder) };
            let module = pid::Module::new(config_of_loop).map_err(|error| error.to_string())?;
            let node = Box::new(Node::new(config, now, u64::from(address) * 104_729));
            line.join(Side::Module { node, module: Box::new(module), step: now }, Place::new(settings));
        }
    }
    for (after, control) in [(0, Control::Observe), (100, Control::Hold), (100, Control::Follow)] {
        run(&mut line, Duration::from_millis(after))?;
        for (seat, gateway) in gateways.iter().enumerate() {
            want(&mut line, seat, gateway.axes, control)?;
        }
    }
    let left = SETTLE.saturating_sub(line.now().since(now));
    run(&mut line, left)?;
    let before: Vec<_> = (0..gateways.len()).map(|seat| counts(&mut line, seat)).collect();
    let characters = line.totals().characters;
    run(&mut line, time)?;
    let characters = line.totals().characters - characters;
    for side in line.nodes() {
        if let Side::Module { module, .. } = side
            && module.status().state != State::Enabled
        {
            return Err(format!("a module is {}", module.status().state));
        }
    }
    let each = before.into_iter().enumerate();
    let gateways = each.map(|(seat, before)| figures(&line, seat, before)).collect::<Result<_, _>>()?;
    Ok(Measured { gateways, share: settings.wire_time(characters as usize).div_duration_f64(time) })
}

fn run(line: &mut Line<Side>, time: Duration) -> Result<(), String> {
    let until = line.now() + time;
    line.run_until(until).map_err(|violation| violation.to_string())
}

/// What a gateway wants of all its axes.
fn want(line: &mut Line<Side>, seat: usize, axes: u8, control: Control) -> Result<(), String> {
    let [kp, ki, kd] = GAINS;
    let gains = Gains::new(kp, ki, kd).map_err(|error| error.to_string())?;
    if let Side::Gateway { master, .. } = line.tell(seat) {
        for axis in 0..usize::from(axes) {
            master.set(axis, Output { control, gains, set_point: POSITION as i32 });
        }
    }
    Ok(())
}

/// Begins to count anew.
fn counts(line: &mut Line<Side>, seat: usize) -> Statistics {
    match line.tell(seat) {
        Side::Gateway { master, sent, reports } => {
            sent.clear();
            *reports = 0;
            master.statistics()
        }
        Side::Module { .. } => Statistics::default(),
    }
}

fn figures(line: &Line<Side>, seat: usize, before: Statistics) -> Result<Figures, String> {
    let Side::Gateway { master, sent, reports } = line.node(seat) else {
        return Err("no gateway".into());
    };
    let after = master.statistics();
    let [(first, _), .., (last, update)] = sent[..] else {
        return Err("too few cycles".into());
    };
    let periods = sent.windows(2).map(|pair| pair[1].0.since(pair[0].0));
    Ok(Figures {
        mean: last.since(first) / (sent.len() - 1) as u32,
        longest: periods.max().unwrap_or_default(),
        cycles: sent.len(),
        update,
        reports: *reports as f64 / sent.len() as f64,
        collisions: after.line.collisions - before.line.collisions,
        overruns: after.overruns - before.overruns,
        missed: after.missed - before.missed,
    })
}
