//! The smooth map from the target's grid to the image: a homography and a low polynomial.
//!
//! Grid coordinates: (column, row) as real numbers, one unit per pitch. The homography carries the
//! perspective, the polynomial what the lens adds; neither has a meaning beyond this image.

use crate::detect::homography::Homography;
use calib_rays::numerics::SingularValues;
use nalgebra::{DMatrix, Matrix2, Matrix3, Vector2};

/// Fewest markers that are mapped; four would fix a homography and leave nothing to check it by.
pub const MIN_POINTS: usize = 8;
/// Degrees of the polynomial, and how many markers each takes: two for a coefficient, at least.
const DEGREES: [(usize, usize); 5] = [(2, 15), (3, 25), (4, 38), (5, 50), (6, 60)];
/// Singular values below this part of the largest count as zero: markers in few rows or columns
/// leave some terms open.
const RANK_TOLERANCE: f64 = 1e-6;

/// A map from grid coordinates to pixels.
#[derive(Debug, Clone)]
pub struct LocalMap {
    middle: Vector2<f64>,
    /// Normalized grid coordinates are `(grid - middle) * scale`.
    scale: f64,
    /// Normalized pixels are `(px - px_middle) * px_scale`.
    px_middle: Vector2<f64>,
    px_scale: f64,
    /// Between the normalized coordinates.
    homography: Matrix3<f64>,
    degree: usize,
    /// Of each term of [`terms`], added to the normalized pixel. The terms are those of the
    /// homography's image, as a lens distorts what a perspective has made.
    coefficients: Vec<Vector2<f64>>,
}

impl LocalMap {
    /// The map through pairs of grid coordinates and pixels, in the least squares sense.
    ///
    /// `None` with fewer than [`MIN_POINTS`], or if they lie on a line.
    pub fn fit(pairs: &[(Vector2<f64>, Vector2<f64>)]) -> Option<Self> {
        if pairs.len() < MIN_POINTS {
            return None;
        }
        let (grid_middle, grid_scale) = frame(pairs.iter().map(|p| p.0))?;
        let (px_middle, px_scale) = frame(pairs.iter().map(|p| p.1))?;
        let normalized: Vec<_> = pairs
            .iter()
            .map(|(grid, px)| {
                (
                    (grid - grid_middle) * grid_scale,
                    (px - px_middle) * px_scale,
                )
            })
            .collect();
        let homography = Homography::fit(&normalized)?.matrix();
        let mut map = Self {
            middle: grid_middle,
            scale: grid_scale,
            px_middle,
            px_scale,
            homography,
            degree: 0,
            coefficients: Vec::new(),
        };
        let ideal: Vec<Vector2<f64>> = normalized.iter().map(|p| map.ideal(&p.0)).collect();
        let bent: Vec<Vector2<f64>> = normalized
            .iter()
            .zip(&ideal)
            .map(|((_, px), ideal)| px - ideal)
            .collect();
        // Too low a degree leaves out what the lens does, too high a one bends wildly at the border:
        // the one that predicts best each marker from the others.
        let best = DEGREES
            .iter()
            .filter(|(_, need)| pairs.len() >= *need)
            .filter_map(|&(degree, _)| Polynomial::fit(&ideal, &bent, degree))
            .min_by(|a, b| a.left_out_error.total_cmp(&b.left_out_error));
        if let Some(polynomial) = best {
            map.degree = polynomial.degree;
            map.coefficients = polynomial.coefficients;
        }
        Some(map)
    }

    /// The homography of a normalized grid point.
    fn ideal(&self, normalized: &Vector2<f64>) -> Vector2<f64> {
        let image = self.homography * normalized.push(1.0);
        image.xy() / image.z
    }

    /// The pixel of a grid point. Not finite on the homography's horizon.
    pub fn at(&self, grid: &Vector2<f64>) -> Vector2<f64> {
        let ideal = self.ideal(&((grid - self.middle) * self.scale));
        let terms = terms(&ideal, self.degree);
        let bent: Vector2<f64> = terms
            .iter()
            .zip(&self.coefficients)
            .map(|(term, coefficient)| coefficient * *term)
            .sum();
        self.px_middle + (ideal + bent) / self.px_scale
    }

    /// Derivative of the pixel by the grid coordinates, px per pitch: columns by column and row.
    pub fn derivative(&self, grid: &Vector2<f64>) -> Matrix2<f64> {
        // Central differences: the map bends by 1e-2 of itself per pitch at most, which leaves
        // 1e-8 of it.
        let step = 1e-3;
        let along = |direction: Vector2<f64>| {
            (self.at(&(grid + direction * step)) - self.at(&(grid - direction * step)))
                / (2.0 * step)
        };
        Matrix2::from_columns(&[along(Vector2::x()), along(Vector2::y())])
    }
}

/// A polynomial through values at points.
struct Polynomial {
    degree: usize,
    coefficients: Vec<Vector2<f64>>,
    /// Sum of the squared errors with which each value is predicted from all others.
    left_out_error: f64,
}

impl Polynomial {
    fn fit(points: &[Vector2<f64>], values: &[Vector2<f64>], degree: usize) -> Option<Self> {
        let rows: Vec<Vec<f64>> = points.iter().map(|p| terms(p, degree)).collect();
        let matrix = DMatrix::from_fn(rows.len(), rows.first()?.len(), |i, k| rows[i][k]);
        let right = DMatrix::from_fn(values.len(), 2, |i, axis| values[i][axis]);
        let svd = SingularValues::new(matrix.clone())?;
        let solution = svd.solve(right.clone(), RANK_TOLERANCE);
        let residuals = right - matrix * &solution;
        let (basis, rank) = (svd.left(), svd.rank(RANK_TOLERANCE));
        // Left out, a value is missed by its residual over one less its leverage.
        let left_out_error = (0..values.len())
            .map(|i| {
                let leverage = basis.row(i).columns(0, rank).norm_squared();
                residuals.row(i).norm_squared() / (1.0 - leverage).max(1e-9).powi(2)
            })
            .sum();
        Some(Self {
            degree,
            coefficients: (0..solution.nrows())
                .map(|k| Vector2::new(solution[(k, 0)], solution[(k, 1)]))
                .collect(),
            left_out_error,
        })
    }
}

/// Middle and inverse RMS radius of points; `None` if they are one point.
fn frame(points: impl Iterator<Item = Vector2<f64>> + Clone) -> Option<(Vector2<f64>, f64)> {
    let count = points.clone().count() as f64;
    let middle = points.clone().sum::<Vector2<f64>>() / count;
    let square = points.map(|p| (p - middle).norm_squared()).sum::<f64>() / count;
    (square > 0.0 && square.is_finite()).then(|| (middle, 1.0 / square.sqrt()))
}

/// All products of powers of x and y up to the degree; none for degree 0.
fn terms(p: &Vector2<f64>, degree: usize) -> Vec<f64> {
    if degree == 0 {
        return Vec::new();
    }
    let mut terms = Vec::with_capacity((degree + 1) * (degree + 2) / 2);
    for total in 0..=degree as i32 {
        for k in 0..=total {
            terms.push(p.x.powi(total - k) * p.y.powi(k));
        }
    }
    terms
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid(cols: usize, rows: usize) -> Vec<Vector2<f64>> {
        (0..rows * cols)
            .map(|k| Vector2::new((k % cols) as f64, (k / cols) as f64))
            .collect()
    }

    fn tilted(g: &Vector2<f64>) -> Vector2<f64> {
        let z = 1.0 + 0.03 * g.x - 0.02 * g.y;
        Vector2::new(
            (50.0 * g.x + 5.0 * g.y) / z + 300.0,
            (48.0 * g.y - 3.0 * g.x) / z + 200.0,
        )
    }

    #[test]
    fn a_homography_is_found_to_round_off_even_from_few_points() {
        for (cols, rows) in [(4, 2), (9, 7)] {
            let pairs: Vec<_> = grid(cols, rows).iter().map(|g| (*g, tilted(g))).collect();
            let map = LocalMap::fit(&pairs).unwrap();
            for g in grid(11, 8) {
                assert!((map.at(&g) - tilted(&g)).norm() < 1e-6, "{g}");
            }
        }
    }

    #[test]
    fn a_bent_image_is_followed_by_the_polynomial() {
        let bent = |g: &Vector2<f64>| {
            let p = tilted(g);
            let from_middle = p - Vector2::new(500.0, 350.0);
            p + from_middle * (-4e-7 * from_middle.norm_squared())
        };
        let pairs: Vec<_> = grid(9, 7).iter().map(|g| (*g, bent(g))).collect();
        let map = LocalMap::fit(&pairs).unwrap();
        for (g, px) in &pairs {
            assert!((map.at(g) - px).norm() < 0.05);
        }
        let derivative = map.derivative(&Vector2::new(4.0, 3.0));
        let by_difference = (bent(&Vector2::new(4.001, 3.0)) - bent(&Vector2::new(4.0, 3.0))) * 1e3;
        assert!((derivative.column(0) - by_difference).norm() < 0.05);
    }

    /// Four rows leave three of the 21 terms of degree 5 open. With nalgebra 0.35's decomposition,
    /// this fit missed a bend that its terms contain by 1.6 % of the bend.
    #[test]
    fn a_bend_seen_in_few_rows_is_fitted_to_round_off() {
        let (cols, rows, turn) = (19, 4, 0.085);
        let step = 2.0 / cols as f64;
        let points: Vec<Vector2<f64>> = grid(cols, rows)
            .iter()
            .map(|g| {
                let p = (g - Vector2::new(9.0, 1.5)) * step;
                Vector2::new(p.x + turn * p.y, p.y - turn * p.x)
            })
            .collect();
        let bend: Vec<Vector2<f64>> = points.iter().map(|p| p * p.norm_squared()).collect();
        let found = Polynomial::fit(&points, &bend, 5).unwrap();
        for (p, bend) in points.iter().zip(&bend) {
            let terms = terms(p, 5);
            let fitted: Vector2<f64> = terms
                .iter()
                .zip(&found.coefficients)
                .map(|(t, c)| c * *t)
                .sum();
            // Round-off of 18 values that count, in a fit to bends up to 1.
            assert!((fitted - bend).norm() < 18.0 * 18.0 * f64::EPSILON, "{p}");
        }
    }

    #[test]
    fn points_on_a_line_and_too_few_have_no_map() {
        let line: Vec<_> = grid(9, 1).iter().map(|g| (*g, tilted(g))).collect();
        assert!(LocalMap::fit(&line).is_none());
        let few: Vec<_> = grid(3, 2).iter().map(|g| (*g, tilted(g))).collect();
        assert!(LocalMap::fit(&few).is_none());
        let same = vec![(Vector2::zeros(), Vector2::zeros()); 12];
        assert!(LocalMap::fit(&same).is_none());
    }
}
