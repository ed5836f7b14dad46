//! Normal equations with an arrow's shape: what all views share in one block, each pose in a 6 x 6
//! block of its own that knows the others through the shared block only.

use nalgebra::{DMatrix, DVector, Matrix6, Vector6};

/// The equations `H step = -gradient` of a weighted sum of squares and its value.
#[derive(Debug, Clone)]
pub struct Arrowhead {
    /// Shared block of H.
    pub shared: DMatrix<f64>,
    /// Gradient by what is shared (half of it, as H is).
    pub shared_gradient: DVector<f64>,
    /// One per pose.
    pub poses: Vec<PoseBlock>,
}

/// What belongs to one pose.
#[derive(Debug, Clone)]
pub struct PoseBlock {
    /// Its diagonal block.
    pub own: Matrix6<f64>,
    /// Its gradient.
    pub gradient: Vector6<f64>,
    /// Rows: shared parameters; columns: the pose's.
    pub cross: DMatrix<f64>,
}

/// A step and what it promises.
#[derive(Debug, Clone)]
pub struct Step {
    /// Of the shared parameters.
    pub shared: DVector<f64>,
    /// Of each pose, in the order of [`crate::geometry::RigidTransform::perturbed`].
    pub poses: Vec<Vector6<f64>>,
    /// By how much the quadratic model of the sum of squares falls.
    pub promised: f64,
}

/// The shared equations with the poses eliminated.
struct Reduced {
    shared: DMatrix<f64>,
    right: DVector<f64>,
    /// Inverses of the pose blocks.
    pose_inverses: Vec<Matrix6<f64>>,
}

impl Arrowhead {
    /// Zeros.
    pub fn new(shared_count: usize, pose_count: usize) -> Self {
        let pose = PoseBlock {
            own: Matrix6::zeros(),
            gradient: Vector6::zeros(),
            cross: DMatrix::zeros(shared_count, 6),
        };
        Self {
            shared: DMatrix::zeros(shared_count, shared_count),
            shared_gradient: DVector::zeros(shared_count),
            poses: vec![pose; pose_count],
        }
    }

    /// The step with the diagonal of H enlarged by the factor `1 + damping`. `None` if the equations
    /// are singular even so.
    pub fn step(&self, damping: f64) -> Option<Step> {
        let Reduced {
            shared: reduced,
            right,
            pose_inverses,
        } = self.reduce(damping)?;
        let shared = if reduced.is_empty() {
            right
        } else {
            reduced.cholesky()?.solve(&right)
        };
        let mut promised = 0.0;
        let mut model = |step: f64, gradient: f64, diagonal: f64| {
            // -(2 g s + s H s) with H s = -g - damping D s.
            promised -= step * gradient - damping * diagonal * step * step;
        };
        for (k, step) in shared.iter().enumerate() {
            model(*step, self.shared_gradient[k], self.shared[(k, k)]);
        }
        let mut poses = Vec::with_capacity(self.poses.len());
        for (block, inverse) in self.poses.iter().zip(&pose_inverses) {
            let step = -(inverse * (block.gradient + block.cross.tr_mul(&shared)));
            for k in 0..6 {
                model(step[k], block.gradient[k], block.own[(k, k)]);
            }
            poses.push(step);
        }
        promised.is_finite().then_some(Step {
            shared,
            poses,
            promised,
        })
    }

    /// Covariance of the shared parameters for residuals of unit variance, the poses being free.
    /// `None` if the data do not determine them.
    pub fn shared_covariance(&self) -> Option<DMatrix<f64>> {
        let reduced = self.reduce(0.0)?.shared;
        // Scaled to a diagonal of ones, so that what is left of a pivot is a share.
        let scale = reduced.diagonal().map(|d| 1.0 / d.sqrt());
        if !scale.iter().all(|s| s.is_finite()) {
            return None;
        }
        let scale = DMatrix::from_diagonal(&scale);
        let inverse = (&scale * reduced * &scale).cholesky()?.inverse();
        Some(&scale * inverse * &scale)
    }

    /// Eliminates the poses, the diagonal of H enlarged by the factor `1 + damping`.
    fn reduce(&self, damping: f64) -> Option<Reduced> {
        let mut reduced = self.shared.clone();
        for k in 0..reduced.nrows() {
            reduced[(k, k)] *= 1.0 + damping;
        }
        let mut right = -&self.shared_gradient;
        let mut inverses = Vec::with_capacity(self.poses.len());
        for block in &self.poses {
            let mut own = block.own;
            for k in 0..6 {
                own[(k, k)] *= 1.0 + damping;
            }
            let inverse = own.cholesky()?.inverse();
            let product = &block.cross * inverse;
            reduced.gemm(-1.0, &product, &block.cross.transpose(), 1.0);
            right.gemv(1.0, &product, &block.gradient, 1.0);
            inverses.push(inverse);
        }
        Some(Reduced {
            shared: reduced,
            right,
            pose_inverses: inverses,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// Equations of a random Jacobian with two poses, and the same as one full matrix.
    fn example() -> (Arrowhead, DMatrix<f64>, DVector<f64>) {
        let (shared_count, pose_count) = (3, 2);
        let mut arrow = Arrowhead::new(shared_count, pose_count);
        let n = shared_count + 6 * pose_count;
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let (mut full, mut gradient) = (DMatrix::zeros(n, n), DVector::zeros(n));
        for pose in 0..pose_count {
            let jacobian =
                DMatrix::from_fn(20, shared_count + 6, |_, _| rng.random_range(-1.0..1.0));
            let residual = DVector::from_fn(20, |_, _| rng.random_range(-1.0..1.0));
            let normal = jacobian.tr_mul(&jacobian);
            let right = jacobian.tr_mul(&residual);
            let place = |k: usize| {
                if k < shared_count { k } else { k + 6 * pose }
            };
            for r in 0..shared_count + 6 {
                gradient[place(r)] += right[r];
                for c in 0..shared_count + 6 {
                    full[(place(r), place(c))] += normal[(r, c)];
                }
            }
            arrow.shared += normal.view((0, 0), (3, 3));
            arrow.shared_gradient += right.rows(0, 3);
            let block = &mut arrow.poses[pose];
            block.own += normal.fixed_view::<6, 6>(3, 3);
            block.gradient += right.fixed_rows::<6>(3);
            block.cross += normal.view((0, 3), (3, 6));
        }
        (arrow, full, gradient)
    }

    #[test]
    fn elimination_solves_the_full_equations() {
        let (arrow, full, gradient) = example();
        for damping in [0.0, 0.3] {
            let mut damped = full.clone();
            for k in 0..damped.nrows() {
                damped[(k, k)] *= 1.0 + damping;
            }
            let expected = damped.cholesky().unwrap().solve(&-&gradient);
            let step = arrow.step(damping).unwrap();
            let found: Vec<f64> = step
                .shared
                .iter()
                .chain(step.poses.iter().flatten())
                .copied()
                .collect();
            assert!((DVector::from_vec(found) - &expected).norm() < 1e-11 * expected.norm());
            let promised = -(2.0 * gradient.dot(&expected) + expected.dot(&(&full * &expected)));
            assert!((step.promised - promised).abs() < 1e-11 * promised);
        }
    }

    #[test]
    fn covariance_is_the_block_of_the_full_inverse() {
        let (arrow, full, _) = example();
        let inverse = full.try_inverse().unwrap();
        let expected = inverse.view((0, 0), (3, 3));
        let found = arrow.shared_covariance().unwrap();
        assert!((found - expected).norm() < 1e-11 * expected.norm());
    }

    #[test]
    fn what_the_data_leave_open_has_no_covariance() {
        let (mut arrow, ..) = example();
        arrow.shared.row_mut(1).fill(0.0);
        arrow.shared.column_mut(1).fill(0.0);
        for block in &mut arrow.poses {
            block.cross.row_mut(1).fill(0.0);
        }
        assert!(arrow.shared_covariance().is_none());
        assert!(arrow.step(0.0).is_none());
    }
}
