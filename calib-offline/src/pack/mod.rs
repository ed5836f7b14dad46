//! From a calibrated rig to the blob that a device opens, within a proven error.
//!
//! Each camera's ray field is resampled onto one control grid (`grid`), the coarsest that holds
//! the bound (`budget`); the bytes are laid out by the runtime's own schema (`encode`); and
//! every pixel of the calibrated area is looked up in those bytes by the real runtime and
//! compared with the f64 field (`proof`). The largest difference is written into the blob. What is
//! known of the rays' uncertainty goes with it, on a coarse grid (`uncertainty`) whose predictions are
//! compared with the calibration's (`sigma_error`).

mod aligned_bytes;
mod budget;
mod encode;
mod field_rows;
mod grid;
mod nearest;
mod proof;
mod self_test;
mod sigma_error;
mod uncertainty;

pub use aligned_bytes::{AlignedBytes, read_aligned};
pub use grid::ControlGrid;
pub use nearest::pack_nearest;
pub use proof::Proof;
pub use sigma_error::{Deviation, PackedPair};

use crate::field::Rig;
use crate::geometry::{PixelPoint, SensorSize};
use crate::in_order;
use ray_runtime::format::{IDENTITY_LEN, MAX_CELLS, MAX_EXTENT_PX};
use ray_runtime::{OpenError, RayBlob, SelfTestFailure};

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
}

impl Default for PackSettings {
    /// 0.001 px at 1 m, an identity of zeros, and the uncertainty.
    fn default() -> Self {
        Self {
            max_error_px: 0.001,
            working_distance_mm: 1000.0,
            identity: [0; IDENTITY_LEN],
            with_uncertainty: true,
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
    /// One for each camera, in the rig's order.
    pub grids: Vec<PackedGrid>,
    /// One for each pair of cameras whose uncertainty the blob carries.
    pub pairs: Vec<PackedPair>,
    /// What other sizes would cost: bytes of the tables of all cameras, and the worst error, px.
    /// From small to large; each holds a smaller error than the one before. The errors are
    /// those of a sample of the pixels.
    pub curve: Vec<(usize, f64)>,
}

/// A camera's control grid and how well it follows the field.
#[derive(Debug, Clone, PartialEq)]
pub struct PackedGrid {
    /// The camera.
    pub camera: String,
    /// Cells along u and v.
    pub cells: [u32; 2],
    /// Whether all rays start in one point.
    pub is_central: bool,
    /// Size of the grid's table, bytes.
    pub bytes: usize,
    /// Comparison of every calibrated pixel with the f64 field.
    pub proof: Proof,
    /// Grids tried: bytes of the table, and the worst error of a sample of the pixels, px.
    pub tried: Vec<(usize, f64)>,
}

/// Why a rig cannot be packed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PackError {
    /// A setting is not a positive number.
    #[error("{setting} must be a positive number, not {value}")]
    BadSetting {
        /// Which.
        setting: &'static str,
        /// Its value.
        value: f64,
    },
    /// The sensor is larger than the format allows.
    #[error(
        "the {sensor} sensor of camera `{camera}` does not fit the format: 1 to {MAX_EXTENT_PX} px"
    )]
    SensorSize {
        /// The camera.
        camera: String,
        /// Its sensor.
        sensor: SensorSize,
    },
    /// The mask is not one of the camera's sensor, or has no cells or too many.
    #[error(
        "the mask of camera `{camera}` has {cells_u}x{cells_v} cells over {mask}, \
         the sensor is {sensor}; 1 to {MAX_CELLS} cells are possible"
    )]
    Mask {
        /// The camera.
        camera: String,
        /// Sensor of the mask.
        mask: SensorSize,
        /// Sensor of the field.
        sensor: SensorSize,
        /// Cells along u.
        cells_u: usize,
        /// Cells along v.
        cells_v: usize,
    },
    /// No pixel of a camera is calibrated.
    #[error("camera `{camera}` has no calibrated pixel")]
    NothingCalibrated {
        /// The camera.
        camera: String,
    },
    /// The field is no number, or looks more than 127 degrees off axis, in the calibrated area.
    #[error("the ray of camera `{camera}` at pixel ({:.1}, {:.1}) cannot be packed: {s:?}", pixel.u, pixel.v)]
    Field {
        /// The camera.
        camera: String,
        /// Where.
        pixel: PixelPoint,
        /// Half-angle vector there.
        s: [f64; 2],
    },
    /// The grid's equations have no solution.
    #[error("no {}x{} grid can be fitted to camera `{camera}`", cells[0], cells[1])]
    Fit {
        /// The camera.
        camera: String,
        /// Cells along u and v.
        cells: [u32; 2],
    },
    /// What a calibration says of a pair's uncertainty is no covariance.
    #[error("the uncertainty of cameras {first} and {second} is not a covariance")]
    Uncertainty {
        /// Index of the first camera.
        first: usize,
        /// Index of the second.
        second: usize,
    },
    /// No grid holds the bound.
    #[error(
        "camera `{camera}` cannot be packed within {wanted_px} px: \
         the best grid tried, {}x{} cells, is off by {best_px:.2e} px at worst",
        cells[0], cells[1]
    )]
    BoundNotReached {
        /// The camera.
        camera: String,
        /// The bound asked for, px.
        wanted_px: f64,
        /// The smallest worst error reached, px.
        best_px: f64,
        /// With this grid.
        cells: [u32; 2],
    },
    /// The runtime refuses what would be written: a name is empty or taken twice, a number is
    /// too large, a rotation is none.
    #[error("the runtime would refuse the blob: {0}")]
    Refused(#[from] OpenError),
    /// The runtime does not repeat its own answers.
    #[error("self-test {} of the blob fails on this machine", .0.test)]
    SelfTest(SelfTestFailure),
    /// The blob would be larger than its length field can say.
    #[error("the blob would have {bytes} bytes; the format ends at 4 GiB")]
    TooLarge {
        /// Bytes.
        bytes: usize,
    },
}

/// Packs a rig.
///
/// # Errors
/// Any [`PackError`]; [`PackError::BoundNotReached`] says what would have been possible.
pub fn pack(rig: &Rig, settings: &PackSettings) -> Result<Packed, PackError> {
    check(rig, settings)?;
    let mut chosen = in_order::try_map(&rig.cameras, |camera| {
        budget::coarsest_grid(camera, settings)
    })?;

    let frame = format!("board at pose {}", rig.datum_pose);
    let mut parts = encode::BlobParts {
        identity: settings.identity,
        frame: &frame,
        max_error_px: settings.max_error_px as f32,
        working_distance_mm: settings.working_distance_mm as f32,
        self_tests: Vec::new(),
        pairs: Vec::new(),
    };
    // The search looked at a sample of the pixels. Now all; a camera that fails gets a finer grid.
    let proofs = loop {
        let bytes = parts.encode(rig, chosen.iter().map(|choice| &choice.grid))?;
        let bytes = AlignedBytes::from(bytes.as_slice());
        let blob = RayBlob::open(&bytes)?;
        let proofs: Vec<Proof> = (0..rig.cameras.len())
            .map(|idx| {
                proof::prove(
                    &rig.cameras[idx],
                    &blob,
                    idx,
                    settings.working_distance_mm,
                    1,
                )
            })
            .collect();
        let mut is_proven = true;
        for (idx, camera) in rig.cameras.iter().enumerate() {
            let worst_px = proofs[idx].worst_error_px;
            if worst_px > settings.max_error_px {
                chosen[idx].refine(camera, settings, worst_px)?;
                is_proven = false;
            }
        }
        if is_proven {
            break proofs;
        }
    };

    let grids = || chosen.iter().map(|choice| &choice.grid);
    let distance_mm = settings.working_distance_mm;
    let pairs = if settings.with_uncertainty {
        uncertainty::choose(rig, distance_mm, |sections| {
            parts.pairs = sections.to_vec();
            parts.encode(rig, grids())
        })?
    } else {
        Vec::new()
    };
    let worst_error_px = proofs
        .iter()
        .fold(0.0, |worst, p| p.worst_error_px.max(worst));
    parts.max_error_px = encode::rounded_up(worst_error_px);
    let unasked = AlignedBytes::from(parts.encode(rig, grids())?.as_slice());
    parts.self_tests = self_test::ask(rig, &RayBlob::open(&unasked)?, distance_mm);
    let bytes = parts.encode(rig, grids())?;
    RayBlob::open(&AlignedBytes::from(bytes.as_slice()))?
        .run_self_tests()
        .map_err(PackError::SelfTest)?;

    let tried: Vec<_> = chosen
        .iter()
        .map(|choice| choice.tried.as_slice())
        .collect();
    let curve = budget::curve(&tried);
    let grids = rig
        .cameras
        .iter()
        .zip(chosen)
        .zip(proofs)
        .map(|((camera, choice), proof)| PackedGrid {
            camera: camera.name.clone(),
            cells: choice.grid.cells,
            is_central: camera.field.is_central(),
            bytes: choice.grid.byte_count(),
            proof,
            tried: choice.tried,
        })
        .collect();
    Ok(Packed {
        bytes,
        worst_error_px,
        grids,
        pairs,
        curve,
    })
}

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
