//! Least squares by a truncated singular value decomposition.
//!
//! The matrix of a network with a wide spread has a condition number beyond 1e17: what it can say in
//! double precision is what its largest singular values say. The normal equations would square the
//! condition number and lose half of those.

use calib_rays::numerics::SingularValues;
use nalgebra::DMatrix;

/// The solution with the least norm, and how many singular values it uses.
#[derive(Debug, Clone)]
pub struct Truncated {
    /// One column per right-hand side.
    pub solution: DMatrix<f64>,
    /// Singular values above the cut.
    pub rank: usize,
}

/// How far below the cut the decomposition goes before it stops: columns smaller than this share of
/// it cannot move a singular value above the cut in its last digits.
const BELOW_CUT: f64 = 1e-3;

/// Minimizes `|A x - b|` over the singular directions of A whose value is at least `cut` times the
/// largest; `None` if A is not finite or empty.
///
/// Cost: `3 m n r` for an `m x n` matrix of rank `r`.
pub fn solve_truncated(a: DMatrix<f64>, b: DMatrix<f64>, cut: f64) -> Option<Truncated> {
    if !b.iter().all(|x| x.is_finite()) {
        return None;
    }
    let svd = SingularValues::down_to(a, BELOW_CUT * cut)?;
    let rank = svd.rank(cut);
    (rank > 0).then(|| Truncated {
        solution: svd.solve(b, cut),
        rank,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::dmatrix;

    #[test]
    fn a_square_system_is_solved_exactly() {
        let a = dmatrix![1.0, 2.0; 3.0, 5.0];
        let found = solve_truncated(a, dmatrix![5.0; 13.0], 1e-13).unwrap();
        assert_eq!(found.rank, 2);
        assert!((found.solution - dmatrix![1.0; 2.0]).norm() < 1e-13);
    }

    #[test]
    fn of_a_deficient_system_the_shortest_solution_comes_out() {
        // Both columns are the same: the least-squares value 3 is shared between them.
        let a = dmatrix![1.0, 1.0; 1.0, 1.0; 1.0, 1.0];
        let found = solve_truncated(a, dmatrix![2.0; 3.0; 4.0], 1e-13).unwrap();
        assert_eq!(found.rank, 1);
        assert!((found.solution - dmatrix![1.5; 1.5]).norm() < 1e-13);
    }

    #[test]
    fn it_is_the_full_decomposition_cut_off() {
        // Columns of powers: condition number 1e10.
        let a = DMatrix::from_fn(40, 12, |i, j| (i as f64 / 39.0).powi(j as i32));
        let b = DMatrix::from_fn(40, 2, |i, j| (0.3 * i as f64 + j as f64).sin());
        let cut = 1e-5;
        let found = solve_truncated(a.clone(), b.clone(), cut).unwrap();
        let svd = SingularValues::new(a).unwrap();
        assert_eq!(found.rank, svd.rank(cut));
        let full = svd.solve(b, cut);
        // Round-off times the condition number kept.
        assert!((found.solution - &full).norm() < 1e-9 * full.norm());
    }

    #[test]
    fn nothing_comes_of_nothing() {
        assert!(solve_truncated(DMatrix::zeros(3, 2), DMatrix::zeros(3, 1), 1e-13).is_none());
        let a = DMatrix::from_element(2, 2, f64::NAN);
        assert!(solve_truncated(a, DMatrix::zeros(2, 1), 1e-13).is_none());
    }
}
