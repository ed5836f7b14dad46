//! A pixel's ray from a camera's table.

use crate::format::{Encoding, Form, Record};
use crate::grid::Inside;
use crate::polynomial::{self, Dual, Number};
use crate::quantized;
use crate::spline;
use crate::vector::Vector;
use crate::{LookupError, PixelPoint, Ray};

/// A blob seen two ways: as bytes, and as pairs of numbers.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Views<'a> {
    pub bytes: &'a [u8],
    pub pairs: &'a [[f32; 2]],
}

/// Half-angle vector and scaled offset; the offset of a central camera is zero.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Sample<T> {
    pub s: [T; 2],
    pub n: [T; 2],
}

/// What a table is evaluated in: numbers, or numbers with their derivatives by the pixel.
pub(crate) trait Evaluated: Number {
    /// A coordinate that grows with u at a rate, 1/px.
    fn along_u(value: f32, per_px: f32) -> Self;
    /// A coordinate that grows with v at a rate, 1/px.
    fn along_v(value: f32, per_px: f32) -> Self;
    /// The spline of f32 knots at the window.
    fn blend(window: &spline::Window<'_>, knots: spline::Knots<'_>) -> Option<[Self; 2]>;
}

impl Evaluated for f32 {
    fn along_u(value: f32, _: f32) -> Self {
        value
    }

    fn along_v(value: f32, _: f32) -> Self {
        value
    }

    #[inline(always)]
    fn blend(window: &spline::Window<'_>, knots: spline::Knots<'_>) -> Option<[Self; 2]> {
        window.blend(knots)
    }
}

impl Evaluated for Dual {
    fn along_u(value: f32, by_u: f32) -> Self {
        Self {
            value,
            by_u,
            by_v: 0.0,
        }
    }

    fn along_v(value: f32, by_v: f32) -> Self {
        Self {
            value,
            by_u: 0.0,
            by_v,
        }
    }

    fn blend(window: &spline::Window<'_>, knots: spline::Knots<'_>) -> Option<[Self; 2]> {
        window.blend_moving(knots)
    }
}

pub(crate) const CENTRAL_PATCHES: u32 = number(Form::Patches, true);
pub(crate) const NON_CENTRAL_PATCHES: u32 = number(Form::Patches, false);
const CENTRAL_SPLINE: u32 = number(Form::Spline, true);
const NON_CENTRAL_SPLINE: u32 = number(Form::Spline, false);

/// Forms that are read: nothing is linked of those that are not.
pub(crate) const HAS_PATCHES: bool = cfg!(feature = "patches");
pub(crate) const HAS_QUANTIZED: bool = cfg!(feature = "quantized");
pub(crate) const HAS_SPLINES: bool = cfg!(feature = "old-versions");

const fn number(form: Form, is_central: bool) -> u32 {
    Encoding { form, is_central }.number()
}

impl Views<'_> {
    /// The ray of a pixel, rig frame.
    #[inline(always)]
    pub fn lookup(&self, record: Record<'_>, pixel: PixelPoint) -> Result<Ray, LookupError> {
        let places = calibrated(self.bytes, record, pixel).ok_or(LookupError::Outside)?;
        // The form that is for speed, in the place of the call; all others behind another one.
        if HAS_PATCHES && record.encoding() == CENTRAL_PATCHES {
            let [s] = self.patch::<1, f32>(record, places)?;
            Ok(central_ray(Pose::of(record), s))
        } else {
            self.lookup_other(record, pixel)
        }
    }

    /// The ray of a calibrated pixel from a table of another form.
    #[inline(never)]
    fn lookup_other(&self, record: Record<'_>, pixel: PixelPoint) -> Result<Ray, LookupError> {
        if HAS_PATCHES && record.encoding() == NON_CENTRAL_PATCHES {
            let [s, n] = self.patch::<2, f32>(record, inside(record, pixel)?)?;
            Ok(shifted_ray(Pose::of(record), Sample { s, n }))
        } else if is_spline(record) {
            lookup_spline(self.pairs, record, pixel)
        } else if HAS_QUANTIZED {
            quantized::lookup(self.pairs, record, from_edge(record, pixel))
        } else {
            // Never: `open` refuses what is left out.
            Err(LookupError::Outside)
        }
    }

    /// The ray of a pixel of the region, calibrated or not, and how it moves with u and with v: of a
    /// calibrated pixel the bits of [`lookup`](Self::lookup).
    ///
    /// It is for size, where `lookup` is for speed.
    #[inline(never)]
    pub fn lookup_moving(
        &self,
        record: Record<'_>,
        pixel: PixelPoint,
    ) -> Result<MovingRay, LookupError> {
        let places = inside(record, pixel)?;
        let sample: Sample<Dual> = match record.encoding() {
            CENTRAL_PATCHES if HAS_PATCHES => {
                let [s] = self.patch(record, places)?;
                Sample {
                    s,
                    n: [0.0.into(); 2],
                }
            }
            NON_CENTRAL_PATCHES if HAS_PATCHES => {
                let [s, n] = self.patch(record, places)?;
                Sample { s, n }
            }
            _ if is_spline(record) => {
                spline::sample(self.pairs, record, pixel).ok_or(LookupError::Outside)?
            }
            _ if HAS_QUANTIZED => {
                quantized::sample_moving(self.pairs, record, pixel).ok_or(LookupError::Outside)?
            }
            _ => return Err(LookupError::Outside),
        };
        let part = |part: fn(Dual) -> f32| Sample {
            s: sample.s.map(part),
            n: sample.n.map(part),
        };
        let value = part(|x| x.value);
        let changes = [part(|x| x.by_u), part(|x| x.by_v)];
        Ok(MovingRay {
            ray: ray(record, value),
            by_pixel: changes.map(|change| differential(record.rotation(), value, change)),
        })
    }

    /// The cubics of a pixel's cell: of the half-angle vector, and of the offset if `MAPS` is 2.
    #[inline(always)]
    fn patch<const MAPS: usize, T: Evaluated>(
        &self,
        record: Record<'_>,
        [u, v]: [Inside; 2],
    ) -> Result<[[T; 2]; MAPS], LookupError> {
        let (axis_u, axis_v) = (record.axis_u(), record.axis_v());
        let (cell_u, cell_v) = (axis_u.cell(u), axis_v.cell(v));
        let x = axis_u.share(u.from_edge_px, axis_u.cell_edge_px(cell_u));
        let y = axis_v.share(v.from_edge_px, axis_v.cell_edge_px(cell_v));
        let x = T::along_u(x, axis_u.cells_per_px);
        let y = T::along_v(y, axis_v.cells_per_px);
        let [cells_u, _] = record.cells();
        let cell = (cell_v * cells_u + cell_u) as usize;
        let start = (record.grid_offset() >> 3) as usize + cell * (10 * MAPS);
        let coefficients = self.pairs.get(start..).ok_or(LookupError::Outside)?;
        let (maps, _) = coefficients.as_chunks::<10>();
        let maps = maps.first_chunk::<MAPS>().ok_or(LookupError::Outside)?;
        // Not by `map`, which the compiler does not always inline.
        let mut values = [[x; 2]; MAPS];
        for (value, map) in values.iter_mut().zip(maps) {
            *value = polynomial::cubic(map, x, y);
        }
        Ok(values)
    }
}

/// Whether a table is of the form of old versions; never, so that nothing of it is linked, where they
/// are not read.
#[inline(always)]
pub(crate) fn is_spline(record: Record<'_>) -> bool {
    HAS_SPLINES && matches!(record.encoding(), CENTRAL_SPLINE | NON_CENTRAL_SPLINE)
}

/// The ray from such a table.
#[inline(never)]
fn lookup_spline(
    pairs: &[[f32; 2]],
    record: Record<'_>,
    pixel: PixelPoint,
) -> Result<Ray, LookupError> {
    let sample = spline::sample(pairs, record, pixel).ok_or(LookupError::Outside)?;
    Ok(ray(record, sample))
}

/// A ray and its derivatives by the pixel.
#[derive(Debug, Clone, Copy)]
pub(crate) struct MovingRay {
    pub ray: Ray,
    by_pixel: [Ray; 2],
}

impl MovingRay {
    /// How the ray moves at `origin + lambda * direction` with u and with v, mm/px.
    pub fn shifts_at(&self, lambda: f32) -> [Vector; 2] {
        self.by_pixel
            .map(|slope| Vector::from(slope.origin_mm) + Vector::from(slope.direction) * lambda)
    }
}

/// The ray of a sample of a camera's table, rig frame.
#[inline(always)]
pub(crate) fn ray(record: Record<'_>, sample: Sample<f32>) -> Ray {
    let pose = Pose::of(record);
    if record.is_central() {
        central_ray(pose, sample.s)
    } else {
        shifted_ray(pose, sample)
    }
}

/// Where a camera is: rows of the rotation, one after the other, and the translation, mm.
#[derive(Clone, Copy)]
pub(crate) struct Pose {
    rotation: [f32; 9],
    translation_mm: [f32; 3],
}

impl Pose {
    #[inline(always)]
    pub fn of(record: Record<'_>) -> Self {
        Self {
            rotation: record.rotation(),
            translation_mm: record.translation_mm(),
        }
    }
}

#[inline(always)]
pub(crate) fn central_ray(pose: Pose, s: [f32; 2]) -> Ray {
    Ray {
        origin_mm: pose.translation_mm,
        direction: direction(pose.rotation, s),
    }
}

#[inline(always)]
pub(crate) fn shifted_ray(pose: Pose, sample: Sample<f32>) -> Ray {
    Ray {
        origin_mm: origin(pose.rotation, pose.translation_mm, sample),
        direction: direction(pose.rotation, sample.s),
    }
}

/// A pixel from the outer edge of the region.
#[inline(always)]
pub(crate) fn from_edge(record: Record<'_>, pixel: PixelPoint) -> PixelPoint {
    PixelPoint {
        u: pixel.u - record.axis_u().min_px,
        v: pixel.v - record.axis_v().min_px,
    }
}

/// Where a pixel lies in the region.
#[inline(always)]
fn inside(record: Record<'_>, pixel: PixelPoint) -> Result<[Inside; 2], LookupError> {
    let u = record
        .axis_u()
        .inside(pixel.u)
        .ok_or(LookupError::Outside)?;
    let v = record
        .axis_v()
        .inside(pixel.v)
        .ok_or(LookupError::Outside)?;
    Ok([u, v])
}

/// The same if it is in a cell of the mask that is set.
#[inline(always)]
fn calibrated(bytes: &[u8], record: Record<'_>, pixel: PixelPoint) -> Option<[Inside; 2]> {
    let [u, v] = inside(record, pixel).ok()?;
    let (cell_u, cell_v) = (record.axis_u().mask_cell(u), record.axis_v().mask_cell(v));
    let [cells_u, _] = record.mask_cells();
    let bit = (cell_v * cells_u + cell_u) as usize;
    let byte = bytes.get(record.mask_offset() as usize + (bit >> 3))?;
    (byte >> (bit & 7) & 1 == 1).then_some([u, v])
}

/// Whether the pixel is in the region and in a cell of the mask that is set.
pub(crate) fn is_calibrated(bytes: &[u8], record: Record<'_>, pixel: PixelPoint) -> bool {
    calibrated(bytes, record, pixel).is_some()
}

/// The unnormalized direction of a half-angle vector, `R (s1, s2, 1 - s.s/4)`; its length is
/// `1 + s.s/4`.
///
/// The third column of the rotation enters by itself and what deviates from it is added last:
/// one rounding at full magnitude instead of three.
fn direction(r: [f32; 9], [s1, s2]: [f32; 2]) -> [f32; 3] {
    let drop = 0.25 * (s1 * s1 + s2 * s2);
    [
        r[2] + (r[0] * s1 + r[1] * s2 - r[2] * drop),
        r[5] + (r[3] * s1 + r[4] * s2 - r[5] * drop),
        r[8] + (r[6] * s1 + r[7] * s2 - r[8] * drop),
    ]
}

/// Origin of the ray, mm: the two axes across it, of length `1 + s.s/4`, times the scaled offset
/// `m / (1 + s.s/4)` that the grid holds, so that nothing is divided.
fn origin(r: [f32; 9], t: [f32; 3], sample: Sample<f32>) -> [f32; 3] {
    let ([s1, s2], [m1, m2]) = (sample.s, sample.n);
    let difference = 0.25 * (s2 * s2 - s1 * s1);
    let product = -0.5 * (s1 * s2);
    let x = m1 + (difference * m1 + product * m2);
    let y = m2 + (product * m1 - difference * m2);
    let z = -(s1 * m1 + s2 * m2);
    [
        t[0] + (r[0] * x + r[1] * y + r[2] * z),
        t[1] + (r[3] * x + r[4] * y + r[5] * z),
        t[2] + (r[6] * x + r[7] * y + r[8] * z),
    ]
}

/// How a ray moves when a sample of the control grid changes, both parts per unit of the change:
/// the differential of [`direction`] and [`origin`].
fn differential(r: [f32; 9], sample: Sample<f32>, change: Sample<f32>) -> Ray {
    let ([s1, s2], [m1, m2]) = (sample.s, sample.n);
    let ([ds1, ds2], [dm1, dm2]) = (change.s, change.n);
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
        [
            r[0] * x + r[1] * y + r[2] * z,
            r[3] * x + r[4] * y + r[5] * z,
            r[6] * x + r[7] * y + r[8] * z,
        ]
    };
    Ray {
        origin_mm: turned(x, y, z),
        direction: turned(ds1, ds2, -drop),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(s: [f32; 2], n: [f32; 2]) -> Sample<f32> {
        Sample { s, n }
    }

    const IDENTITY: [f32; 9] = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];

    #[test]
    fn ninety_degrees_off_axis_looks_sideways_and_its_offset_is_across() {
        let sideways = [2.0, 0.0];
        assert_eq!(direction(IDENTITY, sideways), [2.0, 0.0, 0.0]);
        // The axes across are -z and y, each of length 2.
        let at = [10.0, 20.0, 30.0];
        assert_eq!(
            origin(IDENTITY, at, sample(sideways, [1.0, 0.0])),
            [10.0, 20.0, 28.0]
        );
        assert_eq!(
            origin(IDENTITY, at, sample(sideways, [0.0, 1.0])),
            [10.0, 22.0, 30.0]
        );
    }

    #[test]
    fn slope_is_the_differential_of_the_ray() {
        let turn = [0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
        let start = [0.6, -0.9, 3.0, -2.0];
        let sampled = |[s1, s2, m1, m2]: [f32; 4]| sample([s1, s2], [m1, m2]);
        for channel in 0..4 {
            // Powers of two: the differences are exact to round-off of the ray alone.
            let h = 0.0078125;
            let mut change = [0.0; 4];
            change[channel] = 1.0;
            let at = |step: f32| {
                let mut moved = start;
                moved[channel] += step;
                let moved = sampled(moved);
                (origin(turn, [0.0; 3], moved), direction(turn, moved.s))
            };
            let (low, high) = (at(-h), at(h));
            let found = differential(turn, sampled(start), sampled(change));
            // Origin and direction are quadratic in s: central differences are exact.
            let error = |high: [f32; 3], low: [f32; 3], found: [f32; 3]| {
                let difference = Vector::from(high) - low.into();
                (difference * (0.5 / h) - found.into()).norm_squared()
            };
            assert!(error(high.0, low.0, found.origin_mm) < 1e-8, "{channel}");
            assert!(error(high.1, low.1, found.direction) < 1e-8, "{channel}");
        }
    }

    #[test]
    fn rotation_is_row_major() {
        // x to y, y to z, z to x.
        let turn = [0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
        assert_eq!(direction(turn, [0.0, 0.0]), [1.0, 0.0, 0.0]);
        assert_eq!(direction(turn, [2.0, 0.0]), [0.0, 2.0, 0.0]);
        assert_eq!(
            origin(turn, [0.0; 3], sample([0.0, 0.0], [1.0, 2.0])),
            [0.0, 1.0, 2.0]
        );
    }
}
