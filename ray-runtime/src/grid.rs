//! From a pixel coordinate to the four knots that matter and their weights.
//!
//! All numbers are plain f32 multiplications and additions: the same bits on every target.

use crate::format::Axis;

// Cells are at least one (checked when a blob is opened), so that one less does not wrap.

/// A place along one axis of a control grid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Place {
    /// First of the four knots.
    pub cell: usize,
    /// Weights of the knots 0, 2 and 3; knot 1 has what they leave of 1.
    pub weights: [f32; 3],
}

/// A coordinate in the region, from its first edge.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Inside {
    pub from_edge_px: f32,
    /// The same, but on the very edge a little before it: the product with cells per pixel is below their
    /// number, and nothing has to see to that.
    pub for_cells_px: f32,
}

/// So many of the last numbers before the far edge belong to it. A cell is at least a 1024th of the
/// region, and so much larger; what is rounded is less than three of them.
const EDGE: u32 = 16;

/// Apart, as hardly any pixel needs it.
#[cold]
#[inline(never)]
fn is_outside(bits: u32, extent_bits: u32) -> bool {
    bits > extent_bits
}

impl Axis {
    /// Where a coordinate lies between the region's outer edges; `None` if it does not, as NaN.
    ///
    /// Numbers from zero on are in the order of their bits, and all others have larger ones: one
    /// comparison of integers takes the place of two of numbers.
    #[inline(always)]
    pub(crate) fn inside(&self, coordinate_px: f32) -> Option<Inside> {
        let from_edge_px = coordinate_px - self.min_px;
        let bits = from_edge_px.to_bits();
        let extent_bits = self.extent_px().to_bits();
        let mut for_cells_px = from_edge_px;
        if bits > extent_bits.wrapping_sub(EDGE) {
            if is_outside(bits, extent_bits) {
                return None;
            }
            for_cells_px = f32::from_bits(extent_bits.wrapping_sub(EDGE));
        }
        Some(Inside {
            from_edge_px,
            for_cells_px,
        })
    }

    /// The region's extent, px.
    pub(crate) fn extent_px(&self) -> f32 {
        self.max_px - self.min_px
    }

    /// The coordinate at a share of the extent.
    pub(crate) fn at_share(&self, share: f32) -> f32 {
        self.min_px + share * self.extent_px()
    }

    /// The nearest coordinate that the axis contains; the middle for what is not a number.
    pub(crate) fn clamped(&self, coordinate_px: f32) -> f32 {
        if coordinate_px > self.max_px {
            self.max_px
        } else if coordinate_px < self.min_px {
            self.min_px
        } else if coordinate_px.is_nan() {
            self.at_share(0.5)
        } else {
            coordinate_px
        }
    }

    /// The mask's cell.
    #[inline(always)]
    pub(crate) fn mask_cell(&self, place: Inside) -> u32 {
        (place.for_cells_px * self.mask_cells_per_px) as u32
    }

    /// The grid's cell and the weights at a coordinate that the axis contains.
    pub(crate) fn place(&self, coordinate_px: f32, cells: u32) -> Place {
        let (cell, t) = self.cell_and_fraction(coordinate_px, cells);
        let r = 1.0 - t;
        Place {
            cell,
            weights: [
                r * r * r * SIXTH,
                TWO_THIRDS - r * r * (1.0 - 0.5 * r),
                t * t * t * SIXTH,
            ],
        }
    }

    /// The grid's cell.
    #[inline(always)]
    pub(crate) fn cell(&self, place: Inside) -> u32 {
        (place.for_cells_px * self.cells_per_px) as u32
    }

    /// Where a cell starts, seen from the region's first edge, but for what `cell_high_px` leaves out.
    #[inline(always)]
    pub(crate) fn cell_edge_px(&self, cell: u32) -> f32 {
        // Below 1024: exact.
        cell as f32 * self.cell_high_px
    }

    /// The share of the cell with this edge that lies before a place: 0 to 1, but for what
    /// `cell_high_px` leaves out of a cell's size.
    #[inline(always)]
    pub(crate) fn share(&self, from_edge_px: f32, cell_edge_px: f32) -> f32 {
        (from_edge_px - cell_edge_px) * self.cells_per_px
    }

    /// Derivatives of a place's weights by the coordinate, 1/px.
    pub(crate) fn slopes(&self, coordinate_px: f32, cells: u32) -> [f32; 3] {
        let (_, t) = self.cell_and_fraction(coordinate_px, cells);
        let r = 1.0 - t;
        [-0.5 * (r * r), r * (2.0 - 1.5 * r), 0.5 * (t * t)].map(|slope| slope * self.cells_per_px)
    }

    /// The cell of a coordinate and its place in it, 0 to 1.
    ///
    /// The fraction is taken from the distance to the cell's first edge, in two steps of which the
    /// first is exact: at pixel 6000, `coordinate * cells_per_px` minus its integer part would be
    /// off by 0.0003 px.
    fn cell_and_fraction(&self, coordinate_px: f32, cells: u32) -> (usize, f32) {
        let x = coordinate_px - self.min_px;
        let cell = ((x * self.cells_per_px) as u32).min(cells.wrapping_sub(1));
        let number = cell as f32;
        let rest_px = (x - number * self.cell_high_px) - number * self.cell_low_px;
        (cell as usize, rest_px * self.cells_per_px)
    }
}

const SIXTH: f32 = 1.0 / 6.0;
const TWO_THIRDS: f32 = 2.0 / 3.0;

/// What knots 0, 2 and 3 make of their differences to knot 1: with the slopes of the weights, the
/// derivative of the mean.
pub(crate) fn blend_slopes(weights: [f32; 3], [a, b, c, d]: [f32; 4]) -> f32 {
    weights[0] * (a - b) + weights[1] * (c - b) + weights[2] * (d - b)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_at_the_start_of_a_cell_are_one_four_one_sixths() {
        let axis = Axis::new(0, 64, 4, 4);
        let place = axis.place(15.5, 4);
        assert_eq!(place.cell, 1);
        assert_eq!(place.weights[0], 1.0 / 6.0);
        assert!((place.weights[1] - 1.0 / 6.0).abs() < 1e-7);
        assert_eq!(place.weights[2], 0.0);
    }

    #[test]
    fn last_edge_belongs_to_the_last_cell() {
        let axis = Axis::new(0, 641, 7, 5);
        let contains = |u: f32| axis.inside(u).is_some();
        assert!(contains(640.5) && contains(-0.5));
        assert!(!contains(f32::from_bits(640.5f32.to_bits() + 1)));
        assert!(!contains(-0.5000001) && !contains(f32::NAN));
        assert!(!contains(f32::INFINITY));
        let place = axis.place(640.5, 7);
        assert_eq!(place.cell, 6);
        assert!((place.weights[2] - 1.0 / 6.0).abs() < 1e-6);
        assert_eq!(axis.mask_cell(axis.inside(640.5).unwrap()), 4);
        assert_eq!(axis.mask_cell(axis.inside(-0.5).unwrap()), 0);
    }

    #[test]
    fn no_place_is_behind_the_last_cell_or_before_its_own() {
        for (extent, cells) in [
            (1, 1),
            (1, 1024),
            (7, 3),
            (641, 7),
            (6000, 97),
            (32768, 1024),
            (32767, 1023),
        ] {
            let axis = Axis::new(0, extent, cells, cells);
            let end = axis.max_px.to_bits();
            for bits in end - 200..=end {
                let u = f32::from_bits(bits);
                let from_edge_px = u - axis.min_px;
                let place = axis.inside(u).unwrap();
                let clamped = |per_px: f32| ((from_edge_px * per_px) as u32).min(cells - 1);
                assert_eq!(
                    axis.cell(place),
                    clamped(axis.cells_per_px),
                    "{extent} {cells} {u}"
                );
                assert_eq!(axis.mask_cell(place), clamped(axis.mask_cells_per_px));
            }
            assert!(axis.inside(f32::from_bits(end + 8)).is_none());
            assert!(axis.inside(f32::NAN).is_none() && axis.inside(-0.6).is_none());
        }
    }

    #[test]
    fn slopes_are_those_of_the_weights() {
        let axis = Axis::new(0, 640, 7, 5);
        for u in [3.0f32, 100.3, 411.7, 630.0] {
            let [low, high] = [u - 4.0, u + 4.0].map(|u| axis.place(u, 7));
            assert_eq!(low.cell, high.cell);
            for (k, slope) in axis.slopes(u, 7).into_iter().enumerate() {
                let difference = (high.weights[k] - low.weights[k]) / 8.0;
                // Third derivatives are up to 3 / cell^3, an eighth cell to each side.
                assert!((slope - difference).abs() < 2e-5, "{u} {k}");
            }
        }
    }

    #[test]
    fn a_line_through_the_knots_comes_out_as_that_line() {
        let axis = Axis::new(0, 6000, 97, 48);
        for u in [0.0f32, 61.35, 2999.5, 5990.125, 5999.0] {
            let place = axis.place(u, 97);
            let knot = |k: usize| (place.cell + k) as f32 - 1.0;
            let value = knot(1) + blend_slopes(place.weights, [knot(0), knot(1), knot(2), knot(3)]);
            let exact = (f64::from(u) + 0.5) * 97.0 / 6000.0;
            // 97 cells in f32: one digit is 8e-6 of a cell, and the fraction adds less.
            assert!(
                (f64::from(value) - exact).abs() < 5e-6,
                "{u}: {value} {exact}"
            );
        }
    }
}
