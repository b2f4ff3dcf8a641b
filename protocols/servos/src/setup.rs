//! What a node is told when it boots, so that it can be driven.
//!
//! The PDOs are those that the drive is delivered with, switched on, which is one write each (thesis, 6.4.1). Bit 30 of the
//! COB-ID, which the thesis sets and has no word for, says that nobody may ask for the PDO by a remote frame; of a receive
//! PDO it says nothing. Only what must be other than delivered is set up in full:
//!
//! | PDO | without a cyclic mode | with one |
//! |---|---|---|
//! | RPDO 1 to 3 | as delivered, at once | as delivered, at once |
//! | RPDO 4 | as delivered, at once | the mode's set-point alone, at SYNC |
//! | TPDO 1: status | as delivered | off: TPDO 3 says it with every SYNC |
//! | TPDO 2: status, mode | as delivered | no more than one in 100 ms |
//! | TPDO 3: status, position | no more than one in 20 ms, at least one in 200 ms | with every SYNC |
//! | TPDO 4: status, velocity | no more than one in 50 ms | off: with three axes at 1 ms there is no room for it |
//!
//! No controlword waits for SYNC, so none that waits can undo a stop.

use core::time::Duration;

use heapless::Vec;
use puente_canopen::NodeId;
use puente_canopen::dcf::{self, Entry, Full};
use puente_canopen::object::HEARTBEAT_CONSUMER;
use puente_canopen::pdo::{CobId, Direction, Mapped, Pdo, Setup, Transmission};
use puente_drives::cia402::object::{
    CONNECTION_OPTION, HOMING_FAST, HOMING_METHOD, HOMING_SLOW, INTERPOLATION_RELATIVE,
    INTERPOLATION_SUBMODE, PERIOD_EXPONENT, PERIOD_VALUE,
};
use puente_drives::cia402::{Mode, Object, Period};

use crate::Axis;

/// Bytes that [`push`] adds at most.
pub const MOST: usize = 320;

/// Of status and position, 100 us: 50 a second.
const POSITION_INHIBIT: u16 = 200;
/// Of status and velocity, 100 us: 20 a second.
const VELOCITY_INHIBIT: u16 = 500;
/// Of status and mode, where there is a cyclic mode: 10 a second.
const MODE_INHIBIT: u16 = 1_000;
/// Status and position come at least so often, ms, where the drive can.
const POSITION_EVENT: u16 = 200;

/// Bytes that [`push_watch`] adds at most.
pub const MOST_WATCH: usize = 4 + (7 + 4) + (7 + 2);

/// What a drive does when it hears its master no more (6007h): a quick stop.
const STOPS: i16 = 3;

/// The receive PDO that has the set-point of the cyclic mode.
pub(crate) const SET_POINT: u16 = 4;

/// What receive PDO 4 has for a mode's set-point.
const fn alone(mode: Mode) -> &'static [Mapped] {
    macro_rules! alone {
        ($mode:ident) => {{
            const MAPPED: &[Mapped] = &[match Mode::$mode.target() {
                Some(target) => target.mapped(),
                None => panic!("it has a set-point"),
            }];
            MAPPED
        }};
    }
    match mode {
        Mode::InterpolatedPosition => alone!(InterpolatedPosition),
        Mode::CyclicPosition => alone!(CyclicPosition),
        Mode::CyclicVelocity => alone!(CyclicVelocity),
        Mode::CyclicTorque => alone!(CyclicTorque),
        _ => &[],
    }
}

/// What is in receive PDO `number`, 1 to 4.
pub(crate) fn received(axis: &Axis, number: u16) -> &'static [Mapped] {
    match axis.cyclic() {
        Some(mode) if number == SET_POINT => alone(mode),
        _ => of(&axis.profile.receive, number),
    }
}

/// What is in transmit PDO `number`, 1 to 4.
pub(crate) fn transmitted(axis: &Axis, number: u16) -> &'static [Mapped] {
    of(&axis.profile.transmit, number)
}

fn of(set: &[&'static [Mapped]; 4], number: u16) -> &'static [Mapped] {
    number.checked_sub(1).and_then(|at| set.get(usize::from(at))).copied().unwrap_or_default()
}

/// Adds what the node of an axis is told to `list`, behind what it is told otherwise. `sync` is the period of SYNC; zero:
/// there is none, and no cyclic mode.
///
/// # Errors
/// `Full`: there is no room; `list` has some of it.
pub fn push<const N: usize>(list: &mut Vec<u8, N>, axis: &Axis, sync: Duration) -> Result<(), Full> {
    for number in 1..=4 {
        receive(list, axis, number)?;
    }
    for number in 1..=4 {
        transmit(list, axis, number)?;
    }
    if let Some(mode) = axis.cyclic() {
        cyclic(list, axis, mode, sync)?;
    }
    let homing = axis.homing;
    let values = [
        homing.method.map(|method| (HOMING_METHOD, i64::from(method.number()))),
        homing.fast.map(|speed| (HOMING_FAST, speed.into())),
        homing.slow.map(|speed| (HOMING_SLOW, speed.into())),
    ];
    values.into_iter().flatten().try_for_each(|(object, value)| write(list, object, value))
}

/// Adds to `list` what makes a drive stop by itself when the heartbeat of `manager` has not come for `timeout` ms: whom it
/// watches (1016h:1, CiA 301, 7.5.2.11), and what it does then (6007h). Both are optional objects, so this belongs to the
/// wishes of a plan.
///
/// # Errors
/// `Full`: there is no room; `list` has some of it.
pub fn push_watch<const N: usize>(list: &mut Vec<u8, N>, manager: NodeId, timeout: u16) -> Result<(), Full> {
    let watched = u32::from(manager.value()) << 16 | u32::from(timeout);
    dcf::push(list, Entry { address: HEARTBEAT_CONSUMER, data: &watched.to_le_bytes() })?;
    write(list, CONNECTION_OPTION, STOPS.into())
}

fn receive<const N: usize>(list: &mut Vec<u8, N>, axis: &Axis, number: u16) -> Result<(), Full> {
    let Some((pdo, id)) = Pdo::new(Direction::Receive, number).zip(axis.node.rpdo(number)) else {
        return Ok(());
    };
    if axis.cyclic().is_none() || number != SET_POINT {
        return switch_on(list, pdo, id);
    }
    let setup = Setup {
        transmission: Some(Transmission::SyncCyclic(1)),
        mapping: Some(received(axis, number)),
        ..Setup::new(pdo, CobId::new(id))
    };
    in_full(list, setup)
}

fn transmit<const N: usize>(list: &mut Vec<u8, N>, axis: &Axis, number: u16) -> Result<(), Full> {
    let Some((pdo, id)) = Pdo::new(Direction::Transmit, number).zip(axis.node.tpdo(number)) else {
        return Ok(());
    };
    let setup = Setup::new(pdo, CobId::new(id));
    let on_event = Some(Transmission::EventProfile);
    let setup = match (number, axis.cyclic()) {
        (1 | 4, Some(_)) => Setup { cob_id: CobId::new(id).invalid(), ..setup },
        (2, Some(_)) => Setup { inhibit: Some(MODE_INHIBIT), ..setup },
        (3, Some(_)) => Setup { transmission: Some(Transmission::SyncCyclic(1)), ..setup },
        (3, None) => Setup {
            transmission: on_event,
            inhibit: Some(POSITION_INHIBIT),
            event_timer: axis.profile.event_timers.then_some(POSITION_EVENT),
            ..setup
        },
        (4, None) => Setup { transmission: on_event, inhibit: Some(VELOCITY_INHIBIT), ..setup },
        _ => return switch_on(list, pdo, id),
    };
    in_full(list, setup)
}

/// The period and the form of the set-points.
fn cyclic<const N: usize>(
    list: &mut Vec<u8, N>,
    axis: &Axis,
    mode: Mode,
    sync: Duration,
) -> Result<(), Full> {
    let interpolation = axis.profile.interpolation;
    if let Some(period) = Period::new(sync).filter(|_| !interpolation.period_needs_reset) {
        write(list, PERIOD_VALUE, period.value().into())?;
        write(list, PERIOD_EXPONENT, period.exponent().into())?;
    }
    if mode != Mode::InterpolatedPosition {
        return Ok(());
    }
    write(list, INTERPOLATION_SUBMODE, interpolation.submode.into())?;
    if interpolation.says_relative {
        // Before any set-point, which makes the drive take both.
        write(list, INTERPOLATION_RELATIVE, 0)?;
    }
    Ok(())
}

fn switch_on<const N: usize>(list: &mut Vec<u8, N>, pdo: Pdo, id: u16) -> Result<(), Full> {
    dcf::push(list, Entry { address: pdo.communication(1), data: &CobId::new(id).raw().to_le_bytes() })
}

fn in_full<const N: usize>(list: &mut Vec<u8, N>, setup: Setup<'_>) -> Result<(), Full> {
    for write in setup.writes().map_err(|_| Full)? {
        let bytes = write.bytes();
        let data = bytes.get(..usize::from(write.size)).unwrap_or_default();
        dcf::push(list, Entry { address: write.address, data })?;
    }
    Ok(())
}

fn write<const N: usize>(list: &mut Vec<u8, N>, object: Object, value: i64) -> Result<(), Full> {
    let bytes = value.to_le_bytes();
    let data = bytes.get(..object.kind.size()).unwrap_or_default();
    dcf::push(list, Entry { address: object.address, data })
}
