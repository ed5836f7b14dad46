//! Longitude and latitude as pixels: mrcal's `LENSMODEL_LONLAT` and `LENSMODEL_LATLON`, COLMAP's `EQUIRECTANGULAR`.
//!
//! The poles of the one lie along y, those of the other along x. Focal lengths are pixels per radian.

use super::{CameraModel, ImagePlane, central};
use calib_rays::geometry::{PixelPoint, Ray};
use nalgebra::{Vector2, Vector3};
use std::f64::consts::{FRAC_PI_2, PI};

/// Which coordinate of a pixel goes all around.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Circle {
    /// u is the longitude: `LONLAT`.
    AlongU,
    /// v is the longitude: `LATLON`.
    AlongV,
}

/// Longitude and latitude.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LonLat {
    /// Pixels per radian, and where both are zero.
    pub plane: ImagePlane,
    /// Which is the longitude.
    pub circle: Circle,
}

impl CameraModel for LonLat {
    fn project(&self, point: &Vector3<f64>) -> Option<PixelPoint> {
        let unit = point.try_normalize(0.0)?;
        let place = match self.circle {
            Circle::AlongU => Vector2::new(unit.x.atan2(unit.z), unit.y.asin()),
            Circle::AlongV => Vector2::new(unit.x.asin(), unit.y.atan2(unit.z)),
        };
        self.plane.pixel(&place)
    }

    fn ray(&self, pixel: PixelPoint) -> Option<Ray> {
        let place = self.plane.place(pixel);
        let (longitude, latitude) = match self.circle {
            Circle::AlongU => (place.x, place.y),
            Circle::AlongV => (place.y, place.x),
        };
        if !(longitude.abs() <= PI && latitude.abs() <= FRAC_PI_2) {
            return None;
        }
        let ((sin_lon, cos_lon), (sin_lat, cos_lat)) = (longitude.sin_cos(), latitude.sin_cos());
        central(match self.circle {
            Circle::AlongU => Vector3::new(cos_lat * sin_lon, sin_lat, cos_lat * cos_lon),
            Circle::AlongV => Vector3::new(sin_lat, cos_lat * sin_lon, cos_lat * cos_lon),
        })
    }
}
