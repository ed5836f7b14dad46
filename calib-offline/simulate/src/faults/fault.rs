//! What a planted fault is, and what several of them need.

use super::recording::Recording;
use super::rigs::{Motion, Poses};
use super::session::Session;
use crate::random;
use crate::settings::SceneSettings;
use rand_chacha::ChaCha8Rng;

/// What is wrong, by where it happens.
#[derive(Debug, Clone, Copy)]
pub enum Step {
    /// Nothing is.
    Nothing,
    /// The board is moved about too little.
    Motion(fn(&mut Motion)),
    /// Board or noise throughout.
    Scene(fn(&mut SceneSettings)),
    /// Single takes.
    Session(fn(&mut Session, &mut ChaCha8Rng)),
    /// What was written down of a faultless session.
    Written(fn(&mut Recording, &mut ChaCha8Rng)),
}

/// A fault.
#[derive(Debug, Clone, Copy)]
pub struct Fault {
    /// For tables and arguments.
    pub name: &'static str,
    /// By which of the contract's codes a program may name it first; none if there is nothing to name.
    pub codes: &'static [&'static str],
    /// Whether no faultless recording by some other rig, of some other board, looks like it.
    pub is_visible: bool,
    /// The only way of showing the board that has it, if not both have.
    pub only: Option<Poses>,
    /// Whether it begins with the second half of the poses.
    pub is_half_way: bool,
    /// How it is planted.
    pub step: Step,
}

/// Nothing is wrong.
pub const FAULTLESS: Fault = fault("none", &[], Step::Nothing);

/// A fault that the data show.
pub(super) const fn fault(name: &'static str, codes: &'static [&'static str], step: Step) -> Fault {
    Fault {
        name,
        codes,
        is_visible: true,
        only: None,
        is_half_way: false,
        step,
    }
}

/// One that some other rig or board would show without a fault.
pub(super) const fn unseen(
    name: &'static str,
    codes: &'static [&'static str],
    step: Step,
) -> Fault {
    Fault {
        is_visible: false,
        ..fault(name, codes, step)
    }
}

/// One that begins with the second half of the poses.
pub(super) const fn half_way(
    name: &'static str,
    codes: &'static [&'static str],
    step: Step,
) -> Fault {
    Fault {
        is_half_way: true,
        ..fault(name, codes, step)
    }
}

/// One that only a stage can have.
pub(super) const fn on_stage(fault: Fault) -> Fault {
    Fault {
        only: Some(Poses::Stage),
        ..fault
    }
}

/// Poses that a fault of some poses has.
pub(super) const SOME: usize = 3;

/// [`SOME`] different poses; the first one, which is the datum, is not among them.
pub(super) fn some_poses(pose_count: usize, rng: &mut ChaCha8Rng) -> Vec<usize> {
    let mut left: Vec<usize> = (1..pose_count).collect();
    let mut drawn = Vec::new();
    while drawn.len() < SOME && !left.is_empty() {
        let idx = (random::uniform(rng) * left.len() as f64) as usize;
        drawn.push(left.swap_remove(idx.min(left.len() - 1)));
    }
    drawn
}
