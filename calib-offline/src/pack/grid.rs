//! One control grid per camera: the field resampled by least squares.

use super::PackError;
use super::field_rows::FieldRows;
use crate::field::CalibratedCamera;
use crate::field::knot_order::KnotOrder;
use crate::field::spline::SplineGrid;
use crate::field::transport::{self, MAX_HALF_ANGLE_LENGTH};
use crate::geometry::PixelPoint;
use crate::geometry::banded::BandedSystem;
use nalgebra::{Matrix3, Vector2};
use ray_runtime::format::{self, Encoding};

/// A camera's field as the runtime evaluates it: knots of a uniform bicubic B-spline whose cells
/// cover the sensor from outer edge to outer edge.
#[derive(Debug, Clone, PartialEq)]
pub struct ControlGrid {
    /// Cells along u and v.
    pub cells: [u32; 2],
    /// How the knots are stored.
    pub encoding: Encoding,
    /// Row-major: the half-angle vector and, if not central, `m / (1 + s.s/4)` in mm.
    pub knots: Vec<[f64; 4]>,
}

impl ControlGrid {
    /// Size of the table, bytes.
    pub fn byte_count(&self) -> usize {
        format::grid_len(self.encoding, self.cells)
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

/// Fits a grid with `cells` to a camera's field.
///
/// # Errors
/// [`PackError::Field`] where the field has no direction that can be packed, [`PackError::Fit`].
pub fn fit(camera: &CalibratedCamera, cells: [u32; 2]) -> Result<ControlGrid, PackError> {
    let field = &camera.field;
    let grid = SplineGrid {
        sensor: field.sensor,
        cells_u: cells[0] as usize,
        cells_v: cells[1] as usize,
    };
    let lattice = Lattice::new(camera, &grid);
    let order = KnotOrder::new(grid);
    let mut system = BandedSystem::new(grid.knot_count(), order.half_bandwidth(1));
    for stencil in order.thin_plate() {
        let weight = stencil.weight * THIN_PLATE_WEIGHT;
        system.add_square(stencil.terms(), [0.0; 4], weight);
    }

    let turn = RoundingTurn::new(&camera.rig_from_camera.rotation);
    let rows = FieldRows::new(field, lattice.u_px.clone());
    let weights_u: Vec<_> = lattice.u_px.iter().map(|u| grid.weights_u(*u)).collect();
    for (row_idx, &v) in lattice.v_px.iter().enumerate() {
        let row = rows.row(v);
        let weights_v = grid.weights_v(v);
        for (column, weights_u) in weights_u.iter().enumerate() {
            let weight = lattice.weights[row_idx * lattice.u_px.len() + column];
            if weight == 0.0 {
                continue;
            }
            let sample = row.sample(column);
            let length_squared = sample.s.norm_squared();
            let is_usable = length_squared <= MAX_HALF_ANGLE_LENGTH * MAX_HALF_ANGLE_LENGTH
                && sample.m_mm.iter().all(|m| m.is_finite());
            if !is_usable && weight == 1.0 {
                return Err(PackError::Field {
                    camera: camera.name.clone(),
                    pixel: PixelPoint::new(lattice.u_px[column], v),
                    s: sample.s.into(),
                });
            }
            if is_usable {
                let m = sample.m_mm / (1.0 + length_squared / 4.0);
                let s = turn.applied(&sample.s);
                let value = [s.x, s.y, m.x, m.y];
                let terms = order.around(weights_u, &weights_v);
                system.add_square(&terms, value, weight);
            }
        }
    }
    let solution = system.solve().ok_or_else(|| PackError::Fit {
        camera: camera.name.clone(),
        cells,
    })?;
    let knots = (0..grid.knot_count())
        .map(|number| solution[order.from_row_major(number)])
        .collect();
    Ok(ControlGrid {
        cells,
        encoding: if field.is_central() {
            Encoding::CentralF32
        } else {
            Encoding::NonCentralF32
        },
        knots,
    })
}

/// What the rotation of a camera loses when it is rounded to f32, some 1e-8 rad: the grid can
/// make up for it, and at a focal length of 6000 px that is half of what a blob may be off.
struct RoundingTurn {
    rounded_from_exact: Matrix3<f64>,
}

impl RoundingTurn {
    fn new(rotation: &Matrix3<f64>) -> Self {
        let rounded = rotation.map(|x| f64::from(x as f32));
        // A matrix without inverse is refused when the blob is opened.
        let inverse = rounded.try_inverse().unwrap_or_else(Matrix3::identity);
        Self {
            rounded_from_exact: inverse * rotation,
        }
    }

    /// The half-angle vector that the rounded rotation takes where the exact one takes `s`.
    fn applied(&self, s: &Vector2<f64>) -> Vector2<f64> {
        transport::half_angle(&(self.rounded_from_exact * transport::direction(s))).unwrap_or(*s)
    }
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
