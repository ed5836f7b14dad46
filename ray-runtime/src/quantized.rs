//! A table of a polynomial and of quantized spline knots, borrowed from the blob.

use crate::LookupError;
use crate::format::{
    QUANTIZED_HEADER_LEN, QuantizedHeader, QuantizedMap, Record, coefficient_count,
};
use crate::lookup::Views;
use crate::spline::Knots;

/// A camera's quantized table.
#[derive(Debug, Clone, Copy)]
pub(crate) struct QuantizedTable<'a> {
    pub header: QuantizedHeader,
    pairs: &'a [[f32; 2]],
}

/// What one of its maps is made of.
#[derive(Debug, Clone, Copy)]
pub(crate) struct QuantizedPart<'a> {
    pub coefficients: &'a [[f32; 2]],
    /// What the polynomial leaves, in steps.
    pub knots: Option<Knots<'a>>,
    pub step: f32,
}

impl<'a> QuantizedTable<'a> {
    /// The table of a record. The error cannot happen in a blob that was opened.
    pub fn new(views: Views<'a>, record: Record<'_>) -> Result<Self, LookupError> {
        let start = (record.grid_offset() >> 3) as usize;
        let pairs = views.pairs.get(start..).ok_or(LookupError::Outside)?;
        let header = QuantizedHeader::read(pairs).ok_or(LookupError::Outside)?;
        Ok(Self { header, pairs })
    }

    /// The map of the half-angle vector.
    pub fn direction(&self) -> Result<QuantizedPart<'a>, LookupError> {
        let [_, knots, _] = self.header.starts;
        self.part(self.header.direction, QUANTIZED_HEADER_LEN as u32, knots)
    }

    /// The map of the scaled offset, of a camera that is not central.
    pub fn offset(&self) -> Result<QuantizedPart<'a>, LookupError> {
        let [coefficients, _, knots] = self.header.starts;
        self.part(self.header.offset, coefficients, knots)
    }

    fn part(
        &self,
        map: QuantizedMap,
        coefficients: u32,
        knots: u32,
    ) -> Result<QuantizedPart<'a>, LookupError> {
        let behind = |start: u32| self.pairs.get((start >> 3) as usize..);
        let part = behind(coefficients).and_then(|pairs| {
            let coefficients = pairs.get(..coefficient_count(map.degree.into()))?;
            let knots = match map.number_len {
                0 => None,
                1 => Some(Knots::I8(bytemuck::try_cast_slice(behind(knots)?).ok()?)),
                _ => Some(Knots::I16(bytemuck::try_cast_slice(behind(knots)?).ok()?)),
            };
            Some(QuantizedPart {
                coefficients,
                knots,
                step: map.step,
            })
        });
        part.ok_or(LookupError::Outside)
    }
}
