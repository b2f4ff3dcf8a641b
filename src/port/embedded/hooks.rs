//! What only tests may ask for: the firmware fails, or hangs, on purpose. No image to flash has this.

use core::sync::atomic::{AtomicU8, Ordering};

use super::restart;

/// What a line is to do next.
static LINE: AtomicU8 = AtomicU8::new(NOTHING);
const NOTHING: u8 = 0;
const HANG: u8 = 1;
const STALL: u8 = 2;

/// Does what a console line asks for, where it is one of these.
pub fn obey(line: &[u8]) -> bool {
    match line {
        b"debug panic" => panic!("a test hook was asked for"),
        b"debug fault" => cortex_m::asm::udf(),
        b"debug restart" => restart(),
        b"debug hang front" => hang(),
        b"debug hang bus" => LINE.store(HANG, Ordering::Relaxed),
        b"debug stall bus" => LINE.store(STALL, Ordering::Relaxed),
        _ => return false,
    }
    true
}

fn hang() -> ! {
    loop {
        cortex_m::asm::nop();
    }
}

/// To be called by a line that is read: keeps the processor, if that is wanted.
pub(in crate::port) fn reading() {
    if LINE.load(Ordering::Relaxed) == HANG {
        hang()
    }
}

/// To be called by a line that is written to: never comes to its end, if that is wanted.
pub(in crate::port) async fn writing() {
    if LINE.load(Ordering::Relaxed) == STALL {
        core::future::pending().await
    }
}
