//! Where a pixel lies along an axis of a camera's region: in which cell of the mask and of the table.

use super::float::{Digits, normalized};
use super::product::product_unsigned;
use crate::format;
use core::num::NonZero;

/// An axis, prepared.
#[derive(Debug, Clone, Copy)]
pub struct Axis {
    /// Outer edge of the region's first pixel, and extent of the region: 65536ths of a pixel.
    min: i32,
    extent: u32,
    /// The power of two that takes the extent above 2^30, at most to 2^31.
    scale: u32,
    /// One by the extent so scaled, in 2^-61.
    inverse: u32,
    mask_cells: u32,
    cells: u32,
    /// What the record's `cell_high_px` leaves of a cell, as a share of a cell: in 2^-30.
    low: u32,
}

/// A place along an axis: the share of the region that lies before it, in 2^-31, less than all.
#[derive(Debug, Clone, Copy)]
pub struct Place(u32);

impl Axis {
    /// From the numbers of the record. `None` of cells that are smaller than the digits of a pixel.
    pub fn prepare(axis: format::Axis, cells: u32, mask_cells: u32) -> Option<Self> {
        let sixteenth = Digits::new(16);
        let min = sixteenth.fixed(axis.min_px);
        let extent = sixteenth
            .fixed(axis.max_px)
            .wrapping_sub(min)
            .cast_unsigned();
        let pixels = NonZero::new(extent >> 16)?;
        let shift = (pixels.get() - 1).leading_zeros().saturating_sub(17);
        let pixels = pixels.get() << (shift & 31);
        // 2^46 / pixels, rounded up, in two steps of a long division.
        let divisor = NonZero::new(pixels)?;
        let (first, rest) = ((1_u32 << 31) / divisor, (1_u32 << 31) % divisor);
        let inverse = (first << 15) + ((rest << 15) / divisor) + 1;
        let (low, low_exponent) = normalized(axis.cell_low_px);
        let (per_px, per_px_exponent) = normalized(axis.cells_per_px);
        // The product's upper half counts 2^32 times as much.
        let down = -(low_exponent + per_px_exponent + 32 + 30);
        let low = u32::try_from(down)
            .ok()
            .and_then(|down| product_unsigned(low, per_px).checked_shr(down))
            .unwrap_or(0);
        let least_cell = 1.0f32.to_bits();
        (axis.cell_high_px.to_bits() >= least_cell).then_some(Self {
            min,
            extent,
            scale: 1 << (shift & 31),
            inverse,
            mask_cells,
            cells,
            low,
        })
    }

    /// The place of a coordinate in 65536ths of a pixel, if it lies in the region.
    #[inline(always)]
    pub fn place(&self, coordinate: i32) -> Option<Place> {
        let from_edge = coordinate.wrapping_sub(self.min).cast_unsigned();
        if from_edge > self.extent {
            return None;
        }
        let half = product_unsigned(from_edge.wrapping_mul(self.scale), self.inverse);
        // Never before the exact place, so that a border belongs to the cell behind it.
        Some(Place((2 * half + 6).min(i32::MAX.cast_unsigned())))
    }

    /// Cells of the table.
    pub fn cells(&self) -> u32 {
        self.cells
    }

    /// Cells of the mask.
    pub fn mask_cells(&self) -> u32 {
        self.mask_cells
    }

    /// The mask's cell at a place.
    #[inline(always)]
    pub fn mask_cell(&self, place: Place) -> u32 {
        place.of(self.mask_cells).0
    }

    /// The table's cell and the share of it before the place, in 2^-30, as patches take it: with what
    /// `cell_high_px` leaves.
    #[inline(always)]
    pub fn cell_and_share(&self, place: Place) -> (u32, i32) {
        let (cell, fraction) = place.of(self.cells);
        let share = (fraction >> 1).wrapping_add(cell * self.low);
        (cell, share.cast_signed())
    }

    /// The table's cell and the share of it before the place, in 2^-30.
    pub fn cell_and_fraction(&self, place: Place) -> (u32, i32) {
        let (cell, fraction) = place.of(self.cells);
        (cell, (fraction >> 1).cast_signed())
    }

    /// The cell of quantized knots and the share of it before the place, in 2^-14: two places of them are
    /// left out of the axis.
    #[inline(always)]
    pub fn knot_place(&self, place: Place) -> (u32, i32) {
        let (cell, fraction) = place.of(self.cells);
        let at = ((cell << 16) + (fraction >> 15)).saturating_sub(place.0 >> 28);
        (at >> 16, ((at & 0xffff) >> 2).cast_signed())
    }
}

impl Place {
    /// From -1 to 1 over the region, in 2^-31: the variable of its polynomials.
    #[inline(always)]
    pub fn centered(self) -> i32 {
        (self.0 << 1 ^ 1 << 31).cast_signed()
    }

    /// Which of so many cells it is in, and the share of the cell before it, in 2^-31.
    #[inline(always)]
    fn of(self, cells: u32) -> (u32, u32) {
        // 15 and 16 binary digits by 10 of the cells.
        let (high, low) = ((self.0 >> 16) * cells, (self.0 & 0xffff) * cells);
        let cell = (high + (low >> 16)) >> 15;
        let fraction = (high << 16).wrapping_add(low) & ((1 << 31) - 1);
        (cell, fraction)
    }
}

/// A pixel coordinate in 65536ths, rounded down; `None` if it is on no sensor.
#[inline(always)]
pub fn coordinate(px: f32) -> Option<i32> {
    let bits = px.to_bits();
    // 32768 and above, infinite, or not a number.
    if (bits << 1) >> 24 >= 127 + 15 {
        return None;
    }
    let shift = 142 - ((bits << 1) >> 24);
    let word = bits << 8 | 1 << 31;
    let down = if shift < 32 { word >> shift } else { 0 };
    if bits >> 31 == 0 {
        return Some(down.cast_signed());
    }
    let is_exact = bits << 1 == 0 || shift < 32 && down << shift == word;
    Some((!down).cast_signed() + i32::from(is_exact))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coordinates_are_rounded_down() {
        for (px, expected) in [
            (0.0, 0),
            (-0.0, 0),
            (-0.5, -32_768),
            (-0.500_000_1, -32_769),
            (1e-9, 0),
            (-1e-9, -1),
            (639.25, 41_893_888),
            (32_767.5, 2_147_450_880),
        ] {
            assert_eq!(coordinate(px), Some(expected), "{px}");
        }
        for px in [32_768.0, -32_768.0, f32::NAN, f32::INFINITY] {
            assert_eq!(coordinate(px), None, "{px}");
        }
    }

    #[test]
    fn borders_belong_to_the_cell_behind_and_the_far_edge_to_the_last() {
        for (first, extent, cells) in [
            (0, 64, 5),
            (10, 1280, 30),
            (0, 6001, 97),
            (0, 32_768, 1024),
            (3, 1, 1),
        ] {
            let numbers = format::Axis::new(first, extent, cells, cells);
            let axis = Axis::prepare(numbers, cells, cells).unwrap();
            let edge = (first << 16).cast_signed() - 32_768;
            let step = (extent / 700).max(1);
            for pixel in (0..extent).step_by(step as usize) {
                // The center of a pixel may lie on a border.
                let place = axis
                    .place(edge + (pixel << 16).cast_signed() + 32_768)
                    .unwrap();
                assert_eq!(
                    axis.mask_cell(place),
                    (2 * pixel + 1) * cells / (2 * extent)
                );
                let exact = (f64::from(pixel) + 0.5) / f64::from(extent);
                assert!((f64::from(place.0) / 2.0f64.powi(31) - exact).abs() < 1e-8);
                let (cell, share) = axis.cell_and_share(place);
                assert_eq!(cell, (2 * pixel + 1) * cells / (2 * extent));
                // As f32 has it: from where `cell_high_px` has the cell's first edge.
                let start = f64::from(cell) * f64::from(numbers.cell_high_px);
                let exact = (f64::from(pixel) + 0.5 - start) * f64::from(numbers.cells_per_px);
                let share = f64::from(share) / 2.0f64.powi(30);
                // Eight steps of 2^-31 of the region, and of up to 1024 cells.
                assert!((share - exact).abs() < 5e-6, "{share} {exact}");
            }
            let end = edge + ((extent - 1) << 16).cast_signed() + 65_535;
            let last = axis.place(end.wrapping_add(1)).unwrap();
            assert_eq!(axis.cell_and_share(last).0, cells - 1);
            assert_eq!(axis.knot_place(last).0, cells - 1);
            assert!(axis.place(edge).is_some() && axis.place(edge - 1).is_none());
            assert!(axis.place(end.wrapping_add(2)).is_none());
        }
        // Cells smaller than a pixel.
        assert!(Axis::prepare(format::Axis::new(0, 8, 9, 1), 9, 1).is_none());
    }
}
