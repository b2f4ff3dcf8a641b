//! What is behind a bus whose port is `sim`.

use puente_cell::framed::{self, ModuleConfig};
use puente_modbus::Mode;
use puente_modules::Form;

use super::framed::manners;
use super::{line_settings, mode};
use crate::port::host::Simulation;
use crate::settings::{Axis, Bus, Drive, Framed, Payload, Protocol, Settings};

/// A drive, or a module, for each axis of the bus.
pub fn simulated(settings: &Settings, bus: &Bus) -> Simulation {
    let axes = settings.axes.iter().filter(|axis| axis.bus == bus.name);
    match &bus.protocol {
        Protocol::Framed(framed) => Simulation::Framed(table(bus, framed, axes)),
        Protocol::ModbusRtu(_) | Protocol::ModbusAscii(_) => {
            let addresses: Vec<u8> = axes.map(|axis| axis.address).collect();
            let mode = mode(bus).unwrap_or(Mode::Ascii);
            Simulation::Modbus(puente_cell::Config::new(mode, line_settings(bus), &addresses))
        }
    }
}

/// Modules on axes of the TX8 table, with the manners that the gateway has.
fn table<'a>(bus: &Bus, framed: &Framed, axes: impl Iterator<Item = &'a Axis>) -> framed::Config {
    let line = line_settings(bus);
    let module = |axis: &Axis| {
        let form = match &axis.drive {
            Drive::Pid(pid) if pid.payload == Payload::Binary => Form::Binary,
            Drive::Pid(_) | Drive::Edb(_) => Form::Text,
        };
        ModuleConfig { form, ..ModuleConfig::new(axis.address) }
    };
    framed::Config {
        manners: manners(line, framed),
        modules: axes.map(module).collect(),
        echo: framed.echo != crate::settings::Echo::Off,
        ..framed::Config::new(line, &[])
    }
}
