//! The public types as those of `nalgebra`, for applications that compute on with it.
//!
//! A point or a direction alone needs none of this: `nalgebra` makes its own from `[f32; 3]`. Of a matrix
//! it takes the columns first, where here rows stand first.

use crate::{PointCovariance, Ray, RigFromCamera, Triangulation};
use nalgebra::{IsometryMatrix3, Matrix3, Point3, Rotation3, Translation3, Vector3};

impl Ray {
    /// The point of the ray nearest to its camera's reference point, mm, rig frame.
    pub fn origin(&self) -> Point3<f32> {
        self.origin_mm.into()
    }

    /// From the camera into the scene, rig frame, not normalized.
    pub fn direction_vector(&self) -> Vector3<f32> {
        self.direction.into()
    }
}

impl Triangulation {
    /// The point, mm, rig frame.
    pub fn point(&self) -> Point3<f32> {
        self.point_mm.into()
    }
}

impl RigFromCamera {
    /// The rotation, orthonormal to f32 round-off.
    pub fn rotation_matrix(&self) -> Rotation3<f32> {
        Rotation3::from_matrix_unchecked(matrix(&self.rotation))
    }
}

impl From<RigFromCamera> for IsometryMatrix3<f32> {
    fn from(pose: RigFromCamera) -> Self {
        Self::from_parts(
            Translation3::from(pose.translation_mm),
            pose.rotation_matrix(),
        )
    }
}

impl PointCovariance {
    /// [`total_mm2`](Self::total_mm2) as a matrix.
    pub fn total_matrix_mm2(&self) -> Matrix3<f32> {
        matrix(&self.total_mm2())
    }
}

fn matrix(rows: &[[f32; 3]; 3]) -> Matrix3<f32> {
    Matrix3::from_row_slice(rows.as_flattened())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_stay_rows() {
        // x to y, y to z, z to x.
        let pose = RigFromCamera {
            rotation: [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
            translation_mm: [10.0, 20.0, 30.0],
        };
        let moved = IsometryMatrix3::from(pose) * Point3::new(1.0, 2.0, 3.0);
        assert_eq!(moved, Point3::new(13.0, 21.0, 32.0));
    }
}
