//! Perspective maps of a plane: of a square from its four corners, of many points by least squares.

use nalgebra::{Matrix3, SMatrix, SVector, Vector2, Vector3};

/// A perspective map from a plane to pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Homography(Matrix3<f64>);

impl Homography {
    /// The map that takes (0, 0), (1, 0), (1, 1) and (0, 1) to four pixels, in this order; `None` if
    /// they are no convex quadrilateral.
    ///
    /// The closed form for a square: with `d1 = p1 - p2`, `d2 = p3 - p2`, `s = p0 - p1 + p2 - p3`, the last
    /// row is (g, h, 1) with `g d1 + h d2 = s`.
    pub fn of_unit_square(p: [Vector2<f64>; 4]) -> Option<Self> {
        let (d1, d2) = (p[1] - p[2], p[3] - p[2]);
        let s = p[0] - p[1] + p[2] - p[3];
        let determinant = d1.perp(&d2);
        let (g, h) = (s.perp(&d2) / determinant, d1.perp(&s) / determinant);
        // The third coordinate at the corners; one sign, or the horizon crosses the square.
        let in_front = [1.0, 1.0 + g, 1.0 + g + h, 1.0 + h];
        if !in_front.iter().all(|z| *z > 1e-3) {
            return None;
        }
        let (x, y) = (p[1] * (1.0 + g) - p[0], p[3] * (1.0 + h) - p[0]);
        Some(Self(Matrix3::new(
            x.x, y.x, p[0].x, x.y, y.y, p[0].y, g, h, 1.0,
        )))
    }

    /// The map between point pairs of size 1 about the origin that solves the linear equations best: the direction in
    /// which they are least different from zero (the direct linear transform; Hartley 1997). `None` if they lie on a
    /// line, or on both sides of the horizon.
    pub fn fit(pairs: &[(Vector2<f64>, Vector2<f64>)]) -> Option<Self> {
        let mut normal = SMatrix::<f64, 9, 9>::zeros();
        for (from, to) in pairs {
            let p = from.push(1.0);
            for (axis, value) in [(0, to.x), (1, to.y)] {
                let mut row = SVector::<f64, 9>::zeros();
                row.fixed_rows_mut::<3>(3 * axis).copy_from(&p);
                row.fixed_rows_mut::<3>(6).copy_from(&(-value * p));
                normal.ger(1.0, &row, &row, 1.0);
            }
        }
        let eigen = normal.symmetric_eigen();
        let mut order: Vec<usize> = (0..9).collect();
        order.sort_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]));
        let (least, next) = (*order.first()?, *order.get(1)?);
        // Points on a line leave a second direction open.
        if eigen.eigenvalues[next] < 1e-9 * eigen.eigenvalues.max() {
            return None;
        }
        let h = eigen.eigenvectors.column(least);
        let row = |k: usize| Vector3::new(h[3 * k], h[3 * k + 1], h[3 * k + 2]).transpose();
        let matrix = Matrix3::from_rows(&[row(0), row(1), row(2)]);
        // All points are in front of the camera: one sign of the third coordinate.
        let signs = pairs
            .iter()
            .map(|(from, _)| matrix.row(2).transpose().dot(&from.push(1.0)));
        let negative = signs.clone().filter(|z| *z < 0.0).count();
        let zero = signs.filter(|z| z.abs() < 1e-12).count();
        match negative {
            _ if zero > 0 => None,
            0 => Some(Self(matrix)),
            n if n == pairs.len() => Some(Self(-matrix)),
            _ => None,
        }
    }

    /// Takes (x, y, 1) to a multiple of (u, v, 1), positive for all points that it was made from.
    pub fn matrix(&self) -> Matrix3<f64> {
        self.0
    }

    /// The pixel of a point of the plane; not finite on the horizon, and meaningless beyond.
    pub fn at(&self, x: f64, y: f64) -> Vector2<f64> {
        let image = self.0 * Vector3::new(x, y, 1.0);
        image.xy() / image.z
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corners_go_where_they_should_and_the_middle_to_the_diagonals_crossing() {
        let p = [(10.0, 12.0), (50.0, 8.0), (44.0, 40.0), (14.0, 48.0)]
            .map(|(u, v)| Vector2::new(u, v));
        let map = Homography::of_unit_square(p).unwrap();
        for (k, (x, y)) in [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]
            .into_iter()
            .enumerate()
        {
            assert!((map.at(x, y) - p[k]).norm() < 1e-9);
        }
        let middle = map.at(0.5, 0.5);
        assert!((middle - p[0]).perp(&(p[2] - p[0])).abs() < 1e-9);
        assert!((middle - p[1]).perp(&(p[3] - p[1])).abs() < 1e-9);
        let bow_tie = [p[0], p[2], p[1], p[3]];
        assert!(Homography::of_unit_square(bow_tie).is_none());
    }
}
