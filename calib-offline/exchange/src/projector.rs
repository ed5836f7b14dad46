//! Points to pixels by the rays of a camera, for which there is no formula: the nearest lens has the place and the slope to
//! start with, then each step halves what is left many times over.

use super::camera_rays::CameraRays;
use super::distortion::Distortion;
use super::error::ExchangeError;
use super::nearest::{CameraPinhole, nearest};
use calib_blob::rays::{RaySource, SourceCamera};
use calib_rays::geometry::{PixelPoint, RigidTransform};
use nalgebra::Vector3;

/// A step that is shorter is the last, px ...
const STILL_PX: f64 = 1e-6;
/// ... and so is the last of these, if it is no longer than that: the rays of a blob come in steps of f32.
const STEPS: usize = 20;
const NEAR_PX: f64 = 1e-3;

/// A camera that sees points by its rays.
pub(super) struct Projector<'a> {
    source: &'a dyn RaySource,
    camera_idx: usize,
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
            lens,
            lens_from_rig,
        })
    }

    /// The pixel whose ray passes through a point of the rig's frame; `None` where none of the calibrated area does.
    pub fn pixel(&self, point_in_rig: &Vector3<f64>) -> Option<PixelPoint> {
        let seen = self
            .lens
            .lens
            .see(&self.lens_from_rig.point(point_in_rig))?;
        let by_point = seen.by_point * self.lens_from_rig.rotation;
        let mut pixel = seen.pixel;
        let mut step_px = f64::INFINITY;
        for _ in 0..STEPS {
            let ray = self.source.ray(self.camera_idx, pixel)?;
            let to_point = point_in_rig - ray.origin_mm;
            let along_mm = to_point.dot(&ray.direction);
            // Written so that NaN is refused.
            if !(along_mm > 0.0) {
                return None;
            }
            let step = by_point * (to_point - ray.direction * along_mm);
            pixel = PixelPoint::new(pixel.u + step.x, pixel.v + step.y);
            step_px = step.norm();
            if step_px < STILL_PX {
                break;
            }
        }
        (step_px < NEAR_PX && self.source.ray(self.camera_idx, pixel).is_some()).then_some(pixel)
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
