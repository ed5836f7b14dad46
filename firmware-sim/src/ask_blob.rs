//! A blob that is somewhere in memory, asked once.

use ray_runtime::{OpenError, RayBlob};

/// Asks a blob, which must be one, whole and readable.
pub(crate) fn ask_blob<T>(
    blob: &[u8],
    ask: impl FnOnce(&RayBlob<'_>) -> T,
) -> Result<T, OpenError> {
    let mut words = vec![0_u64; blob.len().div_ceil(8)];
    let bytes: &mut [u8] = bytemuck::cast_slice_mut(&mut words);
    let (bytes, _) = bytes.split_at_mut(blob.len());
    bytes.copy_from_slice(blob);
    RayBlob::open(bytes).map(|blob| ask(&blob))
}
