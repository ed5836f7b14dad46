//! Alignment for a blob that is linked into an image.

/// Puts what it wraps on an address that is a multiple of 8, as [`RayBlob::open`] asks.
///
/// `include_bytes!` gives an array without any alignment:
///
/// ```
/// use ray_runtime::{Aligned, RayBlob};
///
/// static RIG: &Aligned<[u8]> = &Aligned(*include_bytes!(concat!(
///     env!("CARGO_MANIFEST_DIR"),
///     "/example.rays"
/// )));
///
/// let rig = RayBlob::open(&RIG.0).unwrap();
/// assert_eq!(rig.camera_count(), 2);
/// ```
///
/// [`RayBlob::open`]: crate::RayBlob::open
#[repr(C, align(8))]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Aligned<T: ?Sized>(pub T);
