//! A part of the sensor: outside of it a rig is taken to have no rays.

use super::error::ExchangeError;
use calib_blob::rays::{RaySource, SourceCamera};
use calib_rays::field::PairUncertainty;
use calib_rays::geometry::{PixelPoint, Ray};

/// A rectangle of pixels, its edges included, the center of the top-left pixel being (0, 0).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Region {
    /// The upper left corner.
    pub first: PixelPoint,
    /// The lower right one.
    pub last: PixelPoint,
}

impl Region {
    /// From `u0, v0, u1, v1`; `None` if it holds nothing.
    pub fn new([u0, v0, u1, v1]: [f64; 4]) -> Option<Self> {
        (u0 < u1 && v0 < v1).then_some(Self {
            first: PixelPoint::new(u0, v0),
            last: PixelPoint::new(u1, v1),
        })
    }

    fn contains(&self, pixel: PixelPoint) -> bool {
        (self.first.u..=self.last.u).contains(&pixel.u)
            && (self.first.v..=self.last.v).contains(&pixel.v)
    }
}

/// A rig within a region of each of its sensors.
pub struct Within<'a> {
    source: &'a dyn RaySource,
    region: Region,
}

impl<'a> Within<'a> {
    /// The rig within the region.
    ///
    /// # Errors
    /// [`ExchangeError::Region`] for the first camera on whose sensor the region does not lie.
    pub fn new(source: &'a dyn RaySource, region: Region) -> Result<Self, ExchangeError> {
        let is_beyond = |camera: &SourceCamera| {
            !(camera.sensor.contains(region.first) && camera.sensor.contains(region.last))
        };
        match source.cameras().into_iter().find(is_beyond) {
            Some(camera) => Err(ExchangeError::Region {
                camera: camera.name,
                sensor: [camera.sensor.width, camera.sensor.height],
            }),
            None => Ok(Self { source, region }),
        }
    }
}

impl RaySource for Within<'_> {
    fn cameras(&self) -> Vec<SourceCamera> {
        self.source.cameras()
    }

    fn ray(&self, camera_idx: usize, pixel: PixelPoint) -> Option<Ray> {
        if !self.region.contains(pixel) {
            return None;
        }
        self.source.ray(camera_idx, pixel)
    }

    fn region(&self) -> Option<[PixelPoint; 2]> {
        Some([self.region.first, self.region.last])
    }

    fn uncertainty(&self) -> Vec<PairUncertainty> {
        self.source.uncertainty()
    }
}
