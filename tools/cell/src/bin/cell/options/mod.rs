//! The command line.

mod canopen;
pub mod help;
mod values;

pub use canopen::{CanopenOptions, fault};

use std::time::Duration;

use lexopt::{Arg, Parser, ValueExt};
use puente_cell::framed::{self, Disturbance};
use puente_cell::live::Place;
use puente_cell::{Config, Fault};
use puente_framed::arbiter::Policy;
use puente_line::{Format, Settings};
use puente_modbus::{Mode, rtu};
use puente_modules::Form;

/// What the command line asks for.
#[derive(Debug)]
pub enum Options {
    /// The text of [`help`].
    Help,
    /// A Modbus line.
    Modbus(ModbusOptions),
    /// A framed line.
    Framed(FramedOptions),
    /// A CAN bus.
    Canopen(CanopenOptions),
}

/// A Modbus line.
#[derive(Debug)]
pub struct ModbusOptions {
    pub config: Config,
    pub faults: Vec<(u8, Fault)>,
    pub port: Place,
    pub log: Option<String>,
}

/// A framed line.
#[derive(Debug)]
pub struct FramedOptions {
    pub config: framed::Config,
    pub disturbances: Vec<Disturbance>,
    pub ports: Vec<Place>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Protocol {
    Modbus(Mode),
    Framed,
}

/// Options of a Modbus line alone, and of a framed one.
const OF_MODBUS: [&str; 7] = ["units", "reply-delay-ms", "unpaced", "echo", "max-read", "fault", "log"];
const OF_FRAMED: [&str; 10] =
    ["module", "payload", "ipg", "slot", "policy", "no-echo", "rivals", "load", "noise", "disturb"];

/// What was given.
#[derive(Default)]
struct Given {
    names: Vec<String>,
    places: Vec<Place>,
    protocol: Option<Protocol>,
    baud: Option<u32>,
    format: Option<Format>,
    seed: Option<u64>,
    units: Option<Vec<u8>>,
    reply_delay_ms: Option<u64>,
    max_read: Option<u16>,
    faults: Vec<(u8, Fault)>,
    log: Option<String>,
    payload: Option<Form>,
    ipg: Option<usize>,
    slot: Option<usize>,
    policy: Option<Policy>,
    rivals: Option<u8>,
    load: Option<f64>,
    noise: Option<f64>,
    disturbances: Vec<Disturbance>,
}

impl Options {
    /// Reads the command line.
    pub fn parse(mut arguments: Parser) -> Result<Self, lexopt::Error> {
        // `canopen` is a word of its own, before all options.
        let word = arguments.try_raw_args().and_then(|mut raw| raw.next_if(|word| word == "canopen"));
        if word.is_some() {
            return Ok(CanopenOptions::parse(arguments)?.map_or(Self::Help, Self::Canopen));
        }
        let Some(given) = Given::parse(arguments)? else {
            return Ok(Self::Help);
        };
        match given.protocol.unwrap_or(Protocol::Modbus(Mode::Ascii)) {
            Protocol::Modbus(mode) => given.modbus(mode).map(Self::Modbus),
            Protocol::Framed => given.framed().map(Self::Framed),
        }
    }
}

impl Given {
    /// `None` when help is asked for.
    fn parse(mut arguments: Parser) -> Result<Option<Self>, lexopt::Error> {
        let mut given = Self::default();
        while let Some(argument) = arguments.next()? {
            let Arg::Long(name) = argument else { return Err(argument.unexpected()) };
            let name = name.to_string();
            if name == "help" {
                return Ok(None);
            }
            given.take(&name, &mut arguments)?;
            given.names.push(name);
        }
        Ok(Some(given))
    }

    /// Reads the value of an option, where it has one.
    fn take(&mut self, name: &str, value: &mut Parser) -> Result<(), lexopt::Error> {
        match name {
            "pty" => self.places.push(Place::Pty(value.value()?.string()?)),
            "listen" | "tcp" => self.places.push(Place::Listen(value.value()?.string()?)),
            "device" => self.places.push(Place::Device(value.value()?.string()?)),
            "framed" => self.protocol = Some(Protocol::Framed),
            "protocol" => self.protocol = Some(value.value()?.parse_with(values::protocol)?),
            "baud" => self.baud = Some(value.value()?.parse_with(values::in_range(1, 10_000_000))?),
            "format" => self.format = Some(value.value()?.parse_with(values::format)?),
            "seed" => self.seed = Some(value.value()?.parse()?),
            "unpaced" | "echo" | "no-echo" => {}
            "units" | "module" => self.units = Some(value.value()?.parse_with(values::addresses)?),
            "reply-delay-ms" => self.reply_delay_ms = Some(value.value()?.parse()?),
            "max-read" => self.max_read = Some(value.value()?.parse_with(values::in_range(1, 125))?),
            "fault" => self.faults.push(value.value()?.parse_with(values::unit_fault)?),
            "log" => self.log = Some(value.value()?.string()?),
            "payload" => self.payload = Some(value.value()?.parse_with(values::form)?),
            "ipg" => self.ipg = Some(value.value()?.parse_with(values::in_range(1, 1_000))?),
            "slot" => self.slot = Some(value.value()?.parse_with(values::in_range(1, 1_000))?),
            "policy" => self.policy = Some(value.value()?.parse_with(values::policy)?),
            "rivals" => self.rivals = Some(value.value()?.parse_with(values::in_range(0, 32))?),
            "load" => self.load = Some(value.value()?.parse_with(values::in_range(0.0, 4.0))?),
            "noise" => self.noise = Some(value.value()?.parse_with(values::in_range(0.0, 0.1))?),
            "disturb" => self.disturbances.push(value.value()?.parse()?),
            _ => return Err(Arg::Long(name).unexpected()),
        }
        Ok(())
    }

    fn has(&self, name: &str) -> bool {
        self.names.iter().any(|given| given == name)
    }

    /// Refuses what belongs to the other kind of line.
    fn only(&self, others: &[&str], kind: &str) -> Result<(), lexopt::Error> {
        match others.iter().find(|name| self.has(name)) {
            None => Ok(()),
            Some(name) => Err(format!("--{name} is of a {kind} line").into()),
        }
    }

    fn line(&self, baud: u32, format: &str) -> Result<Settings, lexopt::Error> {
        let format = self.format.map_or_else(|| values::format(format), Ok)?;
        Ok(Settings { baud: self.baud.unwrap_or(baud), format })
    }

    fn modbus(self, mode: Mode) -> Result<ModbusOptions, lexopt::Error> {
        self.only(&OF_FRAMED, "framed")?;
        let line = self.line(9_600, "8O1")?;
        let (paced, echo) = (!self.has("unpaced"), self.has("echo"));
        let [port] = <[Place; 1]>::try_from(self.places).map_err(|places| match places[..] {
            [] => "say where: --pty, --listen or --device",
            _ => "only one of --pty, --listen and --device is possible",
        })?;
        let units = self.units.unwrap_or(vec![1, 2, 3]);
        let reply_delay = Duration::from_millis(self.reply_delay_ms.unwrap_or(8));
        let seed = self.seed.unwrap_or(1);
        let mut config = Config { reply_delay, paced, echo, seed, ..Config::new(mode, line, &units) };
        for drive in &mut config.drives {
            drive.profile.max_read = self.max_read.unwrap_or(drive.profile.max_read);
        }
        if matches!(port, Place::Device(_)) {
            // The wire itself takes its time; only the silence before a reply is left to keep.
            config.paced = false;
            if mode == Mode::Rtu {
                config.reply_delay = config.reply_delay.max(rtu::t3_5(line));
            }
        }
        Ok(ModbusOptions { config, faults: self.faults, port, log: self.log })
    }

    fn framed(self) -> Result<FramedOptions, lexopt::Error> {
        self.only(&OF_MODBUS, "Modbus")?;
        let line = self.line(1_000_000, "8N1")?;
        if self.places.iter().any(|place| matches!(place, Place::Device(_))) {
            return Err("--device is of a Modbus line: a framed one takes all its time itself".into());
        }
        if self.places.is_empty() {
            return Err("say where: --pty or --tcp, once for each station that is connected".into());
        }
        let modules = self.units.as_deref().unwrap_or(&[17, 18, 19]);
        let mut config = framed::Config::new(line, modules);
        let manners = &mut config.manners;
        if let Some(ipg) = self.ipg {
            manners.gap = line.wire_time(ipg);
        }
        if let Some(slot) = self.slot {
            (manners.slot, manners.rest) = (line.wire_time(slot), line.wire_time(slot));
        }
        manners.policy = self.policy.unwrap_or(manners.policy);
        for module in &mut config.modules {
            module.form = self.payload.unwrap_or_default();
        }
        config.ports = self.places.len();
        config.echo = !self.has("no-echo");
        config.rivals = self.rivals.unwrap_or(0);
        config.load = self.load.unwrap_or(0.2);
        config.noise = self.noise.unwrap_or(0.0);
        config.seed = self.seed.unwrap_or(1);
        Ok(FramedOptions { config, disturbances: self.disturbances, ports: self.places })
    }
}

#[cfg(test)]
mod tests;
