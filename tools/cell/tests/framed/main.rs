//! The framed cell on a mock clock: modules that a station outside commands.

mod faults;
mod motion;
mod stations;

use std::time::Duration;

use puente_cell::framed::{Cell, Config};
use puente_drives::pid::{Event, State};
use puente_framed::arbiter::{Precedence, Statistics};
use puente_framed::frame::MAX_FRAME;
use puente_framed::station::{self, Action};
use puente_framed::{Class, Kind, Station, section};
use puente_line::{Instant, Settings};
use puente_modules::{Control, Form, Order, Report, Setting, event};

/// The gains of examples/tx8.toml.
pub const GAINS: [f32; 3] = [1e-3, 0.0, 2e-6];

pub fn line() -> Settings {
    Settings { baud: 1_000_000, format: "8N1".parse().expect("a format") }
}

/// Three modules, whose manners are watched.
pub fn config() -> Config {
    Config { judged: true, ..Config::new(line(), &[17, 18, 19]) }
}

/// What a commander wants of a module.
pub fn order(control: Control, set_point: i32) -> Setting {
    let [kp, ki, kd] = GAINS;
    Setting { kp, ki, kd, set_point: set_point as f32, order: Some(Order { control, ask: true }) }
}

/// A cell, and a station at one of its ports that says what it wants of its modules every 4 ms.
pub struct Rig {
    pub cell: Cell,
    pub wants: Vec<(u8, Setting)>,
    pub form: Form,
    /// Of the modules, in the order in which they come.
    pub reports: Vec<(u8, Report)>,
    pub events: Vec<(u8, Event)>,
    /// It says nothing any more, as one whose process was killed.
    pub dead: bool,
    port: usize,
    station: Station<4, 4, 4, 8, MAX_FRAME>,
    next: Instant,
    now: Instant,
}

impl Rig {
    const CYCLE: Duration = Duration::from_millis(4);
    /// How late it hears and talks.
    const STEP: Duration = Duration::from_micros(20);

    pub fn new(config: Config) -> Self {
        Self::at(config, 0)
    }

    fn at(config: Config, port: usize) -> Self {
        let own = station::Config::new(port as u8 + 1, config.manners.line, MAX_FRAME);
        let own = station::Config { arbiter: config.manners, ..own };
        let form = config.modules.first().map_or(Form::Text, |module| module.form);
        Self {
            cell: Cell::new(config).expect("a cell"),
            wants: Vec::new(),
            form,
            reports: Vec::new(),
            events: Vec::new(),
            dead: false,
            port,
            station: Station::new(own, Instant::ZERO, 7),
            next: Instant::ZERO,
            now: Instant::ZERO,
        }
    }

    /// Wants the same of some modules from now on.
    pub fn want(&mut self, addresses: &[u8], setting: Setting) {
        for address in addresses {
            self.wants.retain(|(known, _)| known != address);
            self.wants.push((*address, setting));
        }
    }

    /// Lets time pass.
    pub fn pass(&mut self, time: Duration) {
        let until = self.now + time;
        while self.now < until {
            self.now += Self::STEP;
            let heard = self.cell.poll(self.port, self.now).unwrap_or_default();
            if self.dead {
                continue;
            }
            for byte in heard {
                self.station.receive(self.now, byte);
                self.act();
            }
            if self.now >= self.next && self.station.is_free() && !self.wants.is_empty() {
                self.next = self.now + Self::CYCLE;
                self.ask();
            }
            self.act();
        }
    }

    fn ask(&mut self) {
        let (wants, form) = (&self.wants, self.form);
        let posted =
            self.station.post_with(self.now, Precedence::Ordinary, Kind::Single(Class::Data), |body| {
                for (address, setting) in wants {
                    section::push(body, *address, &setting.emit(form).expect("it can be written"))?;
                }
                Ok(())
            });
        posted.expect("it is free");
    }

    fn act(&mut self) {
        loop {
            match self.station.poll(self.now) {
                Action::Transmit(_) => {
                    let bytes = self.station.sent().to_vec();
                    self.cell.receive(self.port, self.now, &bytes);
                }
                Action::Jam(bytes) => {
                    self.cell.discard(self.port, self.now);
                    self.cell.receive(self.port, self.now, bytes);
                }
                Action::Heard(frame) if frame.kind == Kind::Single(Class::Status) => {
                    let section = frame.section_for(self.port as u8 + 1).expect("for this station");
                    self.reports.push((frame.origin, Report::parse(section.data).expect("a report")));
                }
                Action::Received { from, body, .. } => {
                    let data = &body[2..body.len() - 1];
                    self.events.push((from, event::parse(data).expect("an event")));
                }
                Action::Idle => return,
                _ => {}
            }
        }
    }

    pub fn milliseconds(&mut self, count: u64) {
        self.pass(Duration::from_millis(count));
    }

    /// The modules are under current, held, and this station commands them.
    pub fn enable(&mut self, addresses: &[u8]) {
        self.want(addresses, order(Control::Observe, 0));
        self.milliseconds(20);
        self.want(addresses, order(Control::Hold, 0));
        self.milliseconds(60);
        self.reports.clear();
        for address in addresses {
            assert_eq!(self.state(*address), State::Held, "{address}");
        }
    }

    /// As a module has reported it last.
    pub fn report(&self, address: u8) -> Report {
        let reports = self.reports.iter().rev();
        reports.into_iter().find(|(from, _)| *from == address).expect("a report").1
    }

    pub fn state(&self, address: u8) -> State {
        self.cell.module(address).expect("a module").status().state
    }

    /// Where the plant is, in counts.
    pub fn position(&self, address: u8) -> f64 {
        self.cell.module(address).expect("a module").plant().position()
    }

    pub fn velocity(&self, address: u8) -> f64 {
        self.cell.module(address).expect("a module").plant().velocity()
    }

    pub fn statistics(&self) -> Statistics {
        self.station.statistics()
    }
}
