//! What packing gives: the blob, and the evidence for its bound.

use super::error::PackError;
use super::proof::Proof;
use super::sigma_error::PackedPair;
use super::work::Work;
use ray_runtime::format::Encoding;
use serde::Serialize;

/// A packed rig and the evidence for its bound.
#[derive(Debug, Clone, PartialEq)]
pub struct Packed {
    /// The blob.
    pub bytes: Vec<u8>,
    /// Largest error over all pixels of the calibrated areas of all cameras, px.
    pub worst_error_px: f64,
    /// Largest distance between a ray and the field's at the working distance, mm.
    pub worst_error_mm: f64,
    /// One for each camera, in the rig's order.
    pub tables: Vec<PackedTable>,
    /// Largest error of the arithmetic of integers over the same pixels, px, if it was asked for.
    pub integer_error_px: Option<f64>,
    /// One for each pair of cameras whose uncertainty the blob carries.
    pub pairs: Vec<PackedPair>,
    /// What other sizes would cost. From small to large; each holds a smaller error than the one
    /// before. The errors are those of a sample of the pixels.
    pub curve: Vec<CurvePoint>,
    /// What the search cost.
    pub work: Work,
}

impl Packed {
    /// This, unless the blob has more bytes than `max_bytes`.
    ///
    /// # Errors
    /// [`PackError::TooFewBytes`].
    pub fn within(self, max_bytes: usize) -> Result<Self, PackError> {
        if self.bytes.len() <= max_bytes {
            Ok(self)
        } else {
            Err(PackError::TooFewBytes {
                max_bytes,
                need: self.bytes.len(),
                max_error_px: self.worst_error_px,
            })
        }
    }
}

/// A camera's table and how well it follows the field.
#[derive(Debug, Clone, PartialEq)]
pub struct PackedTable {
    /// The camera.
    pub camera: String,
    /// How it is stored.
    pub encoding: Encoding,
    /// Cells along u and v.
    pub cells: [u32; 2],
    /// Size of the table, bytes.
    pub bytes: usize,
    /// Comparison of every calibrated pixel, and of quarter pixels along the edge, with the f64 field.
    pub proof: Proof,
    /// Tables tried.
    pub tried: Vec<Tried>,
}

/// A table that was tried, with its errors on a sample of the pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tried {
    /// How it was stored.
    pub encoding: Encoding,
    /// Cells along u and v.
    pub cells: [u32; 2],
    /// Size of the table, bytes.
    pub bytes: usize,
    /// Worst error, px.
    pub error_px: f64,
    /// Worst error at the working distance, mm.
    pub error_mm: f64,
}

/// What a size of all cameras' tables together could hold.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct CurvePoint {
    /// Bytes of the tables.
    pub bytes: usize,
    /// Worst error, px.
    pub error_px: f64,
    /// Worst error at the working distance, mm.
    pub error_mm: f64,
}
