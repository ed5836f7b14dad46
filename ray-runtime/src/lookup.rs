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
    let ray = if record.encoding() == Encoding::CentralF32.number() {
        let s = evaluate::<2, 8>(words, first, knots_u, u, v).ok_or(LookupError::Outside)?;
        Ray {
            origin_mm: record.translation_mm().into(),
            direction: rotate(record.rotation(), direction(s)),
        }
    } else {
        let [s1, s2, m1, m2] =
            evaluate::<4, 16>(words, first, knots_u, u, v).ok_or(LookupError::Outside)?;
        let origin = rotate(record.rotation(), offset([s1, s2], [m1, m2]));
        Ray {
            origin_mm: Vector3::from(record.translation_mm()) + origin,
            direction: rotate(record.rotation(), direction([s1, s2])),
        }
    };
    Ok(ray)
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

/// The unnormalized direction of a half-angle vector; its length is `4 + s.s`.
fn direction([s1, s2]: [f32; 2]) -> [f32; 3] {
    [4.0 * s1, 4.0 * s2, 4.0 - (s1 * s1 + s2 * s2)]
}

/// The offset across the ray, mm: the two axes across it, of length `4 + s.s`, times the scaled
/// offset `m / (4 + s.s)` that the grid holds, so that nothing is divided.
fn offset([s1, s2]: [f32; 2], [m1, m2]: [f32; 2]) -> [f32; 3] {
    let difference = s2 * s2 - s1 * s1;
    let product = -2.0 * (s1 * s2);
    [
        (4.0 + difference) * m1 + product * m2,
        product * m1 + (4.0 - difference) * m2,
        -4.0 * (s1 * m1 + s2 * m2),
    ]
}

/// A row-major rotation times a vector.
fn rotate(r: [f32; 9], [x, y, z]: [f32; 3]) -> Vector3<f32> {
    Vector3::new(
        r[0] * x + r[1] * y + r[2] * z,
        r[3] * x + r[4] * y + r[5] * z,
        r[6] * x + r[7] * y + r[8] * z,
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ninety_degrees_off_axis_looks_sideways_and_its_offset_is_across() {
        assert_eq!(direction([2.0, 0.0]), [8.0, 0.0, 0.0]);
        // Axes across: -z and y, each of length 8.
        assert_eq!(offset([2.0, 0.0], [1.0, 0.0]), [0.0, 0.0, -8.0]);
        assert_eq!(offset([2.0, 0.0], [0.0, 1.0]), [0.0, 8.0, 0.0]);
    }
}
