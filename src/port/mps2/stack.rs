//! How much of the stack was ever used. The runtime has painted it before `main`.

use embassy_time::Timer;

/// What the runtime paints the stack with.
const PAINT: u32 = 0xCCCC_CCCC;

unsafe extern "C" {
    static _stack_end: u32;
    static _stack_start: u32;
}

/// Bytes of the stack, and how many of them hold something else than paint.
fn used() -> (usize, usize) {
    let (end, start) = (&raw const _stack_end, &raw const _stack_start);
    let words = (start as usize - end as usize) / size_of::<u32>();
    // SAFETY: the linker's symbols enclose the stack, all of which is memory that can be read.
    let painted = (0..words).take_while(|&word| unsafe { end.add(word).read_volatile() } == PAINT).count();
    (words * size_of::<u32>(), (words - painted) * size_of::<u32>())
}

/// Logs each new high-water mark.
#[embassy_executor::task]
pub(super) async fn watch() -> ! {
    let mut known = 0;
    loop {
        let (size, used) = used();
        if used > known {
            known = used;
            log::info!("stack: {used} of {size} bytes used");
        }
        Timer::after_secs(1).await;
    }
}
