//! How points scatter about their centroid: whether they lie on a line, in a plane, or in neither.

use super::RigidTransform;
use nalgebra::{Matrix3, Vector3};

/// Points closer to one line than this share of their extent lie on it.
const LINE: f64 = 1e-3;
/// Points whose scatter across their best plane is above this share of their extent are no flat target: a single
/// view of them tells a camera's focal length and its distance apart.
const SOLID: f64 = 0.05;

/// Principal axes of a set of points.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scatter {
    /// Mean, mm.
    pub centroid: Vector3<f64>,
    /// RMS along each principal axis, mm, rising.
    pub across_mm: [f64; 3],
    /// The best plane's two axes, then its normal, as columns; right-handed.
    pub axes: Matrix3<f64>,
}

impl Scatter {
    /// Of points, mm; zero without points.
    pub fn of(points: &[Vector3<f64>]) -> Self {
        let count = points.len().max(1) as f64;
        let centroid = points.iter().sum::<Vector3<f64>>() / count;
        let scatter: Matrix3<f64> = points
            .iter()
            .map(|p| (p - centroid) * (p - centroid).transpose() / count)
            .sum();
        let eigen = scatter.symmetric_eigen();
        let mut order = [0, 1, 2];
        order.sort_by(|a, b| eigen.eigenvalues[*a].total_cmp(&eigen.eigenvalues[*b]));
        let axis = |k: usize| eigen.eigenvectors.column(order[k]).into_owned();
        let (x, y) = (axis(2), axis(1));
        Self {
            centroid,
            across_mm: order.map(|k| eigen.eigenvalues[k].max(0.0).sqrt()),
            axes: Matrix3::from_columns(&[x, y, x.cross(&y)]),
        }
    }

    /// Whether the points lie on a line, or in one spot.
    pub fn is_line(&self) -> bool {
        !(self.across_mm[1] > LINE * self.across_mm[2])
    }

    /// Whether the points lie in no plane, far beyond what bends a flat target.
    pub fn is_solid(&self) -> bool {
        self.across_mm[0] > SOLID * self.across_mm[2]
    }

    /// From the points' frame to one in which their best plane is z = 0.
    pub fn plane_from_points(&self) -> RigidTransform {
        let rotation = self.axes.transpose();
        RigidTransform::new(rotation, -(rotation * self.centroid))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_planes_and_solids_are_told_apart() {
        let grid = |depth: f64| -> Vec<Vector3<f64>> {
            (0..18)
                .map(|k| [k % 3, k / 3 % 3, k / 9].map(f64::from))
                .map(|[x, y, z]| Vector3::new(10.0 * x + 5.0 * y, 10.0 * y, depth * z + 3.0 * x))
                .collect()
        };
        let flat = Scatter::of(&grid(0.0));
        assert!(!flat.is_line() && !flat.is_solid());
        let highest = grid(0.0)
            .iter()
            .map(|p| flat.plane_from_points().point(p).z.abs())
            .fold(0.0, f64::max);
        assert!(highest < 1e-9);
        assert!(Scatter::of(&grid(8.0)).is_solid());
        let line: Vec<_> = (0..5).map(|k| Vector3::repeat(f64::from(k))).collect();
        assert!(Scatter::of(&line).is_line());
        assert!(Scatter::of(&[]).is_line());
    }
}
