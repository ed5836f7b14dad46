//! A blob prepared for fixed point.

use super::axis::coordinate;
use super::bounds::{self, Bounds};
use super::camera::Camera;
use super::midpoint::{self, FixedPoint};
use super::ray::{FixedPixel, FixedRay};
use crate::{LookupError, MeasureError, PixelPoint, Ray, RayBlob, Triangulation};

/// The cameras of a blob, at most `N`, prepared for fixed point: some 350 bytes each.
#[derive(Debug, Clone, Copy)]
pub struct Rig<'a, const N: usize> {
    cameras: [Option<Camera<'a>>; N],
    count: usize,
    /// Unit of lengths: 2 to this, mm.
    exponent: i32,
}

/// Why fixed point cannot answer for a blob.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Unsuited {
    /// It has more cameras than there is room for.
    TooManyCameras {
        /// How many it has.
        count: usize,
        /// For how many there is room.
        room: usize,
    },
    /// The half-angle vectors of a camera could be 8 or more, beyond their digits.
    Angles {
        /// Its index.
        camera: usize,
    },
    /// Lengths or the working distance are beyond some 10^6 mm.
    Lengths,
    /// The cells of a camera's table are smaller than a pixel.
    Cells {
        /// Its index.
        camera: usize,
    },
}

impl Unsuited {
    /// The stable number of the reason.
    pub const fn code(self) -> u8 {
        match self {
            Self::TooManyCameras { .. } => 80,
            Self::Angles { .. } => 81,
            Self::Lengths => 82,
            Self::Cells { .. } => 83,
        }
    }
}

impl core::fmt::Display for Unsuited {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{self:?} (code {})", self.code())
    }
}

impl core::error::Error for Unsuited {}

impl<'a, const N: usize> Rig<'a, N> {
    /// Prepares the cameras of a blob: one pass over the numbers of its tables.
    ///
    /// # Errors
    /// [`Unsuited`]: a blob with numbers that have no place in fixed point, or with more cameras than `N`. No
    /// calibrated lens up to 127 degrees off its axis does.
    pub fn prepare(blob: &RayBlob<'a>) -> Result<Self, Unsuited> {
        let count = blob.camera_count();
        if count > N {
            return Err(Unsuited::TooManyCameras { count, room: N });
        }
        let views = blob.views();
        for camera in 0..count {
            if !bounds_of(blob, camera).is_some_and(|bounds| bounds.has_angles()) {
                return Err(Unsuited::Angles { camera });
            }
        }
        let bounds = (0..count).filter_map(|camera| bounds_of(blob, camera));
        let digits =
            bounds::length_digits(bounds, blob.working_distance_mm()).ok_or(Unsuited::Lengths)?;
        let mut cameras = [None; N];
        for (camera, place) in cameras.iter_mut().enumerate().take(count) {
            let prepared = blob
                .record(camera)
                .ok()
                .and_then(|record| Camera::prepare(views, record, digits));
            *place = Some(prepared.ok_or(Unsuited::Cells { camera })?);
        }
        Ok(Self {
            cameras,
            count,
            exponent: -digits,
        })
    }

    /// What the pixel of a camera sees, rig frame.
    ///
    /// # Errors
    /// Those of [`RayBlob::lookup`]; also `Outside` of a pixel that sees further than 127 degrees to the side.
    pub fn lookup(&self, camera: usize, pixel: PixelPoint) -> Result<Ray, LookupError> {
        let pixel = fixed(pixel).ok_or(LookupError::Outside)?;
        Ok(self.lookup_fixed(camera, pixel)?.to_ray())
    }

    /// The same in fixed point.
    ///
    /// # Errors
    /// Those of [`lookup`](Self::lookup).
    #[inline(never)]
    pub fn lookup_fixed(&self, camera: usize, pixel: FixedPixel) -> Result<FixedRay, LookupError> {
        let ray = self.ray(camera, pixel);
        let (origin, direction) = ray.ok_or_else(|| self.error(camera))?;
        Ok(FixedRay {
            origin,
            direction,
            exponent: self.exponent,
        })
    }

    /// The point that two cameras see: the midpoint of the common perpendicular of their rays.
    ///
    /// # Errors
    /// Those of [`RayBlob::triangulate`], decided as there but for pixels within 0.001 px of a border of the calibrated area,
    /// and angles within a thousandth of the least.
    pub fn triangulate(
        &self,
        a: (usize, PixelPoint),
        b: (usize, PixelPoint),
    ) -> Result<Triangulation, MeasureError> {
        let outside = |camera| MeasureError::of_lookup(LookupError::Outside, camera);
        let pixel_a = fixed(a.1).ok_or_else(|| outside(a.0))?;
        let pixel_b = fixed(b.1).ok_or_else(|| outside(b.0))?;
        Ok(self
            .triangulate_fixed((a.0, pixel_a), (b.0, pixel_b))?
            .to_triangulation())
    }

    /// The same in fixed point.
    ///
    /// # Errors
    /// Those of [`triangulate`](Self::triangulate).
    #[inline(never)]
    pub fn triangulate_fixed(
        &self,
        a: (usize, FixedPixel),
        b: (usize, FixedPixel),
    ) -> Result<FixedPoint, MeasureError> {
        // By reference, so that nothing is copied.
        match (&self.ray(a.0, a.1), &self.ray(b.0, b.1)) {
            (Some(ray_a), Some(ray_b)) => midpoint::meet(ray_a, ray_b, self.exponent),
            (None, _) => Err(MeasureError::of_lookup(self.error(a.0), a.0)),
            (_, None) => Err(MeasureError::of_lookup(self.error(b.0), b.0)),
        }
    }

    #[inline(never)]
    fn ray(&self, camera: usize, pixel: FixedPixel) -> Option<([i32; 3], [i32; 3])> {
        self.cameras.get(camera)?.as_ref()?.ray(pixel)
    }

    /// Why a camera's pixel has no ray.
    fn error(&self, camera: usize) -> LookupError {
        if camera < self.count {
            LookupError::Outside
        } else {
            LookupError::NoSuchCamera {
                camera,
                count: self.count,
            }
        }
    }
}

fn bounds_of(blob: &RayBlob<'_>, camera: usize) -> Option<Bounds> {
    Bounds::of(blob.views(), blob.record(camera).ok()?)
}

/// Rounded down; `None` on no sensor.
#[inline(always)]
fn fixed(pixel: PixelPoint) -> Option<FixedPixel> {
    Some(FixedPixel {
        u: coordinate(pixel.u)?,
        v: coordinate(pixel.v)?,
    })
}
