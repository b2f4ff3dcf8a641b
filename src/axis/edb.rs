//! The axis commands as sequences of EDB register accesses, and what is known of the drive by them.

use core::cell::RefCell;

use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use puente_drives::edb::{Monitor, Registers, Status};
use puente_line::{Duration, Instant};

use super::link::{Link, MISFIT};
use super::{AxisError, Turn};
use crate::clock;
use crate::desk::{Class, Failure, Permit, Reason};

const OFF: u16 = 0;
const ON: u16 = 1;
/// Speed of a motor at rest, at most, in r/min: what is measured of a servo that holds its position may flicker.
const STANDSTILL_RPM: u16 = 1;

/// What the configuration says of a drive.
#[derive(Clone, Copy, Debug)]
pub struct Spec {
    /// Highest speed that a jog may ask for, in r/min.
    pub max_rpm: u16,
    /// Where the drive keeps what.
    pub registers: Registers,
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

/// What is known of a drive.
#[derive(Clone, Copy, Debug)]
pub struct Known {
    /// Servo enabled through the gateway; none where not known.
    pub enabled: Option<bool>,
    /// Commanded jog.
    pub jog: Jog,
    /// The last values read.
    pub snapshot: Option<Snapshot>,
}

/// A drive.
pub(super) struct Drive {
    pub(super) spec: Spec,
    known: Mutex<CriticalSectionRawMutex, RefCell<Known>>,
    refresh: Turn,
}

impl Drive {
    pub(super) const fn new(spec: Spec) -> Self {
        let known = Known { enabled: None, jog: Jog::Unknown, snapshot: None };
        Self { spec, known: Mutex::new(RefCell::new(known)), refresh: Turn::new(()) }
    }

    pub(super) fn known(&self) -> Known {
        self.known.lock(|known| *known.borrow())
    }

    fn update(&self, f: impl FnOnce(&mut Known)) {
        self.known.lock(|known| f(&mut known.borrow_mut()));
    }

    /// Nothing is certain any more, for instance after a write past the axis commands.
    pub(super) fn forget(&self) {
        self.update(|known| {
            known.enabled = None;
            known.jog = Jog::Unknown;
        });
    }

    /// The drive is at rest, and its servo as told.
    fn rests(&self, enabled: bool) {
        self.update(|known| {
            known.enabled = Some(enabled);
            known.jog = Jog::Still;
        });
    }

    /// Values of the drive, not older than `max_age`. Readers that ask at once share one reading.
    pub(super) async fn status(&self, link: &Link<'_>, max_age: Duration) -> Result<Snapshot, AxisError> {
        let asked = clock::now();
        let _turn = self.refresh.lock().await;
        if let Some(snapshot) = self.known().snapshot
            && (snapshot.at >= asked || asked.since(snapshot.at) <= max_age && max_age > Duration::ZERO)
        {
            return Ok(snapshot);
        }
        let snapshot = read(link, &self.spec.registers).await?;
        self.update(|known| {
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
    pub(super) async fn enable(&self, link: &Link<'_>, permit: Permit) -> Result<(), AxisError> {
        self.forget();
        enable(link, &self.spec.registers, permit).await?;
        self.rests(true);
        Ok(())
    }

    /// Disables the servo; the axis coasts if it was moving.
    pub(super) async fn disable(&self, link: &Link<'_>) -> Result<(), AxisError> {
        self.forget();
        disable(link, &self.spec.registers).await?;
        self.rests(false);
        Ok(())
    }

    /// Stops the axis by the drive's own ramp; it stays enabled.
    pub(super) async fn stop(&self, link: &Link<'_>) -> Result<(), AxisError> {
        let jog = self.known().jog;
        self.update(|known| known.jog = Jog::Unknown);
        stop(link, &self.spec.registers, jog).await?;
        self.update(|known| known.jog = Jog::Still);
        Ok(())
    }

    /// The speed of a jog, where it may be asked for.
    pub(super) fn speed(&self, rpm: i32) -> Result<i16, AxisError> {
        let max = i32::from(self.spec.max_rpm);
        match i16::try_from(rpm) {
            Ok(speed) if rpm.abs() <= max => Ok(speed),
            _ => Err(AxisError::Range { value: rpm, min: -max, max }),
        }
    }

    /// Turns the axis, under the lease of this permit. `speed` is not 0.
    pub(super) async fn jog(&self, link: &Link<'_>, permit: Permit, speed: i16) -> Result<(), AxisError> {
        let known = self.known();
        if known.jog == Jog::At(speed) && known.enabled == Some(true) {
            return Ok(());
        }
        let result = jog(link, &self.spec.registers, permit, &known, speed).await;
        match result {
            Ok(()) if link.desk.moving(clock::now(), permit) => self.update(|known| {
                known.enabled = Some(true);
                known.jog = Jog::At(speed);
            }),
            // A stop has come right behind it.
            Ok(()) => return Err(Failure::NotSent(Reason::Stopped).into()),
            // The write may have reached the drive: keep the lease, so that its end stops the axis.
            Err(AxisError::Failure(Failure::NoReply(_))) => {
                self.forget();
                link.desk.moving(clock::now(), permit);
            }
            Err(error) => {
                self.forget();
                if error == AxisError::NotEnabled {
                    self.update(|known| known.enabled = Some(false));
                }
                link.desk.unlease(permit);
            }
        }
        result
    }

    /// Clears the alarm. The jog commands and the servo are switched off first, so that the axis stays at rest until it
    /// is enabled again.
    pub(super) async fn clear(&self, link: &Link<'_>, permit: Permit) -> Result<(), AxisError> {
        self.forget();
        clear(link, &self.spec.registers, permit).await?;
        self.rests(false);
        Ok(())
    }
}

/// Whether the motor turns.
pub(super) fn turns(snapshot: &Snapshot) -> bool {
    snapshot.monitor.speed_feedback.unsigned_abs() > STANDSTILL_RPM
}

/// Reads status word and monitor block: two requests.
async fn read(link: &Link<'_>, registers: &Registers) -> Result<Snapshot, AxisError> {
    let status = Status(link.read(registers.status, Class::Free).await?);
    let block = link.read_many(registers.speed_feedback, Monitor::WORDS as u16, Class::Free).await?;
    let monitor = Monitor::decode(block).ok_or(MISFIT)?;
    Ok(Snapshot { at: clock::now(), status, monitor })
}

/// Refuses where the drive shows an alarm.
async fn no_alarm(link: &Link<'_>, registers: &Registers, class: Class) -> Result<(), AxisError> {
    if Status(link.read(registers.status, class).await?).alarm() {
        return Err(AxisError::Alarm(link.read(registers.alarm, class).await?));
    }
    Ok(())
}

/// Clears both directions, then switches the servo on.
async fn enable(link: &Link<'_>, registers: &Registers, permit: Permit) -> Result<(), AxisError> {
    let class = Class::Motion(permit);
    no_alarm(link, registers, class).await?;
    for (register, value) in
        [(registers.jog_forward, OFF), (registers.jog_reverse, OFF), (registers.jog_enable, ON)]
    {
        link.write(register, value, class).await?;
    }
    Ok(())
}

/// Switches the servo off, then clears both directions.
async fn disable(link: &Link<'_>, registers: &Registers) -> Result<(), AxisError> {
    stop_writes(link, [registers.jog_enable, registers.jog_forward, registers.jog_reverse]).await
}

/// Clears both directions, the running one first.
async fn stop(link: &Link<'_>, registers: &Registers, jog: Jog) -> Result<(), AxisError> {
    match jog {
        Jog::At(..0) => stop_writes(link, [registers.jog_reverse, registers.jog_forward]).await,
        Jog::At(_) | Jog::Still | Jog::Unknown => {
            stop_writes(link, [registers.jog_forward, registers.jog_reverse]).await
        }
    }
}

/// Queues zeros for all these registers at once, so that nothing comes between them; the first error is told when all
/// have ended.
async fn stop_writes<const N: usize>(link: &Link<'_>, registers: [u16; N]) -> Result<(), AxisError> {
    let writes = registers.map(|register| link.start_write(register, OFF, Class::Stop));
    let mut result = Ok(());
    for write in writes {
        let ended = match write {
            Ok(write) => write.confirmed().await,
            Err(error) => Err(error),
        };
        result = result.and(ended);
    }
    result
}

/// Starts or changes a jog. `rpm` is not 0.
async fn jog(
    link: &Link<'_>,
    registers: &Registers,
    permit: Permit,
    known: &Known,
    rpm: i16,
) -> Result<(), AxisError> {
    let class = Class::Motion(permit);
    let (direction, opposite) = match rpm {
        ..0 => (registers.jog_reverse, registers.jog_forward),
        0.. => (registers.jog_forward, registers.jog_reverse),
    };
    let same_direction = matches!(known.jog, Jog::At(speed) if (speed < 0) == (rpm < 0));
    if !same_direction {
        let enabled = match known.enabled {
            Some(enabled) => enabled,
            None => link.read(registers.jog_enable, class).await? == ON,
        };
        if !enabled {
            return Err(AxisError::NotEnabled);
        }
        no_alarm(link, registers, class).await?;
        if known.jog != Jog::Still {
            link.write(opposite, OFF, class).await?;
        }
    }
    link.write(registers.jog_speed, rpm.unsigned_abs(), class).await?;
    if !same_direction {
        link.write(direction, ON, class).await?;
    }
    Ok(())
}

/// Takes every command off the drive, then clears its alarm.
async fn clear(link: &Link<'_>, registers: &Registers, permit: Permit) -> Result<(), AxisError> {
    for (register, value) in [
        (registers.jog_forward, OFF),
        (registers.jog_reverse, OFF),
        (registers.jog_enable, OFF),
        (registers.clear_alarm, ON),
    ] {
        link.write(register, value, Class::Guarded(permit)).await?;
    }
    Ok(())
}
