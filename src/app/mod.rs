//! The only module that sees every layer: it wires them and spawns the tasks, the same ones on every port.

#[cfg(target_os = "none")]
pub mod board;
#[cfg(not(target_os = "none"))]
pub mod host;
pub mod lamps;
#[cfg(not(target_os = "none"))]
mod options;
#[cfg(target_os = "none")]
mod vital;

use puente_line::Duration;
use puente_modbus::{Config, Echo, Mode};
use static_cell::StaticCell;

use crate::axis::{Axes, AxisSpec};
use crate::bus;
use crate::desk::{BusQueue, BusSpec, Desk};
use crate::front::{self, Gateway};
use crate::port::{Line, Place, limits};
use crate::settings::{self, Settings};

static DESK: Desk = Desk::new();
static GATEWAY: StaticCell<Gateway> = StaticCell::new();

/// Builds the gateway; once a process. The settings must have passed [`Settings::check`].
#[inline(never)]
pub fn build(settings: &'static Settings) -> &'static Gateway {
    let buses = settings.buses.iter().map(|bus| BusSpec {
        units: bus.units,
        queue_timeout: millis(bus.queue_timeout_ms),
        reply_timeout: millis(bus.reply_timeout_ms),
    });
    DESK.configure(buses, millis(settings.net.lease_ms));
    let axes = settings.axes.iter().map(|axis| AxisSpec {
        name: axis.name.clone(),
        bus: settings.bus(&axis.bus).unwrap_or_default(),
        bus_name: axis.bus.clone(),
        address: axis.address,
        max_rpm: axis.max_rpm,
        registers: axis.registers,
    });
    let axes = Axes::new(&DESK, axes);
    GATEWAY.init_with(|| Gateway::new(settings, &DESK, axes))
}

fn millis(ms: u32) -> Duration {
    Duration::from_millis(u64::from(ms))
}

/// The line's baud rate and format.
fn line_settings(bus: &settings::Bus) -> puente_line::Settings {
    puente_line::Settings { baud: bus.baud, format: bus.format }
}

fn mode(bus: &settings::Bus) -> Mode {
    match bus.protocol {
        settings::Protocol::ModbusRtu => Mode::Rtu,
        settings::Protocol::ModbusAscii => Mode::Ascii,
    }
}

/// What the master of a bus goes by.
pub fn master(settings: &Settings, bus: &settings::Bus) -> Config {
    Config {
        line: line_settings(bus),
        mode: mode(bus),
        silence: silence(settings, bus),
        reply_timeout: millis(bus.reply_timeout_ms),
        turnaround: millis(bus.turnaround_ms),
        rest: millis(bus.rest_ms),
        quarantine: millis(bus.quarantine_ms.unwrap_or(bus.reply_timeout_ms)),
        echo: match bus.echo {
            settings::Echo::Off => Echo::Off,
            settings::Echo::Strip => Echo::Strip,
            settings::Echo::Verify => Echo::Verify,
        },
    }
}

/// EDB drives want 4 characters of silence between RTU frames, where the standard has 3.5.
fn silence(settings: &Settings, bus: &settings::Bus) -> Duration {
    let edb = settings.axes.iter().any(|axis| axis.bus == bus.name && axis.drive == settings::Drive::Edb);
    match bus.protocol {
        settings::Protocol::ModbusRtu if edb => line_settings(bus).wire_time(4),
        settings::Protocol::ModbusRtu | settings::Protocol::ModbusAscii => Duration::ZERO,
    }
}

/// Drives one bus.
#[embassy_executor::task(pool_size = limits::BUSES)]
pub async fn bus_task(desk: &'static Desk, bus: u8, mut line: Line, master: Config) -> ! {
    bus::modbus::pump(&mut line, master, &BusQueue { desk, bus }).await
}

/// Stops one axis when its commander is gone.
#[embassy_executor::task(pool_size = limits::AXES)]
pub async fn watch_task(gateway: &'static Gateway, axis: u8) -> ! {
    gateway.axes.watch(axis).await
}

/// Serves one place for clients.
#[embassy_executor::task(pool_size = limits::SLOTS)]
pub async fn front_task(gateway: &'static Gateway, seat: u8, mut place: Place) -> ! {
    front::serve(gateway, seat, &mut place).await
}
