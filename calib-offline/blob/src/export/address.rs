//! Where bytes may go in a memory with addresses of 32 bits.

use super::error::ExportError;

/// What the address of a blob is a multiple of, bytes: the runtime reads it in place.
pub(super) const ALIGNMENT: u32 = ray_runtime::format::ALIGNMENT as u32;

/// Whether so many bytes fit at an address that is to be such a multiple.
///
/// # Errors
/// [`ExportError::Misaligned`], [`ExportError::TooHigh`].
pub(super) fn check_address(address: u32, multiple: u32, length: usize) -> Result<(), ExportError> {
    if !address.is_multiple_of(multiple) {
        return Err(ExportError::Misaligned { address, multiple });
    }
    if u64::from(address) + length as u64 > 1 << 32 {
        return Err(ExportError::TooHigh { address, length });
    }
    Ok(())
}
