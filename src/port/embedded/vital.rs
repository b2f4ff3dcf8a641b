//! The board's record, in memory that survives a reset. `Board::start` reads it first of all.

use core::fmt;
use core::mem::MaybeUninit;
use core::sync::atomic::{AtomicU32, Ordering};

use crate::port::record::{Head, History, Note, Record, Reset};

/// No start-up code clears or fills this.
#[unsafe(link_section = ".uninit.record")]
static mut RECORD: MaybeUninit<Record> = MaybeUninit::uninit();

/// Who has the processor; for what is said of a watchdog that came by surprise.
#[unsafe(link_section = ".uninit.record")]
static mut TURN: MaybeUninit<u32> = MaybeUninit::uninit();
const BUSES: u32 = 0x6275_7365;
const CLIENTS: u32 = 0x6E65_7477;

/// Any word outside the record, see [`change`].
static SETTLED: AtomicU32 = AtomicU32::new(0);

fn record() -> *mut Record {
    (&raw mut RECORD).cast()
}

fn read<T: Copy>(part: *const T) -> T {
    let mut value = MaybeUninit::<T>::uninit();
    copy(part.cast(), value.as_mut_ptr().cast(), size_of::<T>() / size_of::<u32>());
    // SAFETY: all of it has been copied; a part of the record is words and bytes, of which any memory is a value.
    unsafe { value.assume_init() }
}

/// Copies words of the record. Volatile, for the compiler believes that nothing is there before the first write, and that
/// nobody reads what is there before a reset.
#[inline(never)]
fn copy(from: *const u32, to: *mut u32, words: usize) {
    for word in 0..words {
        // SAFETY: the callers have a part of the record and a value of its type, which are words throughout; no reference
        // to the record is ever made.
        unsafe { to.add(word).write_volatile(from.add(word).read_volatile()) }
    }
}

/// Changes a part of the record.
fn change<T: Copy>(part: *mut T, f: impl FnOnce(T) -> T) {
    const { assert!(align_of::<T>() == align_of::<u32>() && size_of::<T>().is_multiple_of(4)) }
    cortex_m::interrupt::free(|_| {
        let changed = f(read(part));
        copy((&raw const changed).cast(), part.cast(), size_of::<T>() / size_of::<u32>());
    });
    // The STM32H7's memory holds the last write back if it was narrower than its 64 bits, until one to another word: a
    // reset would lose it.
    SETTLED.fetch_add(1, Ordering::Relaxed);
    cortex_m::asm::dsb();
}

fn head() -> *mut Head {
    // SAFETY: within the static.
    unsafe { &raw mut (*record()).head }
}

fn change_head(f: impl FnOnce(&mut Head)) {
    change(head(), |mut head| {
        head.change(f);
        head
    });
}

/// Takes over what the board remembers: the axes that may move. `hardware` is what the chip tells of its reset, where
/// it does. Call it once, before any other function of this file.
pub(in crate::port) fn begin(hardware: Option<Reset>) -> u32 {
    change(record(), |record| record.begin(hardware, holder()));
    turn_of(CLIENTS);
    read(head()).moving()
}

/// What held the processor when the watchdog was not fed.
fn holder() -> &'static str {
    match read((&raw const TURN).cast()) {
        BUSES => "the bus tasks held the processor",
        _ => "the network's tasks or an interrupt held the processor",
    }
}

/// Why the board runs, and what it remembers; nothing on a host.
pub fn history() -> Option<History> {
    let record = read(record());
    let (cause, resets) = record.head.started();
    Some(History { cause, resets, crash: record.crash.incident(), watchdog: record.watchdog.incident() })
}

/// An axis may move from now on, or does no more. To be told before the first frame that could move it.
pub fn may_move(axis: u8, moves: bool) {
    change_head(|head| head.may_move(axis, moves));
}

/// A task hangs, and the watchdog is about to come; `text` says which.
pub fn hung(text: fmt::Arguments<'_>) {
    log::error!("{text}");
    note(watchdog(), Reset::Watchdog, text);
}

/// The watchdog is about to come, for boards whose chip does not tell of it afterwards. Where nobody has said why, it is
/// for whoever has the processor.
#[cfg(feature = "mps2-an500")]
pub(in crate::port) fn starved() {
    if !read(head()).is_told() {
        note(watchdog(), Reset::Watchdog, format_args!("{}", holder()));
    }
}

fn watchdog() -> *mut Note {
    // SAFETY: within the static.
    unsafe { &raw mut (*record()).watchdog }
}

/// The firmware has failed.
pub(super) fn crashed(cause: Reset, text: fmt::Arguments<'_>) {
    // SAFETY: within the static.
    note(unsafe { &raw mut (*record()).crash }, cause, text);
}

fn note(place: *mut Note, cause: Reset, text: fmt::Arguments<'_>) {
    let uptime = read(head()).alive_ms();
    change(place, |_| Note::new(cause, uptime, text));
    change_head(|head| head.reason(cause));
}

/// The board is about to be reset by the gateway itself, or by the watchdog.
pub(in crate::port) fn reason(reason: Reset) {
    change_head(|head| head.reason(reason));
}

/// A sign of life: how long the board ran is told after its next start.
pub fn alive() {
    let uptime = embassy_time::Instant::now().as_millis();
    change_head(|head| head.alive(uptime));
}

/// Runs the bus tasks, and keeps in mind that they are running.
pub(in crate::port) fn bus_turn(run: impl FnOnce()) {
    turn_of(BUSES);
    run();
    turn_of(CLIENTS);
}

fn turn_of(who: u32) {
    let turn: *mut u32 = (&raw mut TURN).cast();
    // SAFETY: a word of its own, to which no reference is ever made.
    unsafe { turn.write_volatile(who) }
}
