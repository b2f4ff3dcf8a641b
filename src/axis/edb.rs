//! The axis commands as sequences of EDB register accesses.

use puente_drives::edb::{Monitor, Registers, Status};

use super::link::{Link, MISFIT};
use super::{AxisError, Jog, Known, Snapshot};
use crate::clock;
use crate::desk::{Class, Permit};

const OFF: u16 = 0;
const ON: u16 = 1;

/// Reads status word and monitor block: two requests.
pub(super) async fn read(link: &Link<'_>, registers: &Registers) -> Result<Snapshot, AxisError> {
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
pub(super) async fn enable(link: &Link<'_>, registers: &Registers, permit: Permit) -> Result<(), AxisError> {
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
pub(super) async fn disable(link: &Link<'_>, registers: &Registers) -> Result<(), AxisError> {
    stop_writes(link, [registers.jog_enable, registers.jog_forward, registers.jog_reverse]).await
}

/// Clears both directions, the running one first.
pub(super) async fn stop(link: &Link<'_>, registers: &Registers, jog: Jog) -> Result<(), AxisError> {
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
pub(super) async fn jog(
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
pub(super) async fn clear(link: &Link<'_>, registers: &Registers, permit: Permit) -> Result<(), AxisError> {
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
