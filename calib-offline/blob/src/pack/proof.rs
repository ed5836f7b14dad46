//! How far the blob's rays are from the field's: every calibrated pixel, through the runtime that
//! the device runs.

use super::field_rows::FieldRows;
use calib_rays::field::{CalibratedCamera, FieldSample, transport};
use calib_rays::geometry::PixelPoint;
use calib_rays::numerics::median;
use calib_rays::progress::Progress;
use nalgebra::{Matrix2, Vector2, Vector3};
use ray_runtime::format::MAX_CAMERAS;
use ray_runtime::{RayBlob, integer};
use rayon::prelude::*;

/// The comparison of a camera in a blob with its f64 field.
///
/// The error of a pixel is how far its ray is moved on the sensor: the error of its direction,
/// and that of its offset at the working distance, each divided by the mm per px that the field
/// has there; the two are added as if they never canceled. Where the field is so squeezed that a
/// pixel is worth less than a tenth of the usual mm, a tenth is taken.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Proof {
    /// Largest error, px; infinite if the runtime has no ray where there should be one.
    pub worst_error_px: f64,
    /// Where it is.
    pub worst_at: PixelPoint,
    /// Largest distance between a ray and the field's at the working distance, mm.
    pub worst_error_mm: f64,
    /// Root mean square over the pixels compared, px.
    pub rms_error_px: f64,
    /// How many pixels were compared.
    pub pixel_count: usize,
}

/// The rays of a camera in a blob, by its index there: as one of the runtime's arithmetics looks them up.
#[derive(Clone, Copy)]
pub enum Rays<'a> {
    /// That of f32.
    Float(&'a RayBlob<'a>, usize),
    /// That of integers.
    Integer(&'a IntegerRig<'a>, usize),
}

/// As many cameras as a blob may hold.
pub type IntegerRig<'a> = integer::Rig<'a, { MAX_CAMERAS as usize }>;

impl Rays<'_> {
    fn lookup(self, pixel: ray_runtime::PixelPoint) -> Option<ray_runtime::Ray> {
        match self {
            Self::Float(blob, camera) => blob.lookup(camera, pixel).ok(),
            Self::Integer(rig, camera) => rig.lookup(camera, pixel).ok(),
        }
    }
}

/// Compares every `stride`-th pixel along both axes (1: all).
pub fn prove(
    camera: &CalibratedCamera,
    rays: Rays<'_>,
    working_distance_mm: f64,
    stride: usize,
    progress: &dyn Progress,
) -> Proof {
    let sensor = camera.field.sensor;
    let columns: Vec<u32> = strided(sensor.width, stride).collect();
    let rows: Vec<u32> = strided(sensor.height, stride).collect();
    let field = FieldRows::new(
        &camera.field,
        columns.iter().map(|u| f64::from(*u)).collect(),
    );
    let judge = Judge::new(camera, rays, working_distance_mm);
    rows.par_iter()
        .map(|&v| {
            let row = field.row(f64::from(v));
            let compared = columns.iter().enumerate().filter_map(|(k, &u)| {
                let pixel = PixelPoint::new(f64::from(u), f64::from(v));
                judge.compare(pixel, || row.sample(k))
            });
            let proof = compared.fold(Proof::empty(), Proof::merged);
            if v > 0 && v.is_multiple_of(ROWS_PER_STEP) {
                progress.advance();
            }
            proof
        })
        .collect::<Vec<_>>()
        .into_iter()
        .fold(Proof::empty(), Proof::merged)
}

/// Compares quarter pixels on both sides of every border between calibrated and other cells of the
/// mask, and along the edge of the sensor: half a pixel to each side, where tables end.
pub fn prove_edges(camera: &CalibratedCamera, rays: Rays<'_>, working_distance_mm: f64) -> Proof {
    let judge = Judge::new(camera, rays, working_distance_mm);
    let mask = &camera.coverage;
    let (width_px, height_px) = mask.cell_size_px();
    let is_covered = |i: Option<usize>, j: Option<usize>| {
        let (Some(i), Some(j)) = (i, j) else {
            return false;
        };
        i < mask.cells_u && j < mask.cells_v && mask.covered[j * mask.cells_u + i]
    };
    // Each border once, as the left or upper edge of the cell behind it: where it starts, and
    // whether it runs along v.
    let mut borders = Vec::new();
    for j in 0..=mask.cells_v {
        for i in 0..=mask.cells_u {
            let own = is_covered(Some(i), Some(j));
            let corner = [i as f64 * width_px - 0.5, j as f64 * height_px - 0.5];
            if j < mask.cells_v && own != is_covered(i.checked_sub(1), Some(j)) {
                borders.push((corner, true));
            }
            if i < mask.cells_u && own != is_covered(Some(i), j.checked_sub(1)) {
                borders.push((corner, false));
            }
        }
    }
    borders
        .par_iter()
        .map(|&([u, v], is_along_v)| {
            let length_px = if is_along_v { height_px } else { width_px };
            let steps = (length_px / QUARTER_PX).floor() as usize;
            let quarter = |x: f64| (x / QUARTER_PX).round() * QUARTER_PX;
            let places = (0..=steps).flat_map(|along| (-2..=2).map(move |across| (along, across)));
            let pixels = places.map(|(along, across)| {
                let (along, across) = (along as f64 * QUARTER_PX, f64::from(across) * QUARTER_PX);
                let (du, dv) = if is_along_v {
                    (across, along)
                } else {
                    (along, across)
                };
                PixelPoint::new(quarter(u) + du, quarter(v) + dv)
            });
            pixels
                .filter_map(|pixel| judge.compare(pixel, || camera.field.sample(pixel)))
                .fold(Proof::empty(), Proof::merged)
        })
        .collect::<Vec<_>>()
        .into_iter()
        .fold(Proof::empty(), Proof::merged)
}

/// Rows that are one step of progress.
const ROWS_PER_STEP: u32 = 256;

/// f32 holds quarter pixels exactly.
const QUARTER_PX: f64 = 0.25;

/// 0, stride, 2 stride ... and the last one.
fn strided(extent: u32, stride: usize) -> impl Iterator<Item = u32> {
    (0..extent).filter(move |k| (*k as usize).is_multiple_of(stride) || *k == extent - 1)
}

impl Proof {
    /// Of a table that the runtime refuses: no pixel has a ray.
    pub fn refused() -> Self {
        Self {
            worst_error_px: f64::INFINITY,
            worst_error_mm: f64::INFINITY,
            ..Self::empty()
        }
    }

    fn empty() -> Self {
        Self {
            worst_error_px: 0.0,
            worst_at: PixelPoint::new(0.0, 0.0),
            worst_error_mm: 0.0,
            rms_error_px: 0.0,
            pixel_count: 0,
        }
    }

    /// Both together.
    pub fn merged(self, other: Self) -> Self {
        let is_worse = other.worst_error_px > self.worst_error_px;
        let sum_of_squares = |p: &Self| p.rms_error_px * p.rms_error_px * p.pixel_count as f64;
        let count = self.pixel_count + other.pixel_count;
        let sum = sum_of_squares(&self) + sum_of_squares(&other);
        let worst = if is_worse { other } else { self };
        Self {
            worst_error_px: worst.worst_error_px,
            worst_at: worst.worst_at,
            worst_error_mm: self.worst_error_mm.max(other.worst_error_mm),
            rms_error_px: (sum / count.max(1) as f64).sqrt(),
            pixel_count: count,
        }
    }
}

/// Compares rays of a blob with the field's.
struct Judge<'a> {
    camera: &'a CalibratedCamera,
    rays: Rays<'a>,
    working_distance_mm: f64,
    max_px_per_mm: f64,
}

impl<'a> Judge<'a> {
    fn new(camera: &'a CalibratedCamera, rays: Rays<'a>, working_distance_mm: f64) -> Self {
        Self {
            camera,
            rays,
            working_distance_mm,
            max_px_per_mm: 10.0 * usual_px_per_mm(camera, working_distance_mm),
        }
    }

    /// The comparison of one pixel; `None` where neither the blob nor the calibration has a ray.
    fn compare(&self, pixel: PixelPoint, exact: impl FnOnce() -> FieldSample) -> Option<Proof> {
        let device_pixel = ray_runtime::PixelPoint::new(pixel.u as f32, pixel.v as f32);
        let ray = self.rays.lookup(device_pixel);
        let [error_px, error_mm] = match (self.camera.coverage.contains(pixel), ray) {
            (true, Some(ray)) => self.errors(&exact(), &ray),
            (false, None) => return None,
            // The masks differ.
            (true, None) | (false, Some(_)) => [f64::INFINITY; 2],
        };
        Some(Proof {
            worst_error_px: error_px,
            worst_at: pixel,
            worst_error_mm: error_mm,
            rms_error_px: error_px,
            pixel_count: 1,
        })
    }

    /// In px, and at the working distance in mm.
    fn errors(&self, exact: &FieldSample, ray: &ray_runtime::Ray) -> [f64; 2] {
        let rig_from_camera = &self.camera.rig_from_camera;
        let turned_back = rig_from_camera.rotation.transpose();
        let in_f64 = |of_ray: [f32; 3]| Vector3::from(of_ray.map(f64::from));
        let origin = in_f64(ray.origin_mm) - rig_from_camera.translation_mm;
        // Both rays in the axes of the exact one: its own direction is z.
        let local_from_rig = transport::frame(&exact.s).transpose() * turned_back;
        let origin = local_from_rig * origin;
        let direction = local_from_rig * in_f64(ray.direction);
        if direction.z <= 0.0 {
            return [f64::INFINITY; 2];
        }
        let slope = direction.xy() / direction.z;
        let direction_error_mm = slope * self.working_distance_mm;
        // Where the ray crosses the plane through the reference point.
        let offset_error_mm = origin.xy() - slope * origin.z - exact.m_mm;
        let px_from_mm = px_from_mm(exact, self.working_distance_mm);
        let error_px =
            self.in_px(px_from_mm, direction_error_mm) + self.in_px(px_from_mm, offset_error_mm);
        let error_mm = direction_error_mm.norm() + offset_error_mm.norm();
        // A field that is no number somewhere cannot have been packed.
        [error_px, error_mm].map(|error| if error.is_nan() { f64::INFINITY } else { error })
    }

    fn in_px(&self, px_from_mm: Option<Matrix2<f64>>, error_mm: Vector2<f64>) -> f64 {
        match px_from_mm {
            Some(px_from_mm) if px_from_mm.norm() <= self.max_px_per_mm => {
                (px_from_mm * error_mm).norm()
            }
            _ => error_mm.norm() * self.max_px_per_mm,
        }
    }
}

/// How the pixel moves when the point at a distance along its ray moves across it; `None` where
/// neighboring pixels see the same.
fn px_from_mm(sample: &FieldSample, distance_mm: f64) -> Option<Matrix2<f64>> {
    let local = Vector3::new(sample.m_mm.x, sample.m_mm.y, distance_mm);
    let turned = transport::local_point_derivative(&sample.s, &local);
    let mm_from_px = turned.fixed_rows::<2>(0) * sample.ds - sample.dm;
    mm_from_px.try_inverse()
}

/// Median px per mm over a coarse lattice of the calibrated area.
pub fn usual_px_per_mm(camera: &CalibratedCamera, distance_mm: f64) -> f64 {
    const STEPS: u32 = 24;
    let sensor = camera.field.sensor;
    let at =
        |k: u32, extent: u32| (f64::from(k) + 0.5) / f64::from(STEPS) * f64::from(extent) - 0.5;
    let scales = (0..STEPS * STEPS)
        .map(|k| PixelPoint::new(at(k % STEPS, sensor.width), at(k / STEPS, sensor.height)))
        .filter(|pixel| camera.coverage.contains(*pixel))
        .filter_map(|pixel| px_from_mm(&camera.field.sample(pixel), distance_mm))
        .map(|px_from_mm| px_from_mm.norm())
        .filter(|scale| scale.is_finite());
    // An area too small to be met by the lattice has no usual scale and no limit either.
    median(scales).unwrap_or(f64::MAX / 10.0)
}
