//! The table that suits best among those that hold the bound.

use super::encode::BlobParts;
use super::packed::{CurvePoint, Tried};
use super::proof::{self, Proof};
use super::quantized::{Number, Predictors};
use super::settings::{PackSettings, Prefer};
use super::table::Table;
use super::{AlignedBytes, PackError, patches};
use calib_rays::field::CalibratedCamera;
use calib_rays::field::spline::SplineGrid;
use ray_runtime::format::{Encoding, Form};
use ray_runtime::{OpenError, RayBlob};
use std::iter;

/// A camera's table, and what else was tried.
pub struct Choice {
    /// The table.
    pub table: Table,
    /// Tables tried, with the errors of a sample of the pixels; from small to large.
    pub tried: Vec<Tried>,
}

/// The finest grid has cells of this many pixels: finer ones only store noise.
const SMALLEST_CELL_PX: f64 = 6.0;
/// Most cells along the longer side.
const MOST_CELLS: u32 = 192;
/// Errors below this may be round-off; measured are 0.0001 px with 1280 px and 0.0006 px with 6000.
const ROUND_OFF_PX: f64 = 0.002;
/// Pixels compared along the longer side of the sensor during the search.
const SAMPLE_ALONG_LONGER_SIDE: usize = 160;

/// The sizes worth trying, from coarse to fine: any number of cells along the longer side, and
/// the grid of the field's own spline with its subdivisions, on which the spline is reproduced
/// exactly where other grids leave an error.
fn sizes(camera: &CalibratedCamera) -> Vec<[u32; 2]> {
    let sensor = camera.field.sensor;
    let longer = f64::from(sensor.width.max(sensor.height));
    let most = ((longer / SMALLEST_CELL_PX) as u32).clamp(4, MOST_CELLS);
    let mut sizes: Vec<[u32; 2]> = (2..=most)
        .map(|cells| {
            let grid = SplineGrid::with_spacing(sensor, longer / f64::from(cells));
            [grid.cells_u as u32, grid.cells_v as u32]
        })
        .collect();
    for grid in own_grids(camera) {
        let (u, v) = (grid.cells_u as u32, grid.cells_v as u32);
        let multiples = (1..=4).map(|k| [k * u, k * v]);
        sizes.extend(multiples.filter(|[u, v]| *u.max(v) <= MOST_CELLS));
    }
    sizes.sort_by_key(|cells| (knot_count(*cells), *cells));
    sizes.dedup();
    sizes
}

/// The grids of the field's own splines.
fn own_grids(camera: &CalibratedCamera) -> impl Iterator<Item = SplineGrid> {
    let maps = iter::once(&camera.field.direction).chain(&camera.field.offset);
    maps.filter_map(|map| map.spline.as_ref())
        .map(|spline| spline.grid)
}

fn knot_count([u, v]: [u32; 2]) -> u32 {
    (u + 3) * (v + 3)
}

/// What a table is made of; its cells are searched.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Plan {
    Patches,
    Quantized { degree: u8, number: Number },
}

/// Tried in this order for the fewest bytes: polynomials alone; knots of i16, for which the cubic is as
/// good as any, since their range is not what limits them; then knots of i8, half as large, which want
/// little left to hold.
const SMALL_PLANS: [Plan; 8] = [
    quantized(3, Number::None),
    quantized(5, Number::None),
    quantized(7, Number::None),
    quantized(9, Number::None),
    quantized(3, Number::Two),
    quantized(7, Number::One),
    quantized(5, Number::One),
    quantized(3, Number::One),
];

const fn quantized(degree: u8, number: Number) -> Plan {
    Plan::Quantized { degree, number }
}

/// Searches a table within `bound_px` on a sample of the pixels: of the form that is looked up
/// fastest or takes the fewest bytes, and of that form the smallest.
///
/// # Errors
/// [`PackError::BoundNotReached`] and what fitting and opening give.
pub fn choose(
    camera: &CalibratedCamera,
    settings: &PackSettings,
    bound_px: f64,
) -> Result<Choice, PackError> {
    let mut search = Search::new(camera, settings, bound_px)?;
    let mut best: Option<Table> = None;
    let plans: &[Plan] = match settings.prefer {
        Prefer::Speed => &[Plan::Patches],
        Prefer::Size => &SMALL_PLANS,
    };
    for plan in plans {
        let below = best.as_ref().map_or(usize::MAX, |table| table.bytes.len());
        if let Some(table) = search.smallest(*plan, below)? {
            best = Some(table);
        }
    }
    let mut tried = search.tried;
    tried.sort_by(|a, b| {
        a.bytes
            .cmp(&b.bytes)
            .then(a.error_px.total_cmp(&b.error_px))
    });
    if let Some(table) = best {
        return Ok(Choice { table, tried });
    }
    let best = tried
        .iter()
        .min_by(|a, b| a.error_px.total_cmp(&b.error_px));
    Err(PackError::BoundNotReached {
        camera: camera.name.clone(),
        wanted_px: settings.max_error_px,
        best_px: best.map_or(f64::INFINITY, |tried| tried.error_px),
        cells: best.map_or([0, 0], |tried| tried.cells),
    })
}

/// Attempts on one camera.
struct Search<'a> {
    camera: &'a CalibratedCamera,
    settings: &'a PackSettings,
    bound_px: f64,
    predictors: Predictors<'a>,
    sizes: Vec<[u32; 2]>,
    tried: Vec<Tried>,
}

impl<'a> Search<'a> {
    fn new(
        camera: &'a CalibratedCamera,
        settings: &'a PackSettings,
        bound_px: f64,
    ) -> Result<Self, PackError> {
        let px_per_mm = proof::usual_px_per_mm(camera, settings.working_distance_mm);
        Ok(Self {
            camera,
            settings,
            bound_px,
            predictors: Predictors::new(camera, bound_px / px_per_mm)?,
            sizes: sizes(camera),
            tried: Vec::new(),
        })
    }

    /// The smallest table of a plan that holds the bound and has fewer bytes than `below`.
    fn smallest(&mut self, plan: Plan, below: usize) -> Result<Option<Table>, PackError> {
        if let Plan::Quantized {
            number: Number::None,
            ..
        } = plan
        {
            let (table, error_px) = self.attempt(plan, [1, 1])?;
            let holds = error_px <= self.bound_px && table.bytes.len() < below;
            return Ok(holds.then_some(table));
        }
        let sizes = self.sizes.clone();
        let affordable = sizes.partition_point(|cells| self.byte_count(plan, *cells) < below);
        let sizes = &sizes[..affordable];
        let is_own = |[u, v]: [u32; 2]| {
            let (u, v) = (u as usize, v as usize);
            own_grids(self.camera)
                .any(|own| u.is_multiple_of(own.cells_u) && v == u / own.cells_u * own.cells_v)
        };

        // Upwards in steps that the error asks for, never past a size that is likely to be exact.
        let mut errors: Vec<([u32; 2], f64)> = Vec::new();
        let mut idx = 1.min(sizes.len().saturating_sub(1));
        let mut failed_below = 0;
        let mut found = loop {
            let Some(&cells) = sizes.get(idx) else {
                return Ok(None);
            };
            let (table, error_px) = self.attempt(plan, cells)?;
            errors.push((cells, error_px));
            if error_px <= self.bound_px {
                break table;
            }
            if has_stalled(&errors) || !self.can_still_hold(&errors) {
                return Ok(None);
            }
            failed_below = idx + 1;
            let goal = f64::from(knot_count(cells)) * growth(error_px, self.bound_px);
            let is_stop = |k: &usize| f64::from(knot_count(sizes[*k])) >= goal || is_own(sizes[*k]);
            let last = sizes.len() - 1;
            idx = match (idx + 1..sizes.len()).find(is_stop) {
                Some(next) => next,
                None if idx < last => last,
                None => return Ok(None),
            };
        };
        // Downwards by halving; the error falls with the size but for small ripples.
        let (mut low, mut high) = (failed_below, idx);
        while low < high {
            let middle = usize::midpoint(low, high);
            let (table, error_px) = self.attempt(plan, sizes[middle])?;
            if error_px <= self.bound_px {
                high = middle;
                found = table;
            } else {
                low = middle + 1;
            }
        }
        Ok(Some(found))
    }

    fn byte_count(&self, plan: Plan, cells: [u32; 2]) -> usize {
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

    /// Makes a table, packs it alone, and compares a sample of the pixels; the table and the worst
    /// error, px.
    fn attempt(&mut self, plan: Plan, cells: [u32; 2]) -> Result<(Table, f64), PackError> {
        let table = match plan {
            Plan::Patches => patches::fit(self.camera, cells)?,
            Plan::Quantized { degree, number } => self.predictors.table(degree, number, cells)?,
        };
        let proof = prove_sample(self.camera, self.settings, &table)?;
        self.tried.push(Tried {
            encoding: table.encoding,
            cells,
            bytes: table.bytes.len(),
            error_px: proof.worst_error_px,
            error_mm: proof.worst_error_mm,
        });
        Ok((table, proof.worst_error_px))
    }

    /// Whether finer grids may get there: quantized to i8, the error ends at half a step however many
    /// knots there are.
    fn can_still_hold(&self, errors: &[([u32; 2], f64)]) -> bool {
        let [.., (before, before_px), (last, last_px)] = errors else {
            return true;
        };
        knot_count(*last) < 2 * knot_count(*before)
            || *last_px < 0.8 * before_px
            || *last_px > MOST_HOPELESS * self.bound_px
    }
}

/// Errors that stay as they are with twice as many knots are hopeless, unless they are larger than
/// this many bounds: local bumps may stay until a grid is fine enough for them.
const MOST_HOPELESS: f64 = 20.0;

/// The worst error of a sample of the pixels, through the runtime; infinite if it refuses the table's numbers:
/// where a small part of the sensor is calibrated, a polynomial of high degree over all of it takes huge coefficients.
fn prove_sample(
    camera: &CalibratedCamera,
    settings: &PackSettings,
    table: &Table,
) -> Result<Proof, PackError> {
    let parts = BlobParts {
        identity: settings.identity,
        frame: "",
        max_error_px: 1.0,
        working_distance_mm: settings.working_distance_mm as f32,
        self_tests: Vec::new(),
        pairs: Vec::new(),
        match_noise: None,
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
    Ok(proof::prove(camera, &blob, 0, distance_mm, stride))
}

/// By how much the number of knots should grow: the error of a cubic spline falls with the fourth
/// power of the spacing, so with the square of the number of knots. A little less is tried, and
/// at most four times as many.
fn growth(error_px: f64, wanted_px: f64) -> f64 {
    ((error_px / wanted_px).sqrt() * 0.9).clamp(1.05, 4.0)
}

/// Whether finer grids no longer help: the error is as small as the round-off of f32 makes
/// it, and twice as many knots did not lower it. (A large error that stays may be that of
/// local bumps that no grid so far was fine enough for.)
fn has_stalled(errors: &[([u32; 2], f64)]) -> bool {
    let Some(((last, last_px), before)) = errors.split_last() else {
        return false;
    };
    let no_better = |(cells, error_px): &([u32; 2], f64)| {
        knot_count(*last) >= 2 * knot_count(*cells) && *last_px > 0.8 * error_px
    };
    *last_px < ROUND_OFF_PX && before.iter().any(no_better)
}

/// Bytes of all cameras' tables against the worst error of any: for each error that some camera
/// has with some table, the smallest tables with which no camera is worse. From small to large,
/// each with a smaller error than the one before; px and mm are the worst of those tables.
pub fn curve(tried: &[&[Tried]]) -> Vec<CurvePoint> {
    let mut limits: Vec<f64> = tried
        .iter()
        .flat_map(|t| t.iter().map(|t| t.error_px))
        .collect();
    limits.sort_by(f64::total_cmp);
    limits.dedup();
    let mut pareto: Vec<CurvePoint> = Vec::new();
    // From large errors to small: a point that costs no more than a worse one replaces it.
    for limit in limits.into_iter().rev() {
        let smallest = |camera: &&[Tried]| {
            let holds = camera.iter().filter(|tried| tried.error_px <= limit);
            holds.min_by_key(|tried| tried.bytes).copied()
        };
        let Some(tables) = tried.iter().map(smallest).collect::<Option<Vec<Tried>>>() else {
            continue;
        };
        let worst = |error: fn(&Tried) -> f64| tables.iter().map(error).fold(0.0, f64::max);
        let point = CurvePoint {
            bytes: tables.iter().map(|table| table.bytes).sum(),
            error_px: worst(|table| table.error_px),
            error_mm: worst(|table| table.error_mm),
        };
        while pareto.last().is_some_and(|last| last.bytes >= point.bytes) {
            pareto.pop();
        }
        pareto.push(point);
    }
    pareto
}
