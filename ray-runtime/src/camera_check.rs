//! What opening a blob checks of a camera: its record and its tables.

use crate::OpenError;
use crate::check::{check_padding, is_rotation, same_bits};
use crate::error::Table;
use crate::format::{
    self, Axis, CameraMeta, Encoding, MAX_CELLS, MAX_DEGREE, QUANTIZED_HEADER_LEN, QuantizedHeader,
    QuantizedMap, Record, is_moderate,
};
use crate::lookup::Views;

/// A camera to check.
pub(crate) struct CameraCheck<'a> {
    pub views: Views<'a>,
    /// Its index.
    pub camera: u16,
    pub record: Record<'a>,
    /// Of the blob.
    pub version: u16,
}

impl CameraCheck<'_> {
    /// Checks the record and the tables, which must start at `start`, a multiple of 8; where they
    /// end.
    pub fn run(&self, meta: &CameraMeta<'_>, start: usize) -> Result<usize, OpenError> {
        let (record, bytes) = (self.record, self.views.bytes);
        let encoding = Encoding::from_number(record.encoding())
            .filter(|encoding| encoding.since_version() <= self.version)
            .ok_or(OpenError::UnknownEncoding {
                camera: self.camera,
                found: record.encoding(),
            })?;
        if !encoding.is_read() {
            return Err(OpenError::FormLeftOut {
                camera: self.camera,
                found: record.encoding(),
            });
        }
        let (cells, mask_cells) = (record.cells(), record.mask_cells());
        let is_count = |count: &u32| (1..=MAX_CELLS).contains(count);
        if !(cells.iter().chain(&mask_cells).all(is_count) && record.reserved() == 0) {
            return Err(self.layout(Table::Record));
        }
        let [axis_u, axis_v] = [
            Axis::new(meta.region_u, meta.region_width, cells[0], mask_cells[0]),
            Axis::new(meta.region_v, meta.region_height, cells[1], mask_cells[1]),
        ];
        if !(same_bits(axis_u, record.axis_u())
            && same_bits(axis_v, record.axis_v())
            && is_rotation(record.rotation())
            && record.translation_mm().into_iter().all(is_moderate))
        {
            return Err(self.number(Table::Record));
        }
        if record.grid_offset() as usize != start {
            return Err(self.layout(Table::Grid));
        }
        let grid_end = match encoding.table_len(cells) {
            Some(len) => {
                self.check_numbers(start, start.saturating_add(len))?;
                start.saturating_add(len)
            }
            // Never where the form is left out, so that nothing of it is linked.
            None if cfg!(feature = "quantized") => self.check_quantized(encoding, meta, start)?,
            None => return Err(self.layout(Table::Grid)),
        };

        let mask_start = format::aligned(grid_end);
        let mask_end = mask_start.saturating_add(format::mask_len(mask_cells));
        let end = format::aligned(mask_end);
        check_padding(bytes, grid_end, mask_start)?;
        let mask = bytes
            .get(mask_start..mask_end)
            .filter(|_| record.mask_offset() as usize == mask_start)
            .ok_or(self.layout(Table::Mask))?;
        // Bits behind the last cell.
        let used = (mask_cells[0] * mask_cells[1]) & 7;
        let is_padded = used == 0 || mask.last().is_some_and(|last| last >> used == 0);
        if !is_padded {
            return Err(self.number(Table::Mask));
        }
        if bytes.len() < end {
            return Err(self.layout(Table::Mask));
        }
        check_padding(bytes, mask_end, end)?;
        Ok(end)
    }

    /// Checks the parts of a quantized table; where it ends.
    fn check_quantized(
        &self,
        encoding: Encoding,
        meta: &CameraMeta<'_>,
        start: usize,
    ) -> Result<usize, OpenError> {
        let header = self
            .views
            .pairs
            .get(start >> 3..)
            .and_then(QuantizedHeader::read)
            .ok_or(self.layout(Table::Grid))?;
        let QuantizedHeader {
            direction, offset, ..
        } = header;
        let is_map = |map: QuantizedMap| map.degree <= MAX_DEGREE && map.number_len <= 2;
        // Bits, as those of a zero count too.
        let is_absent =
            |map: QuantizedMap| map.degree == 0 && map.number_len == 0 && map.unit.to_bits() == 0;
        let (is_central, cells) = (encoding.is_central, self.record.cells());
        if !(is_map(direction) && is_map(offset) && (!is_central || is_absent(offset))) {
            return Err(self.layout(Table::Grid));
        }
        let extent_px = [meta.region_width, meta.region_height];
        let second = (!is_central).then_some(offset);
        let expected = QuantizedHeader::new(direction, second, extent_px, cells);
        if header.knots_start != expected.knots_start {
            return Err(self.layout(Table::Grid));
        }
        let is_unit = |map: QuantizedMap| map.unit >= 0.0 && is_moderate(map.unit);
        if !(header.scale == expected.scale
            && header.places_per_px == expected.places_per_px
            && is_unit(direction)
            && is_unit(offset))
        {
            return Err(self.number(Table::Grid));
        }
        let layout = header.layout(cells);
        let at = |place: usize| start.saturating_add(place);
        self.check_numbers(at(QUANTIZED_HEADER_LEN), at(layout.direction_knots))?;
        let end = at(layout.offset_knots_end);
        if self.views.bytes.len() < end {
            return Err(self.layout(Table::Grid));
        }
        check_padding(
            self.views.bytes,
            at(layout.direction_knots_end),
            at(layout.offset_knots),
        )?;
        Ok(end)
    }

    /// Checks that the f32 from one byte to another, multiples of 8, are there and moderate.
    #[inline(never)]
    fn check_numbers(&self, start: usize, end: usize) -> Result<(), OpenError> {
        let pairs = self
            .views
            .pairs
            .get(start >> 3..end >> 3)
            .ok_or(self.layout(Table::Grid))?;
        if pairs.as_flattened().iter().copied().all(is_moderate) {
            Ok(())
        } else {
            Err(self.number(Table::Grid))
        }
    }

    fn layout(&self, table: Table) -> OpenError {
        OpenError::BadLayout {
            camera: self.camera,
            table,
        }
    }

    fn number(&self, table: Table) -> OpenError {
        OpenError::BadNumber {
            camera: self.camera,
            table,
        }
    }
}
