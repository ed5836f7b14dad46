//! Bytes on an address that the runtime accepts.

use std::ops::Deref;
use std::path::Path;

/// Bytes that start on a multiple of 8, as `RayBlob::open` asks; a `Vec<u8>` need not.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct AlignedBytes {
    words: Vec<u64>,
    len: usize,
}

impl From<&[u8]> for AlignedBytes {
    fn from(bytes: &[u8]) -> Self {
        let mut words = vec![0u64; bytes.len().div_ceil(8)];
        bytemuck::cast_slice_mut(&mut words)[..bytes.len()].copy_from_slice(bytes);
        Self {
            words,
            len: bytes.len(),
        }
    }
}

impl Deref for AlignedBytes {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        &bytemuck::cast_slice(&self.words)[..self.len]
    }
}

/// Reads a whole file onto an aligned address.
///
/// # Errors
/// What reading the file gives.
pub fn read_aligned(path: &Path) -> std::io::Result<AlignedBytes> {
    Ok(AlignedBytes::from(std::fs::read(path)?.as_slice()))
}
