//! A cubic polynomial for each cell: the form that is looked up fastest.

use super::PackError;
use super::field_rows::FieldRows;
use super::monomials::{self, Equation};
use super::table::{Table, Target};
use calib_rays::field::CalibratedCamera;
use calib_rays::geometry::PixelPoint;
use ray_runtime::format::{Axis, Encoding, Form};

/// Chebyshev points per cell along each axis: least squares over them are close to the polynomial of
/// the smallest worst error.
const POINTS_PER_CELL: usize = 7;

/// Weight of points outside the calibrated area in a cell that has points inside: they decide only
/// what those leave open.
const OUTSIDE_WEIGHT: f64 = 1e-8;

/// Pull of every coefficient towards zero: in a well-determined cell some 1e-15 of itself.
const RIDGE: f64 = 1e-16;

const DEGREE: usize = 3;

/// Fits a patch to each cell of a camera's field. A cell of which nothing is calibrated follows the
/// field beyond its area, or is zero where there is none.
///
/// # Errors
/// [`PackError::Field`], [`PackError::Fit`].
pub fn fit(camera: &CalibratedCamera, cells: [u32; 2]) -> Result<Table, PackError> {
    let sensor = camera.field.sensor;
    let target = Target::new(camera);
    let axes = [
        CellPoints::new(sensor.width, cells[0]),
        CellPoints::new(sensor.height, cells[1]),
    ];
    let [along_u, along_v] = &axes;
    let columns: Vec<f64> = along_u.points.iter().map(|point| point.px).collect();
    let rows = FieldRows::new(&camera.field, columns);
    let encoding = Encoding {
        form: Form::Patches,
        is_central: camera.field.is_central(),
    };
    let maps = encoding.channels() / 2;
    let mut bytes = Vec::new();
    for row_of_cells in along_v.points.chunks(POINTS_PER_CELL) {
        let field_rows: Vec<_> = row_of_cells
            .iter()
            .map(|point| rows.row(point.px))
            .collect();
        for first in (0..along_u.points.len()).step_by(POINTS_PER_CELL) {
            let mut equations = Vec::with_capacity(POINTS_PER_CELL * POINTS_PER_CELL);
            for (v, row) in row_of_cells.iter().zip(&field_rows) {
                for k in first..first + POINTS_PER_CELL {
                    let u = along_u.points[k];
                    let pixel = PixelPoint::new(u.px, v.px);
                    let sample = row.sample(k);
                    let (value, weight) = if camera.coverage.contains(pixel) {
                        (Some(target.required(pixel, &sample)?), 1.0)
                    } else {
                        (target.numbers(&sample), OUTSIDE_WEIGHT)
                    };
                    if let Some(value) = value {
                        equations.push(Equation {
                            at: [u.share, v.share],
                            value,
                            weight,
                        });
                    }
                }
            }
            let patch =
                monomials::fit(&equations, DEGREE, RIDGE).ok_or_else(|| PackError::Fit {
                    camera: camera.name.clone(),
                    cells,
                })?;
            for map in 0..maps {
                for coefficient in &patch {
                    let pair = &coefficient[2 * map..2 * map + 2];
                    bytes.extend(pair.iter().flat_map(|x| (*x as f32).to_le_bytes()));
                }
            }
        }
    }
    Ok(Table {
        encoding,
        cells,
        bytes,
    })
}

/// The points of all cells along one axis, cell by cell.
struct CellPoints {
    points: Vec<CellPoint>,
}

#[derive(Clone, Copy)]
struct CellPoint {
    /// Where it is, px.
    px: f64,
    /// Where a lookup finds it in its cell.
    share: f64,
}

impl CellPoints {
    fn new(extent_px: u32, cells: u32) -> Self {
        let axis = Axis::new(0, extent_px, cells, 1);
        let size_px = f64::from(extent_px) / f64::from(cells);
        let point = |cell: u32, k: usize| {
            let angle = (k as f64 + 0.5) / POINTS_PER_CELL as f64 * std::f64::consts::PI;
            let x = (f64::from(cell) + 0.5 - 0.5 * libm::cos(angle)) * size_px;
            let rest_px = x - f64::from(cell) * f64::from(axis.cell_high_px);
            CellPoint {
                px: x - 0.5,
                share: rest_px * f64::from(axis.cells_per_px),
            }
        };
        let points = (0..cells).flat_map(|cell| (0..POINTS_PER_CELL).map(move |k| point(cell, k)));
        Self {
            points: points.collect(),
        }
    }
}
