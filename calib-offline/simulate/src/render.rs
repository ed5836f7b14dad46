//! Images of a printed plate as a camera takes them: anti-aliased, blurred, lit, noisy.
//!
//! Each pixel is cut into 3 x 3 cells; a cell that an edge may cross is sampled at 3 x 3 points, each
//! with the share of its surroundings that lies across the edge.
//! The cells are then weighted with the Gaussian of the lens times the pixel's square. Where a cell
//! falls on the plate is interpolated (cubic, in a lattice of 8 px) from exact rays; against the
//! exact ray this is wrong by less than 1e-3 px on all optics here (tested), and where the lattice
//! has a hole, at the border of an image circle, each cell has its exact ray.

use super::displaced::Displaced;
use super::optics::CameraOptics;
use super::pattern::Pattern;
use super::random::{self, Purpose};
use calib_rays::geometry::{PixelPoint, RigidTransform, SensorSize};
use nalgebra::Vector2;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Cells per pixel along each axis.
const CELLS: usize = 3;
/// Samples per cell along each axis where an edge may cross it.
const SAMPLES: usize = 3;
/// Spacing of the lattice of exact rays, px.
const LATTICE_PX: usize = 8;
/// Rows of pixels that one task renders.
const STRIP: usize = 32;
/// Rays flatter than this against the plate (cosine) show background.
const MIN_FACING_COS: f64 = 0.05;

/// How an image looks. Brightness is a share of full scale.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct RenderSettings {
    /// Standard deviation of the lens's Gaussian blur, px; 0 is a perfect lens.
    pub blur_px: f64,
    /// Brightness of black print.
    pub black: f64,
    /// Brightness of white print.
    pub white: f64,
    /// Brightness beyond the plate.
    pub background: f64,
    /// Change of the illumination from one edge of the image to the other: along u, along v.
    pub gradient: [f64; 2],
    /// Standard deviation of the sensor's noise, in levels of an 8-bit image.
    pub noise_levels: f64,
    /// Whether every corner of the board is drawn off by its noise, as it would be in `corners.csv`.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub is_displaced: bool,
}

impl Default for RenderSettings {
    fn default() -> Self {
        Self {
            blur_px: 0.7,
            black: 0.12,
            white: 0.80,
            background: 0.30,
            gradient: [0.15, -0.10],
            noise_levels: 1.0,
            is_displaced: false,
        }
    }
}

/// Brightness of every pixel, row by row, as a share of full scale (not clipped).
#[derive(Debug, Clone, PartialEq)]
pub struct Rendered {
    /// Size of the image.
    pub sensor: SensorSize,
    /// `sensor.width * sensor.height` values.
    pub brightness: Vec<f32>,
}

impl Rendered {
    /// Adds sensor noise from the stream of a view.
    pub(super) fn add_noise(&mut self, levels: f64, seed: u64, camera_idx: usize, pose: usize) {
        let mut rng = random::stream(seed, Purpose::ImageNoise, camera_idx, pose);
        for value in &mut self.brightness {
            *value += (random::normal(&mut rng) * levels / 255.0) as f32;
        }
    }

    /// Quantized to 8 bits.
    pub fn to_u8(&self) -> Vec<u8> {
        let level = |value: &f32| (value * 255.0).round().clamp(0.0, 255.0) as u8;
        self.brightness.iter().map(level).collect()
    }

    /// Quantized to 16 bits.
    pub fn to_u16(&self) -> Vec<u16> {
        let level = |value: &f32| (value * 65535.0).round().clamp(0.0, 65535.0) as u16;
        self.brightness.iter().map(level).collect()
    }
}

/// A printed plate before one camera.
pub struct PlateView<'a> {
    /// The camera.
    pub camera: &'a CameraOptics,
    /// Where the plate is.
    pub camera_from_plate: RigidTransform,
    /// What is on it.
    pub pattern: Pattern,
    /// Height (along the plate's z) of its outermost corners over its middle, mm; see
    /// [`super::SceneSettings::bow_mm`]. Only for chessboards.
    pub bow_mm: f64,
    /// By how much its print is displaced, if it is.
    pub displaced: Option<Displaced>,
}

impl PlateView<'_> {
    /// The point of the plate that a pixel sees, (x, y) in the plate's frame, mm.
    pub(super) fn plate_point(&self, pixel: PixelPoint) -> Option<Vector2<f64>> {
        let ray = self
            .camera
            .ray(pixel)?
            .transformed(&self.camera_from_plate.inverse());
        // The face is seen by rays along the plate's z.
        let cos = ray.direction.z;
        if cos.is_nan() || cos <= MIN_FACING_COS {
            return None;
        }
        let at_height = |z: f64| {
            let lambda = (z - ray.origin_mm.z) / ray.direction.z;
            (lambda > 0.0).then(|| (ray.origin_mm + ray.direction * lambda).xy())
        };
        let mut point = at_height(0.0)?;
        if let (Pattern::Chessboard(board), true) = (&self.pattern, self.bow_mm != 0.0) {
            let (width_mm, height_mm) = board.extent_mm();
            // The bow is shallow: each round gains at least two digits.
            for _ in 0..8 {
                let x = (2.0 * point.x / width_mm - 1.0).clamp(-1.5, 1.5);
                let y = (2.0 * point.y / height_mm - 1.0).clamp(-1.5, 1.5);
                point = at_height(self.bow_mm * (x * x + y * y) / 2.0)?;
            }
        }
        Some(point)
    }

    /// Largest distance between interpolated and exact plate points, px, over cells that are
    /// interpolated and lie on the plate.
    #[cfg(test)]
    pub(super) fn lattice_error_px(&self) -> f64 {
        let sensor = self.camera.sensor();
        let lattice = Lattice::new(self, 0);
        let [left, right, top, bottom] = self.pattern.plate_mm();
        let mut worst = 0.0_f64;
        for j in 0..sensor.height / 5 {
            let row = lattice.row(f64::from(j) * 5.03);
            for i in 0..sensor.width / 5 {
                let column = lattice.place(f64::from(i) * 5.01);
                let (Some(cell), Some(exact)) = (
                    row.cell(self, &column),
                    self.plate_point(PixelPoint::new(column.at_px, row.v)),
                ) else {
                    continue;
                };
                if (left..right).contains(&exact.x) && (top..bottom).contains(&exact.y) {
                    let mm_per_px = cell.by_u.norm().min(cell.by_v.norm());
                    worst = worst.max((cell.point - exact).norm() / mm_per_px);
                }
            }
        }
        worst
    }

    /// The image, without sensor noise.
    pub fn render(&self, settings: &RenderSettings) -> Rendered {
        let sensor = self.camera.sensor();
        let (width, height) = (sensor.width as usize, sensor.height as usize);
        let kernel = Kernel::new(settings.blur_px);
        let lattice = Lattice::new(self, kernel.margin_px);
        let mut brightness = vec![0.0_f32; width * height];
        brightness
            .par_chunks_mut(width * STRIP)
            .enumerate()
            .for_each(|(strip, rows)| {
                let first = (strip * STRIP) as i64;
                self.render_strip(settings, &kernel, &lattice, first, rows);
            });
        Rendered { sensor, brightness }
    }

    /// Renders the rows of pixels from `first` on into `out`.
    fn render_strip(
        &self,
        settings: &RenderSettings,
        kernel: &Kernel,
        lattice: &Lattice,
        first: i64,
        out: &mut [f32],
    ) {
        let sensor = self.camera.sensor();
        let width = sensor.width as usize;
        let row_count = out.len() / width;
        let margin = kernel.margin_px;
        let cell_width = (width + 2 * margin) * CELLS;
        let cell_height = (row_count + 2 * margin) * CELLS;
        let top = first - margin as i64;
        // One row of cells at a time: shaded, then folded along u.
        let columns: Vec<Place> = (0..cell_width)
            .map(|cell_col| lattice.place(cell_center(-(margin as i64), cell_col)))
            .collect();
        let folded: Vec<Vec<f32>> = (0..cell_height)
            .map(|cell_row| {
                let row = lattice.row(cell_center(top, cell_row));
                let shades: Vec<f32> = columns
                    .iter()
                    .map(|column| self.shade(settings, row.cell(self, column).as_ref()))
                    .collect();
                (0..width)
                    .map(|col| kernel.fold(&shades[col * CELLS..]))
                    .collect()
            })
            .collect();
        for (row, line) in out.chunks_mut(width).enumerate() {
            let v = (first as f64 + row as f64) / f64::from(sensor.height) - 0.5;
            for (col, value) in line.iter_mut().enumerate() {
                let u = col as f64 / width as f64 - 0.5;
                let light = 1.0 + settings.gradient[0] * u + settings.gradient[1] * v;
                let sum: f32 = kernel
                    .weights
                    .iter()
                    .zip(&folded[row * CELLS..])
                    .map(|(weight, cells)| weight * cells[col])
                    .sum();
                *value = sum * light as f32;
            }
        }
    }

    /// Mean brightness of a cell.
    fn shade(&self, settings: &RenderSettings, cell: Option<&Cell>) -> f32 {
        let value = |ink: Option<f32>| match ink {
            Some(ink) => settings.black as f32 + ink * (settings.white - settings.black) as f32,
            None => settings.background as f32,
        };
        let Some(cell) = cell else {
            return value(None);
        };
        let middle = match &self.displaced {
            Some(displaced) => cell.point - displaced.at(&cell.point),
            None => cell.point,
        };
        let center = self.pattern.shade(middle.x, middle.y);
        if center.edge_mm > cell.reach_mm {
            return value(center.ink);
        }
        let offset = |k: usize| ((k as f64 + 0.5) / SAMPLES as f64 - 0.5) / CELLS as f64;
        // Half the width of a sample's share of the cell.
        let area_mm2 = (cell.by_u.x * cell.by_v.y - cell.by_u.y * cell.by_v.x).abs();
        let half_mm = 0.5 * area_mm2.sqrt() / (SAMPLES * CELLS) as f64;
        let mut sum = 0.0;
        for j in 0..SAMPLES {
            for i in 0..SAMPLES {
                let point = middle + cell.by_u * offset(i) + cell.by_v * offset(j);
                let shade = self.pattern.shade(point.x, point.y);
                let across = (0.5 - 0.5 * shade.edge_mm / half_mm).max(0.0) as f32;
                sum += value(shade.ink) * (1.0 - across) + value(shade.beyond) * across;
            }
        }
        sum / (SAMPLES * SAMPLES) as f32
    }
}

/// Center of a cell, px, if cell 0 is the first of the pixel `first`.
fn cell_center(first: i64, cell: usize) -> f64 {
    first as f64 - 0.5 + (cell as f64 + 0.5) / CELLS as f64
}

/// Where the middle of a cell falls on the plate, and its derivative by the pixel.
struct Cell {
    point: Vector2<f64>,
    by_u: Vector2<f64>,
    by_v: Vector2<f64>,
    /// No point of the cell is farther from its middle, mm.
    reach_mm: f64,
}

/// Weights of a row of cells for the pixel in its middle.
struct Kernel {
    weights: Vec<f32>,
    /// Whole pixels on either side of the middle one.
    margin_px: usize,
}

impl Kernel {
    fn new(blur_px: f64) -> Self {
        let margin_px = (4.0 * blur_px).ceil() as usize;
        let count = (2 * margin_px + 1) * CELLS;
        let raw: Vec<f64> = (0..count)
            .map(|k| {
                let x = (k as f64 + 0.5) / CELLS as f64 - (margin_px as f64 + 0.5);
                if blur_px > 0.0 {
                    // The Gaussian over the pixel's width, integrated by Simpson's rule.
                    let gauss = |x: f64| (-0.5 * (x / blur_px).powi(2)).exp();
                    (0..=32)
                        .map(|i| {
                            let weight = match i {
                                0 | 32 => 1.0,
                                _ if i % 2 == 1 => 4.0,
                                _ => 2.0,
                            };
                            weight * gauss(x - 0.5 + f64::from(i) / 32.0)
                        })
                        .sum()
                } else if x.abs() < 0.5 {
                    1.0
                } else {
                    0.0
                }
            })
            .collect();
        let sum: f64 = raw.iter().sum();
        Self {
            weights: raw.iter().map(|weight| (weight / sum) as f32).collect(),
            margin_px,
        }
    }

    fn fold(&self, cells: &[f32]) -> f32 {
        self.weights
            .iter()
            .zip(cells)
            .map(|(weight, cell)| weight * cell)
            .sum()
    }
}

/// Exact plate points on a lattice of pixels, and the cubic between them.
struct Lattice {
    /// Pixel of the first node along u and v.
    first_px: f64,
    columns: usize,
    nodes: Vec<Option<Vector2<f64>>>,
}

impl Lattice {
    fn new(view: &PlateView, margin_px: usize) -> Self {
        let sensor = view.camera.sensor();
        // One node more than needed on every side: a cubic takes two to either side.
        let before = margin_px + 2 * LATTICE_PX;
        let count = |size: u32| (size as usize + 2 * before).div_ceil(LATTICE_PX) + 1;
        let (columns, rows) = (count(sensor.width), count(sensor.height));
        let first_px = -(before as f64);
        let node = |index: usize| first_px + (index * LATTICE_PX) as f64;
        let nodes = (0..rows * columns)
            .into_par_iter()
            .map(|k| view.plate_point(PixelPoint::new(node(k % columns), node(k / columns))))
            .collect();
        Self {
            first_px,
            columns,
            nodes,
        }
    }

    /// Which nodes a coordinate lies between.
    fn place(&self, at_px: f64) -> Place {
        let x = (at_px - self.first_px) / LATTICE_PX as f64;
        let index = x.floor();
        let (weights, slopes) = cubic(x - index);
        Place {
            at_px,
            first: index as usize - 1,
            weights,
            slopes: slopes.map(|slope| slope / LATTICE_PX as f64),
        }
    }

    /// The lattice interpolated along v.
    fn row(&self, v: f64) -> LatticeRow {
        let place = self.place(v);
        let nodes = (0..self.columns)
            .map(|column| {
                let mut point = Vector2::zeros();
                let mut by_v = Vector2::zeros();
                let mut found = 0;
                for k in 0..4 {
                    if let Some(node) = self.nodes[(place.first + k) * self.columns + column] {
                        point += node * place.weights[k];
                        by_v += node * place.slopes[k];
                        found += 1;
                    }
                }
                RowNode { point, by_v, found }
            })
            .collect();
        LatticeRow { v, nodes }
    }
}

/// A coordinate between nodes `first + 1` and `first + 2`, and the cubic's weights there.
struct Place {
    at_px: f64,
    first: usize,
    weights: [f64; 4],
    /// Derivative of the weights, per px.
    slopes: [f64; 4],
}

/// One row of cells: the lattice's columns at its height.
struct LatticeRow {
    v: f64,
    nodes: Vec<RowNode>,
}

struct RowNode {
    point: Vector2<f64>,
    by_v: Vector2<f64>,
    /// How many of the four nodes above and below have a plate point.
    found: u32,
}

impl LatticeRow {
    /// `None` where no point of the plate's plane is seen.
    #[inline]
    fn cell(&self, view: &PlateView, column: &Place) -> Option<Cell> {
        let nodes = &self.nodes[column.first..column.first + 4];
        let found: u32 = nodes.iter().map(|node| node.found).sum();
        let (mut point, mut by_u, mut by_v) =
            (Vector2::zeros(), Vector2::zeros(), Vector2::zeros());
        match found {
            0 => return None,
            16 => {
                for (k, node) in nodes.iter().enumerate() {
                    point += node.point * column.weights[k];
                    by_u += node.point * column.slopes[k];
                    by_v += node.by_v * column.weights[k];
                }
            }
            _ => {
                const STEP_PX: f64 = 0.05;
                let (u, v) = (column.at_px, self.v);
                let exact = |u: f64, v: f64| view.plate_point(PixelPoint::new(u, v));
                point = exact(u, v)?;
                by_u = (exact(u + STEP_PX, v)? - point) / STEP_PX;
                by_v = (exact(u, v + STEP_PX)? - point) / STEP_PX;
            }
        }
        // The L1 norm is no less than the length, and cheaper.
        let reach_mm = (by_u.abs().sum() + by_v.abs().sum()) * 0.5 / CELLS as f64;
        Some(Cell {
            point,
            by_u,
            by_v,
            reach_mm,
        })
    }
}

/// Lagrange weights of the nodes -1, 0, 1, 2 at t in [0, 1], and their derivatives.
fn cubic(t: f64) -> ([f64; 4], [f64; 4]) {
    let weights = [
        -t * (t - 1.0) * (t - 2.0) / 6.0,
        (t + 1.0) * (t - 1.0) * (t - 2.0) / 2.0,
        -(t + 1.0) * t * (t - 2.0) / 2.0,
        (t + 1.0) * t * (t - 1.0) / 6.0,
    ];
    let slopes = [
        -(3.0 * t * t - 6.0 * t + 2.0) / 6.0,
        (3.0 * t * t - 4.0 * t - 1.0) / 2.0,
        -(3.0 * t * t - 2.0 * t - 2.0) / 2.0,
        (3.0 * t * t - 1.0) / 6.0,
    ];
    (weights, slopes)
}
