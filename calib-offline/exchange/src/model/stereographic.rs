//! The stereographic projection, mrcal's `LENSMODEL_STEREOGRAPHIC`: a radius of `2 tan(theta / 2)`.

use super::{CameraModel, ImagePlane, central};
use calib_rays::geometry::{PixelPoint, Ray};
use nalgebra::{Vector2, Vector3};

/// The stereographic projection.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stereographic {
    /// Focal lengths and principal point.
    pub plane: ImagePlane,
}

/// The place of a point; `None` straight backwards.
pub(crate) fn place(point: &Vector3<f64>) -> Option<Vector2<f64>> {
    let under = point.norm() + point.z;
    (under > 0.0).then(|| point.xy() * (2.0 / under))
}

/// What a place sees, not of unit length.
pub(super) fn direction(place: &Vector2<f64>) -> Vector3<f64> {
    place.push(1.0 - place.norm_squared() / 4.0)
}

impl CameraModel for Stereographic {
    fn project(&self, point: &Vector3<f64>) -> Option<PixelPoint> {
        self.plane.pixel(&place(point)?)
    }

    fn ray(&self, pixel: PixelPoint) -> Option<Ray> {
        central(direction(&self.plane.place(pixel)))
    }
}
