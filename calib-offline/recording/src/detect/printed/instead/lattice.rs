//! Grids of circles and of rings that an image shows, found without their description.

use super::Stated;
use crate::dataset::image::GrayImage;
use crate::detect::ring_target::candidates::Sought;
use crate::detect::ring_target::grid::{Cells, largest_grid};
use crate::detect::ring_target::local_map::LocalMap;
use crate::detect::ring_target::markers::{checked_cells, fitted_candidates, grid_point, node};
use crate::detect::ring_target::ring_fit::FittedRing;
use crate::detect::seen_board::{SeenBoard, SeenKind};
use calib_rays::geometry::PixelPoint;
use calib_rays::numerics::median;
use nalgebra::Vector2;
use std::collections::BTreeMap;

/// Radii of circles that are tried, in steps of the lattice; each stands for those within a quarter.
const RADII: [f64; 4] = [0.3, 0.22, 0.4, 0.15];
/// Fits reach so many radii from the middle.
const REACH: f64 = 1.4;
/// Circles looked for at first.
const USUAL_COUNT: usize = 100;
/// Fewest circles that make a grid.
const MIN_CIRCLES: usize = 9;
/// Part of a grid's places that must be seen.
const MIN_FILLED: f64 = 0.75;
/// A circle so much larger or smaller than most is marked.
const MARKED_SIZE: f64 = 1.12;
/// A diameter is another one beyond this.
const OTHER_DIAMETER: f64 = 1.15;

/// The circles on their lattice.
struct Lattice {
    rings: Vec<FittedRing>,
    cells: Cells,
    map: LocalMap,
}

impl Lattice {
    fn of(image: &GrayImage, count: usize) -> Option<Self> {
        let rings = fitted_candidates(image, Sought::RingsAndDisks, count, REACH);
        let nodes: Vec<_> = rings.iter().map(node).collect();
        let cells = RADII
            .into_iter()
            .map(|radius| largest_grid(&nodes, (radius, radius)))
            .max_by_key(Cells::len)?;
        let (cells, map) = checked_cells(&rings, cells).ok()?;
        (cells.len() >= MIN_CIRCLES).then_some(Self { rings, cells, map })
    }

    /// Mean radius in steps of the lattice.
    fn size(&self, i: usize, cell: (i64, i64)) -> f64 {
        let step_px = self.map.derivative(&grid_point(cell)).determinant().abs();
        self.rings[i].mean_radius_px() / step_px.sqrt()
    }

    /// Whether a ring has a hole.
    fn is_hollow(&self, i: usize) -> bool {
        self.rings[i].ratio > 0.0
    }

    fn is_in_view(&self, image: &GrayImage, at: Vector2<f64>) -> bool {
        let pixel = self.map.at(&at);
        image.sensor.contains(PixelPoint::new(pixel.x, pixel.y))
    }
}

/// Places of a grid: extent along x and y, and whether they stand on their corner.
struct Extent {
    least: (i64, i64),
    width: usize,
    height: usize,
    filled: f64,
}

impl Extent {
    fn of(cells: impl Iterator<Item = (i64, i64)> + Clone, per_place: f64) -> Option<Self> {
        let bounds = |of: fn((i64, i64)) -> i64| {
            let low = cells.clone().map(of).min()?;
            Some((low, cells.clone().map(of).max()?))
        };
        let ((left, right), (top, bottom)) = (bounds(|c| c.0)?, bounds(|c| c.1)?);
        let (width, height) = ((right - left + 1) as usize, (bottom - top + 1) as usize);
        let places = per_place * (width * height) as f64;
        Some(Self {
            least: (left, top),
            width,
            height,
            filled: cells.count() as f64 / places,
        })
    }
}

/// A cell of a lattice in pitches of a grid that stands on its corner.
fn on_corner((a, b): (i64, i64)) -> (i64, i64) {
    (a - b, a + b)
}

/// The grid of circles or rings.
pub fn seen(image: &GrayImage, stated: &Stated) -> Option<SeenBoard> {
    let count = (stated.size().0 * stated.size().1).max(USUAL_COUNT);
    let lattice = Lattice::of(image, count)?;
    let cells = || lattice.cells.values().copied();
    let straight = Extent::of(cells(), 1.0)?;
    let diagonal = Extent::of(cells().map(on_corner), 0.5)?;
    let asymmetric = diagonal.filled > straight.filled;
    let extent = if asymmetric { &diagonal } else { &straight };
    if extent.filled < MIN_FILLED {
        return None;
    }
    let hollow = lattice.cells.keys().filter(|i| lattice.is_hollow(**i));
    let are_rings = 2 * hollow.count() > lattice.cells.len();
    let sizes = lattice
        .cells
        .iter()
        .map(|(&i, &cell)| lattice.size(i, cell));
    let usual = median(sizes)?;
    let is_marked = |i: usize, cell: (i64, i64)| {
        let size = lattice.size(i, cell) / usual;
        if are_rings {
            size > MARKED_SIZE
        } else {
            lattice.is_hollow(i) || !(1.0 / MARKED_SIZE..MARKED_SIZE).contains(&size)
        }
    };
    let marked: Vec<(i64, i64)> = lattice
        .cells
        .iter()
        .filter(|(i, cell)| is_marked(**i, **cell))
        .map(|(_, &cell)| if asymmetric { on_corner(cell) } else { cell })
        .map(|(x, y)| (x - extent.least.0, y - extent.least.1))
        .collect();
    let (rows, cols, direction) = if asymmetric {
        let shifted = !cells()
            .map(on_corner)
            .any(|(x, y)| (x - extent.least.0, y - extent.least.1) == (0, 0));
        shifted_rows((extent.width, extent.height), shifted, &marked, stated)
    } else {
        square_rows((extent.width, extent.height), &marked, stated)
    };
    // Where the next circles' rims would begin.
    let is_whole = outer(&lattice, asymmetric)
        .into_iter()
        .all(|at| lattice.is_in_view(image, at));
    let spacing = if asymmetric {
        std::f64::consts::SQRT_2
    } else {
        1.0
    };
    let diameter = 2.0 * usual * spacing;
    let is_other = stated.diameter.is_some_and(|stated| {
        !(1.0 / OTHER_DIAMETER..OTHER_DIAMETER).contains(&(diameter / stated))
    });
    let kind = if are_rings {
        SeenKind::Rings { direction }
    } else {
        SeenKind::Circles {
            asymmetric,
            direction,
            diameter: is_other.then_some(diameter),
        }
    };
    Some(SeenBoard {
        kind,
        rows,
        cols,
        is_whole,
    })
}

/// Places a step outward of the outermost circles.
fn outer(lattice: &Lattice, asymmetric: bool) -> Vec<Vector2<f64>> {
    let taken: BTreeMap<(i64, i64), usize> =
        lattice.cells.iter().map(|(&i, &cell)| (cell, i)).collect();
    let steps: [(i64, i64); 4] = if asymmetric {
        [(1, 1), (-1, -1), (1, -1), (-1, 1)]
    } else {
        [(1, 0), (-1, 0), (0, 1), (0, -1)]
    };
    let beyond = taken.keys().flat_map(|&(a, b)| {
        let taken = &taken;
        steps
            .iter()
            .filter(move |(da, db)| !taken.contains_key(&(a + da, b + db)))
            .map(move |(da, db)| {
                // Half a step tells that the circle is not the last one in view.
                let scale = if asymmetric { 0.45 } else { 0.7 };
                Vector2::new(a as f64 + scale * *da as f64, b as f64 + scale * *db as f64)
            })
    });
    beyond.collect()
}

type Described = (usize, usize, Vec<(usize, usize)>);

fn places(of: impl Iterator<Item = (i64, i64)>) -> Vec<(usize, usize)> {
    let mut places: Vec<(usize, usize)> = of
        .filter_map(|(x, y)| Some((usize::try_from(y).ok()?, usize::try_from(x).ok()?)))
        .collect();
    places.sort_unstable();
    places
}

/// Of several ways to describe one grid the one nearest to what is stated.
fn nearest(ways: Vec<Described>, stated: &Stated) -> Described {
    let alike = |(rows, cols, marked): &Described| {
        let common = marked.iter().filter(|at| stated.direction().contains(at));
        (usize::from((*rows, *cols) == stated.size()), common.count())
    };
    let mut ways = ways.into_iter();
    let first = ways.next().unwrap_or_default();
    ways.fold(first, |best, way| {
        if alike(&way) > alike(&best) {
            way
        } else {
            best
        }
    })
}

/// Rows and columns of a symmetric grid, the shorter direction as rows unless the other way round is stated.
fn square_rows((w, h): (usize, usize), marked: &[(i64, i64)], stated: &Stated) -> Described {
    let mut ways: Vec<Described> = (0..4usize)
        .map(|quarters| {
            let (mut w, mut h) = (w as i64, h as i64);
            let mut at = marked.to_vec();
            for _ in 0..quarters {
                for place in &mut at {
                    *place = (h - 1 - place.1, place.0);
                }
                (w, h) = (h, w);
            }
            (h as usize, w as usize, places(at.into_iter()))
        })
        .collect();
    ways.sort_by_key(|(rows, cols, _)| rows > cols);
    nearest(ways, stated)
}

/// Rows and columns of an asymmetric grid, in all the ways in which its first row is not shifted.
fn shifted_rows(
    (w, h): (usize, usize),
    shifted: bool,
    marked: &[(i64, i64)],
    stated: &Stated,
) -> Described {
    let mut ways: Vec<Described> = Vec::new();
    for quarters in 0..4usize {
        let (mut w, mut h) = (w as i64, h as i64);
        let mut at = marked.to_vec();
        // Whether a circle lies at the upper left.
        let mut first = !shifted;
        for _ in 0..quarters {
            // The lower left becomes the upper left: `h - 1` rows below, it is of the other kind if that is odd.
            first ^= (h - 1) % 2 == 1;
            for place in &mut at {
                *place = (h - 1 - place.1, place.0);
            }
            (w, h) = (h, w);
        }
        if first && w % 2 == 0 {
            let in_rows = at.into_iter().map(|(x, y)| ((x - y % 2) / 2, y));
            ways.push((h as usize, (w / 2) as usize, places(in_rows)));
        }
    }
    if ways.is_empty() {
        // A part of one.
        return (h.max(w), h.min(w).div_ceil(2), Vec::new());
    }
    ways.sort_by_key(|(rows, cols, _)| rows < cols);
    nearest(ways, stated)
}

/// The diameter of most circles as a share of the lattice's step.
pub fn measured_diameter(rings: &[FittedRing], cells: &Cells, map: &LocalMap) -> Option<f64> {
    let sizes = cells.iter().map(|(&i, &cell)| {
        let step_px = map.derivative(&grid_point(cell)).determinant().abs();
        2.0 * rings[i].mean_radius_px() / step_px.sqrt()
    });
    median(sizes)
}
