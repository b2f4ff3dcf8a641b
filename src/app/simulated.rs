//! What is behind a bus whose port is `sim`.

use puente_cell::can::{self, DriveConfig, Model};
use puente_cell::framed::{self, ModuleConfig};
use puente_modules::Form;

use super::framed::manners;
use super::mode;
use crate::port::host::Simulation;
use crate::settings::{Axis, Bus, Drive, Framed, Payload, Protocol, Settings};

/// A drive, or a module, for each axis of a serial bus.
pub fn simulated(settings: &Settings, bus: &Bus) -> Option<Simulation> {
    let axes = settings.axes.iter().filter(|axis| axis.bus == bus.name);
    match &bus.protocol {
        Protocol::Framed(framed) => Some(Simulation::Framed(table(framed, axes))),
        Protocol::ModbusRtu(modbus) | Protocol::ModbusAscii(modbus) => {
            let addresses: Vec<u8> = axes.map(|axis| axis.address).collect();
            Some(Simulation::Modbus(puente_cell::Config::new(mode(bus)?, modbus.line, &addresses)))
        }
        Protocol::Canopen(_) => None,
    }
}

/// A drive for each axis of a CAN bus, and what has no more than its communication profile for each node that is none.
pub fn simulated_can(settings: &Settings, bus: &Bus, bitrate: u32) -> can::Config {
    let axes = settings.axes.iter().filter(|axis| axis.bus == bus.name);
    let drives = axes.clone().filter_map(|axis| match &axis.drive {
        // A drive of the generic profile is one of those that there are.
        Drive::Cia402(drive) => {
            DriveConfig::new(axis.address, drive.profile.name.parse().unwrap_or(Model::Lexium23a))
        }
        Drive::Edb(_) | Drive::Pid(_) => None,
    });
    let nodes = settings
        .nodes
        .iter()
        .filter(|node| node.bus == bus.name && axes.clone().all(|axis| axis.address != node.id));
    let nodes = nodes.filter_map(|node| DriveConfig::new(node.id, Model::Node));
    can::Config { drives: drives.chain(nodes).collect(), ..can::Config::new(bitrate) }
}

/// Modules on axes of the TX8 table, with the manners that the gateway has.
fn table<'a>(framed: &Framed, axes: impl Iterator<Item = &'a Axis>) -> framed::Config {
    let module = |axis: &Axis| {
        let form = match &axis.drive {
            Drive::Pid(pid) if pid.payload == Payload::Binary => Form::Binary,
            Drive::Pid(_) | Drive::Edb(_) | Drive::Cia402(_) => Form::Text,
        };
        ModuleConfig { form, ..ModuleConfig::new(axis.address) }
    };
    framed::Config {
        manners: manners(framed),
        modules: axes.map(module).collect(),
        echo: framed.echo != crate::settings::Echo::Off,
        ..framed::Config::new(framed.line, &[])
    }
}

#[cfg(test)]
mod tests {
    use puente_framed::arbiter::Policy;

    use super::*;

    /// The table of the settings has the manners and the modules of the bus, and of no other.
    #[test]
    fn a_framed_bus_has_a_module_for_each_axis() {
        let text = r#"
            [[bus]]
            name = "a"
            protocol = "modbus-rtu"
            port = "sim"
            [[bus]]
            name = "b"
            protocol = "framed"
            port = "sim"
            baud = 500000
            format = "8E1"
            policy = "thesis"
            ipg = 3
            slot = 10
            echo = "off"
            [[axis]]
            name = "e"
            bus = "a"
            drive = "edb"
            address = 5
            [[axis]]
            name = "x"
            bus = "b"
            drive = "pid"
            address = 17
            [[axis]]
            name = "y"
            bus = "b"
            drive = "pid"
            address = 18
            payload = "binary"
        "#;
        let settings: Settings = toml::from_str(text).expect("settings");
        let [a, b] = &settings.buses[..] else { panic!("two buses") };
        let Some(Simulation::Framed(config)) = simulated(&settings, b) else { panic!("framed") };
        let modules: Vec<_> = config.modules.iter().map(|module| (module.address, module.form)).collect();
        assert_eq!(modules, [(17, Form::Text), (18, Form::Binary)]);
        let line = b.line().expect("a line");
        let manners = config.manners;
        assert_eq!((manners.line, manners.policy), (line, Policy::Thesis));
        assert_eq!(
            (manners.gap, manners.slot, manners.rest),
            (line.wire_time(3), line.wire_time(10), line.wire_time(10))
        );
        assert!(!config.echo);
        let Some(Simulation::Modbus(config)) = simulated(&settings, a) else { panic!("Modbus") };
        assert_eq!(config.drives.iter().map(|drive| drive.address).collect::<Vec<_>>(), [5]);
    }
}
