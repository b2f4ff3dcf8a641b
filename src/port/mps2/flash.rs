//! A stand-in for flash, of which QEMU's board has none: memory that outlasts a reset, with the manners of the H7's.
//! What it holds when QEMU starts is not erased.

use core::mem::MaybeUninit;
use core::sync::atomic::{AtomicBool, Ordering};

use embedded_storage_async::nor_flash::{ErrorType, NorFlash, NorFlashErrorKind, ReadNorFlash};

use crate::port::{SettingsFlash, nor};

const WORD: usize = 32;
const PAGE: usize = 128 * 1024;
const CAPACITY: usize = 2 * PAGE;
const ERASED: u8 = 0xFF;

#[repr(align(32))]
struct Cells([u8; CAPACITY]);

/// The start leaves it alone.
#[unsafe(link_section = ".uninit.flash")]
static mut CELLS: MaybeUninit<Cells> = MaybeUninit::uninit();

/// The flash.
pub struct Flash(&'static mut [u8; CAPACITY]);

impl Flash {
    /// None but the first time.
    pub(super) fn take() -> Option<Self> {
        static TAKEN: AtomicBool = AtomicBool::new(false);
        if TAKEN.swap(true, Ordering::Relaxed) {
            return None;
        }
        // What it holds is nobody's to guess at compile time.
        let cells: *mut MaybeUninit<Cells> = core::hint::black_box(&raw mut CELLS);
        // SAFETY: this is the only reference that is ever made. Any bytes are a value of its type, and these have one:
        // they are memory that QEMU has filled, or what was written before a reset.
        Some(Self(unsafe { &mut (*cells).assume_init_mut().0 }))
    }
}

impl ErrorType for Flash {
    type Error = NorFlashErrorKind;
}

impl ReadNorFlash for Flash {
    const READ_SIZE: usize = WORD;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), NorFlashErrorKind> {
        let place = nor::check(offset, bytes.len(), Self::READ_SIZE, CAPACITY)?;
        bytes.copy_from_slice(self.0.get(place).ok_or(NorFlashErrorKind::OutOfBounds)?);
        Ok(())
    }

    fn capacity(&self) -> usize {
        CAPACITY
    }
}

impl NorFlash for Flash {
    const WRITE_SIZE: usize = WORD;
    const ERASE_SIZE: usize = PAGE;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), NorFlashErrorKind> {
        let length = to.checked_sub(from).ok_or(NorFlashErrorKind::OutOfBounds)? as usize;
        let place = nor::check(from, length, PAGE, CAPACITY)?;
        self.0.get_mut(place).ok_or(NorFlashErrorKind::OutOfBounds)?.fill(ERASED);
        Ok(())
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), NorFlashErrorKind> {
        let place = nor::check(offset, bytes.len(), WORD, CAPACITY)?;
        let words = self.0.get_mut(place).ok_or(NorFlashErrorKind::OutOfBounds)?;
        words.iter_mut().zip(bytes).for_each(|(word, byte)| *word &= byte);
        Ok(())
    }
}

impl SettingsFlash for Flash {}
