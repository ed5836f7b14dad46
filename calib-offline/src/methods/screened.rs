//! The views that all methods are given when they are compared.

use super::MethodError;
use super::method::{Given, JointFound};
use calib_estimate::adjust::Observations;
use calib_estimate::init::rig::start_rig;
use calib_estimate::joint::estimate_screened;
use std::collections::BTreeMap;

/// Views that agree with each other, as the joint estimate finds them.
#[derive(Debug)]
pub struct Screened {
    /// The views.
    pub observations: Observations,
    /// The joint estimate that came of it on the way.
    pub joint: Result<JointFound, MethodError>,
}

impl Screened {
    /// Screens the views offered. Where there is no joint estimate they are taken as its start left
    /// them, and without even a start as they were offered.
    pub fn of(offered: &Observations) -> Self {
        let start = match start_rig(offered) {
            Ok(start) => start,
            Err(error) => {
                return Self {
                    observations: offered.clone(),
                    joint: Err(error.into()),
                };
            }
        };
        let started = start.observations.clone();
        match estimate_screened(offered, start) {
            Ok(found) => Self {
                observations: found.0.observations.clone(),
                joint: Ok(found),
            },
            Err(error) => Self {
                observations: started,
                joint: Err(error.into()),
            },
        }
    }

    /// For a method.
    pub fn given<'a>(
        &'a self,
        names: &'a [String],
        placements: &'a BTreeMap<usize, usize>,
    ) -> Given<'a> {
        Given {
            observations: &self.observations,
            names,
            placements,
            joint: Some(&self.joint),
        }
    }
}
