//! The perspective map of a square from its four corners.

use nalgebra::{Matrix3, Vector2};

/// A perspective map from the unit square to pixels.
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

    /// The pixel of a point of the square's plane; not finite on the horizon, and meaningless beyond.
    pub fn at(&self, x: f64, y: f64) -> Vector2<f64> {
        let image = self.0 * nalgebra::Vector3::new(x, y, 1.0);
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
