//! Why the middle of a ring's image is not the image of its middle, and by how much.
//!
//! A circle of radius r around x is seen as the curve `M(x + r (cos t, sin t))`, M being the map from
//! the target to the image. To second order it is an ellipse whose middle lies off `M(x)` by
//! something of the size of `r^2 M'' / 4`: under perspective the near half is seen larger. At a tilt
//! of 45 degrees, a distance of 400 mm and a focal length of 1500 px that is 0.1 px for
//! r = 5 mm, many times what noise does to a fitted center. M is known well enough from the
//! markers themselves ([`super::local_map`]), although these are off by as much: neighbors
//! are off alike, and what is left enters the correction only by its second derivatives.
//!
//! Here the ellipse is fitted to the curve by the distance along its normals, each piece weighted by
//! its length, because that is how the blurred edge in the image is fitted ([`super::ring_fit`]).
//! No power series is cut off, so a fisheye's curve counts as it is.

use super::local_map::LocalMap;
use super::ring_fit::shape_of_circle;
use super::ring_model::EdgeOffsets;
use nalgebra::{Matrix2, SMatrix, SVector, Vector2};
use std::f64::consts::TAU;

/// Points of the circle's image; an ellipse has five unknowns, and its curve is smooth.
const POINTS: usize = 24;
/// Newton steps; each squares what is left.
const ROUNDS: usize = 3;

/// The offsets of both edges of a ring at `grid`; radii in pitches, the inner one 0 of a disk. `None` if the map is not
/// regular there.
pub fn edge_offsets(
    map: &LocalMap,
    grid: &Vector2<f64>,
    outer_radius: f64,
    inner_radius: f64,
) -> Option<EdgeOffsets> {
    Some(EdgeOffsets {
        outer: middle_offset(map, grid, outer_radius)?,
        inner: if inner_radius > 0.0 {
            middle_offset(map, grid, inner_radius)?
        } else {
            Vector2::zeros()
        },
    })
}

/// From the image of a circle's center to the middle of the ellipse that its image is, px.
fn middle_offset(map: &LocalMap, grid: &Vector2<f64>, radius: f64) -> Option<Vector2<f64>> {
    let curve: Vec<Vector2<f64>> = (0..POINTS)
        .map(|k| {
            let angle = TAU * k as f64 / POINTS as f64;
            map.at(&(grid + Vector2::new(angle.cos(), angle.sin()) * radius))
        })
        .collect();
    let center = map.at(grid);
    let mut middle = center;
    let mut shape = shape_of_circle(&map.derivative(grid), radius);
    for _ in 0..ROUNDS {
        let step = ellipse_step(&curve, &middle, &shape)?;
        middle += step.fixed_rows::<2>(0);
        shape += Matrix2::new(step[2], step[3], step[3], step[4]);
    }
    let offset = middle - center;
    (offset.x.is_finite() && offset.y.is_finite()).then_some(offset)
}

/// One step towards the ellipse with the least distances from a closed curve: of its middle, and
/// of its shape (uu, uv, vv).
fn ellipse_step(
    curve: &[Vector2<f64>],
    middle: &Vector2<f64>,
    shape: &Matrix2<f64>,
) -> Option<SVector<f64, 5>> {
    let inverse = shape.try_inverse()?;
    let mut normal = SMatrix::<f64, 5, 5>::zeros();
    let mut right = SVector::<f64, 5>::zeros();
    for (k, point) in curve.iter().enumerate() {
        let before = curve[(k + curve.len() - 1) % curve.len()];
        let after = curve[(k + 1) % curve.len()];
        let length = (after - before).norm();
        let w = inverse * (point - middle);
        let radius = w.norm();
        let gradient = inverse.transpose() * w / radius;
        let n = gradient.normalize();
        let on_circle = w / radius;
        let distance = (radius - 1.0) / gradient.norm();
        let row = SVector::<f64, 5>::from([
            n.x,
            n.y,
            n.x * on_circle.x,
            n.x * on_circle.y + n.y * on_circle.x,
            n.y * on_circle.y,
        ]);
        normal.ger(length, &row, &row, 1.0);
        right.axpy(length * distance, &row, 1.0);
    }
    Some(normal.cholesky()?.solve(&right))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A target 400 mm away, turned about the image's vertical, 12 mm of pitch, 1500 px focal length.
    fn tilted(tilt_rad: f64, g: &Vector2<f64>) -> Vector2<f64> {
        let (x, y) = (12.0 * (g.x - 4.0), 12.0 * (g.y - 3.0));
        let z = 400.0 + x * tilt_rad.sin();
        Vector2::new(1500.0 * x * tilt_rad.cos() / z, 1500.0 * y / z)
    }

    fn map(tilt_rad: f64) -> LocalMap {
        let pairs: Vec<_> = (0..63)
            .map(|k| Vector2::new(f64::from(k % 9), f64::from(k / 9)))
            .map(|g| (g, tilted(tilt_rad, &g)))
            .collect();
        LocalMap::fit(&pairs).unwrap()
    }

    #[test]
    fn a_tilted_circle_in_the_middle_agrees_with_the_exact_ellipse() {
        // Seen at x = +-r c / (d +- r s): the ellipse ends there along u, so its middle lies at
        // -f r^2 c s / (d^2 - r^2 s^2).
        let tilt = 0.7_f64;
        let offsets =
            edge_offsets(&map(tilt), &Vector2::new(4.0, 3.0), 5.0 / 12.0, 2.5 / 12.0).unwrap();
        let exact = |r: f64| {
            let (s, c) = tilt.sin_cos();
            -1500.0 * r * r * c * s / (400.0 * 400.0 - (r * s).powi(2))
        };
        assert!((offsets.outer.x - exact(5.0)).abs() < 1e-6, "{offsets:?}");
        assert!((offsets.inner.x - exact(2.5)).abs() < 1e-6);
        assert!(exact(5.0) < -0.1, "worth correcting");
        assert!(offsets.outer.y.abs() < 1e-6);
    }

    #[test]
    fn a_circle_seen_straight_on_has_no_offset() {
        let offsets = edge_offsets(&map(0.0), &Vector2::new(1.0, 5.0), 0.4, 0.2).unwrap();
        assert!(offsets.outer.norm() < 1e-6 && offsets.inner.norm() < 1e-6);
    }
}
