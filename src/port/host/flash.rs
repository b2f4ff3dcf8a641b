//! Flash that is a file: `--flash FILE`.

use std::fs::{File, OpenOptions, TryLockError};
use std::io;
use std::os::unix::fs::FileExt;
use std::path::Path;

use embedded_storage_async::nor_flash::{ErrorType, NorFlash, NorFlashErrorKind, ReadNorFlash};

use crate::port::{SettingsFlash, nor};

const PAGE: usize = 64 * 1024;
const CAPACITY: usize = 2 * PAGE;
const ERASED: u8 = 0xFF;

/// A file with the contents and the manners of a flash memory. What an operation has changed is on the disk when it
/// returns.
pub struct Flash(File);

impl Flash {
    /// Opens the file for this process alone, and makes it where there is none.
    pub fn open(path: &Path) -> io::Result<Self> {
        let file = OpenOptions::new().read(true).write(true).create(true).truncate(false).open(path)?;
        match file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => return Err(io::Error::other("another gateway has this file")),
            Err(TryLockError::Error(error)) => return Err(error),
        }
        match file.metadata()?.len() {
            0 => {
                file.write_all_at(&[ERASED; CAPACITY], 0)?;
                file.sync_all()?;
            }
            length if length != CAPACITY as u64 => {
                return Err(io::Error::other(format!(
                    "a flash image has {CAPACITY} bytes, this file {length}"
                )));
            }
            _ => {}
        }
        Ok(Self(file))
    }
}

fn failed(error: io::Error) -> NorFlashErrorKind {
    log::error!("the flash file: {error}");
    NorFlashErrorKind::Other
}

impl ErrorType for Flash {
    type Error = NorFlashErrorKind;
}

impl ReadNorFlash for Flash {
    const READ_SIZE: usize = 1;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), NorFlashErrorKind> {
        nor::check(offset, bytes.len(), Self::READ_SIZE, CAPACITY)?;
        self.0.read_exact_at(bytes, offset.into()).map_err(failed)
    }

    fn capacity(&self) -> usize {
        CAPACITY
    }
}

impl NorFlash for Flash {
    /// As the H7's.
    const WRITE_SIZE: usize = 32;
    const ERASE_SIZE: usize = PAGE;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), NorFlashErrorKind> {
        let length = to.checked_sub(from).ok_or(NorFlashErrorKind::OutOfBounds)? as usize;
        nor::check(from, length, PAGE, CAPACITY)?;
        self.0.write_all_at(&vec![ERASED; length], from.into()).map_err(failed)?;
        self.0.sync_data().map_err(failed)
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), NorFlashErrorKind> {
        nor::check(offset, bytes.len(), Self::WRITE_SIZE, CAPACITY)?;
        let mut words = vec![0; bytes.len()];
        self.0.read_exact_at(&mut words, offset.into()).map_err(failed)?;
        words.iter_mut().zip(bytes).for_each(|(word, byte)| *word &= byte);
        self.0.write_all_at(&words, offset.into()).map_err(failed)?;
        self.0.sync_data().map_err(failed)
    }
}

impl SettingsFlash for Flash {}
