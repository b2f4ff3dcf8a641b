//! What the settings say of framed buses, as those take it who work with it.

use core::marker::PhantomData;

use puente_drives::pid::Gains;
use puente_framed::arbiter::{self, Echo, Policy};
use puente_framed::{section, station};
use puente_line::Duration;
use puente_modules::{Form, master, report, setting};

use super::{DESK, millis};
use crate::axis::pid;
use crate::bus::framed::{Room, Setup};
use crate::desk::{BusImage, Modules};
use crate::port::limits;
use crate::settings::{self, Drive, Payload, Pid, Settings};

/// Reports come at least so often, or the module is silent. A module's own supervision takes as long.
const SILENT: Duration = Duration::from_millis(100);
/// Cycles that may be lost before that.
const LOST: u32 = 3;
/// Bytes of a section with all of its parts, and of a frame around it.
const SECTION: usize = section::OVERHEAD + setting::MAX_DATA;
const REPORT: usize = section::OVERHEAD + report::DATA;
const FRAME: usize = puente_framed::frame::TAGGED_OVERHEAD;

static ROOMS: [Room; limits::FRAMED] = [const { Room::new() }; limits::FRAMED];

fn form(pid: &Pid) -> Form {
    match pid.payload {
        Payload::Text => Form::Text,
        Payload::Binary => Form::Binary,
    }
}

/// The gains that a module has at first; they hold nothing where there are none.
pub(super) fn gains(pid: &Pid) -> Gains {
    let gains = pid.gains.and_then(|[kp, ki, kd]| Gains::new(kp, ki, kd).ok());
    gains.unwrap_or_default()
}

/// The axes of a bus with their numbers.
fn axes_of(settings: &Settings, index: usize) -> impl Iterator<Item = (u8, &settings::Axis, &Pid)> {
    let name = settings.buses.get(index).map(|bus| &bus.name);
    super::axes(settings).filter_map(move |(id, axis)| match &axis.drive {
        Drive::Pid(pid) if Some(&axis.bus) == name => Some((id, axis, pid)),
        _ => None,
    })
}

/// What the axis of a module on this bus goes by.
pub(super) fn axis(settings: &Settings, bus: usize, pid: &Pid) -> pid::Spec {
    let count = axes_of(settings, bus).count();
    let within = settings.buses.get(bus).and_then(|bus| {
        let framed = bus.framed()?;
        let cycle = framed.line.wire_time(FRAME + count * (SECTION + FRAME + REPORT));
        Some(cycle.max(millis(framed.cycle_ms.into())))
    });
    // In the worst case one module is asked a cycle.
    let within = within.unwrap_or_default().saturating_mul(LOST * count as u32);
    pid::Spec { form: form(pid), within: within.max(SILENT) }
}

/// How every station of a bus behaves on the line.
pub(super) fn manners(framed: &settings::Framed) -> arbiter::Config {
    let line = framed.line;
    let characters = |count: u16| line.wire_time(count.into());
    arbiter::Config {
        gap: characters(framed.ipg),
        slot: characters(framed.slot),
        rest: characters(framed.slot),
        attempts: framed.attempts,
        policy: match framed.policy {
            settings::Policy::Truncated => Policy::Truncated,
            settings::Policy::Thesis => Policy::Thesis,
        },
        ..arbiter::Config::new(line)
    }
}

/// What the pump of a framed bus goes by; none where the bus is none.
pub fn framed(settings: &Settings, index: u8, seed: u64) -> Option<(BusImage<'static, Modules>, Setup)> {
    let bus = settings.buses.get(usize::from(index))?;
    let framed = bus.framed()?;
    let mut station = station::Config::new(framed.station, framed.line, limits::FRAME);
    station.arbiter = manners(framed);
    station.arbiter.echo = match framed.echo {
        settings::Echo::Verify => Echo::Compared,
        settings::Echo::Off | settings::Echo::Strip => Echo::None,
    };
    station.window.window = framed.window;
    let axes = || axes_of(settings, index.into());
    let before = settings.buses.iter().take(index.into()).filter(|bus| bus.framed().is_some());
    let setup = Setup {
        config: master::Config { station, cycle: millis(framed.cycle_ms.into()) },
        axes: axes().map(|(_, axis, pid)| master::Axis { address: axis.address, form: form(pid) }).collect(),
        // Another on each bus, too.
        seed: seed.wrapping_add(index.into()),
        room: ROOMS.get(before.count())?,
    };
    let axes = axes().map(|(id, ..)| id).collect();
    Some((BusImage { desk: &DESK, bus: index, axes, kind: PhantomData }, setup))
}
