//! A pixel's ray from the control grid.

use crate::format::{Encoding, Record};
use crate::grid::{Place, blend, blend_slopes};
use crate::{LookupError, PixelPoint, Ray};
use nalgebra::Vector3;

/// The ray of a pixel, rig frame. `bytes` and `words` are the whole blob, seen two ways.
pub(crate) fn lookup(
    bytes: &[u8],
    words: &[f32],
    record: Record<'_>,
    pixel: PixelPoint,
) -> Result<Ray, LookupError> {
    if !is_calibrated(bytes, record, pixel) {
        return Err(LookupError::Outside);
    }
    let (window, u, v) = Window::at(record, pixel);
    let along_u = |knots| blend(u.weights, knots);
    let along_v = |knots| blend(v.weights, knots);
    let sample = window
        .evaluate(words, along_u, along_v)
        .ok_or(LookupError::Outside)?;
    Ok(ray(record, sample))
}

/// The ray of a pixel, the bits of [`lookup`], and how it moves with u and with v.
///
/// Neither this nor what it calls three times is inlined: it is for size, where lookup is for speed.
#[inline(never)]
pub(crate) fn lookup_moving(
    bytes: &[u8],
    words: &[f32],
    record: Record<'_>,
    pixel: PixelPoint,
) -> Result<MovingRay, LookupError> {
    if !is_calibrated(bytes, record, pixel) {
        return Err(LookupError::Outside);
    }
    let (window, u, v) = Window::at(record, pixel);
    let [cells_u, cells_v] = record.cells();
    let [value_u, value_v] = [u, v].map(|place| Weights {
        of_knot_1: 1.0,
        of_differences: place.weights,
    });
    let slope = |of_differences| Weights {
        of_knot_1: 0.0,
        of_differences,
    };
    let slope_u = slope(record.axis_u().slopes(pixel.u, cells_u));
    let slope_v = slope(record.axis_v().slopes(pixel.v, cells_v));
    let evaluated = [(value_u, value_v), (slope_u, value_v), (value_u, slope_v)]
        .map(|(along_u, along_v)| window.evaluate_weighted(words, along_u, along_v));
    let [Some(sample), Some(by_u), Some(by_v)] = evaluated else {
        return Err(LookupError::Outside);
    };
    Ok(MovingRay {
        ray: ray(record, sample),
        by_pixel: [by_u, by_v].map(|change| differential(record.rotation(), sample, change)),
    })
}

/// A ray and its derivatives by the pixel.
#[derive(Debug, Clone, Copy)]
pub(crate) struct MovingRay {
    pub ray: Ray,
    by_pixel: [Ray; 2],
}

impl MovingRay {
    /// How the ray moves at `origin + lambda * direction` with u and with v, mm/px.
    pub fn shifts_at(&self, lambda: f32) -> [Vector3<f32>; 2] {
        self.by_pixel
            .map(|slope| slope.origin_mm + slope.direction * lambda)
    }
}

/// The ray of a sample of the control grid, rig frame.
fn ray(record: Record<'_>, [s1, s2, m1, m2]: [f32; 4]) -> Ray {
    let (rotation, translation) = (record.rotation(), record.translation_mm());
    let origin_mm = if record.encoding() == Encoding::CentralF32.number() {
        translation.into()
    } else {
        origin(rotation, translation, [s1, s2], [m1, m2])
    };
    Ray {
        origin_mm,
        direction: direction(rotation, [s1, s2]),
    }
}

/// Weights along one axis, of a place or of its derivative.
#[derive(Debug, Clone, Copy)]
struct Weights {
    /// 1 for the place, 0 for the derivative: exact either way.
    of_knot_1: f32,
    of_differences: [f32; 3],
}

impl Weights {
    fn applied_to(self, knots: [f32; 4]) -> f32 {
        self.of_knot_1 * knots[1] + blend_slopes(self.of_differences, knots)
    }
}

/// What of the control grid a pixel needs.
#[derive(Debug, Clone, Copy)]
struct Window {
    /// The first of the 4 x 4 knots, in words.
    start: usize,
    knots_u: usize,
    is_central: bool,
}

impl Window {
    /// The window of a pixel in the region, and the pixel's places along u and v.
    fn at(record: Record<'_>, pixel: PixelPoint) -> (Self, Place, Place) {
        let [cells_u, cells_v] = record.cells();
        let u = record.axis_u().place(pixel.u, cells_u);
        let v = record.axis_v().place(pixel.v, cells_v);
        let is_central = record.encoding() == Encoding::CentralF32.number();
        let channels = if is_central { 2 } else { 4 };
        let knots_u = cells_u as usize + 3;
        let first = (record.grid_offset() >> 2) as usize;
        let window = Self {
            start: first + (v.cell * knots_u + u.cell) * channels,
            knots_u,
            is_central,
        };
        (window, u, v)
    }

    /// The bicubic spline: first along u in each of four rows, then along v. Of a central camera
    /// the offset is zero. `None` cannot happen in a blob that was opened: its size was checked.
    fn evaluate(
        self,
        words: &[f32],
        along_u: impl Fn([f32; 4]) -> f32,
        along_v: impl Fn([f32; 4]) -> f32,
    ) -> Option<[f32; 4]> {
        if self.is_central {
            let [s1, s2] = self.channels::<2, 8>(words, along_u, along_v)?;
            Some([s1, s2, 0.0, 0.0])
        } else {
            self.channels::<4, 16>(words, along_u, along_v)
        }
    }

    /// The same with weights that are known only when it is called.
    #[inline(never)]
    fn evaluate_weighted(
        self,
        words: &[f32],
        along_u: Weights,
        along_v: Weights,
    ) -> Option<[f32; 4]> {
        self.evaluate(
            words,
            |knots| along_u.applied_to(knots),
            |knots| along_v.applied_to(knots),
        )
    }

    /// `ROW` is `4 * CHANNELS`.
    fn channels<const CHANNELS: usize, const ROW: usize>(
        self,
        words: &[f32],
        along_u: impl Fn([f32; 4]) -> f32,
        along_v: impl Fn([f32; 4]) -> f32,
    ) -> Option<[f32; CHANNELS]> {
        let stride = self.knots_u * CHANNELS;
        let row = |j: usize| -> Option<[f32; CHANNELS]> {
            let knots = words.get(self.start + j * stride..)?.first_chunk::<ROW>()?;
            Some(core::array::from_fn(|channel| {
                along_u(core::array::from_fn(|i| {
                    knots.get(i * CHANNELS + channel).map_or(0.0, |k| *k)
                }))
            }))
        };
        let (a, b, c, d) = (row(0)?, row(1)?, row(2)?, row(3)?);
        Some(core::array::from_fn(|channel| {
            let at = |row: &[f32; CHANNELS]| row.get(channel).map_or(0.0, |value| *value);
            along_v([at(&a), at(&b), at(&c), at(&d)])
        }))
    }
}

/// Whether the pixel is in the region and in a cell of the mask that is set.
pub(crate) fn is_calibrated(bytes: &[u8], record: Record<'_>, pixel: PixelPoint) -> bool {
    let (axis_u, axis_v) = (record.axis_u(), record.axis_v());
    if !(axis_u.contains(pixel.u) && axis_v.contains(pixel.v)) {
        return false;
    }
    let [cells_u, cells_v] = record.mask_cells();
    let bit =
        axis_v.mask_cell(pixel.v, cells_v) * cells_u as usize + axis_u.mask_cell(pixel.u, cells_u);
    let byte = bytes.get(record.mask_offset() as usize + (bit >> 3));
    byte.is_some_and(|byte| byte >> (bit & 7) & 1 == 1)
}

/// The unnormalized direction of a half-angle vector, `R (s1, s2, 1 - s.s/4)`; its length is
/// `1 + s.s/4`.
///
/// The third column of the rotation enters by itself and what deviates from it is added last:
/// one rounding at full magnitude instead of three.
fn direction(r: [f32; 9], [s1, s2]: [f32; 2]) -> Vector3<f32> {
    let drop = 0.25 * (s1 * s1 + s2 * s2);
    Vector3::new(
        r[2] + (r[0] * s1 + r[1] * s2 - r[2] * drop),
        r[5] + (r[3] * s1 + r[4] * s2 - r[5] * drop),
        r[8] + (r[6] * s1 + r[7] * s2 - r[8] * drop),
    )
}

/// Origin of the ray, mm: the two axes across it, of length `1 + s.s/4`, times the scaled offset
/// `m / (1 + s.s/4)` that the grid holds, so that nothing is divided.
fn origin(r: [f32; 9], t: [f32; 3], [s1, s2]: [f32; 2], [m1, m2]: [f32; 2]) -> Vector3<f32> {
    let difference = 0.25 * (s2 * s2 - s1 * s1);
    let product = -0.5 * (s1 * s2);
    let x = m1 + (difference * m1 + product * m2);
    let y = m2 + (product * m1 - difference * m2);
    let z = -(s1 * m1 + s2 * m2);
    Vector3::new(
        t[0] + (r[0] * x + r[1] * y + r[2] * z),
        t[1] + (r[3] * x + r[4] * y + r[5] * z),
        t[2] + (r[6] * x + r[7] * y + r[8] * z),
    )
}

/// How a ray moves when a sample of the control grid changes, both parts per unit of the change:
/// the differential of [`direction`] and [`origin`].
fn differential(r: [f32; 9], [s1, s2, m1, m2]: [f32; 4], [ds1, ds2, dm1, dm2]: [f32; 4]) -> Ray {
    let difference = 0.25 * (s2 * s2 - s1 * s1);
    let product = -0.5 * (s1 * s2);
    let difference_change = 0.5 * (s2 * ds2 - s1 * ds1);
    let product_change = -0.5 * (s1 * ds2 + s2 * ds1);
    let x =
        dm1 + (difference * dm1 + product * dm2) + (difference_change * m1 + product_change * m2);
    let y =
        dm2 + (product * dm1 - difference * dm2) + (product_change * m1 - difference_change * m2);
    let z = -(s1 * dm1 + s2 * dm2) - (ds1 * m1 + ds2 * m2);
    let drop = 0.5 * (s1 * ds1 + s2 * ds2);
    let turned = |x: f32, y: f32, z: f32| {
        Vector3::new(
            r[0] * x + r[1] * y + r[2] * z,
            r[3] * x + r[4] * y + r[5] * z,
            r[6] * x + r[7] * y + r[8] * z,
        )
    };
    Ray {
        origin_mm: turned(x, y, z),
        direction: turned(ds1, ds2, -drop),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const IDENTITY: [f32; 9] = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];

    #[test]
    fn ninety_degrees_off_axis_looks_sideways_and_its_offset_is_across() {
        let sideways = [2.0, 0.0];
        assert_eq!(direction(IDENTITY, sideways), Vector3::new(2.0, 0.0, 0.0));
        // The axes across are -z and y, each of length 2.
        let at = [10.0, 20.0, 30.0];
        assert_eq!(
            origin(IDENTITY, at, sideways, [1.0, 0.0]),
            Vector3::new(10.0, 20.0, 28.0)
        );
        assert_eq!(
            origin(IDENTITY, at, sideways, [0.0, 1.0]),
            Vector3::new(10.0, 22.0, 30.0)
        );
    }

    #[test]
    fn slope_is_the_differential_of_the_ray() {
        let turn = [0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
        let sample = [0.6, -0.9, 3.0, -2.0];
        for channel in 0..4 {
            // Powers of two: the differences are exact to round-off of the ray alone.
            let h = 0.0078125;
            let mut change = [0.0; 4];
            change[channel] = 1.0;
            let at = |step: f32| {
                let mut moved = sample;
                moved[channel] += step;
                let [s1, s2, m1, m2] = moved;
                (
                    origin(turn, [0.0; 3], [s1, s2], [m1, m2]),
                    direction(turn, [s1, s2]),
                )
            };
            let (low, high) = (at(-h), at(h));
            let found = differential(turn, sample, change);
            // Origin and direction are quadratic in s: central differences are exact.
            let error = (high.0 - low.0) / (2.0 * h) - found.origin_mm;
            assert!(error.norm() < 1e-4, "{channel}: {error}");
            let error = (high.1 - low.1) / (2.0 * h) - found.direction;
            assert!(error.norm() < 1e-4, "{channel}: {error}");
        }
    }

    #[test]
    fn rotation_is_row_major() {
        // x to y, y to z, z to x.
        let turn = [0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
        assert_eq!(direction(turn, [0.0, 0.0]), Vector3::x());
        assert_eq!(direction(turn, [2.0, 0.0]), Vector3::y() * 2.0);
        assert_eq!(
            origin(turn, [0.0; 3], [0.0, 0.0], [1.0, 2.0]),
            Vector3::new(0.0, 1.0, 2.0)
        );
    }
}
