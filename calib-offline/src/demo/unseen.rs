//! Boards that the calibration never saw, measured by the device's code through a blob.

use super::DemoError;
use calib_blob::matches::BlobSource;
use calib_blob::pack::{AlignedBytes, PackSettings, pack_nearest};
use calib_estimate::adjust::Observations;
use calib_judge::Folds;
use calib_judge::held_out::{BoardErrors, Fold, measure_boards};
use calib_rays::in_order;
use calib_rays::numerics::rms;
use ray_runtime::RayBlob;
use serde::Serialize;

/// Boards measured by the runtime, single precision, each with the blob of a rig that was
/// calibrated without it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct UnseenBoards {
    /// Folds by pose.
    pub folds: usize,
    /// Length of a square's side, mm.
    pub square_mm: f64,
    /// Every pair of views as it was recorded: those too that the calibration takes for bad.
    pub as_recorded: BoardFigures,
    /// Only the pairs that the calibration, which has seen them all, uses as pairs.
    pub as_used: BoardFigures,
    /// Largest difference of the folds' blobs from their rigs, px.
    pub blob_error_px: f64,
}

/// Errors of some boards.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct BoardFigures {
    /// Boards seen by two cameras.
    pub pairs: usize,
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
}

/// What came of one fold.
struct FoldErrors {
    as_recorded: BoardErrors,
    as_used: BoardErrors,
    blob_error_px: f64,
}

/// Packs each fold's rig, opens the blob and measures the fold's boards with it. `offered` is what
/// the calibration was offered, from which it may have left out pairs.
///
/// `None` if nothing was triangulated.
///
/// # Errors
/// What packing and opening give.
pub fn measure_unseen(
    folds: &Folds,
    offered: &Observations,
    settings: &PackSettings,
) -> Result<Option<UnseenBoards>, DemoError> {
    let measured = in_order::try_map(&folds.estimated, |fold| {
        measure_fold(fold, offered, settings)
    })?;
    let (mut as_recorded, mut as_used) = (BoardErrors::default(), BoardErrors::default());
    let mut blob_error_px = 0.0_f64;
    for fold in measured {
        as_recorded.add(fold.as_recorded);
        as_used.add(fold.as_used);
        blob_error_px = blob_error_px.max(fold.blob_error_px);
    }
    let square_mm = offered.board.square_mm;
    let figures = [as_recorded, as_used].map(|errors| BoardFigures::of(&errors, square_mm));
    let [Some(as_recorded), Some(as_used)] = figures else {
        return Ok(None);
    };
    Ok(Some(UnseenBoards {
        folds: folds.estimated.len(),
        square_mm,
        as_recorded,
        as_used,
        blob_error_px,
    }))
}

fn measure_fold(
    fold: &Fold,
    offered: &Observations,
    settings: &PackSettings,
) -> Result<FoldErrors, DemoError> {
    let packed = pack_nearest(&fold.rig, settings)?;
    let bytes = AlignedBytes::from(packed.bytes.as_slice());
    let blob = RayBlob::open(&bytes)?;
    let recorded = offered.with_poses(|pose| fold.unseen.poses.contains(&pose));
    // Without a frame there is always a source.
    let source = BlobSource::new(&blob, None);
    let measure = |boards: &Observations| {
        let errors = source.as_ref().map(|source| measure_boards(source, boards));
        errors.unwrap_or_default()
    };
    Ok(FoldErrors {
        as_recorded: measure(&recorded),
        as_used: measure(&fold.unseen),
        blob_error_px: packed.worst_error_px,
    })
}

impl BoardFigures {
    /// `None` if nothing was triangulated.
    fn of(errors: &BoardErrors, square_mm: f64) -> Option<Self> {
        let mut sizes: Vec<f64> = errors.neighbor_errors.iter().map(|e| e.abs()).collect();
        sizes.sort_by(f64::total_cmp);
        let neighbor_rms = rms(&sizes)?;
        Some(Self {
            pairs: errors.board_count,
            neighbor_rms_percent: 100.0 * neighbor_rms,
            neighbor_rms_mm: neighbor_rms * square_mm,
            neighbor_median_percent: 100.0 * sizes.get(sizes.len() / 2)?,
            rigid_rms_mm: rms(&errors.rigid_errors_mm)?,
            points: errors.point_count,
            outside: errors.outside_count,
            unmet: errors.unmet_count,
        })
    }
}
