//! One camera's tables tried so far: none is fitted, sampled or proven twice, whatever bounds are asked for.

use super::encode::BlobParts;
use super::packed::Tried;
use super::proof::{self, Proof, Rays};
use super::quantized::{Number, OffsetPredictor, Predictors};
use super::settings::PackSettings;
use super::sizes::knot_count;
use super::table::Table;
use super::work::Work;
use super::{AlignedBytes, PackError, patches};
use calib_rays::field::CalibratedCamera;
use calib_rays::progress::{Progress, Silent};
use ray_runtime::format::{Encoding, Form};
use ray_runtime::{OpenError, RayBlob};
use std::collections::BTreeMap;

/// Pixels compared along the longer side of the sensor during the search.
const SAMPLE_ALONG_LONGER_SIDE: usize = 160;
/// With more calibrated pixels than this, a coarse proof comes before that of every pixel,
const COARSE_ABOVE_PX: u64 = 4_000_000;
/// of about this many: it refuses most tables that the sample let pass.
const COARSE_PX: u64 = 1_000_000;

/// What a table is made of; its cells are searched.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Plan {
    /// A cubic for each cell.
    Patches,
    /// A polynomial and quantized knots.
    Quantized {
        /// Of the direction's polynomial.
        degree: u8,
        /// Of the direction's knots.
        number: Number,
    },
}

/// All that a camera's table follows from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct TableKey {
    plan: Plan,
    cells: [u32; 2],
    offset: Option<OffsetPredictor>,
}

impl TableKey {
    /// Cells along u and v.
    pub fn cells(&self) -> [u32; 2] {
        self.cells
    }
}

/// What is known of a table.
struct Trial {
    /// With the errors of a sample of the pixels.
    tried: Tried,
    /// Kept if it held a bound that was asked for.
    table: Option<Table>,
    edges: Option<Proof>,
    /// Of some of the pixels and the edges.
    coarse: Option<Proof>,
    /// Of every pixel and the edges.
    full: Option<Proof>,
}

/// Attempts on one camera.
pub struct Trials<'a> {
    /// The camera.
    pub camera: &'a CalibratedCamera,
    /// What it has cost.
    pub work: Work,
    settings: PackSettings,
    px_per_mm: f64,
    predictors: Predictors<'a>,
    known: BTreeMap<TableKey, Trial>,
    progress: &'a dyn Progress,
}

impl<'a> Trials<'a> {
    /// Nothing is tried yet.
    ///
    /// # Errors
    /// [`PackError::Field`].
    pub fn new(
        camera: &'a CalibratedCamera,
        settings: &PackSettings,
        progress: &'a dyn Progress,
    ) -> Result<Self, PackError> {
        Ok(Self {
            camera,
            work: Work::default(),
            settings: *settings,
            px_per_mm: proof::usual_px_per_mm(camera, settings.working_distance_mm),
            predictors: Predictors::new(camera)?,
            known: BTreeMap::new(),
            progress,
        })
    }

    /// Prepares for tables within a bound.
    pub fn set_bound(&mut self, bound_px: f64) {
        self.predictors.set_bound(bound_px / self.px_per_mm);
    }

    /// The table of a plan with these cells, within the bound that was set last.
    pub fn key(&self, plan: Plan, cells: [u32; 2]) -> TableKey {
        let offset = match plan {
            Plan::Patches => None,
            Plan::Quantized { .. } => self.predictors.offset(),
        };
        TableKey {
            plan,
            cells,
            offset,
        }
    }

    /// Bytes of that table.
    pub fn byte_count(&self, plan: Plan, cells: [u32; 2]) -> usize {
        match plan {
            Plan::Quantized { degree, number } => self.predictors.byte_count(degree, number, cells),
            Plan::Patches => {
                let encoding = Encoding {
                    form: Form::Patches,
                    is_central: self.camera.field.is_central(),
                };
                encoding.table_len(cells).unwrap_or(usize::MAX)
            }
        }
    }

    /// The table's worst error at a sample of the pixels, px, once it was packed alone; `None` if it is not
    /// known and there is no more to spend.
    ///
    /// # Errors
    /// What fitting and opening give.
    pub fn error_px(&mut self, key: TableKey, bound_px: f64) -> Result<Option<f64>, PackError> {
        if let Some(trial) = self.known.get(&key) {
            return Ok(Some(trial.tried.error_px));
        }
        if !self.work.afford_fit(fit_steps(key)) {
            return Ok(None);
        }
        let table = self.fit(key)?;
        let proof = prove_sample(self.camera, &self.settings, &table)?;
        self.progress.advance();
        let tried = Tried {
            encoding: table.encoding,
            cells: key.cells,
            bytes: table.bytes.len(),
            error_px: proof.worst_error_px,
            error_mm: proof.worst_error_mm,
        };
        let trial = Trial {
            tried,
            table: (tried.error_px <= bound_px).then_some(table),
            edges: None,
            coarse: None,
            full: None,
        };
        self.known.insert(key, trial);
        Ok(Some(tried.error_px))
    }

    /// The table itself.
    ///
    /// # Errors
    /// What fitting gives.
    pub fn table(&mut self, key: TableKey) -> Result<Table, PackError> {
        let kept = self.known.get(&key).and_then(|trial| trial.table.clone());
        kept.map_or_else(|| self.fit(key), Ok)
    }

    fn fit(&mut self, key: TableKey) -> Result<Table, PackError> {
        match key.plan {
            Plan::Patches => patches::fit(self.camera, key.cells),
            Plan::Quantized { degree, number } => {
                self.predictors.table(degree, number, key.cells, key.offset)
            }
        }
    }

    /// The proof of a table that was tried, as the camera of this index in a blob: of every pixel, or as soon as
    /// some are off by more than `max_error_px`, of those. `None` if there is no more to spend.
    pub fn prove(
        &mut self,
        key: TableKey,
        (blob, camera_idx): (&RayBlob<'_>, usize),
        max_error_px: f64,
    ) -> Option<Proof> {
        let calibrated_px = self.calibrated_px();
        let trial = self.known.get_mut(&key)?;
        if trial.full.is_some() {
            return trial.full;
        }
        let is_refused = |proof: &Proof| proof.worst_error_px > max_error_px;
        if let Some(refused) = trial.coarse.filter(is_refused) {
            return Some(refused);
        }
        let distance_mm = self.settings.working_distance_mm;
        let (camera, progress) = (self.camera, self.progress);
        let rays = Rays::Float(blob, camera_idx);
        let edges = *trial
            .edges
            .get_or_insert_with(|| proof::prove_edges(camera, rays, distance_mm));
        let prove =
            |stride| proof::prove(camera, rays, distance_mm, stride, progress).merged(edges);
        let stride = coarse_stride(calibrated_px);
        let coarse_px = calibrated_px / (stride * stride) as u64;
        if stride > 1 && trial.coarse.is_none() && self.work.afford_proof(coarse_px, calibrated_px)
        {
            let coarse = prove(stride);
            trial.coarse = Some(coarse);
            if is_refused(&coarse) {
                return Some(coarse);
            }
        }
        if !self.work.afford_full_proof(calibrated_px) {
            return None;
        }
        trial.full = Some(prove(1));
        trial.full
    }

    /// Pixels of the calibrated area.
    pub fn calibrated_px(&self) -> u64 {
        let sensor = self.camera.field.sensor;
        let all = f64::from(sensor.width) * f64::from(sensor.height);
        (all * self.camera.coverage.covered_share()).ceil() as u64
    }

    /// Tables tried, from small to large.
    pub fn tried(&self) -> Vec<Tried> {
        let mut tried: Vec<Tried> = self.known.values().map(|trial| trial.tried).collect();
        tried.sort_by(|a, b| {
            a.bytes
                .cmp(&b.bytes)
                .then(a.error_px.total_cmp(&b.error_px))
        });
        tried
    }

    /// The smallest table that held a bound on the sample.
    pub fn smallest_within(&self, bound_px: f64) -> Option<TableKey> {
        let tried = self.known.iter();
        let holds = tried.filter(|(_, trial)| trial.tried.error_px <= bound_px);
        holds
            .min_by_key(|(_, trial)| trial.tried.bytes)
            .map(|(key, _)| *key)
    }

    /// The smallest table every pixel of which is proven to hold a bound.
    pub fn smallest_proven(&self, bound_px: f64) -> Option<TableKey> {
        let proven = self.proven();
        let holds = proven.filter(|(_, _, proof)| proof.worst_error_px <= bound_px);
        holds
            .min_by_key(|(_, trial, _)| trial.tried.bytes)
            .map(|(key, ..)| key)
    }

    /// The proven table with the smallest error.
    pub fn best_proven(&self) -> Option<(TableKey, Proof)> {
        self.proven()
            .map(|(key, _, proof)| (key, proof))
            .min_by(|(_, a), (_, b)| a.worst_error_px.total_cmp(&b.worst_error_px))
    }

    /// The table with the smallest error on the sample.
    pub fn best_tried(&self) -> Option<(TableKey, Tried)> {
        let tried = self.known.iter().map(|(key, trial)| (*key, trial.tried));
        tried.min_by(|(_, a), (_, b)| a.error_px.total_cmp(&b.error_px))
    }

    fn proven(&self) -> impl Iterator<Item = (TableKey, &Trial, Proof)> {
        self.known
            .iter()
            .filter_map(|(key, trial)| Some((*key, trial, trial.full?)))
    }
}

/// What a fit takes, in steps of some 0.1 ns.
fn fit_steps(key: TableKey) -> u64 {
    let [u, v] = key.cells.map(u64::from);
    match key.plan {
        Plan::Patches => u * v * STEPS_PER_PATCH,
        Plan::Quantized {
            number: Number::None,
            ..
        } => STEPS_PER_POLYNOMIAL,
        Plan::Quantized { .. } => {
            let half_bandwidth = 3 * (u.min(v) + 3) + 3;
            let factor = u64::from(knot_count(key.cells)) * half_bandwidth * half_bandwidth;
            STEPS_PER_POLYNOMIAL + u * v * STEPS_PER_CELL + factor
        }
    }
}

/// A triangle of 59 by 10.
const STEPS_PER_PATCH: u64 = 100_000;
/// A triangle of some 4000 by 55 at most, and the comparison of the sample.
const STEPS_PER_POLYNOMIAL: u64 = 100_000_000;
/// The equations of 16 points.
const STEPS_PER_CELL: u64 = 80_000;

/// Every how many pixels a coarse proof compares, along both axes; odd, so that it meets every phase of a grid with
/// an even cell size; 1 for a sensor whose proof is quick.
fn coarse_stride(calibrated_px: u64) -> usize {
    if calibrated_px <= COARSE_ABOVE_PX {
        return 1;
    }
    (calibrated_px.div_ceil(COARSE_PX)).isqrt() as usize | 1
}

/// The worst error of a sample of the pixels, through the runtime; infinite if it refuses the table's numbers:
/// where a small part of the sensor is calibrated, a polynomial of high degree over all of it takes huge coefficients.
fn prove_sample(
    camera: &CalibratedCamera,
    settings: &PackSettings,
    table: &Table,
) -> Result<Proof, PackError> {
    let parts = BlobParts {
        identity: settings.identity,
        frame: String::new(),
        max_error_px: 1.0,
        working_distance_mm: settings.working_distance_mm as f32,
        self_tests: Vec::new(),
        pairs: Vec::new(),
        match_noise: None,
        arithmetic: None,
    };
    let bytes = AlignedBytes::from(parts.encode_cameras(&[(camera, table)])?.as_slice());
    let blob = match RayBlob::open(&bytes) {
        Err(OpenError::BadNumber {
            table: ray_runtime::Table::Grid,
            ..
        }) => return Ok(Proof::refused()),
        opened => opened?,
    };
    let sensor = camera.field.sensor;
    // Odd, so that the sample meets every phase of a grid with an even cell size.
    let stride = (sensor.width.max(sensor.height) as usize / SAMPLE_ALONG_LONGER_SIDE) | 1;
    let distance_mm = settings.working_distance_mm;
    Ok(proof::prove(
        camera,
        Rays::Float(&blob, 0),
        distance_mm,
        stride,
        &Silent,
    ))
}
