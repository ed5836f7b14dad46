//! Pictures as an ideal pinhole would have taken them, and the maps that make them of a camera's own.
//!
//! A map says for each pixel of the view which pixel of the camera sees the same point of a plane: the one at a distance in front of the view, across
//! its axis. Where rays do not meet in a point, things elsewhere are seen beside their place; that is the loss.

use super::NamedFile;
use super::dense::IN_MASK;
use super::loss::Loss;
use super::npy;
use super::projector::Projector;
use calib_rays::geometry::{PixelPoint, RigidTransform, SensorSize};
use nalgebra::Vector3;
use rayon::prelude::*;
use serde_json::{Value, json};

/// What a map has where no ray goes.
pub const OUTSIDE: f32 = -1.0;
/// Parts of a pixel in `OpenCV`'s maps in whole numbers.
const PARTS: i64 = 32;
/// Nearer and farther planes at which the loss is taken, as shares of the distance.
const ELSEWHERE: [f64; 2] = [0.5, 2.0];
/// Places along the longer side at which it is taken.
const LOSS_PLACES: u32 = 160;

/// An ideal pinhole.
#[derive(Debug, Clone, PartialEq)]
pub struct View {
    /// The camera whose picture it shows.
    pub camera: String,
    /// Its size.
    pub size: SensorSize,
    /// `[fx, fy]`, px.
    pub focal_px: [f64; 2],
    /// `[cx, cy]`, px.
    pub center_px: [f64; 2],
    /// Where it is.
    pub rig_from_view: RigidTransform,
    /// The plane that it is exact for: z in its frame, mm.
    pub plane_mm: f64,
}

/// A view, and where the camera sees what it shows.
#[derive(Debug, Clone, PartialEq)]
pub struct ViewMap {
    /// The view.
    pub view: View,
    /// The camera's own sensor.
    pub camera_sensor: SensorSize,
    /// u and v for each pixel, row by row; (-1, -1) where no ray goes.
    pub pixels: Vec<[f32; 2]>,
    /// By how much the view is off at half the distance and at twice that.
    pub loss: Loss,
}

impl View {
    /// The point of a plane that a place of the view shows, in its own frame.
    pub(super) fn point(&self, pixel: PixelPoint, z_mm: f64) -> Vector3<f64> {
        let x = (pixel.u - self.center_px[0]) / self.focal_px[0];
        let y = (pixel.v - self.center_px[1]) / self.focal_px[1];
        Vector3::new(x, y, 1.0) * z_mm
    }

    /// Where it shows a point in front of it, of its own frame.
    fn pixel(&self, point: &Vector3<f64>) -> PixelPoint {
        PixelPoint::new(
            self.center_px[0] + self.focal_px[0] * point.x / point.z,
            self.center_px[1] + self.focal_px[1] * point.y / point.z,
        )
    }

    /// Where the camera sees what a pixel of the view shows.
    pub(super) fn seen_by(&self, camera: &Projector<'_>, pixel: PixelPoint) -> Option<PixelPoint> {
        camera.pixel(&self.rig_from_view.point(&self.point(pixel, self.plane_mm)))
    }

    /// The camera matrix, row by row.
    pub fn camera_matrix(&self) -> [f64; 9] {
        let ([fx, fy], [cx, cy]) = (self.focal_px, self.center_px);
        [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0]
    }

    /// Its map. Cost: some four rays a pixel, rows in parallel.
    pub(super) fn map(self, camera: &Projector<'_>) -> ViewMap {
        let rows: Vec<Vec<[f32; 2]>> = (0..self.size.height)
            .into_par_iter()
            .map(|v| {
                let at = |u: u32| PixelPoint::new(f64::from(u), f64::from(v));
                (0..self.size.width)
                    .map(|u| match self.seen_by(camera, at(u)) {
                        Some(pixel) => [pixel.u as f32, pixel.v as f32],
                        None => [OUTSIDE; 2],
                    })
                    .collect()
            })
            .collect();
        let loss = self.loss(camera, &rows);
        ViewMap {
            view: self,
            camera_sensor: camera.lens.lens.sensor,
            pixels: rows.concat(),
            loss,
        }
    }

    fn loss(&self, camera: &Projector<'_>, rows: &[Vec<[f32; 2]>]) -> Loss {
        let view_from_rig = self.rig_from_view.inverse();
        let SensorSize { width, height } = self.size;
        let step = (width.max(height) / LOSS_PLACES).max(1) as usize;
        let mut each = Vec::new();
        for (v, row) in rows.iter().enumerate().step_by(step) {
            for (u, seen) in row.iter().enumerate().step_by(step) {
                if *seen == [OUTSIDE; 2] {
                    continue;
                }
                let [map_u, map_v] = seen.map(f64::from);
                for share in ELSEWHERE {
                    let z_mm = share * self.plane_mm;
                    let pixel = PixelPoint::new(map_u, map_v);
                    // A map's f32 may round out of the calibrated area.
                    let Some(point) = camera.on_plane(pixel, &view_from_rig, z_mm) else {
                        continue;
                    };
                    let shown = PixelPoint::new(u as f64, v as f64);
                    let off_px = self.pixel(&point).distance_px(shown);
                    let off_mm = (point - self.point(shown, z_mm)).norm();
                    each.push((off_px, off_mm));
                }
            }
        }
        Loss::of_each(&each)
    }
}

impl ViewMap {
    /// Whether any pixel of the view shows anything.
    pub fn is_empty(&self) -> bool {
        self.pixels.iter().all(|pixel| *pixel == [OUTSIDE; 2])
    }

    /// `map_NAME.npy`, `fixed_NAME.npy`, `fraction_NAME.npy`, `mask_NAME.npy`.
    pub fn files(&self) -> Vec<NamedFile> {
        let (height, width) = (
            self.view.size.height as usize,
            self.view.size.width as usize,
        );
        let name = &self.view.camera;
        let floats = self.pixels.as_flattened().iter();
        let floats: Vec<u8> = floats.flat_map(|value| value.to_le_bytes()).collect();
        let (mut whole, mut fraction) = (Vec::new(), Vec::new());
        for pixel in &self.pixels {
            let ([u, v], part) = fixed(*pixel);
            whole.extend(u.to_le_bytes());
            whole.extend(v.to_le_bytes());
            fraction.extend(part.to_le_bytes());
        }
        let in_mask = |pixel: &[f32; 2]| if *pixel == [OUTSIDE; 2] { 0 } else { IN_MASK };
        let mask: Vec<u8> = self.pixels.iter().map(in_mask).collect();
        vec![
            (
                format!("map_{name}.npy"),
                npy::file("<f4", &[height, width, 2], &floats),
            ),
            (
                format!("fixed_{name}.npy"),
                npy::file("<i2", &[height, width, 2], &whole),
            ),
            (
                format!("fraction_{name}.npy"),
                npy::file("<u2", &[height, width], &fraction),
            ),
            (
                format!("mask_{name}.npy"),
                npy::file("|u1", &[height, width], &mask),
            ),
        ]
    }

    /// What an index says of it.
    pub fn entry(&self) -> Value {
        let view = &self.view;
        let name = &view.camera;
        let (height, width) = (view.size.height, view.size.width);
        let rotation: Vec<f64> = view
            .rig_from_view
            .rotation
            .transpose()
            .iter()
            .copied()
            .collect();
        let shown = self
            .pixels
            .iter()
            .filter(|pixel| **pixel != [OUTSIDE; 2])
            .count();
        json!({
            "camera": name,
            "camera_matrix": view.camera_matrix(),
            "rig_from_view": { "rotation": rotation, "translation_mm": view.rig_from_view.translation_mm.as_slice() },
            "plane_mm": view.plane_mm,
            "shown_share": shown as f64 / self.pixels.len().max(1) as f64,
            "map": { "file": format!("map_{name}.npy"), "shape": [height, width, 2], "dtype": "<f4" },
            "fixed": { "file": format!("fixed_{name}.npy"), "shape": [height, width, 2], "dtype": "<i2" },
            "fraction": { "file": format!("fraction_{name}.npy"), "shape": [height, width], "dtype": "<u2" },
            "mask": { "file": format!("mask_{name}.npy"), "shape": [height, width], "dtype": "|u1" },
        })
    }
}

/// What holds of all maps: what their numbers are.
pub(super) fn units() -> Value {
    json!({
        "map": "pixel (u, v) of the camera for each pixel of the view, px; -1, -1 where no ray goes: map1 of cv::remap (CV_32FC2)",
        "fixed": "the same in whole pixels: map1 of cv::remap (CV_16SC2)",
        "fraction": "the rest in 32nds, v * 32 + u: map2 of cv::remap (CV_16UC1)",
        "mask": "255 where a ray goes, else 0",
        "rotation": "row by row",
        "plane_mm": "the map is exact for points with this z in the view's frame",
        "pixel_origin": "center of the top-left pixel is (0, 0)",
    })
}

/// `OpenCV`'s form in whole numbers: 32nds of a pixel, halves to even, split in whole ones and the rest.
fn fixed(pixel: [f32; 2]) -> ([i16; 2], u16) {
    let parts = pixel.map(|value| (f64::from(value) * PARTS as f64).round_ties_even() as i64);
    let whole = parts.map(|part| {
        part.div_euclid(PARTS)
            .clamp(i16::MIN.into(), i16::MAX.into()) as i16
    });
    let [u, v] = parts.map(|part| part.rem_euclid(PARTS) as u16);
    (whole, v * PARTS as u16 + u)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_numbers_are_32nds_with_halves_to_even() {
        assert_eq!(fixed([0.0, 0.0]), ([0, 0], 0));
        assert_eq!(fixed([1.5, 2.25]), ([1, 2], 8 * 32 + 16));
        // 1/64 px is half a part: to 0; 3/64 is one and a half: to 2.
        assert_eq!(fixed([1.0 / 64.0, 3.0 / 64.0]), ([0, 0], 2 * 32));
        assert_eq!(fixed([OUTSIDE, OUTSIDE]), ([-1, -1], 0));
        assert_eq!(fixed([-0.25, 40000.0]), ([-1, 32767], 24));
    }
}
