//! The working numbers of a pixel axis.

/// Numbers that turn a pixel coordinate into a cell and a fraction, along one axis.
///
/// They follow from the region, the cells and the mask's cells ([`Axis::new`]); they stand in the
/// blob so that a lookup need not divide, and `open` checks that they are the ones that follow.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Axis {
    /// Outer edge of the region's first pixel, px.
    pub min_px: f32,
    /// Outer edge of the region's last pixel, px.
    pub max_px: f32,
    /// Cells per pixel.
    pub cells_per_px: f32,
    /// Size of a cell, its first 12 binary digits, px: times a cell number it is exact.
    pub cell_high_px: f32,
    /// Size of a cell, what `cell_high_px` leaves, px.
    pub cell_low_px: f32,
    /// Mask cells per pixel, rounded up: a pixel on a border belongs to the cell after it.
    pub mask_cells_per_px: f32,
}

impl Axis {
    /// The numbers of an axis with `extent_px` pixels from number `first_px` on.
    ///
    /// Extents, first pixels up to [`MAX_EXTENT_PX`](super::MAX_EXTENT_PX) and cells from 1 to [`MAX_CELLS`](super::MAX_CELLS) give finite
    /// numbers; anything else gives some numbers.
    pub fn new(first_px: u32, extent_px: u32, cells: u32, mask_cells: u32) -> Self {
        let (first, extent, cells) = (first_px as f32, extent_px as f32, cells as f32);
        // Sign, exponent and 11 stored binary digits.
        let cell_high_px = f32::from_bits((extent / cells).to_bits() & 0xffff_f000);
        let mask_cells_per_px = mask_cells as f32 / extent;
        Self {
            min_px: first - 0.5,
            max_px: first + extent - 0.5,
            cells_per_px: cells / extent,
            cell_high_px,
            cell_low_px: (extent - cells * cell_high_px) / cells,
            mask_cells_per_px: f32::from_bits(mask_cells_per_px.to_bits().wrapping_add(1)),
        }
    }

    /// The six numbers in the order of the record.
    pub const fn to_numbers(self) -> [f32; 6] {
        [
            self.min_px,
            self.max_px,
            self.cells_per_px,
            self.cell_high_px,
            self.cell_low_px,
            self.mask_cells_per_px,
        ]
    }

    /// From the six words of the record.
    pub const fn from_bits(bits: [u32; 6]) -> Self {
        Self {
            min_px: f32::from_bits(bits[0]),
            max_px: f32::from_bits(bits[1]),
            cells_per_px: f32::from_bits(bits[2]),
            cell_high_px: f32::from_bits(bits[3]),
            cell_low_px: f32::from_bits(bits[4]),
            mask_cells_per_px: f32::from_bits(bits[5]),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cell_size_is_kept_to_beyond_single_precision() {
        for (extent, cells) in [(6000, 97), (1280, 30), (32768, 1023), (7, 3), (1, 1)] {
            let axis = Axis::new(0, extent, cells, 48);
            let size = f64::from(axis.cell_high_px) + f64::from(axis.cell_low_px);
            let exact = f64::from(extent) / f64::from(cells);
            // 12 digits in the high part, 24 more in the low part.
            assert!(
                (size - exact).abs() <= exact * 2.0f64.powi(-35),
                "{extent} {cells}"
            );
            let product = axis.cell_high_px * cells as f32;
            assert_eq!(
                f64::from(product),
                f64::from(axis.cell_high_px) * f64::from(cells)
            );
        }
    }

    #[test]
    fn a_pixel_on_a_mask_border_is_in_the_cell_after_it() {
        for (extent, cells) in [
            (1224u32, 48u32),
            (1280, 48),
            (6000, 48),
            (4500, 36),
            (6001, 48),
        ] {
            let axis = Axis::new(0, extent, 4, cells);
            for u in 0..extent {
                let exact = (2 * u + 1) * cells / (2 * extent);
                let x = u as f32 + 0.5;
                assert_eq!(
                    (x * axis.mask_cells_per_px) as u32,
                    exact,
                    "{extent} {cells} {u}"
                );
            }
        }
    }
}
