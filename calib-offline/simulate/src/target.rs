//! The ring-marker target before the rig: where it stands and where its centers are seen.
//!
//! 9 x 7 black rings on white, 12 mm apart; 5 of them are larger and tell the target's direction
//! ([`super::pattern`] has the numbers). Target frame: origin at the center of the marker in row 0,
//! column 0, x along the columns, y along the rows, z away from the printed face.

use super::pattern::{RING_COLS, RING_PITCH_MM, RING_ROWS, is_direction_marker};
use super::scene::Scene;
use calib_rays::geometry::{PixelPoint, RigidTransform, so3};
use nalgebra::Vector3;

/// Distances of the target as shares of the working distance.
const DISTANCES: [f64; 7] = [0.92, 0.95, 0.98, 1.0, 1.02, 1.05, 1.08];

/// A marker that all cameras see.
#[derive(Debug, Clone, PartialEq)]
pub struct SeenMarker {
    /// `63 pose + 9 row + col`.
    pub id: usize,
    /// Which of [`target_poses`].
    pub pose: usize,
    /// Row on the target.
    pub row: usize,
    /// Column on the target.
    pub col: usize,
    /// Whether it is one of the larger ones.
    pub is_direction: bool,
    /// Its center, left camera frame, mm.
    pub point_in_left: Vector3<f64>,
    /// The pixel that sees the center, per camera. (The middle of the ring's image lies elsewhere,
    /// by the perspective.)
    pub true_pixels: Vec<PixelPoint>,
}

/// `left_from_target` at seven distances about the working distance, each turned a little.
pub fn target_poses(scene: &Scene) -> Vec<RigidTransform> {
    let left_from_bench = scene.rig.bench_from_camera[0].inverse();
    let middle = Vector3::new(
        (RING_COLS - 1) as f64 * RING_PITCH_MM / 2.0,
        (RING_ROWS - 1) as f64 * RING_PITCH_MM / 2.0,
        0.0,
    );
    DISTANCES
        .iter()
        .enumerate()
        .map(|(k, share)| {
            let k = k as f64;
            let rotation = so3::exp(&Vector3::new(
                0.12 * (1.7 * k).sin(),
                0.25 * (2.3 * k + 0.5).sin(),
                0.08 * (1.1 * k).cos(),
            ));
            let bench_middle = Vector3::new(
                8.0 * (1.3 * k).cos(),
                6.0 * (0.9 * k).sin(),
                scene.rig.distance_mm * share,
            );
            left_from_bench * RigidTransform::new(rotation, bench_middle - rotation * middle)
        })
        .collect()
}

/// The markers whose centers every camera sees.
pub fn seen_markers(scene: &Scene, left_from_targets: &[RigidTransform]) -> Vec<SeenMarker> {
    let mut markers = Vec::new();
    for (pose, left_from_target) in left_from_targets.iter().enumerate() {
        for row in 0..RING_ROWS {
            for col in 0..RING_COLS {
                let center =
                    Vector3::new(col as f64 * RING_PITCH_MM, row as f64 * RING_PITCH_MM, 0.0);
                let pixels: Option<Vec<PixelPoint>> = (0..scene.cameras.len())
                    .map(|camera_idx| {
                        scene.project_board_point(camera_idx, left_from_target, &center)
                    })
                    .collect();
                if let Some(true_pixels) = pixels {
                    markers.push(SeenMarker {
                        id: (pose * RING_ROWS + row) * RING_COLS + col,
                        pose,
                        row,
                        col,
                        is_direction: is_direction_marker(row, col),
                        point_in_left: left_from_target.point(&center),
                        true_pixels,
                    });
                }
            }
        }
    }
    markers
}
