//! TCP/IP on the Ethernet MAC.

use core::mem::MaybeUninit;
use core::net::Ipv4Addr;

use embassy_executor::Spawner;
use embassy_net::{Config, Ipv4Cidr, Runner, Stack, StackResources, StaticConfigV4};
use embassy_stm32::eth::{self, Ethernet, GenericPhy, PacketQueue, Sma};
use embassy_stm32::interrupt::{InterruptExt, Priority};
use embassy_stm32::peripherals::{ETH, ETH_SMA, PA1, PA2, PA7, PB13, PC1, PC4, PC5, PG11, PG13};
use embassy_stm32::{Peri, bind_interrupts, interrupt};
use static_cell::StaticCell;

use super::limits::SLOTS;

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

/// The board's address on the network.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Address {
    /// IPv4 address.
    pub ip: [u8; 4],
    /// Bits of the network part, 0 to 32.
    pub prefix: u8,
    /// Router, where there is one.
    pub gateway: Option<[u8; 4]>,
}

impl Address {
    /// 192.168.1.111/24, the address of the thesis' gateway.
    pub const THESIS: Self = Self { ip: [192, 168, 1, 111], prefix: 24, gateway: None };
}

/// Starts the stack. `seed` makes TCP sequence numbers hard to guess.
pub(super) fn start(
    spawner: Spawner,
    parts: Parts,
    mac: [u8; 6],
    address: Address,
    seed: u64,
) -> Stack<'static> {
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
    static RESOURCES: StaticCell<StackResources<{ SLOTS + 1 }>> = StaticCell::new();
    let config = Config::ipv4_static(StaticConfigV4 {
        address: Ipv4Cidr::new(Ipv4Addr::from(address.ip), address.prefix),
        gateway: address.gateway.map(Ipv4Addr::from),
        dns_servers: Default::default(),
    });
    let (stack, runner) = embassy_net::new(device, config, RESOURCES.init_with(StackResources::new), seed);
    spawner.spawn(run(runner).expect("the network task is started once"));
    stack
}

#[embassy_executor::task]
async fn run(mut runner: Runner<'static, Device>) -> ! {
    runner.run().await
}
