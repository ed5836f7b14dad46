//! One line of `corners.csv`, of a grid's corner or of a point with a known place.

use super::error::CornersError;
use super::fields::{shortened, unquoted};
use super::header::{Columns, Labels};
use crate::dataset::Dataset;
use calib_rays::board::KnownPlace;
use calib_rays::geometry::PixelPoint;
use nalgebra::Vector3;
use std::path::Path;

/// Most columns that a header has.
const MOST_COLUMNS: usize = 9;

/// Places are no farther from their origin than this, mm: a kilometer. Beyond, a double no longer tells microns apart
/// after a few sums, and nobody measures with cameras.
pub(in crate::dataset) const FARTHEST_MM: f64 = 1e6;

/// What a corner is called.
#[derive(Debug, Clone, Copy)]
pub(super) enum Label {
    /// Row and column of a grid.
    RowCol(usize, usize),
    /// Its place.
    Place(KnownPlace),
}

/// One line of the file.
#[derive(Debug, Clone, Copy)]
pub(super) struct Row {
    pub line: usize,
    pub camera_idx: usize,
    pub pose: usize,
    pub label: Label,
    pub pixel: PixelPoint,
    pub sigma_px: Option<f64>,
}

/// A coordinate that is no farther than any measurement goes.
fn near(value: f64, file: &Path, line: usize, column: &'static str) -> Result<f64, CornersError> {
    if value.abs() <= FARTHEST_MM {
        return Ok(value);
    }
    Err(CornersError::FarPlace {
        file: file.to_owned(),
        line,
        column,
        value,
        most_mm: FARTHEST_MM,
    })
}

/// Reads a line.
pub(super) fn parse(
    dataset: &Dataset,
    file: &Path,
    line: usize,
    text: &str,
    columns: Columns,
) -> Result<Row, CornersError> {
    let mut fields = [""; MOST_COLUMNS];
    let mut have = 0;
    for field in text.split(',') {
        if let Some(slot) = fields.get_mut(have) {
            *slot = unquoted(field);
        }
        have += 1;
    }
    if have != columns.count {
        return Err(CornersError::FieldCount {
            file: file.to_owned(),
            line,
            have,
            need: columns.count,
        });
    }
    let not_a = |column, text: &str, expected| CornersError::Number {
        file: file.to_owned(),
        line,
        column,
        text: shortened(text),
        expected,
    };
    let count = |text: &str, column| {
        text.parse::<usize>()
            .map_err(|_| not_a(column, text, "whole number from 0"))
    };
    let number = |text: &str, column| {
        text.parse::<f64>()
            .map_err(|_| not_a(column, text, "number"))
    };
    let finite = |text: &str, column| {
        let value = number(text, column)?;
        if value.is_finite() {
            return Ok(value);
        }
        Err(CornersError::NotFinite {
            file: file.to_owned(),
            line,
            column,
            value,
        })
    };
    let place = |text: &str, column| near(finite(text, column)?, file, line, column);
    let sigma = |text: &str, column| match text {
        "" => Ok(None),
        text => match number(text, column)? {
            value if value.is_finite() && value > 0.0 => Ok(Some(value)),
            value => Err(CornersError::Sigma {
                file: file.to_owned(),
                line,
                column,
                value,
            }),
        },
    };
    let camera_idx = dataset
        .camera_idx(fields[0])
        .ok_or_else(|| CornersError::UnknownCamera {
            file: file.to_owned(),
            line,
            camera: shortened(fields[0]),
            known: dataset.cameras.iter().map(|c| c.name.clone()).collect(),
        })?;
    let pose = count(fields[1], "pose")?;
    let (label, [u, v], sigma_px) = match columns.kind {
        Labels::RowCol => (
            Label::RowCol(count(fields[2], "row")?, count(fields[3], "col")?),
            [fields[4], fields[5]],
            fields[6],
        ),
        Labels::Places => {
            // Adding zero makes one zero of the two that there are.
            let at_mm = Vector3::new(
                place(fields[4], "x_mm")?,
                place(fields[5], "y_mm")?,
                place(fields[6], "z_mm")?,
            ) + Vector3::zeros();
            let sigma_mm = sigma(fields[8], "sigma_mm")?.unwrap_or(0.0);
            (
                Label::Place(KnownPlace { at_mm, sigma_mm }),
                [fields[2], fields[3]],
                fields[7],
            )
        }
    };
    Ok(Row {
        line,
        camera_idx,
        pose,
        label,
        pixel: PixelPoint::new(finite(u, "u")?, finite(v, "v")?),
        sigma_px: sigma(sigma_px, "sigma_px")?,
    })
}
