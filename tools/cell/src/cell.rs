//! The cell: drives on a line.

use std::collections::BTreeMap;
use std::time::Duration;

use puente_line::{Instant, Settings};
use puente_modbus::server::Decoder;
use puente_modbus::{Mode, Pdu, rtu};

use crate::answer::answer;
use crate::drive::{Drive, DriveConfig};
use crate::fault::{self, Fault, Random};
use crate::line::{Arrivals, Departures, Pace};
use crate::log::{Event, Log};

/// A cell to be simulated.
#[derive(Clone, Debug)]
pub struct Config {
    /// Baud rate and character format.
    pub line: Settings,
    /// RTU or ASCII.
    pub mode: Mode,
    /// The drives. Of two with the same address, the later one counts.
    pub drives: Vec<DriveConfig>,
    /// From the last byte of a request to the first of its reply. On a paced RTU line at least t3.5.
    pub reply_delay: Duration,
    /// Whether characters take their time on the wire, in both directions.
    pub paced: bool,
    /// Whether the master hears what it sends, as on two wires with the receiver left on.
    pub echo: bool,
    /// Seed of what is random in faults.
    pub seed: u64,
}

impl Config {
    /// Drives with default profiles on a paced line without echo. They answer after 8 ms, which is what the thesis'
    /// 45 ms for an exchange leave beside the wire time.
    pub fn new(mode: Mode, line: Settings, addresses: &[u8]) -> Self {
        Self {
            line,
            mode,
            drives: addresses.iter().map(|address| DriveConfig::new(*address)).collect(),
            reply_delay: Duration::from_millis(8),
            paced: true,
            echo: false,
            seed: 1,
        }
    }
}

#[derive(Debug)]
struct Station {
    drive: Drive,
    fault: Fault,
}

/// Drives on a line.
///
/// Time never goes back: a `now` earlier than the latest one counts as the latest one.
pub struct Cell {
    mode: Mode,
    echo: bool,
    reply_delay: Duration,
    /// t3.5 on an RTU line.
    silence: Duration,
    decoder: Decoder,
    arrivals: Arrivals,
    departures: Departures,
    stations: BTreeMap<u8, Station>,
    random: Random,
    log: Log,
    now: Instant,
}

impl Cell {
    /// A cell right after power-up, at the start of the clock.
    pub fn new(config: Config) -> Self {
        let pace = Pace { line: config.line, paced: config.paced };
        let silence = match config.mode {
            Mode::Rtu => rtu::t3_5(config.line),
            Mode::Ascii => Duration::ZERO,
        };
        let least = if config.paced { silence } else { Duration::ZERO };
        let station = |drive: &DriveConfig| Station { drive: Drive::new(drive), fault: Fault::None };
        Self {
            mode: config.mode,
            echo: config.echo,
            reply_delay: config.reply_delay.max(least),
            silence,
            decoder: Decoder::new(config.mode, config.line),
            arrivals: Arrivals::new(pace),
            departures: Departures::new(pace, least),
            stations: config.drives.iter().map(|drive| (drive.address, station(drive))).collect(),
            random: Random(config.seed),
            log: Log::default(),
            now: Instant::ZERO,
        }
    }

    /// Takes bytes that the master starts to send now.
    pub fn receive(&mut self, now: Instant, bytes: &[u8]) {
        self.run(now);
        let start = self.arrivals.push(self.now, bytes);
        if self.echo {
            self.departures.send(start, bytes.to_vec());
        }
        self.run(now);
    }

    /// The bytes that the master has got since the last call; `None` for none.
    pub fn poll(&mut self, now: Instant) -> Option<Vec<u8>> {
        self.run(now);
        let bytes = self.departures.poll(self.now, &mut self.log);
        (!bytes.is_empty()).then_some(bytes)
    }

    /// When to poll again; `None` while nothing is under way. Drives need no polling to move.
    pub fn poll_at(&self) -> Option<Instant> {
        let pending = [self.arrivals.last_at(), self.decoder.poll_at(), self.departures.poll_at()];
        pending.into_iter().flatten().min()
    }

    /// The drive at `address`, in its state at the latest `now`.
    pub fn drive(&self, address: u8) -> Option<&Drive> {
        self.stations.get(&address).map(|station| &station.drive)
    }

    /// As [`Cell::drive`], to change it.
    pub fn drive_mut(&mut self, address: u8) -> Option<&mut Drive> {
        self.stations.get_mut(&address).map(|station| &mut station.drive)
    }

    /// Makes requests to `address` go wrong from now on; false where there is no such drive.
    pub fn set_fault(&mut self, address: u8, fault: Fault) -> bool {
        let station = self.stations.get_mut(&address);
        station.map(|station| station.fault = fault).is_some()
    }

    /// The last requests, oldest first: the moment of the last byte, the address and the PDU.
    pub fn log(&self) -> impl Iterator<Item = (Instant, u8, &[u8])> {
        self.events().filter_map(|(at, event)| match event {
            Event::Request { unit, pdu } => Some((*at, *unit, pdu.as_slice())),
            _ => None,
        })
    }

    /// The last events on the line, oldest first.
    pub fn events(&self) -> impl Iterator<Item = &(Instant, Event)> {
        self.log.iter()
    }

    /// As [`Cell::events`], and forgets them.
    pub fn take_events(&mut self) -> impl Iterator<Item = (Instant, Event)> + use<> {
        self.log.take()
    }

    /// Lets everything happen that is due by `now`, each at its own moment.
    fn run(&mut self, now: Instant) {
        self.now = self.now.max(now);
        loop {
            let byte = self.arrivals.next_at().filter(|at| *at <= self.now);
            let timer = self.decoder.poll_at().filter(|at| *at <= self.now);
            match (byte, timer) {
                (Some(at), timer) if timer.is_none_or(|timer| at <= timer) => {
                    if let Some(byte) = self.arrivals.pop() {
                        self.decoder.receive(at, &[byte]);
                    }
                    self.decode(at);
                }
                (_, Some(at)) if self.decode(at) || self.decoder.poll_at() != timer => {}
                _ => break,
            }
        }
        for station in self.stations.values_mut() {
            station.drive.advance(self.now);
        }
    }

    /// Executes the requests that are complete; whether there was any frame, good or bad.
    fn decode(&mut self, at: Instant) -> bool {
        let mut any = false;
        while let Some(frame) = self.decoder.poll(at) {
            any = true;
            match frame {
                Ok(frame) => self.request(at, frame.unit, frame.pdu),
                Err(error) => self.log.push(at, Event::NoFrame(error)),
            }
        }
        any
    }

    fn request(&mut self, at: Instant, unit: u8, pdu: Pdu) {
        self.log.push(at, Event::Request { unit, pdu: pdu.to_vec() });
        if unit == 0 {
            self.broadcast(at, &pdu);
        } else if let Some(station) = self.stations.get_mut(&unit) {
            let fault = station.fault.take();
            let Some(reply) = station.execute(at, &fault, &pdu) else { return };
            let sent =
                fault::transmissions(&fault, self.mode, unit, &pdu, &reply, self.silence, &mut self.random);
            for transmission in sent {
                self.departures.send(at + self.reply_delay + transmission.extra, transmission.bytes);
            }
        }
    }

    fn broadcast(&mut self, at: Instant, pdu: &Pdu) {
        for station in self.stations.values_mut() {
            let fault = station.fault.peek().clone();
            station.execute(at, &fault, pdu);
        }
    }
}

impl Station {
    /// The reply that the drive means to give; `None` where it hears nothing.
    fn execute(&mut self, at: Instant, fault: &Fault, pdu: &Pdu) -> Option<Pdu> {
        match *fault {
            Fault::Silent => None,
            Fault::Exception(code) => {
                let function = pdu.first().copied().unwrap_or(0) | 0x80;
                Some([function, code].into_iter().collect())
            }
            _ => {
                self.drive.advance(at);
                Some(answer(&mut self.drive, pdu))
            }
        }
    }
}
