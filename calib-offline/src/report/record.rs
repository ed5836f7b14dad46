//! `calibration.json`: everything a calibration found, versioned, enough to draw every figure again.

use super::nearest_pinhole::NearestPinhole;
use calib_estimate::alternating::estimate::{PlacementCircles, StartCost};
use calib_estimate::alternating::spread::SpreadChoice;
use calib_estimate::joint::{Choice, SmoothnessFound};
pub use calib_judge::agreement::Agreement;
pub use calib_judge::held_out::FailedFold;
pub use calib_judge::model_choice::ModelChoice;
pub use calib_judge::stage_axis::StageAxis;
pub use calib_judge::verdict::{Grade, Verdict};
pub use calib_judge::{Cause, CrossChecks, ExpectedError};
pub use calib_rays::board::BoardShape;
use calib_rays::board::BoardSpec;
use calib_rays::field::Rig;
use calib_rays::geometry::{PixelPoint, RigidTransform};
use calib_rays::observed::KnownPose;
pub use calib_recording::dataset::{Certificate, ExpectedOptics, RecordingSpec};
use nalgebra::Vector2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Name and version of the format: the one written.
pub const SCHEMA: &str = "calib-offline/calibration/2";
/// The version before, which is read too: rotations are nine numbers, column by column.
pub const SCHEMA_1: &str = "calib-offline/calibration/1";

/// The whole result of `calibrate`.
///
/// Millimeters; the center of the top-left pixel is (0, 0); `a_from_b` maps coordinates in b to
/// coordinates in a. The rig frame is the board frame at the datum pose.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Calibration {
    /// [`SCHEMA`].
    pub schema: String,
    /// Version of the program that wrote the file.
    pub tool_version: String,
    /// What the program was asked for, as words of a command line: the dataset by the name of its folder, without
    /// what has no bearing on the result. `None` where a library was, and in files of earlier versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub command: Option<String>,
    /// `joint` or `alternating`; `imported` of a calibration by another tool.
    pub method: String,
    /// SHA-256 of the manifest and of the corners that went in, hex; of an imported calibration, of its files. With the
    /// tool's version it identifies the calibration.
    pub input_sha256: String,
    /// The board as it was while it was recorded: as the manifest describes it, longer by what its
    /// certificate says of its temperature. Of an imported calibration nothing is known of a board: no rows, no columns.
    pub board: BoardSpec,
    /// What the manifest says of the board's lengths, if it does.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub certificate: Option<Certificate>,
    /// Poses that were known beforehand, by number.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub known_poses: BTreeMap<usize, KnownPose>,
    /// What the manifest says of the recording, if it does.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub recording: Option<RecordingSpec>,
    /// What the manifest says of each camera, in the rig's order; empty in files of earlier versions.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub cameras: Vec<CameraRecord>,
    /// Out-of-plane shape found for the board.
    pub board_shape: BoardShape,
    /// The calibrated cameras.
    pub rig: Rig,
    /// Each camera as the pinhole that comes nearest to its rays at the median working distance: frames in which
    /// baselines and angles compare with those of other tools. Empty where a camera has none, and in files of earlier versions.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub nearest_pinholes: Vec<NearestPinhole>,
    /// Every pose used. A pose whose views do not show the board in the same place has one record
    /// for each place.
    pub poses: Vec<PoseRecord>,
    /// The stage's axis per placement, if the dataset says which placement poses belong to.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub stage_axes: Vec<StageAxis>,
    /// Every corner offered to the estimate.
    pub corners: Vec<CornerRecord>,
    /// What was left out, and why.
    pub left_out: Vec<LeftOut>,
    /// Views whose board was numbered from the other end: renumbered and used.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub renumbered: Vec<Renumbered>,
    /// How the estimate went.
    pub estimate: EstimateRecord,
    /// What the estimate chose by itself; `None` in files of earlier versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub choices: Option<ChoicesRecord>,
    /// How the published procedure went; `None` for another method.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub alternating: Option<AlternatingRecord>,
    /// Held-out check; `None` if there were too few poses for one.
    pub held_out: Option<HeldOutRecord>,
    /// Checks of the calibration against itself; `None` in files of earlier versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub checks: Option<CrossChecks>,
    /// What was found about the recording, most likely first.
    #[serde(default)]
    pub causes: Vec<Cause>,
    /// The expected error of the measurement that was asked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub task: Option<ExpectedError>,
    /// Where it came from, if another tool made it: then there are neither poses nor corners.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub imported: Option<ImportRecord>,
    /// The judgement.
    pub verdict: Verdict,
}

/// Where an imported calibration came from, and what was lost on the way.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ImportRecord {
    /// The tool whose format it was.
    pub format: String,
    /// Names of the files.
    pub files: Vec<String>,
    /// In the rig's order.
    pub cameras: Vec<ImportedCamera>,
    /// Where things are measured, mm from the cameras, if somebody said so.
    pub working_distance_mm: Option<f64>,
    /// What was lost, in words.
    pub lost: Vec<String>,
}

/// A camera of an imported calibration.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ImportedCamera {
    /// Its name in the rig.
    pub name: String,
    /// The model's name in its tool.
    pub model: String,
    /// RMS difference of the ray field from the model over the calibrated area, px.
    pub rms_px: f64,
    /// The largest, px.
    pub max_px: f64,
}

/// A camera as the manifest describes it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct CameraRecord {
    /// Its name in the rig.
    pub name: String,
    /// Serial number, if the manifest says it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub serial: Option<String>,
    /// What stands before it, if the manifest says it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub optics: Option<ExpectedOptics>,
}

/// One pose of the board.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct PoseRecord {
    /// Its number in the dataset.
    pub pose: usize,
    /// Where the board was.
    pub rig_from_board: RigidTransform,
    /// RMS of the residual vectors per camera, px, in the rig's camera order; `None` where the
    /// camera did not see the pose.
    pub rms_px: Vec<Option<f64>>,
    /// Dial reading, if the dataset has one.
    pub stage_angle_deg: Option<f64>,
}

/// One corner offered to the estimate.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct CornerRecord {
    /// Index into the rig's cameras.
    pub camera_idx: usize,
    /// Number of the pose in the dataset.
    pub pose: usize,
    /// Row on the board.
    pub row: usize,
    /// Column on the board.
    pub col: usize,
    /// Where it was seen.
    pub observed: PixelPoint,
    /// Observed minus predicted, px (to first order, see `joint::residual`); zero where no ray
    /// predicts.
    #[schemars(with = "[f64; 2]")]
    pub residual_px: Vector2<f64>,
    /// Robust weight, 0 to 1; 0 is a corner that is rejected or that no ray predicts.
    pub weight: f64,
}

/// Something that did not go into the estimate.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct LeftOut {
    /// Number of the pose.
    pub pose: usize,
    /// Name of the camera; `None` if the pose was left out for all.
    pub camera: Option<String>,
    /// Number of corners left out; 0 where views are used, but not as a pair.
    pub corner_count: usize,
    /// In words.
    pub reason: String,
}

/// A view whose labels were changed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Renumbered {
    /// Number of the pose.
    pub pose: usize,
    /// Name of the camera.
    pub camera: String,
    /// In words.
    pub reason: String,
}

/// How the estimate went.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct EstimateRecord {
    /// Cost after each accepted step.
    pub cost_per_iteration: Vec<f64>,
    /// Why it stopped, in words.
    pub stop_reason: String,
    /// Standard deviation of the corner noise per axis, px, robust estimate.
    pub sigma_px: f64,
    /// RMS of the residual vectors of the corners used, px.
    pub rms_px: f64,
    /// Corners used.
    pub corners_used: usize,
    /// Corners rejected as outliers; those that no ray predicts are in neither number.
    pub corners_rejected: usize,
}

/// What the estimate chose by itself, each with its evidence. "Evidence" is twice the logarithm of
/// the probability of the data under a model; the scale is that of Kass and Raftery (1995).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ChoicesRecord {
    /// The alternatives, in the order tried.
    pub tried: Vec<Choice>,
    /// How strongly smoothness holds each family of numbers of each camera, and how many of
    /// them the data determine.
    pub smoothness: Vec<SmoothnessFound>,
    /// Degrees of freedom of the Student-t distribution of the residuals: 3 has heavy tails, 1000
    /// is a Gaussian. Its scale is `sigma_px` of the estimate.
    pub noise_freedom: f64,
    /// Correlation of the residuals of neighboring corners: 0 for independent corners.
    pub neighbor_correlation: f64,
    /// Share of the corners that counts as independent because of it, 0 to 1.
    pub effective_share: f64,
    /// Distance from the highest to the lowest corner of the board's shape, mm.
    pub board_peak_to_valley_mm: f64,
    /// Its standard deviation, as far as the terms of the shape are independent, mm.
    pub board_peak_to_valley_sd_mm: f64,
    /// What boards that no fold learned from say to offsets and splines; `None` without these, without folds, and in
    /// files of earlier versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unseen: Option<ModelChoice>,
}

/// How the published procedure went.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct AlternatingRecord {
    /// Spread of the networks.
    pub spread: SpreadChoice,
    /// Starts tried; the one with the lowest cost was taken.
    pub starts: Vec<StartCost>,
    /// Circles of the stage per placement; empty without placements.
    pub circles: Vec<PlacementCircles>,
    /// Whether poses were projected onto the circles: only where that lowers the cost.
    pub projected: bool,
    /// Sweeps over rays and poses.
    pub sweeps: usize,
    /// Farthest that a control point moved in the last sweep, mm.
    pub last_step_mm: f64,
    /// Share by which the cost fell in the last tenth of the sweeps; `None` at rest.
    pub still_falling: Option<f64>,
    /// Per camera: RMS difference of the field from the rays of single pixels, px.
    pub field_rms_error_px: Vec<f64>,
}

/// Boards the estimate never saw, measured with the rig.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct HeldOutRecord {
    /// Number of folds; poses are dealt to folds in turn.
    pub folds: usize,
    /// Folds whose other poses gave no estimate; nothing is known of their boards.
    #[serde(default)]
    pub failed_folds: usize,
    /// Which, and why.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub fold_failures: Vec<FailedFold>,
    /// RMS residual vector of the held-out corners, board pose refitted, px.
    pub rms_px: Option<f64>,
    /// Median of the same.
    pub median_px: Option<f64>,
    /// RMS error of the distance between neighboring corners, percent of the square; stereo only.
    pub neighbor_rms_percent: Option<f64>,
    /// RMS distance of the triangulated corners from the best-placed board, mm; stereo only.
    pub rigid_rms_mm: Option<f64>,
    /// Triangulated corners behind the two figures above.
    pub point_count: usize,
    /// Held-out corners outside the calibrated area of their fold, for which nothing was measured.
    pub outside_count: usize,
    /// Residuals of the same corners, held-out and fitted, and whether the cameras agree; `None` in
    /// files of earlier versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub agreement: Option<Agreement>,
}
