//! The clock of embassy-time: DUALTIMER's first timer counts, TIMER0 is the alarm. Both count down, at 25 MHz.

use core::cell::RefCell;
use core::task::Waker;

use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_time_driver::Driver;
use embassy_time_queue_utils::Queue;

use super::interrupt::{Interrupt, enable};
use super::registers::{DUALTIMER, TIMER0};

/// Counts of a timer in one tick of 1 µs.
const COUNTS: u32 = 25;
/// Longest time between two looks at the counter, in ticks: it wraps after 171 s.
const LONGEST: u64 = 60_000_000;

// DUALTIMER, first timer.
const COUNTER_VALUE: usize = 0x04;
const COUNTER_CONTROL: usize = 0x08;
/// Enabled, 32 bits wide, free running.
const COUNTER_RUNS: u32 = 0x82;

// TIMER0.
const CONTROL: usize = 0x00;
const VALUE: usize = 0x04;
const RELOAD: usize = 0x08;
const INTERRUPT_CLEAR: usize = 0x0C;
/// Enabled, with interrupt.
const ALARM_SET: u32 = 0b1001;

struct State {
    queue: Queue,
    ticks: u64,
    /// What the counter had counted at `ticks`.
    counted: u32,
    /// When the alarm goes off.
    alarm: u64,
}

impl State {
    fn now(&mut self) -> u64 {
        let counted = !DUALTIMER.read(COUNTER_VALUE);
        let ticks = counted.wrapping_sub(self.counted) / COUNTS;
        self.counted = self.counted.wrapping_add(ticks * COUNTS);
        self.ticks += u64::from(ticks);
        self.ticks
    }

    /// Wakes what is due, and sets the alarm for what is not.
    fn expire(&mut self) {
        let now = self.now();
        let next = self.queue.next_expiration(now);
        let wait = next.saturating_sub(now).clamp(1, LONGEST);
        self.alarm = now + wait;
        TIMER0.write(CONTROL, 0);
        TIMER0.write(INTERRUPT_CLEAR, 1);
        TIMER0.write(RELOAD, 0);
        TIMER0.write(VALUE, wait as u32 * COUNTS);
        TIMER0.write(CONTROL, ALARM_SET);
    }
}

struct Clock(Mutex<CriticalSectionRawMutex, RefCell<State>>);

impl Driver for Clock {
    fn now(&self) -> u64 {
        self.0.lock(|state| state.borrow_mut().now())
    }

    fn schedule_wake(&self, at: u64, waker: &Waker) {
        self.0.lock(|state| {
            let mut state = state.borrow_mut();
            if state.queue.schedule_wake(at, waker) && at < state.alarm {
                state.expire();
            }
        });
    }
}

embassy_time_driver::time_driver_impl!(static CLOCK: Clock = Clock(Mutex::new(RefCell::new(State {
    queue: Queue::new(),
    ticks: 0,
    counted: 0,
    alarm: 0,
}))));

/// Starts the clock.
pub(super) fn start() {
    DUALTIMER.write(COUNTER_CONTROL, COUNTER_RUNS);
    enable(Interrupt::Timer0);
    interrupted();
}

/// The alarm's interrupt.
pub(super) fn interrupted() {
    CLOCK.0.lock(|state| state.borrow_mut().expire());
}
