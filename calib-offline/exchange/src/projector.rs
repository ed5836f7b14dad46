//! Points to pixels by the rays of a camera, for which there is no formula: the nearest lens has the place to start with,
//! `sight` the search.

use super::camera_rays::CameraRays;
use super::distortion::Distortion;
use super::error::ExchangeError;
use super::nearest::{CameraPinhole, nearest};
use super::sight::{Sight, Target};
use calib_blob::rays::{RaySource, SourceCamera};
use calib_rays::geometry::{PixelPoint, RigidTransform};
use nalgebra::Vector3;

/// A camera that sees points by its rays.
pub(super) struct Projector<'a> {
    source: &'a dyn RaySource,
    camera_idx: usize,
    sight: Sight<'a>,
    /// The lens that comes nearest.
    pub lens: CameraPinhole,
    lens_from_rig: RigidTransform,
}

impl<'a> Projector<'a> {
    /// Of one camera.
    ///
    /// # Errors
    /// [`ExchangeError`] if no lens comes near its rays.
    pub fn new(
        source: &'a dyn RaySource,
        camera_idx: usize,
        camera: &SourceCamera,
        distance_mm: f64,
    ) -> Result<Self, ExchangeError> {
        let rays = CameraRays::new(source, camera_idx, camera);
        let forms = [Distortion::Five, Distortion::Eight, Distortion::Equidistant];
        let lens = nearest(&rays, distance_mm, &forms)?;
        let lens_from_rig = lens.rig_from_pinhole.inverse();
        Ok(Self {
            source,
            camera_idx,
            sight: Sight::new(source, camera_idx, camera.sensor),
            lens,
            lens_from_rig,
        })
    }

    /// The pixel whose ray passes through a point of the rig's frame; `None` where none of the calibrated area does.
    pub fn pixel(&self, point_in_rig: &Vector3<f64>) -> Option<PixelPoint> {
        let guess = self
            .lens
            .lens
            .see(&self.lens_from_rig.point(point_in_rig))?;
        let center_mm = self.lens.rig_from_pinhole.translation_mm;
        let target = Target::new(*point_in_rig, &center_mm);
        let seen = self.sight.seen(&target, Some(guess.pixel), None)?;
        Some(seen.pixel)
    }

    /// The point that a pixel sees on a plane of another frame, in that frame, mm; `None` where it sees none of it.
    pub fn on_plane(
        &self,
        pixel: PixelPoint,
        plane_from_rig: &RigidTransform,
        z_mm: f64,
    ) -> Option<Vector3<f64>> {
        let ray = self
            .source
            .ray(self.camera_idx, pixel)?
            .transformed(plane_from_rig);
        let along_mm = (z_mm - ray.origin_mm.z) / ray.direction.z;
        (along_mm > 0.0 && along_mm.is_finite()).then(|| ray.origin_mm + ray.direction * along_mm)
    }
}
