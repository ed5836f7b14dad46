//! mrcal's `LENSMODEL_SPLINED_STEREOGRAPHIC`: a stereographic projection, moved by a spline.
//!
//! A place `u` ([`super::stereographic`]) has the pixel `f (u + d(u)) + c`. `d` is a B-spline of order 3 or 2 (mrcal's word for the
//! degree) with `Nx` x `Ny` knots, even in `u`, the same spacing both ways and the middle knot at `u = 0`; `fov_x_deg` is what they span
//! along x without half a cell (order 2) or a cell (order 3) on each side. Beyond that mrcal extrapolates, thousands of
//! pixels off at 150 degrees; here a place off the knots has no ray and no pixel.

use super::inverse::{followed, slope};
use super::{CameraModel, ImagePlane, central, stereographic};
use calib_rays::geometry::{PixelPoint, Ray};
use nalgebra::{Vector2, Vector3};

/// The degree of the spline.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Order {
    /// 2.
    Quadratic,
    /// 3.
    Cubic,
}

/// A splined stereographic projection.
#[derive(Debug, Clone, PartialEq)]
pub struct Splined {
    plane: ImagePlane,
    order: Order,
    knots: [usize; 2],
    /// Knots a unit of `u`.
    density: f64,
    /// Row by row.
    shifts: Vec<Vector2<f64>>,
}

impl Splined {
    /// From mrcal's configuration and its numbers behind the core: x and y of each knot, row by row. `None` if there are too
    /// few knots, or not two numbers for each, or the field of view is none.
    pub fn new(
        plane: ImagePlane,
        order: Order,
        knots: [usize; 2],
        fov_x_deg: f64,
        numbers: &[f64],
    ) -> Option<Self> {
        let (least, margin) = match order {
            Order::Quadratic => (3, 1),
            Order::Cubic => (4, 2),
        };
        let count = knots[0].checked_mul(knots[1])?.checked_mul(2)?;
        let is_whole = knots.iter().all(|n| *n >= least) && numbers.len() == count;
        if !(is_whole && fov_x_deg > 0.0 && fov_x_deg < 360.0) {
            return None;
        }
        let edge = 2.0 * (fov_x_deg.to_radians() / 4.0).tan();
        Some(Self {
            plane,
            order,
            knots,
            density: (knots[0] - 1 - margin) as f64 / (2.0 * edge),
            shifts: numbers
                .chunks_exact(2)
                .map(|pair| Vector2::new(pair[0], pair[1]))
                .collect(),
        })
    }

    /// First knot and weights of order 3 along an axis with so many knots; `None` off them.
    pub(crate) fn cubic_weights(u: f64, count: usize, density: f64) -> Option<(usize, [f64; 4])> {
        let last = (count - 1) as f64;
        let at = u * density + last / 2.0;
        if !(at >= 1.0 && at <= last - 1.0) {
            return None;
        }
        let first = (at as usize).min(count - 3);
        let x = at - first as f64;
        let (x2, y) = (x * x, 1.0 - x);
        let inner = |x: f64| (4.0 - 6.0 * x * x + 3.0 * x * x * x) / 6.0;
        Some((
            first - 1,
            [y * y * y / 6.0, inner(x), inner(y), x2 * x / 6.0],
        ))
    }

    /// First knot and weights along an axis; `None` off the knots.
    fn weights(&self, u: f64, count: usize) -> Option<(usize, [f64; 4])> {
        let at = u * self.density + (count - 1) as f64 / 2.0;
        let last = (count - 1) as f64;
        match self.order {
            Order::Cubic => Self::cubic_weights(u, count, self.density),
            Order::Quadratic => {
                if !(at >= 0.5 && at <= last - 0.5) {
                    return None;
                }
                let middle = ((at + 0.5) as usize).clamp(1, count - 2);
                let x = at - middle as f64;
                let (low, high) = (0.5 - x, 0.5 + x);
                Some((
                    middle - 1,
                    [low * low / 2.0, 0.75 - x * x, high * high / 2.0, 0.0],
                ))
            }
        }
    }

    fn moved(&self, u: &Vector2<f64>) -> Option<Vector2<f64>> {
        let (i, along_x) = self.weights(u.x, self.knots[0])?;
        let (j, along_y) = self.weights(u.y, self.knots[1])?;
        let mut sum = *u;
        for (row, weight_y) in along_y.iter().enumerate() {
            for (column, weight_x) in along_x.iter().enumerate() {
                let weight = weight_x * weight_y;
                if weight != 0.0 {
                    sum += self.shifts[(j + row) * self.knots[0] + i + column] * weight;
                }
            }
        }
        Some(sum)
    }
}

impl CameraModel for Splined {
    fn project(&self, point: &Vector3<f64>) -> Option<PixelPoint> {
        let u = stereographic::place(point)?;
        // At the edge of the knots there is no slope: it was not folded before.
        let slope = slope(&|at: &Vector2<f64>| self.moved(at), &u);
        if slope.is_some_and(|slope| !(slope.determinant() > 0.0)) {
            return None;
        }
        self.plane.pixel(&self.moved(&u)?)
    }

    fn ray(&self, pixel: PixelPoint) -> Option<Ray> {
        let place = self.plane.place(pixel);
        let u = followed(|at| self.moved(at), Vector2::zeros(), place)?;
        central(stereographic::direction(&u))
    }
}
