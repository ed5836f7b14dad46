//! Least squares by a truncated singular value decomposition.
//!
//! The matrix of a network with a wide spread has a condition number beyond 1e17: what it can say in
//! double precision is what its largest singular values say. The normal equations would square the
//! condition number and lose half of those.

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
/// A is brought to a few rows by a Householder decomposition with column pivoting (Golub and Van
/// Loan, 5.4.2), which ends when what is left lies below the cut; the singular values are then those
/// of a small triangle. Cost: `2 m n r` for an `m x n` matrix of rank `r`.
pub fn solve_truncated(mut a: DMatrix<f64>, mut b: DMatrix<f64>, cut: f64) -> Option<Truncated> {
    let (rows, cols) = a.shape();
    let mut order: Vec<usize> = (0..cols).collect();
    let mut norms: Vec<f64> = a.column_iter().map(|c| c.norm_squared()).collect();
    let largest = norms.iter().copied().fold(0.0, f64::max);
    if !(largest > 0.0 && largest.is_finite() && b.iter().all(|x| x.is_finite())) {
        return None;
    }
    let mut steps = 0;
    while steps < rows.min(cols) {
        let pivot = (steps..cols).max_by(|i, j| norms[*i].total_cmp(&norms[*j]))?;
        a.swap_columns(steps, pivot);
        order.swap(steps, pivot);
        norms.swap(steps, pivot);
        let column = a.column(steps).rows(steps, rows - steps).into_owned();
        let length = column.norm();
        if length <= BELOW_CUT * cut * largest.sqrt() {
            break;
        }
        // The reflection that takes the column to a multiple of the first axis.
        let mut v = column;
        v[0] += length.copysign(v[0]);
        let scale = 2.0 / v.norm_squared();
        // Columns to the left are zero from here down.
        for (matrix, from) in [(&mut a, steps), (&mut b, 0)] {
            for c in from..matrix.ncols() {
                let mut column = matrix.column_mut(c);
                let mut part = column.rows_mut(steps, rows - steps);
                let along = scale * part.dot(&v);
                part.axpy(-along, &v, 1.0);
            }
        }
        // Norms are taken anew: updated ones lose their digits where ranks end.
        for (c, norm) in norms.iter_mut().enumerate().skip(steps + 1) {
            *norm = a.column(c).rows(steps + 1, rows - steps - 1).norm_squared();
        }
        steps += 1;
    }
    let triangle = a.rows(0, steps).upper_triangle();
    let svd = triangle.transpose().svd(true, true);
    let (u, v_t) = (svd.u?, svd.v_t?);
    let top = svd.singular_values.max();
    let mut in_order = DMatrix::zeros(cols, b.ncols());
    let mut rank = 0;
    for (k, value) in svd.singular_values.iter().enumerate() {
        if *value >= cut * top {
            rank += 1;
            let amounts = v_t.row(k) * b.rows(0, steps) / *value;
            in_order += u.column(k) * amounts;
        }
    }
    let mut solution = DMatrix::zeros(cols, b.ncols());
    for (k, place) in order.iter().enumerate() {
        solution.set_row(*place, &in_order.row(k));
    }
    Some(Truncated { solution, rank })
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
        let svd = a.svd(true, true);
        let top = svd.singular_values.max();
        let kept = svd.singular_values.iter().filter(|s| **s >= cut * top);
        assert_eq!(found.rank, kept.count());
        let full = svd.solve(&b, cut * top).unwrap();
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
