//! Which pixels of a row are calibrated.

use crate::format::{Axis, Record};
use crate::grid::Inside;

/// The row of a mask's cells that a row of pixels lies in.
#[derive(Clone, Copy)]
pub(crate) struct MaskRow<'a> {
    axis: Axis,
    cells: u32,
    /// From the byte of the row's first bit on.
    bytes: &'a [u8],
    /// The bits of that byte before it.
    skipped: usize,
}

impl<'a> MaskRow<'a> {
    /// The row at a place along v.
    pub fn at(bytes: &'a [u8], record: Record<'a>, v: Inside) -> Self {
        let [cells, _] = record.mask_cells();
        let first = (record.axis_v().mask_cell(v) * cells) as usize;
        let start = record.mask_offset() as usize + (first >> 3);
        Self {
            axis: record.axis_u(),
            cells,
            bytes: bytes.get(start..).unwrap_or_default(),
            skipped: first & 7,
        }
    }

    /// The cell of a pixel of the region, seen from its first edge.
    #[inline(always)]
    pub fn cell(&self, from_edge_px: f32) -> usize {
        let cell = (from_edge_px * self.axis.mask_cells_per_px) as u32;
        cell.min(self.cells.wrapping_sub(1)) as usize
    }

    /// The first cell from this one on that is not calibrated.
    pub fn set_until(&self, cell: usize) -> usize {
        let mut bit = self.skipped + cell;
        let end = self.skipped + self.cells as usize;
        while bit < end {
            let byte = self.bytes.get(bit >> 3).copied().unwrap_or_default();
            let ones = (byte >> (bit & 7)).trailing_ones() as usize;
            bit += ones;
            if ones == 0 || bit & 7 != 0 {
                break;
            }
        }
        bit.min(end) - self.skipped
    }
}
