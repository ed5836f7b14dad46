//! Exposures that were not at one instant: of one camera later than of the other, of one line later
//! than of the one above it.

use super::fault::{Fault, Step, fault, some_poses, unseen};
use super::session::{BOTH, RIGHT, Take};
use crate::random;
use nalgebra::Vector3;
use rand_chacha::ChaCha8Rng;

/// How far the board goes on before a late exposure, mm.
pub(super) const LATE_MM: f64 = 0.3;
/// Largest skew of an image read line by line, px.
const SKEW_PX: f64 = 1.0;

pub(super) const FAULTS: &[Fault] = &[
    fault(
        "late-some",
        &["not-simultaneous"],
        Step::Session(|session, rng| {
            for pose in some_poses(session.pose_count(), rng) {
                move_on(&mut session.takes[1][pose], &shift_mm(rng));
            }
        }),
    ),
    fault(
        "late-all-random",
        &["not-simultaneous"],
        Step::Session(|session, rng| {
            for (_, take) in session.takes_of(RIGHT) {
                move_on(take, &shift_mm(rng));
            }
        }),
    ),
    // A right camera that stands elsewhere sees the same.
    unseen(
        "late-all-same",
        &["not-simultaneous"],
        Step::Session(|session, rng| {
            let shift_mm = shift_mm(rng);
            for (_, take) in session.takes_of(RIGHT) {
                move_on(take, &shift_mm);
            }
        }),
    ),
    fault(
        "skew-per-pose",
        &["rolling-shutter"],
        Step::Session(|session, rng| {
            for (_, take) in session.takes_of(BOTH) {
                take.skew_px = random::between(rng, -SKEW_PX, SKEW_PX);
            }
        }),
    ),
    // A lens whose image is sheared shows the same.
    unseen(
        "skew-same",
        &["rolling-shutter"],
        Step::Session(|session, _| {
            for (_, take) in session.takes_of(BOTH) {
                take.skew_px = SKEW_PX;
            }
        }),
    ),
];

/// [`LATE_MM`] in any direction, left camera's frame.
fn shift_mm(rng: &mut ChaCha8Rng) -> Vector3<f64> {
    let mut component = || random::normal(rng);
    Vector3::new(component(), component(), component()).normalize() * LATE_MM
}

fn move_on(take: &mut Take, shift_mm: &Vector3<f64>) {
    take.left_from_board.translation_mm += shift_mm;
}
