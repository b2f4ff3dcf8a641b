//! How much of the stack is used. The runtime has painted it before `main`.

use cortex_m::register::msp;

use crate::port::Stack;

/// What the runtime paints the stack with.
const PAINT: u32 = 0xCCCC_CCCC;

unsafe extern "C" {
    static _stack_end: u32;
    static _stack_start: u32;
}

/// Bytes right below the stack pointer that are left alone while painting.
const MARGIN: usize = 256;

/// The lowest address of the stack, and its size in words.
fn bounds() -> (*mut u32, usize) {
    let (end, start) = (&raw const _stack_end, &raw const _stack_start);
    (end.cast_mut(), (start as usize - end as usize) / size_of::<u32>())
}

/// Bytes of the stack, and how many of them were used since it was painted.
pub fn stack() -> Option<Stack> {
    let (end, words) = bounds();
    // SAFETY: the linker's symbols enclose the stack, all of which is memory that can be read.
    let painted = (0..words).take_while(|&word| unsafe { end.add(word).read_volatile() } == PAINT).count();
    Some(Stack { size: words * size_of::<u32>(), used: (words - painted) * size_of::<u32>() })
}

/// Logs what the start took, which is over, and paints the stack anew. Call it from thread mode.
pub(in crate::port) fn started() {
    if let Some(Stack { size, used }) = stack() {
        log::info!("stack: {used} of {size} bytes used to start");
    }
    cortex_m::interrupt::free(|_| {
        let (end, _) = bounds();
        let free = (msp::read() as usize - MARGIN).saturating_sub(end as usize) / size_of::<u32>();
        for word in 0..free {
            // SAFETY: this is stack below the stack pointer and below what this loop may call, and no interrupt comes.
            unsafe { end.add(word).write_volatile(PAINT) }
        }
    });
}
