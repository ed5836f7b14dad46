//! Whether corners of two cameras can belong together: the fundamental matrix as a check.
//!
//! Two cameras that keep their places see every point of every pose under one fundamental matrix.
//! Labels that are turned in one camera break this if the poses are tilted differently and lie in
//! different places: by pixels, where lens distortion leaves less. Boards that turn about a fixed
//! middle far away nearly fit after a half turn too (0.2 px for 110 mm at 300 mm). Used to decide
//! and to warn, never to estimate.

use calib_rays::geometry::PixelPoint;
use calib_rays::numerics::{SingularValues, median};
use nalgebra::{Matrix3, SMatrix, SVector, SymmetricEigen, Vector3};

/// The same corner in a first and a second camera.
pub type Match = (PixelPoint, PixelPoint);

/// `second^T F first = 0` for pixels of the same point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FundamentalMatrix(Matrix3<f64>);

/// Fewest matches for the linear estimate.
const MIN_MATCHES: usize = 8;

impl FundamentalMatrix {
    /// The normalized eight-point estimate (Hartley 1997); `None` with fewer than eight matches or
    /// if the pixels do not spread in both cameras.
    pub fn from_matches(matches: &[Match]) -> Option<Self> {
        if matches.len() < MIN_MATCHES {
            return None;
        }
        let first_norm = normalization(matches.iter().map(|m| m.0))?;
        let second_norm = normalization(matches.iter().map(|m| m.1))?;
        let mut normal = SMatrix::<f64, 9, 9>::zeros();
        for (first, second) in matches {
            let a = first_norm * homogeneous(*first);
            let b = second_norm * homogeneous(*second);
            let row = SVector::<f64, 9>::from_fn(|k, _| b[k / 3] * a[k % 3]);
            normal.ger(1.0, &row, &row, 1.0);
        }
        let eigen = SymmetricEigen::new(normal);
        let null = eigen.eigenvectors.column(eigen.eigenvalues.imin());
        let any_rank = Matrix3::from_fn(|r, c| null[3 * r + c]);
        let svd = SingularValues::new(any_rank)?;
        let third = svd.left().column(2) * svd.right.column(2).transpose();
        let rank_two = any_rank - third * svd.values[2];
        Some(Self(second_norm.transpose() * rank_two * first_norm))
    }

    /// Distance of a match from fulfilling the epipolar constraint, first order (Sampson), px.
    pub fn distance_px(&self, (first, second): &Match) -> f64 {
        let (a, b) = (homogeneous(*first), homogeneous(*second));
        let (line_in_second, line_in_first) = (self.0 * a, self.0.transpose() * b);
        let gradient = line_in_second.xy().norm_squared() + line_in_first.xy().norm_squared();
        b.dot(&line_in_second).abs() / gradient.sqrt().max(f64::MIN_POSITIVE)
    }

    /// Median distance of the matches, px; `None` without matches.
    pub fn median_distance_px(&self, matches: &[Match]) -> Option<f64> {
        median(matches.iter().map(|m| self.distance_px(m)))
    }
}

fn homogeneous(pixel: PixelPoint) -> Vector3<f64> {
    Vector3::new(pixel.u, pixel.v, 1.0)
}

/// Moves the mean to the origin and scales the RMS distance from it to the square root of two.
fn normalization(pixels: impl Iterator<Item = PixelPoint> + Clone) -> Option<Matrix3<f64>> {
    let count = pixels.clone().count() as f64;
    let sum = pixels
        .clone()
        .fold((0.0, 0.0), |s, p| (s.0 + p.u, s.1 + p.v));
    let mean = PixelPoint::new(sum.0 / count, sum.1 / count);
    let spread: f64 = pixels.map(|p| p.distance_px(mean).powi(2)).sum();
    let scale = (2.0 * count / spread).sqrt();
    (scale.is_finite()).then(|| {
        Matrix3::new(
            scale,
            0.0,
            -scale * mean.u,
            0.0,
            scale,
            -scale * mean.v,
            0.0,
            0.0,
            1.0,
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use calib_rays::geometry::so3;

    /// Matches of a 6 x 9 board in poses tilted to and fro, 30 cm away, cameras 8 cm apart.
    fn matches(half_turned_in_second: bool) -> Vec<Match> {
        let mut all = Vec::new();
        for pose in 0..4 {
            let tilt = 0.5 * f64::from(pose) - 0.7;
            let rotation = so3::exp(&Vector3::new(tilt, 0.6 * tilt * tilt, 0.1));
            for (r, c) in (0..6).flat_map(|r| (0..9).map(move |c| (r, c))) {
                let seen = |r: i32, c: i32, baseline_mm: f64| {
                    let on_board =
                        Vector3::new(f64::from(c) * 25.0 - 100.0, f64::from(r) * 25.0 - 62.0, 0.0);
                    let p = rotation * on_board
                        + Vector3::new(60.0 * tilt - baseline_mm, 0.0, 300.0 + 80.0 * tilt);
                    PixelPoint::new(320.0 + 530.0 * p.x / p.z, 240.0 + 530.0 * p.y / p.z)
                };
                let (r2, c2) = if half_turned_in_second {
                    (5 - r, 8 - c)
                } else {
                    (r, c)
                };
                all.push((seen(r, c, 0.0), seen(r2, c2, 83.0)));
            }
        }
        all
    }

    #[test]
    fn true_matches_fit_to_round_off_and_turned_labels_do_not() {
        let straight = matches(false);
        let f = FundamentalMatrix::from_matches(&straight).unwrap();
        assert!(f.median_distance_px(&straight).unwrap() < 1e-6);
        let turned = matches(true);
        let f = FundamentalMatrix::from_matches(&turned).unwrap();
        let median_px = f.median_distance_px(&turned).unwrap();
        assert!(median_px > 1.0, "{median_px}");
    }

    #[test]
    fn too_few_or_coinciding_matches_give_none() {
        assert_eq!(FundamentalMatrix::from_matches(&matches(false)[..7]), None);
        let one_place = vec![(PixelPoint::new(1.0, 1.0), PixelPoint::new(2.0, 2.0)); 20];
        assert_eq!(FundamentalMatrix::from_matches(&one_place), None);
    }
}
