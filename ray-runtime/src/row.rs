//! Rays and points of a run of pixels of one row, for line buffers: with the bits of single lookups, in
//! fewer instructions, as what depends on the row alone is computed once.

mod fill;
mod runs;

use crate::{LookupError, MeasureError, PixelPoint, Ray, RayBlob, triangulate_pair};

/// Pixels of one row, from left to right.
///
/// Pixel `k` is at `(first.u + (k * step_px) as f32, first.v)`.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Row {
    /// The first of them, px of the sensor.
    pub first: PixelPoint,
    /// From one to the next, px of the sensor: 1, or the binning along u of an image that was binned.
    pub step_px: u16,
}

/// Which pixels of the second camera belong to those of a row of the first one. What is not a number is
/// no match.
#[derive(Debug, Clone, Copy)]
pub enum Matched<'a> {
    /// Those of this row (v, px) at as many columns, px.
    Columns(f32, &'a [f32]),
    /// Those of this row (v, px) that lie to the left of the first camera's column by so much each, px.
    Disparities(f32, &'a [f32]),
    /// Anywhere.
    Pixels(&'a [PixelPoint]),
}

/// A point of a row of matches, or why there is none.
// As C sees it: five words.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct RowPoint {
    /// Rig frame, mm; without a point not a number.
    pub point_mm: [f32; 3],
    /// As in [`Triangulation`](crate::Triangulation), mm2.
    pub gap_squared_mm2: f32,
    /// 0, or the [`MeasureError::code`] of why there is no point.
    pub code: u32,
}

impl RowPoint {
    /// No point, for this reason.
    pub const fn none(error: MeasureError) -> Self {
        Self {
            point_mm: [f32::NAN; 3],
            gap_squared_mm2: f32::NAN,
            code: error.code() as u32,
        }
    }
}

/// Rays that are looked up at once, on the stack, for points of a row.
const CHUNK: usize = 16;

impl Row {
    /// Pixel number `k`.
    pub fn pixel(&self, k: usize) -> PixelPoint {
        let offset_px =
            u32::try_from(k).map_or(u32::MAX, |k| k.saturating_mul(self.step_px.into()));
        PixelPoint::new(self.first.u + offset_px as f32, self.first.v)
    }
}

impl Matched<'_> {
    fn len(&self) -> usize {
        match self {
            Self::Columns(_, numbers) | Self::Disparities(_, numbers) => numbers.len(),
            Self::Pixels(pixels) => pixels.len(),
        }
    }

    /// The pixel that belongs to pixel number `k` of a row.
    fn pixel(&self, row: &Row, k: usize) -> Option<PixelPoint> {
        Some(match *self {
            Self::Columns(v, columns) => PixelPoint::new(*columns.get(k)?, v),
            Self::Disparities(v, disparities) => {
                PixelPoint::new(row.pixel(k).u - *disparities.get(k)?, v)
            }
            Self::Pixels(pixels) => *pixels.get(k)?,
        })
    }
}

impl RayBlob<'_> {
    /// The rays of as many pixels of a row as there is room for, with the bits of
    /// [`lookup`](RayBlob::lookup); those that are not calibrated are [`Ray::OUTSIDE`].
    ///
    /// Fast are rows of patches, and of quantized tables of the usual kind, whose first pixel is at a whole
    /// multiple of 1/256 px; the pixels of others are looked up one by one.
    ///
    /// # Errors
    /// [`LookupError::NoSuchCamera`].
    pub fn lookup_row(
        &self,
        camera: usize,
        row: &Row,
        rays: &mut [Ray],
    ) -> Result<(), LookupError> {
        self.views().lookup_row(self.record(camera)?, row, 0, rays);
        Ok(())
    }

    /// The points of matches of a row of the first camera with pixels of the second one: as many as there
    /// are matches and room for. How many that is; each has the bits of [`triangulate`](RayBlob::triangulate),
    /// or its error's code.
    ///
    /// # Errors
    /// [`LookupError::NoSuchCamera`].
    pub fn triangulate_row(
        &self,
        first: (usize, &Row),
        second: (usize, Matched<'_>),
        points: &mut [RowPoint],
    ) -> Result<usize, LookupError> {
        let ((camera, row), (other, matched)) = (first, second);
        let (record, other_record) = (self.record(camera)?, self.record(other)?);
        let views = self.views();
        let outside = |camera| RowPoint::none(MeasureError::Outside { camera });
        let count = points.len().min(matched.len());
        let mut rays = [Ray::OUTSIDE; CHUNK];
        for (number, points) in points.chunks_mut(CHUNK).enumerate() {
            let start = number * CHUNK;
            views.lookup_row(record, row, start, &mut rays);
            for (j, (ray, point)) in rays.iter().zip(points).enumerate() {
                let Some(pixel) = matched.pixel(row, start + j) else {
                    return Ok(count);
                };
                *point = if ray.is_outside() {
                    outside(camera)
                } else {
                    let seen = views.lookup(other_record, pixel);
                    seen.map_or(outside(other), |seen| point_of(ray, &seen))
                };
            }
        }
        Ok(count)
    }
}

fn point_of(a: &Ray, b: &Ray) -> RowPoint {
    match triangulate_pair(a, b) {
        Ok(found) => RowPoint {
            point_mm: found.point_mm,
            gap_squared_mm2: found.gap_squared_mm2,
            code: 0,
        },
        Err(error) => RowPoint::none(error),
    }
}
