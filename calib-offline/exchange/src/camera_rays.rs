//! The rays of one camera of a rig in its own frame, and the lattices of pixels that they are taken on.

use super::error::ExchangeError;
use super::fit::Sample;
use calib_blob::rays::{RaySource, SourceCamera};
use calib_rays::geometry::{PixelPoint, Ray, RigidTransform, SensorSize, nearest_point};
use nalgebra::Vector3;

/// With fewer places than this the numbers of a lens hang in the air.
const LEAST_PLACES: usize = 100;

/// A pixel and what it sees, camera frame.
pub(super) type PixelRay = (PixelPoint, Ray);

/// A camera of a rig.
pub(super) struct CameraRays<'a> {
    source: &'a dyn RaySource,
    camera_idx: usize,
    /// The camera.
    pub camera: &'a SourceCamera,
    /// Its rotation orthonormal to the last bit.
    pub rig_from_camera: RigidTransform,
    camera_from_rig: RigidTransform,
}

impl<'a> CameraRays<'a> {
    pub fn new(source: &'a dyn RaySource, camera_idx: usize, camera: &'a SourceCamera) -> Self {
        let rig_from_camera = camera.rig_from_camera.orthonormalized();
        Self {
            source,
            camera_idx,
            camera,
            rig_from_camera,
            camera_from_rig: rig_from_camera.inverse(),
        }
    }

    /// What a pixel sees, camera frame.
    pub fn ray(&self, pixel: PixelPoint) -> Option<Ray> {
        let ray = self.source.ray(self.camera_idx, pixel)?;
        Some(ray.transformed(&self.camera_from_rig))
    }

    /// Columns and rows of an even lattice over the sensor, or over the region that is asked for.
    pub fn lattice(&self, places: u32) -> (Vec<f64>, Vec<f64>) {
        let SensorSize { width, height } = self.camera.sensor;
        let whole = [(0.0, f64::from(width - 1)), (0.0, f64::from(height - 1))];
        let [along_u, along_v] = match self.source.region() {
            Some([first, last]) => [(first.u, last.u), (first.v, last.v)],
            None => whole,
        };
        let length = |(first, last): (f64, f64)| last - first;
        let step = length(along_u).max(length(along_v)).max(1.0) / f64::from(places - 1);
        let along = |side: (f64, f64)| -> Vec<f64> {
            let count = (length(side) / step).round().max(1.0);
            (0..=count as u32)
                .map(|k| side.0 + f64::from(k) / count * length(side))
                .collect()
        };
        (along(along_u), along(along_v))
    }

    /// The calibrated pixels of a lattice with so many places along the longer side of the sensor, row by row, and what they see.
    pub fn on_lattice(&self, places: u32) -> Vec<PixelRay> {
        let (u_px, v_px) = self.lattice(places);
        v_px.iter()
            .flat_map(|v| u_px.iter().map(move |u| PixelPoint::new(*u, *v)))
            .filter_map(|pixel| Some((pixel, self.ray(pixel)?)))
            .collect()
    }

    /// The rays of a lattice to fit a camera to, and the point that comes nearest to all of them.
    ///
    /// # Errors
    /// [`ExchangeError`] if they are few or parallel.
    pub fn to_fit(&self, places: u32) -> Result<(Vec<PixelRay>, Vector3<f64>), ExchangeError> {
        let rays = self.on_lattice(places);
        if rays.len() < LEAST_PLACES {
            return Err(ExchangeError::TooFewRays {
                camera: self.camera.name.clone(),
                have: rays.len(),
                need: LEAST_PLACES,
            });
        }
        let lines: Vec<Ray> = rays.iter().map(|(_, ray)| *ray).collect();
        let center_mm = nearest_point(&lines).ok_or_else(|| self.no_lens("they are parallel"))?;
        Ok((rays, center_mm))
    }

    pub fn no_lens(&self, reason: &'static str) -> ExchangeError {
        ExchangeError::NoPinhole {
            camera: self.camera.name.clone(),
            reason,
        }
    }
}

/// The point that a ray sees at a distance, from a center, mm.
pub(super) fn seen_at(ray: &Ray, distance_mm: f64, center_mm: &Vector3<f64>) -> Vector3<f64> {
    ray.origin_mm + ray.direction * distance_mm - center_mm
}

/// Pixels and the points that they see at a distance, from a center.
pub(super) fn samples(
    rays: &[PixelRay],
    distance_mm: f64,
    center_mm: &Vector3<f64>,
) -> Vec<Sample> {
    rays.iter()
        .map(|(pixel, ray)| (*pixel, seen_at(ray, distance_mm, center_mm)))
        .collect()
}
