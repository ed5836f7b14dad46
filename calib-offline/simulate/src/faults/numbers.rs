//! Views that were given to the wrong camera or the wrong pose, poses recorded twice, angles that the
//! dial did not show.

use super::fault::{Fault, Step, fault, on_stage, some_poses, unseen};
use super::recording::Recording;

/// Different positions among the poses of a recording with copies.
const POSITIONS: usize = 4;

pub(super) const FAULTS: &[Fault] = &[
    fault(
        "exchanged-all",
        &["cameras-exchanged"],
        Step::Written(|written, _| exchange_cameras(written, |_| true)),
    ),
    fault(
        "exchanged-some",
        &["cameras-exchanged"],
        Step::Written(|written, rng| {
            let some = some_poses(written.pose_count(), rng);
            exchange_cameras(written, |pose| some.contains(&pose));
        }),
    ),
    fault(
        "poses-from-1",
        &["pose-numbering"],
        Step::Written(|written, _| {
            for view in &mut written.views {
                view.pose += 1;
            }
        }),
    ),
    fault(
        "right-one-late",
        &["pose-numbering"],
        Step::Written(|written, _| lose_first_of_right(written)),
    ),
    fault(
        "copies",
        &["duplicates"],
        Step::Written(|written, _| copy_positions(written)),
    ),
    // A dial may count either way.
    on_stage(unseen(
        "dial-other-sense",
        &[],
        Step::Written(|written, _| dial(written, |angle_deg| -angle_deg)),
    )),
    on_stage(fault(
        "dial-radians",
        &["stage-angles"],
        Step::Written(|written, _| dial(written, f64::to_radians)),
    )),
    on_stage(fault(
        "dial-shifted",
        &["stage-angles"],
        Step::Written(|written, _| {
            if let Some(dial) = &mut written.dial {
                dial.angles_deg.rotate_right(1);
            }
        }),
    )),
];

/// Gives the views of some poses to the other camera.
fn exchange_cameras(written: &mut Recording, is_one: impl Fn(usize) -> bool) {
    for view in written.views.iter_mut().filter(|view| is_one(view.pose)) {
        view.camera_idx = 1 - view.camera_idx;
    }
    written
        .views
        .sort_by_key(|view| (view.camera_idx, view.pose));
}

/// Loses the right camera's first image, so that each of the others stands a pose too early.
fn lose_first_of_right(written: &mut Recording) {
    written.views.retain_mut(|view| {
        let is_first = view.pose == 0;
        if view.camera_idx == 1 && !is_first {
            view.pose -= 1;
        }
        view.camera_idx == 0 || !is_first
    });
}

/// Takes the corners of [`POSITIONS`] poses, spread over all, for all of them in turn.
fn copy_positions(written: &mut Recording) {
    let pose_count = written.pose_count();
    let originals = written.views.clone();
    for view in &mut written.views {
        let source = view.pose % POSITIONS * pose_count / POSITIONS;
        let original = originals
            .iter()
            .find(|other| other.camera_idx == view.camera_idx && other.pose == source);
        if let Some(original) = original {
            view.corners.clone_from(&original.corners);
        }
    }
}

/// Writes down other angles.
fn dial(written: &mut Recording, told: fn(f64) -> f64) {
    if let Some(dial) = &mut written.dial {
        for angle_deg in &mut dial.angles_deg {
            *angle_deg = told(*angle_deg);
        }
    }
}
