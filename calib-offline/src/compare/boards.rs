//! Boards that no method saw, judged on the corners that every method can answer: a method that
//! refuses the difficult part of the image would else look the better for it.

use calib_estimate::adjust::Observations;
use calib_estimate::adjust::observations::{ObservedCorner, ViewBlock};
use calib_estimate::init::board_pose::residuals_with_free_pose;
use calib_judge::held_out::{BoardErrors, Fold, measure_boards};
use calib_rays::field::Rig;
use calib_rays::geometry::PixelPoint;
use calib_rays::measure::RigSource;
use calib_rays::observed::Corner;
use nalgebra::Vector2;

/// Errors of one method on one board.
#[derive(Debug, Clone, Default)]
pub struct BoardScore {
    /// Length of the residual vector of every common corner, pose refitted, px.
    pub residuals_px: Vec<f64>,
    /// The triangulated board.
    pub boards: BoardErrors,
}

/// The boards of one fold.
#[derive(Debug, Clone)]
pub struct FoldScores {
    /// Per board, then per method.
    pub boards: Vec<Vec<BoardScore>>,
    /// Corners offered.
    pub corner_count: usize,
    /// Corners that every method can answer.
    pub common_count: usize,
    /// Per method: corners outside its calibrated area.
    pub unanswered: Vec<usize>,
}

/// Judges the estimates of one fold, one per method, all made without the poses of `unseen`.
pub fn score_fold(folds: &[&Fold], unseen: &Observations) -> FoldScores {
    let rigs: Vec<&Rig> = folds.iter().map(|fold| &fold.rig).collect();
    let mut scores = FoldScores {
        boards: Vec::new(),
        corner_count: 0,
        common_count: 0,
        unanswered: vec![0; folds.len()],
    };
    for view in &unseen.views {
        scores.corner_count += view.corners.len();
        for (rig, unanswered) in rigs.iter().zip(&mut scores.unanswered) {
            let corners = view.corners.iter();
            *unanswered += corners
                .filter(|corner| !answers(rig, view, corner.pixel))
                .count();
        }
    }
    for pose_idx in 0..unseen.poses.len() {
        let board = common_part(unseen.with_pose_indices(|idx| idx == pose_idx), &rigs);
        scores.common_count += board.corner_count();
        scores.boards.push(score_board(folds, &board));
    }
    scores
}

fn answers(rig: &Rig, view: &ViewBlock, pixel: PixelPoint) -> bool {
    rig.cameras[view.camera_idx].coverage.contains(pixel)
}

/// The corners of a board that every rig has a ray for and, where two cameras saw them, a point.
fn common_part(mut board: Observations, rigs: &[&Rig]) -> Observations {
    for view in &mut board.views {
        let whole = view.clone();
        view.corners
            .retain(|corner| rigs.iter().all(|rig| answers(rig, &whole, corner.pixel)));
    }
    let [left, right, ..] = &mut board.views[..] else {
        return board;
    };
    let cameras = [left.camera_idx, right.camera_idx];
    let mut unmet = Vec::new();
    for corner in &left.corners {
        let label = (corner.row, corner.col);
        let other = right.corners.iter().find(|c| (c.row, c.col) == label);
        let Some(other) = other else { continue };
        let sightings = [(cameras[0], corner.pixel), (cameras[1], other.pixel)];
        if rigs.iter().any(|rig| rig.triangulate(&sightings).is_err()) {
            unmet.push(label);
        }
    }
    for view in [left, right] {
        view.corners
            .retain(|corner| !unmet.contains(&(corner.row, corner.col)));
    }
    board
}

fn score_board(folds: &[&Fold], board: &Observations) -> Vec<BoardScore> {
    let mut scores: Vec<BoardScore> = folds
        .iter()
        .map(|fold| {
            // Without a frame there is always a source.
            let source = RigSource::new(&fold.rig, None);
            BoardScore {
                residuals_px: Vec::new(),
                boards: source.map_or_else(BoardErrors::default, |s| measure_boards(&s, board)),
            }
        })
        .collect();
    for view in &board.views {
        let corners: Vec<Corner> = view.corners.iter().map(ObservedCorner::labelled).collect();
        let residuals: Option<Vec<_>> = folds
            .iter()
            .map(|fold| {
                let field = &fold.rig.cameras[view.camera_idx].field;
                residuals_with_free_pose(field, &board.board, &fold.board_shape, &corners)
            })
            .collect();
        // A view that one method cannot place counts for none.
        for (score, residuals) in scores.iter_mut().zip(residuals.into_iter().flatten()) {
            score
                .residuals_px
                .extend(residuals.iter().map(Vector2::norm));
        }
    }
    scores
}

#[cfg(test)]
mod tests {
    use super::*;
    use calib_estimate::pinhole::{RigSettings, calibrate_rig};
    use calib_rays::board::BoardShape;
    use calib_simulate::{CameraOptics, OpticsKind, Scene, SceneSettings};

    #[test]
    fn a_method_gains_nothing_by_refusing_a_part_of_the_image() {
        let mut settings = SceneSettings::standard_noisy(OpticsKind::Brown, 3);
        (settings.board.rows, settings.board.cols) = (7, 6);
        settings.board.square_mm = 22.0;
        settings.angles_deg = (-3..=3).map(|k| f64::from(k) * 13.0).collect();
        let scene = Scene::new(settings).unwrap();
        let sensors = scene.cameras.iter().map(CameraOptics::sensor).collect();
        let seen = Observations::new(
            scene.settings.board.clone(),
            sensors,
            &scene.observe_corners(),
        );
        let pinhole = calibrate_rig(&seen, &RigSettings::default()).unwrap();
        let rig = pinhole.rig(&seen.numbered_cameras(), &seen).unwrap().rig;
        let whole = Fold {
            joint: None,
            rig,
            board_shape: BoardShape::default(),
            unseen: seen.clone(),
        };
        let mut half = whole.clone();
        let coverage = &mut half.rig.cameras[0].coverage;
        for (k, covered) in coverage.covered.iter_mut().enumerate() {
            *covered &= k % coverage.cells_u < coverage.cells_u / 2;
        }

        let alone = score_fold(&[&whole], &seen);
        assert_eq!(alone.unanswered, [0]);
        assert_eq!(alone.common_count, seen.corner_count());
        let both = score_fold(&[&whole, &half], &seen);
        let refused = both.unanswered[1];
        assert_eq!(both.unanswered[0], 0);
        assert!(refused > 20, "{refused}");
        assert_eq!(both.common_count, seen.corner_count() - refused);
        assert_eq!(both.boards.len(), seen.poses.len());
        let mut points = 0;
        for board in &both.boards {
            // The same rig on the same corners: the same errors.
            assert_eq!(board[0].residuals_px, board[1].residuals_px);
            assert_eq!(
                board[0].boards.neighbor_errors,
                board[1].boards.neighbor_errors
            );
            points += board[0].boards.point_count;
        }
        let all: usize = alone.boards.iter().map(|b| b[0].boards.point_count).sum();
        assert!(points > 0 && points < all, "{points} of {all}");
    }
}
