//! How strongly smoothness holds, from the data themselves: hyperparameters by the evidence, which is
//! the marginal likelihood of the data (METHOD 2.4, 9A).

use crate::adjust::equations::knots::{thin_plate, thin_plate_ln_determinant};
use crate::adjust::equations::schur_complement::SchurComplement;
use crate::adjust::model::Layout;
use crate::adjust::priors::{CameraPriors, Priors};
use crate::adjust::{CameraModel, Model};
use calib_rays::field::knot_order::KnotOrder;
use calib_rays::field::structured::{PLAIN_DEGREE, TILT_DEGREE};
use calib_rays::numerics::banded::BandedMatrix;
use nalgebra::DVector;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::f64::consts::{PI, TAU};
use std::sync::Arc;

/// Inverse variances at the start: directions may move by 1e-3 rad, an offset by 1e-3 mm, a
/// spline's second differences by what residuals are then. The offset starts nearly central on purpose: started free it
/// absorbs what a spline has not resolved yet and is slow to let go (METHOD 2.4).
const START_DIRECTION: f64 = 1e6;
const START_OFFSET: f64 = 1e6;
/// Where offsets go first: they may move by 0.1 mm.
const FREE_OFFSET: f64 = 1e2;
/// What a plain lens has beyond a rotationally symmetric one is expected to be so large, RMS over
/// the sensor, as a share of the square of half the sensor's longer side in focal lengths; and the
/// expectation counts as much as one number more (METHOD 2.9).
const PLAIN_SHARE: f64 = 1e-3;
const PLAIN_COUNT: f64 = 1.0;
/// Where no base lens was fitted yet, its center is not known either: 0.01 in s.
const PLAIN_START: f64 = 1e4;
/// Beyond this a parameter is held to round-off and a larger weight changes nothing.
const MOST_PRECISION: f64 = 1e14;
/// Longest step of a weight's logarithm in one update.
const LONGEST_LOG_STEP: f64 = 7.0;
/// Steps grow by this factor as long as they keep their sign: plain updates creep when a weight
/// wants to be infinite.
const STEP_GROWTH: f64 = 1.6;
const MOST_GROWTH: f64 = 5.0;
/// Random vectors behind the trace of a spline's covariance; their seed is fixed, so that the same
/// input gives the same bytes. 16 leave 1 to 2 % of noise on a weight, which nothing feels.
const PROBES: usize = 16;
const PROBE_SEED: u64 = 0x5eed;

/// A family of parameters that share one smoothness weight.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Family {
    /// Directions of the field's polynomial of this total degree, beyond the structured ones; of
    /// degree 1, aspect and decentering; of degree 0, skew and tilt.
    Direction(usize),
    /// The spline deviation of the direction.
    Spline,
    /// Radial offset terms, as of a pupil that moves with the angle.
    Pupil,
    /// Other offset terms of this total degree (of the core degree and below for the core degree).
    Offset(usize),
}

/// One family of one camera with its weight.
#[derive(Debug, Clone)]
struct Group {
    camera_idx: usize,
    family: Family,
    /// Which of the camera's amounts belong; empty for a spline (all do).
    members: Vec<usize>,
    precision: f64,
    /// What was expected of the weight: as much as so many numbers of such a mean square. Without
    /// that a weight runs to nothing or to infinity where the data determine none of its numbers.
    expected: Expected,
    /// Whether it is held at zero for good.
    held: bool,
    /// What the weight of a spline is of.
    energy: Option<Arc<SplineEnergy>>,
    last_log_step: f64,
    growth: f64,
    effective: f64,
}

/// A Gamma density of a weight beforehand.
#[derive(Debug, Clone, Copy, Default)]
struct Expected {
    count: f64,
    mean_square: f64,
}

impl Expected {
    fn of(family: Family, camera: &CameraModel) -> Self {
        if !is_structured(family) {
            return Self::default();
        }
        let sensor = camera.field.sensor;
        let half = f64::from(sensor.width.max(sensor.height)) / 2.0 / camera.field.base.focal_px;
        Self {
            count: PLAIN_COUNT,
            mean_square: (PLAIN_SHARE * half * half).powi(2),
        }
    }

    /// Twice the logarithm of what the weight of a group that is not held adds to the evidence: its
    /// density (over its logarithm) times the width that is left to it, which Laplace's
    /// approximation gives. So models with and without the group compare.
    fn ln_evidence_twice(&self, group: &Group) -> f64 {
        if group.held || self.count == 0.0 {
            return 0.0;
        }
        // Of half a number, as Gamma(1/2) is the root of pi.
        let scaled = group.precision * self.count * self.mean_square / 2.0;
        let width_squared = 2.0 / (group.effective + self.count);
        scaled.ln() - 2.0 * scaled - PI.ln() + (TAU * width_squared).ln()
    }
}

/// The thin-plate energy of a grid, with what is asked of it in every round.
#[derive(Debug)]
struct SplineEnergy {
    order: KnotOrder,
    thin_plate: Arc<BandedMatrix>,
    ln_determinant: f64,
    probes: Vec<DVector<f64>>,
    /// The energy times each probe.
    weighted: Vec<DVector<f64>>,
}

impl SplineEnergy {
    fn new(order: KnotOrder) -> Self {
        let thin_plate = thin_plate(&order);
        let probes = probes(thin_plate.size());
        Self {
            weighted: probes.iter().map(|probe| thin_plate.times(probe)).collect(),
            probes,
            ln_determinant: thin_plate_ln_determinant(&order),
            thin_plate: Arc::new(thin_plate),
            order,
        }
    }
}

/// The smoothness weights of all cameras.
#[derive(Debug, Clone, Default)]
pub struct Smoothness {
    groups: Vec<Group>,
}

/// What the evidence found for one family.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SmoothnessFound {
    /// Index of the camera.
    pub camera_idx: usize,
    /// The family.
    pub family: Family,
    /// Number of parameters.
    pub parameters: usize,
    /// Of these, how many the data determine.
    pub effective: f64,
    /// Inverse variance of a parameter, 1/rad^2 or 1/mm^2.
    pub precision: f64,
}

impl Smoothness {
    /// Weights for everything that a model has, each family at its start.
    pub fn new(model: &Model) -> Self {
        let mut smoothness = Self::default();
        smoothness.cover(model, 1.0);
        smoothness
    }

    /// The same with every weight so large that only structured directions move.
    pub fn structured_only(model: &Model) -> Self {
        let mut smoothness = Self::new(model);
        for group in &mut smoothness.groups {
            group.precision = match group.family {
                Family::Direction(PLAIN_DEGREE) => PLAIN_START,
                Family::Direction(TILT_DEGREE) => 1.0 / group.expected.mean_square,
                _ => MOST_PRECISION,
            };
        }
        smoothness
    }

    /// Holds the polynomials of directions of one total degree, or of all, of all cameras at zero;
    /// `false` if none was free. What a plain lens has stays.
    pub fn hold_directions(&mut self, degree: Option<usize>) -> bool {
        let mut any = false;
        for group in &mut self.groups {
            if let Family::Direction(own) = group.family
                && own != PLAIN_DEGREE
                && degree.is_none_or(|degree| degree == own)
            {
                any |= group.precision < MOST_PRECISION;
                group.precision = MOST_PRECISION;
                group.held = true;
                group.effective = 0.0;
            }
        }
        any
    }

    /// Fits the families to a model: known ones keep their weights, new ones get their start,
    /// those that are gone are dropped. Over a change of grid, a spline's weight is scaled by the
    /// fourth power of the spacing, as second differences scale by its square.
    ///
    /// `variance_px2` is that of the residuals so far, per axis: what a new spline may follow.
    pub fn cover(&mut self, model: &Model, variance_px2: f64) {
        let old = std::mem::take(&mut self.groups);
        for (camera_idx, camera) in model.cameras.iter().enumerate() {
            for (family, members) in families(camera) {
                let known = old
                    .iter()
                    .find(|g| g.camera_idx == camera_idx && g.family == family);
                let expected = Expected::of(family, camera);
                let start = match family {
                    Family::Direction(PLAIN_DEGREE | TILT_DEGREE) => 1.0 / expected.mean_square,
                    Family::Direction(_) => START_DIRECTION,
                    Family::Spline => camera.field.base.focal_px.powi(2) / variance_px2,
                    Family::Pupil | Family::Offset(_) => START_OFFSET,
                };
                let energy = camera
                    .knot_order()
                    .filter(|_| family == Family::Spline)
                    .map(|order| {
                        // The cameras of a rig often have the same sensor and so the same grid.
                        old.iter()
                            .chain(&self.groups)
                            .filter_map(|group| group.energy.as_ref())
                            .find(|energy| energy.order == order)
                            .map_or_else(|| Arc::new(SplineEnergy::new(order)), Arc::clone)
                    });
                self.groups.push(Group {
                    camera_idx,
                    family,
                    members,
                    precision: known.map_or(start, |g| g.precision * g.rescaled(energy.as_ref())),
                    expected,
                    held: known.is_some_and(|g| g.held),
                    energy,
                    last_log_step: 0.0,
                    growth: 1.0,
                    effective: 0.0,
                });
            }
        }
    }

    /// Frees offsets and holds back the penalized polynomials of directions, to start from.
    pub fn put_offsets_first(&mut self) {
        for group in &mut self.groups {
            group.precision = match group.family {
                Family::Spline | Family::Direction(PLAIN_DEGREE | TILT_DEGREE) => continue,
                Family::Direction(_) => MOST_PRECISION,
                Family::Pupil | Family::Offset(_) => FREE_OFFSET,
            };
        }
    }

    /// As priors of an adjustment.
    pub fn priors(&self, model: &Model, board: f64) -> Priors {
        let mut cameras: Vec<_> = model
            .cameras
            .iter()
            .enumerate()
            .map(|(camera_idx, camera)| {
                let mut own = self.groups.iter().filter(|g| g.camera_idx == camera_idx);
                let energy = own.find_map(|group| group.energy.as_ref());
                let thin_plate = energy.map(|energy| Arc::clone(&energy.thin_plate));
                CameraPriors::with_energy(camera, thin_plate)
            })
            .collect();
        for group in &self.groups {
            let priors = &mut cameras[group.camera_idx];
            let target = match group.family {
                Family::Direction(_) => &mut priors.direction,
                Family::Pupil | Family::Offset(_) => &mut priors.offset,
                Family::Spline => {
                    priors.spline = group.precision;
                    continue;
                }
            };
            for member in &group.members {
                target[*member] = group.precision;
            }
        }
        Priors { cameras, board }
    }

    /// One fixed-point step of every weight (MacKay): `lambda <- gamma / energy` with
    /// `gamma = dim - lambda tr(S covariance)`, the number of parameters that the data determine,
    /// and `energy = a^T S a`.
    pub fn update(&mut self, model: &Model, layout: &Layout, reduced: &SchurComplement) {
        let variances = reduced.marginal_variances();
        for group in self.groups.iter_mut().filter(|group| !group.held) {
            let camera = &model.cameras[group.camera_idx];
            let (dimension, trace, energy) = match group.family {
                Family::Spline => {
                    let Some(energy) = &group.energy else {
                        continue;
                    };
                    let amounts = camera.spline_amounts();
                    (
                        amounts.len() as f64,
                        reduced.spline_trace(group.camera_idx, &energy.probes, &energy.weighted),
                        energy.thin_plate.times(&amounts).dot(&amounts),
                    )
                }
                Family::Direction(_) => {
                    let amounts = camera.basis.amounts(&camera.field.direction.polynomial);
                    let start = layout.cameras[group.camera_idx].direction.start;
                    member_sums(&group.members, &amounts, start, &variances)
                }
                Family::Pupil | Family::Offset(_) => {
                    let amounts = camera.offset_amounts();
                    let start = layout.cameras[group.camera_idx].offset.start;
                    member_sums(&group.members, &amounts, start, &variances)
                }
            };
            group.step(dimension, trace, energy);
        }
    }

    /// How many of the parameters that are held back the data determine, and how many there are.
    pub fn effective(&self, model: &Model) -> (f64, usize) {
        let sum = self.groups.iter().map(|g| g.effective).sum();
        let count = self
            .groups
            .iter()
            .map(|g| parameter_count(g, &model.cameras[g.camera_idx]))
            .sum();
        (sum, count)
    }

    /// `sum dim ln lambda + ln det S`: the priors' share of twice the log evidence.
    pub fn ln_prior_determinant(&self, model: &Model) -> f64 {
        self.groups
            .iter()
            .map(|group| {
                let count = parameter_count(group, &model.cameras[group.camera_idx]) as f64;
                let energy = group.energy.as_ref().map_or(0.0, |e| e.ln_determinant);
                let expected = group.expected.ln_evidence_twice(group);
                count * group.precision.ln() + energy + expected
            })
            .sum()
    }

    /// What was found, per camera and family.
    pub fn found(&self, model: &Model) -> Vec<SmoothnessFound> {
        self.groups
            .iter()
            .map(|group| SmoothnessFound {
                camera_idx: group.camera_idx,
                family: group.family,
                parameters: parameter_count(group, &model.cameras[group.camera_idx]),
                effective: group.effective,
                precision: group.precision,
            })
            .collect()
    }
}

impl Group {
    /// What a spline's weight is multiplied by if its grid changes to that of `next`.
    fn rescaled(&self, next: Option<&Arc<SplineEnergy>>) -> f64 {
        let cells = |energy: &Arc<SplineEnergy>| energy.order.cells_along_longer_side() as f64;
        match (&self.energy, next) {
            (Some(now), Some(next)) => (cells(next) / cells(now)).powi(4),
            _ => 1.0,
        }
    }

    fn step(&mut self, dimension: f64, trace: f64, energy: f64) {
        self.effective = (dimension - self.precision * trace).clamp(1e-6 * dimension, dimension);
        let Expected { count, mean_square } = self.expected;
        let energy = (energy + count * mean_square).max(f64::MIN_POSITIVE);
        let wanted = ((self.effective + count) / energy).min(MOST_PRECISION);
        let log_step = (wanted / self.precision).ln();
        self.growth = if log_step * self.last_log_step > 0.0 {
            (self.growth * STEP_GROWTH).min(MOST_GROWTH)
        } else {
            1.0
        };
        self.last_log_step = log_step;
        let taken = (log_step * self.growth).clamp(-LONGEST_LOG_STEP, LONGEST_LOG_STEP);
        self.precision = (self.precision * taken.exp()).min(MOST_PRECISION);
    }
}

/// Dimension, trace of the covariance and energy of some amounts.
fn member_sums(
    members: &[usize],
    amounts: &DVector<f64>,
    start: usize,
    variances: &DVector<f64>,
) -> (f64, f64, f64) {
    let trace = members.iter().map(|k| variances[start + k]).sum();
    let energy = members.iter().map(|k| amounts[*k].powi(2)).sum();
    (members.len() as f64, trace, energy)
}

fn parameter_count(group: &Group, camera: &CameraModel) -> usize {
    match group.family {
        Family::Spline => camera.spline_amounts().len(),
        _ => group.members.len(),
    }
}

/// What every lens may use, held by what is expected of lenses and not by smoothness alone.
fn is_structured(family: Family) -> bool {
    matches!(family, Family::Direction(PLAIN_DEGREE | TILT_DEGREE))
}

/// The families of a camera with their members.
fn families(camera: &CameraModel) -> Vec<(Family, Vec<usize>)> {
    let mut families: Vec<(Family, Vec<usize>)> = Vec::new();
    let mut put = |family: Family, member: usize| match families.iter_mut().find(|f| f.0 == family)
    {
        Some((_, members)) => members.push(member),
        None => families.push((family, vec![member])),
    };
    for (direction, degree) in camera.basis.penalized_degrees().iter().enumerate() {
        if let Some(degree) = degree {
            put(Family::Direction(*degree), direction);
        }
    }
    if let Some((_, basis)) = camera.offset() {
        for (direction, degree) in basis.penalized_degrees().iter().enumerate() {
            put(degree.map_or(Family::Pupil, Family::Offset), direction);
        }
    }
    if camera.knot_order().is_some() {
        families.push((Family::Spline, Vec::new()));
    }
    families
}

/// Fixed random signs.
fn probes(len: usize) -> Vec<DVector<f64>> {
    let mut rng = ChaCha8Rng::seed_from_u64(PROBE_SEED);
    (0..PROBES)
        .map(|_| {
            let mut word = 0u32;
            DVector::from_fn(len, |k, _| {
                if k % 32 == 0 {
                    word = rng.next_u32();
                }
                let bit = word & 1;
                word >>= 1;
                if bit == 1 { 1.0 } else { -1.0 }
            })
        })
        .collect()
}
