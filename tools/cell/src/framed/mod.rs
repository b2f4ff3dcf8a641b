//! A framed line with PID modules, each on an axis of the [table](crate::table), with rivals, noise and faults. Its ports are
//! the ends of stations outside, such as gateways.
//!
//! Sans-io as [`crate::Cell`] is: bytes and the time go in, bytes come out, and everything follows from these calls and from
//! [`Config::seed`]. Each port hears all that is on the line, its own bytes too, at the end of each character.
//!
//! ```
//! use puente_cell::framed::{Cell, Config};
//! use puente_line::{Instant, Settings};
//!
//! let line = Settings { baud: 1_000_000, format: "8N1".parse().unwrap() };
//! let mut cell = Cell::new(Config { ports: 2, ..Config::new(line, &[17, 18, 19]) }).unwrap();
//! cell.receive(0, Instant::from_micros(100), b"hello");
//! // 10 us a character, after the transceiver has turned round.
//! assert_eq!(cell.poll(1, Instant::from_micros(133)).unwrap(), b"hel");
//! ```

mod disturbance;
mod module;
mod station;

use std::time::Duration;

pub use disturbance::{BadDisturbance, Disturbance, Encoder, Trouble, WORDS};
pub use module::{Module, ModuleConfig};
use puente_drives::pid::BadConfig;
use puente_framed::arbiter::{self, Echo};
use puente_line::{Instant, Settings};
use puente_shared_line::external::External;
use puente_shared_line::faulty::Babbler;
use puente_shared_line::talker::{Load, Talker, frame_of};
use puente_shared_line::{Line, Place, Totals};
use station::Station;

/// The address of the first rival; the others have the next ones.
pub const FIRST_RIVAL: u8 = 201;
/// Whom the rivals talk to: nobody.
const NOBODY: u8 = 254;
/// Bytes of a rival's frame, as of the shortest of the thesis.
const RIVAL_FRAME: usize = 51;
/// A rival with next to nothing to say says it once in such a time.
const RARELY: Duration = Duration::from_secs(3_600);
/// Bytes that a station outside may have sent ahead; more are lost.
const AHEAD: usize = 65_536;

/// A framed line to be simulated.
#[derive(Clone, Debug)]
pub struct Config {
    /// The line, and the manners of all stations on it.
    pub manners: arbiter::Config,
    /// The modules.
    pub modules: Vec<ModuleConfig>,
    /// Stations outside.
    pub ports: usize,
    /// Whether they hear themselves.
    pub echo: bool,
    /// Stations that only talk to each other.
    pub rivals: u8,
    /// What the rivals offer together, in bits per bit of the line.
    pub load: f64,
    /// Probability that a station hears a bit wrong.
    pub noise: f64,
    /// Seed of all that is random.
    pub seed: u64,
    /// Whether it panics where a module or a rival breaks the rules of the line; for tests of those.
    pub judged: bool,
}

impl Config {
    /// Modules with default profiles, one station outside, no rivals, no noise.
    pub fn new(line: Settings, addresses: &[u8]) -> Self {
        Self {
            manners: arbiter::Config::new(line),
            modules: addresses.iter().map(|address| ModuleConfig::new(*address)).collect(),
            ports: 1,
            echo: true,
            rivals: 0,
            load: 0.0,
            noise: 0.0,
            seed: 1,
            judged: false,
        }
    }
}

/// A framed line with its stations.
///
/// Time never goes back: a `now` earlier than the latest one counts as the latest one.
pub struct Cell {
    line: Line<Station>,
    manners: arbiter::Config,
    judged: bool,
    seed: u64,
    /// Address and seat of each module, then of each rival.
    modules: Vec<(u8, usize)>,
    rivals: Vec<(u8, usize)>,
    babbler: usize,
    ports: Vec<usize>,
}

impl Cell {
    /// A cell right after power-up, at the start of the clock.
    ///
    /// # Errors
    /// A module's setting that is out of its range.
    pub fn new(config: Config) -> Result<Self, BadConfig> {
        // Whoever is outside may not hear himself; those inside do, and at once.
        let manners = arbiter::Config { echo: Echo::Compared, latency: Duration::ZERO, ..config.manners };
        let mut line = Line::new(manners.line, manners.gap, config.noise, config.seed);
        let inside = Place { judged: config.judged, ..Place::new(manners.line) };
        let outside = Place { judged: false, echo: config.echo, ..inside };
        let seed = |number: usize| config.seed.wrapping_mul(0x9E37_79B9).wrapping_add(number as u64);
        let mut modules = Vec::new();
        for module in &config.modules {
            let address = module.address;
            let module = Module::new(module.clone(), manners, seed(line.nodes().count()))?;
            modules.push((address, line.join(Station::Module(Box::new(module)), inside)));
        }
        let mut rivals = Vec::new();
        for address in (FIRST_RIVAL..NOBODY).take(config.rivals.into()) {
            let frame = frame_of(address, NOBODY, RIVAL_FRAME);
            let talker = Talker::new(manners, frame, Load::Nothing, seed(line.nodes().count()));
            rivals.push((address, line.join(Station::Rival(Box::new(talker)), inside)));
        }
        let silent = Babbler::new(manners.line, Instant::ZERO, Instant::ZERO, 0);
        let babbler = line.join(Station::Babbler(silent), outside);
        let ports = (0..config.ports).map(|_| line.join(Station::Outside(External::default()), outside));
        let ports = ports.collect();
        let mut cell =
            Self { line, manners, judged: config.judged, seed: config.seed, modules, rivals, babbler, ports };
        cell.set_load(config.load);
        Ok(cell)
    }

    /// Takes bytes that the station at a port starts to send now.
    pub fn receive(&mut self, port: usize, now: Instant, bytes: &[u8]) {
        self.run(now);
        let room = AHEAD.saturating_sub(self.ports.get(port).map_or(AHEAD, |seat| self.line.pending(*seat)));
        if let Some(outside) = self.outside(port) {
            outside.say(&bytes[..bytes.len().min(room)]);
        }
        self.run(now);
    }

    /// Drops what the station at a port has sent and is not on the line yet.
    pub fn discard(&mut self, port: usize, now: Instant) {
        self.run(now);
        if let Some(outside) = self.outside(port) {
            outside.discard();
        }
        self.run(now);
    }

    /// What the station at a port has heard since the last call; `None` for nothing.
    pub fn poll(&mut self, port: usize, now: Instant) -> Option<Vec<u8>> {
        self.run(now);
        let Station::Outside(outside) = self.line.node_mut(*self.ports.get(port)?) else {
            return None;
        };
        let heard = outside.take();
        (!heard.is_empty()).then_some(heard)
    }

    /// Whether a character is arriving at a port.
    pub fn carrier(&mut self, port: usize, now: Instant) -> bool {
        self.run(now);
        self.ports.get(port).is_some_and(|seat| self.line.carrier(*seat))
    }

    /// When to poll again.
    pub fn poll_at(&self) -> Option<Instant> {
        self.line.poll_at()
    }

    /// Lets everything happen that is due by `now`, each at its own moment.
    pub fn run(&mut self, now: Instant) {
        if let Err(violation) = self.line.run_until(now) {
            panic!("{violation}");
        }
        let now = self.line.now();
        for (_, seat) in &self.modules {
            if let Station::Module(module) = self.line.node_mut(*seat) {
                module.advance(now);
            }
        }
    }

    /// The module at `address`, as of the latest `now`.
    pub fn module(&self, address: u8) -> Option<&Module> {
        let (_, seat) = self.modules.iter().find(|(own, _)| *own == address)?;
        match self.line.node(*seat) {
            Station::Module(module) => Some(module),
            _ => None,
        }
    }

    /// The modules, with their addresses.
    pub fn modules(&self) -> impl Iterator<Item = (u8, &Module)> {
        self.modules.iter().filter_map(|(address, _)| Some((*address, self.module(*address)?)))
    }

    /// What has been on the line.
    pub fn totals(&self) -> Totals {
        self.line.totals()
    }

    /// Lets something go wrong from now on, or mends it; false where there is no such station, or it is no module and
    /// should be one.
    pub fn disturb(&mut self, now: Instant, disturbance: Disturbance) -> bool {
        self.run(now);
        match disturbance {
            Disturbance::Noise(probability) => self.line.set_noise(probability),
            Disturbance::Load(load) => self.set_load(load),
            Disturbance::Babble(time) => {
                let now = self.line.now();
                self.seed = self.seed.wrapping_add(1);
                let babbler = Babbler::new(self.manners.line, now, now + time, self.seed);
                *self.line.tell(self.babbler) = Station::Babbler(babbler);
            }
            Disturbance::Station(address, trouble) => return self.trouble(address, trouble),
        }
        true
    }

    fn trouble(&mut self, address: u8, trouble: Trouble) -> bool {
        let mut stations = self.modules.iter().chain(&self.rivals);
        let Some(&(_, seat)) = stations.find(|(own, _)| *own == address) else {
            return false;
        };
        match (trouble, self.line.tell(seat)) {
            (Trouble::Mute(mute), _) => self.line.place(seat).mute = mute,
            (Trouble::Deaf(deaf), _) => {
                let place = self.line.place(seat);
                place.deaf = deaf;
                // It cannot know.
                place.judged = self.judged && !deaf;
            }
            (trouble, Station::Module(module)) => module.suffer(trouble),
            _ => return false,
        }
        true
    }

    fn set_load(&mut self, load: f64) {
        let line = self.manners.line;
        let bits = RIVAL_FRAME as f64 * f64::from(line.format.bits());
        let each = load / self.rivals.len().max(1) as f64;
        let pause = Duration::try_from_secs_f64(bits / f64::from(line.baud) / each);
        let load = pause.map_or(Load::Nothing, |pause| Load::Offered(pause.min(RARELY)));
        let now = self.line.now();
        for (_, seat) in &self.rivals {
            if let Station::Rival(talker) = self.line.tell(*seat) {
                talker.set_load(now, load);
            }
        }
    }

    fn outside(&mut self, port: usize) -> Option<&mut External> {
        match self.line.tell(*self.ports.get(port)?) {
            Station::Outside(outside) => Some(outside),
            _ => None,
        }
    }
}
