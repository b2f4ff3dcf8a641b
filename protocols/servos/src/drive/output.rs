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
    /// Its bits, what it shall be; nothing in particular, if `None`.
    wanted: Option<u32>,
    /// What it was told last since it booted.
    told: Option<u32>,
}

impl Value {
    fn is_due(self) -> bool {
        self.wanted.is_some() && self.wanted != self.told
    }
}

/// What a drive is told.
#[derive(Clone, Debug)]
pub(super) struct Output {
    /// The word that it shall have; `None`: nothing is to be told.
    word: Option<Controlword>,
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
        Self { word: None, told: None, again: false, at: now, values: [value; OBJECTS.len()] }
    }

    /// Nothing is to be told, and nothing that it was told may be so any more.
    pub fn forget(&mut self) {
        *self = Self::new(self.at);
    }

    /// All objects are left as they are.
    pub fn leave_all(&mut self) {
        for value in &mut self.values {
            value.wanted = None;
        }
    }

    /// The word that it shall have.
    pub const fn word(&self) -> Option<Controlword> {
        self.word
    }

    /// Sets the word that it shall have.
    pub fn set_word(&mut self, word: Controlword) {
        self.word = Some(word);
    }

    /// What would let something begin is not told.
    pub fn drop_urging(&mut self) {
        if !self.stops() {
            self.word = self.told;
        }
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
        self.told.is_some()
            && self.told == self.word
            && !self.again
            && !self.values.iter().any(|value| value.is_due())
    }

    /// What an object shall be.
    pub fn set(&mut self, object: Object, value: i64) {
        if let Some(slot) = self.value(object) {
            slot.wanted = Some(value as u32);
        }
    }

    /// What an object was told; it is not told again.
    pub fn note(&mut self, object: Object, value: i64) {
        if let Some(slot) = self.value(object) {
            *slot = Value { wanted: Some(value as u32), told: Some(value as u32) };
        }
    }

    /// What an object was told is not known any more.
    pub fn doubt(&mut self, object: Object) {
        if let Some(slot) = self.value(object) {
            slot.told = None;
        }
    }

    /// What is known of an object.
    pub fn known(&mut self, object: Object) -> Option<i64> {
        Some(object.kind.extend(self.value(object)?.told?))
    }

    /// An object is left as it is.
    pub fn leave(&mut self, object: Object) {
        if let Some(slot) = self.value(object) {
            slot.wanted = None;
        }
    }

    fn value(&mut self, object: Object) -> Option<&mut Value> {
        let at = OBJECTS.iter().position(|known| *known == object)?;
        self.values.get_mut(at)
    }

    /// Whether the word, when it goes, brings something about that what goes with it must be there for.
    fn urges(&self) -> bool {
        let (Some(word), Some(told)) = (self.word, self.told) else {
            return false;
        };
        let rising = word.0 & !told.0;
        let falling = told.0 & !word.0;
        rising & (Controlword::ENABLE_OPERATION | Controlword::MODE_4) != 0
            || falling & Controlword::HALT != 0 && word.has(Controlword::ENABLE_OPERATION)
    }

    fn word_is_due(&self) -> bool {
        self.word.is_some() && (self.again || self.told != self.word)
    }

    /// Whether the word is due, and lets nothing begin.
    pub fn stops(&self) -> bool {
        self.word_is_due() && !self.urges()
    }

    /// The word alone, at once.
    pub fn word_frame(&mut self, now: Instant, axis: &Axis) -> Option<Frame> {
        let frame = pdo(axis, self.word?, None)?;
        self.told = self.word;
        self.again = false;
        self.at = now;
        Some(frame)
    }

    /// The next frame. A word that stops something goes before all else; one that lets something begin, after all else, and
    /// after what has to be written.
    pub fn frame(&mut self, now: Instant, axis: &Axis) -> Option<Frame> {
        if self.stops() {
            return self.word_frame(now, axis);
        }
        if let Some((at, object, value)) = self.mapped(axis) {
            // It carries the word as it is.
            let frame = pdo(axis, self.told?, Some((object, value)))?;
            if let Some(slot) = self.values.get_mut(at) {
                slot.told = slot.wanted;
            }
            self.at = now;
            return Some(frame);
        }
        if self.word_is_due() && self.write(axis).is_none() { self.word_frame(now, axis) } else { None }
    }

    /// Whether there is a frame.
    pub fn is_due(&self, axis: &Axis) -> bool {
        self.stops()
            || self.told.is_some() && self.mapped(axis).is_some()
            || self.word_is_due() && self.write(axis).is_none()
    }

    fn due(&self) -> impl Iterator<Item = (usize, Object, i64)> {
        let slots = OBJECTS.iter().zip(&self.values).enumerate();
        slots
            .filter(|(_, (_, slot))| slot.is_due())
            .filter_map(|(at, (object, slot))| Some((at, *object, object.kind.extend(slot.wanted?))))
    }

    /// An object that a PDO has.
    fn mapped(&self, axis: &Axis) -> Option<(usize, Object, i64)> {
        self.due().find(|(_, object, _)| number_of(axis, *object).is_some())
    }

    /// An object that no PDO has, and what is to be written to it.
    pub fn write(&self, axis: &Axis) -> Option<(Object, i64)> {
        let found = self.due().find(|(_, object, _)| number_of(axis, *object).is_none());
        found.map(|(_, object, value)| (object, value))
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
