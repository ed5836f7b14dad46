//! How many cells a table may have.

use calib_rays::field::CalibratedCamera;
use calib_rays::field::spline::SplineGrid;
use std::iter;

/// The finest grid has cells of this many pixels: finer ones only store noise.
const SMALLEST_CELL_PX: f64 = 6.0;
/// Most cells along the longer side.
const MOST_CELLS: u32 = 192;

/// The sizes worth trying, from coarse to fine: any number of cells along the longer side, and
/// the grid of the field's own spline with its subdivisions, on which the spline is reproduced
/// exactly where other grids leave an error.
pub fn sizes(camera: &CalibratedCamera) -> Vec<[u32; 2]> {
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
pub fn own_grids(camera: &CalibratedCamera) -> impl Iterator<Item = SplineGrid> {
    let maps = iter::once(&camera.field.direction).chain(&camera.field.offset);
    maps.filter_map(|map| map.spline.as_ref())
        .map(|spline| spline.grid)
}

/// Knots of a grid with these cells.
pub fn knot_count([u, v]: [u32; 2]) -> u32 {
    (u + 3) * (v + 3)
}
