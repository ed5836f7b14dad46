//! A board that is not what the manifest says, or not the same in every pose.

use super::fault::{Fault, Step, fault, unseen};
use super::recording::Recording;
use super::session::{BOTH, Session};
use crate::random;
use rand_chacha::ChaCha8Rng;

pub(super) const FAULTS: &[Fault] = &[
    fault(
        "square-x-long",
        &["square-scale-axis"],
        Step::Session(|session, _| deform(session, [1.005, 0.0])),
    ),
    fault(
        "board-sheared",
        &["square-scale-axis"],
        Step::Session(|session, _| deform(session, [1.0, 0.005])),
    ),
    fault(
        "square-in-m",
        &["square-unit"],
        Step::Written(|written, _| scale(written, 1e-3)),
    ),
    fault(
        "square-in-cm",
        &["square-unit"],
        Step::Written(|written, _| scale(written, 0.1)),
    ),
    fault(
        "square-in-inches",
        &["square-unit"],
        Step::Written(|written, _| scale(written, 1.0 / 25.4)),
    ),
    unseen(
        "square-small",
        &["square-unit"],
        Step::Written(|written, _| scale(written, 0.995)),
    ),
    fault(
        "rows-cols-swapped",
        &["rows-cols-swapped"],
        Step::Written(|written, _| {
            std::mem::swap(&mut written.board.rows, &mut written.board.cols);
        }),
    ),
    fault(
        "bowed-0.2mm",
        &["board-bowed"],
        Step::Scene(|settings| settings.bow_mm = 0.2),
    ),
    fault(
        "bowed-2mm",
        &["board-bowed"],
        Step::Scene(|settings| settings.bow_mm = 2.0),
    ),
    fault("flexing", &["board-flexes"], Step::Session(flex)),
];

/// Prints the board with x scaled, and x that grows with y.
fn deform(session: &mut Session, stretch_and_shear: [f64; 2]) {
    for (_, take) in session.takes_of(BOTH) {
        take.stretch_and_shear = stretch_and_shear;
    }
}

/// Writes another pitch into the manifest.
fn scale(written: &mut Recording, factor: f64) {
    written.board.square_mm *= factor;
}

/// Another bow in every pose, up to 0.2 mm either way.
fn flex(session: &mut Session, rng: &mut ChaCha8Rng) {
    for pose in 0..session.pose_count() {
        let bow_mm = random::between(rng, -0.2, 0.2);
        for takes in &mut session.takes {
            takes[pose].bow_mm = bow_mm;
        }
    }
}
