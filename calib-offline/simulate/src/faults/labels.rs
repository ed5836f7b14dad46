//! Corners with wrong labels.

use super::fault::{Fault, Step, fault, some_poses, unseen};
use super::recording::Recording;
use calib_rays::observed::View;
use rand_chacha::ChaCha8Rng;

pub(super) const FAULTS: &[Fault] = &[
    fault(
        "half-turn-some",
        &["labels-turned"],
        Step::Written(half_turn_some),
    ),
    fault(
        "mirrored-some",
        &["labels-mirrored"],
        Step::Written(|written, rng| {
            let some = some_poses(written.pose_count(), rng);
            mirror(written, |view| {
                view.camera_idx == 1 && some.contains(&view.pose)
            });
        }),
    ),
    // What all corners show is a mirrored world, and not which of the two it comes from.
    fault(
        "mirrored-all",
        &["labels-mirrored", "v-upwards"],
        Step::Written(|written, _| mirror(written, |_| true)),
    ),
    fault(
        "row-shift-right-one",
        &["labels-shifted"],
        Step::Written(|written, rng| {
            let one = some_poses(written.pose_count(), rng)[0];
            shift_rows(written, |view| view.camera_idx == 1 && view.pose == one);
        }),
    ),
    unseen(
        "row-shift-both-one",
        &["labels-shifted"],
        Step::Written(|written, rng| {
            let one = some_poses(written.pose_count(), rng)[0];
            shift_rows(written, |view| view.pose == one);
        }),
    ),
    fault(
        "row-shift-right-all",
        &["labels-shifted"],
        Step::Written(|written, _| shift_rows(written, |view| view.camera_idx == 1)),
    ),
];

/// Gives the corners of some views other labels; those that fall off the board are lost.
fn relabel(
    written: &mut Recording,
    is_one: impl Fn(&View) -> bool,
    label: impl Fn(usize, usize) -> (usize, usize),
) {
    let board = written.board.clone();
    for view in written.views.iter_mut().filter(|view| is_one(view)) {
        for corner in &mut view.corners {
            (corner.row, corner.col) = label(corner.row, corner.col);
        }
        view.corners
            .retain(|corner| corner.row < board.rows && corner.col < board.cols);
        view.corners.sort_by_key(|corner| (corner.row, corner.col));
    }
}

/// Numbers some views of the right camera from the opposite end.
fn half_turn_some(written: &mut Recording, rng: &mut ChaCha8Rng) {
    let some = some_poses(written.pose_count(), rng);
    let board = written.board.clone();
    relabel(
        written,
        |view| view.camera_idx == 1 && some.contains(&view.pose),
        |row, col| board.half_turned(row, col),
    );
}

/// Numbers the columns of some views from the other end, as in a mirror.
fn mirror(written: &mut Recording, is_one: impl Fn(&View) -> bool) {
    let last = written.board.cols - 1;
    relabel(written, is_one, |row, col| (row, last - col));
}

/// Counts the rows of some views from 1.
fn shift_rows(written: &mut Recording, is_one: impl Fn(&View) -> bool) {
    relabel(written, is_one, |row, col| (row + 1, col));
}
