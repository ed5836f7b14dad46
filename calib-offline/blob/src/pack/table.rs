//! A camera's table as it stands in the blob, and what it is to hold.

use super::PackError;
use calib_rays::field::transport::{self, MAX_HALF_ANGLE_LENGTH};
use calib_rays::field::{CalibratedCamera, FieldSample};
use calib_rays::geometry::PixelPoint;
use nalgebra::{Matrix3, Vector2};
use ray_runtime::format::Encoding;

/// The bytes of one camera's table.
#[derive(Debug, Clone, PartialEq)]
pub struct Table {
    /// How it is stored.
    pub encoding: Encoding,
    /// Cells along u and v.
    pub cells: [u32; 2],
    /// As they stand in the blob, without the padding behind them.
    pub bytes: Vec<u8>,
}

/// What a table holds at a pixel: the half-angle vector and `m / (1 + s.s/4)`, mm.
pub struct Target<'a> {
    camera: &'a CalibratedCamera,
    rounded_from_exact: Matrix3<f64>,
}

impl<'a> Target<'a> {
    /// The target of a camera.
    ///
    /// What the rotation of a camera loses when it is rounded to f32, some 1e-8 rad, the table makes
    /// up for: at a focal length of 6000 px that is half of what a blob may be off.
    pub fn new(camera: &'a CalibratedCamera) -> Self {
        let rotation = &camera.rig_from_camera.rotation;
        let rounded = rotation.map(|x| f64::from(x as f32));
        // A matrix without inverse is refused when the blob is opened.
        let inverse = rounded.try_inverse().unwrap_or_else(Matrix3::identity);
        Self {
            camera,
            rounded_from_exact: inverse * rotation,
        }
    }

    /// The numbers of a sample of the field; `None` where the field has none that can be stored.
    pub fn numbers(&self, sample: &FieldSample) -> Option<[f64; 4]> {
        let length_squared = sample.s.norm_squared();
        let is_usable = length_squared <= MAX_HALF_ANGLE_LENGTH * MAX_HALF_ANGLE_LENGTH
            && sample.m_mm.iter().all(|m| m.is_finite());
        is_usable.then(|| {
            let m = sample.m_mm / (1.0 + length_squared / 4.0);
            let s = self.turned(&sample.s);
            [s.x, s.y, m.x, m.y]
        })
    }

    /// The numbers of a pixel that must have some.
    ///
    /// # Errors
    /// [`PackError::Field`].
    pub fn required(&self, pixel: PixelPoint, sample: &FieldSample) -> Result<[f64; 4], PackError> {
        self.numbers(sample).ok_or_else(|| PackError::Field {
            camera: self.camera.name.clone(),
            pixel,
            s: sample.s.into(),
        })
    }

    /// The half-angle vector that the rounded rotation takes where the exact one takes `s`.
    fn turned(&self, s: &Vector2<f64>) -> Vector2<f64> {
        transport::half_angle(&(self.rounded_from_exact * transport::direction(s))).unwrap_or(*s)
    }
}
