//! Normal equations with an arrow's shape: what all views share in one block, each pose in a 6 x 6
//! block of its own that knows the others through the shared block only. Eliminating the poses leaves a
//! Schur complement; the work is linear in their number.

use super::cholesky::{BandedCholesky, gram};
use nalgebra::{Cholesky, Const, DMatrix, DVector, Matrix6, Vector6};

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

/// The shared equations with the poses eliminated: a Schur complement.
#[derive(Debug, Clone)]
pub struct PosesEliminated {
    /// What is left of the shared block, its lower triangle.
    pub shared: DMatrix<f64>,
    /// The right-hand side that goes with it.
    pub right: DVector<f64>,
    /// Factors of the pose blocks.
    pub factors: Vec<PoseFactor>,
}

/// The factorized block of a pose.
pub type PoseFactor = Cholesky<f64, Const<6>>;

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

    /// Eliminates the poses, the diagonal of H enlarged by the factor `1 + damping`. `None` if one of
    /// them is not determined.
    pub fn eliminate_poses(&self, damping: f64) -> Option<PosesEliminated> {
        let mut shared = damped(&self.shared, damping);
        let shared_count = shared.nrows();
        let mut right = -&self.shared_gradient;
        // With V = L L^T and Y = L^-1 W^T, the pose takes Y^T Y off the shared block.
        let mut y = DMatrix::zeros(shared_count, 6 * self.poses.len());
        let mut factors = Vec::with_capacity(self.poses.len());
        for (idx, pose) in self.poses.iter().enumerate() {
            let factor = damped_own(pose, damping).cholesky()?;
            let inverse = factor
                .l_dirty()
                .solve_lower_triangular(&Matrix6::identity())?;
            y.columns_mut(6 * idx, 6)
                .gemm(1.0, &pose.cross, &inverse.transpose(), 0.0);
            right += &pose.cross * factor.solve(&pose.gradient);
            factors.push(factor);
        }
        // Column-major y is its transpose in row-major storage.
        shared -= gram(y.as_slice(), &vec![0; shared_count]);
        Some(PosesEliminated {
            shared,
            right,
            factors,
        })
    }

    /// The steps of the poses that go with a step of what is shared.
    pub fn pose_steps(&self, factors: &[PoseFactor], shared: &DVector<f64>) -> Vec<Vector6<f64>> {
        self.poses
            .iter()
            .zip(factors)
            .map(|(pose, factor)| {
                let pulled = pose.cross.tr_mul(shared);
                factor.solve(&(-pose.gradient - pulled.fixed_rows::<6>(0)))
            })
            .collect()
    }

    /// The products of a step with the gradient, and with itself through the diagonal of H.
    pub fn along(&self, shared: &DVector<f64>, poses: &[Vector6<f64>]) -> (f64, f64) {
        let mut linear = self.shared_gradient.dot(shared);
        let mut diagonal: f64 = (0..shared.len())
            .map(|k| self.shared[(k, k)] * shared[k].powi(2))
            .sum();
        for (pose, step) in self.poses.iter().zip(poses) {
            linear += pose.gradient.dot(step);
            let squares = (0..6).map(|k| pose.own[(k, k)] * step[k].powi(2));
            diagonal += squares.sum::<f64>();
        }
        (linear, diagonal)
    }

    /// The step with the diagonal of H enlarged by the factor `1 + damping`. `None` if the equations
    /// are singular even so.
    pub fn step(&self, damping: f64) -> Option<Step> {
        let eliminated = self.eliminate_poses(damping)?;
        let mut shared = eliminated.right;
        BandedCholesky::of_dense(&eliminated.shared)?.solve_vector(&mut shared);
        let poses = self.pose_steps(&eliminated.factors, &shared);
        // The step solves `(H + mu D) x = -g`, so `-(2 g.x + x.H x) = -g.x + mu x.D x`.
        let (linear, diagonal) = self.along(&shared, &poses);
        let promised = -linear + damping * diagonal;
        promised.is_finite().then_some(Step {
            shared,
            poses,
            promised,
        })
    }

    /// Covariance of the shared parameters for residuals of unit variance, the poses being free.
    /// `None` if the data do not determine them.
    pub fn shared_covariance(&self) -> Option<DMatrix<f64>> {
        let reduced = self.eliminate_poses(0.0)?.shared;
        // Scaled to a diagonal of ones, so that what is left of a pivot is a share.
        let scale = reduced.diagonal().map(|d| 1.0 / d.sqrt());
        if !scale.iter().all(|s| s.is_finite()) {
            return None;
        }
        let scale = DMatrix::from_diagonal(&scale);
        let inverse = (&scale * reduced * &scale).cholesky()?.inverse();
        Some(&scale * inverse * &scale)
    }
}

/// The matrix with its diagonal enlarged.
pub fn damped(matrix: &DMatrix<f64>, damping: f64) -> DMatrix<f64> {
    let mut matrix = matrix.clone();
    for k in 0..matrix.nrows() {
        matrix[(k, k)] *= 1.0 + damping;
    }
    matrix
}

/// A pose's own block with its diagonal enlarged.
pub fn damped_own(pose: &PoseBlock, damping: f64) -> Matrix6<f64> {
    let mut own = pose.own;
    for k in 0..6 {
        own[(k, k)] *= 1.0 + damping;
    }
    own
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
