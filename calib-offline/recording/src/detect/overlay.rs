//! The image with what was found in it drawn over: for people to check the labels.

use super::Detection;
use super::verdict::{ImageVerdict, MissingCorner, Outcome};
use crate::dataset::Dataset;
use crate::dataset::image::GrayImage;
use calib_rays::geometry::PixelPoint;
use calib_rays::in_order;
use calib_rays::observed::{Corner, View};
use calib_rays::progress::Progress;
use calib_rays::remedy::Remedy;
use image::{Rgb, RgbImage};
use nalgebra::{Matrix2, Vector2};
use std::path::{Path, PathBuf};

const FIRST: Rgb<u8> = Rgb([255, 60, 60]);
const ROW_ZERO: Rgb<u8> = Rgb([255, 160, 0]);
const OTHER: Rgb<u8> = Rgb([0, 220, 90]);
const EDGE: Rgb<u8> = Rgb([80, 160, 255]);
const MISSING: Rgb<u8> = Rgb([255, 0, 255]);
const REFUSED: Rgb<u8> = Rgb([255, 0, 0]);

/// Pixels of the overlay per pixel of a small image, so that digits can be read.
const ENLARGED_BELOW_PX: u32 = 1000;
/// An ellipse is drawn with so many straight sides.
const ELLIPSE_SIDES: u32 = 72;

/// The image, each row of corners joined by a line: row 0 orange, the first corner a red square, a
/// dot on every other, row and column numbers at the rows' and columns' beginnings. An empty diamond
/// stands where a corner of the board should be and was not found; how many these are is at the top
/// left. A refused image is framed in red.
pub fn draw(image: &GrayImage, view: Option<&View>, verdict: &ImageVerdict) -> RgbImage {
    let mut canvas = Canvas::new(image);
    if matches!(verdict.outcome, Outcome::Refused(_)) {
        canvas.frame();
    }
    if let Some(view) = view {
        canvas.corners(&view.corners);
    }
    canvas.missing(&verdict.missing);
    canvas.image
}

/// An image to draw on, in pixels of the image below.
pub struct Canvas {
    image: RgbImage,
    /// Pixels drawn per pixel of the image.
    scale: u32,
}

impl Canvas {
    /// The image in gray; a small one is enlarged.
    pub fn new(image: &GrayImage) -> Self {
        let scale = if image.sensor.width.max(image.sensor.height) < ENLARGED_BELOW_PX {
            2
        } else {
            1
        };
        Self {
            image: enlarged(image, scale),
            scale,
        }
    }

    fn place(&self, u: f64, v: f64) -> (f64, f64) {
        let on = |x: f64| (x + 0.5) * f64::from(self.scale) - 0.5;
        (on(u), on(v))
    }

    /// A red frame: refused.
    pub fn frame(&mut self) {
        frame(&mut self.image);
    }

    /// Labelled corners as [`draw`] shows them; they come by row and column.
    pub fn corners(&mut self, corners: &[Corner]) {
        for pair in corners.windows(2) {
            if let [a, b] = pair
                && a.row == b.row
            {
                let color = if a.row == 0 { ROW_ZERO } else { OTHER };
                let from = self.place(a.pixel.u, a.pixel.v);
                let to = self.place(b.pixel.u, b.pixel.v);
                line(&mut self.image, from, to, color);
            }
        }
        for corner in corners {
            let at = self.place(corner.pixel.u, corner.pixel.v);
            let first = (corner.row, corner.col) == (0, 0);
            let color = match (first, corner.row) {
                (true, _) => FIRST,
                (_, 0) => ROW_ZERO,
                _ => OTHER,
            };
            square(&mut self.image, at, if first { 6 } else { 2 }, color);
            if corner.col == 0 {
                let beside = (at.0 - 22.0, at.1 - 6.0);
                number(&mut self.image, beside, corner.row, color);
            }
            if corner.row == 0 {
                let above = (at.0 + 4.0, at.1 - 18.0);
                number(&mut self.image, above, corner.col, color);
            }
        }
    }

    /// Corners that were not found: a diamond on each in the image, and their number.
    fn missing(&mut self, missing: &[MissingCorner]) {
        let places: Vec<PixelPoint> = missing.iter().filter_map(|c| c.pixel).collect();
        for pixel in &places {
            let at = self.place(pixel.u, pixel.v);
            diamond(&mut self.image, at, MISSING);
        }
        if !places.is_empty() {
            let legend = (2.0 * DIAMOND_PX, 2.0 * DIAMOND_PX);
            diamond(&mut self.image, legend, MISSING);
            let beside = (legend.0 + 2.0 * DIAMOND_PX, legend.1 - 2.5 * DOT_PX as f64);
            number(&mut self.image, beside, places.len(), MISSING);
        }
    }

    /// The ellipse that `shape` makes of the unit circle, about `middle`, px.
    pub fn ellipse(&mut self, middle: &Vector2<f64>, shape: &Matrix2<f64>) {
        let point = |k: u32| {
            let angle = std::f64::consts::TAU * f64::from(k) / f64::from(ELLIPSE_SIDES);
            middle + shape * Vector2::new(angle.cos(), angle.sin())
        };
        for k in 0..ELLIPSE_SIDES {
            let (from, to) = (point(k), point(k + 1));
            let (from, to) = (self.place(from.x, from.y), self.place(to.x, to.y));
            line(&mut self.image, from, to, EDGE);
        }
    }
}

/// Why overlays could not be written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum OverlayError {
    /// The folder cannot be made.
    #[error("cannot make the folder {folder} for overlays: {source}")]
    Folder {
        /// The folder.
        folder: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// A file cannot be written.
    #[error("cannot write the overlay {path}: {source}")]
    Write {
        /// The file.
        path: PathBuf,
        /// What the encoder or the system said.
        source: image::ImageError,
    },
}

impl Remedy for OverlayError {
    fn remedy(&self) -> Option<String> {
        Some("choose another folder for --overlay".to_owned())
    }
}

/// Writes the overlay of every image that can be read to `CAMERA_POSE.png` in the folder, which is
/// made if need be. Files of these names are replaced.
///
/// # Errors
/// [`OverlayError`].
pub fn write_all(
    folder: &Path,
    dataset: &Dataset,
    detection: &Detection,
    progress: &dyn Progress,
) -> Result<(), OverlayError> {
    save_all(folder, &detection.images, progress, |verdict| {
        let camera = dataset.cameras.get(verdict.camera_idx)?;
        // An unreadable image has its verdict; there is nothing to draw on.
        let image = GrayImage::load(&verdict.path).ok()?;
        let of_image = |v: &&View| (v.camera_idx, v.pose) == (verdict.camera_idx, verdict.pose);
        let view = detection.views.iter().find(of_image);
        let name = format!("{}_{:03}.png", camera.name, verdict.pose);
        Some((name, draw(&image, view, verdict)))
    })
}

/// Writes what `drawn` makes of each item, under the name it gives, to the folder, which is made if
/// need be.
pub(super) fn save_all<T: Sync, I: Into<RgbImage>>(
    folder: &Path,
    items: &[T],
    progress: &dyn Progress,
    drawn: impl Fn(&T) -> Option<(String, I)> + Sync,
) -> Result<(), OverlayError> {
    std::fs::create_dir_all(folder).map_err(|source| OverlayError::Folder {
        folder: folder.to_path_buf(),
        source,
    })?;
    progress.begin("drawing overlays", items.len());
    let written = in_order::try_map(items, |item| {
        if let Some((name, image)) = drawn(item) {
            let path = folder.join(name);
            let image: RgbImage = image.into();
            image
                .save_with_format(&path, image::ImageFormat::Png)
                .map_err(|source| OverlayError::Write { path, source })?;
        }
        progress.advance();
        Ok(())
    });
    progress.end();
    written.map(drop)
}

impl From<Canvas> for RgbImage {
    fn from(canvas: Canvas) -> Self {
        canvas.image
    }
}

fn enlarged(image: &GrayImage, scale: u32) -> RgbImage {
    let [black, white] = image.quantiles([0.002, 0.998]);
    let gray = image.stretched(black, white);
    let width = image.sensor.width;
    RgbImage::from_fn(width * scale, image.sensor.height * scale, |u, v| {
        let value = gray[(v / scale) as usize * width as usize + (u / scale) as usize];
        Rgb([value, value, value])
    })
}

fn put(canvas: &mut RgbImage, u: i64, v: i64, color: Rgb<u8>) {
    if let (Ok(u), Ok(v)) = (u32::try_from(u), u32::try_from(v))
        && let Some(pixel) = canvas.get_pixel_mut_checked(u, v)
    {
        *pixel = color;
    }
}

fn line(canvas: &mut RgbImage, from: (f64, f64), to: (f64, f64), color: Rgb<u8>) {
    let steps = (to.0 - from.0)
        .abs()
        .max((to.1 - from.1).abs())
        .ceil()
        .max(1.0);
    for k in 0..=steps as i64 {
        let t = k as f64 / steps;
        let (u, v) = (from.0 + t * (to.0 - from.0), from.1 + t * (to.1 - from.1));
        put(canvas, u.round() as i64, v.round() as i64, color);
    }
}

fn square(canvas: &mut RgbImage, at: (f64, f64), half: i64, color: Rgb<u8>) {
    let (u, v) = (at.0.round() as i64, at.1.round() as i64);
    for k in -half..=half {
        for side in [-half, half] {
            put(canvas, u + k, v + side, color);
            put(canvas, u + side, v + k, color);
        }
    }
}

/// From the middle of a diamond to its corners, px.
const DIAMOND_PX: f64 = 7.0;

fn diamond(canvas: &mut RgbImage, (u, v): (f64, f64), color: Rgb<u8>) {
    // Two lines wide.
    for reach in [DIAMOND_PX, DIAMOND_PX - 1.0] {
        let tips = [
            (u - reach, v),
            (u, v - reach),
            (u + reach, v),
            (u, v + reach),
        ];
        for k in 0..4 {
            line(canvas, tips[k], tips[(k + 1) % 4], color);
        }
    }
}

fn frame(canvas: &mut RgbImage) {
    let (width, height) = (i64::from(canvas.width()), i64::from(canvas.height()));
    for k in 0..4 {
        for u in 0..width {
            put(canvas, u, k, REFUSED);
            put(canvas, u, height - 1 - k, REFUSED);
        }
        for v in 0..height {
            put(canvas, k, v, REFUSED);
            put(canvas, width - 1 - k, v, REFUSED);
        }
    }
}

/// 3 x 5 dots per digit, rows from the top, three bits each.
const DIGITS: [[u8; 5]; 10] = [
    [7, 5, 5, 5, 7],
    [2, 6, 2, 2, 7],
    [7, 1, 7, 4, 7],
    [7, 1, 7, 1, 7],
    [5, 5, 7, 1, 1],
    [7, 4, 7, 1, 7],
    [7, 4, 7, 5, 7],
    [7, 1, 1, 1, 1],
    [7, 5, 7, 5, 7],
    [7, 5, 7, 1, 7],
];
/// Pixels per dot of a digit.
const DOT_PX: i64 = 2;

fn number(canvas: &mut RgbImage, at: (f64, f64), value: usize, color: Rgb<u8>) {
    let (mut u, v) = (at.0.round() as i64, at.1.round() as i64);
    for character in value.to_string().bytes() {
        let rows = DIGITS[usize::from(character - b'0')];
        for (row, bits) in (0i64..).zip(rows) {
            for column in 0..3i64 {
                if bits >> (2 - column) & 1 == 1 {
                    for k in 0..DOT_PX * DOT_PX {
                        let (du, dv) = (column * DOT_PX + k % DOT_PX, row * DOT_PX + k / DOT_PX);
                        put(canvas, u + du, v + dv, color);
                    }
                }
            }
        }
        u += 4 * DOT_PX;
    }
}
