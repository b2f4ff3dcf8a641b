//! Marks in the code, for the plugin of QEMU that counts instructions: it knows these functions by their addresses.

/// What is counted begins.
#[inline(never)]
#[unsafe(no_mangle)]
pub extern "C" fn span_begins() {
    mark::<1>();
}

/// It ends.
#[inline(never)]
#[unsafe(no_mangle)]
pub extern "C" fn span_ends() {
    mark::<2>();
}

/// What follows is counted apart.
#[inline(never)]
#[unsafe(no_mangle)]
pub extern "C" fn span_next() {
    mark::<3>();
}

/// An instruction that no other mark has, lest one function do for all.
#[inline(always)]
fn mark<const NUMBER: u8>() {
    // SAFETY: a comparison with a number, which changes nothing but flags.
    unsafe { core::arch::asm!("cmp r0, #{}", const NUMBER, options(nomem, nostack)) }
}
