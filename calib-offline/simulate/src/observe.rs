//! What a corner detector would report of a scene: noise, gaps and mistakes included.

use super::random::{self, Purpose};
use super::scene::Scene;
use calib_rays::geometry::PixelPoint;
use calib_rays::observed::{Corner, View};
use rand_distr::{ChiSquared, Distribution};

impl Scene {
    /// Every visible corner with noise, some missing, some wrong.
    ///
    /// Views in the order camera, pose; corners in the order row, column. A view without corners
    /// is left out.
    pub fn observe_corners(&self) -> Vec<View> {
        let mut views = Vec::new();
        for camera_idx in 0..self.cameras.len() {
            for pose in 0..self.true_poses.len() {
                let left_from_board = self.exposed_pose(camera_idx, pose);
                let corners = self.observe_view(camera_idx, pose, |row, col| {
                    let corner = self.corner_in_board(row, col);
                    self.project_board_point(camera_idx, &left_from_board, &corner)
                });
                if !corners.is_empty() {
                    views.push(View {
                        camera_idx,
                        pose,
                        corners,
                    });
                }
            }
        }
        views
    }

    /// The corners of a view whose clean pixels are given, with the scene's noise and mistakes.
    pub(super) fn observe_view(
        &self,
        camera_idx: usize,
        pose: usize,
        clean: impl Fn(usize, usize) -> Option<PixelPoint>,
    ) -> Vec<Corner> {
        let settings = &self.settings;
        let board = &settings.board;
        let noise = self.noise_px(camera_idx, pose);
        let mut missing_rng = random::stream(settings.seed, Purpose::Missing, camera_idx, pose);
        let mut outlier_rng = random::stream(settings.seed, Purpose::Outliers, camera_idx, pose);
        let sensor = self.cameras[camera_idx].sensor();
        let is_flipped = settings.flipped_views.contains(&(camera_idx, pose));
        let mut corners = Vec::new();
        for row in 0..board.rows {
            for col in 0..board.cols {
                // Drawn for every corner, seen or not: what one corner gets depends on no other.
                let is_missing = random::uniform(&mut missing_rng) < settings.missing_share;
                let is_outlier = random::uniform(&mut outlier_rng) < settings.outlier_share;
                let outlier_px = random::between(&mut outlier_rng, 3.0, 10.0);
                let outlier_angle = random::between(&mut outlier_rng, 0.0, std::f64::consts::TAU);
                let Some(clean) = clean(row, col) else {
                    continue;
                };
                let [du, dv] = noise[row * board.cols + col];
                let mut pixel = PixelPoint::new(clean.u + du, clean.v + dv);
                if is_outlier {
                    pixel.u += outlier_px * outlier_angle.cos();
                    pixel.v += outlier_px * outlier_angle.sin();
                }
                if is_missing || !sensor.contains(pixel) {
                    continue;
                }
                let (row, col) = if is_flipped {
                    board.half_turned(row, col)
                } else {
                    (row, col)
                };
                corners.push(Corner {
                    row,
                    col,
                    pixel,
                    sigma_px: None,
                });
            }
        }
        corners.sort_by_key(|corner| (corner.row, corner.col));
        corners
    }

    /// Noise of every corner of a view, row by row.
    pub(super) fn noise_px(&self, camera_idx: usize, pose: usize) -> Vec<[f64; 2]> {
        let settings = &self.settings;
        let (rows, cols) = (settings.board.rows, settings.board.cols);
        let mut rng = random::stream(settings.seed, Purpose::Noise, camera_idx, pose);
        let mut noise: Vec<[f64; 2]> = (0..rows * cols)
            .map(|_| [random::normal(&mut rng), random::normal(&mut rng)])
            .collect();
        // First-order recursion along both directions keeps the variance at one and gives
        // neighbors the correlation asked for.
        let rho = settings.noise_correlation;
        let fresh = (1.0 - rho * rho).sqrt();
        let follow = |noise: &mut Vec<[f64; 2]>, from: usize, to: usize| {
            let before = noise[from];
            for (here, before) in noise[to].iter_mut().zip(before) {
                *here = rho * before + fresh * *here;
            }
        };
        for row in 0..rows {
            for col in 1..cols {
                follow(&mut noise, row * cols + col - 1, row * cols + col);
            }
        }
        for row in 1..rows {
            for col in 0..cols {
                follow(&mut noise, (row - 1) * cols + col, row * cols + col);
            }
        }
        let mut tail_rng = random::stream(settings.seed, Purpose::NoiseTail, camera_idx, pose);
        let chi_squared = settings
            .noise_tail
            .and_then(|nu| Some((nu, ChiSquared::new(nu).ok()?)));
        for corner in &mut noise {
            let scale = match &chi_squared {
                // Student-t of unit variance, both components with the same factor.
                Some((nu, chi)) => ((nu - 2.0) / chi.sample(&mut tail_rng)).sqrt(),
                None => 1.0,
            };
            *corner = corner.map(|value| value * scale * settings.noise_px);
        }
        noise
    }
}
