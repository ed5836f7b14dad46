//! Matched pixels with known points: what a calibration is judged by.

use super::preset;
use super::random::{self, Purpose};
use super::scene::Scene;
use super::stage;
use calib_rays::geometry::hull::{convex_hull, hull_contains};
use calib_rays::geometry::{PixelPoint, RigidTransform, triangulate_rays};
use nalgebra::Vector3;

/// Which points to measure.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MatchSet {
    /// Random points inside the volume that the board swept.
    Points,
    /// Corners of a (flat) board at poses that the calibration never sees.
    Holdout,
}

/// One point, where it is and how every camera sees it.
#[derive(Debug, Clone, PartialEq)]
pub struct TrueMatch {
    /// From 0, in order.
    pub id: usize,
    /// For [`MatchSet::Holdout`]: number of the held-out board, row and column.
    pub label: Option<(usize, usize, usize)>,
    /// The point in the rig (left camera) frame, mm.
    pub point_in_left: Vector3<f64>,
    /// The point in the datum frame (the board at the first pose), mm.
    pub point_in_datum: Vector3<f64>,
    /// Per camera, without noise.
    pub true_pixels: Vec<PixelPoint>,
    /// Per camera, with noise.
    pub pixels: Vec<PixelPoint>,
    /// Where the *true* rays of the noisy pixels meet, datum frame, mm: the best that any
    /// calibration can do with these pixels.
    pub oracle_in_datum: Vector3<f64>,
}

impl Scene {
    /// `count` matches whose pixels are covered by the calibration's corners in every camera:
    /// inside the outline of the corners of at least one view.
    ///
    /// Fewer come back if the covered volume is too small to find them.
    pub fn matches(&self, set: MatchSet, count: usize) -> Vec<TrueMatch> {
        let outlines = self.outlines();
        let is_covered = |pixels: &[PixelPoint]| {
            pixels
                .iter()
                .zip(&outlines)
                .all(|(pixel, views)| views.iter().any(|outline| hull_contains(outline, *pixel)))
        };
        let candidates: Box<dyn Iterator<Item = Candidate>> = match set {
            MatchSet::Points => Box::new(self.volume_points(50 * count + 1000)),
            MatchSet::Holdout => Box::new(self.holdout_corners(count)),
        };
        let mut matches = Vec::new();
        for candidate in candidates {
            if matches.len() == count {
                break;
            }
            let Some(true_pixels) = self.see(&candidate) else {
                continue;
            };
            if !is_covered(&true_pixels) {
                continue;
            }
            if let Some(found) = self.with_noise(set, matches.len(), &candidate, true_pixels) {
                matches.push(found);
            }
        }
        matches
    }

    /// Hull of the visible corners, per camera and pose.
    fn outlines(&self) -> Vec<Vec<Vec<PixelPoint>>> {
        let board = &self.settings.board;
        (0..self.cameras.len())
            .map(|camera_idx| {
                (0..self.true_poses.len())
                    .map(|pose| {
                        let corners = (0..board.rows)
                            .flat_map(|row| (0..board.cols).map(move |col| (row, col)))
                            .filter_map(|(row, col)| self.true_corner(camera_idx, pose, row, col))
                            .collect();
                        convex_hull(corners)
                    })
                    .collect()
            })
            .collect()
    }

    fn see(&self, candidate: &Candidate) -> Option<Vec<PixelPoint>> {
        (0..self.cameras.len())
            .map(|camera_idx| match &candidate.board {
                Some((left_from_board, point_in_board)) => {
                    self.project_board_point(camera_idx, left_from_board, point_in_board)
                }
                None => self.true_project(camera_idx, &candidate.point_in_left),
            })
            .collect()
    }

    fn with_noise(
        &self,
        set: MatchSet,
        id: usize,
        candidate: &Candidate,
        true_pixels: Vec<PixelPoint>,
    ) -> Option<TrueMatch> {
        let mut rng = random::stream(self.settings.seed, Purpose::MatchNoise, set as usize, id);
        let sigma_px = self.settings.match_noise_px;
        let pixels: Vec<PixelPoint> = true_pixels
            .iter()
            .map(|pixel| {
                PixelPoint::new(
                    pixel.u + sigma_px * random::normal(&mut rng),
                    pixel.v + sigma_px * random::normal(&mut rng),
                )
            })
            .collect();
        let rays = pixels
            .iter()
            .enumerate()
            .map(|(camera_idx, pixel)| self.true_ray_in_left(camera_idx, *pixel))
            .collect::<Option<Vec<_>>>()?;
        let oracle_in_left = triangulate_rays(&rays).ok()?.point_mm;
        let datum_from_left = self.datum_from_left();
        Some(TrueMatch {
            id,
            label: candidate.label,
            point_in_left: candidate.point_in_left,
            point_in_datum: datum_from_left.point(&candidate.point_in_left),
            true_pixels,
            pixels,
            oracle_in_datum: datum_from_left.point(&oracle_in_left),
        })
    }

    /// From the rig (left camera) frame to the board frame of the first pose.
    pub fn datum_from_left(&self) -> RigidTransform {
        // A scene has at least one pose.
        self.true_poses
            .first()
            .map_or_else(RigidTransform::identity, RigidTransform::inverse)
    }

    /// Points between the same place of the board at two poses.
    fn volume_points(&self, count: usize) -> impl Iterator<Item = Candidate> + '_ {
        let mut rng = random::stream(self.settings.seed, Purpose::Points, 0, 0);
        let (width_mm, height_mm) = self.settings.board.extent_mm();
        let pose_count = self.true_poses.len();
        (0..count).map(move |_| {
            let mut pose = || {
                let idx = random::uniform(&mut rng) * pose_count as f64;
                self.true_poses[(idx as usize).min(pose_count - 1)]
            };
            let (from, to) = (pose(), pose());
            let place = Vector3::new(
                random::between(&mut rng, 0.0, width_mm),
                random::between(&mut rng, 0.0, height_mm),
                0.0,
            );
            let point_in_left = from
                .point(&place)
                .lerp(&to.point(&place), random::uniform(&mut rng));
            Candidate {
                point_in_left,
                board: None,
                label: None,
            }
        })
    }

    /// Corners of boards at new placements and new angles, a random tenth of each board.
    fn holdout_corners(&self, count: usize) -> impl Iterator<Item = Candidate> + '_ {
        let settings = &self.settings;
        let low = settings.angles_deg.iter().copied().fold(f64::MAX, f64::min);
        let high = settings.angles_deg.iter().copied().fold(f64::MIN, f64::max);
        let left_from_bench = self.rig.bench_from_camera[0].inverse();
        (0..20 + count).flat_map(move |number| {
            let mut rng = random::stream(settings.seed, Purpose::Holdout, 0, number);
            let spread = if settings.placements > 1 { 0.9 } else { 0.1 };
            let fraction = [
                random::between(&mut rng, -spread, spread),
                random::between(&mut rng, -spread, spread),
                random::between(&mut rng, -0.05, 0.05) * spread,
            ];
            let placement = preset::placement(&self.rig, fraction, number);
            let angle_deg = random::between(&mut rng, low, high);
            let bench_from_board = stage::bench_from_board(
                &placement,
                &self.rig.mount,
                &settings.board,
                angle_deg,
                &RigidTransform::identity(),
            );
            let left_from_board = left_from_bench * bench_from_board;
            let mut candidates = Vec::new();
            for row in 0..settings.board.rows {
                for col in 0..settings.board.cols {
                    if random::uniform(&mut rng) < 0.1 {
                        let corner = settings.board.corner_in_board(row, col);
                        candidates.push(Candidate {
                            point_in_left: left_from_board.point(&corner),
                            board: Some((left_from_board, corner)),
                            label: Some((number, row, col)),
                        });
                    }
                }
            }
            candidates
        })
    }
}

struct Candidate {
    point_in_left: Vector3<f64>,
    /// The board it lies on, if it is printed on one: then the face must be seen.
    board: Option<(RigidTransform, Vector3<f64>)>,
    label: Option<(usize, usize, usize)>,
}
