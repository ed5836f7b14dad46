//! Rigid transforms between two named frames.

use super::so3;
use nalgebra::{Matrix2x3, Matrix2x6, Matrix3, Vector3, Vector6};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// `point_in_a = rotation * point_in_b + translation_mm`; a variable of this type is named
/// `a_from_b`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct RigidTransform {
    /// Proper orthonormal; column k is axis k of frame b seen in frame a. Row by row in files; nine numbers, column by
    /// column, in those of earlier versions.
    #[serde(with = "rows")]
    #[schemars(with = "[[f64; 3]; 3]")]
    pub rotation: Matrix3<f64>,
    /// Origin of frame b seen in frame a, mm.
    #[schemars(with = "[f64; 3]")]
    pub translation_mm: Vector3<f64>,
}

impl RigidTransform {
    /// The transform that changes nothing.
    pub fn identity() -> Self {
        Self::new(Matrix3::identity(), Vector3::zeros())
    }

    /// From a rotation and a translation, mm.
    pub fn new(rotation: Matrix3<f64>, translation_mm: Vector3<f64>) -> Self {
        Self {
            rotation,
            translation_mm,
        }
    }

    /// The point in frame a, mm.
    pub fn point(&self, point_in_b: &Vector3<f64>) -> Vector3<f64> {
        self.rotation * point_in_b + self.translation_mm
    }

    /// The direction in frame a.
    pub fn direction(&self, direction_in_b: &Vector3<f64>) -> Vector3<f64> {
        self.rotation * direction_in_b
    }

    /// `b_from_a`.
    pub fn inverse(&self) -> Self {
        let rotation = self.rotation.transpose();
        Self::new(rotation, -(rotation * self.translation_mm))
    }

    /// The update `R <- Exp(phi) R, t <- t + tau`: rotation vector rad, translation mm.
    ///
    /// The translation is not turned by `phi`, which keeps the two apart in the normal equations.
    pub fn perturbed(&self, phi_rad: &Vector3<f64>, tau_mm: &Vector3<f64>) -> Self {
        Self::new(
            so3::exp(phi_rad) * self.rotation,
            self.translation_mm + tau_mm,
        )
    }

    /// [`Self::perturbed`] by rotation vector and translation in one.
    pub fn stepped(&self, change: &Vector6<f64>) -> Self {
        let [a, b, c, x, y, z] = (*change).into();
        self.perturbed(&Vector3::new(a, b, c), &Vector3::new(x, y, z))
    }

    /// The derivative by the change of [`Self::stepped`] of what has the derivative `by_point` by a
    /// point in frame a, mm; `turned` is that point without the translation.
    #[inline]
    pub fn by_step(by_point: &Matrix2x3<f64>, turned: &Vector3<f64>) -> Matrix2x6<f64> {
        let by_turn = -by_point * so3::skew(turned);
        Matrix2x6::from_fn(|axis, k| match k {
            0..3 => by_turn[(axis, k)],
            _ => by_point[(axis, k - 3)],
        })
    }

    /// The same transform with its rotation made orthonormal to round-off.
    pub fn orthonormalized(&self) -> Self {
        Self::new(
            so3::nearest_rotation(&self.rotation).unwrap_or(self.rotation),
            self.translation_mm,
        )
    }
}

/// A rotation in a file.
mod rows {
    use nalgebra::Matrix3;
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    #[derive(Deserialize)]
    #[serde(
        untagged,
        expecting = "a rotation is three rows of three numbers, [[..], [..], [..]]"
    )]
    enum Written {
        Rows([[f64; 3]; 3]),
        ColumnByColumn([f64; 9]),
    }

    pub(super) fn serialize<S: Serializer>(
        rotation: &Matrix3<f64>,
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        let rows: [[f64; 3]; 3] = rotation.transpose().into();
        rows.serialize(serializer)
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(
        deserializer: D,
    ) -> Result<Matrix3<f64>, D::Error> {
        Ok(match Written::deserialize(deserializer)? {
            Written::Rows(rows) => Matrix3::from(rows).transpose(),
            Written::ColumnByColumn(numbers) => Matrix3::from_column_slice(&numbers),
        })
    }
}

impl std::ops::Mul for RigidTransform {
    type Output = RigidTransform;

    /// `a_from_b * b_from_c = a_from_c`.
    fn mul(self, rhs: RigidTransform) -> RigidTransform {
        RigidTransform::new(
            self.rotation * rhs.rotation,
            self.rotation * rhs.translation_mm + self.translation_mm,
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn products_chain_and_inverses_cancel() {
        let a_from_b = RigidTransform::new(
            so3::exp(&Vector3::new(0.1, 0.7, -0.3)),
            Vector3::new(1.0, 2.0, 3.0),
        );
        let b_from_c = RigidTransform::new(
            so3::exp(&Vector3::new(-0.4, 0.2, 0.9)),
            Vector3::new(-5.0, 0.5, 2.0),
        );
        let point_in_c = Vector3::new(3.0, -1.0, 0.25);
        let chained = (a_from_b * b_from_c).point(&point_in_c);
        let stepwise = a_from_b.point(&b_from_c.point(&point_in_c));
        assert!((chained - stepwise).norm() < 1e-14);
        let back = a_from_b.inverse().point(&a_from_b.point(&point_in_c));
        assert!((back - point_in_c).norm() < 1e-14);
    }
}
