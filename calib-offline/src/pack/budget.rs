//! The coarsest control grid that holds the bound.

use super::encode::BlobParts;
use super::grid::{self, ControlGrid};
use super::{AlignedBytes, PackError, PackSettings, proof};
use crate::field::CalibratedCamera;
use crate::field::spline::SplineGrid;
use ray_runtime::RayBlob;
use std::iter;

/// A camera's grid, and what else was tried.
pub struct Choice {
    /// The grid.
    pub grid: ControlGrid,
    /// Bytes of the table, and the worst error of a sample of the pixels, px; as tried.
    pub tried: Vec<(usize, f64)>,
    /// Number of the size after the one chosen.
    next: usize,
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

/// Searches the coarsest grid that holds the bound on a sample of the pixels.
///
/// # Errors
/// [`PackError::BoundNotReached`] and what fitting and opening give.
pub fn coarsest_grid(
    camera: &CalibratedCamera,
    settings: &PackSettings,
) -> Result<Choice, PackError> {
    let sizes = sizes(camera);
    let is_own = |[u, v]: [u32; 2]| {
        let (u, v) = (u as usize, v as usize);
        own_grids(camera)
            .any(|own| u.is_multiple_of(own.cells_u) && v == u / own.cells_u * own.cells_v)
    };
    let mut search = Search::new(camera, settings);

    // Upwards in steps that the error asks for, never past a size that is likely to be exact.
    let mut idx = 1.min(sizes.len() - 1);
    let mut failed_below = 0;
    let found = loop {
        let error_px = search.attempt(sizes[idx])?;
        if error_px <= settings.max_error_px {
            break idx;
        }
        if idx + 1 == sizes.len() || search.has_stalled() {
            return Err(search.not_reached());
        }
        failed_below = idx + 1;
        let goal = f64::from(knot_count(sizes[idx])) * growth(error_px, settings.max_error_px);
        let is_stop = |k: usize| f64::from(knot_count(sizes[k])) >= goal || is_own(sizes[k]);
        idx = (idx + 1..sizes.len())
            .find(|k| is_stop(*k))
            .unwrap_or(sizes.len() - 1);
    };
    // Downwards by halving; the error falls with the size but for small ripples.
    let (mut low, mut high) = (failed_below, found);
    while low < high {
        let middle = usize::midpoint(low, high);
        if search.attempt(sizes[middle])? <= settings.max_error_px {
            high = middle;
        } else {
            low = middle + 1;
        }
    }
    let grid = search.grid_of(sizes[high])?;
    Ok(Choice {
        grid,
        tried: search.tried_in_order(),
        next: high + 1,
    })
}

/// By how much the number of knots should grow: the error of a cubic spline falls with the fourth
/// power of the spacing, so with the square of the number of knots. A little less is tried, and
/// at most four times as many.
fn growth(error_px: f64, wanted_px: f64) -> f64 {
    ((error_px / wanted_px).sqrt() * 0.9).clamp(1.05, 4.0)
}

impl Choice {
    /// Takes the next finer size, after all pixels were compared and one was worse than the
    /// sample had it.
    ///
    /// # Errors
    /// As [`coarsest_grid`].
    pub fn refine(
        &mut self,
        camera: &CalibratedCamera,
        settings: &PackSettings,
        worst_px: f64,
    ) -> Result<(), PackError> {
        let sizes = sizes(camera);
        let mut search = Search::new(camera, settings);
        while let Some(&size) = sizes.get(self.next) {
            self.next += 1;
            let error_px = search.attempt(size)?;
            self.tried
                .push((search.grid_of(size)?.byte_count(), error_px));
            if error_px <= settings.max_error_px {
                self.grid = search.grid_of(size)?;
                return Ok(());
            }
            if search.has_stalled() {
                break;
            }
        }
        Err(PackError::BoundNotReached {
            camera: camera.name.clone(),
            wanted_px: settings.max_error_px,
            best_px: worst_px,
            cells: self.grid.cells,
        })
    }
}

/// Attempts on one camera.
struct Search<'a> {
    camera: &'a CalibratedCamera,
    settings: &'a PackSettings,
    attempts: Vec<(ControlGrid, f64)>,
}

impl<'a> Search<'a> {
    fn new(camera: &'a CalibratedCamera, settings: &'a PackSettings) -> Self {
        Self {
            camera,
            settings,
            attempts: Vec::new(),
        }
    }

    /// Fits a grid, packs it alone, and compares a sample of the pixels; the worst error, px.
    fn attempt(&mut self, cells: [u32; 2]) -> Result<f64, PackError> {
        if let Some((_, error_px)) = self.attempts.iter().find(|(g, _)| g.cells == cells) {
            return Ok(*error_px);
        }
        let grid = grid::fit(self.camera, cells)?;
        let parts = BlobParts {
            identity: self.settings.identity,
            frame: "",
            max_error_px: 1.0,
            working_distance_mm: self.settings.working_distance_mm as f32,
            self_tests: Vec::new(),
            pairs: Vec::new(),
        };
        let bytes = AlignedBytes::from(parts.encode_cameras(&[(self.camera, &grid)])?.as_slice());
        let blob = RayBlob::open(&bytes)?;
        let sensor = self.camera.field.sensor;
        // Odd, so that the sample meets every phase of a grid with an even cell size.
        let stride = (sensor.width.max(sensor.height) as usize / SAMPLE_ALONG_LONGER_SIDE) | 1;
        let distance_mm = self.settings.working_distance_mm;
        let proof = proof::prove(self.camera, &blob, 0, distance_mm, stride);
        self.attempts.push((grid, proof.worst_error_px));
        Ok(proof.worst_error_px)
    }

    /// Whether finer grids no longer help: the error is as small as the round-off of f32 makes
    /// it, and twice as many knots did not lower it. (A large error that stays may be that of
    /// local bumps that no grid so far was fine enough for.)
    fn has_stalled(&self) -> bool {
        let Some(((last, last_px), before)) = self.attempts.split_last() else {
            return false;
        };
        let no_better = |(grid, error_px): &(ControlGrid, f64)| {
            knot_count(last.cells) >= 2 * knot_count(grid.cells) && *last_px > 0.8 * error_px
        };
        *last_px < ROUND_OFF_PX && before.iter().any(no_better)
    }

    fn not_reached(&self) -> PackError {
        let best = self.attempts.iter().min_by(|(_, a), (_, b)| a.total_cmp(b));
        PackError::BoundNotReached {
            camera: self.camera.name.clone(),
            wanted_px: self.settings.max_error_px,
            best_px: best.map_or(f64::INFINITY, |(_, error_px)| *error_px),
            cells: best.map_or([0, 0], |(grid, _)| grid.cells),
        }
    }

    fn grid_of(&self, cells: [u32; 2]) -> Result<ControlGrid, PackError> {
        match self.attempts.iter().find(|(g, _)| g.cells == cells) {
            Some((grid, _)) => Ok(grid.clone()),
            None => grid::fit(self.camera, cells),
        }
    }

    fn tried_in_order(&self) -> Vec<(usize, f64)> {
        let mut tried: Vec<_> = self
            .attempts
            .iter()
            .map(|(grid, error_px)| (grid.byte_count(), *error_px))
            .collect();
        tried.sort_by_key(|(bytes, _)| *bytes);
        tried
    }
}

/// Bytes of all cameras' tables against the worst error of any: for each error that some camera
/// has with some grid, the smallest tables with which no camera is worse.
pub fn curve(tried: &[&[(usize, f64)]]) -> Vec<(usize, f64)> {
    let mut limits: Vec<f64> = tried
        .iter()
        .flat_map(|t| t.iter().map(|(_, e)| *e))
        .collect();
    limits.sort_by(f64::total_cmp);
    limits.dedup();
    let mut curve: Vec<(usize, f64)> = limits
        .into_iter()
        .filter_map(|limit| {
            let smallest = |camera: &&[(usize, f64)]| {
                let holds = camera.iter().filter(|(_, error_px)| *error_px <= limit);
                holds.map(|(bytes, _)| *bytes).min()
            };
            let bytes: Option<usize> = tried.iter().map(smallest).sum();
            bytes.map(|bytes| (bytes, limit))
        })
        .collect();
    // From large errors to small: a point that costs no more than a worse one replaces it.
    curve.reverse();
    let mut pareto: Vec<(usize, f64)> = Vec::new();
    for point in curve {
        while pareto.last().is_some_and(|last| last.0 >= point.0) {
            pareto.pop();
        }
        pareto.push(point);
    }
    pareto
}
