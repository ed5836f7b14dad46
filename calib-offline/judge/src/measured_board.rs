//! A board measured with the rig: how far its triangulated corners are from where they must be.

use calib_rays::board::BoardSpec;
use calib_rays::geometry::best_placement;
use nalgebra::Vector3;
use std::collections::HashMap;

/// Triangulated corners of one pose.
#[derive(Debug, Clone, Default)]
pub struct MeasuredBoard {
    /// Row, column and measured position (any one frame, mm).
    pub corners: Vec<(usize, usize, Vector3<f64>)>,
}

impl MeasuredBoard {
    /// Error of the distance between each two neighboring corners, relative to the square.
    pub fn neighbor_errors(&self, board: &BoardSpec) -> Vec<f64> {
        let by_label: HashMap<(usize, usize), Vector3<f64>> = self
            .corners
            .iter()
            .map(|(row, col, point)| ((*row, *col), *point))
            .collect();
        self.corners
            .iter()
            .flat_map(|(row, col, point)| {
                board
                    .next_to(*row, *col)
                    .filter_map(|next| Some((next, by_label.get(&next)?)))
                    .map(|(next, other)| {
                        let apart_mm = board.apart_mm((*row, *col), next);
                        (point - other).norm() / board.square_mm - apart_mm / board.square_mm
                    })
                    .collect::<Vec<_>>()
            })
            .collect()
    }

    /// Distance of each corner from the best-placed nominal board, mm; empty for fewer than 3 corners.
    pub fn rigid_errors_mm(&self, board: &BoardSpec) -> Vec<f64> {
        let nominal: Vec<_> = self
            .corners
            .iter()
            .map(|(row, col, _)| board.corner_in_board(*row, *col))
            .collect();
        let measured: Vec<_> = self.corners.iter().map(|(_, _, point)| *point).collect();
        let Some(measured_from_board) = best_placement(&nominal, &measured) else {
            return Vec::new();
        };
        nominal
            .iter()
            .zip(&measured)
            .map(|(n, m)| (measured_from_board.point(n) - m).norm())
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use calib_rays::geometry::{RigidTransform, so3};

    #[test]
    fn a_scaled_board_shows_its_scale_and_a_moved_one_nothing() {
        let board = BoardSpec::chessboard(4, 5, 10.0);
        let moved = RigidTransform::new(
            so3::exp(&Vector3::new(0.3, -1.0, 0.2)),
            Vector3::new(5.0, -7.0, 300.0),
        );
        let measure = |scale: f64| MeasuredBoard {
            corners: (0..20)
                .map(|k| {
                    let (row, col) = (k / 5, k % 5);
                    (
                        row,
                        col,
                        moved.point(&(board.corner_in_board(row, col) * scale)),
                    )
                })
                .collect(),
        };
        let exact = measure(1.0);
        assert_eq!(exact.neighbor_errors(&board).len(), 4 * 4 + 3 * 5);
        assert!(
            exact
                .neighbor_errors(&board)
                .iter()
                .all(|e| e.abs() < 1e-12)
        );
        assert!(exact.rigid_errors_mm(&board).iter().all(|e| *e < 1e-12));
        let scaled = measure(1.01);
        assert!(
            scaled
                .neighbor_errors(&board)
                .iter()
                .all(|e| (e - 0.01).abs() < 1e-12)
        );
        // The corner farthest from the middle is 25 mm away: 1 % of it.
        let worst = scaled
            .rigid_errors_mm(&board)
            .into_iter()
            .fold(0.0, f64::max);
        assert!((worst - 0.25).abs() < 1e-3);
    }
}
