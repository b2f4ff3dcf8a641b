//! What all flash of a port has in common.

use embedded_storage_async::nor_flash::NorFlashErrorKind;

/// Whether `length` bytes from `offset` on lie within `capacity`, in whole `unit`s.
pub(super) fn check(
    offset: u32,
    length: usize,
    unit: usize,
    capacity: usize,
) -> Result<core::ops::Range<usize>, NorFlashErrorKind> {
    let start = offset as usize;
    let end =
        start.checked_add(length).filter(|end| *end <= capacity).ok_or(NorFlashErrorKind::OutOfBounds)?;
    if start.is_multiple_of(unit) && length.is_multiple_of(unit) {
        Ok(start..end)
    } else {
        Err(NorFlashErrorKind::NotAligned)
    }
}
