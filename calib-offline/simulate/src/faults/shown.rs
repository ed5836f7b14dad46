//! A board shown too little: few tilts, distances, places or poses.

use super::fault::{Fault, Step, fault, some_poses};
use super::recording::Recording;
use super::session::Session;
use rand_chacha::ChaCha8Rng;

pub(super) const FAULTS: &[Fault] = &[
    fault(
        "few-tilts",
        &["few-tilts"],
        Step::Motion(|motion| motion.tilt_deg = 3.0),
    ),
    fault(
        "frontal-one-depth",
        &["one-depth", "few-tilts"],
        Step::Motion(|motion| {
            motion.tilt_deg = 2.0;
            motion.depth = 0.0;
        }),
    ),
    fault(
        "one-depth",
        &["one-depth"],
        Step::Motion(|motion| motion.depth = 0.0),
    ),
    fault(
        "middle-only",
        &["coverage"],
        Step::Motion(|motion| {
            motion.distance = 1.7;
            motion.across = 0.1;
        }),
    ),
    fault(
        "poses-2",
        &["few-poses"],
        Step::Written(|written, _| keep(written, 2)),
    ),
    fault(
        "poses-3",
        &["few-poses"],
        Step::Written(|written, _| keep(written, 3)),
    ),
    fault(
        "poses-4",
        &["few-poses"],
        Step::Written(|written, _| keep(written, 4)),
    ),
    fault(
        "poses-5",
        &["few-poses"],
        Step::Written(|written, _| keep(written, 5)),
    ),
    fault("standing-some", &["duplicates"], Step::Session(stand)),
];

/// So many poses, spread over all.
fn keep(written: &mut Recording, count: usize) {
    let last = written.pose_count() - 1;
    let kept: Vec<usize> = (0..count).map(|k| k * last / (count - 1)).collect();
    written.keep_poses(&kept);
}

/// Does not move the board before some poses.
fn stand(session: &mut Session, rng: &mut ChaCha8Rng) {
    for pose in some_poses(session.pose_count(), rng) {
        for takes in &mut session.takes {
            takes[pose].left_from_board = takes[pose - 1].left_from_board;
        }
    }
}
