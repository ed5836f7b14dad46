//! What a predictor leaves of a field, resampled onto a control grid by least squares.

use super::PackError;
use super::field_rows::FieldRows;
use super::table::Target;
use calib_rays::field::CalibratedCamera;
use calib_rays::field::knot_order::KnotOrder;
use calib_rays::field::spline::SplineGrid;
use calib_rays::geometry::PixelPoint;
use calib_rays::numerics::banded_system::BandedSystem;
use ray_runtime::format::{PLACES_PER_CELL, places_per_px};

/// Knots of a uniform bicubic B-spline whose cells cover the sensor from outer edge to outer edge.
#[derive(Debug, Clone, PartialEq)]
pub struct Knots {
    /// Row-major: half-angle vector, and offset in mm.
    pub knots: Vec<[f64; 4]>,
    /// Whether the calibrated area has pixels that depend on the knot.
    is_used: Vec<bool>,
}

impl Knots {
    /// The largest magnitude of the knots that matter, in some channels.
    pub fn largest(&self, channels: [usize; 2]) -> f64 {
        let used = self
            .knots
            .iter()
            .zip(&self.is_used)
            .filter(|(_, used)| **used);
        used.flat_map(|(knot, _)| channels.map(|c| knot[c].abs()))
            .fold(0.0, f64::max)
    }
}

/// Lattice points per cell along each axis.
const POINTS_PER_CELL: usize = 4;

/// Weight of lattice points up to one cell outside the calibrated area, relative to those inside.
/// They hold the knots that the area itself barely touches; their misfit is of the order of the
/// misfit inside, so a thousandth of it does not show.
const OUTSIDE_WEIGHT: f64 = 1e-3;

/// Weight of the thin-plate energy of the knots. It decides what nothing else decides: far from
/// the calibrated area the grid goes on as it was bent last, where a plain ridge would let the
/// outer knots run to large values.
const THIN_PLATE_WEIGHT: f64 = 1e-9;

/// A grid over a camera's sensor, to be fitted.
pub struct ResidualSpline<'a> {
    camera: &'a CalibratedCamera,
    target: &'a Target<'a>,
    grid: SplineGrid,
}

impl<'a> ResidualSpline<'a> {
    /// A grid with `cells`.
    pub fn new(camera: &'a CalibratedCamera, target: &'a Target<'a>, cells: [u32; 2]) -> Self {
        Self {
            camera,
            target,
            grid: SplineGrid {
                sensor: camera.field.sensor,
                cells_u: cells[0] as usize,
                cells_v: cells[1] as usize,
            },
        }
    }

    /// The knots that follow the target less what is predicted.
    ///
    /// # Errors
    /// [`PackError::Field`] where the field has no direction that can be packed, [`PackError::Fit`].
    pub fn fit(&self, predicted: impl Fn(PixelPoint) -> [f64; 4]) -> Result<Knots, PackError> {
        let grid = self.grid;
        let lattice = Lattice::new(self.camera, &grid);
        let order = KnotOrder::new(grid);
        let mut system = BandedSystem::new(grid.knot_count(), order.half_bandwidth(1));
        for stencil in order.thin_plate() {
            let weight = stencil.weight * THIN_PLATE_WEIGHT;
            system.add_square(stencil.terms(), [0.0; 4], weight);
        }

        let mut is_used = vec![false; grid.knot_count()];
        let rows = FieldRows::new(&self.camera.field, lattice.u_px.clone());
        let on_u = |u: &f64| grid.weights_u(on_grid(*u, grid.sensor.width, grid.cells_u));
        let weights_u: Vec<_> = lattice.u_px.iter().map(on_u).collect();
        for (row_idx, &v) in lattice.v_px.iter().enumerate() {
            let row = rows.row(v);
            let weights_v = grid.weights_v(on_grid(v, grid.sensor.height, grid.cells_v));
            for (column, weights_u) in weights_u.iter().enumerate() {
                let weight = lattice.weights[row_idx * lattice.u_px.len() + column];
                if weight == 0.0 {
                    continue;
                }
                let pixel = PixelPoint::new(lattice.u_px[column], v);
                let sample = row.sample(column);
                let target = if weight == 1.0 {
                    Some(self.target.required(pixel, &sample)?)
                } else {
                    self.target.numbers(&sample)
                };
                let terms = order.around(weights_u, &weights_v);
                if let Some(target) = target {
                    let predicted = predicted(pixel);
                    let value = std::array::from_fn(|c| target[c] - predicted[c]);
                    system.add_square(&terms, value, weight);
                }
                if weight == 1.0 {
                    for (place, _) in terms {
                        is_used[place] = true;
                    }
                }
            }
        }
        let solution = system.solve().ok_or_else(|| PackError::Fit {
            camera: self.camera.name.clone(),
            cells: [grid.cells_u as u32, grid.cells_v as u32],
        })?;
        let places = (0..grid.knot_count()).map(|number| order.from_row_major(number));
        let (knots, is_used) = places
            .map(|place| (solution[place], is_used[place]))
            .unzip();
        Ok(Knots { knots, is_used })
    }
}

/// The coordinate at which a grid without round-off is what the runtime's is at `px`: that ends a little
/// before the sensor does, and rounds places down, by half of one on average.
fn on_grid(px: f64, extent_px: u32, cells: usize) -> f64 {
    let place = (px + 0.5) * f64::from(places_per_px(cells as u32, extent_px)) - 0.5;
    let px_per_place = f64::from(extent_px) / (cells as f64 * f64::from(PLACES_PER_CELL));
    place * px_per_place - 0.5
}

/// Where the field is sampled, and what each sample counts.
struct Lattice {
    u_px: Vec<f64>,
    v_px: Vec<f64>,
    /// Row-major: 1 in the calibrated area, [`OUTSIDE_WEIGHT`] around it, 0 beyond.
    weights: Vec<f64>,
}

impl Lattice {
    fn new(camera: &CalibratedCamera, grid: &SplineGrid) -> Self {
        let axis = |extent: u32, cells: usize| -> Vec<f64> {
            let steps = cells * POINTS_PER_CELL;
            (0..=steps)
                .map(|k| k as f64 * f64::from(extent) / steps as f64 - 0.5)
                .collect()
        };
        let u_px = axis(grid.sensor.width, grid.cells_u);
        let v_px = axis(grid.sensor.height, grid.cells_v);
        let is_inside = |u: f64, v: f64| camera.coverage.contains(PixelPoint::new(u, v));
        let inside: Vec<bool> = v_px
            .iter()
            .flat_map(|v| u_px.iter().map(|u| is_inside(*u, *v)))
            .collect();
        let (width, height) = (u_px.len(), v_px.len());
        let wide = dilated(&inside, width, height, 1, POINTS_PER_CELL);
        let around = dilated(&wide, height, width, width, POINTS_PER_CELL);
        let weights = inside
            .iter()
            .zip(&around)
            .map(|(inside, around)| match (inside, around) {
                (true, _) => 1.0,
                (false, true) => OUTSIDE_WEIGHT,
                (false, false) => 0.0,
            })
            .collect();
        Self {
            u_px,
            v_px,
            weights,
        }
    }
}

/// Flags set within `reach` steps of a set one, along lines of `length` flags `stride` apart.
fn dilated(flags: &[bool], length: usize, lines: usize, stride: usize, reach: usize) -> Vec<bool> {
    // Lines along u start at multiples of their length; lines along v at consecutive places.
    let line_stride = if stride == 1 { length } else { 1 };
    let mut result = flags.to_vec();
    for line in 0..lines {
        let at = |k: usize| line * line_stride + k * stride;
        for k in (0..length).filter(|k| flags[at(*k)]) {
            for near in k.saturating_sub(reach)..=(k + reach).min(length - 1) {
                result[at(near)] = true;
            }
        }
    }
    result
}
