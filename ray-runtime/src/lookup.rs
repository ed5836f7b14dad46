//! A pixel's ray from the control grid.

use crate::format::{Encoding, Record};
use crate::grid::{Place, blend};
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
    let [cells_u, cells_v] = record.cells();
    let u = record.axis_u().place(pixel.u, cells_u);
    let v = record.axis_v().place(pixel.v, cells_v);
    let first = (record.grid_offset() >> 2) as usize;
    let knots_u = cells_u as usize + 3;
    let rotation = record.rotation();
    let translation = record.translation_mm();
    if record.encoding() == Encoding::CentralF32.number() {
        let s = evaluate::<2, 8>(words, first, knots_u, u, v).ok_or(LookupError::Outside)?;
        Ok(Ray {
            origin_mm: translation.into(),
            direction: direction(rotation, s),
        })
    } else {
        let [s1, s2, m1, m2] =
            evaluate::<4, 16>(words, first, knots_u, u, v).ok_or(LookupError::Outside)?;
        Ok(Ray {
            origin_mm: origin(rotation, translation, [s1, s2], [m1, m2]),
            direction: direction(rotation, [s1, s2]),
        })
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

/// The bicubic spline at a place: first along u in each of four rows, then along v.
///
/// `ROW` is `4 * CHANNELS`. `None` cannot happen in a blob that was opened: its size was checked.
fn evaluate<const CHANNELS: usize, const ROW: usize>(
    words: &[f32],
    first: usize,
    knots_u: usize,
    u: Place,
    v: Place,
) -> Option<[f32; CHANNELS]> {
    let start = first + (v.cell * knots_u + u.cell) * CHANNELS;
    let stride = knots_u * CHANNELS;
    let row = |j: usize| -> Option<[f32; CHANNELS]> {
        let knots = words.get(start + j * stride..)?.first_chunk::<ROW>()?;
        Some(core::array::from_fn(|channel| {
            blend(
                u.weights,
                core::array::from_fn(|i| knots.get(i * CHANNELS + channel).map_or(0.0, |k| *k)),
            )
        }))
    };
    let (a, b, c, d) = (row(0)?, row(1)?, row(2)?, row(3)?);
    Some(core::array::from_fn(|channel| {
        let at = |row: &[f32; CHANNELS]| row.get(channel).map_or(0.0, |value| *value);
        blend(v.weights, [at(&a), at(&b), at(&c), at(&d)])
    }))
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
