//! What an audit found, as JSON has it.

use crate::compare::bootstrap::Ratio;
use serde::Serialize;

/// Name and version of the object.
pub const SCHEMA: &str = "calib-offline/audit/1";

/// Calibrations on one recording.
#[derive(Debug, Serialize)]
pub struct Audit {
    /// [`SCHEMA`].
    pub schema: &'static str,
    /// Version of the program.
    pub tool_version: &'static str,
    /// Of the manifest and the corners.
    pub input_sha256: String,
    /// Pitch of the board's corners, mm.
    pub square_mm: f64,
    /// Poses used.
    pub poses: usize,
    /// Views used.
    pub views: usize,
    /// Corners used.
    pub corners: usize,
    /// Folds of our own estimate's held-out check.
    pub folds: usize,
    /// Corners that all calibrations and every fold of ours can answer.
    pub common_corners: usize,
    /// Each calibration, in the order of the files.
    pub calibrations: Vec<Audited>,
    /// Our own joint estimate from these corners.
    pub ours: Option<Audited>,
    /// Why there is none.
    pub no_estimate: Option<String>,
    /// In plain words.
    pub conclusion: Vec<String>,
}

/// The figures of one calibration.
#[derive(Debug, Serialize)]
pub struct Audited {
    /// What it is called.
    pub title: String,
    /// Its files.
    pub files: Vec<String>,
    /// Whether it was made from these corners: then its figures are fitted ones. `None` where no file says so.
    pub saw_these: Option<bool>,
    /// RMS residual of all corners, a pose for each view, px.
    pub rms_px: Option<f64>,
    /// RMS residual with one pose of a board for all cameras, px.
    pub together_rms_px: Option<f64>,
    /// Corners behind that.
    pub together_corners: usize,
    /// Views whose board could not be placed.
    pub unplaced_views: usize,
    /// Camera by camera.
    pub cameras: Vec<AuditedCamera>,
    /// What it measures; `None` of one camera, or where nobody says how cameras stand.
    pub points: Option<PointFigures>,
    /// On the corners that all can answer; of our own estimate, on boards that it never saw.
    pub common: Option<CommonFigures>,
    /// Errors over those of our own estimate on boards that it never saw.
    pub against_ours: Option<AgainstOurs>,
}

/// The figures of a camera.
#[derive(Debug, Serialize)]
pub struct AuditedCamera {
    /// Its name.
    pub name: String,
    /// Its model.
    pub model: String,
    /// Corners with a residual.
    pub corners: usize,
    /// Corners for which the calibration has no pixel.
    pub unanswered: usize,
    /// RMS residual, px.
    pub rms_px: Option<f64>,
    /// Its median.
    pub median_px: Option<f64>,
    /// Where on the sensor.
    pub regions: Vec<Region>,
}

/// A third of the sensor both ways.
#[derive(Debug, Serialize)]
pub struct Region {
    /// Which.
    pub name: &'static str,
    /// Corners in it.
    pub corners: usize,
    /// RMS residual, px.
    pub rms_px: f64,
    /// Mean residual (observed minus predicted), px: what is the same in all images.
    pub mean_px: [f64; 2],
}

/// Triangulated boards.
#[derive(Debug, Serialize)]
pub struct PointFigures {
    /// Points.
    pub points: usize,
    /// Corners seen by two cameras that have no point.
    pub unanswered: usize,
    /// RMS error of the distance of neighboring corners, mm.
    pub neighbor_rms_mm: Option<f64>,
    /// Mean error of it, percent: a wrong scale.
    pub scale_percent: Option<f64>,
    /// RMS distance from the rigid board, mm.
    pub rigid_rms_mm: Option<f64>,
}

/// The corners that all can answer.
#[derive(Debug, Serialize)]
pub struct CommonFigures {
    /// RMS residual, px.
    pub rms_px: Option<f64>,
    /// RMS error of the distance of neighboring corners, mm.
    pub neighbor_rms_mm: Option<f64>,
    /// RMS distance from the rigid board, mm.
    pub rigid_rms_mm: Option<f64>,
}

/// Errors over ours.
#[derive(Debug, Serialize)]
pub struct AgainstOurs {
    /// Of residuals.
    pub residual: Option<Ratio>,
    /// Of distances of neighbors.
    pub neighbor: Option<Ratio>,
    /// Of distances from the rigid board.
    pub rigid: Option<Ratio>,
}

/// RMS; `None` of nothing.
pub(super) fn rms(values: &[f64]) -> Option<f64> {
    let squares: f64 = values.iter().map(|value| value * value).sum();
    (!values.is_empty()).then(|| (squares / values.len() as f64).sqrt())
}
