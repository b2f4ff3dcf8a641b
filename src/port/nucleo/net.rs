//! The Ethernet MAC.

use core::mem::MaybeUninit;

use embassy_executor::Spawner;
use embassy_net::Runner;
use embassy_stm32::eth::{self, Ethernet, GenericPhy, PacketQueue, Sma};
use embassy_stm32::interrupt::{InterruptExt, Priority};
use embassy_stm32::peripherals::{ETH, ETH_SMA, PA1, PA2, PA7, PB13, PC1, PC4, PC5, PG11, PG13};
use embassy_stm32::{Peri, bind_interrupts, interrupt};

use crate::port::embedded::{Network, network};

bind_interrupts!(struct Interrupts {
    ETH => eth::InterruptHandler;
});

/// Frames that wait for the wire, and frames that wait for the stack.
type Frames = PacketQueue<4, 4>;
type Device = Ethernet<'static, ETH, GenericPhy<Sma<'static, ETH_SMA>>>;

/// Where the DMA finds its descriptors and frames; the memory files say which RAM that is and why.
///
/// embassy leaves the data cache off, and so do we: what the DMA writes is what the processor reads.
#[unsafe(link_section = ".ethernet")]
static mut FRAMES: MaybeUninit<Frames> = MaybeUninit::uninit();

/// The MAC, the LAN8742A PHY's management port, and the RMII pins of every Nucleo-144 with Ethernet.
pub(super) struct Parts {
    pub eth: Peri<'static, ETH>,
    pub sma: Peri<'static, ETH_SMA>,
    pub ref_clk: Peri<'static, PA1>,
    pub mdio: Peri<'static, PA2>,
    pub mdc: Peri<'static, PC1>,
    pub crs_dv: Peri<'static, PA7>,
    pub rxd0: Peri<'static, PC4>,
    pub rxd1: Peri<'static, PC5>,
    pub tx_en: Peri<'static, PG11>,
    pub txd0: Peri<'static, PG13>,
    pub txd1: Peri<'static, PB13>,
}

/// Starts the stack. `seed` makes TCP sequence numbers hard to guess.
pub(super) fn start(spawner: Spawner, parts: Parts, mac: [u8; 6], seed: u64) -> Network {
    // Below the bus tasks: it only wakes the network task.
    interrupt::ETH.set_priority(Priority::P8);
    let frames: *mut MaybeUninit<Frames> = &raw mut FRAMES;
    // SAFETY: `Parts` exists once, as the peripheral tokens in it do, and is consumed here; so this is the only
    // reference that is ever made. `init` writes the whole queue before it is used.
    let frames = unsafe {
        let frames = &mut *frames;
        Frames::init(frames);
        frames.assume_init_mut()
    };
    let device = Ethernet::new(
        frames,
        parts.eth,
        Interrupts,
        parts.ref_clk,
        parts.crs_dv,
        parts.rxd0,
        parts.rxd1,
        parts.txd0,
        parts.txd1,
        parts.tx_en,
        mac,
        parts.sma,
        parts.mdio,
        parts.mdc,
    );
    let (network, runner) = network(device, seed);
    spawner.spawn(run(runner).expect("the network task is started once"));
    network
}

#[embassy_executor::task]
async fn run(mut runner: Runner<'static, Device>) -> ! {
    runner.run().await
}
