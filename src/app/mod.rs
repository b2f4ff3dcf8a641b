//! The only module that sees every layer: it wires them and spawns the tasks, the same ones on every port.

#[cfg(target_os = "none")]
pub mod board;
mod canopen;
mod framed;
#[cfg(not(target_os = "none"))]
pub mod host;
pub mod lamps;
#[cfg(not(target_os = "none"))]
mod options;
#[cfg(not(target_os = "none"))]
mod simulated;
#[cfg(target_os = "none")]
mod vital;

use embassy_futures::block_on;
use puente_drives::pid::Gains;
use puente_line::Duration;
use puente_modbus::{Config, Echo, Mode};
use static_cell::{ConstStaticCell, StaticCell};

use crate::axis::{Axes, AxisSpec, DriveSpec, edb};
use crate::bus::{self, framed::Setup};
use crate::clock;
use crate::desk::{BusImage, BusQueue, BusSpec, Desk, Modules, Units};
use crate::front::{self, Gateway};
use crate::port::{Can, Flash, Line, Place, limits};
use crate::settings::keeper::{self, Form, Keeper, Source};
use crate::settings::store::{Start, Store};
use crate::settings::{self, Settings};

static DESK: Desk = Desk::new();
static FORM: ConstStaticCell<Form> = ConstStaticCell::new(Form::new());
static SETTINGS: StaticCell<Settings> = StaticCell::new();
static KEEPER: StaticCell<Keeper> = StaticCell::new();
static GATEWAY: StaticCell<Gateway> = StaticCell::new();

/// The settings in force, and who changes them.
pub struct InForce {
    /// The settings.
    pub settings: &'static Settings,
    /// Who changes them,
    pub keeper: &'static Keeper,
    /// and where, if anywhere.
    pub store: Option<Store<Flash>>,
}

/// Finds the settings: those in flash, or else `base`, or else what is built in. Where `reset`, those in flash are
/// forgotten. Call it once.
#[inline(never)]
pub fn settings(flash: Option<Flash>, base: Option<&'static Settings>, reset: bool) -> InForce {
    let form = FORM.take();
    let settings = SETTINGS.init_with(Settings::factory);
    let (store, start) = flash.map(|flash| block_on(open(flash, form.buffer(), settings, reset))).unzip();
    let Start { stored, on_trial } = start.unwrap_or(Start { stored: false, on_trial: false });
    let source = match base {
        _ if stored => Source::Flash,
        Some(base) => {
            settings.clone_from(base);
            Source::File
        }
        None => {
            *settings = Settings::factory();
            Source::Factory
        }
    };
    let keeper = KEEPER.init_with(|| Keeper::new(form, source, base, store.is_some()));
    log::info!("settings: {}{}", source.name(), if on_trial { ", on trial" } else { "" });
    if on_trial {
        keeper.try_out(clock::now());
    }
    InForce { settings, keeper, store }
}

async fn open(
    flash: Flash,
    buffer: &mut [u8],
    settings: &mut Settings,
    reset: bool,
) -> (Store<Flash>, Start) {
    let (mut store, start) = Store::open(flash, buffer, settings).await;
    if !reset {
        return (store, start);
    }
    match store.put(buffer, None).await {
        Ok(()) => log::warn!("the button is held: back to the factory settings"),
        Err(error) => log::error!("the button is held, but the factory settings cannot be kept: {error:?}"),
    }
    (store, Start { stored: false, on_trial: false })
}

/// Builds the gateway; once a process. The settings must have passed [`Settings::check`].
#[inline(never)]
pub fn build(settings: &'static Settings, keeper: &'static Keeper) -> &'static Gateway {
    let buses = settings.buses.iter().map(|bus| match bus.modbus() {
        Some(modbus) => BusSpec {
            units: modbus.units,
            queue_timeout: millis(modbus.queue_timeout_ms),
            reply_timeout: millis(modbus.reply_timeout_ms),
        },
        None => {
            BusSpec { units: Units::default(), queue_timeout: Duration::ZERO, reply_timeout: Duration::ZERO }
        }
    });
    DESK.configure(buses, millis(settings.net.lease_ms));
    if let Some(bus) = settings.buses.iter().position(|bus| bus.framed().is_some()) {
        DESK.send_frames_to(bus as u8);
    }
    canopen::add(settings);
    let axes = Axes::new(&DESK, axes(settings).map(|(id, axis)| axis_spec(settings, id, axis)));
    GATEWAY.init_with(|| Gateway::new(settings, &DESK, axes, keeper))
}

/// The axes with their numbers.
fn axes(settings: &Settings) -> impl Iterator<Item = (u8, &settings::Axis)> {
    (0..).zip(&settings.axes)
}

/// What the axes go by of one of them; a cyclic one is added to the desk's process image.
fn axis_spec(settings: &Settings, id: u8, axis: &settings::Axis) -> AxisSpec {
    let bus = settings.bus(&axis.bus).unwrap_or_default();
    AxisSpec {
        name: axis.name.clone(),
        bus,
        bus_name: axis.bus.clone(),
        address: axis.address,
        drive: match &axis.drive {
            settings::Drive::Edb(edb) => {
                DriveSpec::Edb(edb::Spec { max_rpm: edb.max_rpm, registers: edb.registers })
            }
            settings::Drive::Pid(pid) => {
                DESK.add_cyclic(id, bus, framed::gains(pid));
                DriveSpec::Pid(framed::axis(settings, usize::from(bus), pid))
            }
            settings::Drive::Cia402(cia402) => {
                DESK.add_cyclic(id, bus, Gains::default());
                DriveSpec::Cia402(canopen::axis(settings, bus, cia402))
            }
        },
    }
}

fn millis(ms: u32) -> Duration {
    Duration::from_millis(u64::from(ms))
}

/// What the master of a Modbus bus goes by.
pub fn modbus(settings: &Settings, bus: &settings::Bus) -> Option<Config> {
    let modbus = bus.modbus()?;
    let mode = mode(bus)?;
    Some(Config {
        line: modbus.line,
        mode,
        silence: if mode == Mode::Rtu && drives_edb(settings, bus) {
            // EDB drives want 4 characters of silence between RTU frames, where the standard has 3.5.
            modbus.line.wire_time(4)
        } else {
            Duration::ZERO
        },
        reply_timeout: millis(modbus.reply_timeout_ms),
        turnaround: millis(modbus.turnaround_ms),
        rest: millis(modbus.rest_ms),
        quarantine: millis(modbus.quarantine_ms.unwrap_or(modbus.reply_timeout_ms)),
        echo: match modbus.echo {
            settings::Echo::Off => Echo::Off,
            settings::Echo::Strip => Echo::Strip,
            settings::Echo::Verify => Echo::Verify,
        },
    })
}

fn mode(bus: &settings::Bus) -> Option<Mode> {
    match bus.protocol {
        settings::Protocol::ModbusRtu(_) => Some(Mode::Rtu),
        settings::Protocol::ModbusAscii(_) => Some(Mode::Ascii),
        settings::Protocol::Framed(_) | settings::Protocol::Canopen(_) => None,
    }
}

fn drives_edb(settings: &Settings, bus: &settings::Bus) -> bool {
    let mut axes = settings.axes.iter().filter(|axis| axis.bus == bus.name);
    axes.any(|axis| matches!(axis.drive, settings::Drive::Edb(_)))
}

/// Drives one bus.
#[embassy_executor::task(pool_size = limits::MODBUS)]
pub async fn bus_task(desk: &'static Desk, bus: u8, mut line: Line, master: Config) -> ! {
    bus::modbus::pump(&mut line, master, &BusQueue { desk, bus }).await
}

/// Drives one framed bus.
#[embassy_executor::task(pool_size = limits::FRAMED)]
pub async fn framed_task(image: BusImage<'static, Modules>, mut line: Line, setup: Setup) -> ! {
    bus::framed::pump(&mut line, setup, &image).await
}

/// Drives one CANopen bus.
#[embassy_executor::task(pool_size = limits::CANOPEN)]
pub async fn canopen_task(mut port: Can, parts: canopen::Parts) -> ! {
    bus::canopen::pump(&mut port, parts.setup, &parts.clients, &parts.image).await
}

/// Stops one axis when its commander is gone.
#[embassy_executor::task(pool_size = limits::AXES)]
pub async fn watch_task(gateway: &'static Gateway, axis: u8) -> ! {
    gateway.axes.watch(axis).await
}

/// Takes groups of axes through their stages.
#[embassy_executor::task]
pub async fn group_task(gateway: &'static Gateway) -> ! {
    gateway.axes.work_groups().await
}

/// Changes the settings.
#[embassy_executor::task]
pub async fn keeper_task(keeper: &'static Keeper, desk: &'static Desk, store: Store<Flash>) -> ! {
    keeper::keep(keeper, desk, store).await
}

/// Serves one place for clients.
#[embassy_executor::task(pool_size = limits::SLOTS)]
pub async fn front_task(gateway: &'static Gateway, seat: u8, mut place: Place) -> ! {
    front::serve(gateway, seat, &mut place).await
}
