//! Which port each idle place listens on.
//!
//! A place listens on one port at a time, and whoever finds no place listening has to wait. So a place goes back to where
//! its last client came, who may be about to come again; and one comes over from the other door for everybody who has to
//! wait, and where hardly any is left.

use core::cell::Cell;

use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::watch::{Receiver, Watch};

use crate::port::Door;
use crate::port::embedded::limits::SLOTS;

/// Idle places that a door keeps while nobody waits at the other one.
const KEPT: usize = 2;

/// A door.
#[derive(Clone, Copy)]
struct Side {
    /// Places that listen there.
    idle: usize,
    /// Clients that had to wait, and for whom no place has come free or over yet.
    waiting: usize,
}

impl Side {
    const EMPTY: Self = Self { idle: 0, waiting: 0 };

    fn wants(self) -> bool {
        self.waiting > 0 || self.idle < KEPT
    }

    /// Whether it can spare a place for `other`: its last one where somebody waits there, its last but one where there is
    /// none.
    fn can_give(self, other: Self) -> bool {
        let kept = match other {
            Self { waiting: 1.., .. } => 0,
            Self { idle: 0, .. } => 1,
            _ => KEPT,
        };
        self.waiting == 0 && self.idle > kept
    }
}

/// The main and the Modbus/TCP door.
static SIDES: Mutex<CriticalSectionRawMutex, Cell<[Side; 2]>> = Mutex::new(Cell::new([Side::EMPTY; 2]));
static CHANGED: Watch<CriticalSectionRawMutex, (), SLOTS> = Watch::new();

/// Changes what is known of a door and of the other one, and tells all places.
fn change<R>(door: Door, f: impl FnOnce(&mut Side, &mut Side) -> R) -> R {
    let result = SIDES.lock(|sides| {
        let [mut main, mut modbus] = sides.get();
        let result = match door {
            Door::Main => f(&mut main, &mut modbus),
            _ => f(&mut modbus, &mut main),
        };
        sides.set([main, modbus]);
        result
    });
    CHANGED.sender().send(());
    result
}

/// A client found no place listening, and has to wait.
pub(super) fn missed(door: Door) {
    change(door, |side, _| side.waiting = (side.waiting + 1).min(SLOTS));
}

/// One place's part in it.
pub(super) struct Post {
    door: Option<Door>,
    /// Where the last client came.
    last: Option<Door>,
    changed: Receiver<'static, CriticalSectionRawMutex, (), SLOTS>,
}

impl Post {
    /// One for every place; none beyond [`SLOTS`].
    pub(super) fn new() -> Option<Self> {
        Some(Self { door: None, last: None, changed: CHANGED.receiver()? })
    }

    /// The door to listen at: as before; for a place that was busy, that of its client; at first, the one with fewer idle
    /// places.
    pub(super) fn take(&mut self) -> Door {
        if let Some(door) = self.door {
            return door;
        }
        let [main, modbus] = SIDES.lock(Cell::get);
        let fewer = if main.idle <= modbus.idle { Door::Main } else { Door::Modbus };
        let door = self.last.unwrap_or(fewer);
        self.door = Some(door);
        change(door, |side, _| {
            side.idle += 1;
            side.waiting = side.waiting.saturating_sub(1);
        });
        door
    }

    /// The place has a client, and is idle no more.
    pub(super) fn leave(&mut self) {
        let Some(door) = self.door.take() else { return };
        self.last = Some(door);
        change(door, |side, _| side.idle = side.idle.saturating_sub(1));
    }

    /// Resolves when anything has changed at the doors.
    pub(super) async fn changed(&mut self) {
        self.changed.changed().await;
    }

    /// Goes over to the other door, where a place is wanted there and can be spared here; whether it did.
    pub(super) fn moves(&mut self) -> bool {
        let [main, modbus] = SIDES.lock(Cell::get);
        let to = match self.door {
            Some(Door::Main) if modbus.wants() && main.can_give(modbus) => Door::Modbus,
            Some(Door::Modbus) if main.wants() && modbus.can_give(main) => Door::Main,
            _ => return false,
        };
        change(to, |side, other| {
            side.idle += 1;
            side.waiting = side.waiting.saturating_sub(1);
            other.idle = other.idle.saturating_sub(1);
        });
        self.door = Some(to);
        true
    }
}
