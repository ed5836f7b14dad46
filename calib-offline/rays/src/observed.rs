//! What was seen of a board: labelled corners, view by view.

use crate::geometry::{PixelPoint, RigidTransform};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;

/// Fewest poses of the board that determine a camera: with two, the focal length of a general
/// view is fixed only if nothing else is unknown.
pub const MIN_POSES: usize = 3;

/// One labelled corner in one image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Corner {
    /// Row of the board, from 0.
    pub row: usize,
    /// Column of the board, from 0.
    pub col: usize,
    /// Where it was seen.
    pub pixel: PixelPoint,
    /// Standard deviation per axis, px, if the detector gave one.
    pub sigma_px: Option<f64>,
}

/// The corners that one camera saw of one pose; at least one, in (row, col) order.
#[derive(Debug, Clone, PartialEq)]
pub struct View {
    /// Index of the camera, in the dataset's order.
    pub camera_idx: usize,
    /// The pose's number in the dataset (image order, or the `pose` column of `corners.csv`).
    /// Numbers need not be contiguous.
    pub pose: usize,
    /// The corners seen.
    pub corners: Vec<Corner>,
}

/// The distinct pose numbers among the views.
pub fn poses(views: &[View]) -> BTreeSet<usize> {
    views.iter().map(|view| view.pose).collect()
}

/// Where a target stood, known by other means than the cameras.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct KnownPose {
    /// In the rig's frame, which is that of all known poses.
    pub rig_from_board: RigidTransform,
    /// Standard deviation of each coordinate of the place of the target's origin, mm; 0 for an exact one.
    pub sigma_mm: f64,
    /// Standard deviation of the turn about each axis, rad; 0 for an exact one.
    pub sigma_rad: f64,
}
