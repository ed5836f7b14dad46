//! A renderer without sampling: every square's share of an eighth of a pixel is a clipped polygon,
//! weighted by area and first moment.

use crate::dataset::image::GrayImage;
use calib_rays::board::BoardSpec;
use calib_rays::geometry::{PixelPoint, SensorSize};
use nalgebra::{Matrix3, Vector3};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};
use rayon::prelude::*;

/// Cells per pixel along each axis.
const CELLS: usize = 8;
/// Code values of dark and bright squares; everything beyond the board is bright.
pub const LEVELS: [f64; 2] = [13.0, 242.0];

/// A board's image, its squares' edges straight.
#[derive(Debug, Clone)]
pub struct Exact {
    pub board: BoardSpec,
    pub sensor: SensorSize,
    /// Pixel of a board point (x, y, 1), in squares from the first inner corner.
    pub px_from_board: Matrix3<f64>,
    /// Standard deviation of the lens blur, px.
    pub blur_px: f64,
}

impl Exact {
    pub fn true_corner(&self, row: usize, col: usize) -> PixelPoint {
        let p = self.px_from_board * Vector3::new(col as f64, row as f64, 1.0);
        PixelPoint::new(p.x / p.z, p.y / p.z)
    }

    /// Distance of a pixel from the nearest true corner, along u and v.
    pub fn error_px(&self, pixel: PixelPoint) -> [f64; 2] {
        let corners = (0..self.board.rows * self.board.cols)
            .map(|k| self.true_corner(k / self.board.cols, k % self.board.cols));
        let nearest = corners.min_by(|a, b| a.distance_px(pixel).total_cmp(&b.distance_px(pixel)));
        nearest.map_or([f64::NAN; 2], |c| [pixel.u - c.u, pixel.v - c.v])
    }

    /// With noise of a standard deviation in code values, rounded to 8 bits.
    pub fn take(&self, noise: f64, seed: u64) -> GrayImage {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let normal = Normal::new(0.0, noise).unwrap();
        let mut level = |v: f64| (v + normal.sample(&mut rng)).round().clamp(0.0, 255.0) as f32;
        let values = self.brightness().into_iter().map(&mut level).collect();
        GrayImage::from_values(self.sensor, values, 255.0).unwrap()
    }

    /// Without noise and rounding.
    pub fn brightness(&self) -> Vec<f64> {
        let (width, height) = (self.sensor.width as usize, self.sensor.height as usize);
        let board_from_px = self.px_from_board.try_inverse().unwrap();
        let kernel = Kernel::new(self.blur_px);
        let margin = kernel.margin_px;
        let place = |cell: usize| (cell as f64 + 0.5) / CELLS as f64 - 0.5 - margin as f64;
        let columns = (width + 2 * margin) * CELLS;
        // One row of cells at a time, folded along u: the light, and its moment along v.
        let folded: Vec<Vec<[f64; 2]>> = (0..(height + 2 * margin) * CELLS)
            .into_par_iter()
            .map(|row| {
                let v = place(row);
                let cells: Vec<Cell> = (0..columns)
                    .map(|column| self.cell(&board_from_px, place(column), v))
                    .collect();
                let along_u = |u: usize| {
                    let cells = &cells[u * CELLS..];
                    [
                        kernel.fold(cells.iter().map(|c| [c.light, c.moment[0]])),
                        kernel.fold(cells.iter().map(|c| [c.moment[1], 0.0])),
                    ]
                };
                (0..width).map(along_u).collect()
            })
            .collect();
        (0..width * height)
            .into_par_iter()
            .map(|i| kernel.fold(folded[i / width * CELLS..].iter().map(|row| row[i % width])))
            .collect()
    }

    /// The cell around a place.
    fn cell(&self, board_from_px: &Matrix3<f64>, u: f64, v: f64) -> Cell {
        let half = 0.5 / CELLS as f64;
        // No square is smaller than ten pixels: within one, and not near its sides, it is even.
        let at = board_from_px * Vector3::new(u, v, 1.0);
        let (x, y) = (at.x / at.z, at.y / at.z);
        let inside = |x: f64| (0.2 * half..1.0 - 0.2 * half).contains(&(x - x.floor()));
        if inside(x) && inside(y) {
            return Cell {
                light: self.square(x.floor(), y.floor()),
                moment: [0.0; 2],
            };
        }
        let outline: Vec<Vector3<f64>> = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
            .iter()
            .map(|(du, dv)| Vector3::new(u + du * half, v + dv * half, 1.0))
            .collect();
        let range = |axis: usize| {
            let at = outline.iter().map(|p| {
                let q = board_from_px * p;
                q[axis] / q.z
            });
            at.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| {
                (low.min(x), high.max(x))
            })
        };
        let (x, y) = (range(0), range(1));
        let (i, j) = (x.0.floor(), y.0.floor());
        if x.1.floor() <= i && y.1.floor() <= j {
            return Cell {
                light: self.square(i, j),
                moment: [0.0; 2],
            };
        }
        // The cell reaches over the lines x = i + 1 and y = j + 1, or one of them.
        let beyond = |axis: usize, line: f64| {
            board_from_px.row(axis).transpose() - board_from_px.row(2).transpose() * line
        };
        let (over_x, over_y) = (beyond(0, i + 1.0), beyond(1, j + 1.0));
        let mut cell = Cell::default();
        for (di, side_x) in [(0.0, -over_x), (1.0, over_x)] {
            for (dj, side_y) in [(0.0, -over_y), (1.0, over_y)] {
                let part = clipped(&clipped(&outline, &side_x), &side_y);
                let (area, middle) = area(&part, [u, v]);
                let light = self.square(i + di, j + dj) * area * (CELLS * CELLS) as f64;
                cell.light += light;
                cell.moment[0] += light * middle[0];
                cell.moment[1] += light * middle[1];
            }
        }
        cell
    }

    fn square(&self, i: f64, j: f64) -> f64 {
        let on_board = (-1.0..self.board.cols as f64).contains(&i)
            && (-1.0..self.board.rows as f64).contains(&j);
        LEVELS[usize::from(!on_board || (i + j).rem_euclid(2.0) != 0.0)]
    }
}

/// The part of a polygon where a linear form is positive.
fn clipped(polygon: &[Vector3<f64>], form: &Vector3<f64>) -> Vec<Vector3<f64>> {
    let mut part = Vec::with_capacity(polygon.len() + 2);
    for (k, &from) in polygon.iter().enumerate() {
        let to = polygon[(k + 1) % polygon.len()];
        let (a, b) = (form.dot(&from), form.dot(&to));
        if a >= 0.0 {
            part.push(from);
        }
        if (a >= 0.0) != (b >= 0.0) {
            part.push(from + (to - from) * (a / (a - b)));
        }
    }
    part
}

/// The area of a polygon, and its middle from a place inside it.
fn area(polygon: &[Vector3<f64>], from: [f64; 2]) -> (f64, [f64; 2]) {
    let (mut twice, mut moment) = (0.0, [0.0; 2]);
    for (k, a) in polygon.iter().enumerate() {
        let b = polygon[(k + 1) % polygon.len()];
        let (a, b) = (
            [a.x - from[0], a.y - from[1]],
            [b.x - from[0], b.y - from[1]],
        );
        let cross = a[0] * b[1] - b[0] * a[1];
        twice += cross;
        for axis in 0..2 {
            moment[axis] += cross * (a[axis] + b[axis]) / 3.0;
        }
    }
    if twice.abs() < 1e-15 {
        return (0.0, [0.0; 2]);
    }
    (twice.abs() / 2.0, moment.map(|m| m / twice))
}

/// Mean light in a cell, and its first moment about the cell's middle, px.
#[derive(Debug, Clone, Copy, Default)]
struct Cell {
    light: f64,
    moment: [f64; 2],
}

/// How much a pixel sees of each cell along one axis: its own width, folded with the lens's Gaussian.
struct Kernel {
    /// The weights, means over a cell, and their derivatives by the place, 1/px.
    weights: Vec<[f64; 2]>,
    /// Whole pixels on either side of the middle one.
    margin_px: usize,
}

impl Kernel {
    fn new(blur_px: f64) -> Self {
        let margin_px = (6.0 * blur_px).ceil() as usize;
        let count = (2 * margin_px + 1) * CELLS;
        // The lens's step, and its integral.
        let step = |x: f64| {
            if blur_px > 0.0 {
                let y = x / (blur_px * std::f64::consts::SQRT_2);
                let spread = blur_px * std::f64::consts::FRAC_2_SQRT_PI / std::f64::consts::SQRT_2;
                [libm::erf(y), x * libm::erf(y) + spread * (-y * y).exp()]
            } else {
                [x.signum(), x.abs()]
            }
        };
        let cell = 1.0 / CELLS as f64;
        let weights = (0..count).map(|k| {
            let x = (k as f64 + 0.5) * cell - (margin_px as f64 + 0.5);
            let over = |k: usize, x: f64| step(x + cell / 2.0)[k] - step(x - cell / 2.0)[k];
            let weight = |k: usize| (over(k, x + 0.5) - over(k, x - 0.5)) / 2.0;
            // Without blur, no cell lies on the pixel's border.
            [weight(1), if blur_px > 0.0 { weight(0) } else { 0.0 }]
        });
        Self {
            weights: weights.collect(),
            margin_px,
        }
    }

    fn fold(&self, cells: impl Iterator<Item = [f64; 2]>) -> f64 {
        let pairs = self.weights.iter().zip(cells);
        pairs.map(|(w, c)| w[0] * c[0] + w[1] * c[1]).sum()
    }
}
