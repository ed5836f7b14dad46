//! The nearest lens of another tool's for each camera of a rig: a pinhole with distortion, or a fisheye.

use super::camera_rays::{CameraRays, samples, seen_at};
use super::distortion::Distortion;
use super::error::ExchangeError;
use super::fit::{self, Turned};
use super::lens::Lens;
use super::loss::{Loss, LossMap, missed};
use calib_blob::rays::RaySource;
use calib_rays::geometry::{PixelPoint, RigidTransform};
use nalgebra::{Matrix2x3, Matrix3, Vector3};

/// Places along the longer side of the sensor at which a lens is fitted ...
const FIT_PLACES: u32 = 49;
/// ... and at which its loss is taken; these are not the same ones.
pub(super) const LOSS_PLACES: u32 = 160;
/// Places of the map of the loss along the longer side.
pub(super) const MAP_PLACES: u32 = 33;
/// A form with more coefficients is taken where it leaves at most this share of the loss ...
const WORTH_MORE: f64 = 0.8;
/// ... of more than this, RMS, px: nobody needs less.
pub(super) const NEGLIGIBLE_PX: f64 = 1e-3;

/// A camera as a lens of another tool.
#[derive(Debug, Clone, PartialEq)]
pub struct CameraPinhole {
    /// Unique in the rig.
    pub name: String,
    /// The lens.
    pub lens: Lens,
    /// Where it is: its center is the point nearest to all rays, its axes are its own and not those of the ray field.
    pub rig_from_pinhole: RigidTransform,
    /// What it loses.
    pub loss: Loss,
    /// Where on the sensor.
    pub map: LossMap,
}

/// The cameras of a rig as lenses of another tool.
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

/// Fits a lens to each camera: the points at a distance on the rays of its calibrated area, seen from the point nearest to
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
        nearest(
            &CameraRays::new(source, camera_idx, camera),
            distance_mm,
            forms,
        )
    });
    Ok(Pinholes {
        cameras: fitted.collect::<Result<_, _>>()?,
        distance_mm,
    })
}

/// The nearest lens of one camera.
pub(super) fn nearest(
    rays: &CameraRays<'_>,
    distance_mm: f64,
    forms: &[Distortion],
) -> Result<CameraPinhole, ExchangeError> {
    let (to_fit, center_mm) = rays.to_fit(FIT_PLACES)?;
    let fitted_at = samples(&to_fit, distance_mm, &center_mm);
    let compared_at = samples(&rays.on_lattice(LOSS_PLACES), distance_mm, &center_mm);
    let mut reason = "they go to the side or backwards, or the image is mirrored";
    let mut best: Option<(Turned, Loss)> = None;
    let mut from: Option<Turned> = None;
    for form in forms {
        // A pinhole goes on from the one before, a fisheye begins anew.
        let before = from.filter(|(lens, _)| lens.distortion.is_fisheye() == form.is_fisheye());
        let start =
            before.or_else(|| fit::ideal(rays.camera.sensor, form.is_fisheye(), &fitted_at));
        let Some(start) = start else {
            continue;
        };
        let found = fit::nearest(start, *form, &fitted_at);
        let Some(loss) = Loss::of(&|point| see(&found, point), &compared_at) else {
            reason = "its distortion would fold back within the image";
            continue;
        };
        from = Some(found);
        let is_better = best.is_none_or(|(_, before)| {
            before.rms_px > NEGLIGIBLE_PX && loss.rms_px <= WORTH_MORE * before.rms_px
        });
        if is_better {
            best = Some((found, loss));
        }
    }
    let (turned, loss) = best.ok_or_else(|| rays.no_lens(reason))?;
    let (lens, turn) = turned;
    let rig_from_pinhole = rays.rig_from_camera
        * RigidTransform::new(Matrix3::identity(), center_mm)
        * RigidTransform::new(turn.transpose(), Vector3::zeros());
    let name = rays.camera.name.clone();
    let lattice = rays.lattice(MAP_PLACES);
    let map = LossMap::new(
        name.clone(),
        &rig_from_pinhole,
        lattice,
        |pixel: PixelPoint| {
            let point = seen_at(&rays.ray(pixel)?, distance_mm, &center_mm);
            missed(&|point| see(&turned, point), &(pixel, point))
        },
    );
    Ok(CameraPinhole {
        name,
        lens,
        rig_from_pinhole,
        loss,
        map,
    })
}

/// Where a turned lens sees a point, and how that moves with it.
fn see((lens, turn): &Turned, point: &Vector3<f64>) -> Option<(PixelPoint, Matrix2x3<f64>)> {
    let seen = lens.see(&(turn * point))?;
    Some((seen.pixel, seen.by_point * turn))
}
