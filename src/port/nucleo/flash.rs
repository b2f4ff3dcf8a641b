//! The last two sectors of the chip's flash, which the memory files keep free of the image.
//!
//! Nothing else runs in thread mode while it is written or erased. Whether the processor itself stands still depends on
//! the chip: see the board files.

use embassy_stm32::Peri;
use embassy_stm32::flash::{self, Blocking};
use embassy_stm32::peripherals::FLASH;
use embedded_storage_async::nor_flash::{ErrorType, NorFlash, NorFlashErrorKind, ReadNorFlash};

use super::{board, watchdog};
use crate::port::{SettingsFlash, nor};

const PAGE: usize = board::SECTOR;
const CAPACITY: usize = 2 * PAGE;
/// From the start of the chip's flash.
const START: u32 = (flash::FLASH_SIZE - CAPACITY) as u32;

/// The flash.
pub struct Flash(flash::Flash<'static, Blocking>);

impl Flash {
    /// None where the chip's flash is divided into other sectors than this image knows.
    pub(super) fn new(flash: Peri<'static, FLASH>) -> Option<Self> {
        if !board::flash_is_divided_as_known() {
            log::error!("the flash has other sectors than this image knows: no settings are kept");
            return None;
        }
        Some(Self(flash::Flash::new_blocking(flash)))
    }
}

/// Reads flash that has no checksums.
#[cfg(not(feature = "nucleo-h753zi"))]
pub(super) fn read_plain(address: usize, bytes: &mut [u8]) {
    let flash = address as *const u8;
    for (number, byte) in bytes.iter_mut().enumerate() {
        // SAFETY: the caller stays within the flash.
        *byte = unsafe { flash.add(number).read_volatile() };
    }
}

fn failed(error: flash::Error) -> NorFlashErrorKind {
    log::error!("flash: {error:?}");
    NorFlashErrorKind::Other
}

impl ErrorType for Flash {
    type Error = NorFlashErrorKind;
}

impl ReadNorFlash for Flash {
    const READ_SIZE: usize = board::FLASH_READ;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), NorFlashErrorKind> {
        nor::check(offset, bytes.len(), Self::READ_SIZE, CAPACITY)?;
        board::read_flash(flash::FLASH_BASE + (START + offset) as usize, bytes);
        Ok(())
    }

    fn capacity(&self) -> usize {
        CAPACITY
    }
}

impl NorFlash for Flash {
    const WRITE_SIZE: usize = flash::WRITE_SIZE;
    const ERASE_SIZE: usize = PAGE;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), NorFlashErrorKind> {
        let length = to.checked_sub(from).ok_or(NorFlashErrorKind::OutOfBounds)? as usize;
        nor::check(from, length, PAGE, CAPACITY)?;
        // A sector may take 4 s, during which nobody feeds the watchdog.
        watchdog::widen();
        let erased = self.0.blocking_erase(START + from, START + to);
        watchdog::narrow();
        erased.map_err(failed)
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), NorFlashErrorKind> {
        nor::check(offset, bytes.len(), Self::WRITE_SIZE, CAPACITY)?;
        self.0.blocking_write(START + offset, bytes).map_err(failed)
    }
}

impl SettingsFlash for Flash {}
