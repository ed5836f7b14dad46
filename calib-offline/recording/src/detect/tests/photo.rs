//! A small renderer: a flat board through a pinhole, averaged over each pixel, blurred, noisy.

use crate::dataset::image::GrayImage;
use calib_rays::board::BoardSpec;
use calib_rays::geometry::{PixelPoint, SensorSize, so3};
use nalgebra::{Matrix3, Vector3};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};
use std::path::Path;

/// A photo to be taken.
#[derive(Debug, Clone)]
pub struct Photo {
    pub board: BoardSpec,
    pub sensor: SensorSize,
    /// Pixel of a board point (x, y, 1), in squares from the first inner corner.
    pub px_from_board: Matrix3<f64>,
    /// Whether the square before the first corner is dark.
    pub dark_first: bool,
    /// White margin around the squares, squares.
    pub margin: f64,
    /// Code values of dark and bright squares and of the background.
    pub levels: [f64; 3],
    /// Standard deviation of the lens blur, px.
    pub blur_px: f64,
    /// Standard deviation of the noise, code values.
    pub noise: f64,
    /// Rectangles (u0, v0, u1, v1) and their code value, laid over everything.
    pub covers: Vec<([f64; 4], f64)>,
    /// Left and right exchanged, as in a mirror.
    pub mirrored: bool,
}

/// A board turned in its plane by `turn_deg`, then tilted about u and v (degrees), its middle
/// `right_mm`, `down_mm` off the axis of a camera with 600 px focal length, 240 mm away.
pub fn tilted(
    board: BoardSpec,
    turn_deg: f64,
    tilt_deg: [f64; 2],
    right_mm: f64,
    down_mm: f64,
) -> Photo {
    let axis = |x: f64, y: f64, z: f64| so3::exp(&Vector3::new(x, y, z));
    let rotation = axis(tilt_deg[0].to_radians(), 0.0, 0.0)
        * axis(0.0, tilt_deg[1].to_radians(), 0.0)
        * axis(0.0, 0.0, turn_deg.to_radians());
    let camera = Matrix3::new(600.0, 0.0, 319.5, 0.0, 600.0, 239.5, 0.0, 0.0, 1.0);
    let middle = board.center_in_board();
    let position = Vector3::new(right_mm, down_mm, 240.0) - rotation * middle;
    let square = board.square_mm;
    let columns = [
        rotation.column(0) * square,
        rotation.column(1) * square,
        position,
    ];
    Photo {
        board,
        sensor: super::SENSOR,
        px_from_board: camera * Matrix3::from_columns(&columns),
        dark_first: true,
        margin: 0.6,
        levels: [30.0, 220.0, 100.0],
        blur_px: 0.7,
        noise: 1.0,
        covers: Vec::new(),
        mirrored: false,
    }
}

/// Samples per pixel along u and v.
const OVERSAMPLING: u32 = 5;

impl Photo {
    pub fn true_corner(&self, row: usize, col: usize) -> PixelPoint {
        let p = self.px_from_board * Vector3::new(col as f64, row as f64, 1.0);
        let u = p.x / p.z;
        let mirrored_u = f64::from(self.sensor.width) - 1.0 - u;
        PixelPoint::new(if self.mirrored { mirrored_u } else { u }, p.y / p.z)
    }

    pub fn take(&self) -> GrayImage {
        let (width, height) = (self.sensor.width as usize, self.sensor.height as usize);
        let mut values = vec![0.0; width * height];
        let board_from_px = self.px_from_board.try_inverse().unwrap();
        for (i, value) in values.iter_mut().enumerate() {
            let (u, v) = ((i % width) as f64, (i / width) as f64);
            *value = self.mean_over_pixel(&board_from_px, u, v);
        }
        blur(&mut values, width, self.blur_px);
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let noise = Normal::new(0.0, self.noise).unwrap();
        for value in &mut values {
            *value = (*value + noise.sample(&mut rng)).round().clamp(0.0, 255.0);
        }
        if self.mirrored {
            for row in values.chunks_mut(width) {
                row.reverse();
            }
        }
        let values = values.iter().map(|&v| v as f32).collect();
        GrayImage::from_values(self.sensor, values, 255.0).unwrap()
    }

    pub fn save(&self, path: &Path) {
        let image = self.take();
        let bytes: Vec<u8> = image.values().map(|v| v as u8).collect();
        image::GrayImage::from_raw(self.sensor.width, self.sensor.height, bytes)
            .unwrap()
            .save(path)
            .unwrap();
    }

    fn mean_over_pixel(&self, board_from_px: &Matrix3<f64>, u: f64, v: f64) -> f64 {
        let at_corner = [(-0.5, -0.5), (0.5, -0.5), (-0.5, 0.5), (0.5, 0.5)]
            .map(|(du, dv)| self.brightness(board_from_px, u + du, v + dv));
        // Squares are many pixels wide: a pixel with four equal corners is of one color.
        if at_corner.iter().all(|&b| b == at_corner[0]) {
            return at_corner[0];
        }
        let step = 1.0 / f64::from(OVERSAMPLING);
        let sub = |k: u32| (f64::from(k) + 0.5) * step - 0.5;
        let mut sum = 0.0;
        for k in 0..OVERSAMPLING * OVERSAMPLING {
            let (u, v) = (u + sub(k % OVERSAMPLING), v + sub(k / OVERSAMPLING));
            sum += self.brightness(board_from_px, u, v);
        }
        sum / f64::from(OVERSAMPLING * OVERSAMPLING)
    }

    fn brightness(&self, board_from_px: &Matrix3<f64>, u: f64, v: f64) -> f64 {
        for &([u0, v0, u1, v1], value) in &self.covers {
            if (u0..u1).contains(&u) && (v0..v1).contains(&v) {
                return value;
            }
        }
        let p = board_from_px * Vector3::new(u, v, 1.0);
        let (x, y) = (p.x / p.z, p.y / p.z);
        let [dark, bright, background] = self.levels;
        let beyond = |x: f64, count: usize| (-1.0 - x).max(x - count as f64);
        let outside = beyond(x, self.board.cols).max(beyond(y, self.board.rows));
        if outside > self.margin {
            background
        } else if outside > 0.0 {
            bright
        } else {
            let even = (x.floor() + y.floor()).rem_euclid(2.0) == 0.0;
            if even == self.dark_first {
                dark
            } else {
                bright
            }
        }
    }
}

pub fn blur(values: &mut [f64], width: usize, sigma_px: f64) {
    if sigma_px <= 0.0 {
        return;
    }
    let reach = (4.0 * sigma_px).ceil() as i64;
    let kernel: Vec<f64> = (-reach..=reach)
        .map(|k| (-0.5 * (k as f64 / sigma_px).powi(2)).exp())
        .collect();
    let total: f64 = kernel.iter().sum();
    let height = values.len() / width;
    for stride in [1, width] {
        let extent = if stride == 1 { width } else { height } as i64;
        let source = values.to_vec();
        for (i, value) in values.iter_mut().enumerate() {
            let at = if stride == 1 { i % width } else { i / width } as i64;
            let sum: f64 = (-reach..=reach)
                .zip(&kernel)
                .map(|(k, weight)| {
                    let shifted = (at + k).clamp(0, extent - 1) - at;
                    weight * source[(i as i64 + shifted * stride as i64) as usize]
                })
                .sum();
            *value = sum / total;
        }
    }
}
