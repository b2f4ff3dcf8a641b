//! The command line.

use std::str::FromStr;
use std::time::Duration;

use lexopt::{Arg, Parser, ValueExt};
use puente_cell::live::Place;
use puente_cell::{Config, Fault};
use puente_line::{BadFormat, Format, Parity, Settings};
use puente_modbus::{Mode, rtu};

pub const HELP: &str = "\
Simulated EDB servo drives as Modbus slaves.

cell [OPTIONS] (--pty LINK | --listen HOST:PORT | --device TTY)

  --pty LINK            a pseudo terminal, with a symbolic link to it
  --listen HOST:PORT    raw bytes over TCP, one client at a time
  --device TTY          a serial device
  --protocol NAME       modbus-ascii (default) or modbus-rtu
  --baud N              default 9600
  --format F            default 8O1
  --units LIST          addresses of the drives, as in 1,2,5-8; default 1,2,3
  --reply-delay-ms N    from request to reply; default 8
  --unpaced             characters take no time on the wire
  --echo                the master hears what it sends
  --max-read N          most registers of one read; default 20, as the drives
  --fault UNIT=FAULT    silent, lost, late:MS, corrupt, wrong-unit, wrong-function, wrong-byte-count, other-quantity,
                        truncated, echo, garbage-before, garbage-after, duplicate, exception:CODE; *N behind it for the
                        next N requests only; may be repeated for other units
  --seed N              seed of what is random in faults; default 1
  --log FILE            a line a frame: microseconds, direction, bytes; - for the standard output
  --help

Prints one line that begins with 'ready' once it can be used.
";

/// What the command line asks for.
#[derive(Debug)]
pub struct Options {
    pub config: Config,
    pub faults: Vec<(u8, Fault)>,
    pub port: Place,
    pub log: Option<String>,
}

impl Options {
    /// Reads the command line; `None` when it asks for help.
    pub fn parse(mut arguments: Parser) -> Result<Option<Self>, lexopt::Error> {
        let mut line =
            Settings { baud: 9_600, format: Format { data_bits: 8, parity: Parity::Odd, stop_bits: 1 } };
        let mut mode = Mode::Ascii;
        let mut units = vec![1, 2, 3];
        let mut reply_delay = Duration::from_millis(8);
        let (mut paced, mut echo, mut seed) = (true, false, 1);
        let (mut max_read, mut faults, mut place, mut log) = (None, Vec::new(), None, None);
        while let Some(argument) = arguments.next()? {
            let Arg::Long(name) = argument else { return Err(argument.unexpected()) };
            let name = name.to_string();
            let value = &mut arguments;
            match name.as_str() {
                "help" => return Ok(None),
                "unpaced" => paced = false,
                "echo" => echo = true,
                "pty" => set_place(&mut place, Place::Pty(value.value()?.string()?))?,
                "listen" => set_place(&mut place, Place::Listen(value.value()?.string()?))?,
                "device" => set_place(&mut place, Place::Device(value.value()?.string()?))?,
                "protocol" => mode = value.value()?.parse_with(protocol)?,
                "baud" => line.baud = value.value()?.parse_with(baud)?,
                "format" => line.format = value.value()?.parse_with(format)?,
                "units" => units = value.value()?.parse_with(unit_list)?,
                "reply-delay-ms" => reply_delay = Duration::from_millis(value.value()?.parse()?),
                "max-read" => max_read = Some(value.value()?.parse_with(max_read_of)?),
                "fault" => faults.push(value.value()?.parse_with(unit_fault)?),
                "seed" => seed = value.value()?.parse()?,
                "log" => log = Some(value.value()?.string()?),
                _ => return Err(Arg::Long(&name).unexpected()),
            }
        }
        let port = place.ok_or("say where: --pty, --listen or --device")?;
        let mut config = Config { reply_delay, paced, echo, seed, ..Config::new(mode, line, &units) };
        for drive in &mut config.drives {
            drive.profile.max_read = max_read.unwrap_or(drive.profile.max_read);
        }
        if matches!(port, Place::Device(_)) {
            // The wire itself takes its time; only the silence before a reply is left to keep.
            config.paced = false;
            if mode == Mode::Rtu {
                config.reply_delay = config.reply_delay.max(rtu::t3_5(line));
            }
        }
        Ok(Some(Self { config, faults, port, log }))
    }
}

fn set_place(place: &mut Option<Place>, new: Place) -> Result<(), lexopt::Error> {
    match place.replace(new) {
        None => Ok(()),
        Some(_) => Err("only one of --pty, --listen and --device is possible".into()),
    }
}

fn protocol(text: &str) -> Result<Mode, String> {
    match text {
        "modbus-ascii" => Ok(Mode::Ascii),
        "modbus-rtu" => Ok(Mode::Rtu),
        _ => Err("expected modbus-ascii or modbus-rtu".into()),
    }
}

fn format(text: &str) -> Result<Format, String> {
    text.parse().map_err(|error: BadFormat| error.to_string())
}

fn baud(text: &str) -> Result<u32, String> {
    in_range(text, 1, 10_000_000)
}

fn max_read_of(text: &str) -> Result<u16, String> {
    in_range(text, 1, 125)
}

fn in_range<T: FromStr + PartialOrd + std::fmt::Display>(text: &str, min: T, max: T) -> Result<T, String> {
    let value = text.parse().ok().filter(|value| *value >= min && *value <= max);
    value.ok_or_else(|| format!("expected {min} to {max}"))
}

/// `1,2,5-8`
fn unit_list(text: &str) -> Result<Vec<u8>, String> {
    let mut units = Vec::new();
    for part in text.split(',') {
        let (first, last) = part.split_once('-').unwrap_or((part, part));
        let (first, last) = (in_range(first, 1, 254)?, in_range(last, 1, 254)?);
        units.extend(first..=last);
    }
    if units.is_empty() { Err("the list is empty".into()) } else { Ok(units) }
}

/// `2=silent`
fn unit_fault(text: &str) -> Result<(u8, Fault), String> {
    let (unit, fault) = text.split_once('=').ok_or("expected UNIT=FAULT, as in 2=silent")?;
    Ok((in_range(unit, 1, 254)?, fault.parse().map_err(|error| format!("{error}"))?))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(arguments: &[&str]) -> Result<Options, String> {
        match Options::parse(Parser::from_iter(["cell"].iter().chain(arguments))) {
            Ok(options) => Ok(options.expect("help was not asked for")),
            Err(error) => Err(error.to_string()),
        }
    }

    #[test]
    fn defaults_are_those_of_the_thesis() {
        let options = parse(&["--pty", "line"]).expect("good");
        assert_eq!(options.port, Place::Pty("line".into()));
        let config = options.config;
        assert_eq!(
            (config.mode, config.line.baud, config.line.format.to_string()),
            (Mode::Ascii, 9_600, "8O1".into())
        );
        assert_eq!(config.drives.iter().map(|drive| drive.address).collect::<Vec<_>>(), [1, 2, 3]);
        assert!(config.paced && !config.echo);
    }

    #[test]
    fn every_option_is_read() {
        let line = "--listen 127.0.0.1:0 --protocol modbus-rtu --baud 19200 --format 8E1 --units 1,5-7 \
                    --reply-delay-ms 2 --unpaced --echo --max-read 125 --fault 5=late:300*2 --fault 6=silent --seed 7 --log -";
        let options = parse(&line.split_whitespace().collect::<Vec<_>>()).expect("good");
        let config = options.config;
        assert_eq!(
            (config.mode, config.line.baud, config.line.format.to_string()),
            (Mode::Rtu, 19_200, "8E1".into())
        );
        assert_eq!(config.drives.iter().map(|drive| drive.address).collect::<Vec<_>>(), [1, 5, 6, 7]);
        assert!(config.drives.iter().all(|drive| drive.profile.max_read == 125));
        assert_eq!(config.reply_delay, Duration::from_millis(2));
        assert!(!config.paced && config.echo && config.seed == 7);
        let late = Fault::Late(Duration::from_millis(300)).times(2);
        assert_eq!(options.faults, [(5, late), (6, Fault::Silent)]);
        assert_eq!((options.port, options.log), (Place::Listen("127.0.0.1:0".into()), Some("-".into())));
    }

    #[test]
    fn a_device_paces_itself_but_keeps_the_silence() {
        let config = |more: &[&str]| {
            parse(&[&["--device", "tty", "--reply-delay-ms", "0"], more].concat()).expect("good").config
        };
        assert!(!config(&[]).paced);
        assert_eq!(config(&[]).reply_delay, Duration::ZERO);
        let rtu = config(&["--protocol", "modbus-rtu"]);
        assert_eq!(rtu.reply_delay, rtu::t3_5(rtu.line));
    }

    #[test]
    fn mistakes_are_told() {
        for (line, expected) in [
            ("", "say where"),
            ("--pty a --listen b:1", "only one of"),
            ("--pty a --baud 0", "expected 1 to 10000000"),
            ("--pty a --format 9E1", "as in 8E1"),
            ("--pty a --protocol can", "modbus-ascii or modbus-rtu"),
            ("--pty a --units 0", "expected 1 to 254"),
            ("--pty a --units 9-2", "is empty"),
            ("--pty a --max-read 126", "expected 1 to 125"),
            ("--pty a --fault silent", "UNIT=FAULT"),
            ("--pty a --fault 1=broken", "'broken' is no fault"),
            ("--pty a --fault 1=late:x", "'late:x' is no fault"),
            ("--pty a --fault 1=corrupt*x", "'corrupt*x' is no fault"),
            ("--pty a --speed 9600", "--speed"),
            ("--pty a more", "more"),
        ] {
            let error = parse(&line.split_whitespace().collect::<Vec<_>>()).expect_err(line);
            assert!(error.contains(expected), "{line}: {error}");
        }
    }
}
