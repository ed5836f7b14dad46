//! The estimate as a rig of ray fields, so that `measure`, the blob and the device work with it.
//!
//! A ray per pixel is more than anybody can flash: the rays of a lattice become a smooth field
//! ([`calib_rays::field::from_rays`]), which takes with it some of the noise that each ray has for itself.

use super::AlternatingEstimate;
use super::rays::SupportedRay;
use calib_rays::field::from_rays::{FromRaysSettings, SampledRay, field_of_rays, ray_error_px};
use calib_rays::field::{BaseLens, CalibratedCamera, CoverageMask, Rig};
use calib_rays::geometry::{RigidTransform, SensorSize};
use calib_rays::numerics::rms;

/// Rays along the longer side of the sensor: two in each cell of the mask along each axis.
const RAYS_ALONG_LONGER_SIDE: f64 = 96.0;
/// Cells of the field's splines along it: finer than what a network resolves between corners.
const CELLS_ALONG_LONGER_SIDE: f64 = 32.0;
/// Least stretch of a ray that tells its direction, as a share of its distance.
const MIN_STRETCH: f64 = 0.01;

/// The cameras as ray fields.
#[derive(Debug, Clone)]
pub struct FieldRig {
    /// The cameras; the rig frame is the board at the datum pose.
    pub rig: Rig,
    /// Per camera: RMS difference of the field from the rays of single pixels, px.
    pub rms_error_px: Vec<f64>,
}

impl AlternatingEstimate {
    /// The rig. A camera's calibrated area are the mask's cells whose pixels all have a ray. `bases`
    /// are ideal lenses near to each camera's, as the start has them; `names` the cameras', in
    /// order.
    ///
    /// `None` if a camera has too few rays for a field.
    ///
    /// Cost: a line fit per ray of the lattice and a banded system per camera.
    pub fn rig(&self, names: &[String], bases: &[BaseLens]) -> Option<FieldRig> {
        let mut cameras = Vec::new();
        let mut rms_error_px = Vec::new();
        for (camera_idx, source) in self.cameras.iter().enumerate() {
            let sensor = *self.observations.sensors.get(camera_idx)?;
            let rig_from_camera = *self.rig_from_camera.get(camera_idx)?;
            let longer = f64::from(sensor.width.max(sensor.height));
            let rays = source.lattice(sensor, longer / RAYS_ALONG_LONGER_SIDE);
            let coverage = covered(
                sensor,
                &super::rays::lattice(sensor, longer / RAYS_ALONG_LONGER_SIDE),
                &rays,
            );
            let sampled: Vec<SampledRay> = rays
                .iter()
                .flatten()
                .map(|ray| in_camera(ray, &rig_from_camera))
                .filter(|ray| ray.near_mm > 0.0)
                .collect();
            let settings = FromRaysSettings {
                cell_px: longer / CELLS_ALONG_LONGER_SIDE,
                is_central: false,
            };
            let field = field_of_rays(sensor, *bases.get(camera_idx)?, &sampled, &settings)?;
            let errors: Vec<f64> = sampled
                .iter()
                .filter(|ray| coverage.contains(ray.pixel))
                .filter_map(|ray| ray_error_px(&field, ray))
                .collect();
            rms_error_px.push(rms(&errors).unwrap_or(0.0));
            cameras.push(CalibratedCamera {
                name: names.get(camera_idx)?.clone(),
                field,
                coverage,
                rig_from_camera,
            });
        }
        Some(FieldRig {
            rig: Rig {
                cameras,
                datum_pose: self.observations.poses.get(self.datum).copied()?,
                frame_is_known: false,
                match_noise_px: None,
                uncertainty: Vec::new(),
            },
            rms_error_px,
        })
    }
}

/// Cells in which every pixel of the lattice has a ray.
fn covered(
    sensor: SensorSize,
    pixels: &[calib_rays::geometry::PixelPoint],
    rays: &[Option<SupportedRay>],
) -> CoverageMask {
    let mut mask = CoverageMask::uniform(sensor, false);
    let mut missing = CoverageMask::uniform(sensor, false);
    for (pixel, ray) in pixels.iter().zip(rays) {
        let Some(cell) = mask.cell_of(*pixel) else {
            continue;
        };
        if ray.is_some() {
            mask.covered[cell] = true;
        } else {
            missing.covered[cell] = true;
        }
    }
    for (covered, missing) in mask.covered.iter_mut().zip(missing.covered) {
        *covered &= !missing;
    }
    mask
}

/// A ray in its camera's frame. Its stretch is that of its control points, widened where these lie
/// so close that both ends would say the same.
fn in_camera(supported: &SupportedRay, rig_from_camera: &RigidTransform) -> SampledRay {
    let ray = supported.ray.transformed(&rig_from_camera.inverse());
    // Distances count from the foot point of the camera's origin, which has moved along the ray.
    let foot = ray.foot_point(&nalgebra::Vector3::zeros());
    let shift = (ray.origin_mm - foot).dot(&ray.direction);
    let (near, far) = (supported.near_mm + shift, supported.far_mm + shift);
    let middle = f64::midpoint(near, far);
    let half = ((far - near) / 2.0).max(MIN_STRETCH * middle.abs());
    SampledRay {
        pixel: supported.pixel,
        ray,
        near_mm: middle - half,
        far_mm: middle + half,
    }
}
