//! The board as a PID interface module. It runs on QEMU's mps2-an386 as well, which has the Cortex-M4 of the real one and
//! the same peripherals but for the Ethernet.

use embassy_executor::{SendSpawner, Spawner};

use super::axis::Axis;
use super::line::{Line, UART1};
use super::registers::{EMULATOR, SCC};
use super::tick::Tick;
use super::{clock, executor, interrupt, log, stack};
use crate::port::embedded::vital;
use crate::port::{Bus, CommandForm, Feedback};

/// In the emulator's page: the switch for the address, 0 to 15,
const SWITCH: usize = 0x08;
/// and baud rate, gap and slot of the bus, where they are not 0. QEMU keeps to the times of a slow line only.
const BAUD: usize = 0x0C;
const GAP: usize = 0x10;
const SLOT: usize = 0x14;

/// What the board offers to the application.
pub struct AxisBoard {
    /// Spawns bus tasks, above everything in thread mode.
    pub buses: SendSpawner,
    /// The bus,
    pub bus: Bus,
    /// and its line.
    pub line: Line,
    /// Encoder and amplifier.
    pub axis: Axis,
    /// An LED.
    pub lamp: Lamp,
    /// What the switch for the address says: 0 to 15.
    pub switch: u8,
    /// No random number: there is no source of them.
    pub seed: u64,
    /// What steps the loop.
    pub tick: Tick,
}

impl AxisBoard {
    /// Starts clocks and executors. Call it once, first of all.
    #[inline(never)]
    pub fn start(spawner: Spawner, bus: Bus, feedback: Feedback, _: CommandForm) -> Self {
        vital::begin(None);
        log::start();
        let mut core = cortex_m::Peripherals::take().expect("the board is started once");
        interrupt::start(&mut core.NVIC);
        clock::start();
        spawner.spawn(stack::watch().expect("the watch is started once"));
        let bus = own(bus);
        let switch = EMULATOR.read(SWITCH) as u8 & 0x0F;
        Self {
            buses: executor::start(),
            bus,
            line: Line::new(&UART1, bus.line),
            axis: Axis::new(feedback),
            lamp: Lamp,
            switch,
            seed: switch.into(),
            tick: Tick::new(core.SYST, core.SCB),
        }
    }
}

/// The bus as the emulator has it.
fn own(mut bus: Bus) -> Bus {
    if let baud @ 1.. = EMULATOR.read(BAUD) {
        bus.line.baud = baud;
    }
    if let gap @ 1.. = EMULATOR.read(GAP) {
        bus.gap = gap as usize;
    }
    if let slot @ 1.. = EMULATOR.read(SLOT) {
        bus.slot = slot as usize;
    }
    bus
}

/// LED 0, of which QEMU shows none: it can be read in its register.
pub struct Lamp;

impl Lamp {
    /// Switches it on or off.
    pub fn show(&mut self, on: bool) {
        /// SCC: one bit an LED.
        const CFG1: usize = 0x04;
        SCC.write(CFG1, u32::from(on));
    }
}
