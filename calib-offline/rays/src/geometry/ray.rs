//! A line in space with a sense: what a pixel sees.

use super::RigidTransform;
use nalgebra::Vector3;

/// The points `origin_mm + lambda * direction`, lambda > 0 in front of the camera.
///
/// The direction need not have unit length. Which point of the line is the origin is written down
/// by whoever makes the ray: for a ray field it is the foot point of the camera's reference point,
/// so that `lambda > 0` means "in front".
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ray {
    /// A point on the line, mm.
    pub origin_mm: Vector3<f64>,
    /// From the camera into the scene; not zero, any length.
    pub direction: Vector3<f64>,
}

impl Ray {
    /// The same ray in frame a.
    pub fn transformed(&self, a_from_b: &RigidTransform) -> Self {
        Self {
            origin_mm: a_from_b.point(&self.origin_mm),
            direction: a_from_b.direction(&self.direction),
        }
    }

    /// The point of the ray nearest to `point_mm` (its foot point), mm.
    pub fn foot_point(&self, point_mm: &Vector3<f64>) -> Vector3<f64> {
        let lambda =
            (point_mm - self.origin_mm).dot(&self.direction) / self.direction.norm_squared();
        self.origin_mm + self.direction * lambda
    }

    /// Distance of a point from the line, mm.
    pub fn distance_mm(&self, point_mm: &Vector3<f64>) -> f64 {
        (point_mm - self.foot_point(point_mm)).norm()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distance_to_the_z_axis_is_the_hypotenuse() {
        let ray = Ray {
            origin_mm: Vector3::new(0.0, 0.0, 5.0),
            direction: Vector3::new(0.0, 0.0, 2.0),
        };
        let point = Vector3::new(3.0, 4.0, -7.0);
        assert_eq!(ray.foot_point(&point), Vector3::new(0.0, 0.0, -7.0));
        assert!((ray.distance_mm(&point) - 5.0).abs() < 1e-15);
    }
}
