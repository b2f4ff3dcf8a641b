//! Command line options of the host program.

use std::net::Ipv4Addr;
use std::path::PathBuf;

use lexopt::prelude::*;

use crate::settings::Settings;

pub(super) const USAGE: &str = "\
puente gateway: any TCP client to servo drives

Usage: gateway [OPTIONS]

Without options it starts with a simulated cell: bus a, three EDB drives, axes x, y and z.

Options:
  --config FILE       settings, in TOML (docs/configuration.md)
  --flash FILE        keeps the settings that clients put in this file, made where there is none;
                      --config is then what an empty one stands for
  --bind ADDR         address to listen on
  --port N            TCP port of every dialect; 0 takes a free one
  --modbus-port N     TCP port of Modbus/TCP alone; 0 takes a free one
  --check             say what is wrong with the settings and where, and exit 0 or 1
  --print-config      print the settings in force and exit
  -h, --help          this text
  -V, --version       the version
";

/// What the command line asks for.
#[derive(Debug, Default, PartialEq)]
pub(super) struct Options {
    pub config: Option<PathBuf>,
    pub flash: Option<PathBuf>,
    pub bind: Option<Ipv4Addr>,
    pub port: Option<u16>,
    pub modbus_port: Option<u16>,
    pub action: Action,
}

/// What to do with the settings.
#[derive(Debug, Default, PartialEq)]
pub(super) enum Action {
    #[default]
    Run,
    Check,
    Print,
    Help,
    Version,
}

impl Options {
    pub(super) fn parse(mut arguments: lexopt::Parser) -> Result<Self, lexopt::Error> {
        let mut options = Self::default();
        while let Some(argument) = arguments.next()? {
            match argument {
                Long("config") => options.config = Some(arguments.value()?.into()),
                Long("flash") => options.flash = Some(arguments.value()?.into()),
                Long("bind") => options.bind = Some(arguments.value()?.parse()?),
                Long("port") => options.port = Some(arguments.value()?.parse()?),
                Long("modbus-port") => options.modbus_port = Some(arguments.value()?.parse()?),
                Long("check") => options.action = Action::Check,
                Long("print-config") => options.action = Action::Print,
                Short('h') | Long("help") => options.action = Action::Help,
                Short('V') | Long("version") => options.action = Action::Version,
                other => return Err(other.unexpected()),
            }
        }
        Ok(options)
    }

    /// Settings as these options change them.
    pub(super) fn on(&self, settings: &Settings) -> Settings {
        let mut settings = settings.clone();
        settings.net.bind = self.bind.unwrap_or(settings.net.bind);
        settings.net.port = self.port.unwrap_or(settings.net.port);
        settings.net.modbus_port = self.modbus_port.unwrap_or(settings.net.modbus_port);
        settings
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_are_read() {
        let parse = |text: &[&str]| Options::parse(lexopt::Parser::from_args(text));
        let options = parse(&["--config", "a.toml", "--port", "0", "--check"]).expect("options");
        assert_eq!(options.config, Some("a.toml".into()));
        assert_eq!((options.port, options.action), (Some(0), Action::Check));
        for bad in [&["--port"][..], &["--port", "70000"], &["--bind", "x"], &["--nonsense"], &["stray"]] {
            assert!(parse(bad).is_err(), "{bad:?}");
        }
    }
}
