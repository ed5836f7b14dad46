//! Standard scenes with their estimates, made once for all tests that ask for them.

use super::against_truth::{run_scene, scene};
use super::halves::checked;
use calib_estimate::init::screening::Finding;
use calib_estimate::joint::Estimate;
use calib_judge::CrossChecks;
use calib_judge::half_data::{HalfData, HalfDataCheck};
use calib_simulate::{OpticsKind, Scene};
use std::sync::{Mutex, OnceLock, PoisonError};

/// A scene of 0.05 px of noise and what the whole way from corners to the screened estimate gave.
pub struct Standard {
    pub scene: Scene,
    pub estimate: Estimate,
    pub findings: Vec<Finding>,
    checks: OnceLock<CrossChecks>,
}

impl Standard {
    /// All checks of the estimate.
    pub fn checks(&self) -> &CrossChecks {
        self.checks
            .get_or_init(|| checked(&self.scene, &self.estimate))
    }

    /// The halves of its poses.
    pub fn halves(&self) -> &HalfData {
        match &self.checks().half_data {
            HalfDataCheck::Compared(halves) => halves,
            HalfDataCheck::Skipped(reason) => panic!("{reason:?}"),
        }
    }
}

type Made = ((OpticsKind, u64), &'static OnceLock<Standard>);

/// The standard scene of these optics and of this draw of the noise.
pub fn standard(optics: OpticsKind, seed: u64) -> &'static Standard {
    static MADE: Mutex<Vec<Made>> = Mutex::new(Vec::new());
    let place = {
        let mut made = MADE.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, place)) = made.iter().find(|(key, _)| *key == (optics, seed)) {
            place
        } else {
            let place: &OnceLock<Standard> = Box::leak(Box::default());
            made.push(((optics, seed), place));
            place
        }
    };
    place.get_or_init(|| {
        let scene = scene(optics, |settings| settings.seed = seed);
        let (estimate, findings) = run_scene(&scene);
        Standard {
            scene,
            estimate,
            findings,
            checks: OnceLock::new(),
        }
    })
}
