//! Fixed points reached faster: Anderson's mixing (Anderson 1965; Walker and Ni 2011).
//!
//! Plain iteration `x <- g(x)` of a map that contracts slowly creeps: what it leaves falls by a small
//! share each time. Mixing takes the combination of the last few results whose differences `g(x) - x`
//! nearly cancel.

use calib_rays::numerics::SingularValues;
use nalgebra::{DMatrix, DVector};
use std::collections::VecDeque;

/// Differences whose singular values are below this share of the largest tell nothing new.
const CUT: f64 = 1e-8;

/// The last few arguments and results of a map.
#[derive(Debug)]
pub struct Mixing {
    depth: usize,
    /// (x, g(x)), oldest first.
    known: VecDeque<(DVector<f64>, DVector<f64>)>,
}

impl Mixing {
    /// Nothing known yet; at most `depth` differences are mixed.
    pub fn new(depth: usize) -> Self {
        Self {
            depth,
            known: VecDeque::new(),
        }
    }

    /// Forgets what is known: after a step that did not help.
    pub fn clear(&mut self) {
        self.known.clear();
    }

    /// Where to go next, given that the map takes `x` to `g`: `g` itself as long as nothing else is
    /// known.
    pub fn next(&mut self, x: &DVector<f64>, g: &DVector<f64>) -> DVector<f64> {
        self.known.push_back((x.clone(), g.clone()));
        if self.known.len() > self.depth + 1 {
            self.known.pop_front();
        }
        let pairs: Vec<_> = self.known.iter().collect();
        let gap = |k: usize| &pairs[k].1 - &pairs[k].0;
        let last = pairs.len() - 1;
        if last == 0 {
            return g.clone();
        }
        let newest = gap(last);
        let differences: Vec<DVector<f64>> = (0..last).map(|k| gap(k + 1) - gap(k)).collect();
        let Some(svd) = SingularValues::new(DMatrix::from_columns(&differences)) else {
            return g.clone();
        };
        let amounts = svd.solve(newest, CUT);
        (0..last).fold(g.clone(), |mixed, k| {
            mixed - (&pairs[k + 1].1 - &pairs[k].1) * amounts[k]
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A linear map that keeps 0.9 to 0.999 of what is left along its axes.
    fn creeping(x: &DVector<f64>) -> DVector<f64> {
        let keep = DVector::from_vec(vec![0.9, 0.99, 0.999]);
        let fixed = DVector::from_vec(vec![1.0, -2.0, 3.0]);
        &fixed + keep.component_mul(&(x - &fixed))
    }

    #[test]
    fn a_linear_map_of_three_axes_is_at_rest_after_as_many_differences() {
        let mut mixing = Mixing::new(5);
        let mut x = DVector::zeros(3);
        for _ in 0..5 {
            let g = creeping(&x);
            x = mixing.next(&x, &g);
        }
        // Five plain steps would leave 99.5 % along the last axis.
        let left = (creeping(&x) - &x).norm();
        assert!(left < 1e-9, "{left}");
        assert!((x - DVector::from_vec(vec![1.0, -2.0, 3.0])).norm() < 1e-6);
    }

    #[test]
    fn at_rest_nothing_moves() {
        let mut mixing = Mixing::new(3);
        let x = DVector::from_vec(vec![1.0, 2.0]);
        for _ in 0..3 {
            assert_eq!(mixing.next(&x, &x), x);
        }
    }
}
