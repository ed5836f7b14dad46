//! A table of a polynomial and of quantized spline knots, borrowed from the blob.

use crate::PixelPoint;
use crate::format::{QuantizedMap, Record};
use crate::lookup::{Evaluated, Sample, Views};
use crate::polynomial;
use crate::spline::{Knots, Window};

/// The sample of a quantized table. `None` cannot happen in a blob that was opened: the sizes of its
/// parts were checked.
#[inline(never)]
pub(crate) fn sample<T: Evaluated>(
    views: Views<'_>,
    record: Record<'_>,
    pixel: PixelPoint,
) -> Option<Sample<T>> {
    let start = (record.grid_offset() >> 3) as usize;
    let table = views.pairs.get(start..)?;
    let [direction_a, direction_b, offset_a, offset_b, scale] = table.first_chunk()?;
    let [scale_u, scale_v] = *scale;
    let x = (pixel.u - record.axis_u().min_px) * scale_u - 1.0;
    let y = (pixel.v - record.axis_v().min_px) * scale_v - 1.0;
    let place = Place {
        record,
        pixel,
        x: T::along_u(x, scale_u),
        y: T::along_v(y, scale_v),
    };
    let s = place.map(table, [direction_a, direction_b])?;
    let n = if record.is_central() {
        [T::from(0.0); 2]
    } else {
        place.map(table, [offset_a, offset_b])?
    };
    Some(Sample { s, n })
}

/// A pixel of a camera, and the polynomials' variables there.
struct Place<'r, T> {
    record: Record<'r>,
    pixel: PixelPoint,
    x: T,
    y: T,
}

impl<T: Evaluated> Place<'_, T> {
    /// The value of one of a table's maps.
    #[inline(never)]
    fn map(&self, table: &[[f32; 2]], [a, b]: [&[f32; 2]; 2]) -> Option<[T; 2]> {
        let map = QuantizedMap::read([*a, *b])?;
        let behind = |start: u32| table.get((start >> 3) as usize..);
        let coefficients = behind(map.coefficients_start)?;
        let predicted = polynomial::evaluate(coefficients, map.degree, self.x, self.y)?;
        if map.number_len == 0 {
            return Some(predicted);
        }
        let knots = behind(map.knots_start)?;
        let knots = if map.number_len == 1 {
            Knots::I8(bytemuck::cast_slice(knots))
        } else {
            Knots::I16(bytemuck::cast_slice(knots))
        };
        let left = T::blend(&Window::at(self.record, self.pixel), knots)?;
        let step = T::from(map.step);
        let [a, b] = predicted;
        Some([a + step * left[0], b + step * left[1]])
    }
}
