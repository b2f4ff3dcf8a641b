//! Flash of two small pages.

use embedded_storage_async::nor_flash::{ErrorType, NorFlash, NorFlashErrorKind, ReadNorFlash};

const PAGE: usize = 2048;

/// The flash.
pub struct Nor([u8; 2 * PAGE]);

impl Nor {
    /// Erased.
    pub fn blank() -> Self {
        Self([0xFF; 2 * PAGE])
    }

    /// Puts anything in its place.
    pub fn spoil(&mut self, at: usize, bytes: &[u8]) {
        self.0.iter_mut().skip(at % (2 * PAGE)).zip(bytes).for_each(|(place, byte)| *place = *byte);
    }

    fn place(&mut self, offset: u32, length: usize) -> Result<&mut [u8], NorFlashErrorKind> {
        let start = offset as usize;
        self.0.get_mut(start..start + length).ok_or(NorFlashErrorKind::OutOfBounds)
    }
}

impl ErrorType for Nor {
    type Error = NorFlashErrorKind;
}

impl ReadNorFlash for Nor {
    const READ_SIZE: usize = 1;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), NorFlashErrorKind> {
        bytes.copy_from_slice(self.place(offset, bytes.len())?);
        Ok(())
    }

    fn capacity(&self) -> usize {
        2 * PAGE
    }
}

impl NorFlash for Nor {
    const WRITE_SIZE: usize = 4;
    const ERASE_SIZE: usize = PAGE;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), NorFlashErrorKind> {
        self.place(from, (to - from) as usize)?.fill(0xFF);
        Ok(())
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), NorFlashErrorKind> {
        self.place(offset, bytes.len())?.iter_mut().zip(bytes).for_each(|(place, byte)| *place &= byte);
        Ok(())
    }
}
