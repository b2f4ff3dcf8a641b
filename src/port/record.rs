//! What a board remembers over a reset: why it was reset, what ended it before, and which axes may move. The board keeps
//! it in memory that nothing clears; each part counts only with its right check value.

use core::fmt;

use crc::{CRC_32_ISO_HDLC, Crc, NoTable};
use heapless::String;

/// Most bytes of what is said of an incident.
pub const TEXT: usize = 120;
/// Tells a record of this layout from whatever else may be in the memory.
const MAGIC: u32 = 0x7075_6501;

/// The check value of words and a text.
#[inline(never)]
fn check(words: &[u32], text: &[u8]) -> u32 {
    const CRC: Crc<u32, NoTable> = Crc::<u32, NoTable>::new(&CRC_32_ISO_HDLC);
    let mut digest = CRC.digest();
    for byte in words.iter().flat_map(|word| word.to_le_bytes()).chain(text.iter().copied()) {
        digest.update(&[byte]);
    }
    digest.finalize()
}

/// Why a board has started.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reset {
    /// It was switched on.
    PowerOn,
    /// The supply voltage was too low for a while.
    BrownOut,
    /// The reset button, or a debugger.
    Pin,
    /// The gateway itself wanted a new start.
    Software,
    /// Something hung.
    Watchdog,
    /// The firmware found a mistake of its own.
    Panic,
    /// The processor found one.
    Fault,
}

impl Reset {
    const ALL: [Self; 7] =
        [Self::PowerOn, Self::BrownOut, Self::Pin, Self::Software, Self::Watchdog, Self::Panic, Self::Fault];

    /// Whether the firmware had failed.
    pub const fn is_failure(self) -> bool {
        matches!(self, Reset::Watchdog | Reset::Panic | Reset::Fault)
    }

    /// The name used in replies.
    pub const fn name(self) -> &'static str {
        match self {
            Reset::PowerOn => "power-on",
            Reset::BrownOut => "brown-out",
            Reset::Pin => "pin",
            Reset::Software => "software",
            Reset::Watchdog => "watchdog",
            Reset::Panic => "panic",
            Reset::Fault => "fault",
        }
    }

    const fn code(self) -> u32 {
        self as u32 + 1
    }

    fn from_code(code: u32) -> Option<Self> {
        Self::ALL.into_iter().find(|reset| reset.code() == code)
    }
}

/// What ended the gateway once.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Incident {
    /// Of which kind it was.
    pub cause: Reset,
    /// How long the gateway had run at its last sign of life before, in ms.
    pub uptime_ms: u64,
    /// Where and why, in one line without quotation marks.
    pub text: String<TEXT>,
}

/// Why the board runs now, and what it remembers.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct History {
    /// Why it has started.
    pub cause: Reset,
    /// Resets since it was switched on, as far as is known.
    pub resets: u32,
    /// The last panic or fault since it was switched on.
    pub crash: Option<Incident>,
    /// The last time since then that something hung.
    pub watchdog: Option<Incident>,
}

/// The part that changes often.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(C)]
pub struct Head {
    magic: u32,
    /// Why the board runs now; with `resets` it stays as it is until the next start.
    cause: u32,
    resets: u32,
    /// Why it is about to be reset; 0 where nobody has said so.
    reason: u32,
    moving: u32,
    alive_ms: [u32; 2],
    check: u32,
}

impl Head {
    /// Of a board that has just been switched on.
    const fn new() -> Self {
        Self { magic: MAGIC, cause: 0, resets: 0, reason: 0, moving: 0, alive_ms: [0; 2], check: 0 }
    }

    fn sum(&self) -> u32 {
        let Self { magic, cause, resets, reason, moving, alive_ms: [low, high], check: _ } = *self;
        check(&[magic, cause, resets, reason, moving, low, high], &[])
    }

    fn sound(&self) -> bool {
        self.magic == MAGIC && self.check == self.sum()
    }

    /// Changes it and its check value.
    pub fn change(&mut self, f: impl FnOnce(&mut Self)) {
        f(self);
        self.check = self.sum();
    }

    /// Why the board runs, and its resets since it was switched on.
    pub fn started(&self) -> (Reset, u32) {
        (Reset::from_code(self.cause).unwrap_or(Reset::PowerOn), self.resets)
    }

    /// Axes that may move, a bit each.
    pub fn moving(&self) -> u32 {
        self.moving
    }

    /// An axis may move from now on, or does no more.
    pub fn may_move(&mut self, axis: u8, moves: bool) {
        let bit = 1_u32.checked_shl(u32::from(axis)).unwrap_or(0);
        self.moving = if moves { self.moving | bit } else { self.moving & !bit };
    }

    /// How long the board has run at the last sign of life, in ms.
    pub fn alive_ms(&self) -> u64 {
        let [low, high] = self.alive_ms;
        u64::from(high) << 32 | u64::from(low)
    }

    /// A sign of life.
    pub fn alive(&mut self, uptime_ms: u64) {
        self.alive_ms = [uptime_ms as u32, (uptime_ms >> 32) as u32];
    }

    /// Whether somebody has said why the board is about to be reset.
    pub fn is_told(&self) -> bool {
        self.reason != 0
    }

    /// The board is about to be reset; the first reason counts.
    pub fn reason(&mut self, reason: Reset) {
        if self.reason == 0 {
            self.reason = reason.code();
        }
    }
}

/// An incident as it is kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(C)]
pub struct Note {
    cause: u32,
    uptime_ms: [u32; 2],
    length: u32,
    text: [u8; TEXT],
    check: u32,
}

impl Note {
    /// None.
    pub const fn none() -> Self {
        Self { cause: 0, uptime_ms: [0; 2], length: 0, text: [0; TEXT], check: 0 }
    }

    /// Notes an incident. What is too long for it is cut off.
    pub fn new(cause: Reset, uptime_ms: u64, text: fmt::Arguments<'_>) -> Self {
        let mut note = Self { cause: cause.code(), ..Self::none() };
        note.uptime_ms = [uptime_ms as u32, (uptime_ms >> 32) as u32];
        // It takes what fits.
        let _ = fmt::write(&mut note, text);
        note.check = note.sum();
        note
    }

    fn sum(&self) -> u32 {
        let Self { cause, uptime_ms: [low, high], length, text, check: _ } = self;
        check(&[MAGIC, *cause, *low, *high, *length], text)
    }

    /// The incident, where there is one.
    pub fn incident(&self) -> Option<Incident> {
        if self.check != self.sum() {
            return None;
        }
        let [low, high] = self.uptime_ms;
        let text = core::str::from_utf8(self.text.get(..self.length as usize)?).ok()?;
        Some(Incident {
            cause: Reset::from_code(self.cause)?,
            uptime_ms: u64::from(high) << 32 | u64::from(low),
            text: String::try_from(text).ok()?,
        })
    }
}

impl fmt::Write for Note {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        for character in text.chars() {
            let character = match character {
                '"' => '\'',
                _ if character.is_control() => ' ',
                _ => character,
            };
            let (start, length) = (self.length as usize, character.len_utf8());
            let room = self.text.get_mut(start..start + length).ok_or(fmt::Error)?;
            character.encode_utf8(room);
            self.length += length as u32;
        }
        Ok(())
    }
}

/// All that is remembered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(C)]
pub struct Record {
    /// The part that changes often.
    pub head: Head,
    /// The last panic or fault.
    pub crash: Note,
    /// The last time that something hung.
    pub watchdog: Note,
}

impl Record {
    /// What a start makes of the memory as it was found. `hardware` is what the chip tells of its reset, where it does;
    /// `starved` is what is said where the watchdog came and nobody had told why.
    ///
    /// A record that a reset has torn still tells that there was no power-on: then every axis may move.
    pub fn begin(mut self, hardware: Option<Reset>, starved: &str) -> Self {
        let sound = self.head.sound();
        let reason = Reset::from_code(self.head.reason).filter(|_| sound);
        let cause = match hardware {
            None if sound => reason.unwrap_or(Reset::Pin),
            None => Reset::PowerOn,
            Some(Reset::Software) => reason.unwrap_or(Reset::Software),
            Some(hardware) => hardware,
        };
        let mut head = Head::new();
        if cause == Reset::PowerOn {
            (self.crash, self.watchdog) = (Note::none(), Note::none());
        } else {
            head.resets = if sound { self.head.resets.saturating_add(1) } else { 1 };
            head.moving = if sound { self.head.moving } else { u32::MAX };
        }
        if cause == Reset::Watchdog && reason != Some(Reset::Watchdog) {
            let uptime_ms = if sound { self.head.alive_ms() } else { 0 };
            self.watchdog = Note::new(Reset::Watchdog, uptime_ms, format_args!("{starved}"));
        }
        head.change(|head| head.cause = cause.code());
        Self { head, ..self }
    }
}

#[cfg(test)]
mod tests;
