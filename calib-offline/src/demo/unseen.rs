//! Boards that the calibration never saw, measured by the device's code through a blob.

use super::DemoError;
use crate::error::Error;
use crate::evaluate::Folds;
use crate::evaluate::held_out::{BoardErrors, Fold, measure_boards};
use crate::matches::source::BlobSource;
use crate::pack::{AlignedBytes, PackSettings, pack_nearest};
use ray_runtime::RayBlob;
use rayon::prelude::*;
use serde::Serialize;

/// Errors of boards measured by the runtime, single precision, each with the blob of a rig that
/// was calibrated without it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct UnseenBoards {
    /// Folds by pose.
    pub folds: usize,
    /// Length of a square's side, mm.
    pub square_mm: f64,
    /// Error of the distance of neighboring corners, RMS, percent of the square.
    pub neighbor_rms_percent: f64,
    /// The same, mm.
    pub neighbor_rms_mm: f64,
    /// Half of the errors are smaller, percent of the square.
    pub neighbor_median_percent: f64,
    /// RMS distance of the corners from the rigid board, mm.
    pub rigid_rms_mm: f64,
    /// Corners triangulated.
    pub points: usize,
    /// Corners seen by both cameras, but outside the calibrated area of their fold.
    pub outside: usize,
    /// Corners whose rays did not meet before the cameras.
    pub unmet: usize,
    /// Largest difference of the folds' blobs from their rigs, px.
    pub blob_error_px: f64,
}

/// Packs each fold's rig, opens the blob and measures the fold's boards with it.
///
/// `None` if nothing was triangulated.
///
/// # Errors
/// What packing and opening give.
pub fn measure_unseen(
    folds: &Folds,
    settings: &PackSettings,
) -> Result<Option<UnseenBoards>, Error> {
    let measured: Vec<(BoardErrors, f64)> = folds
        .estimated
        .par_iter()
        .map(|fold| measure_fold(fold, settings))
        .collect::<Result<_, _>>()?;
    let (mut all, mut blob_error_px) = (BoardErrors::default(), 0.0_f64);
    for (errors, error_px) in measured {
        all.add(errors);
        blob_error_px = blob_error_px.max(error_px);
    }
    let square_mm = match folds.estimated.first() {
        Some(fold) => fold.unseen.board.square_mm,
        None => return Ok(None),
    };
    let mut sizes: Vec<f64> = all.neighbor_errors.iter().map(|e| e.abs()).collect();
    sizes.sort_by(f64::total_cmp);
    let (Some(neighbor_rms), Some(rigid_rms_mm), Some(median)) = (
        rms(&sizes),
        rms(&all.rigid_errors_mm),
        sizes.get(sizes.len() / 2),
    ) else {
        return Ok(None);
    };
    Ok(Some(UnseenBoards {
        folds: folds.estimated.len(),
        square_mm,
        neighbor_rms_percent: 100.0 * neighbor_rms,
        neighbor_rms_mm: neighbor_rms * square_mm,
        neighbor_median_percent: 100.0 * median,
        rigid_rms_mm,
        points: all.point_count,
        outside: all.outside_count,
        unmet: all.unmet_count,
        blob_error_px,
    }))
}

fn measure_fold(fold: &Fold, settings: &PackSettings) -> Result<(BoardErrors, f64), Error> {
    let packed = pack_nearest(&fold.rig(), settings)?;
    let bytes = AlignedBytes::from(packed.bytes.as_slice());
    let blob = RayBlob::open(&bytes).map_err(DemoError::Open)?;
    // Without a frame there is always a source.
    let errors = BlobSource::new(&blob, None)
        .map(|source| measure_boards(&source, &fold.unseen))
        .unwrap_or_default();
    Ok((errors, packed.worst_error_px))
}

/// Root mean square; `None` of nothing.
fn rms(values: &[f64]) -> Option<f64> {
    (!values.is_empty())
        .then(|| (values.iter().map(|x| x * x).sum::<f64>() / values.len() as f64).sqrt())
}
