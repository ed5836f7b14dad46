//! Recordings in which one thing is wrong, and known: what a verdict is judged by.
//!
//! [`all`] lists them. Each says by which code a program ought to name it, and whether the corners can
//! show it at all. [`plant`] makes the recording: of a session with the fault in its scene, its cameras
//! or its board, or from what was written down of a faultless one, made wrong.

mod board;
mod exposure;
mod fault;
mod half_way;
mod labels;
mod numbers;
mod pixels;
mod recording;
mod rigs;
mod session;
mod shown;

pub use fault::{FAULTLESS, Fault, Step};
pub use recording::{Dial, ExactMatch, MATCHES, Recording};
pub use rigs::{Motion, Poses, Rig, scene};
pub use session::{Session, Take};

use crate::random::{self, Purpose};
use crate::settings::SceneError;

/// Every fault by name, [`FAULTLESS`] first.
pub fn all() -> impl Iterator<Item = &'static Fault> {
    let kinds = [
        &[FAULTLESS],
        board::FAULTS,
        labels::FAULTS,
        numbers::FAULTS,
        shown::FAULTS,
        exposure::FAULTS,
        half_way::FAULTS,
        pixels::FAULTS,
    ];
    kinds.into_iter().flatten()
}

/// The fault of a name.
pub fn named(name: &str) -> Option<&'static Fault> {
    all().find(|fault| fault.name == name)
}

/// The recording of a fault, everything random by the seed.
///
/// # Errors
/// [`SceneError`] if a fault asks for a scene that cannot be.
pub fn plant(fault: &Fault, rig: Rig, poses: Poses, seed: u64) -> Result<Recording, SceneError> {
    let usual = scene(rig, poses, &Motion::USUAL, seed)?;
    let mut rng = random::stream(seed, Purpose::Fault, 0, 0);
    let has_dial = poses == Poses::Stage;
    let recording = match fault.step {
        Step::Nothing => Recording::of(&Session::faultless(usual.clone()), &usual, has_dial),
        Step::Motion(change) => {
            let mut motion = Motion::USUAL;
            change(&mut motion);
            let moved = scene(rig, poses, &motion, seed)?;
            Recording::of(&Session::faultless(moved), &usual, has_dial)
        }
        Step::Scene(change) => {
            let mut changed = usual.clone();
            change(&mut changed.settings);
            Recording::of(&Session::faultless(changed), &usual, has_dial)
        }
        Step::Session(change) => {
            let mut session = Session::faultless(usual.clone());
            change(&mut session, &mut rng);
            Recording::of(&session, &usual, has_dial)
        }
        Step::Written(change) => {
            let mut recording = Recording::of(&Session::faultless(usual.clone()), &usual, has_dial);
            change(&mut recording, &mut rng);
            recording
        }
    };
    Ok(recording)
}

#[cfg(test)]
mod tests;
