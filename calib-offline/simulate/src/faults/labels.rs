//! Corners that were given wrong labels, views that were given wrong cameras or numbers.

use super::recording::Recording;
use calib_rays::observed::View;

/// Gives the corners of some views other labels; those that fall off the board are lost.
pub(super) fn relabel(
    recording: &mut Recording,
    is_one: impl Fn(&View) -> bool,
    label: impl Fn(usize, usize) -> (usize, usize),
) {
    let board = recording.board;
    for view in recording.views.iter_mut().filter(|view| is_one(view)) {
        for corner in &mut view.corners {
            (corner.row, corner.col) = label(corner.row, corner.col);
        }
        view.corners
            .retain(|corner| corner.row < board.rows && corner.col < board.cols);
        view.corners.sort_by_key(|corner| (corner.row, corner.col));
    }
}

/// Numbers the columns of some views from the other end, as in a mirror.
pub(super) fn mirror(recording: &mut Recording, is_one: impl Fn(&View) -> bool) {
    let last = recording.board.cols - 1;
    relabel(recording, is_one, |row, col| (row, last - col));
}

/// Numbers rows and columns of some views from the other end.
pub(super) fn half_turn(recording: &mut Recording, is_one: impl Fn(&View) -> bool) {
    let board = recording.board;
    relabel(recording, is_one, |row, col| board.half_turned(row, col));
}

/// Counts the rows of some views from 1.
pub(super) fn shift_rows(recording: &mut Recording, is_one: impl Fn(&View) -> bool) {
    relabel(recording, is_one, |row, col| (row + 1, col));
}

/// Gives the views of some poses to the other camera.
pub(super) fn exchange_cameras(recording: &mut Recording, is_one: impl Fn(usize) -> bool) {
    for view in recording.views.iter_mut().filter(|view| is_one(view.pose)) {
        view.camera_idx = 1 - view.camera_idx;
    }
    recording
        .views
        .sort_by_key(|view| (view.camera_idx, view.pose));
}

/// Loses the first image of the right camera's, so that each stands beside the next pose's of the left.
pub(super) fn right_one_late(recording: &mut Recording) {
    recording.views.retain_mut(|view| {
        let is_first = view.pose == 0;
        if view.camera_idx == 1 && !is_first {
            view.pose -= 1;
        }
        view.camera_idx == 0 || !is_first
    });
}

/// Takes the corners of so many positions for all poses in turn.
pub(super) fn repeat_positions(recording: &mut Recording, positions: usize, poses: usize) {
    let originals = recording.views.clone();
    for view in &mut recording.views {
        let source = view.pose % positions * poses / positions;
        let is_source = |v: &&View| v.camera_idx == view.camera_idx && v.pose == source;
        if let Some(original) = originals.iter().find(is_source) {
            view.corners.clone_from(&original.corners);
        }
    }
}
