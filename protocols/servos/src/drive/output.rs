//! What a drive is told: the controlword, and the objects that go with it.

use puente_canopen::pdo::{self, Mapped};
use puente_canopen::{Frame, Id};
use puente_drives::cia402::object::{
    CONTROLWORD, HOMING_METHOD, MODE, PROFILE_VELOCITY, TARGET_POSITION, TARGET_TORQUE, TARGET_VELOCITY,
};
use puente_drives::cia402::{Controlword, Object};
use puente_line::Instant;

use crate::Axis;
use crate::setup;

/// The objects that are told, whichever way: some are in a receive PDO, the others are written.
const OBJECTS: [Object; 6] =
    [MODE, TARGET_POSITION, TARGET_VELOCITY, TARGET_TORQUE, PROFILE_VELOCITY, HOMING_METHOD];

/// An object of the drive.
#[derive(Clone, Copy, Debug, Default)]
struct Value {
    /// What it shall be; nothing in particular, if `None`.
    wanted: Option<i64>,
    /// What it was told last since it booted.
    told: Option<i64>,
}

impl Value {
    fn is_due(self) -> bool {
        self.wanted.is_some() && self.wanted != self.told
    }
}

/// What a drive is told.
#[derive(Clone, Debug)]
pub(super) struct Output {
    word: Controlword,
    /// The word that it was told last; `None` where somebody else may have told it another.
    told: Option<Controlword>,
    /// The word goes once more.
    again: bool,
    /// When it was told that.
    at: Instant,
    values: [Value; OBJECTS.len()],
}

impl Output {
    pub const fn new(now: Instant) -> Self {
        let value = Value { wanted: None, told: None };
        Self {
            word: Controlword(0),
            told: None,
            again: false,
            at: now,
            values: [value; OBJECTS.len()],
        }
    }

    /// Nothing is told any more; what it was told does not count.
    pub fn forget(&mut self) {
        self.told = None;
        self.again = false;
        self.values = Default::default();
    }

    /// The word that it shall have.
    pub fn set_word(&mut self, word: Controlword) {
        self.word = word;
    }

    /// The word goes (again), whatever it was told.
    pub fn repeat(&mut self) {
        self.again = true;
    }

    /// The word that it has, as far as is known.
    pub const fn told(&self) -> Option<Controlword> {
        self.told
    }

    /// Since when it has it.
    pub const fn told_at(&self) -> Instant {
        self.at
    }

    /// Whether there is nothing left to be told.
    pub fn is_told(&self) -> bool {
        self.told == Some(self.word) && !self.again && !self.values.iter().any(|value| value.is_due())
    }

    /// What an object shall be.
    pub fn set(&mut self, object: Object, value: i64) {
        if let Some(slot) = self.value(object) {
            slot.wanted = Some(value);
        }
    }

    /// What an object was told; it is not told again.
    pub fn note(&mut self, object: Object, value: i64) {
        if let Some(slot) = self.value(object) {
            *slot = Value { wanted: Some(value), told: Some(value) };
        }
    }

    /// Whether an object was told this last.
    pub fn has(&mut self, object: Object, value: i64) -> bool {
        self.value(object).is_some_and(|slot| slot.told == Some(value))
    }

    /// What an object was told is not known any more.
    pub fn doubt(&mut self, object: Object) {
        if let Some(slot) = self.value(object) {
            slot.told = None;
        }
    }

    /// What is known of an object.
    pub fn known(&mut self, object: Object) -> Option<i64> {
        self.value(object)?.told
    }

    /// An object is left as it is.
    pub fn leave(&mut self, object: Object) {
        if let Some(slot) = self.value(object) {
            slot.wanted = slot.told;
        }
    }

    fn value(&mut self, object: Object) -> Option<&mut Value> {
        let at = OBJECTS.iter().position(|known| *known == object)?;
        self.values.get_mut(at)
    }

    /// Whether the word, when it goes, brings something about that what goes with it must be there for.
    fn urges(&self) -> bool {
        let told = self.told.unwrap_or_default().0;
        let rising = self.word.0 & !told;
        let falling = told & !self.word.0;
        rising & (Controlword::ENABLE_OPERATION | Controlword::MODE_4) != 0
            || falling & Controlword::HALT != 0 && self.word.has(Controlword::ENABLE_OPERATION)
    }

    fn word_is_due(&self) -> bool {
        self.again || self.told != Some(self.word)
    }

    /// The word alone, at once.
    pub fn word_frame(&mut self, now: Instant, axis: &Axis) -> Option<Frame> {
        let frame = pdo(axis, self.word, None)?;
        self.told = Some(self.word);
        self.again = false;
        self.at = now;
        Some(frame)
    }

    /// The next frame. A word that stops something goes before all else; one that lets something begin, after all else, and
    /// after what has to be written.
    pub fn frame(&mut self, now: Instant, axis: &Axis) -> Option<Frame> {
        let word_is_due = self.word_is_due();
        if word_is_due && !self.urges() {
            return self.word_frame(now, axis);
        }
        // They carry the word as it is.
        let word = self.told?;
        for (object, slot) in OBJECTS.iter().zip(&mut self.values).filter(|(_, slot)| slot.is_due()) {
            let Some(frame) = slot.wanted.and_then(|value| pdo(axis, word, Some((*object, value)))) else {
                continue;
            };
            slot.told = slot.wanted;
            return Some(frame);
        }
        if word_is_due && self.write(axis).is_none() { self.word_frame(now, axis) } else { None }
    }

    /// An object that no PDO has, and what is to be written to it.
    pub fn write(&self, axis: &Axis) -> Option<(Object, i64)> {
        let due = OBJECTS.iter().zip(&self.values).filter(|(_, slot)| slot.is_due());
        let mut unmapped = due.filter(|(object, _)| number_of(axis, **object).is_none());
        unmapped.next().and_then(|(object, slot)| Some((*object, slot.wanted?)))
    }
}

/// The receive PDO that has a controlword and an object.
fn number_of(axis: &Axis, object: Object) -> Option<u16> {
    (1..=4).find(|number| {
        let mapping = setup::received(axis, *number);
        has(mapping, CONTROLWORD) && has(mapping, object)
    })
}

fn has(mapping: &[Mapped], object: Object) -> bool {
    mapping.iter().any(|mapped| mapped.address == object.address)
}

/// The frame of a controlword, with an object where one is given.
fn pdo(axis: &Axis, word: Controlword, with: Option<(Object, i64)>) -> Option<Frame> {
    let number = number_of(axis, with.map_or(CONTROLWORD, |(object, _)| object))?;
    let mapping = setup::received(axis, number);
    let mut data = [0; 8];
    pdo::put(mapping, &mut data, CONTROLWORD.address, word.0.into());
    if let Some((object, value)) = with {
        pdo::put(mapping, &mut data, object.address, value as u64);
    }
    Frame::new(Id::base(axis.node.rpdo(number)?), data.get(..pdo::bytes(mapping))?)
}

/// The frame of the cyclic mode's set-point.
pub(super) fn set_point(axis: &Axis, value: i32) -> Option<Frame> {
    let mapping = setup::received(axis, setup::SET_POINT);
    let mut data = [0; 8];
    let target = axis.cyclic()?.target()?;
    pdo::put(mapping, &mut data, target.address, i64::from(value) as u64);
    Frame::new(Id::base(axis.node.rpdo(setup::SET_POINT)?), data.get(..pdo::bytes(mapping))?)
}
