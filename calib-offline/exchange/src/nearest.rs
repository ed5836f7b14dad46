//! The nearest pinhole of each camera of a rig.

use super::error::ExchangeError;
use super::fit::{self, Sample};
use super::lens::{Distortion, Lens};
use super::loss::Loss;
use calib_blob::rays::{RaySource, SourceCamera};
use calib_rays::geometry::{PixelPoint, Ray, RigidTransform, SensorSize, nearest_point};
use nalgebra::Matrix3;

/// Places along the longer side of the sensor at which a lens is fitted ...
const FIT_PLACES: u32 = 49;
/// ... and at which its loss is taken; these are not the same ones.
const LOSS_PLACES: u32 = 160;
/// With fewer places than this the numbers of a lens hang in the air.
const LEAST_PLACES: usize = 100;
/// The rational form is taken where it leaves at most this share of the loss ...
const WORTH_EIGHT: f64 = 0.8;
/// ... of more than this, RMS, px: nobody needs less.
const NEGLIGIBLE_PX: f64 = 1e-3;

/// A camera as a pinhole.
#[derive(Debug, Clone, PartialEq)]
pub struct CameraPinhole {
    /// Unique in the rig.
    pub name: String,
    /// The pinhole.
    pub lens: Lens,
    /// Where it is: its center is the point nearest to all rays, its axes are its own and not those of the ray field.
    pub rig_from_pinhole: RigidTransform,
    /// What it loses.
    pub loss: Loss,
}

/// The cameras of a rig as pinholes.
#[derive(Debug, Clone, PartialEq)]
pub struct Pinholes {
    /// In the rig's order.
    pub cameras: Vec<CameraPinhole>,
    /// Where on the rays they were fitted, mm from the camera.
    pub distance_mm: f64,
}

impl Pinholes {
    /// The loss of all cameras together.
    pub fn loss(&self) -> Loss {
        let losses: Vec<Loss> = self.cameras.iter().map(|camera| camera.loss).collect();
        Loss::together(&losses)
    }
}

/// Fits a pinhole to each camera: the points at a distance on the rays of its calibrated area, seen from the point nearest to
/// all rays, are projected as near to their pixels as can be (least squares; a lattice of some two thousand pixels). Cost:
/// some ten milliseconds a camera.
///
/// `forms` are tried in their order; a later one is kept where it loses at least a fifth less.
///
/// # Errors
/// [`ExchangeError`].
pub fn nearest_pinholes(
    source: &dyn RaySource,
    distance_mm: f64,
    forms: &[Distortion],
) -> Result<Pinholes, ExchangeError> {
    let cameras = source.cameras();
    let fitted = cameras.iter().enumerate().map(|(camera_idx, camera)| {
        let rays = Rays {
            source,
            camera_idx,
            camera,
        };
        rays.nearest(distance_mm, forms)
    });
    Ok(Pinholes {
        cameras: fitted.collect::<Result<_, _>>()?,
        distance_mm,
    })
}

struct Rays<'a> {
    source: &'a dyn RaySource,
    camera_idx: usize,
    camera: &'a SourceCamera,
}

impl Rays<'_> {
    fn nearest(
        &self,
        distance_mm: f64,
        forms: &[Distortion],
    ) -> Result<CameraPinhole, ExchangeError> {
        let rig_from_camera = self.camera.rig_from_camera.orthonormalized();
        let rays = self.on_lattice(FIT_PLACES, &rig_from_camera);
        if rays.len() < LEAST_PLACES {
            return Err(ExchangeError::TooFewRays {
                camera: self.camera.name.clone(),
                have: rays.len(),
                need: LEAST_PLACES,
            });
        }
        let no_pinhole = |reason| ExchangeError::NoPinhole {
            camera: self.camera.name.clone(),
            reason,
        };
        let lines: Vec<Ray> = rays.iter().map(|(_, ray)| *ray).collect();
        let center_mm = nearest_point(&lines).ok_or_else(|| no_pinhole("they are parallel"))?;
        let samples = |rays: &[(PixelPoint, Ray)]| -> Vec<Sample> {
            let point = |ray: &Ray| ray.origin_mm + ray.direction * distance_mm - center_mm;
            rays.iter()
                .map(|(pixel, ray)| (*pixel, point(ray)))
                .collect()
        };
        let fitted_at = samples(&rays);
        let compared_at = samples(&self.on_lattice(LOSS_PLACES, &rig_from_camera));
        let start = fit::ideal(self.camera.sensor, &fitted_at).ok_or_else(|| {
            no_pinhole("they go to the side or backwards, or the image is mirrored")
        })?;
        let mut best = None;
        let mut from = start;
        for form in forms {
            let found = fit::nearest(from, *form, &fitted_at);
            let Some(loss) = Loss::of(&found, &compared_at) else {
                continue;
            };
            from = found;
            let is_better = best.is_none_or(|(_, before): (_, Loss)| {
                before.rms_px > NEGLIGIBLE_PX && loss.rms_px <= WORTH_EIGHT * before.rms_px
            });
            if is_better {
                best = Some((found, loss));
            }
        }
        let ((lens, turn), loss) =
            best.ok_or_else(|| no_pinhole("its distortion would fold back within the image"))?;
        Ok(CameraPinhole {
            name: self.camera.name.clone(),
            lens,
            rig_from_pinhole: rig_from_camera
                * RigidTransform::new(Matrix3::identity(), center_mm)
                * RigidTransform::new(turn.transpose(), nalgebra::Vector3::zeros()),
            loss,
        })
    }

    /// The rays of the calibrated pixels of a lattice over the sensor, camera frame.
    fn on_lattice(&self, places: u32, rig_from_camera: &RigidTransform) -> Vec<(PixelPoint, Ray)> {
        let SensorSize { width, height } = self.camera.sensor;
        let step = f64::from(width.max(height) - 1).max(1.0) / f64::from(places - 1);
        let along = |length: u32| {
            let count = (f64::from(length - 1) / step).round().max(1.0);
            (0..=count as u32).map(move |k| f64::from(k) / count * f64::from(length - 1))
        };
        let camera_from_rig = rig_from_camera.inverse();
        along(height)
            .flat_map(|v| along(width).map(move |u| PixelPoint::new(u, v)))
            .filter_map(|pixel| {
                let ray = self.source.ray(self.camera_idx, pixel)?;
                Some((pixel, ray.transformed(&camera_from_rig)))
            })
            .collect()
    }
}
