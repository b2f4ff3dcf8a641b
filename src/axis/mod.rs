//! The uniform axis: the same commands whatever the drive speaks.
//!
//! [`Axes`] finds an axis by its name, keeps what is known of it, and holds each command to the rules that every drive
//! shares: the lease, no motion without `enable`, no jump on enabling, stop for everyone.

mod edb;
mod error;
mod link;
mod raw;

use core::cell::RefCell;

use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use heapless::{String, Vec};
use puente_drives::edb::{Monitor, Parameter, Registers, Status};
use puente_line::{Duration, Instant};

pub use error::AxisError;
pub use raw::Ruling;

use crate::clock;
use crate::desk::{Cause, Class, Desk, Event, Failure, Holder, Reason};
use crate::port::limits::AXES;
use link::Link;

type Shared<T> = Mutex<CriticalSectionRawMutex, RefCell<T>>;
/// One sequence of writes at a time on an axis; a stop does not wait for it.
type Turn = embassy_sync::mutex::Mutex<CriticalSectionRawMutex, ()>;

/// So many stops without confirmation are told, and repeated soon; then more slowly.
const STOP_ATTEMPTS: u32 = 10;
/// Speed of a motor at rest, at most, in r/min: what is measured of a servo that holds its position may flicker.
const STANDSTILL_RPM: u16 = 1;

/// What the configuration says of an axis.
#[derive(Clone, Debug)]
pub struct AxisSpec {
    /// Name in commands and paths.
    pub name: String<16>,
    /// Index of its bus.
    pub bus: u8,
    /// Name of its bus.
    pub bus_name: String<16>,
    /// Modbus address of the drive, 1 to 247.
    pub address: u8,
    /// Highest speed that a jog may ask for, in r/min.
    pub max_rpm: u16,
    /// Where the drive keeps what.
    pub registers: Registers,
}

/// Who gives a command.
#[derive(Clone, Copy, Debug)]
pub struct Commander {
    /// Its place at the gateway, for the fair order of requests.
    pub seat: u8,
    /// As whom it holds leases.
    pub holder: Holder,
}

/// What the axis is doing, as far as the gateway's own confirmed writes tell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Jog {
    /// Neither direction is commanded.
    Still,
    /// Jogging at this speed in r/min, negative for reverse.
    At(i16),
    /// Not known: the gateway has just started, or a write was not confirmed.
    Unknown,
}

/// Values read from a drive at one moment.
#[derive(Clone, Copy, Debug)]
pub struct Snapshot {
    /// When the last of them arrived.
    pub at: Instant,
    /// Status word 0901h.
    pub status: Status,
    /// Monitor values.
    pub monitor: Monitor,
}

/// What is known of an axis.
#[derive(Clone, Copy, Debug)]
pub struct Known {
    /// Servo enabled through the gateway; none where not known.
    pub enabled: Option<bool>,
    /// Commanded jog.
    pub jog: Jog,
    /// The last values read.
    pub snapshot: Option<Snapshot>,
}

/// One axis.
pub struct Axis {
    /// Its configuration.
    pub spec: AxisSpec,
    known: Shared<Known>,
    turn: Turn,
    refresh: Turn,
}

/// All axes of the gateway.
pub struct Axes {
    /// The desk that carries their requests.
    pub desk: &'static Desk,
    list: Vec<Axis, AXES>,
}

impl Axis {
    /// What is known of it.
    pub fn known(&self) -> Known {
        self.known.lock(|known| *known.borrow())
    }

    fn update(&self, f: impl FnOnce(&mut Known)) {
        self.known.lock(|known| f(&mut known.borrow_mut()));
    }

    /// Nothing is certain any more, for instance after a write past the axis commands.
    fn forget(&self) {
        self.update(|known| {
            known.enabled = None;
            known.jog = Jog::Unknown;
        });
    }
}

impl Axes {
    /// The axes of a configuration; at most [`AXES`] count.
    pub fn new(desk: &'static Desk, specs: impl IntoIterator<Item = AxisSpec>) -> Self {
        let axis = |spec| Axis {
            spec,
            known: Mutex::new(RefCell::new(Known { enabled: None, jog: Jog::Unknown, snapshot: None })),
            turn: Turn::new(()),
            refresh: Turn::new(()),
        };
        Self { desk, list: specs.into_iter().take(AXES).map(axis).collect() }
    }

    /// All of them, with their numbers.
    pub fn iter(&self) -> impl Iterator<Item = (u8, &Axis)> {
        self.list.iter().enumerate().map(|(index, axis)| (index as u8, axis))
    }

    /// The number of the axis of this name.
    pub fn find(&self, name: &str) -> Result<u8, AxisError> {
        self.iter().find(|(_, axis)| axis.spec.name == name).map(|(id, _)| id).ok_or(AxisError::UnknownAxis)
    }

    /// An axis by its number.
    pub fn get(&self, id: u8) -> Result<&Axis, AxisError> {
        self.list.get(usize::from(id)).ok_or(AxisError::UnknownAxis)
    }

    /// Who holds the axis, and for how long.
    pub fn leased(&self, id: u8) -> Option<(Holder, Duration)> {
        self.desk.leased(clock::now(), id)
    }

    /// How the last commander lost the axis, until cleared.
    pub fn event(&self, id: u8) -> Option<Event> {
        self.desk.event(id)
    }

    fn link<'a>(&'a self, axis: &Axis, seat: u8) -> Link<'a> {
        Link { desk: self.desk, seat, bus: axis.spec.bus, unit: axis.spec.address }
    }

    /// Values of the drive, not older than `max_age`. Readers that ask at once share one reading.
    pub async fn status(&self, id: u8, by: Commander, max_age: Duration) -> Result<Snapshot, AxisError> {
        let axis = self.get(id)?;
        let asked = clock::now();
        let _turn = axis.refresh.lock().await;
        if let Some(snapshot) = axis.known().snapshot
            && (snapshot.at >= asked || asked.since(snapshot.at) <= max_age && max_age > Duration::ZERO)
        {
            return Ok(snapshot);
        }
        let snapshot = edb::read(&self.link(axis, by.seat), &axis.spec.registers).await?;
        axis.update(|known| {
            known.snapshot = Some(snapshot);
            if snapshot.status.alarm() {
                // The drive has dropped the servo by itself.
                known.enabled = None;
                known.jog = Jog::Unknown;
            }
        });
        Ok(snapshot)
    }

    /// Enables the servo at standstill: both jog directions are cleared first, so that nothing moves.
    pub async fn enable(&self, id: u8, by: Commander) -> Result<(), AxisError> {
        let axis = self.get(id)?;
        let permit = self.desk.permit(clock::now(), id, by.holder)?;
        let _turn = axis.turn.lock().await;
        axis.forget();
        edb::enable(&self.link(axis, by.seat), &axis.spec.registers, permit).await?;
        // A jog of this commander's own has ended with it.
        self.desk.release(permit);
        axis.update(|known| {
            known.enabled = Some(true);
            known.jog = Jog::Still;
        });
        Ok(())
    }

    /// Disables the servo. Allowed to everyone, at any time; the axis coasts if it was moving.
    pub async fn disable(&self, id: u8, by: Commander) -> Result<(), AxisError> {
        let axis = self.get(id)?;
        let duty = self.desk.revoke(clock::now(), id, by.holder);
        axis.forget();
        edb::disable(&self.link(axis, by.seat), &axis.spec.registers).await?;
        duty.done();
        axis.update(|known| {
            known.enabled = Some(false);
            known.jog = Jog::Still;
        });
        Ok(())
    }

    /// Stops the axis by the drive's own ramp; it stays enabled. Allowed to everyone, at any time. Where that ended a
    /// lease and the drive does not confirm it, the gateway goes on trying.
    pub async fn stop(&self, id: u8, by: Commander) -> Result<(), AxisError> {
        let axis = self.get(id)?;
        let jog = axis.known().jog;
        let duty = self.desk.revoke(clock::now(), id, by.holder);
        axis.update(|known| known.jog = Jog::Unknown);
        edb::stop(&self.link(axis, by.seat), &axis.spec.registers, jog).await?;
        duty.done();
        axis.update(|known| known.jog = Jog::Still);
        Ok(())
    }

    /// Turns the axis at `rpm` r/min, negative for reverse, while its commander shows life; 0 stops it. Takes the
    /// lease for `hold`, or for the configured time.
    pub async fn jog(
        &self,
        id: u8,
        by: Commander,
        rpm: i32,
        hold: Option<Duration>,
    ) -> Result<(), AxisError> {
        let axis = self.get(id)?;
        let max = i32::from(axis.spec.max_rpm);
        let speed = match i16::try_from(rpm) {
            Ok(speed) if rpm.abs() <= max => speed,
            _ => return Err(AxisError::Range { value: rpm, min: -max, max }),
        };
        if speed == 0 {
            return self.stop(id, by).await;
        }
        let permit = self.desk.lease(clock::now(), id, by.holder, hold)?;
        let _turn = axis.turn.lock().await;
        let known = axis.known();
        if known.jog == Jog::At(speed) && known.enabled == Some(true) {
            return Ok(());
        }
        let result = edb::jog(&self.link(axis, by.seat), &axis.spec.registers, permit, &known, speed).await;
        match result {
            Ok(()) if self.desk.moving(clock::now(), permit) => axis.update(|known| {
                known.enabled = Some(true);
                known.jog = Jog::At(speed);
            }),
            // A stop has come right behind it.
            Ok(()) => return Err(Failure::NotSent(Reason::Stopped).into()),
            // The write may have reached the drive: keep the lease, so that its end stops the axis.
            Err(AxisError::Failure(Failure::NoReply(_))) => {
                axis.forget();
                self.desk.moving(clock::now(), permit);
            }
            Err(error) => {
                axis.forget();
                if error == AxisError::NotEnabled {
                    axis.update(|known| known.enabled = Some(false));
                }
                self.desk.unlease(permit);
            }
        }
        result
    }

    /// Whether the motor of any axis turns, by its drive's own word. A drive that does not answer has no part in it:
    /// what this gateway has set in motion is under a lease, or is being stopped.
    pub async fn turning(&self, by: Commander) -> bool {
        for (id, _) in self.iter() {
            if let Ok(snapshot) = self.status(id, by, Duration::ZERO).await
                && snapshot.monitor.speed_feedback.unsigned_abs() > STANDSTILL_RPM
            {
                return true;
            }
        }
        false
    }

    /// Reads a parameter.
    pub async fn parameter(&self, id: u8, by: Commander, parameter: Parameter) -> Result<u16, AxisError> {
        let axis = self.get(id)?;
        self.link(axis, by.seat).read(parameter.address(), Class::Free).await
    }

    /// Writes a parameter: one request, sent once.
    pub async fn set_parameter(
        &self,
        id: u8,
        by: Commander,
        parameter: Parameter,
        value: u16,
    ) -> Result<(), AxisError> {
        let axis = self.get(id)?;
        let permit = self.desk.permit(clock::now(), id, by.holder)?;
        if parameter.address() == axis.spec.registers.jog_speed {
            // A running jog changes its speed with it.
            axis.forget();
        }
        self.link(axis, by.seat).write(parameter.address(), value, Class::Guarded(permit)).await
    }

    /// The number of the present alarm, 0 for none.
    pub async fn alarm(&self, id: u8, by: Commander) -> Result<u16, AxisError> {
        let axis = self.get(id)?;
        self.link(axis, by.seat).read(axis.spec.registers.alarm, Class::Free).await
    }

    /// Clears the alarm and the latched event. The jog commands and the servo are switched off first, so that the axis
    /// stays at rest until it is enabled again.
    pub async fn clear(&self, id: u8, by: Commander) -> Result<(), AxisError> {
        let axis = self.get(id)?;
        let permit = self.desk.permit(clock::now(), id, by.holder)?;
        let _turn = axis.turn.lock().await;
        axis.forget();
        edb::clear(&self.link(axis, by.seat), &axis.spec.registers, permit).await?;
        self.desk.release(permit);
        self.desk.clear_event(id);
        axis.update(|known| {
            known.enabled = Some(false);
            known.jog = Jog::Still;
        });
        Ok(())
    }

    /// Stops the axis whenever its lease is lost, and repeats that until the drive confirms. One task an axis.
    pub async fn watch(&self, id: u8) -> ! {
        let by = Commander { seat: crate::port::limits::SLOTS as u8 + id, holder: Holder::Gateway };
        let name = self.get(id).map_or("?", |axis| axis.spec.name.as_str());
        loop {
            let cause = self.desk.owed(id).await;
            log::warn!("axis {name}: {}, stopping it", cause.name());
            let mut failed = 0;
            while self.desk.owes(id) {
                let begun = clock::now();
                let Err(error) = self.stop(id, by).await else { break };
                failed += 1;
                if failed <= STOP_ATTEMPTS {
                    log::error!("axis {name}: stop attempt {failed}: {error}");
                }
                if failed == STOP_ATTEMPTS {
                    self.desk.stop_unconfirmed(clock::now(), id);
                    log::error!("axis {name}: {}, still trying", Cause::StopUnconfirmed.name());
                }
                let pause = stop_pause(clock::now().since(begun), failed);
                embassy_time::Timer::after_micros(puente_line::micros(pause)).await;
            }
        }
    }
}

/// Time between two stops that `took` so long each, after so many that failed. The other drives of the bus have half of
/// the line at first, and later as much as they have beside any dead drive.
fn stop_pause(took: Duration, failed: u32) -> Duration {
    if failed < STOP_ATTEMPTS {
        took.max(Duration::from_millis(100))
    } else {
        took.saturating_mul(9).clamp(Duration::from_secs(1), Duration::from_secs(10))
    }
}
