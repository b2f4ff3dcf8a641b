//! The options of `cell canopen`.

use std::time::Duration;

use lexopt::{Arg, Parser, ValueExt};
use puente_canopen::frame::MAX_BASE;
use puente_cell::can::{Config, DriveConfig, Fault, Model};
use puente_cell::live::can::{CLIENTS, Door};

use super::values;

/// A CAN bus.
#[derive(Debug)]
pub struct CanopenOptions {
    pub config: Config,
    pub doors: Vec<Door>,
    /// When, after the start, with which node.
    pub faults: Vec<(Duration, u8, Fault)>,
    pub log: Option<String>,
    pub pcap: Option<String>,
}

/// What the help has to have.
#[cfg(test)]
pub const OPTIONS: [&str; 12] = [
    "slcan",
    "pty",
    "socketcand",
    "bitrate",
    "drive",
    "drop",
    "errors",
    "fault",
    "seed",
    "log",
    "pcap",
    "node",
];

/// Serial number of the first node that has no node-ID.
const FIRST_SERIAL: u32 = 9_000;

impl CanopenOptions {
    /// `None` when help is asked for.
    pub fn parse(mut arguments: Parser) -> Result<Option<Self>, lexopt::Error> {
        let config = Config { ports: CLIENTS, ..Config::new(1_000_000) };
        let mut options = Self { config, doors: Vec::new(), faults: Vec::new(), log: None, pcap: None };
        while let Some(argument) = arguments.next()? {
            let Arg::Long(name) = argument else { return Err(argument.unexpected()) };
            let name = name.to_string();
            if name == "help" {
                return Ok(None);
            }
            options.take(&name, &mut arguments)?;
        }
        if options.doors.is_empty() {
            return Err("say where: --slcan, --pty or --socketcand".into());
        }
        Ok(Some(options))
    }

    fn take(&mut self, name: &str, value: &mut Parser) -> Result<(), lexopt::Error> {
        match name {
            "slcan" => self.doors.push(Door::Slcan(value.value()?.string()?)),
            "pty" => self.doors.push(Door::Pty(value.value()?.string()?)),
            "socketcand" => self.doors.push(Door::Socketcand(value.value()?.string()?)),
            "bitrate" => {
                self.config.bitrate = value.value()?.parse_with(values::in_range(1_000, 1_000_000))?;
            }
            "drive" | "node" => self.drive(&value.value()?.string()?)?,
            "drop" => self.config.drop = value.value()?.parse_with(share)?,
            "errors" => self.config.errors = value.value()?.parse_with(share)?,
            "fault" => self.faults.push(value.value()?.parse_with(fault)?),
            "seed" => self.config.seed = value.value()?.parse()?,
            "log" => self.log = Some(value.value()?.string()?),
            "pcap" => self.pcap = Some(value.value()?.string()?),
            _ => return Err(Arg::Long(name).unexpected()),
        }
        Ok(())
    }

    /// `2=lexium23a`, and `lss=node` for one without a node-ID.
    fn drive(&mut self, text: &str) -> Result<(), lexopt::Error> {
        let (node, model) = text.split_once('=').ok_or("expected NODE=MODEL, as in 2=lexium23a")?;
        let model: Model = model.parse().map_err(|error| format!("{error}"))?;
        let drives = &mut self.config.drives;
        drives.push(match node {
            "lss" => {
                let others = drives.iter().filter(|drive| drive.node.is_none()).count() as u32;
                DriveConfig::unconfigured(model, FIRST_SERIAL + others)
            }
            node => {
                let node = values::in_range(1, 127)(node)?;
                DriveConfig::new(node, model).ok_or("expected a node-ID of 1 to 127")?
            }
        });
        Ok(())
    }
}

/// `1%` or `0.01`.
fn share(text: &str) -> Result<f64, String> {
    let (digits, unit) = text.strip_suffix('%').map_or((text, 1.0), |digits| (digits, 100.0));
    let value: Option<f64> = digits.parse().ok().filter(|value| (0.0..=unit).contains(value));
    value.map(|value| value / unit).ok_or_else(|| "expected 0 to 1, or 0% to 100%".into())
}

/// `2:mute`, and `2:mute@5s` for later.
pub fn fault(text: &str) -> Result<(Duration, u8, Fault), String> {
    let bad = || "expected NODE:FAULT or NODE:FAULT@TIME, as in 2:mute@5s".to_owned();
    let (text, at) = match text.split_once('@') {
        Some((text, at)) => (text, time(at).ok_or_else(bad)?),
        None => (text, Duration::ZERO),
    };
    let (node, fault) = text.split_once(':').ok_or_else(bad)?;
    let node = values::in_range(0, 127)(node)?;
    let fault: Fault = fault.parse().map_err(|error| format!("{error}; see cell --help"))?;
    match fault {
        fault if (node == 0) != matches!(fault, Fault::Short(_)) => Err(bad()),
        Fault::Babble(frame, _) if frame.id().raw() > MAX_BASE.into() => Err(bad()),
        fault => Ok((at, node, fault)),
    }
}

/// `5s` or `250ms`.
fn time(text: &str) -> Option<Duration> {
    if let Some(millis) = text.strip_suffix("ms") {
        return millis.parse().ok().map(Duration::from_millis);
    }
    let seconds: f64 = text.strip_suffix('s')?.parse().ok()?;
    Duration::try_from_secs_f64(seconds).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(line: &str) -> Result<CanopenOptions, lexopt::Error> {
        CanopenOptions::parse(Parser::from_args(line.split(' '))).map(|options| options.expect("no help"))
    }

    #[test]
    fn a_bus_with_drives() {
        let line = "--slcan 127.0.0.1:0 --socketcand [::1]:29536 --pty /tmp/can --drive 2=lexium23a --drive \
                    3=festo-cmms --node 5=node --drive lss=node --drop 1% --errors 0.5 --bitrate 250000";
        let line: Vec<_> = line.split_whitespace().collect();
        let options = parse(&line.join(" ")).unwrap();
        assert_eq!(options.doors.len(), 3);
        let nodes: Vec<_> =
            options.config.drives.iter().map(|drive| drive.node.map(|id| id.value())).collect();
        assert_eq!(nodes, [Some(2), Some(3), Some(5), None]);
        assert_eq!((options.config.drop, options.config.errors), (0.01, 0.5));
        assert_eq!((options.config.bitrate, options.config.ports), (250_000, CLIENTS));
    }

    #[test]
    fn faults_with_their_times() {
        assert_eq!(fault("2:mute"), Ok((Duration::ZERO, 2, Fault::Mute(true))));
        assert_eq!(fault("2:mute@5s"), Ok((Duration::from_secs(5), 2, Fault::Mute(true))));
        assert_eq!(
            fault("3:slow:20@250ms"),
            Ok((Duration::from_millis(250), 3, Fault::Slow(Duration::from_millis(20))))
        );
        assert_eq!(fault("0:short"), Ok((Duration::ZERO, 0, Fault::Short(true))));
        for bad in [
            "mute",
            "0:mute",
            "2:short",
            "2:id:0",
            "2:id:300",
            "2:mut",
            "2:mute@5",
            "2:mute@x s",
            "2:slow",
            "2:mute:1",
            "128:die",
        ] {
            assert!(fault(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn what_is_wrong_is_told() {
        for bad in [
            "--drive 2=lexium23a",
            "--slcan 127.0.0.1:0 --drive 0=node",
            "--slcan 127.0.0.1:0 --drive 2=servo",
            "--slcan 127.0.0.1:0 --drop 2",
            "--slcan 127.0.0.1:0 --baud 9600",
        ] {
            assert!(parse(bad).is_err(), "{bad}");
        }
    }
}
