//! How far an image's corners really scatter: what no smooth map of the board takes up.
//!
//! A fit predicts its corner's error from its own residuals, as if they were independent. In
//! photographs they are not: compression and color interpolation correlate neighboring pixels, print
//! and glare bend edges. What a camera and a flat or slowly bent board do to a grid is smooth, though:
//! a homography, and a polynomial of the place in its image for the lens and the bend. What is left over
//! is the corners' own scatter, and what of it no fit predicted is the error of its model.

use super::corner_fit::FittedCorner;
use super::homography::Homography;
use calib_rays::numerics::median;
use nalgebra::{DMatrix, DVector, Matrix3, Vector2, Vector3};
use std::collections::BTreeMap;

/// Degrees of the polynomial; the one that leaves least per degree of freedom counts.
const DEGREES: std::ops::RangeInclusive<i32> = 2..=6;
/// Part of the numbers that must remain over the unknowns.
const MIN_FREE_PART: f64 = 0.4;
/// Below so many degrees of freedom the scatter is known worse than to a fifth.
const MIN_FREE: f64 = 24.0;
/// More scatter than this is the lens, squares.
const MAX_SCATTER_SQUARES: f64 = 0.01;
/// Corners farther out than this many medians of the residuals are single failures, not scatter.
const OUTLIER_MEDIANS: f64 = 5.0;
/// A grid's own model error is clearly larger than its camera's beyond this factor.
const CLEARLY_LARGER: f64 = 3.0;
/// Gauss-Newton's steps: the polynomial is small beside the homography.
const STEPS: usize = 4;

/// Standard deviation per axis that the corners have beyond what their fits predict, px; `None` if too
/// few are there to tell.
pub fn model_error_px(corners: &BTreeMap<(i32, i32), FittedCorner>, square_px: f64) -> Option<f64> {
    let points: Vec<Scattered> = corners
        .iter()
        .map(|(&(i, j), c)| Scattered {
            place: Vector2::new(f64::from(i), f64::from(j)),
            pixel: Vector2::new(c.pixel.u, c.pixel.v),
            sigma_px: c.sigma_px,
        })
        .collect();
    beyond_predicted_px(&points, square_px)
}

/// A point of a flat target.
#[derive(Debug, Clone, Copy)]
pub struct Scattered {
    /// Its place on the target.
    pub place: Vector2<f64>,
    /// Where it was found, px.
    pub pixel: Vector2<f64>,
    /// Standard deviation per axis that its fit predicts, px.
    pub sigma_px: f64,
}

/// As [`model_error_px`], of the points of any flat target; `step_px` from one to the next.
pub fn beyond_predicted_px(points: &[Scattered], step_px: f64) -> Option<f64> {
    let predicted = points.iter().map(|point| point.sigma_px.powi(2));
    let mean_predicted = predicted.sum::<f64>() / points.len() as f64;
    let smooth = Smooth::of(points)?;
    let degrees = DEGREES.filter_map(|degree| smooth.variance_beyond(degree));
    let variance = degrees.min_by(f64::total_cmp)?;
    if variance.sqrt() > MAX_SCATTER_SQUARES * step_px {
        return None;
    }
    Some((variance - mean_predicted).max(0.0).sqrt())
}

/// Gives the grids of one camera one model error (px), the root of their mean square: weighting images of one
/// lens and board by what each tells of its own raises the held-out error of `opencv-stereo` from 0.34 %
/// to 0.39 % of the square, because the boards that tilt most, of which least is smooth, say most of the
/// lens. Only a grid that is worse by far (glare, motion) keeps its own; one that is too small to tell
/// gets the camera's.
pub fn pool<'a>(grids: impl Iterator<Item = &'a mut Option<f64>>) {
    let grids: Vec<&mut Option<f64>> = grids.collect();
    let own = || grids.iter().filter_map(|grid| **grid);
    let Some(median_px) = median(own()) else {
        return;
    };
    let is_usual = |px: &f64| *px <= CLEARLY_LARGER * median_px;
    let usual: Vec<f64> = own().filter(is_usual).collect();
    let mean_square = usual.iter().map(|px| px * px).sum::<f64>() / usual.len() as f64;
    for grid in grids {
        let own_px = grid.filter(|px| !is_usual(px));
        *grid = Some(own_px.unwrap_or(mean_square.sqrt()));
    }
}

/// Corners, scaled for the fit.
struct Smooth {
    /// Places on the board and in the image, both within -1 and 1.
    corners: Vec<(Vector2<f64>, Vector2<f64>)>,
    px_per_unit: f64,
    start: Matrix3<f64>,
}

impl Smooth {
    fn of(points: &[Scattered]) -> Option<Self> {
        let board: Vec<Vector2<f64>> = points.iter().map(|point| point.place).collect();
        let image: Vec<Vector2<f64>> = points.iter().map(|point| point.pixel).collect();
        let (board, _) = scaled(&board)?;
        let (image, px_per_unit) = scaled(&image)?;
        let corners: Vec<_> = board.into_iter().zip(image).collect();
        // Points around the origin: its image is in front, and the last element positive.
        let start = Homography::fit(&corners)?.matrix();
        let start = start / start[(2, 2)];
        Some(Self {
            corners,
            px_per_unit,
            start,
        })
    }

    /// Variance per axis that a polynomial of this degree leaves, px^2; `None` if it leaves too few
    /// degrees of freedom.
    fn variance_beyond(&self, degree: i32) -> Option<f64> {
        let exponents: Vec<(i32, i32)> = (0..=degree)
            .flat_map(|a| (0..=degree - a).map(move |b| (a, b)))
            .filter(|(a, b)| a + b >= 2)
            .collect();
        let numbers = 2 * self.corners.len();
        let unknowns = 8 + 2 * exponents.len();
        let free = numbers.checked_sub(unknowns)? as f64;
        if free < MIN_FREE || free < MIN_FREE_PART * numbers as f64 {
            return None;
        }
        let mut map = self.start;
        let mut residuals = DVector::zeros(numbers);
        for _ in 0..STEPS {
            let mut design = DMatrix::zeros(numbers, unknowns);
            let mut right = DVector::zeros(numbers);
            for (k, (board, image)) in self.corners.iter().enumerate() {
                let at = Vector3::new(board.x, board.y, 1.0);
                let image_at = map * at;
                let ideal = image_at.xy() / image_at.z;
                for axis in 0..2 {
                    let row = 2 * k + axis;
                    right[row] = image[axis] - ideal[axis];
                    for c in 0..3 {
                        design[(row, 3 * axis + c)] = at[c] / image_at.z;
                        if c < 2 {
                            design[(row, 6 + c)] = -ideal[axis] * at[c] / image_at.z;
                        }
                    }
                    for (m, &(a, b)) in exponents.iter().enumerate() {
                        let column = 8 + axis * exponents.len() + m;
                        design[(row, column)] = ideal.x.powi(a) * ideal.y.powi(b);
                    }
                }
            }
            let mut normal = design.tr_mul(&design);
            // Grids of few rows do not tell all powers apart.
            let ridge = 1e-10 * normal.diagonal().amax();
            for k in 0..unknowns {
                normal[(k, k)] += ridge;
            }
            let step = normal.cholesky()?.solve(&design.tr_mul(&right));
            residuals = right - design * &step;
            for k in 0..8 {
                map[(k / 3, k % 3)] += step[k];
            }
        }
        let distances = residuals.iter().map(|r| r.abs());
        let limit = OUTLIER_MEDIANS * median(distances)?;
        let kept: Vec<f64> = residuals
            .iter()
            .copied()
            .filter(|r| r.abs() <= limit)
            .collect();
        let left_out = (numbers - kept.len()) as f64;
        let sum: f64 = kept.iter().map(|r| r * r).sum();
        let variance = sum / (free - left_out).max(1.0) * self.px_per_unit.powi(2);
        variance.is_finite().then_some(variance)
    }
}

/// Points moved and scaled into -1 to 1, and how long a unit was; `None` if they are one point.
fn scaled(points: &[Vector2<f64>]) -> Option<(Vec<Vector2<f64>>, f64)> {
    let middle = points.iter().sum::<Vector2<f64>>() / points.len() as f64;
    let reach = points
        .iter()
        .map(|p| (p - middle).amax())
        .fold(0.0, f64::max);
    let unit = |p: &Vector2<f64>| (p - middle) / reach;
    (reach > 0.0).then(|| (points.iter().map(unit).collect(), reach))
}

#[cfg(test)]
mod tests {
    use super::*;
    use calib_rays::geometry::PixelPoint;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    /// A tilted board through a lens with barrel distortion, its corners off by `sigma_px`.
    fn corners(
        rows: i32,
        cols: i32,
        sigma_px: f64,
        predicted_px: f64,
    ) -> BTreeMap<(i32, i32), FittedCorner> {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let mut noise = || -> f64 {
            let n: f64 = StandardNormal.sample(&mut rng);
            n * sigma_px
        };
        let nodes = (0..cols).flat_map(|i| (0..rows).map(move |j| (i, j)));
        nodes
            .map(|(i, j)| {
                let (x, y) = (f64::from(i) - 4.2, f64::from(j) - 2.1);
                let w = 10.0 + 0.35 * x - 0.2 * y;
                let (x, y) = (x / w, y / w);
                let lens = 1.0 - 0.3 * (x * x + y * y);
                let (u, v) = (320.0 + 500.0 * lens * x, 240.0 + 500.0 * lens * y);
                let corner = FittedCorner {
                    pixel: PixelPoint::new(u + noise(), v + noise()),
                    sigma_px: predicted_px,
                    amplitude: 100.0,
                    mean: 120.0,
                    blur_px: 0.7,
                    lens_blur_px: 0.6,
                    residual_rms: 1.0,
                    moved_px: 0.0,
                };
                ((i, j), corner)
            })
            .collect()
    }

    #[test]
    fn scatter_is_what_the_lens_and_the_pose_do_not_explain() {
        for (sigma_px, predicted_px, expected_px) in
            [(0.1, 0.0, 0.1), (0.1, 0.08, 0.06), (0.004, 0.0, 0.004)]
        {
            let found = model_error_px(&corners(6, 9, sigma_px, predicted_px), 50.0).unwrap();
            // Half of 108 numbers are free, in the least of five fits: 10 %, and as much downwards; of
            // a difference of variances, about twice that.
            assert!(
                (found / expected_px - 1.0).abs() < 0.3,
                "{found} {expected_px}"
            );
        }
    }

    #[test]
    fn one_corner_elsewhere_is_no_scatter_and_few_corners_tell_nothing() {
        let mut off = corners(6, 9, 0.05, 0.0);
        off.get_mut(&(4, 3)).unwrap().pixel.u += 3.0;
        let found = model_error_px(&off, 50.0).unwrap();
        assert!(found < 0.5, "{found}");
        assert_eq!(model_error_px(&corners(3, 4, 0.05, 0.0), 50.0), None);
    }
}
