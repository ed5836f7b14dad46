//! What a comparison found: `comparison.json`, and what `--json` prints.

use super::bootstrap::Ratio;
use calib_judge::held_out::FailedFold;
use calib_judge::known_points::TruthErrors;
use serde::Serialize;
use std::time::Duration;

/// Name and version of the format.
pub const SCHEMA: &str = "calib-offline/compare/1";

/// Methods side by side. Lengths are millimeters.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Comparison {
    /// [`SCHEMA`].
    pub schema: &'static str,
    /// Version of the program.
    pub tool_version: &'static str,
    /// SHA-256 of the manifest and of the corners, hex.
    pub input_sha256: String,
    /// Length of a square's side, mm.
    pub square_mm: f64,
    /// Median distance of the boards from the first camera, mm.
    pub working_distance_mm: Option<f64>,
    /// Poses, views and corners that every method was given.
    pub poses: usize,
    /// Views.
    pub views: usize,
    /// Corners.
    pub corners: usize,
    /// Corners that every method rejects: they are in no held-out figure.
    pub outliers: usize,
    /// Folds that the held-out figures are from.
    pub folds: usize,
    /// Held-out corners of those folds, without the outliers.
    pub held_out_corners: usize,
    /// How many of them every method can answer: the held-out figures are from these.
    pub common_corners: usize,
    /// Held-out boards.
    pub boards: usize,
    /// Each method.
    pub methods: Vec<MethodFigures>,
    /// In words.
    pub conclusion: Vec<String>,
}

/// The figures of one method.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MethodFigures {
    /// Its name.
    pub method: &'static str,
    /// In words.
    pub title: &'static str,
    /// Why it has no answer; all that follows is empty then.
    pub failure: Option<String>,
    /// On what it was made from.
    pub training: Option<Training>,
    /// Largest difference of the rays compared from the method's own, px.
    pub conversion_error_px: Option<f64>,
    /// Folds without an answer. If they are more than half, there is no `held_out`.
    pub failed_folds: Vec<FailedFold>,
    /// On boards that it never saw.
    pub held_out: Option<HeldOutFigures>,
    /// Its held-out errors over those of the first method.
    pub against_first: Option<Ratios>,
    /// On matches whose truth is known.
    pub truth: Vec<TruthFigures>,
    /// Time for the fit and the folds; differs between machines, so it is in no file.
    #[serde(skip)]
    pub time: Duration,
}

/// Residuals of the corners that a calibration is made from.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Training {
    /// RMS of the residual vectors of the corners that no method rejects, px.
    pub rms_px: f64,
    /// Corners behind it.
    pub corners: usize,
    /// Corners that this method rejects, or whose board it cannot place.
    pub rejected: usize,
}

/// Errors on held-out boards, over the corners that every method can answer.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct HeldOutFigures {
    /// RMS of the residual vectors with the board's pose refitted, px.
    pub rms_px: Option<f64>,
    /// Median of their lengths, px.
    pub median_px: Option<f64>,
    /// RMS error of the distance of neighboring corners, percent of the square.
    pub neighbor_rms_percent: Option<f64>,
    /// The same, mm.
    pub neighbor_rms_mm: Option<f64>,
    /// RMS distance of the corners from the rigid board, mm.
    pub rigid_rms_mm: Option<f64>,
    /// Points triangulated.
    pub points: usize,
    /// Held-out corners outside this method's own calibrated area.
    pub unanswered: usize,
}

/// Errors over those of the first method, on the same boards.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Ratios {
    /// Of the residuals.
    pub residual: Option<Ratio>,
    /// Of the distance of neighboring corners.
    pub neighbor: Option<Ratio>,
    /// Of the distance from the rigid board.
    pub rigid: Option<Ratio>,
}

/// Errors on matches whose truth is known, over the matches that every method has a point for.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TruthFigures {
    /// The file of matches.
    pub file: String,
    /// Matches that this method has no point for.
    pub unanswered: usize,
    /// How far its points are from the truth.
    pub errors: Option<TruthErrors>,
}
