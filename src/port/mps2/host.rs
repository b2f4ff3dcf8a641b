//! Semihosting: what the firmware says to QEMU itself. The processor stands still meanwhile.

use core::fmt::{self, Write};

use heapless::String;

/// Most bytes of a line, its end included.
const LINE: usize = 256;
/// Operation SYS_WRITE0: a text that ends with a zero byte, to QEMU's standard error.
const WRITE0: u32 = 0x04;

/// Says one line. What is too long for it is cut off.
pub(super) fn say(text: fmt::Arguments<'_>) {
    let mut line = Line(String::new());
    // It takes what fits, and never fails.
    let _ = line.write_fmt(text);
    let _ = line.0.push_str("\n\0");
    // SAFETY: the text lives until the call returns, and ends with a zero byte, for which `Line` has left room.
    unsafe { cortex_m::asm::semihosting_syscall(WRITE0, line.0.as_ptr() as u32) };
}

/// A line without its end.
struct Line(String<LINE>);

impl fmt::Write for Line {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        for character in text.chars() {
            if self.0.len() + character.len_utf8() + 2 > LINE || self.0.push(character).is_err() {
                break;
            }
        }
        Ok(())
    }
}
