//! Which port each idle place listens on.
//!
//! A place listens on one port at a time, and the stack refuses whoever finds no place listening. So the idle places
//! share themselves out evenly, anew whenever one of them has got a client.

use core::cell::Cell;

use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::watch::{Receiver, Watch};

use super::limits::SLOTS;
use crate::port::Door;

/// Idle places on the main and on the Modbus/TCP port.
static IDLE: Mutex<CriticalSectionRawMutex, Cell<(usize, usize)>> = Mutex::new(Cell::new((0, 0)));
static CHANGED: Watch<CriticalSectionRawMutex, (), SLOTS> = Watch::new();

/// One place's part in it.
pub(super) struct Post {
    door: Option<Door>,
    changed: Receiver<'static, CriticalSectionRawMutex, (), SLOTS>,
}

impl Post {
    /// One for every place; none beyond [`SLOTS`].
    pub(super) fn new() -> Option<Self> {
        Some(Self { door: None, changed: CHANGED.receiver()? })
    }

    /// The door to listen at: as before, or, for a place that was busy, the one with fewer idle places.
    pub(super) fn take(&mut self) -> Door {
        if let Some(door) = self.door {
            return door;
        }
        let door = IDLE.lock(|idle| {
            let (main, modbus) = idle.get();
            let (door, after) = if main <= modbus {
                (Door::Main, (main + 1, modbus))
            } else {
                (Door::Modbus, (main, modbus + 1))
            };
            idle.set(after);
            door
        });
        self.door = Some(door);
        CHANGED.sender().send(());
        door
    }

    /// The place has a client, and is idle no more.
    pub(super) fn leave(&mut self) {
        let Some(door) = self.door.take() else { return };
        IDLE.lock(|idle| {
            let (main, modbus) = idle.get();
            idle.set(match door {
                Door::Main => (main.saturating_sub(1), modbus),
                Door::Modbus => (main, modbus.saturating_sub(1)),
            });
        });
        CHANGED.sender().send(());
    }

    /// Resolves when this place has changed to the other door, where idle places are fewer.
    pub(super) async fn moved(&mut self) {
        while !self.step() {
            self.changed.changed().await;
        }
    }

    /// Changes doors if that makes the numbers more even.
    fn step(&mut self) -> bool {
        let Some(door) = self.door else { return false };
        let next = IDLE.lock(|idle| {
            let (main, modbus) = idle.get();
            let (next, after) = match door {
                Door::Main if main > modbus + 1 => (Door::Modbus, (main - 1, modbus + 1)),
                Door::Modbus if modbus > main + 1 => (Door::Main, (main + 1, modbus - 1)),
                _ => return None,
            };
            idle.set(after);
            Some(next)
        });
        self.door = next.or(self.door);
        next.is_some()
    }
}
