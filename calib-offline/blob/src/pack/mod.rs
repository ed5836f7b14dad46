//! From a calibrated rig to the blob that a device opens, within a proven error.
//!
//! Each camera's ray field becomes a table, of cubic patches (`patches`) or of a polynomial and
//! quantized knots (`quantized`, over `monomials` and `residual_spline`): the smallest that holds the bound
//! (`search`). The bytes are laid out by the runtime's own schema (`encode`); and every pixel of the
//! calibrated area, quarter pixels along its edge too, is looked up in those bytes by the real runtime and
//! compared with the f64 field (`proof`). The largest difference is written into the blob. What is
//! known of the rays' uncertainty goes with it, on a coarse grid (`uncertainty`) whose predictions are
//! compared with the calibration's (`sigma_error`).

mod aligned_bytes;
mod encode;
mod error;
mod field_rows;
mod monomials;
mod nearest;
mod patches;
mod proof;
mod quantized;
mod residual_spline;
mod search;
mod self_test;
mod sigma_error;
mod table;
mod uncertainty;

pub use aligned_bytes::{AlignedBytes, read_aligned};
pub use error::PackError;
pub use nearest::{LOOSEST_PX, pack_nearest, pack_within_bytes};
pub use proof::Proof;
pub use sigma_error::{Deviation, PackedPair};

use calib_rays::field::Rig;
use calib_rays::in_order;
use ray_runtime::RayBlob;
use ray_runtime::format::{Encoding, IDENTITY_LEN, MAX_CELLS, MAX_EXTENT_PX};
use serde::Serialize;

/// What to pack for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PackSettings {
    /// No pixel in the calibrated area may be further from its ray than this, px.
    pub max_error_px: f64,
    /// The distance from the cameras at which things are measured, mm: an error in the offset of
    /// a ray counts as the pixels that it makes there.
    pub working_distance_mm: f64,
    /// First bytes of the hash that identifies the calibration.
    pub identity: [u8; IDENTITY_LEN],
    /// Whether the blob carries what is known of the rays' uncertainty, 648 bytes a pair for smooth lenses.
    pub with_uncertainty: bool,
    /// What matters among tables that hold the bound.
    pub prefer: Prefer,
}

/// What matters among tables that hold the bound.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Prefer {
    /// The fewest bytes: a polynomial, and quantized knots of what it leaves.
    #[default]
    Size,
    /// The fewest instructions per lookup: cubic patches.
    Speed,
}

impl Default for PackSettings {
    /// 0.001 px at 1 m, an identity of zeros, the uncertainty, and the fewest bytes.
    fn default() -> Self {
        Self {
            max_error_px: 0.001,
            working_distance_mm: 1000.0,
            identity: [0; IDENTITY_LEN],
            with_uncertainty: true,
            prefer: Prefer::Size,
        }
    }
}

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
    /// One for each pair of cameras whose uncertainty the blob carries.
    pub pairs: Vec<PackedPair>,
    /// What other sizes would cost. From small to large; each holds a smaller error than the one
    /// before. The errors are those of a sample of the pixels.
    pub curve: Vec<CurvePoint>,
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

/// Packs a rig.
///
/// # Errors
/// Any [`PackError`]; [`PackError::BoundNotReached`] says what would have been possible.
pub fn pack(rig: &Rig, settings: &PackSettings) -> Result<Packed, PackError> {
    check(rig, settings)?;
    let distance_mm = settings.working_distance_mm;
    let mut bounds_px = vec![settings.max_error_px; rig.cameras.len()];
    let choose = |camera, bound_px: &f64| search::choose(camera, settings, *bound_px);
    let mut chosen = in_order::try_map(0..rig.cameras.len(), |idx| {
        choose(&rig.cameras[idx], &bounds_px[idx])
    })?;

    let frame = format!("board at pose {}", rig.datum_pose);
    let mut parts = encode::BlobParts {
        identity: settings.identity,
        frame: &frame,
        max_error_px: settings.max_error_px as f32,
        working_distance_mm: distance_mm as f32,
        self_tests: Vec::new(),
        pairs: Vec::new(),
    };
    // The search looked at a sample of the pixels. Now all, and quarter pixels along the edge; for a
    // camera that fails, the search starts over with a tighter bound.
    let proofs = loop {
        let bytes = parts.encode(rig, chosen.iter().map(|choice| &choice.table))?;
        let bytes = AlignedBytes::from(bytes.as_slice());
        let blob = RayBlob::open(&bytes)?;
        let prove = |idx: usize| {
            let camera = &rig.cameras[idx];
            proof::prove(camera, &blob, idx, distance_mm, 1).merged(proof::prove_edges(
                camera,
                &blob,
                idx,
                distance_mm,
            ))
        };
        let proofs: Vec<Proof> = (0..rig.cameras.len()).map(prove).collect();
        let mut is_proven = true;
        for (idx, camera) in rig.cameras.iter().enumerate() {
            let worst_px = proofs[idx].worst_error_px;
            if worst_px > settings.max_error_px {
                bounds_px[idx] *= TIGHTER * settings.max_error_px / worst_px;
                if bounds_px[idx] < LEAST_SHARE * settings.max_error_px {
                    return Err(PackError::BoundNotReached {
                        camera: camera.name.clone(),
                        wanted_px: settings.max_error_px,
                        best_px: worst_px,
                        cells: chosen[idx].table.cells,
                    });
                }
                chosen[idx] = choose(camera, &bounds_px[idx])?;
                is_proven = false;
            }
        }
        if is_proven {
            break proofs;
        }
    };

    let tables = || chosen.iter().map(|choice| &choice.table);
    let pairs = if settings.with_uncertainty {
        uncertainty::choose(rig, distance_mm, |sections| {
            parts.pairs = sections.to_vec();
            parts.encode(rig, tables())
        })?
    } else {
        Vec::new()
    };
    let worst_error_px = proofs
        .iter()
        .fold(0.0, |worst, p| p.worst_error_px.max(worst));
    parts.max_error_px = encode::rounded_up(worst_error_px);
    let unasked = AlignedBytes::from(parts.encode(rig, tables())?.as_slice());
    parts.self_tests = self_test::ask(rig, &RayBlob::open(&unasked)?, distance_mm);
    let bytes = parts.encode(rig, tables())?;
    RayBlob::open(&AlignedBytes::from(bytes.as_slice()))?
        .run_self_tests()
        .map_err(PackError::SelfTest)?;

    let tried: Vec<_> = chosen
        .iter()
        .map(|choice| choice.tried.as_slice())
        .collect();
    let curve = search::curve(&tried);
    let tables: Vec<PackedTable> = rig
        .cameras
        .iter()
        .zip(chosen)
        .zip(proofs)
        .map(|((camera, choice), proof)| PackedTable {
            camera: camera.name.clone(),
            encoding: choice.table.encoding,
            cells: choice.table.cells,
            bytes: choice.table.bytes.len(),
            proof,
            tried: choice.tried,
        })
        .collect();
    let worst_mm = tables.iter().map(|table| table.proof.worst_error_mm);
    Ok(Packed {
        bytes,
        worst_error_px,
        worst_error_mm: worst_mm.fold(0.0, f64::max),
        tables,
        pairs,
        curve,
    })
}

/// By how much the bound of a search is tightened beyond what the worst pixel asks for.
const TIGHTER: f64 = 0.98;
/// A search whose bound fell below this share of the one asked for is given up.
const LEAST_SHARE: f64 = 0.2;

/// Settings and sizes, before anything is computed.
fn check(rig: &Rig, settings: &PackSettings) -> Result<(), PackError> {
    for (setting, value) in [
        ("max_error_px", settings.max_error_px),
        ("working_distance_mm", settings.working_distance_mm),
    ] {
        if !(value > 0.0 && value.is_finite()) {
            return Err(PackError::BadSetting { setting, value });
        }
    }
    for camera in &rig.cameras {
        let (sensor, mask) = (camera.field.sensor, &camera.coverage);
        let is_extent = |extent| (1..=MAX_EXTENT_PX).contains(&extent);
        if !(is_extent(sensor.width) && is_extent(sensor.height)) {
            return Err(PackError::SensorSize {
                camera: camera.name.clone(),
                sensor,
            });
        }
        let is_count = |cells| (1..=MAX_CELLS as usize).contains(&cells);
        if mask.sensor != sensor
            || !is_count(mask.cells_u)
            || !is_count(mask.cells_v)
            || mask.covered.len() != mask.cells_u * mask.cells_v
        {
            return Err(PackError::Mask {
                camera: camera.name.clone(),
                mask: mask.sensor,
                sensor,
                cells_u: mask.cells_u,
                cells_v: mask.cells_v,
            });
        }
        if !mask.covered.contains(&true) {
            return Err(PackError::NothingCalibrated {
                camera: camera.name.clone(),
            });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests;
