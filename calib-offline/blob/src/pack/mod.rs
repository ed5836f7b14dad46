//! From a calibrated rig to the blob that a device opens, within a proven error.
//!
//! Each camera's ray field becomes a table, of cubic patches (`patches`) or of a polynomial and
//! quantized knots (`quantized`, over `monomials` and `residual_spline`): the smallest that holds the bound
//! (`search`, over `sizes`). No table is made, sampled or proven twice (`trials`), and what all of them may cost is
//! bounded (`work`). The bytes are laid out by the runtime's own schema (`encode`); and every pixel of the
//! calibrated area, quarter pixels along its edge too, is looked up in those bytes by the real runtime and
//! compared with the f64 field (`proof`). The largest difference is written into the blob, and where it is asked for that of the
//! arithmetic of integers too (`integers`). What is
//! known of the rays' uncertainty goes with it, on a coarse grid (`uncertainty`) whose predictions are
//! compared with the calibration's (`sigma_error`).

mod aligned_bytes;
mod blob_error;
mod curve;
mod encode;
mod error;
mod field_rows;
mod integers;
mod monomials;
mod nearest;
mod packed;
mod packer;
mod patches;
mod proof;
mod quantized;
mod residual_spline;
mod search;
mod self_test;
mod settings;
mod sigma_error;
mod sizes;
mod table;
mod trials;
mod uncertainty;
mod work;

pub use aligned_bytes::{AlignedBytes, read_aligned};
pub use blob_error::BlobError;
pub use error::PackError;
pub use nearest::{LOOSEST_PX, pack, pack_nearest, pack_within_bytes};
pub use packed::{CurvePoint, Packed, PackedTable, Tried};
pub use packer::Packer;
pub use proof::{IntegerRig, Proof};
pub use settings::{PackSettings, Prefer};
pub use sigma_error::{Deviation, PackedPair};
pub use work::Work;

#[cfg(test)]
mod tests;
#[cfg(test)]
mod work_tests;
